"""What an export has to do with, whichever the engine.

The motion that it has to be right on, and what is asked of an engine; the errors of a force and of
a rebound; the text that engines read; the law of an engine's kind that is nearest to another; and
at the end what an engine is, and which there are.
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
from palpate.findings import Finding
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, force_over_breaks
from palpate.identifying import Identification
from palpate.lab.trajectories import Probing
from palpate.quantities.restitution import restitution
from palpate.results.saved import SavedResult
from palpate.validation import Floats, one_of

#: An engine is asked for the force at so many states at most, unless it is slow.
MOST_SAMPLES = 20_000
#: Where the paper's motion is judged: deeper, m, than where the probe enters.
FIRM = 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class ProbeMotion:
    """Where a probe was, sample by sample, below the surface that the law was identified with.

    Attributes
    ----------
    time, penetration, velocity, acceleration : numpy.ndarray, shape (k,)
        s, m, m/s and m/s².
    judged : numpy.ndarray of bool, shape (k,)
        The samples that errors are taken over: in firm contact.
    starts : tuple of int
        Places of the samples that do not follow upon the one before, the first among them.
    force : numpy.ndarray, shape (k,), optional
        As measured, without its offset, N.
    source : str
        What it is, in words.
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
        """Return the paper's: a smooth approach, then 10 + 1 sin 4t + 1.8 sin 11t + 1.8 sin 15t mm.

        Judged where it is deeper than 2 mm.
        """
        time: Floats = 1e-3 * np.arange(6000, dtype=np.float64)
        command = Probing(pause=0.0).at(time)
        x, v = command.penetration, command.velocity
        return cls(time, x, v, np.gradient(v, time), x > FIRM, source="the paper's motion")

    @classmethod
    def recorded(cls, result: Identification | SavedResult) -> "ProbeMotion":
        """Return the motion that a law was identified from; judged where samples were taken.

        Raises
        ------
        RecordingError
            No sample was taken.
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
            raise RecordingError(f"{contact.source}: no sample of it was taken; identify it again")
        starts = tuple(np.cumsum([0, *(part.size for part in kept[:-1])]).tolist())
        motion = cls(time, penetration, velocity, np.concatenate(parts), judged, starts)
        return replace(motion, force=contact.force[whole] - offset, source="the recorded motion")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def deepest(self) -> float:
        """Of the judged samples, m."""
        return float(self.penetration[self.judged].max())

    @property
    def shallowest(self) -> float:
        """Of the judged samples, m."""
        return float(self.penetration[self.judged].min())

    @property
    def fastest(self) -> float:
        """The highest speed of the judged samples, either way, m/s."""
        return float(np.abs(self.velocity[self.judged]).max())

    def force_by(self, law: ForceLaw) -> Floats:
        """Force by a law at every sample, N; of one with memory, from rest where samples begin."""
        if not law.remembers:
            # Then the times do not matter, which of several recordings together need not rise.
            return law.force(self.penetration, self.velocity)
        steps = np.diff(self.time, prepend=0.0)
        inside = np.delete(steps, list(self.starts))
        steps[list(self.starts)] = float(np.median(inside)) if inside.size else 1e-3
        return force_over_breaks(law, self.penetration, self.velocity, steps, list(self.starts))

    def firm(self, most: int = MOST_SAMPLES) -> "ProbeMotion":
        """Return the judged samples alone, at most so many, evenly chosen.

        For an engine that is asked for its force at one state after another: they are no motion any
        more that could be followed in time.
        """
        places = self.firm_places(most)
        names = ("time", "penetration", "velocity", "acceleration", "judged")
        kept = {name: getattr(self, name)[places] for name in names}
        force = None if self.force is None else self.force[places]
        return replace(self, **kept, force=force, starts=(0,))

    def firm_places(self, most: int = MOST_SAMPLES) -> NDArray[np.int64]:
        """Which samples :meth:`firm` takes."""
        places = np.flatnonzero(self.judged)
        return places[:: -(-places.size // most)]


@dataclass(frozen=True, slots=True, eq=False)
class ExportRequest:
    """A law to be carried into an engine, and for what.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        F = K xⁿ + B xᵖ v, without memory.
    motion : Motion
        That it has to be right on.
    mass : float, optional
        Of the body that presses, as the contact feels it, kg.
    model : Path, optional
        The user's own model, for engines that read theirs.
    geom : str, optional
        The geom in it that touches.
    tip_radius : float, optional
        Of a round tip, m, for engines whose law has its radius in it.
    time_step : float
        Of the simulation, s.
    form : str
        Which of the engine's ways; "auto" leaves it to the engine.
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
        """The mass, kg; 1 kg where none is given, for engines whose law does not depend on it."""
        return 1.0 if self.mass is None else self.mass

    @property
    def radius_or_any(self) -> float:
        """The tip's, m; else any that is not all below the surface, for laws without it in them."""
        return self.tip_radius or max(0.01, 2.0 * self.motion.deepest)


