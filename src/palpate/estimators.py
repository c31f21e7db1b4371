"""The paper's recursive estimators: settings, names and words over the compiled recursion.

Each is called once a sample, ``update(penetration, velocity, force)``; ``replay`` is the same
recursion over arrays. The estimator's own numbers (θ, P) live in the units of its ``scale``.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.force_laws import ExtendedKelvinVoigt, ForceLaw, HuntCrossley, KelvinVoigt
from palpate.settings import (
    NO_DETECTION,
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    Forgetting,
    Scale,
    SelfPerturbation,
)
from palpate.trace import Trace
from palpate.validation import (
    Floats,
    covariance_matrix,
    instance,
    number_in,
    signal,
    signals,
)


class ContactEstimator:
    """What every estimator of a contact shares: one sample at a time, or arrays by the same recursion.

    Its subclasses are the methods.
    """

    __slots__ = ()
    method: ClassVar[str]
    law_type: ClassVar[type[ForceLaw]]

    if TYPE_CHECKING:  # the compiled class brings these
        _settings: dict[str, Any]
        _replay: Callable[..., None]
        _state: Callable[[], bytes]
        _restore: Callable[[bytes], None]

        def update(
            self, penetration: float, velocity: float, force: float, dt: float | None = None
        ) -> _core.Status:
            """Take one sample; the compiled method says how."""

        def predict(self, penetration: float, velocity: float) -> float:
            """Force [N] of the present law."""

        def estimate(self) -> _core.Estimate:
            """What is known now."""

        def reset(self) -> None:
            """Forget everything but the settings."""

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments."""
        return dict(self._settings)

    def replay(
        self,
        penetration: ArrayLike,
        velocity: ArrayLike,
        force: ArrayLike,
        dt: ArrayLike | None = None,
    ) -> Trace:
        """Take arrays sample by sample, as ``update`` would, and write everything down.

        Parameters
        ----------
        penetration, velocity, force : array_like, shape (k,)
            m, m/s and N.
        dt : float or array_like, shape (k,), optional
            Time since the previous sample, s; ``sample_time`` unless given.

        Raises
        ------
        InvalidParameterError
            Arrays of different length, of the wrong type or not one-dimensional.
        """
        x, v, f = signals(penetration=penetration, velocity=velocity, force=force)
        steps: Floats | None = None
        if dt is not None:
            steps = signal("dt", np.atleast_1d(np.asarray(dt)))
            if steps.size not in (1, x.size):
                raise InvalidParameterError(
                    "arrays must have the same length: "
                    f"penetration has {x.size}, dt has {steps.size}"
                )
        trace = Trace.empty(x.size, len(self.law_type.symbols))
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
        )
        return trace

    def replace(self, **changes: Any) -> Self:
        """Return a fresh estimator with these settings changed, which has learned nothing."""
        return type(self)(**{**self._settings, **changes})

    def copy(self) -> Self:
        """Return an estimator with the same settings and state, from here on independent."""
        return _restored(type(self), self._settings, self._state())

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self._settings, self._state())

    def __repr__(self) -> str:
        arguments = ", ".join(f"{name}={value!r}" for name, value in self._settings.items())
        return f"{type(self).__name__}({arguments})"


Estimator = TypeVar("Estimator", bound=ContactEstimator)


def _restored(kind: type[Estimator], settings: dict[str, Any], state: bytes) -> Estimator:
    estimator = kind(**settings)
    estimator._restore(state)
    return estimator


