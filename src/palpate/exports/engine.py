"""Common parts of the exports, independent of the engine.

The motion on which errors are measured and the request to an engine; errors of force and
restitution; the text that engines read; the nearest law of an engine's form; and at the end the
base class of engines and their registry.
"""

import math
import re
import string
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module, resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.digits import rounded
from palpate.errors import ExportRefusedError, InvalidParameterError, RecordingError
from palpate.estimators.estimate import rmse_percent
from palpate.estimators.least_squares import least_squares
from palpate.findings import Check, Finding
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, steps_over_breaks
from palpate.identifying import Identification
from palpate.lab.trajectories import Probing
from palpate.quantities.restitution import restitution
from palpate.results.saved import SavedResult
from palpate.validation import Floats, one_of

#: Most states at which an engine computes the force; slow engines have a lower limit.
MOST_SAMPLES = 20_000
#: Depth, m, above which the paper's motion counts for errors.
FIRM = 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class ProbeMotion:
    """A motion of a probe, with penetration measured from the surface of the identified law.

    Attributes
    ----------
    time, penetration, velocity, acceleration : numpy.ndarray, shape (k,)
        s, m, m/s and m/s².
    judged : numpy.ndarray of bool, shape (k,)
        Samples in firm contact, over which errors are computed.
    starts : tuple of int
        First sample of each continuous part of the motion. Default: (0,).
    force : numpy.ndarray, shape (k,), optional
        Measured force without its offset, N.
    source : str
        Description of the motion.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    acceleration: Floats
    judged: NDArray[np.bool_]
    starts: tuple[int, ...] = (0,)
    force: Floats | None = None
    source: str = "a motion"

    @classmethod
    def of_paper(cls) -> "ProbeMotion":
        """Return that of the paper: an approach, then 10 + sin 4t + 1.8 sin 11t + 1.8 sin 15t mm.

        Samples deeper than 2 mm count for errors.
        """
        time: Floats = 1e-3 * np.arange(6000, dtype=np.float64)
        command = Probing(pause=0.0).at(time)
        x, v = command.penetration, command.velocity
        return cls(time, x, v, np.gradient(v, time), x > FIRM, source="the paper's motion")

    @classmethod
    def recorded(cls, result: Identification | SavedResult) -> "ProbeMotion":
        """Return the motion of a recording; the samples used by the estimate count for errors.

        Raises
        ------
        RecordingError
            The estimate used no sample.
        """
        contact = result.contact
        if isinstance(result, Identification):
            surface, offset = result.estimate.surface, result.estimate.offset
        else:
            [found] = result.description["results"]
            surface, offset = (float(found.get(name, 0.0)) for name in ("surface", "offset"))
        good = np.isfinite(contact.penetration) & np.isfinite(contact.velocity)
        good &= np.isfinite(contact.force)
        parts = [np.flatnonzero(good[part]) + part.start for part in contact.segments()]
        kept = [part for part in parts if part.size > 1]
        whole = np.concatenate(kept) if kept else np.empty(0, dtype=np.int64)
        time, velocity = contact.time[whole], contact.velocity[whole]
        parts = [np.gradient(contact.velocity[part], contact.time[part]) for part in kept]
        penetration = contact.penetration[whole] - surface
        judged = result.trace.taken[whole] & (penetration > 0.0)
        if not judged.any():
            raise RecordingError(f"{contact.source}: no sample was used; identify it again")
        starts = tuple(np.cumsum([0, *(part.size for part in kept[:-1])]).tolist())
        motion = cls(time, penetration, velocity, np.concatenate(parts), judged, starts)
        return replace(motion, force=contact.force[whole] - offset, source="the recorded motion")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def deepest(self) -> float:
        """Largest penetration of the judged samples, m."""
        return float(self.penetration[self.judged].max())

    @property
    def shallowest(self) -> float:
        """Smallest penetration of the judged samples, m."""
        return float(self.penetration[self.judged].min())

    @property
    def fastest(self) -> float:
        """Largest absolute velocity of the judged samples, m/s."""
        return float(np.abs(self.velocity[self.judged]).max())

    def force_by(self, law: ForceLaw) -> Floats:
        """Return a law's force at every sample, N."""
        if not law.remembers:
            # Without relaxation the times do not matter, which joined recordings may repeat.
            return law.force(self.penetration, self.velocity)
        inside = np.delete(np.diff(self.time, prepend=0.0), list(self.starts))
        usual = float(np.median(inside)) if inside.size else 1e-3
        steps = steps_over_breaks(self.time, self.penetration, usual)
        return law.force_along(self.penetration, self.velocity, steps)

    def firm(self, most: int = MOST_SAMPLES) -> "ProbeMotion":
        """Return the judged samples only, at most so many, evenly chosen.

        They are independent states for an engine's force, no longer a motion in time.
        """
        places = self.firm_places(most)
        names = ("time", "penetration", "velocity", "acceleration", "judged")
        kept = {name: getattr(self, name)[places] for name in names}
        force = None if self.force is None else self.force[places]
        return replace(self, **kept, force=force, starts=(0,))

    def firm_places(self, most: int = MOST_SAMPLES) -> NDArray[np.int64]:
        """Return the indices of the samples that :meth:`firm` chooses."""
        places = np.flatnonzero(self.judged)
        return places[:: -(-places.size // most)]


@dataclass(frozen=True, slots=True, eq=False)
class ExportRequest:
    """A law to export to an engine, with the motion, body and options.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        F = K xⁿ + B xᵖ v, without relaxation.
    motion : ProbeMotion
        The motion on which the error is measured.
    mass : float, optional
        Effective mass of the pressing body at the contact, kg.
    model : Path, optional
        The user's own model, for engines that can read it.
    geom : str, optional
        Name of the touching geom in the model.
    tip_radius : float, optional
        Radius of a spherical tip, m, for engines whose law contains it.
    time_step : float
        Time step of the simulation, s. Default: 1e-3.
    form : str
        Form of the contact in the engine. Default: "auto", chosen by the engine.
    """

    law: GeneralisedHuntCrossley
    motion: ProbeMotion = field(repr=False)
    mass: float | None = None
    model: Path | None = None
    geom: str | None = None
    tip_radius: float | None = None
    time_step: float = 1e-3
    form: str = "auto"

    def __post_init__(self) -> None:
        if not self.law.stiffness > 0.0:
            raise InvalidParameterError(
                f"law must have a stiffness above 0, not {self.law.stiffness:.3g}"
            )

    @property
    def mass_or_one(self) -> float:
        """The mass, kg; 1 kg if none was set, for engines whose law does not depend on it."""
        return 1.0 if self.mass is None else self.mass

    @property
    def radius_or_any(self) -> float:
        """Radius of the tip, m; if unknown, one larger than the depth, where it has no effect."""
        return self.tip_radius or max(0.01, 2.0 * self.motion.deepest)


# Errors of an engine's force and restitution.

#: Force [N] at a penetration [m] and a velocity [m/s].
Pointwise: TypeAlias = Callable[[float, float], float]

# Steps per half period of the spring alone: restitution e is accurate to 10⁻⁶.
_STEPS = 1000
# Half periods after which a body counts as at rest in the material.
_LONGEST = 40


def force_error(force: Floats, reference: Floats, judged: NDArray[np.bool_]) -> float:
    """Return 100 rms(F − F_reference)/rms(F_reference) over the judged samples, %."""
    return rmse_percent(reference[judged], force[judged])


@dataclass(frozen=True, slots=True)
class Drop:
    """An impact of a free, weightless body on the surface.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    speed : float
        Speed at first touch, m/s.
    depth : float
        Largest depth, m.
    restitution : float
        e = speed after/speed before; 0 if the body does not rebound.
    """

    mass: float
    speed: float
    depth: float
    restitution: float


def drop_to(law: GeneralisedHuntCrossley, mass: float, depth: float) -> Drop:
    """Return the impact that reaches a depth [m] by a law, with its restitution.

    For p = n from the exact relation of :mod:`palpate.quantities.restitution`, else by integration.
    """
    force = law.force
    step = half_period(law, mass, depth) / _STEPS
    speed = abs(_until_surface(force, mass, depth, 0.0, -step))
    if law.damping_exponent == law.exponent or law.damping == 0.0:
        e = restitution(law.damping / law.stiffness, speed)
    else:
        e = drop_restitution(force, mass, speed, step)
    return Drop(mass, speed, depth, e)


def drop_restitution(force: Pointwise, mass: float, speed: float, step: float) -> float:
    """Return the restitution of an impact on a material that cannot pull, by RK4.

    Parameters
    ----------
    force : callable
        Force, N, at a penetration [m] and a velocity [m/s]; below 0 it counts as 0.
    mass, speed, step : float
        Mass, kg; speed at first touch, m/s, > 0; time step, s.
    """

    def pushing(penetration: float, velocity: float) -> float:
        return max(force(penetration, velocity), 0.0)

    return abs(min(_until_surface(pushing, mass, 0.0, speed, step), 0.0)) / speed


def came_back(states: Iterable[tuple[float, float]], drop: Drop) -> float:
    """Return the restitution from (penetration, velocity) after each step; 0 without a rebound."""
    for x, v in states:
        if x <= 0.0 and v < 0.0:
            return -v / drop.speed
        if not math.isfinite(v):
            break
    return 0.0


def state_by_state(motion: ProbeMotion, force: Pointwise) -> Floats:
    """Return the force at every state of a motion, N."""
    states = zip(motion.penetration.tolist(), motion.velocity.tolist(), strict=True)
    return np.array([force(x, v) for x, v in states], dtype=np.float64)


def restitution_by(law: GeneralisedHuntCrossley, drop: Drop) -> float:
    """Return the restitution of the drop's body at the same speed with another law."""
    step = half_period(law, drop.mass, drop.depth) / _STEPS
    return drop_restitution(law.force, drop.mass, drop.speed, step)


def half_period(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Return the half period, s, of a body on a spring of the law's secant stiffness at depth."""
    return math.pi * math.sqrt(mass / (law.stiffness * depth ** (law.exponent - 1.0)))


def course(
    force: Pointwise, mass: float, x: float, v: float, step: float
) -> Iterator[tuple[float, float]]:
    """Yield position and velocity of a free body, m ẍ = −F(x, ẋ), until it leaves the surface.

    By RK4. A negative step integrates back in time, from the greatest depth to first touch.
    """

    def slope(depth: float, speed: float) -> float:
        return -force(max(depth, 0.0), speed) / mass

    for _ in range(_STEPS * _LONGEST):
        a1 = slope(x, v)
        v2 = v + 0.5 * step * a1
        a2 = slope(x + 0.5 * step * v, v2)
        v3 = v + 0.5 * step * a2
        a3 = slope(x + 0.5 * step * v2, v3)
        v4 = v + step * a3
        a4 = slope(x + step * v3, v4)
        x += step * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
        v += step * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        yield x, v
        if x <= 0.0 or not math.isfinite(v):
            return


def _until_surface(force: Pointwise, mass: float, x: float, v: float, step: float) -> float:
    """Return the velocity of :func:`course` at the surface; 0 if it does not return in time."""
    for nearer, faster in course(force, mass, x, v, step):
        if nearer <= 0.0:
            # Interpolate linearly to x = 0 within the step.
            return v + (faster - v) * x / (x - nearer) if x > nearer else faster
        x, v = nearer, faster
    return 0.0


# Text for engines: numbers that read back exactly, errors, and comments.


class _Digits(string.Formatter):
    """A formatter that writes numbers so that they read back exactly."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return digits(value) if isinstance(value, int | float) else str(value)


def template(name: str, **values: Any) -> str:
    """Return a file of ``templates`` with its fields filled in."""
    text = resources.files("palpate.exports") / "templates" / name
    return _Digits().format(text.read_text(encoding="utf-8"), **values)


def digits(value: float) -> str:
    """Return a number in the fewest digits that read back as the same float."""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else repr(float(value))


def xml_comment(notes: Sequence[str]) -> str:
    """Return lines as an XML comment, which may not contain two adjacent hyphens."""
    lines = [re.sub("-(?=-)", "- ", line) for line in _lines(notes)]
    inside = "\n".join(f"  {line}".rstrip() for line in lines)
    return f"<!--\n{inside}\n-->"


def hash_comment(notes: Sequence[str]) -> str:
    """Return lines as comments that begin with #."""
    return "\n".join(f"# {line}".rstrip() for line in _lines(notes))


def _lines(notes: Sequence[str]) -> list[str]:
    """Return lines without characters that XML forbids; file names may contain any character."""
    lines = [line for note in notes for line in note.splitlines()]
    return ["".join(each if each.isprintable() else " " for each in line) for line in lines]


def percent(value: float) -> str:
    """Return an error in two digits, rounded up: 0.301 % is written 0.31 %."""
    if not math.isfinite(value):
        return "an unknown percentage"
    if value <= 0.0:
        return "0 %"
    place = 10.0 ** (math.floor(math.log10(value)) - 1)
    up = math.ceil(value / place - 1e-9) * place
    return f"{rounded(up, 2)} %"


def length(metres: float, figures: int) -> str:
    """Return a length in mm, or below 0.1 mm in µm."""
    if abs(metres) >= 1e-4 or metres == 0.0:
        return f"{rounded(1e3 * metres, figures)} mm"
    return f"{rounded(1e6 * metres, figures)} µm"


def numbers_of(law: GeneralisedHuntCrossley) -> dict[str, float]:
    """Return K, n, B and p by name."""
    names = ("stiffness", "exponent", "damping", "damping_exponent")
    return {name: float(getattr(law, name)) for name in names}


# The nearest law of an engine's form, along a motion.

_EXPONENTS = (0.5, 3.0)  # a little beyond x and x²


def with_exponents(
    law: ForceLaw, motion: ProbeMotion, n: float, p: float
) -> GeneralisedHuntCrossley:
    """Return the nearest K xⁿ + B xᵖ v, by least squares over the judged samples, B ≥ 0.

    The law itself if it has these exponents and no relaxation.
    """
    if law.powers is not None and not law.remembers:
        own = GeneralisedHuntCrossley.of(law)
        same = own.exponent == n and (own.damping == 0.0 or own.damping_exponent == p)
        if same and own.damping >= 0.0:
            return GeneralisedHuntCrossley(own.stiffness, n, own.damping, p)
    return _nearest(law, motion, (n, n), p)


def _nearest(
    law: ForceLaw, motion: ProbeMotion, exponents: tuple[float, float], p: float
) -> GeneralisedHuntCrossley:
    """Return K, n within these bounds, and B ≥ 0 by least squares over the judged samples."""
    firm, unit = motion.judged, motion.deepest  # in SI units K and n are correlated
    x, v = motion.penetration[firm] / unit, motion.velocity[firm]
    force, damper, logarithm = motion.force_by(law)[firm], x**p * v, np.log(x)

    def model(parameters: Floats) -> tuple[Floats, Floats]:
        stiffness, n, damping = parameters
        power = x**n
        slopes = np.column_stack([power, stiffness * power * logarithm, damper])
        slopes[:, 1] *= exponents[0] < exponents[1]
        return force - stiffness * power - damping * damper, slopes

    bounds = np.array([-np.inf, exponents[0], 0.0]), np.array([np.inf, exponents[1], np.inf])
    found = least_squares(model, np.array([0.0, 0.5 * sum(exponents), 0.0]), bounds, 1e-12)
    stiffness, n, damping = found.parameters.tolist()
    return GeneralisedHuntCrossley(stiffness / unit**n, n, damping / unit**p, p)


def with_one_exponent(
    law: GeneralisedHuntCrossley, motion: ProbeMotion, n: float
) -> GeneralisedHuntCrossley:
    """Return the nearest K xⁿ (1 + b v), b ≥ 0.

    For a law with p = n it keeps b = B/K, and so the restitution.
    """
    if law.damping > 0.0 and law.damping_exponent != law.exponent:
        return with_exponents(law, motion, n, n)
    b = max(law.damping, 0.0) / law.stiffness
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    weight = np.maximum(1.0 + b * v, 0.0) ** 2 * x**n
    stiffness = law.stiffness * float(weight @ x**law.exponent / (weight @ x**n))
    return GeneralisedHuntCrossley(stiffness, n, stiffness * b, n)


def kelvin_voigt(law: ForceLaw, motion: ProbeMotion) -> GeneralisedHuntCrossley:
    """Return the nearest K x + B v; see :func:`with_exponents`."""
    return with_exponents(law, motion, 1.0, 0.0)


def is_kelvin_voigt(law: GeneralisedHuntCrossley) -> bool:
    """Whether a law is exactly K x + B v."""
    linear = law.damping == 0.0 or law.damping_exponent == 0.0
    return law.exponent == 1.0 and linear and not law.remembers


def stable_step(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Return the time step, s, from which an explicit penalty contact is unstable.

    h² k/m + 2 h c/m = 4, with k = n K xⁿ⁻¹ and c = B xᵖ, at the greatest depth. (Semi-implicit
    Euler of m ẍ + c ẋ + k x = 0; MuJoCo was stable to within 10 % of it.)
    """
    k = law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    c = law.damping * depth**law.damping_exponent
    return float((math.sqrt(c * c + 4.0 * k * mass) - c) / k)


@dataclass(frozen=True, slots=True)
class Nearest:
    """A law K xⁿ + B xᵖ v exported in place of another.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The exported law.
    which : str
        How it was derived, in words; empty for the law itself.
    error_percent : float
        Rms error of its force against that of the original law, over the judged samples, %.
    """

    law: GeneralisedHuntCrossley
    which: str = ""
    error_percent: float = 0.0

    @classmethod
    def of(
        cls, member: GeneralisedHuntCrossley, law: ForceLaw, motion: ProbeMotion, which: str
    ) -> "Nearest":
        """Return an exported law with its error along a motion."""
        error = force_error(motion.force_by(member), motion.force_by(law), motion.judged)
        return cls(member, which, error)


def without_memory(law: GeneralisedHuntCrossley, motion: ProbeMotion) -> Nearest:
    """Return the law without relaxation whose force is nearest along a motion.

    The relaxed law, the instantaneous one, or K and B by least squares with the law's exponents.
    """
    if not law.remembers:
        return Nearest(law)
    fitted = with_exponents(law, motion, law.exponent, law.damping_exponent)
    members = {
        "the fully relaxed law": law.relaxed(),
        "the instantaneous (unrelaxed) law": law.instantaneous(),
        "the law without relaxation nearest along this motion": fitted,
    }
    found = [Nearest.of(member, law, motion, which) for which, member in members.items()]
    # Avoid laws with K ≤ 0 or B < 0.
    return min(
        found,
        key=lambda each: (each.law.stiffness <= 0.0, each.law.damping < 0.0, each.error_percent),
    )


def one_power(law: ForceLaw, motion: ProbeMotion) -> Nearest:
    """Return the K xⁿ + B v nearest to the quadratic law K₁ x + K₂ x² + B v."""
    nearest = _nearest(law, motion, _EXPONENTS, 0.0)
    return Nearest.of(
        nearest, law, motion, "the law with one power of depth nearest along this motion"
    )


# Base classes of engines and of laws in their parameters.


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """The force of an engine along a motion.

    Attributes
    ----------
    force : numpy.ndarray, shape (k,)
        Force on the probe, positive out of the material, N, at every sample of the motion.
    how : str
        Method of the replay, in words.
    """

    force: Floats
    how: str


def warned(*messages: str) -> tuple[Finding, ...]:
    """Return messages as warnings."""
    return tuple(Check.ENGINE.finding(message, severity="with-care") for message in messages)


def refused(*messages: str) -> tuple[Finding, ...]:
    """Return messages as refusals."""
    return tuple(Check.ENGINE.finding(message, severity="do-not-trust") for message in messages)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fragment(ABC):
    """A law in an engine's parameters: text to paste, and the engine's force with it.

    Attributes
    ----------
    form : str
        Form of the contact in the engine.
    request : ExportRequest
        The request it was made for.
    numbers : mapping of str to float
        The engine's parameters by name.
    engine_law : GeneralisedHuntCrossley, optional
        The resulting force law in the engine, if it has this form; :meth:`predicted` may add to it.
    exact : bool
        Whether that is the requested law, to the engine's accuracy. Default: False.
    largest_step : float, optional
        Stability limit of the time step, s.
    findings : tuple of Finding
        Warnings (:func:`warned`) and refusals (:func:`refused`).
    most_samples : int
        Most states for a replay.
    """

    most_samples: ClassVar[int] = MOST_SAMPLES
    form: str
    request: ExportRequest = field(repr=False)
    numbers: Mapping[str, float]
    engine_law: GeneralisedHuntCrossley | None = None
    exact: bool = False
    largest_step: float | None = None
    findings: tuple[Finding, ...] = ()

    @abstractmethod
    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        """Return text by file name: the fragment to paste, and a minimal scene.

        Parameters
        ----------
        notes : sequence of str
            Lines for the comment in each file: origin, error, warnings.
        """

    def predicted(self, motion: ProbeMotion) -> Floats:
        """Return the engine's predicted force along a motion, N, at least 0."""
        assert self.engine_law is not None  # else a subclass overrides this
        return np.maximum(motion.force_by(self.engine_law), 0.0)

    def predicted_restitution(self, drop: Drop) -> float:
        """Return the engine's predicted restitution in an impact."""
        assert self.engine_law is not None
        return restitution_by(self.engine_law, drop)

    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return the real engine's force along a motion; None if palpate cannot run it."""
        return None

    def drop_restitution(self, drop: Drop) -> float | None:
        """Return the real engine's restitution at the time step; None if it is not simulated."""
        return None


class Engine(ABC):
    """A simulation engine to which laws can be exported; each module has one as ``ENGINE``.

    Attributes
    ----------
    name : str
        Name for ``--to``.
    title : str
        Display name.
    forms : mapping of str to str
        Names and descriptions of the forms of contact; "auto" chooses among them.
    distribution : str, optional
        Name of its Python package; None if palpate cannot run the engine.
    extra : str
        The extra of palpate that installs it.
    takes : frozenset of str
        Which of the options model, geom and tip_radius it uses.
    continuous : bool
        Whether it accepts a time step of 0 (continuous time).
    """

    name: ClassVar[str]
    title: ClassVar[str]
    forms: ClassVar[Mapping[str, str]]
    distribution: ClassVar[str | None] = None
    extra: ClassVar[str] = ""
    takes: ClassVar[frozenset[str]] = frozenset()
    continuous: ClassVar[bool] = False

    @abstractmethod
    def fit(self, request: ExportRequest) -> Fragment:
        """Return the law in this engine's parameters.

        Raises
        ------
        InvalidParameterError
            An option that the engine needs is missing.
        """

    def version(self) -> str | None:
        """Return the version of the installed engine; None if there is none."""
        if self.distribution is None:
            return None
        try:
            return version(self.distribution)
        except PackageNotFoundError:
            return None


# The registry of engines; each has a module that is imported on use.

#: Modules whose ``ENGINE`` is the engine; importing one does not import the simulator.
MODULES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "palpate.exports.mujoco",
        "drake": "palpate.exports.drake.engine",
        "opensim": "palpate.exports.opensim",
        "usd": "palpate.exports.usd",
    }
)

#: gz-physics issues 82 and 636, gz-sim issue 1961.
_DART = (
    "Gazebo with DART ignores the <kp> and <kd> of a surface, so it cannot have the law; export to "
    "mujoco or drake instead"
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines."""
    return tuple(MODULES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name.

    Raises
    ------
    InvalidParameterError
        There is no such engine.
    ExportRefusedError
        The engine ignores the parameters of a contact law.
    """
    if name in ("gazebo", "gz", "dart"):
        raise ExportRefusedError(_DART)
    one_of("to", name, MODULES)
    engine: Engine = import_module(MODULES[name]).ENGINE
    return engine
