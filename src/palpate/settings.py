"""Settings that estimators share: the gate, how the past is forgotten, the units."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.validation import Floats, kept, shown

# Each default stands once, in the C++ headers, with its reason.
_FADING = _core.defaults["FadingForgetting"]
_PERTURBATION = _core.defaults["SelfPerturbation"]
_DETECTOR = _core.defaults["ChangeDetector"]
_REJECTION = _core.defaults["OutlierRejection"]
#: Time between samples where ``update`` is given none, s.
SAMPLE_TIME: float = _core.defaults["loop"]["sample_time"]


class _Numbers:
    """A setting of plain numbers: as the compiled constructors take it, in their order."""

    __slots__ = ()

    def _plain(self) -> tuple[float, ...]:
        own: Any = self  # which each subclass makes a dataclass
        return tuple(float(getattr(self, each.name) or 0.0) for each in fields(own))


@dataclass(frozen=True, slots=True)
class ContactGate(_Numbers):
    """Which samples are contact.

    Contact is made above ``make_force`` and lost at or below ``break_force``; a sample also has to
    be deeper than ``minimum_penetration``. Outside contact an estimate is held, never erased.

    Near the surface noise biases a logarithm, E ln(F + ε) ≈ ln F − σ²/2F²: put ``break_force`` at
    about ten times the force noise.

    Parameters
    ----------
    minimum_penetration : float
        m, ≥ 0.
    make_force, break_force : float
        N, 0 ≤ break_force ≤ make_force. ``break_force=None`` means 0.8 × ``make_force``.
    """

    minimum_penetration: float = 0.0
    make_force: float = 0.0
    break_force: float | None = None

    def __post_init__(self) -> None:
        make = kept(self, "make_force", 0.0, 1e100)
        given = self.break_force
        if given is None:
            object.__setattr__(self, "break_force", 0.8 * make)
        if kept(self, "break_force", 0.0, 1e100) > make:
            raise InvalidParameterError(
                f"break_force must be in [0, make_force = {make:g}], not {shown(given)}"
            )
        kept(self, "minimum_penetration", 0.0, 1e100)

    def makes(self, penetration: Floats, force: Floats) -> NDArray[np.bool_]:
        """Whether contact is made at each sample."""
        found: NDArray[np.bool_] = penetration > self.minimum_penetration
        return found & (force > self.make_force)


@dataclass(frozen=True, slots=True)
class ConstantForgetting:
    """The same forgetting factor λ at every sample; 1 forgets nothing (plain RLS).

    A constant factor below 1 winds the covariance up whenever the motion stops exciting it (the
    paper: "instability occurs"); ``docs/numerics.md`` says where the guard ends that.

    Parameters
    ----------
    factor : float
        λ per sample, in (0, 1].
    """

    factor: float = 1.0

    def __post_init__(self) -> None:
        kept(self, "factor", 0.0, 1.0, open_low=True)

    def _plain(self) -> tuple[float, ...]:
        return self.factor, 0.0


@dataclass(frozen=True, slots=True)
class FadingForgetting(_Numbers):
    """Forgetting that fades after each contact: λ(t) = 1 − (1 − λ₀) e^(−α t), section V-A-3.

    Parameters
    ----------
    initial_factor : float
        λ₀ per sample, in (0, 1].
    rate : float
        α, 1/s, > 0. The paper finds 5 to 8 good and 0.1 unstable.
    """

    initial_factor: float = _FADING["initial_factor"]
    rate: float = _FADING["rate"]

    def __post_init__(self) -> None:
        kept(self, "initial_factor", 0.0, 1.0, open_low=True)
        kept(self, "rate", 0.0, 1e6, open_low=True)


Forgetting = ConstantForgetting | FadingForgetting


@dataclass(frozen=True, slots=True)
class SelfPerturbation(_Numbers):
    """Self-perturbing least squares (Park & Jun 1992), section VII.

    P ← (1/λ) [P − L gᵀ + β NINT(γ e²) I], and λ returns to λ₀ whenever NINT(γ e²) > 0; e is the
    a-priori force error in newtons. Errors below √(0.5/γ) perturb nothing.

    Parameters
    ----------
    gain : float
        β, in the units of P, ≥ 0.
    sensitivity : float
        γ, 1/N², ≥ 0.
    """

    gain: float = _PERTURBATION["gain"]
    sensitivity: float = _PERTURBATION["sensitivity"]

    def __post_init__(self) -> None:
        kept(self, "gain", 0.0, 1e20)
        kept(self, "sensitivity", 0.0, 1e40)


@dataclass(frozen=True, slots=True)
class ChangeDetector(_Numbers):
    """Notices that another material is touched, and reinitialises the estimate.

    z = min(e²/s², 25);  g ← max(0, g + z − drift);  alarm at g > threshold   (Page's CUSUM)

    e is the a-priori force error, whitened by its own correlation; s² follows e² slowly. A second
    sum takes errors as they are, for laws outside the material's class, and blocks of errors show
    changes too small for single ones, as of the damping alone. All three alarm only beyond what
    they have come back from before, and only at depths and speeds of earlier strokes: elsewhere an
    error says more of the law than of a change.

    On an alarm the estimate restarts with the samples since g was last zero, and with the old value
    as a prior. Variable projection keeps the exponent it had, n ~ N(n̂, 0.02²), where it was
    identifiable and until the samples reject it (then N(n̂, 0.3²)), and the force offset; a
    recursive least squares keeps θ̂ with its initial covariance.

    Parameters
    ----------
    drift : float
        What z may be on average without adding up, 1 to 24. White noise has 1.
    threshold : float
        Of g, > 0. The larger, the later and the fewer false alarms.
    noise : float, optional
        The least s, N, > 0: the sensor's noise. None: from the first errors.
    adaptation : float
        Fraction of the way from s² to e² a sample, in [0, 1].
    warm_up : int
        Samples without alarms at the start, 10 to 1e6. The first half tells the noise and its
        correlation; the later half, and it again from 300 samples after each change on, tells how
        large errors are where nothing changes.
    transition : int
        Samples over which a velocity filter smears a change, 0 to 100: the length of a centred
        filter. Once twice as many have come after an alarm, a second reset leaves the latest of
        them only; 0 for a velocity that is measured.
    """

    drift: float = _DETECTOR["drift"]
    threshold: float = _DETECTOR["threshold"]
    noise: float | None = None
    adaptation: float = _DETECTOR["adaptation"]
    warm_up: int = _DETECTOR["warm_up"]
    transition: int = _DETECTOR["transition"]

    def __post_init__(self) -> None:
        kept(self, "drift", 1.0, 24.0)
        kept(self, "threshold", 0.0, 1e12, open_low=True)
        if self.noise is not None:
            kept(self, "noise", 0.0, 1e30, open_low=True)
        kept(self, "adaptation", 0.0, 1.0)
        kept(self, "warm_up", 10, 1_000_000, whole=True)
        kept(self, "transition", 0, 100, whole=True)


@dataclass(frozen=True, slots=True)
class OutlierRejection:
    """Leaves out samples that no probe and no material can have made.

    Lost positions and spikes of the velocity, by x − x_p − ½(v + v_p) T; spikes of the force, by
    F − F_p; and forces at the end of the sensor's range, where five and more equal ones at the top
    come while the law's force moves. x_p, v_p, F_p is the previous sample that was not left out, T
    the time since then. Each is compared with its own running median in contact, and with how far
    the previous one was off; forces within a tenth of the median force, and motions within 1.2
    times the median speed, are none.

    At most 3 forces or 20 motions are left out in a row: what lasts longer is another material or
    place, and is taken, so that a :class:`ChangeDetector` finds it that much later.

    Parameters
    ----------
    threshold : float
        Standard deviations beyond which a sample is an outlier, 3 to 1e6.
    """

    threshold: float = _REJECTION["threshold"]

    def __post_init__(self) -> None:
        kept(self, "threshold", 3.0, 1e6)

    def _plain(self) -> float:
        return self.threshold


@dataclass(frozen=True, slots=True)
class Scale(_Numbers):
    """Units of the arithmetic: inputs are divided by these, laws come back in SI.

    An initial covariance is meant in scaled units. ``Scale()`` is plain SI, as in the paper.

    Parameters
    ----------
    penetration, velocity, force : float
        m, m/s and N; in [1e-30, 1e30]. Best near the largest values of a recording.
    """

    penetration: float = 1.0
    velocity: float = 1.0
    force: float = 1.0

    def __post_init__(self) -> None:
        for name in ("penetration", "velocity", "force"):
            kept(self, name, 1e-30, 1e30)


class Configured:
    """What keyword arguments make and samples change: copied and pickled, it goes on the same."""

    __slots__ = ()

    if TYPE_CHECKING:  # the compiled class, or one of one's own, brings these
        _settings: dict[str, Any]

        def _state(self) -> bytes: ...
        def _restore(self, state: bytes) -> None: ...

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments."""
        return dict(self._settings)

    def copy(self) -> Self:
        """Return one with the same settings and state, from here on independent."""
        return _restored(type(self), self._settings, self._state())

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self._settings, self._state())

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self._settings.items())
        return f"{type(self).__name__}({given})"


Kind = TypeVar("Kind", bound=Configured)


def _restored(kind: type[Kind], settings: dict[str, Any], state: Any) -> Kind:
    made = kind(**settings)
    try:
        made._restore(state)
    except (TypeError, ValueError) as error:
        raise InvalidParameterError(f"{kind.__name__}: {error}") from None
    return made
