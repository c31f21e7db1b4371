"""Young's modulus from the approach of a force curve, for a tip of known shape.

The tip comes through free air, where the force follows a line, and presses into the sample:

    F(x) = F₀ + s x + K max(x − d, 0)ᵐ,    E = (1 − ν²) K/g

with the tip's exponent m and factor g (:mod:`palpate.identification.quantities.elastic_modulus`).
The position x
is that of the tip: the height of the cantilever's base plus its deflection F/k. The whole-curve fit
(:func:`palpate.fit_curves`) finds the contact point d; Gauss–Newton steps then minimise
Σ w² (F − F(x))² over K, d, F₀ and s.

Near the contact point roughness, a soft layer and long-range forces add to the law. Samples closer
to it than a third of the indentation count less: w rises from 0 at d to 1. The change of E by these
weights is one of its systematic errors; nanite has weights of this form within a micrometre.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from palpate.digits import format_quantity, rough_percent, with_error
from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Check, Finding, worst
from palpate.identification.diagnosis.outcome import UNKNOWN, Quantity
from palpate.identification.quantities.elastic_modulus import (
    INCOMPRESSIBLE,
    LAYER,
    LAYER_SLOPE,
    NEXT_SHAPE,
    TIPS,
    ElasticModulus,
    Tip,
    error_mark,
)
from palpate.input.channels import Columns
from palpate.input.channels.kinds import channel_kind
from palpate.input.preparation import prepare
from palpate.input.recordings import Recording
from palpate.input.recordings.units import UNITS, split_name, unit_size
from palpate.method.contact import Contact
from palpate.method.estimators.batch_fit import fit_curves
from palpate.method.rows import count_true, median, rms
from palpate.validation import Floats, frozen

POSITION = "tip position"
FORCE = "force"
SEGMENT = "segment"
HEIGHT = "height"
# Farther than the piezo of a microscope moves, m.
MOST_TRAVEL = 1e-3
# Part of the indentation, next to the contact point, in which samples count less.
ZONE = 1.0 / 3.0
# Lighter part of the indentation that is fitted by itself: up to half the force under a sphere.
LIGHT = 0.63
# Largest numbers of means of consecutive samples: in the search, in air and nearer afterwards.
_SEARCHED = 2048
_AIR = 96
_NEAR = 192
_STEPS = 20
_SEARCH_STEPS = 10
_REFIT_STEPS = 3
_TOGETHER = 12  # means in a block of residuals
_FEWEST = 10  # samples in contact, and in air
_SURE = 3.0  # standard errors, or standard deviations of the noise
_LIKELY = 2.5
RELAXES = 0.9  # part of the work; a sample that gives back less relaxes
_LEAST_PULL = 0.02  # of the peak force
_BLURRED = "check the tip for a particle; look for a layer on the sample or a rough surface"
_UNEVEN = "check the shape of the tip, and whether the sample is uniform and thick enough"
_STRAIGHT = "let the instrument settle before the approach, or start it nearer to the sample"
_ADHESION = "measure in a liquid, or coat the tip, so that it does not stick"
_THIN = "pass --thickness for a sphere on a thin sample, or press less deep"
_DEEP = "press less deep, or use a larger tip"


@frozen
class Indentation:
    """The fit of a force curve's approach, SI.

    Attributes
    ----------
    modulus : ElasticModulus
        Young's modulus, with its mark.
    K : Quantity
        K, N/mᵐ.
    contact_point : Quantity
        d, m, in the coordinate of the penetration, which is minus the position of the tip.
    baseline : tuple of float
        F₀ at d, N, and s, N/m.
    depth, largest_depth : float
        Median and largest depth in contact, m.
    residual : float
        Root mean square of the residual in contact, N.
    samples, taken : int
        Number of samples of the approach, and of those in contact.
    findings : tuple of Finding
        Problems of the curve and of its fit.
    tilt : tuple of float
        Slope of the force over the position of the piezo, N/m, and compliance of the cantilever,
        m/N, which are subtracted; zeros if the baseline slopes over the position of the tip.
    """

    modulus: ElasticModulus
    K: Quantity
    contact_point: Quantity
    baseline: tuple[float, float]
    depth: float
    largest_depth: float
    residual: float
    samples: int
    taken: int
    findings: tuple[Finding, ...]
    tilt: tuple[float, float] = (0.0, 0.0)


def read_force_curve(recording: Recording) -> Recording | None:
    """Return a force curve with the names of :mod:`palpate.input.recordings.afm`, in SI, or None.

    Other files call the same channels ``Vertical Tip Position [nm]`` or ``force (nN)``; a position
    that moves farther than an instrument can is that of a robot's tip.
    """
    if {POSITION, FORCE} <= recording.channels.keys():
        return recording if len({*map(len, recording.channels.values())}) == 1 else None
    names: dict[str, str] = {}
    for name in recording.channels:
        words = split_name(name)
        kind = channel_kind(name, recording.unit_of(name)) or ""
        known = SEGMENT if SEGMENT in words else HEIGHT if "height" in words else kind
        names.setdefault(POSITION if {"tip", "position"} <= set(words) else known, name)
    if not {POSITION, FORCE} <= names.keys():
        return None
    kinds = {"time": "time", POSITION: "penetration", HEIGHT: "penetration", FORCE: "force"}
    channels = {SEGMENT: recording.channels[names[SEGMENT]]} if SEGMENT in names else {}
    for known, kind in kinds.items():
        if known in names:
            size = unit_size(kind, recording.unit_of(names[known]) or next(iter(UNITS[kind])))
            channels[known] = size * recording.numbers(names[known])
    if len({*map(len, channels.values())}) > 1 or not np.ptp(channels[POSITION]) < MOST_TRAVEL:
        return None
    clocks = dict.fromkeys(channels.keys() - {"time"}, "time") if "time" in channels else {}
    return replace(recording, channels=channels, units={}, clocks=clocks)


def find_force_curve(contact: Contact) -> Recording | None:
    """Return the force curve from which a contact was made; None if it is from another source."""
    recording = None if contact.prepared is None else contact.prepared.recording
    if recording is None or recording.source != contact.source:
        return None
    return read_force_curve(recording)


def refuse_options(names: Iterable[str]) -> None:
    """Raise for options of the preparation: the tip alone decides how a force curve is read."""
    if given := ", ".join(sorted({*names} - {"strict"})):
        raise InvalidParameterError(
            f"--tip finds baseline, contact point and exponent of a force curve: drop the options "
            f"for {given}"
        )


def fit_force_curve(
    recording: Recording,
    tip: Tip,
    poisson_ratio: float | None = None,
) -> Indentation:
    """Fit the approach of a recorded force curve; see :func:`fit_approach`."""
    channels = recording.channels
    height = next((channels[name] for name in channels if name.startswith(HEIGHT)), None)
    return fit_approach(
        -np.asarray(channels[POSITION]),
        np.asarray(channels[FORCE]),
        channels.get(SEGMENT),
        tip,
        poisson_ratio,
        base=None if height is None else -np.asarray(height),
        time=channels.get("time"),
        source=recording.source,
    )


def prepare_force_curve(recording: Recording, found: Indentation) -> Contact:
    """Return a force curve as a contact: the force above the baseline, over the depth.

    A curve without times is timeless, and an approach alone: at one speed damping does not differ
    from stiffness.
    """
    names = Columns(penetration="penetration", force="force above the baseline")
    depth = -np.asarray(recording.channels[POSITION])
    force = np.asarray(recording.channels[FORCE])
    tilt, compliance = found.tilt
    if tilt:
        virtual = tilt * (depth + compliance * force)
        force = force - virtual
        depth = depth + compliance * virtual
    depth = depth - found.contact_point.value
    level, slope = found.baseline
    force = force - level - slope * depth
    channels = {**recording.channels, names.penetration: depth, names.force: force}
    units = {**recording.units, names.penetration: "m", names.force: "N"}
    clocks = {name: "time" for name in channels if name != "time" and "time" in channels}
    curve = replace(recording, channels=channels, units=units, clocks=clocks)
    timeless = found.samples == len(depth) or "time" not in channels
    contact = prepare(curve, columns=names, no_time=timeless)
    of_modulus = Check.MODULUS, Check.TIP_SHAPE
    findings = (each for each in found.findings if each.check not in of_modulus)
    return replace(
        contact,
        surface_deviation=found.contact_point.whole_error,
        findings=(*contact.findings, *findings),
    )


def fit_approach(
    penetration: Floats,
    force: Floats,
    segment: Any,
    tip: Tip,
    poisson_ratio: float | None = None,
    *,
    base: Floats | None = None,
    time: Any = None,
    source: str = "",
) -> Indentation:
    """Fit the approach of a force curve: a line as baseline, and the exponent of the tip.

    Parameters
    ----------
    penetration, force : numpy.ndarray, shape (k,)
        m, positive into the sample, and N.
    segment : numpy.ndarray, shape (k,), or None
        The first label is the approach. With None or one label it ends at the deepest sample.
    tip : Tip
        The tip of the probe.
    poisson_ratio : float, optional
        ν of the material. Default: 0.5, assumed.
    base : numpy.ndarray, shape (k,), optional
        Position of the piezo, m, positive towards the sample; the tip is behind it by the
        cantilever's deflection. Default: the baseline slopes over the position of the tip.
    time : array_like, shape (k,), optional
        s, for the speed at which a sample that relaxes was pressed.
    source : str
        Name of the curve, for errors.

    Raises
    ------
    RecordingError
        There are fewer than 40 samples, or none in contact.
    """
    where = f"{source}: " if source else ""
    rows = [penetration, force, penetration if base is None else base]
    rows.append(np.full(np.shape(force), math.nan) if time is None else time)
    approach, retract = _split(rows, segment)
    if (count := approach.shape[1]) < 4 * _FEWEST:
        raise RecordingError(f"{where}the approach has {count} samples; it needs {4 * _FEWEST}")
    try:
        with np.errstate(all="ignore"):
            fit = _ApproachFit(approach, retract, tip)
            if base is not None:
                fit = _choose_tilt(fit)
            return fit.result(poisson_ratio)
    except np.linalg.LinAlgError:
        raise RecordingError(
            f"{where}the approach has no contact in which the force rises; check that the tip "
            "touches, and the signs of height and force"
        ) from None


def _choose_tilt(fit: "_ApproachFit") -> "_ApproachFit":
    """Return the fit whose baseline slopes over the position of the tip, or over the piezo's.

    Along the piezo the light path changes, and with it the force that the detector shows: a
    virtual deflection, which belongs neither to the force nor to the position of the tip.
    """
    slope = fit.solution[3] * fit.peak / (fit.scale * fit.length)
    if abs(fit.solution[3]) <= _SURE * fit.errors[3]:
        return fit
    position, force, base, _ = fit.approach
    compliance = float(np.polyfit(force, base - position, 1)[0])
    tilt = slope / (1.0 + slope * compliance)
    turn = tilt * np.array([[compliance], [-1.0], [0.0], [0.0]])
    approach, retract = (signals + turn * signals[2] for signals in (fit.approach, fit.retract))
    other = _ApproachFit(approach, retract, fit.tip)
    other.tilt = tilt, compliance
    with_tip, with_piezo = (each.misfit(compliance) for each in (fit, other))
    # Neighbouring samples of coloured noise count less: its jumps are smaller.
    white = min((fit.noise / min(with_tip, with_piezo)) ** 2, 1.0)
    independent = force.size * white / (2.0 - white)
    evidence = 2.0 * independent * math.log(with_tip / with_piezo)
    if evidence < -(_SURE**2):
        return fit
    if evidence < _SURE**2:
        other.tilted = fit.stiffness / other.stiffness - 1.0
    return other


def _split(rows: Sequence[Any], segment: Any) -> tuple[Floats, Floats]:
    """Return the approach and the rest, without samples that lack a position or the force."""
    both = np.array(rows, dtype=np.float64)
    finite = np.logical_and.reduce(np.isfinite(both[:3]))
    labels = np.zeros(1) if segment is None or not len(segment) else np.asarray(segment)
    end = int(np.argmax(labels != labels[0]))
    if not end and finite.any():
        end = int(np.nanargmax(both[0])) + 1
    if not finite.all():
        both = both[:, finite]
        end = count_true(finite[:end])
    return both[:, :end], both[:, end:]


def _starts(first: int, end: int, most: int) -> Any:
    """Return the starts of at most so many blocks of about equal length."""
    count = min(end - first, most)
    return first + np.arange(count) * (end - first) // max(count, 1)


def _means(values: Floats, starts: Any) -> tuple[Floats, Floats]:
    """Return the means of the samples from each start to the next, and their numbers."""
    counts: Floats = np.diff(starts, append=values.shape[-1]).astype(np.float64)
    return np.add.reduceat(values, starts, axis=-1) / counts, counts


def _search(approach: Floats, exponent: float) -> tuple[float, float, float]:
    """Return K, d and F₀ of the whole-curve fit.

    A tip that moves 60 µm through the air may indent by only 0.1 µm, less than a step of the fit's
    grid of surfaces: the fit is then repeated with the last part of the way.

    Raises
    ------
    LinAlgError
        The force does not rise.
    """
    (x, force), _ = _means(approach, _starts(0, approach.shape[1], _SEARCHED))
    low = float(x.min())
    high = float(x.max())
    for part in (1.0, 0.15):
        used = x >= high - part * (high - low)
        ends = max(low, high - part * (high - low)), high + (high - low) / 79.0
        signals = x[used], np.zeros(np.count_nonzero(used)), force[used]
        fit = fit_curves(*signals, surface="estimate", surface_range=ends, exponent=exponent)
        stiffness, surface, offset = (float(each[0]) for each in (fit.K, fit.surface, fit.offset))
        if stiffness > 0.0 and surface < float(approach[0].max()) and math.isfinite(offset):
            return stiffness, surface, offset
    raise np.linalg.LinAlgError


def _integrate(depth: Floats, force: Floats) -> float:
    """Return ∫ F dx by trapezoids; ``numpy.trapezoid`` needs NumPy 2."""
    return float(0.5 * (force[1:] + force[:-1]) @ np.diff(depth))


class _SystematicPart(NamedTuple):
    """A relative error of the modulus, its cause as a clause, and the next step."""

    size: float
    reason: str
    remedy: str


class _ApproachFit:
    """Least squares of an approach, in units of its indentation and of its peak force."""

    def __init__(self, approach: Floats, retract: Floats, tip: Tip) -> None:
        self.tip = tip
        self.approach = approach
        self.retract = retract
        self.tilt = 0.0, 0.0
        self.tilted = 0.0  # change of K with the other baseline, if it fits as well
        position, force = approach[:2]
        stiffness, self.zero, offset = _search(approach[:2], tip.exponent)
        self.scale = float(position.max()) - self.zero
        self.peak = stiffness * self.scale**tip.exponent
        self.thinness = tip.thinness(self.scale)
        far = np.flatnonzero(position < self.zero - self.scale)
        near = int(far[-1]) + 1 if far.size else 0
        starts = _starts(0, near, _AIR), _starts(near, position.size, _NEAR)
        (x, y), self.counts = _means(approach[:2], np.concatenate(starts))
        self.x = (x - self.zero) / self.scale
        self.y = y / self.peak
        self.length = max(1.0, -float(self.x.min()))
        begin = np.array([1.0, 0.0, offset / self.peak, 0.0])
        self.solution, self.errors = self.minimise(begin, steps=_STEPS)
        if not self.solution[0] > 0.0:
            raise np.linalg.LinAlgError
        self.unweighted = self.minimise(self.solution, zone=0.0)
        self.bent = self.minimise(self.solution, extra="bend")
        depth = (position - self.zero) / self.scale - self.solution[1]
        self.inside = depth > 0.0
        self.depths = self.scale * depth[self.inside]
        self.air = int(np.argmax(depth > -ZONE))
        jumps = np.diff(force[: max(self.air, _FEWEST)])
        self.noise = float(np.sqrt(0.5 * np.mean(jumps**2)))

    def minimise(
        self,
        begin: Floats,
        *,
        steps: int = _REFIT_STEPS,
        zone: float = ZONE,
        deepest: float = math.inf,
        extra: Literal["bend", "jump", "exponent", "layer"] | None = None,
    ) -> tuple[Floats, Floats]:
        """Return K, d, F₀, s and an extra parameter, if any, with standard errors.

        Not by :func:`~palpate.method.estimators.least_squares.least_squares`: the weight of a
        sample depends on its distance to the contact point, which is fitted.

        Parameters
        ----------
        begin : numpy.ndarray
            K, d, F₀ and s to begin with.
        steps : int
            Largest number of Gauss–Newton steps.
        zone : float
            Part of the indentation in which samples count less.
        deepest : float
            Largest depth used, over the indentation.
        extra : str, optional
            Fit also the bend of the baseline, a parabola; a jump of the force at the contact point;
            the difference of the exponent to that of the tip; or of the contact's radius over the
            thickness of the sample.
        """
        m = self.tip.exponent
        used = self.x - begin[1] <= deepest
        x = self.x[used]
        y = self.y[used]
        counts = self.counts[used]
        solution = np.append(begin, [0.0] * (extra is not None))
        columns = np.ones((solution.size, x.size))
        columns[3] = x / self.length
        if extra == "bend":
            columns[4] = columns[3] ** 2
        linear = slice(2, 4 if extra in ("exponent", "layer") else None)
        thinness = self.thinness
        for _ in range(steps):
            depth = x - solution[1]
            weight = counts
            if zone:
                width = zone * (1.0 - solution[1])
                weight = counts * np.minimum(np.abs(depth) / width, 1.0) ** 2
            touching = depth > 0.0
            inside = np.where(touching, depth, 1.0)  # log 1 = 0
            if extra == "exponent":
                m = self.tip.exponent + solution[4]
            if extra == "layer":
                thinness = self.thinness + max(solution[4], 0.0)
            radius = inside ** (m - 1.0)  # of the contact, over that at the depth 1
            layer = LAYER(thinness * radius)
            layer_slope = radius * LAYER_SLOPE(thinness * radius)
            slope = radius * touching
            columns[0] = depth * slope * layer
            columns[1] = -(m * layer + (m - 1.0) * thinness * layer_slope) * solution[0] * slope
            if extra == "exponent":
                columns[4] = solution[0] * columns[0] * np.log(inside)
            if extra == "layer":
                columns[4] = solution[0] * depth * slope * layer_slope
            if extra == "jump":
                columns[4] = touching
            rest = y - solution[0] * columns[0] - solution[linear] @ columns[linear]
            weighted = columns * weight
            inverse = np.linalg.inv(weighted @ columns.T)
            change = inverse @ (weighted @ rest)
            most = 0.3 * (1.0 - solution[1])
            change[1] = min(max(change[1], -most), most)
            if extra == "exponent":
                change[4] = min(max(change[4], -0.3), 0.3)
            solution = solution + change
            if abs(change[1]) < 1e-3 * most and (extra != "exponent" or abs(change[4]) < 0.01):
                break
        # Neighbouring residuals have common causes: the sums of the scores of blocks vary.
        free = depth < -ZONE
        scores = weighted * rest
        # In contact the noise of the force moves the tip too, along the slope of the curve.
        variance = np.empty(x.size)
        for part, fitted in ((free, 2), (~free, solution.size)):
            count = max(np.count_nonzero(part) - fitted, 1)
            variance[part] = counts[part] @ rest[part] ** 2 / count
        noise = (weighted * (variance * weight / counts)) @ columns.T
        sums = np.add.reduceat(scores, np.arange(0, x.size, _TOGETHER), axis=1)
        spread = np.maximum(np.diag(inverse @ noise @ inverse), ((inverse @ sums) ** 2).sum(axis=1))
        return solution, np.sqrt(spread)

    def above_baseline(self, signals: Floats) -> tuple[Floats, Floats]:
        """Return depth and force above the baseline, over the indentation and the peak force."""
        _, point, level, slope = self.solution
        x = (signals[0] - self.zero) / self.scale
        return np.maximum(x - point, 0.0), signals[1] / self.peak - level - slope * x / self.length

    def residuals(self, signals: Floats) -> Floats:
        """Return the force minus the fitted one, over the peak force."""
        depth, force = self.above_baseline(signals)
        radius = depth ** (self.tip.exponent - 1.0)
        law: Floats = self.solution[0] * depth * radius * LAYER(self.thinness * radius)
        return force - law

    def misfit(self, compliance: float) -> float:
        """Root mean square of the noise of the force that explains the residuals, N.

        With this compliance, m/N, the noise moves the position as well, along the slope of the fit.
        """
        residuals = self.residuals(self.approach)
        step = 1e-4 * self.scale
        deeper = self.residuals(self.approach + np.array([[step], [0.0], [0.0], [0.0]]))
        slope = self.peak * (residuals - deeper) / step
        return float(self.peak * rms(residuals / (1.0 + compliance * slope)))

    @property
    def stiffness(self) -> float:
        """K, N/mᵐ."""
        return float(self.peak / self.scale**self.tip.exponent * self.solution[0])

    def stiffness_change(self, other: tuple[Floats, Floats]) -> float:
        """Return the relative change of K in another fit."""
        return float(other[0][0] / self.solution[0] - 1.0)

    @cached_property
    def pull_off(self) -> float:
        """The largest pull of the sample during the retract, N; 0 if it is not certain."""
        if self.retract.shape[1] < 4 * _FEWEST:
            return 0.0
        (x, y), _ = _means(self.retract[:2], _starts(0, self.retract.shape[1], _AIR + _NEAR))
        depth = (x - self.zero) / self.scale
        force = y / self.peak - self.solution[3] * depth / self.length
        free = depth < -1.0
        if np.count_nonzero(free) < _FEWEST or free.all():
            return 0.0
        nearest = force[free][: _NEAR // 4]
        pull = float(np.median(nearest) - force[~free].min())
        least = max(_LEAST_PULL, _SURE * float(nearest.std()))
        return self.peak * pull if pull > least else 0.0

    @cached_property
    def pulled_in(self) -> tuple[float, float]:
        """A pull that begins at the contact point, N, and the change of K with it; else zeros.

        After a pull-off one standard error is enough, since adhesion raises the K of a sphere by up
        to 20 % (``benchmarks.fleets.force_curves``). Under a flat punch (m = 1) a jump is a shift
        of the contact point: the two columns are the same, and no jump is fitted.
        """
        flat = self.tip.exponent == 1.0
        if flat or (not self.pull_off and self.retract.size):
            return 0.0, 0.0
        solution, errors = self.minimise(self.solution, steps=_SEARCH_STEPS, extra="jump")
        if not solution[-1] < -(1.0 if self.pull_off else _SURE) * errors[-1]:
            return 0.0, 0.0
        return -self.peak * float(solution[-1]), self.stiffness_change((solution, errors))

    def check_exponent(self) -> Iterator[Finding]:
        """Check that the force grows with depth as under this tip."""
        expected = self.tip.exponent
        with suppress(np.linalg.LinAlgError):
            solution, errors = self.minimise(self.solution, steps=_SEARCH_STEPS, extra="exponent")
            difference = float(solution[4])
            error = float(errors[4])
            if abs(difference) <= max(NEXT_SHAPE, _SURE * error):
                return
            found = expected + difference
            near = (k for k, t in TIPS.items() if abs(t.exponent - found) <= NEXT_SHAPE)
            guesses = [f"a {kind}" for kind in near]
            if difference > 0.0 or not guesses:
                guesses.append("a thin sample" if difference > 0.0 else "a sample that relaxes")
            text = f"the curve follows n = {with_error(found, error)}, and under a "
            text += f"{self.tip.kind} n = {expected:g}"
            text += f": {' or '.join(guesses)}?"
            yield Check.TIP_SHAPE.finding(text, _UNEVEN, mark="do-not-trust")

    @cached_property
    def thin(self) -> tuple[float, str]:
        """The relative change of K if the sample is thin, and how thin it is; else 0."""
        # Adhesion, too, makes the curve steeper.
        least = _SURE if self.pull_off else _LIKELY
        with suppress(np.linalg.LinAlgError):
            found = self.minimise(self.solution, steps=_SEARCH_STEPS, extra="layer")
            thinner = float(found[0][4])
            if thinner > least * found[1][4]:
                return abs(self.stiffness_change(found)), rough_percent(self.thinness + thinner)
        return 0.0, ""

    def relaxation(self) -> Iterator[str]:
        """State the speed of the approach if the sample gives back less work than it took."""
        if self.pull_off or not self.retract.size:
            return
        taken = _integrate(*self.above_baseline(self.approach))
        given = _integrate(*self.above_baseline(self.retract))
        returned = -given / taken
        speed = np.ptp(self.depths) / np.ptp(self.approach[3, self.inside])
        if returned < RELAXES and math.isfinite(speed):
            yield (
                f"the sample relaxes: it gives back {rough_percent(returned)} of the work, and "
                f"the modulus is that at {format_quantity(speed, 'm')}/s"
            )

    def systematic_parts(self, depth: float) -> list[_SystematicPart]:
        """Return the systematic errors of the modulus at a depth, the largest first."""
        uneven = abs(self.stiffness_change(self.minimise(self.solution, deepest=LIGHT)))
        pull, by_pull = self.pulled_in
        ball = self.tip.departure(depth)
        thin, radius = self.thin
        parts = (
            (thin, f"the sample may be thin: the contact's radius is {radius} of it", _THIN),
            (abs(self.stiffness_change(self.unweighted)), "the contact point is blurred", _BLURRED),
            (0.5 * uneven, f"light and deep touch differ by {rough_percent(uneven)}", _UNEVEN),
            (abs(self.stiffness_change(self.bent)), "the baseline bends", _STRAIGHT),
            (abs(self.tilted), "the baseline slopes with the tip or with the piezo", _STRAIGHT),
            (abs(by_pull), f"adhesion begins with {format_quantity(pull, 'N')}", _ADHESION),
            (ball, f"the tip sinks in by {rough_percent(10.0 * ball)} of its radius", _DEEP),
        )
        return sorted((_SystematicPart(*part) for part in parts), key=lambda part: -part.size)

    def result(self, poisson_ratio: float | None) -> Indentation:
        """Return the modulus with its errors, its mark and the findings."""
        tip = self.tip
        (k, point, level, slope) = self.solution
        depth = median(self.depths)
        parts = self.systematic_parts(depth)
        systematic = math.hypot(*(part.size for part in parts))
        unit = self.peak / self.scale**tip.exponent
        stiffness = Quantity(unit * k, unit * self.errors[0], unit * k * systematic)
        moved = self.unweighted[0][1] - point
        errors = self.scale * self.errors[1], self.scale * abs(moved)
        contact_point = Quantity(self.zero + self.scale * point, *errors)
        slope *= self.peak / (self.scale * self.length)
        baseline = self.peak * level + slope * self.scale * point, slope
        refused = None
        if not tip.holds(depth):
            deep = format_quantity(depth, "m")
            refused = f"the working depth, {deep}, is larger than the {tip.kind} allows"
        relative = float(self.errors[0] / k)
        findings = [*self.check_curve(), *self.check_exponent()]
        findings += _check_modulus(relative, parts, refused)
        mark = worst(*(each.stiffness for each in findings))
        reasons = [each.message for each in findings if each.stiffness == mark != "trust"]
        ratio = INCOMPRESSIBLE if poisson_ratio is None else poisson_ratio
        exponent = Quantity(tip.exponent, 0.0, 0.0)
        known = (tip, ratio, exponent, poisson_ratio is None, refused)
        value = UNKNOWN if refused else stiffness.scaled((1.0 - ratio**2) / tip.factor)
        remarks = (*reasons[:1], *tip.limitations(depth), *self.relaxation())
        modulus = ElasticModulus(value, *known, remarks, mark)
        residual = self.peak * rms(self.residuals(self.approach)[self.inside])
        largest = self.scale * (1.0 - point)
        samples = self.inside.size
        counts = samples, self.depths.size, tuple(findings)
        return Indentation(
            modulus,
            stiffness,
            contact_point,
            baseline,
            depth,
            largest,
            residual,
            *counts,
            self.tilt,
        )

    def check_curve(self) -> Iterator[Finding]:
        """Check the contact point, the indentation, the baseline, and look for adhesion."""
        contact = self.depths.size
        air = self.air
        depth = self.scale * (1.0 - self.solution[1])
        error = self.scale * self.errors[1]
        if contact < _FEWEST or air < _FEWEST or self.x[0] > -1.0:
            text = f"at an edge of the approach: {air} samples in air, {contact} in contact"
            remedy = "start farther above the sample, or record more samples in contact"
            yield Check.CONTACT_POINT.finding(
                f"the contact point lies {text}",
                remedy,
                mark="do-not-trust",
            )
        force = self.peak * self.solution[0] * (1.0 - self.solution[1]) ** self.tip.exponent
        if not (force > _SURE * self.noise and depth > _SURE * error):
            deep = with_error(1e9 * depth, 1e9 * error, unit="nm")
            size = with_error(1e9 * force, 1e9 * self.noise, unit="nN")
            text = f"the indentation is below three times its noise: {deep}, {size}"
            remedy = "press harder, or average several curves of one place"
            yield Check.INDENTATION.finding(text, remedy, mark="do-not-trust")
        bent, errors = self.bent
        bend = 0.25 * self.peak * float(abs(bent[4]))
        z = float(abs(bent[4] / errors[4]))
        if z > _SURE and bend > self.noise:
            moves = 100.0 * self.stiffness_change(self.bent), math.nan
            text = f"the baseline bends by {format_quantity(bend, 'N')}"
            yield Check.BASELINE.finding(text, _STRAIGHT, z, moves_percent=moves)
        if self.pull_off or self.pulled_in[0]:
            pull, by_pull = self.pulled_in
            largest = format_quantity(max(self.pull_off, pull), "N")
            text = f"the sample adheres: it pulls the tip with {largest}"
            if pull:
                text += f", and with {format_quantity(pull, 'N')} already on approach"
            moves = 100.0 * by_pull, math.nan
            yield Check.PULL_OFF.finding(text, _ADHESION, moves_percent=moves)


def _check_modulus(
    relative: float,
    parts: Sequence[_SystematicPart],
    refused: str | None,
) -> Iterator[Finding]:
    """Report a modulus that is refused, or whose error bar is too wide to trust."""
    error = math.hypot(relative, *(part.size for part in parts))
    if refused is not None:
        yield Check.MODULUS.finding(f"no modulus: {refused}", mark="do-not-trust")
    elif (mark := error_mark(error)) != "trust":
        _, cause, remedy = parts[0]
        if parts[0].size < relative:
            cause = "the force scatters"
            remedy = "average several curves of one place"
        text = f"Young's modulus is known to ± {rough_percent(error)}, since {cause}"
        yield Check.MODULUS.finding(text, remedy, mark=mark)
