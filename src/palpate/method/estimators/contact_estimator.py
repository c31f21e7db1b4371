"""The interface of every contact estimator, and the table of all estimators by name.

The command line, ``compare``, the reports and the conformance tests all use that table.
"""

import copy
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.method.estimators.law_verdicts import Candidate, Evidence, LawVerdict
from palpate.method.settings import (
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
    Integers,
    check_choice,
    instance,
    number_in,
    pair_in,
    same_length,
    shown,
    signal,
    signals,
)

#: Bounds of stiffness, N/m, and damping, N·s/m.
ResponsePrior = tuple[tuple[float, float], tuple[float, float]]


class ContactEstimator(Configured):
    """Base class of all estimators: samples one at a time, or arrays through the same recursion.

    Each subclass is one method. Settings are the constructor's keyword arguments, separate from the
    learned state; :meth:`replace` keeps only the settings.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.ESTIMATORS["variable-projection"](exponent=1.5)
    >>> isinstance(estimator, palpate.ContactEstimator), estimator.fixed
    (True, ('n',))
    >>> estimator.replace(exponent=2.0).settings["exponent"]
    2.0
    """

    __slots__ = ()
    #: Name of the method on the command line.
    method: ClassVar[str]
    #: The force law that it identifies.
    law_type: ClassVar[type[ForceLaw]]
    #: Whether its result is biased where condition 10 of the paper does not hold.
    needs_condition_10: ClassVar[bool] = False
    #: The residual whose squares it minimises, if its error bars assume that residual to be white.
    minimises: ClassVar[Literal["force", "logarithm"] | None] = None
    #: Whether it chooses its samples itself and needs no gate chosen from the data.
    chooses_samples: ClassVar[bool] = False
    #: Range of a known exponent.
    exponents: ClassVar[tuple[float, float]] = (0.1, 10.0)
    #: Whether it selects among several laws and returns a verdict on them.
    chooses_law: ClassVar[bool] = False
    #: Whether another registered method of the same law replaces it.
    gives_way: ClassVar[bool] = False
    #: Whether it identifies the spring of a curve without time.
    works_without_time: ClassVar[bool] = False
    #: Whether it uses the contact's uncertainty of the force offset and of the surface position.
    knows_offset: ClassVar[bool] = False

    if TYPE_CHECKING:  # the compiled class, or the user's own method, defines these

        def update(
            self,
            penetration: float,
            velocity: float,
            force: float,
            dt: float | None = None,
        ) -> _core.Status:
            """Take one sample and return its status; never raises on data."""

        def _fill(self, trace: Trace, x: Floats, v: Floats, f: Floats, dt: Floats | None) -> None:
            """Take checked arrays sample by sample, and fill the trace."""

        def predict(self, penetration: float, velocity: float) -> float:
            """Force [N] that the present estimate predicts for the sensor, offset included."""

        def estimate(self) -> Estimate:
            """The current estimate."""

        def reset(self) -> None:
            """Forget everything but the settings."""

        def leave_contact(self) -> None:
            """End the contact; the estimate is held until the next contact."""

        def evidence(self) -> Evidence:
            """The numbers from which a verdict is computed; only if the method selects a law."""

        def pack_verdict(self, *, with_estimate: bool = True) -> dict[str, Any]:
            """The same, and the estimate, as JSON types; only if the method selects a law."""

    @property
    def offered(self) -> tuple[Candidate, ...]:
        """The competing laws if the method selects one; otherwise none."""
        return ()

    @property
    def candidate(self) -> Candidate | None:
        """The law selected so far if the method selects one; otherwise None."""
        return None

    def verdict(self) -> LawVerdict | None:
        """The verdict on the best law if the method selects one; otherwise None."""
        return None

    def second_pass(self) -> Self | None:
        """Return a fresh estimator that knows what this one learned of the sensor; else None."""
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
        """Take arrays sample by sample, as ``update`` would, and record a trace.

        A compiled estimator releases the interpreter's lock meanwhile: do not change the arrays
        from another thread.

        Parameters
        ----------
        penetration, velocity, force : array_like, shape (k,)
            m, m/s and N.
        dt : float or array_like, shape (k,), optional
            Time since the previous sample, s. Default: ``sample_time``.
        at : array_like of int, shape (m,), optional
            Indices, from 0 and rising, of the samples after which the trace contains the estimate.
            Fewer are faster if an estimate costs more than a sample. Default: every sample.

        Raises
        ------
        InvalidParameterError
            The arrays differ in length, have the wrong type or are not one-dimensional; or ``at``
            is not a rising sequence of sample indices.
        """
        x, v, f = signals(penetration=penetration, velocity=velocity, force=force)
        steps = None if dt is None else _time_steps(dt, x.size)
        trace = Trace.empty(x.size, len(self.law_type.symbols), _rows(at, x.size))
        self._fill(trace, x, v, f, steps)
        return trace

    @property
    def rejects_outliers(self) -> bool:
        """Whether outliers, and samples whose load is carried elsewhere, are excluded."""
        return self.settings.get("outlier_rejection") is not False

    @property
    def fixed(self) -> tuple[str, ...]:
        """Names of the law's parameters that the settings fix; they are not identified."""
        return ("n",) if self._settings.get("exponent") is not None else ()

    def replace(self, **changes: Any) -> Self:
        """Return a new estimator with these settings changed and no samples taken."""
        return type(self)(**{**self._settings, **changes})