# How far an engine's force is from a law's, and how differently a body rebounds.

#: Force [N] at a penetration [m] and a velocity [m/s].
Pointwise: TypeAlias = Callable[[float, float], float]

# Steps to the half period of the spring alone: e to 10⁻⁶, against the exact relation.
_STEPS = 1000
# Half periods after which a body has come to rest in the material.
_LONGEST = 40


def force_error(force: Floats, reference: Floats, judged: NDArray[np.bool_]) -> float:
    """100 rms(F − F_reference)/rms(F_reference) over the judged samples, %."""
    return rmse_percent(reference[judged], force[judged])


@dataclass(frozen=True, slots=True)
class Drop:
    """A free body that meets the surface, without weight: to some depth, and how it rebounds.

    Attributes
    ----------
    mass : float
        kg.
    speed : float
        At first touch, m/s.
    depth : float
        As deep as it goes, m.
    restitution : float
        e = speed after/speed before; 0 of a body that stays.
    """

    mass: float
    speed: float
    depth: float
    restitution: float


def drop_to(law: GeneralisedHuntCrossley, mass: float, depth: float) -> Drop:
    """Return the drop that goes to a depth [m] by a law, and its restitution.

    Where p = n by the exact relation of :mod:`palpate.quantities.restitution`; else by integration.
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
    """Restitution of a body that meets a material which cannot pull, by RK4 with a step [s].

    Parameters
    ----------
    force : callable
        N, at a penetration [m] and a velocity [m/s]; below 0 it counts as 0.
    mass, speed, step : float
        kg; m/s, > 0; s.
    """

    def pushing(penetration: float, velocity: float) -> float:
        return max(force(penetration, velocity), 0.0)

    return abs(min(_until_surface(pushing, mass, 0.0, speed, step), 0.0)) / speed


def came_back(states: Iterable[tuple[float, float]], drop: Drop) -> float:
    """Restitution by penetration [m] and velocity [m/s] after each step; 0 of a body that stays."""
    for x, v in states:
        if x <= 0.0 and v < 0.0:
            return -v / drop.speed
        if not math.isfinite(v):
            break
    return 0.0


def state_by_state(motion: ProbeMotion, force: Pointwise) -> Floats:
    """Force at every state of a motion, N."""
    states = zip(motion.penetration.tolist(), motion.velocity.tolist(), strict=True)
    return np.array([force(x, v) for x, v in states], dtype=np.float64)


def restitution_by(law: GeneralisedHuntCrossley, drop: Drop) -> float:
    """Restitution by another law of a body that meets it as a drop does."""
    step = half_period(law, drop.mass, drop.depth) / _STEPS
    return drop_restitution(law.force, drop.mass, drop.speed, step)


def half_period(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Of the body on a spring as stiff as the law is, as a secant, at a depth, s."""
    return math.pi * math.sqrt(mass / (law.stiffness * depth ** (law.exponent - 1.0)))