class RecursiveLeastSquaresEstimator(ContactEstimator):
    """The settings of the paper's recursive estimators; its subclasses are the methods.

    Parameters
    ----------
    initial : force law, optional
        Where the estimate starts, SI; small values unless given.
    initial_covariance : float or array_like, optional
        P₀ of θ, in units of ``scale``: a scalar, p variances or a p × p matrix, variances in
        [1e-20, 1e20]. The larger, the faster the start and the larger its overshoot.
    forgetting : ConstantForgetting or FadingForgetting, optional
        λ over time; the paper's fading one unless given.
    perturbation : SelfPerturbation, optional
        Reopens the covariance when the material changes (section VII); None never does.
    change_detector : ChangeDetector, optional
        Restarts the estimate when another material is touched; None never does.
    gate : ContactGate, optional
        Which samples are contact. None: every sample with x > 0 and F > 0, and in :func:`identify`
        a gate chosen from the data.
    sample_time : float
        Time between samples where ``update`` is not told, s, in (0, 1e6].
    scale : Scale, optional
        Units of the arithmetic. None: plain SI, and in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
    """

    __slots__ = ()
    default_initial: ClassVar[ForceLaw]
    default_covariance: ClassVar[ArrayLike]

    def __init__(
        self,
        *,
        initial: ForceLaw | None = None,
        initial_covariance: ArrayLike | None = None,
        forgetting: Forgetting | None = None,
        perturbation: SelfPerturbation | None = None,
        change_detector: ChangeDetector | None = None,
        gate: ContactGate | None = None,
        sample_time: float = 1e-3,
        scale: Scale | None = None,
    ) -> None:
        settings: dict[str, Any] = {
            "initial": self.default_initial if initial is None else initial,
            "initial_covariance": (
                self.default_covariance if initial_covariance is None else initial_covariance
            ),
            "forgetting": FadingForgetting() if forgetting is None else forgetting,
            "perturbation": perturbation,
            "change_detector": change_detector,
            "gate": gate,
            "sample_time": sample_time,
            "scale": scale,
        }
        self._settings = settings  # type: ignore[misc]  # a slot of each subclass: two bases with slots would clash
        super().__init__(*self._plain_settings())

    def _plain_settings(self) -> tuple[Any, ...]:
        """The settings, checked, as the compiled constructor takes them."""
        given = self._settings
        instance("initial", given["initial"], self.law_type)
        instance("forgetting", given["forgetting"], (ConstantForgetting, FadingForgetting))
        instance("perturbation", given["perturbation"], (SelfPerturbation, type(None)))
        instance("change_detector", given["change_detector"], (ChangeDetector, type(None)))
        instance("gate", given["gate"], (ContactGate, type(None)))
        instance("scale", given["scale"], (Scale, type(None)))
        covariance = covariance_matrix(
            "initial_covariance", given["initial_covariance"], len(self.law_type.symbols)
        )
        return (
            given["initial"].parameters.tolist(),
            covariance.tolist(),
            given["forgetting"]._plain(),
            (given["perturbation"] or SelfPerturbation(gain=0.0, sensitivity=0.0))._plain(),
            _plain_detector(given["change_detector"]),
            (given["gate"] or ContactGate())._plain(),
            (given["scale"] or Scale())._plain(),
            number_in("sample_time", given["sample_time"], 0.0, 1e6, open_low=True),
        )


class KelvinVoigtRLS(RecursiveLeastSquaresEstimator, _core.KelvinVoigtRLS):
    """The linear contact model by recursive least squares.

    y = F, φ = [x, v], θ = [K, B] in eq. 13. The simplest and quickest to settle; wrong in shape
    wherever stiffness grows with depth.

    Settings are those of :class:`RecursiveLeastSquaresEstimator`; ``initial`` is a :class:`KelvinVoigt`,
    ``initial_covariance`` 1e8 unless given.
    """

    __slots__ = ("_settings",)
    method = "kelvin-voigt"
    law_type = KelvinVoigt
    default_initial = KelvinVoigt(0.1, 0.0)
    default_covariance = 1e8


class ExtendedKelvinVoigtRLS(RecursiveLeastSquaresEstimator, _core.ExtendedKelvinVoigtRLS):
    """The extended Kelvin–Voigt model by recursive least squares.

    y = F, φ = [x, x², v], θ = [K₁, K₂, B] in eq. 13, for the law of eq. 14.

    Settings are those of :class:`RecursiveLeastSquaresEstimator`; ``initial`` is an
    :class:`ExtendedKelvinVoigt`, ``initial_covariance`` 1e10 unless given: in SI x² is so small
    that K₂ never moves under a smaller one.
    """

    __slots__ = ("_settings",)
    method = "extended-kelvin-voigt"
    law_type = ExtendedKelvinVoigt
    default_initial = ExtendedKelvinVoigt(0.1, 0.0, 0.0)
    default_covariance = 1e10


class SingleStageRLS(RecursiveLeastSquaresEstimator, _core.SingleStageRLS):
    """The paper's method: the Hunt–Crossley law, linear in one logarithm.

    y = ln F, φ = [1, v, ln x], θ = [ln K, B/K, n]   (eqs. 9, 12, 13)

    Valid while |v| < 0.1 K/B (eq. 10), which every estimate reports; beyond it K and B are biased
    low. Low-force samples weigh as much as high-force ones, so gate above the noise.

    Settings are those of :class:`RecursiveLeastSquaresEstimator`; ``initial`` is a :class:`HuntCrossley` of
    positive stiffness, ``initial_covariance`` that of θ, 1e3 unless given.
    """

    __slots__ = ("_settings",)
    method = "single-stage"
    law_type = HuntCrossley
    default_initial = HuntCrossley(0.1, 0.0, 1.0)
    default_covariance = 1e3

    def _plain_settings(self) -> tuple[Any, ...]:
        plain = super()._plain_settings()
        stiffness = self._settings["initial"].stiffness
        if not stiffness > 0.0:
            raise InvalidParameterError(
                f"initial stiffness must be in (0, inf), for its logarithm, not {stiffness!r}"
            )
        return plain