class CompiledEstimator(ContactEstimator):
    """An estimator whose recursion is compiled; ``update`` never allocates.

    Several threads may use one estimator: each call runs alone and waits for other threads' calls.
    """

    __slots__ = ()
    #: The class of its estimates.
    estimate_type: ClassVar[type[Estimate]] = Estimate

    if TYPE_CHECKING:  # the compiled class defines these

        def _estimate(self, kind: type, depth: float, bounds: Sequence[float]) -> Any: ...
        def _replay(self, *arrays: Any) -> None: ...

    def estimate(self, at: float | None = None, prior: ResponsePrior | None = None) -> Estimate:
        """Return the current estimate.

        Parameters
        ----------
        at : float, optional
            Depth of ``stiffness`` and ``damping``, m, > 0. Default: that of the latest sample.
        prior : tuple of two pairs of floats, optional
            Bounds that are known of the stiffness, N/m, and of the damping, N·s/m, as
            ((least, largest), (least, largest)). Default: from 0.

        Raises
        ------
        InvalidParameterError
            The depth or a bound is outside its range.
        """
        estimate: Estimate = self._estimate(self.estimate_type, *_response_settings(at, prior))
        self._name(estimate)
        return estimate

    def _name(self, estimate: Any) -> None:
        """Give an estimate the names of its law."""
        estimate._law_type = self.law_type
        estimate.fixed = self.fixed
        estimate._law = None

    def _fill(self, trace: Trace, x: Floats, v: Floats, f: Floats, dt: Floats | None) -> None:
        learned = trace.parameters, trace.standard_errors
        every = trace.predicted_force, trace.validity_margin, trace.status
        self._replay(x, v, f, dt, *learned, *every, trace.samples)