def course(
    force: Pointwise, mass: float, x: float, v: float, step: float
) -> Iterator[tuple[float, float]]:
    """Yield where a free body is and how fast, m ẍ = −F(x, ẋ), until it is above the surface.

    By RK4. A negative step goes back in time, from the greatest depth to first touch.
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
    """Velocity of :func:`course` at the surface; 0 where it is not met in reasonable time."""
    for nearer, faster in course(force, mass, x, v, step):
        if nearer <= 0.0:
            # Where x is 0 within the step, by a line.
            return v + (faster - v) * x / (x - nearer) if x > nearer else faster
        x, v = nearer, faster
    return 0.0


# Text for engines and about them: numbers that read back exactly, errors, and comments.


class _Digits(string.Formatter):
    """Fills in numbers so that they read back as the same."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return digits(value) if isinstance(value, int | float) else str(value)


def template(name: str, **values: Any) -> str:
    """Return one of the engines' texts, which lie in ``templates``, with its places filled in."""
    text = resources.files("palpate.exports") / "templates" / name
    return _Digits().format(text.read_text(encoding="utf-8"), **values)


def digits(value: float) -> str:
    """A number in the fewest digits that read back as the same float."""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else repr(float(value))


def xml_comment(notes: Sequence[str]) -> str:
    """Lines as an XML comment, in which two hyphens may not stand together."""
    lines = [re.sub("-(?=-)", "- ", line) for line in _lines(notes)]
    inside = "\n".join(f"  {line}".rstrip() for line in lines)
    return f"<!--\n{inside}\n-->"


def hash_comment(notes: Sequence[str]) -> str:
    """Lines as comments that begin with #."""
    return "\n".join(f"# {line}".rstrip() for line in _lines(notes))


def _lines(notes: Sequence[str]) -> list[str]:
    """Lines of text, without what XML does not take: a file's name may have anything in it."""
    lines = [line for note in notes for line in note.splitlines()]
    return ["".join(each if each.isprintable() else " " for each in line) for line in lines]


def percent(value: float) -> str:
    """An error in two digits, rounded up: what is within 0.31 % is not within 0.3 %."""
    if not math.isfinite(value):
        return "an unknown part"
    if value <= 0.0:
        return "0 %"
    place = 10.0 ** (math.floor(math.log10(value)) - 1)
    up = math.ceil(value / place - 1e-9) * place
    return f"{rounded(up, 2)} %"


def length(metres: float, figures: int) -> str:
    """A length in mm; in µm where it is less than a tenth of one."""
    if abs(metres) >= 1e-4 or metres == 0.0:
        return f"{rounded(1e3 * metres, figures)} mm"
    return f"{rounded(1e6 * metres, figures)} µm"


def numbers_of(law: GeneralisedHuntCrossley) -> dict[str, float]:
    """K, n, B and p by name, of a law without memory."""
    names = ("stiffness", "exponent", "damping", "damping_exponent")
    return {name: float(getattr(law, name)) for name in names}


# The nearest law of a kind that an engine has, along a motion.

_EXPONENTS = (0.5, 3.0)  # what lies between x and x², and a little beyond them