class DoubleStageRLS(RecursiveLeastSquaresEstimator, _core.DoubleStageRLS):
    """The double-stage method of Diolaiti, Melchiorri & Stramigioli (2005).

    Stage 1: y = F, φ = [x^n̂, x^n̂ v] → K̂, B̂ (eq. 3).
    Stage 2: y = ln(F / (K̂ + B̂ v)), φ = ln x → n̂ (eq. 4), skipped while K̂ + B̂ v ≤ 0.

    Kept as it is for comparison: from most starts it freezes where K and n trade against each
    other, and only starts within about 10 % of the truth converge.

    Settings are those of :class:`RecursiveLeastSquaresEstimator`; ``initial`` is a :class:`HuntCrossley`,
    ``initial_covariance`` that of [K, B] and n, (1e8, 1e8, 1e3) unless given, with no covariance
    between the stages.
    """

    __slots__ = ("_settings",)
    method = "double-stage"
    law_type = HuntCrossley
    default_initial = HuntCrossley(0.1, 0.0, 1.0)
    default_covariance = (1e8, 1e8, 1e3)

    def _plain_settings(self) -> tuple[Any, ...]:
        plain = super()._plain_settings()
        covariance = plain[1]
        if covariance[0][2] or covariance[1][2]:
            raise InvalidParameterError(
                "initial_covariance must be zero between [K, B] and n: the stages know nothing of "
                f"each other, not {self._settings['initial_covariance']!r}"
            )
        return plain


class VariableProjection(ContactEstimator, _core.VariableProjection):
    """The Hunt–Crossley law by variable projection: exact least squares in the force domain.

    min over (K, B, n, F₀) of Σ (F − K xⁿ − B xⁿ v − F₀)²

    For each exponent of a grid the law is linear in the rest, so a few sums per exponent hold all
    that the samples say; the minimum over n is searched globally and then solved. No logarithm, no
    condition 10, no starting values, and at the Cramér–Rao bound. Accumulating a sample is cheap;
    the solve happens when an estimate is asked for.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of the force, N, > 0. None: estimated from the residual.
    forgetting : ConstantForgetting or FadingForgetting, optional
        None forgets nothing.
    change_detector : ChangeDetector, optional
        Restarts the estimate when another material is touched; None never does.
    offset : bool
        Estimate a constant force offset beside the law: what the removal of the sensor's bias left.
    offset_deviation : float, optional
        How large that offset is expected to be, N, > 0: a prior F₀ ~ N(0, offset_deviation²). None:
        twenty times the noise. What quantisation to steps Δ leaves is (Δ/π) exp(−2π²σ²/Δ²).
    exponent_range : tuple of float
        Where the exponent is looked for: (lowest, highest), within [0.1, 10], 0.2 to 5 apart.
    gate : ContactGate, optional
        Which samples are contact. None: every sample with x > 0 and F > 0, and in :func:`identify`
        a gate chosen from the data.
    sample_time : float
        Time between samples where ``update`` is not told, s, in (0, 1e6].
    scale : Scale, optional
        Units of the arithmetic, near the largest values to come. None: 10 mm, 20 mm/s and 1 N, and
        in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.
    """

    __slots__ = ("_settings",)
    method = "variable-projection"
    law_type = HuntCrossley

    def __init__(
        self,
        *,
        noise: float | None = None,
        forgetting: Forgetting | None = None,
        change_detector: ChangeDetector | None = None,
        offset: bool = True,
        offset_deviation: float | None = None,
        exponent_range: tuple[float, float] = (0.3, 3.6),
        gate: ContactGate | None = None,
        sample_time: float = 1e-3,
        scale: Scale | None = None,
    ) -> None:
        settings = {
            "noise": noise,
            "forgetting": forgetting,
            "change_detector": change_detector,
            "offset": offset,
            "offset_deviation": offset_deviation,
            "exponent_range": exponent_range,
            "gate": gate,
            "sample_time": sample_time,
            "scale": scale,
        }
        instance("forgetting", forgetting, (ConstantForgetting, FadingForgetting, type(None)))
        instance("change_detector", change_detector, (ChangeDetector, type(None)))
        instance("offset", offset, bool)
        instance("gate", gate, (ContactGate, type(None)))
        instance("scale", scale, (Scale, type(None)))
        self._settings = settings
        super().__init__(
            0.0 if noise is None else number_in("noise", noise, 0.0, 1e30, open_low=True),
            _checked_range(exponent_range),
            offset,
            0.0
            if offset_deviation is None
            else number_in("offset_deviation", offset_deviation, 0.0, 1e30, open_low=True),
            (forgetting or ConstantForgetting())._plain(),
            _plain_detector(change_detector),
            (gate or ContactGate())._plain(),
            (scale or Scale(penetration=10e-3, velocity=20e-3, force=1.0))._plain(),
            number_in("sample_time", sample_time, 0.0, 1e6, open_low=True),
        )


def _plain_detector(detector: ChangeDetector | None) -> tuple[float, ...]:
    return NO_DETECTION if detector is None else detector._plain()


def _checked_range(exponent_range: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = (number_in("exponent_range", n, 0.1, 10.0) for n in exponent_range)
    except (TypeError, ValueError):
        raise InvalidParameterError(
            f"exponent_range must be (lowest, highest) within [0.1, 10], not {exponent_range!r}"
        ) from None
    if not 0.2 <= high - low <= 5.0:
        raise InvalidParameterError(
            f"exponent_range must be 0.2 to 5 wide, not {exponent_range!r}: it holds "
            f"{'nothing' if high <= low else 'too little or too much'}"
        )
    return low, high