class PythonEstimator(ContactEstimator):
    """Base class of an estimator written in Python.

    A subclass defines ``update``, ``predict``, ``estimate``, ``reset`` and ``leave_contact``, and
    keeps its settings in ``_settings`` and its learned state in other attributes.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> class Spring(palpate.PythonEstimator):
    ...     method, law_type = "spring", palpate.KelvinVoigt
    ...
    ...     def __init__(self):
    ...         self._settings = {}
    ...         self.reset()
    ...
    ...     def reset(self):
    ...         self.K, self.samples = 0.0, 0
    ...
    ...     def update(self, penetration, velocity, force, dt=None):
    ...         if not (penetration > 0.0 and force > 0.0):
    ...             return palpate.Status.WAITING
    ...         self.samples += 1
    ...         self.K += (force / penetration - self.K) / self.samples
    ...         return palpate.Status.UPDATED
    ...
    ...     def predict(self, penetration, velocity):
    ...         return self.K * penetration
    ...
    ...     def estimate(self):
    ...         law, unknown = palpate.KelvinVoigt(K=self.K, B=0.0), np.zeros((2, 2))
    ...         return palpate.Estimate.from_law(
    ...             law, unknown, status=palpate.Status.UPDATED, samples=self.samples
    ...         )
    ...
    ...     def leave_contact(self):
    ...         pass
    >>> trace = Spring().replay([1e-3, 2e-3], [0.1, 0.1], [1.4, 3.2])
    >>> trace.parameters[-1].tolist()
    [1500.0, 0.0]
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


_UNKNOWN_RESPONSE = math.nan, (0.0, 1e100, 0.0, 1e100)


def _response_settings(
    at: float | None,
    prior: ResponsePrior | None,
) -> tuple[float, tuple[float, ...]]:
    """Check the depth and the bounds of a response for the compiled estimate."""
    if at is None and prior is None:
        return _UNKNOWN_RESPONSE
    depth = math.nan if at is None else number_in("at", at, 0.0, 1e100, open_low=True)
    if prior is None:
        return depth, _UNKNOWN_RESPONSE[1]
    if not (isinstance(prior, tuple | list) and len(prior) == 2):
        raise InvalidParameterError(
            f"prior must be ((least, largest) stiffness, (least, largest) damping), not "
            f"{shown(prior)}"
        )
    pairs = [
        pair_in(f"prior {name}", pair, 0.0, 1e100)
        for name, pair in zip(("stiffness", "damping"), prior, strict=True)
    ]
    for least, largest in pairs:
        if not least <= largest:
            raise InvalidParameterError(f"prior must be from least to largest, not {shown(prior)}")
    return depth, (*pairs[0], *pairs[1])


def _time_steps(dt: "ArrayLike", samples: int) -> Floats:
    """The time steps: a single one, or one for each sample."""
    one = np.isscalar(dt) or (isinstance(dt, np.ndarray) and dt.ndim == 0)
    steps = signal("dt", np.array([dt]) if one else dt)
    if not one:
        same_length(penetration=samples, dt=steps.size)
    return steps


def _rows(at: "ArrayLike | None", samples: int) -> Integers | None:
    """Indices of the samples after which a trace contains the estimate; None: all samples."""
    if at is None:
        return None
    indices = signal("at", at)
    rows = indices.astype(np.int64) if np.isfinite(indices).all() else np.array([-1])
    valid = (rows >= 0).all() and (rows < samples).all() and (np.diff(rows) > 0).all()
    if not valid or not np.array_equal(rows, indices):
        raise InvalidParameterError(
            f"at must be rising sample indices, whole numbers in [0, {samples}), not {shown(at)}"
        )
    return rows


Kind = TypeVar("Kind", bound=type[ContactEstimator])


class EstimatorRegistry(dict[str, type[ContactEstimator]]):
    """Estimators by their ``method``; the default comes first.

    Examples
    --------
    >>> import palpate
    >>> palpate.ESTIMATORS["single-stage"]
    <class 'palpate.method.estimators.recursive_least_squares.SingleStageRLS'>
    """


#: All registered estimators.
ESTIMATORS = EstimatorRegistry()

# Attributes that an estimator must define in addition to those of ContactEstimator.
_FACE = ("update", "predict", "estimate", "reset", "leave_contact", "_state", "_restore")


def register(kind: Kind) -> Kind:
    """Register an estimator under its ``method``; a decorator.

    The conformance tests check every registered estimator (``CONTRIBUTING.md``).

    Raises
    ------
    InvalidParameterError
        It is not an estimator, lacks an attribute, or another estimator has its name.
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
            f"method {kind.method!r} is taken by {ESTIMATORS[kind.method].__name__}: choose another"
        )
    return kind


def estimator_named(name: str) -> type[ContactEstimator]:
    """Return the estimator of this name.

    Raises
    ------
    InvalidParameterError
        No estimator has this name; the message lists those that exist.
    """
    check_choice("method", name, ESTIMATORS)
    return ESTIMATORS[name]


# The settings of every compiled estimator's loop, as the compiled constructors expect them.

#: None: off, but on in ``identify``; False: off there too.
Rejection = OutlierRejection | Literal[False] | None


def loop_settings(
    settings: dict[str, Any],
    default_scale: Scale,
    perturbation: tuple[float, ...] = (0.0, 0.0),
) -> tuple[Any, ...]:
    """Check the loop's settings; an absent detector or rejection costs no memory and no time."""
    forgetting = settings.get("forgetting")
    instance("forgetting", forgetting, (ConstantForgetting, FadingForgetting, type(None)))
    detector = settings["change_detector"]
    rejection = settings["outlier_rejection"]
    gate = settings["gate"]
    scale = settings["scale"]
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


def check_exponent(exponent: float | None) -> float | None:
    """Check a known exponent; None: the exponent is to be identified."""
    return None if exponent is None else number_in("exponent", exponent, 0.1, 10.0)