def with_exponents(
    law: ForceLaw, motion: ProbeMotion, n: float, p: float
) -> GeneralisedHuntCrossley:
    """Return the K xⁿ + B xᵖ v nearest to a law: least squares over the judged samples, B ≥ 0.

    The law itself where it has these exponents and no memory.
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
    """K, n within these exponents, and B ≥ 0 of least squares over the judged samples."""
    firm, unit = motion.judged, motion.deepest  # in SI, K and n of a power are one
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
    """Return the K xⁿ (1 + b v), b ≥ 0, nearest to a law.

    Of a law with p = n it has that one's own b = B/K, and so its restitution.
    """
    if law.damping > 0.0 and law.damping_exponent != law.exponent:
        return with_exponents(law, motion, n, n)
    b = max(law.damping, 0.0) / law.stiffness
    x, v = motion.penetration[motion.judged], motion.velocity[motion.judged]
    weight = np.maximum(1.0 + b * v, 0.0) ** 2 * x**n
    stiffness = law.stiffness * float(weight @ x**law.exponent / (weight @ x**n))
    return GeneralisedHuntCrossley(stiffness, n, stiffness * b, n)


def kelvin_voigt(law: ForceLaw, motion: ProbeMotion) -> GeneralisedHuntCrossley:
    """Return the K x + B v nearest to a law; see :func:`with_exponents`."""
    return with_exponents(law, motion, 1.0, 0.0)


def is_kelvin_voigt(law: GeneralisedHuntCrossley) -> bool:
    """Whether a law is exactly K x + B v."""
    linear = law.damping == 0.0 or law.damping_exponent == 0.0
    return law.exponent == 1.0 and linear and not law.remembers


def stable_step(law: GeneralisedHuntCrossley, mass: float, depth: float) -> float:
    """Time step from which on an explicit penalty contact is unstable, s.

    h² k/m + 2 h c/m = 4, with k = n K xⁿ⁻¹ and c = B xᵖ, at the greatest depth. (Semi-implicit
    Euler of m ẍ + c ẋ + k x = 0; MuJoCo held to within 10 % of it.)
    """
    k = law.exponent * law.stiffness * depth ** (law.exponent - 1.0)
    c = law.damping * depth**law.damping_exponent
    return float((math.sqrt(c * c + 4.0 * k * mass) - c) / k)


@dataclass(frozen=True, slots=True)
class Nearest:
    """The law of one power of depth, without memory, that stands for another.

    Attributes
    ----------
    law : GeneralisedHuntCrossley
        The one exported.
    which : str
        How it came about, in words; empty where it is the law itself.
    error_percent : float
        Of its force against that of the whole law, over the judged samples.
    """

    law: GeneralisedHuntCrossley
    which: str = ""
    error_percent: float = 0.0

    @classmethod
    def of(
        cls, member: GeneralisedHuntCrossley, law: ForceLaw, motion: ProbeMotion, which: str
    ) -> "Nearest":
        """Return a law in place of another, with its error along a motion."""
        error = force_error(motion.force_by(member), motion.force_by(law), motion.judged)
        return cls(member, which, error)


def without_memory(law: GeneralisedHuntCrossley, motion: ProbeMotion) -> Nearest:
    """Return the member without memory whose force is nearest along a motion.

    The relaxed one, the instantaneous one, or K and B by least squares with the law's exponents.
    """
    if not law.remembers:
        return Nearest(law)
    fitted = with_exponents(law, motion, law.exponent, law.damping_exponent)
    members = {
        "the law once it has relaxed": law.relaxed(),
        "the law before anything has relaxed": law.instantaneous(),
        "K and B nearest to the law with memory along this motion": fitted,
    }
    found = [Nearest.of(member, law, motion, which) for which, member in members.items()]
    # Not one that nothing pushes back by, or that makes energy.
    return min(
        found,
        key=lambda each: (each.law.stiffness <= 0.0, each.law.damping < 0.0, each.error_percent),
    )


def one_power(law: ForceLaw, motion: ProbeMotion) -> Nearest:
    """Return the K xⁿ + B v nearest to a law of two powers of depth, K₁ x + K₂ x² + B v."""
    nearest = _nearest(law, motion, _EXPONENTS, 0.0)
    return Nearest.of(nearest, law, motion, "one power of depth nearest along this motion")


# What an engine is, to an export: its ways of carrying a law, and what it makes of it.


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What an engine did along a motion.

    Attributes
    ----------
    force : numpy.ndarray, shape (k,)
        On the probe, out of the material, N, at every sample of the motion that it was asked for.
    how : str
        How the engine was moved, in words.
    """

    force: Floats
    how: str


def warned(*messages: str) -> tuple[Finding, ...]:
    """Return what a user of an engine should know."""
    return tuple(Finding("engine", message, severity="with-care") for message in messages)


