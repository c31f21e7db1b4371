"""The face that every estimator of a contact shows, and the table of all of them by name.

The command line, ``compare``, the reports and the conformance tests all ask that.
"""

import copy
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.law_verdicts import Candidate, Evidence, LawVerdict
from palpate.force_laws import ForceLaw
from palpate.settings import (
    ChangeDetector,
    Configured,
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    OutlierRejection,
    Scale,
)
from palpate.validation import (
    Floats,
    instance,
    number_in,
    one_of,
    same_length,
    shown,
    signal,
    signals,
)


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
    #: Whether it chooses among laws, and has a verdict on them.
    chooses_law: ClassVar[bool] = False
    #: Whether it gives way to another method of its law that is registered.
    gives_way: ClassVar[bool] = False
    #: Whether it takes what a tare left, and how well the surface is known, from the contact.
    knows_offset: ClassVar[bool] = False

    if TYPE_CHECKING:  # the compiled class, or a method of one's own, brings these

        def update(
            self, penetration: float, velocity: float, force: float, dt: float | None = None
        ) -> _core.Status:
            """Take one sample, and say what was done with it; never raises on data."""

        def _fill(self, trace: Trace, x: Floats, v: Floats, f: Floats, dt: Floats | None) -> None:
            """Take checked arrays sample by sample, and write a trace of them."""

        def predict(self, penetration: float, velocity: float) -> float:
            """Force [N] that the sensor would show by the present estimate."""

        def estimate(self) -> Estimate:
            """What is known now."""

        def reset(self) -> None:
            """Forget everything but the settings."""

        def leave_contact(self) -> None:
            """End the contact; the estimate is held until it is made again."""

        def evidence(self) -> Evidence:
            """What a verdict is worked out from, by a method that chooses a law."""

        @property
        def offered(self) -> tuple[Candidate, ...]:
            """The laws that compete, by a method that chooses one."""

        @property
        def candidate(self) -> Candidate | None:
            """The law in force, by a method that chooses one."""

    def verdict(self) -> LawVerdict | None:
        """Which law it is, by a method that chooses one; None by any other."""
        return None

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

        A compiled one releases the interpreter's lock meanwhile: do not change the arrays from
        another thread.

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
        self._fill(trace, x, v, f, steps)
        return trace

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

    def _fill(self, trace: Trace, x: Floats, v: Floats, f: Floats, dt: Floats | None) -> None:
        learned = trace.parameters, trace.standard_errors
        every = trace.predicted_force, trace.validity_margin, trace.status
        self._replay(x, v, f, dt, *learned, *every, trace.samples)


class PythonEstimator(ContactEstimator):
    """An estimator written in Python: it gives ``update``, ``predict``, ``estimate``, ``reset``
    and ``leave_contact``, keeps its settings in ``_settings`` and what it learned in other
    attributes, and gets the rest from here.
    """

    def _fill(self, trace: Trace, x: Floats, v: Floats, f: Floats, dt: Floats | None) -> None:
        steps = [None] * x.size if dt is None else np.broadcast_to(dt, x.shape).tolist()
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

    def _state(self) -> Any:
        learned = {name: value for name, value in vars(self).items() if name != "_settings"}
        return copy.deepcopy(learned)

    def _restore(self, state: Any) -> None:
        vars(self).update(copy.deepcopy(state))


def _time_steps(dt: "ArrayLike", samples: int) -> Floats:
    """One time step, or as many as there are samples."""
    one = np.isscalar(dt) or (isinstance(dt, np.ndarray) and dt.ndim == 0)
    steps = signal("dt", np.array([dt]) if one else dt)
    if not one:
        same_length(penetration=samples, dt=steps.size)
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


Kind = TypeVar("Kind", bound=type[ContactEstimator])

#: In the order of a table: the default first.
ESTIMATORS: dict[str, type[ContactEstimator]] = {}

# What the face of an estimator has beside what ContactEstimator gives.
_FACE = ("update", "predict", "estimate", "reset", "leave_contact", "_state", "_restore")


def register(kind: Kind) -> Kind:
    """Make an estimator known by its ``method``; a decorator.

    It has to pass the conformance tests, which find it here (``CONTRIBUTING.md``).

    Raises
    ------
    InvalidParameterError
        It is no estimator, lacks a part of the face, or another has its name.
    """
    if not (isinstance(kind, type) and issubclass(kind, ContactEstimator)):
        raise InvalidParameterError(f"estimator must be a ContactEstimator, not {shown(kind)}")
    missing = [name for name in ("method", "law_type", *_FACE) if not hasattr(kind, name)]
    if missing:
        raise InvalidParameterError(f"{kind.__name__} lacks {', '.join(missing)}")
    for name, other in list(ESTIMATORS.items()):
        if other.gives_way and other.law_type is kind.law_type and other is not kind:
            del ESTIMATORS[name]
    if ESTIMATORS.setdefault(kind.method, kind) is not kind:
        raise InvalidParameterError(
            f"method must be new: {kind.method!r} is {ESTIMATORS[kind.method].__name__}"
        )
    return kind


def estimator_named(name: str) -> type[ContactEstimator]:
    """Return the estimator of this name.

    Raises
    ------
    InvalidParameterError
        There is none; the message lists them.
    """
    one_of("method", name, ESTIMATORS)
    return ESTIMATORS[name]


# What every compiled estimator's loop is set by, as the compiled constructors take it.

#: None is off, but in ``identify`` on; False is off there too.
Rejection = OutlierRejection | Literal[False] | None


def loop_settings(
    settings: dict[str, Any], default_scale: Scale, perturbation: tuple[float, ...] = (0.0, 0.0)
) -> tuple[Any, ...]:
    """Check them; an absent detector or rejection costs no memory and no time."""
    forgetting = settings.get("forgetting")
    instance("forgetting", forgetting, (ConstantForgetting, FadingForgetting, type(None)))
    detector, rejection = settings["change_detector"], settings["outlier_rejection"]
    gate, scale = settings["gate"], settings["scale"]
    instance("change_detector", detector, (ChangeDetector, type(None)))
    if not (rejection is None or rejection is False or isinstance(rejection, OutlierRejection)):
        raise InvalidParameterError(
            f"outlier_rejection must be an OutlierRejection, None or False, not {shown(rejection)}"
        )
    instance("gate", gate, (ContactGate, type(None)))
    instance("scale", scale, (Scale, type(None)))
    return (
        (forgetting or ConstantForgetting())._plain(),
        perturbation,
        None if detector is None else detector._plain(),
        rejection._plain() if rejection else None,
        (gate or ContactGate())._plain(),
        (scale or default_scale)._plain(),
        number_in("sample_time", settings["sample_time"], 0.0, 1e6, open_low=True),
    )


def known_exponent(exponent: float | None) -> float | None:
    """Check an exponent that is not to be identified; None where it is."""
    return None if exponent is None else number_in("exponent", exponent, 0.1, 10.0)
