"""The face that every estimator of a contact shows."""

import copy
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.estimators.estimate import Estimate, Trace
from palpate.force_laws import ForceLaw
from palpate.settings import Configured
from palpate.validation import Floats, shown, signal, signals


class ContactEstimator(Configured):
    """What estimators have in common: samples one at a time, or arrays by the same recursion.

    Its subclasses are the methods. Settings are the constructor's keyword arguments; what was
    learned is kept separately, and :meth:`replace` forgets it.
    """

    __slots__ = ()
    #: What the command line calls the method.
    method: ClassVar[str]
    #: The force law that it identifies.
    law_type: ClassVar[type[ForceLaw]]
    #: Whether its answer is biased where condition 10 of the paper does not hold.
    needs_condition_10: ClassVar[bool] = False
    #: Of what it minimises the squares, where its error bars take that for white noise.
    minimises: ClassVar[Literal["force", "logarithm"] | None] = None
    #: Whether it chooses its samples itself, and wants no gate chosen from the data.
    chooses_samples: ClassVar[bool] = False
    #: The known exponents that it can keep.
    exponents: ClassVar[tuple[float, float]] = (0.1, 10.0)
    #: Whether it takes what a tare left, and how well the surface is known, from the contact.
    knows_offset: ClassVar[bool] = False

    if TYPE_CHECKING:  # the compiled class, or a method of one's own, brings these

        def update(
            self, penetration: float, velocity: float, force: float, dt: float | None = None
        ) -> _core.Status:
            """Take one sample, and say what was done with it; never raises on data."""

        def replay(
            self,
            penetration: "ArrayLike",
            velocity: "ArrayLike",
            force: "ArrayLike",
            dt: "ArrayLike | None" = None,
            *,
            at: "ArrayLike | None" = None,
        ) -> Trace:
            """Take arrays sample by sample, as ``update`` would, and write everything down."""

        def predict(self, penetration: float, velocity: float) -> float:
            """Force [N] that the sensor would show by the present estimate."""

        def estimate(self) -> Estimate:
            """What is known now."""

        def reset(self) -> None:
            """Forget everything but the settings."""

        def leave_contact(self) -> None:
            """End the contact; the estimate is held until it is made again."""

    @property
    def fixed(self) -> tuple[str, ...]:
        """The law's parameters that its settings give, and that are not identified."""
        return ("exponent",) if self._settings.get("exponent") is not None else ()

    def replace(self, **changes: Any) -> Self:
        """Return a fresh estimator with these settings changed, which has learned nothing."""
        return type(self)(**{**self._settings, **changes})


class CompiledEstimator(ContactEstimator):
    """An estimator whose recursion is compiled; ``update`` never allocates.

    Threads may use one together: each call is taken whole, and waits while another thread replays.
    """

    __slots__ = ()

    if TYPE_CHECKING:  # the compiled class brings these

        def _estimate(self) -> _core.EstimateValue: ...
        def _replay(self, *arrays: Any) -> None: ...

    def estimate(self) -> Estimate:
        """Return what is known now."""
        return Estimate(self._estimate(), self.law_type, self.fixed)

    def replay(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        force: "ArrayLike",
        dt: "ArrayLike | None" = None,
        *,
        at: "ArrayLike | None" = None,
    ) -> Trace:
        """Take arrays sample by sample, as ``update`` would, and write everything down.

        The interpreter's lock is released meanwhile: do not change the arrays from another thread.

        Parameters
        ----------
        penetration, velocity, force : array_like, shape (k,)
            m, m/s and N.
        dt : float or array_like, shape (k,), optional
            Time since the previous sample, s; ``sample_time`` unless given.
        at : array_like of int, shape (m,), optional
            The samples after which the estimate is written down, rising from 0 on (default: every
            one). The fewer, the quicker, where an estimate costs more than a sample.

        Raises
        ------
        InvalidParameterError
            Arrays of different length, of the wrong type or not one-dimensional; or ``at`` names
            what is no sample, or not in their order.
        """
        x, v, f = signals(penetration=penetration, velocity=velocity, force=force)
        steps = None if dt is None else _time_steps(dt, x.size)
        trace = Trace.empty(x.size, len(self.law_type.symbols), _rows(at, x.size))
        self._replay(
            x,
            v,
            f,
            steps,
            trace.parameters,
            trace.standard_errors,
            trace.predicted_force,
            trace.validity_margin,
            trace.status,
            trace.samples,
        )
        return trace


class PythonEstimator(ContactEstimator):
    """An estimator written in Python: it gives ``update``, ``predict``, ``estimate``, ``reset``
    and ``leave_contact``, keeps its settings in ``_settings`` and what it learned in other
    attributes, and gets the rest from here.
    """

    def replay(
        self,
        penetration: "ArrayLike",
        velocity: "ArrayLike",
        force: "ArrayLike",
        dt: "ArrayLike | None" = None,
        *,
        at: "ArrayLike | None" = None,
    ) -> Trace:
        """Take arrays sample by sample by ``update``, and write everything down.

        Arguments and errors are those of :meth:`CompiledEstimator.replay`.
        """
        x, v, f = signals(penetration=penetration, velocity=velocity, force=force)
        steps: list[float | None] = [None] * x.size
        if dt is not None:
            steps = np.broadcast_to(_time_steps(dt, x.size), x.shape).tolist()
        trace = Trace.empty(x.size, len(self.law_type.symbols), _rows(at, x.size))
        places = {sample: row for row, sample in enumerate(trace.after.tolist())}
        rows = zip(x.tolist(), v.tolist(), f.tolist(), steps, strict=True)
        for k, (depth, speed, push, step) in enumerate(rows):
            finite = np.isfinite((depth, speed, push)).all()
            trace.predicted_force[k] = self.predict(depth, speed) if finite else np.nan
            trace.status[k] = self.update(depth, speed, push, step)
            row = places.get(k)
            if row is None and not self.law_type.has_condition_10:
                trace.validity_margin[k] = 1.0
                continue
            estimate = self.estimate()
            trace.validity_margin[k] = estimate.validity_margin
            if row is not None:
                trace.parameters[row] = estimate.parameters
                trace.standard_errors[row] = estimate.standard_errors
        return trace

    def _state(self) -> Any:
        learned = {name: value for name, value in vars(self).items() if name != "_settings"}
        return copy.deepcopy(learned)

    def _restore(self, state: Any) -> None:
        vars(self).update(copy.deepcopy(state))


def _time_steps(dt: "ArrayLike", samples: int) -> Floats:
    """One time step, or as many as there are samples."""
    one = np.isscalar(dt) or (isinstance(dt, np.ndarray) and dt.ndim == 0)
    steps = signal("dt", np.array([dt]) if one else dt)
    if not one and steps.size != samples:
        raise InvalidParameterError(
            f"arrays must have the same length: penetration has {samples}, dt has {steps.size}"
        )
    return steps


def _rows(at: "ArrayLike | None", samples: int) -> NDArray[np.int64] | None:
    """The samples after which a trace has the estimate; None: after each."""
    if at is None:
        return None
    given = signal("at", at)
    rows = given.astype(np.int64) if np.isfinite(given).all() else np.array([-1])
    sound = (rows >= 0).all() and (rows < samples).all() and (np.diff(rows) > 0).all()
    if not sound or not np.array_equal(rows, given):
        raise InvalidParameterError(
            f"at must be samples in their order, whole numbers in [0, {samples}), not {shown(at)}"
        )
    return rows