def refused(*messages: str) -> tuple[Finding, ...]:
    """Return why a law should not be used in an engine."""
    return tuple(Finding("engine", message, severity="do-not-trust") for message in messages)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fragment(ABC):
    """A law in an engine's own numbers: text to paste, and what the engine will do with it.

    Attributes
    ----------
    form : str
        Which of the engine's ways.
    request : ExportRequest
        What it was made for.
    numbers : mapping of str to float
        The engine's own parameters by their names.
    engine_law : GeneralisedHuntCrossley, optional
        The force law that the engine then has, where it is one of these; but for what
        :meth:`predicted` adds.
    exact : bool
        Whether that is the law that was asked for, to the engine's own accuracy.
    largest_step : float, optional
        The time step from which on the simulation is unstable, s.
    findings : tuple of Finding
        What a user should know, :func:`warned`; and why this should not be used, :func:`refused`.
    most_samples : int
        At how many states, for an engine that is slow.
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
        """Return text by file name: what is to be pasted, and the smallest scene that runs.

        Parameters
        ----------
        notes : sequence of str
            Lines that each of them has to carry as a comment: origin, error, warnings.
        """

    def predicted(self, motion: ProbeMotion) -> Floats:
        """Force that the engine will have along a motion, N: of its law, and it cannot pull."""
        assert self.engine_law is not None  # or this is overridden
        return np.maximum(motion.force_by(self.engine_law), 0.0)

    def predicted_restitution(self, drop: Drop) -> float:
        """Restitution that the engine will have in a drop."""
        assert self.engine_law is not None
        return restitution_by(self.engine_law, drop)

    def replay(self, motion: ProbeMotion) -> Replayed | None:
        """Return what the real engine does along a motion; None of one that is not run here."""
        return None

    def drop_restitution(self, drop: Drop) -> float | None:
        """Restitution in the real engine in a drop, at the time step; None where it is not run."""
        return None


class Engine(ABC):
    """A simulation engine that a law can be exported to; its module has one as ``ENGINE``.

    Attributes
    ----------
    name : str
        As ``--to`` knows it.
    title : str
        As a person does.
    forms : mapping of str to str
        Its ways by name, in words; "auto" chooses among them.
    distribution : str, optional
        What pip installs; None of an engine of which text is written only.
    extra : str
        Of palpate, which brings it.
    takes : frozenset of str
        Which of model, geom and tip_radius it can do something with.
    continuous : bool
        Whether it can do without time steps: a time step of 0.
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
        """Return the law in this engine's numbers.

        Raises
        ------
        InvalidParameterError
            Something that this engine cannot do without is not given.
        """

    def version(self) -> str | None:
        """Of the installed engine; None where it is not there, or none is run."""
        if self.distribution is None:
            return None
        try:
            return version(self.distribution)
        except PackageNotFoundError:
            return None


# Every engine by its name: a module each, which is imported when it is asked for.

#: A module, of which ``ENGINE`` is the engine; none of them imports the simulator itself.
MODULES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "palpate.exports.mujoco",
        "drake": "palpate.exports.drake.engine",
        "opensim": "palpate.exports.opensim",
        "usd": "palpate.exports.usd",
    }
)

#: Kelvin–Voigt engines that an identified law can be typed into, but that have no export.
_BY_HAND: Mapping[str, str] = MappingProxyType(
    {
        "pybullet": "its contactStiffness and contactDamping are the K and B",
        "gazebo-classic": "ODE's <kp> and <kd> are the K and B",
    }
)
#: gz-physics issues 82 and 636, gz-sim issue 1961.
_DART = (
    "Gazebo with DART ignores the <kp> and <kd> of a surface: nothing of the law would arrive; "
    "export to mujoco or drake instead"
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines that a law can be exported to."""
    return tuple(MODULES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name.

    Raises
    ------
    InvalidParameterError
        There is none, or no longer one.
    ExportRefusedError
        It is one that ignores what it would be given.
    """
    if name in ("gazebo", "gz", "dart"):
        raise ExportRefusedError(_DART)
    if name in _BY_HAND:
        raise InvalidParameterError(
            f"palpate no longer exports to {name}: {_BY_HAND[name]} that "
            "palpate identify FILE --method kelvin-voigt prints"
        )
    one_of("to", name, MODULES)
    engine: Engine = import_module(MODULES[name]).ENGINE
    return engine
