"""Settings that estimators share: contact gate, forgetting, outlier rejection, scaling."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.validation import Floats, Mask, check_field, frozen, shown

# The C++ headers define and explain each default.
_FADING = _core.defaults["FadingForgetting"]
_PERTURBATION = _core.defaults["SelfPerturbation"]
_DETECTOR = _core.defaults["ChangeDetector"]
_REJECTION = _core.defaults["OutlierRejection"]
#: Default time between samples in ``update``, s.
SAMPLE_TIME: float = _core.defaults["loop"]["sample_time"]
#: Axes of a force: those of the tool, or of the position.
ForceFrame = Literal["tool", "base"]


class _Numbers:
    """A setting whose fields are numbers, in the order of the compiled constructor."""

    __slots__ = ()

    def _plain(self) -> tuple[float, ...]:
        own: Any = self  # each subclass is a dataclass
        return tuple(float(getattr(self, field.name) or 0.0) for field in fields(own))


@frozen
class ContactGate(_Numbers):
    """The rule for which samples are in contact.

    Contact begins above ``make_force`` and ends at or below ``break_force``; a sample in contact is
    also deeper than ``minimum_penetration``. Outside contact the estimator keeps its estimate.

    Near the surface, noise biases the logarithm of the force, E ln(F + ε) ≈ ln F − σ²/2F²: set
    ``break_force`` to about ten times the force noise.

    Parameters
    ----------
    minimum_penetration : float
        m, ≥ 0.
    make_force, break_force : float
        N, 0 ≤ break_force ≤ make_force. Default of ``break_force``: 0.8 × ``make_force``.

    Examples
    --------
    >>> import palpate
    >>> gate = palpate.ContactGate(make_force=0.5)
    >>> gate.break_force
    0.4
    >>> gate.makes(penetration=1e-3, force=0.6)
    True
    """

    minimum_penetration: float = 0.0
    make_force: float = 0.0
    break_force: float | None = None

    def __post_init__(self) -> None:
        make = check_field(self, "make_force", 0.0, 1e100)
        break_force = self.break_force
        if break_force is None:
            object.__setattr__(self, "break_force", 0.8 * make)
        if check_field(self, "break_force", 0.0, 1e100) > make:
            raise InvalidParameterError(
                f"break_force must be in [0, make_force = {make:g}], not {shown(break_force)}"
            )
        check_field(self, "minimum_penetration", 0.0, 1e100)

    def makes(self, penetration: Floats, force: Floats) -> Mask:
        """Whether each sample is deep and firm enough to begin contact."""
        found: Mask = penetration > self.minimum_penetration
        return found & (force > self.make_force)


@frozen
class ConstantForgetting:
    """A constant forgetting factor λ; 1 forgets nothing (plain RLS).

    With a constant factor below 1 the covariance winds up whenever the motion stops exciting the
    estimator (the paper: "instability occurs"); ``docs/reference/numerics.md`` explains the guard
    against it.

    Parameters
    ----------
    factor : float
        λ per sample, in (0, 1].

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.KelvinVoigtRLS(forgetting=palpate.ConstantForgetting(factor=0.999))
    >>> result = palpate.identify("examples/recordings/ball.csv", estimator)
    >>> round(result.law.K, -1)
    2000.0
    """

    factor: float = 1.0

    def __post_init__(self) -> None:
        check_field(self, "factor", 0.0, 1.0, open_low=True)

    def _plain(self) -> tuple[float, ...]:
        return self.factor, 0.0


@frozen
class FadingForgetting(_Numbers):
    """Forgetting that fades from contact onset: λ(t) = 1 − (1 − λ₀) e^(−α t), section V-A-3.

    Parameters
    ----------
    initial_factor : float
        λ₀ per sample, in (0, 1].
    rate : float
        α, 1/s, > 0. The paper finds 5 to 8 good and 0.1 unstable.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.SingleStageRLS(forgetting=palpate.FadingForgetting(rate=8.0))
    >>> result = palpate.identify("examples/recordings/ball.csv", estimator)
    >>> round(result.law.n, 2)
    1.0
    """

    initial_factor: float = _FADING["initial_factor"]
    rate: float = _FADING["rate"]

    def __post_init__(self) -> None:
        check_field(self, "initial_factor", 0.0, 1.0, open_low=True)
        check_field(self, "rate", 0.0, 1e6, open_low=True)


Forgetting = ConstantForgetting | FadingForgetting


@frozen
class SelfPerturbation(_Numbers):
    """Self-perturbing least squares (Park & Jun 1992), section VII.

    P ← (1/λ) [P − L gᵀ + β NINT(γ e²) I], and λ returns to λ₀ whenever NINT(γ e²) > 0; e is the
    one-step prediction error of the force, N. Errors below √(0.5/γ) do not perturb P.

    Parameters
    ----------
    gain : float
        β, in the units of P, ≥ 0.
    sensitivity : float
        γ, 1/N², ≥ 0.

    Examples
    --------
    >>> import palpate
    >>> perturbation = palpate.SelfPerturbation(gain=0.05, sensitivity=2.5)
    >>> estimator = palpate.SingleStageRLS(perturbation=perturbation)
    >>> estimator.settings["perturbation"].gain
    0.05
    """

    gain: float = _PERTURBATION["gain"]
    sensitivity: float = _PERTURBATION["sensitivity"]

    def __post_init__(self) -> None:
        check_field(self, "gain", 0.0, 1e20)
        check_field(self, "sensitivity", 0.0, 1e40)


@frozen
class ChangeDetector(_Numbers):
    """Detects that the probe touches another material, and restarts the estimate.

    z = min(e²/s², 25);  g ← max(0, g + z − drift);  alarm at g > threshold   (Page's CUSUM)

    e is the one-step prediction error of the force, whitened with its autocorrelation; s² follows
    e² slowly. A second sum uses the errors before whitening, for materials that the law cannot
    describe. Either alarms only once a change of stiffness and damping explains the errors since it
    was zero, which a burst of noise does not. A third uses blocks of errors: it detects small
    changes, as of the damping or the exponent alone. Each alarms only above the highest value from
    which it has returned before, and only at depths and speeds of earlier strokes: elsewhere an
    error says more about the law than about a change.

    After an alarm the estimate restarts from the samples since g was last zero, with the old value
    as a prior. Variable projection keeps the force offset and, if it was identifiable, the exponent
    as n ~ N(n̂, 0.02²) until the samples reject it (then N(n̂, 0.3²)); recursive least squares
    keeps θ̂ with its initial covariance.

    Parameters
    ----------
    drift : float
        Average of z above which g grows, 1 to 24. White noise has 1.
    threshold : float
        Alarm level of g, > 0. A higher level gives fewer false alarms and later detection.
    noise : float, optional
        Lower bound of s, N, > 0: the noise of the sensor. Default: from the first errors.
    adaptation : float
        Fraction of the way from s² to e² per sample, in [0, 1].
    warm_up : int
        Samples without alarms at the start, 10 to 1e6. The first half gives the noise and its
        correlation. The second half, again from 300 samples after each change, gives the size of
        the errors without a change.
    transition : int
        Samples over which the velocity filter smears a change, 0 to 100: the length of a centred
        filter; 0 for a measured velocity. After twice as many samples a second reset keeps only the
        latest of them.

    Examples
    --------
    >>> import palpate
    >>> detector = palpate.ChangeDetector(threshold=100.0)
    >>> estimator = palpate.VariableProjection(change_detector=detector)
    >>> palpate.identify("examples/recordings/ball.csv", estimator).changes.size
    0
    """

    drift: float = _DETECTOR["drift"]
    threshold: float = _DETECTOR["threshold"]
    noise: float | None = None
    adaptation: float = _DETECTOR["adaptation"]
    warm_up: int = _DETECTOR["warm_up"]
    transition: int = _DETECTOR["transition"]

    def __post_init__(self) -> None:
        check_field(self, "drift", 1.0, 24.0)
        check_field(self, "threshold", 0.0, 1e12, open_low=True)
        if self.noise is not None:
            check_field(self, "noise", 0.0, 1e30, open_low=True)
        check_field(self, "adaptation", 0.0, 1.0)
        check_field(self, "warm_up", 10, 1_000_000, whole=True)
        check_field(self, "transition", 0, 100, whole=True)


@frozen
class OutlierRejection:
    """Rejects physically impossible samples: dropouts, spikes and a saturated sensor.

    Dropouts and velocity spikes are detected by x − x_p − ½(v + v_p) T; force spikes by F − F_p;
    saturation by five or more equal forces at the top while the predicted force changes. x_p, v_p,
    F_p is the last accepted sample, T the time since then. Each quantity is compared with its own
    running median in contact and with its previous deviation. Force steps within a tenth of the
    median force and motions within 1.2 times the median speed are never outliers.

    At most 3 forces or 20 motions are rejected in a row: what lasts longer is another material or
    place and is accepted, so a :class:`ChangeDetector` sees it that much later.

    Parameters
    ----------
    threshold : float
        Outlier limit in standard deviations, 3 to 1e6.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.VariableProjection(outlier_rejection=palpate.OutlierRejection(5.0))
    >>> result = palpate.identify("examples/recordings/ball.csv", estimator)
    >>> result.estimate.rejected
    0
    """

    threshold: float = _REJECTION["threshold"]

    def __post_init__(self) -> None:
        check_field(self, "threshold", 3.0, 1e6)

    def _plain(self) -> float:
        return self.threshold


@frozen
class Scale(_Numbers):
    """Units of the arithmetic: the estimator divides its inputs by them and returns laws in SI.

    An initial covariance is in scaled units. ``Scale()`` is plain SI, as in the paper.

    Parameters
    ----------
    penetration, velocity, force : float
        m, m/s and N; in [1e-30, 1e30]. Best close to the largest values of a recording.

    Examples
    --------
    >>> import palpate
    >>> scale = palpate.Scale(penetration=1e-6, velocity=1e-5, force=1e-7)  # a microscope's
    >>> estimator = palpate.VariableProjection(scale=scale)
    >>> result = palpate.identify("examples/recordings/microscale.csv", estimator)
    >>> round(result.law.n, 2)
    1.5
    """

    penetration: float = 1.0
    velocity: float = 1.0
    force: float = 1.0

    def __post_init__(self) -> None:
        for name in ("penetration", "velocity", "force"):
            check_field(self, name, 1e-30, 1e30)


class Configured:
    """Keyword settings and a state that samples change; copies and pickles keep both."""

    __slots__ = ()

    if TYPE_CHECKING:  # the compiled class, or a user's own, provides these
        _settings: dict[str, Any]

        def _state(self) -> bytes: ...
        def _restore(self, state: bytes) -> None: ...

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments."""
        return dict(self._settings)

    def copy(self) -> Self:
        """Return an independent copy with the same settings and state."""
        return _restore_object(type(self), self._settings, self._state())

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore_object, (type(self), self._settings, self._state())

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self._settings.items())
        return f"{type(self).__name__}({given})"


Kind = TypeVar("Kind", bound=Configured)


def _restore_object(kind: type[Kind], settings: dict[str, Any], state: Any) -> Kind:
    made = kind(**settings)
    try:
        made._restore(state)
    except (TypeError, ValueError) as error:
        raise InvalidParameterError(f"{kind.__name__}: {error}") from None
    return made
