"""From causes to a verdict: which one is named, which remain possible, and their marks."""

import math
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from palpate.diagnosis.finding import SELECT_LAW, Quantity, WorkingDepth
from palpate.diagnosis.fit import (
    FEWEST_FREE,
    FEWEST_ROWS,
    NOISE_LIKE,
    SIGNIFICANT,
    Fit,
    MisfitHypothesis,
    MovedSamples,
    augmented_fit,
    deeper_half,
)
from palpate.digits import format_quantity, rounded, with_error
from palpate.estimators.least_squares import mean_error, robust_covariance
from palpate.estimators.variable_projection import ConstrainedEstimate
from palpate.findings import Finding, Mark, Severity, worst
from palpate.force_laws import HuntCrossley
from palpate.preparation.gates import dead_band_of
from palpate.preparation.surfaces import placed
from palpate.validation import Floats

_UNDETECTED = "by friction or a delay that the recording cannot exclude"
_LAWS = "since other laws fit as well"
# Causes of the material. Where a law was selected they change no bar: it has them, or not.
MATERIAL = frozenset(["memory", "damping form", "damping with depth", "shape", "square speed"])
# How far a cause changes the result: judgement, not calibration.
CARE = 0.05
STOP_STIFFNESS, STOP_DAMPING = 0.20, 0.50
# The surface is named before a cause that removes so little more, in a fit that is no worse: looked
# up on recordings, not calibrated.
NEAR, MOST_UNEXPLAINED = 0.25, 0.15
ALIKE = 0.7  # of the named cause's gain: such a rival's influence counts in full
SURE = 0.6  # (1 − g₁)/(1 − g₂) below which a cause is named by itself
SOUGHT = ("change", "skew jump")  # among borders
UNDETECTED = ("friction", "delay")
UNDETECTED_ERRORS = 2.0
MATTERS = 0.02  # of a number


@dataclass(frozen=True, slots=True)
class Judged:
    """Findings of the causes, and what they may be wrong by.

    Attributes
    ----------
    findings : list of Finding
        One for each significant cause, the named one first.
    counted : tuple of (MisfitHypothesis, float)
        The causes that may have changed stiffness and damping, each with its weight.
    least : tuple of float
        Least systematic parts of stiffness and damping, of their size.
    undetected : tuple of float
        What causes that are not significant may add to them.
    sources : tuple of (str, str or None, (float, float))
        What ``least`` is made of: in words, the next step, and both parts.
    skew : float
        Skew between force and position that the law cannot tell from damping, s; 0 where it can, or
        where the clocks are known.
    """

    findings: list[Finding]
    counted: tuple[tuple[MisfitHypothesis, float], ...] = ()
    least: tuple[float, float] = (0.0, 0.0)
    undetected: tuple[float, float] = (0.0, 0.0)
    sources: tuple[tuple[str, str | None, tuple[float, float]], ...] = ()
    skew: float = 0.0

    def largest(self, fit: Fit, number: int, quantity: Quantity) -> tuple[str, str | None]:
        """What sets most of the bar of stiffness (0) or damping (1), and the next step."""
        size = fit.sizes[number]
        parts = [
            (weight * abs(each.moves(fit)[number]), f"since {each.sentence}", each.remedy)
            for each, weight in self.counted
        ]
        parts += [(moves[number], words, remedy) for words, remedy, moves in self.sources]
        parts.append((self.undetected[number], _UNDETECTED, "press along the surface normal"))
        if fit.response is not None:
            parts.append((float(_spread(fit)[number]) / size, _LAWS, "record a longer motion"))
        wide = "move faster and over a wider range of depths"
        parts.append((quantity.standard_error / size, "by the noise and the motion", wide))
        return max(parts, key=lambda each: each[0])[1:]

    def systematic(self, fit: Fit) -> tuple[float, float]:
        """Systematic parts of stiffness and damping at the fit's working depth, of their size."""
        moved = [weight * np.abs(each.moves(fit)) for each, weight in self.counted]
        both = np.array([self.least, self.undetected, *moved])
        stiffness, damping = both.max(axis=0).tolist()
        return stiffness, damping


def judge(
    causes: list[MisfitHypothesis], unexplained: float, *, near_noise: bool, selected: bool = False
) -> Judged:
    """Name one of the significant causes, and weigh all of them.

    Parameters
    ----------
    causes : list of MisfitHypothesis
        All that were tried.
    unexplained : float
        Fraction of the force that the law leaves.
    near_noise : bool
        Whether what it leaves is little more than noise.
    selected : bool
        Whether the law was selected, so that causes of the material are its own.
    """
    significant = [cause for cause in causes if cause.z > SIGNIFICANT]
    significant.sort(key=attrgetter("gain"), reverse=True)
    if not significant:
        return Judged([], undetected=undetected(causes))
    named = _named(significant, unexplained)
    rivals = [c for c in significant if c is not named and not _explained_by(named, c)]
    findings = [_finding(_in_doubt(named, rivals), 1.0, leading=True, near_noise=near_noise)]
    highest = max(named.gain, 1e-9)
    for rival in rivals:
        weight = 0.5 if rival.gain > 0.5 * highest else 0.25
        findings.append(_finding(rival, weight, leading=False, near_noise=near_noise))
    own = MATERIAL if selected else frozenset()
    small = named.small and near_noise
    counted = [] if small or named.name in own else [(named, 1.0)]
    for rival in rivals:
        if rival.name in ("offset drift", *own) or (rival.small and near_noise):
            continue
        relative = rival.gain / highest
        counted.append((rival, 1.0 if relative > ALIKE else 0.5 * relative))
    return Judged(findings, tuple(counted), undetected=undetected(causes))


def undetected(causes: list[MisfitHypothesis]) -> tuple[float, float]:
    """How far friction or a skew that is not significant may move stiffness and damping.

    No recording is without some. As far as it seems to, or by two standard errors of that; not
    where both are so little that they matter to nobody.
    """
    moved = [(0.0, 0.0)]
    for cause in causes:
        if cause.name in UNDETECTED and 0.0 < cause.z <= SIGNIFICANT:
            wide = max(1.0, UNDETECTED_ERRORS / cause.z)
            moved.append((wide * abs(cause.stiffness), wide * abs(cause.damping)))
    stiffness, damping = np.max(moved, axis=0).tolist()
    return stiffness * (stiffness > MATTERS), damping * (damping > MATTERS)


def _named(significant: list[MisfitHypothesis], unexplained: float) -> MisfitHypothesis:
    """The largest gain; or the surface, which hardly shows in the residual, where it comes near.

    Not where the largest surely explains more: a surface fits some of any damper of another form.
    """
    first = significant[0]
    for cause in significant:
        near = first.gain - max(cause.gain, 0.0) < NEAR and not _surely(first, cause)
        if cause.name == "surface" and unexplained < MOST_UNEXPLAINED and (near or cause is first):
            return cause
    return first


def _explained_by(named: MisfitHypothesis, rival: MisfitHypothesis) -> bool:
    """Whether a change, or a jump, is only what borders anywhere fit of another cause.

    Borders are sought, so they fit some of any misfit: a change that explains far less than the
    named cause was listed for one in ten stationary recordings.
    """
    if rival.name not in SOUGHT or named.family == rival.family:
        return False
    less = rival.gain < ALIKE * named.gain or _surely(named, rival)
    return named.name == "surface" or less


def _surely(named: MisfitHypothesis, rival: MisfitHypothesis) -> bool:
    return (1.0 - named.gain) < SURE * (1.0 - rival.gain)


def _in_doubt(named: MisfitHypothesis, rivals: list[MisfitHypothesis]) -> MisfitHypothesis:
    """Say the second cause too, unless the first explains far more."""
    others = [rival for rival in rivals if rival.family != named.family]
    if not others:
        return named
    second = max(others, key=attrgetter("gain"))
    if named.name == "surface" or _surely(named, second):
        return named
    return replace(named, sentence=f"{named.sentence}, or {second.sentence}")


def _finding(cause: MisfitHypothesis, weight: float, *, leading: bool, near_noise: bool) -> Finding:
    stiffness, damping = marks_of(cause, weight)
    if cause.name in ("change", "adhesion"):  # no one law describes it
        stiffness = damping = "with-care"
    if not leading:  # a rival is not what happened, so at most care
        stiffness, damping = (
            "with-care" if mark == "do-not-trust" else mark for mark in (stiffness, damping)
        )
    elif not cause.settled:
        stiffness, damping = worst(stiffness, "with-care"), worst(damping, "with-care")
    if cause.small and near_noise:
        return finding_of(cause, "note", "trust", "trust")
    return finding_of(cause, "with-care" if leading else "note", stiffness, damping)


def finding_of(
    cause: MisfitHypothesis, severity: Severity, stiffness: Mark, damping: Mark
) -> Finding:
    """Return a cause as a finding, of this severity or what the marks make it."""
    moves = 100.0 * cause.stiffness, 100.0 * cause.damping
    words = cause.name, cause.sentence, cause.remedy
    return Finding(*words, severity, cause.z, stiffness, damping, *moves)


def marks_of(cause: MisfitHypothesis, weight: float = 1.0) -> tuple[Mark, Mark]:
    """Return the marks of stiffness and damping, by how far a cause moves them."""
    stiffness = mark_of(weight * abs(cause.stiffness), STOP_STIFFNESS)
    return stiffness, mark_of(weight * abs(cause.damping), STOP_DAMPING)


def mark_of(moved: float, stop: float) -> Mark:
    """The mark of a number that is moved so far, of its size."""
    if moved > stop:
        return "do-not-trust"
    return "with-care" if moved > CARE else "trust"


# Surface: where the material begins, against where the penetration says that it does.

MOST_IN_CONTACT, MOST_FREE = 3000, 1500
STARTS = (-1.0, -0.3, -0.1, 0.0, 0.1)  # of the working depth
FEWEST_MOVED = 0.005  # of the working depth; less moves no number by more than noise does
# Times the penetration's noise, its steps included: half an encoder count is no other surface.
RESOLVED = 5.0


def surface(fit: Fit) -> list[MisfitHypothesis]:
    """Levenberg–Marquardt on (k, c, n, F₀, d), the free approach included; Hunt–Crossley only."""
    law = fit.solution.law
    if not law.power_law or not fit.with_offset:
        return []
    if not fit.free_air or fit.estimate.surface_standard_error:
        return []
    given = (*law.parameters, fit.solution.offset)
    starts = np.array([(*given, start) for start in STARTS])
    after = placed(_samples(fit), starts, exponent_fixed=bool(fit.fixed))
    depth = after.parameters[4]
    if abs(depth) < max(FEWEST_MOVED, RESOLVED * fit.data.penetration_noise / fit.reference):
        return []
    error = math.sqrt(robust_covariance(after.jacobian, after.residual)[-1, -1])
    # Of the band's residual, by a fit below this surface.
    motion = MovedSamples(np.maximum(fit.x - depth, 1e-9), fit.v, fit.band, fit.force)
    law, zero = HuntCrossley(*after.parameters[:3]), float(after.parameters[3])
    energy = fit.solve(law, zero, motion).energy
    settled = math.sqrt(energy / len(fit.band)) < NOISE_LIKE * fit.floor
    return [_described(fit, after.parameters, error, max(fit.gain(energy), 0.0), settled)]


def _described(
    fit: Fit, found: Floats, error: float, gain: float, settled: bool
) -> MisfitHypothesis:
    k, c, n, _, depth = found.tolist()
    before, reference = fit.solution.law, fit.reference

    def moves(other: Fit) -> tuple[float, float]:
        at = max(other.depth / reference - depth, 0.05)
        stiffness, damping = n * k * at ** (n - 1.0) / reference, c * at**n / other.speed
        return other.apart((stiffness, damping), before)

    after = fit.units.restored(HuntCrossley(k, c, n)).parameters / fit.law.parameters - 1.0
    way = "deeper than zero penetration" if depth > 0.0 else "above zero penetration"
    sentence = (
        f"the surface is {format_quantity(abs(depth) * reference, 'm')} ± "
        f"{format_quantity(error * reference, 'm')} {way}: with it K changes by {after[0]:+.0%} "
        f"and B by {after[1]:+.0%}"
    )
    by = moves(fit)
    if settled and max(map(abs, by)) < CARE:
        sentence += ", stiffness and damping at working depth hardly at all"
    elif not settled:
        sentence += ", but the force is still not explained to the noise"
    parameter = abs((n - before.parameters[2]) * math.log(reference)) + n * abs(depth)
    z = abs(depth) / max(error, 1e-300)
    remedy = "run again with --surface estimate"
    if not fit.finds_surface:
        remedy = "run again with --method variable-projection --surface estimate"
    words = sentence, remedy
    return MisfitHypothesis("surface", z, gain, parameter, *words, moves, *by, settled)


def _samples(fit: Fit) -> Floats:
    """Contact, free approach and what lies between, thinned."""
    between, chosen = fit.outside & (fit.penetration >= 0.0), []
    if band := dead_band_of(fit.data.contact):  # where the sensor shows no force that is there
        between &= fit.data.force >= band
    for kept, most in ((fit.inside, MOST_IN_CONTACT), (fit.free, MOST_FREE), (between, MOST_FREE)):
        index = np.flatnonzero(kept)
        chosen.append(index[:: -(-index.size // most) or 1])
    at, data = np.sort(np.concatenate(chosen)), fit.data
    x, v = fit.penetration[at] / fit.units.depth, data.velocity[at] / fit.units.speed
    return np.array([x, v, data.force[at]])


# Misfit, offset, excitation and the method's own error: checks of the fit as a whole.

UNEXPLAINED, TOO_MUCH_UNEXPLAINED = 0.05, 0.30  # of the force
OFFSET_Z, OFFSET_PART = 5.0, 0.01
FEWEST_SAMPLES = 60
METHOD_Z = 5.0  # a method that is off by more, but by no more than calls for care, gets a note


def unexplained(fit: Fit) -> float:
    """Fraction of the force that neither law nor noise explains."""
    spread = float(np.std(fit.force))
    square = fit.solution.energy / max(len(fit.band), 1) - 2.0 * fit.floor**2
    return math.sqrt(max(square, 0.0)) / spread if spread > 0.0 else 0.0


def misfit(fit: Fit) -> Finding | None:
    """The law leaves more than 5 % of the force, or three times the noise."""
    left, times = unexplained(fit), fit.ratio
    if left <= UNEXPLAINED and not fit.misfits:
        return None
    part = rounded(left, 2) if left < 0.01 else f"{left:.0%}"
    remedy = SELECT_LAW if fit.laws is None else deeper_half(fit)
    mark: Mark = "do-not-trust" if left > TOO_MUCH_UNEXPLAINED else "trust"
    return Finding.of_both(
        mark,
        "misfit",
        f"the law leaves {part} of the force unexplained ({rounded(times, 2)} times the noise)",
        remedy,
        times,
    )


def _percent(part: float) -> str:
    return f"{part:.0%}" if 0.01 <= part < 2.0 else "under 1%" if part < 2.0 else "over 200%"


#: Standard errors, and part of the number, above which a slope in free air is one.
AIR_Z, AIR_PART = 6.0, 0.01


def air(fit: Fit) -> Finding | None:
    """The force in free air follows the probe's position or velocity.

    What moves with the probe there moves with it in contact: its slope adds to the stiffness, its
    drag to the damping.
    """
    slopes, errors = np.array(fit.air.slopes), np.array(fit.air.errors)
    moved = np.where(np.abs(slopes) > AIR_Z * errors, slopes / fit.sizes, 0.0)
    moved = np.where(np.abs(moved) > AIR_PART, moved, 0.0)
    if not moved.any():
        return None
    parts = zip(("stiffness", "damping"), moved.tolist(), strict=True)
    much = " and ".join(f"{name} by {_percent(abs(by))}" for name, by in parts if by)
    return Finding(
        "free air",
        "the force changes with the motion in free air: a cable, a guide or a mass that moves "
        f"with the probe changes {much}",
        "route the cable so that it does not pull, and subtract the force measured in free air",
        "with-care",
        float(np.max(np.abs(slopes) / errors)),
        mark_of(abs(moved[0]), STOP_STIFFNESS),
        mark_of(abs(moved[1]), STOP_DAMPING),
        100.0 * float(moved[0]),
        100.0 * float(moved[1]),
        brief="the force in free air changes with the motion",
    )


def offset(fit: Fit) -> Finding | None:
    """The offset that the fit wants is not the force in free air."""
    free = np.flatnonzero(fit.free)
    if free.size < FEWEST_FREE or not fit.with_offset:
        return None
    x = fit.penetration[free]
    force = fit.data.force[free[x <= np.median(x)]]
    difference = fit.solution.offset - float(force.mean())
    error = math.hypot(math.sqrt(fit.covariance[-1, -1]), mean_error(force))
    z = abs(difference) / max(error, 1e-300)
    if z <= OFFSET_Z or abs(difference) <= OFFSET_PART * fit.data.peak_force:
        return None
    return Finding(
        "offset",
        f"the fitted force offset is {format_quantity(abs(difference), 'N')} "
        f"{'above' if difference > 0 else 'below'} the force in free air: another law at light "
        "touch, or a wrong tare",
        f"tare in free air: --tare {_longest_free(fit)}",
        "with-care",
        z,
    )


def _longest_free(fit: Fit) -> str:
    """The longest time without contact, START:STOP, s."""
    edges = np.flatnonzero(np.diff(np.r_[0, fit.free, 0]))
    starts, stops = edges[::2], edges[1::2] - 1
    k = int(np.argmax(stops - starts))
    ends = (float(fit.data.time[at]) for at in (starts[k], stops[k]))
    return ":".join(f"{end:.3f}".rstrip("0").rstrip(".") for end in ends)


def excitation(fit: Fit) -> Finding | None:
    """There are too few samples to check the law."""
    count = int(np.count_nonzero(fit.inside))
    if count < FEWEST_SAMPLES or len(fit.band) < FEWEST_ROWS // 2:
        words = f"only {count} samples in contact"
        return Finding.of_both("do-not-trust", "excitation", words, "record longer")
    return None


def extrapolation(fit: Fit) -> Finding | None:
    """The working depth that is asked for is not among the depths of the recording."""
    least, peak = fit.range
    if least <= fit.depth <= peak:
        return None
    return Finding.of_both(
        "with-care",
        "depth",
        f"the working depth, {format_quantity(fit.depth, 'm')}, is outside the recorded depths, "
        f"{format_quantity(least, 'm')} to {format_quantity(peak, 'm')}: the law is extrapolated",
        f"choose a recorded depth: --at {1e3 * fit.reference:.2g}mm",
    )


def standard_errors(fit: Fit) -> Floats:
    """Of force, stiffness and damping at the working depth, SI, shape (3,).

    The covariance takes the noise to be the same at all depths. Where it is larger where it matters
    (White 1980), as in proportion to force, Σ u² e² exceeds Σ u² ⟨e²⟩ by the influences u.
    """
    names, residual = len(fit.solution.law.symbols), fit.solution.residual
    variances = np.diag(fit.gradients @ fit.covariance[:names, :names] @ fit.gradients.T)
    influences = (fit.gradients @ fit.solution.inverse[:names]) ** 2
    pooled = influences.sum(axis=1) * np.mean(residual**2)
    uneven = influences @ residual**2 / np.maximum(pooled, np.finfo(float).tiny)
    errors: Floats = np.sqrt(np.maximum(variances, 0.0) * np.maximum(uneven, 1.0))
    return errors


def off_least_squares(fit: Fit) -> Floats:
    """How far the method's force, stiffness and damping are off its law's least squares, SI, (3,).

    A method that forgets, or weighs light touch as much as firm, has an answer of its own, and no
    error bar of the least squares is about it.
    """
    own, best = fit.units.local(fit.estimate.law), fit.solution.law
    return fit.felt(own) - fit.felt(best)


def method(fit: Fit) -> Finding | None:
    """The method's own answer is not the least squares of its law on these samples."""
    if isinstance(fit.estimate, ConstrainedEstimate):
        return None  # under a prior, and reported
    apart = off_least_squares(fit)[1:]
    z = float(np.max(np.abs(apart) / np.maximum(standard_errors(fit)[1:], 1e-300)))
    if z <= METHOD_Z:
        return None
    off_s, off_c = (apart / fit.sizes).tolist()
    large = max(abs(off_s), abs(off_c)) > CARE
    own = fit.method == "variable-projection"
    remedy = deeper_half(fit) if own else "run again with --method variable-projection"
    whose = f"{fit.method} fails here: its" if large else "the method's"
    return Finding(
        "method",
        f"{whose} stiffness is {off_s:+.1%} and its damping {off_c:+.1%} off the least-squares fit "
        f"of its own law ({rounded(z, 2)} standard errors)",
        remedy,
        z=z,
        stiffness=mark_of(abs(off_s), STOP_STIFFNESS),
        damping=mark_of(abs(off_c), STOP_DAMPING),
        moves_stiffness_percent=-100.0 * off_s,
        moves_damping_percent=-100.0 * off_c,
    )


# Force, stiffness and damping at a depth, with what they may be wrong by.

# Standard errors that a number is off before that counts: less widens no bar by over an eighth.
OFF = 0.5


def working_depth(fit: Fit, judged: Judged) -> WorkingDepth:
    """Return the numbers at the fit's working depth.

    Parameters
    ----------
    fit : Fit
        At its working depth.
    judged : Judged
        The causes that may move them.
    """
    errors = standard_errors(fit)
    moved = np.zeros(3)
    moved[1:] = np.multiply(judged.systematic(fit), fit.sizes)
    apart = np.abs(off_least_squares(fit))
    moved = np.maximum(moved, np.where(apart > OFF * errors, apart, 0.0))
    if not fit.with_offset:
        moved = np.maximum(moved, _without_offset(fit))
    if fit.equivalent is not None:
        # Where memory was taken out of the force, its least squares take it for known.
        own = fit.equivalent.own_errors
        errors = np.where(own > errors, own, errors)
    if fit.response is not None:
        if fit.equivalent is not None:
            errors[1:] = fit.response.at(fit.depth, fit.frequency)[1]
        moved[1:] = np.maximum(moved[1:], _spread(fit))
    return _numbers(fit, _with_surface(fit, errors), moved)


def _spread(fit: Fit) -> Floats:
    """How far other laws that fit as well, and the misfit, may move stiffness and damping."""
    assert fit.response is not None
    values = np.array(fit.estimate.law.at_rest(fit.depth)[1:])
    return fit.response.systematic(values, fit.depth, fit.frequency)


#: Standard errors, all causes together, of the number: up to the first it is trusted, beyond the
#: second it is not.
TRUSTED, STOPPED = (0.10, 0.20), (0.25, 0.60)
IN_STEP = "if one clock stamps both, run again with --skew 0.1ms"
_NAMES, _UNITS = ("stiffness", "damping"), ("N/m", "N·s/m")


def precision(fit: Fit, at: WorkingDepth, judged: Judged) -> list[Finding]:
    """Numbers that their error bars do not let a reader trust, with what sets the bar."""
    found = []
    for k, (name, unit) in enumerate(zip(_NAMES, _UNITS, strict=True)):
        quantity: Quantity = getattr(at, name)
        bar, size = quantity.whole_error, abs(quantity.value)
        words, sign = f"the {name} is known to ± {_percent(bar / size if size else math.inf)}", ""
        mark: Mark = "trust"
        if not bar <= TRUSTED[k] * size:
            mark = "with-care" if bar <= STOPPED[k] * size else "do-not-trust"
        if not size > 2.0 * bar:
            mark = "do-not-trust"
            sign = "its sign is open, "
            words = f"the sign of the {name} is open: {with_error(quantity.value, bar, unit=unit)}"
        elif quantity.value < 0.0:  # no passive material has one
            mark = "do-not-trust"
            sign = "it is negative, "
            words = f"the {name} is negative, {with_error(quantity.value, bar, unit=unit)}"
        source, remedy = judged.largest(fit, k, quantity)
        if mark == "trust":
            if not (name == "damping" and judged.skew):
                continue
            # Of 46 such laws that a sensor's fault had made of Hunt and Crossley's, 13 were beyond.
            mark, remedy = "with-care", IN_STEP
            step = format_quantity(judged.skew, "s", digits=1)
            source = f"if force and position are in step to {step}: this law cannot tell"
        marks = {name: mark}
        told = "precision", f"{words}, {source}", remedy
        found.append(Finding(*told, brief=f"{sign}{source}", **marks))  # type: ignore[arg-type]
    return found


def nothing_known(fit: Fit) -> WorkingDepth:
    """Return the numbers at the working depth of a fit that could not be checked."""
    unknown = np.full(3, math.nan)
    return _numbers(fit, unknown, np.zeros(3) if math.isfinite(fit.depth) else unknown)


def _without_offset(fit: Fit) -> Floats:
    """How far the numbers of a method that knows no offset move when one is fitted beside its law.

    No tare is exact; what it leaves is in no residual that a stiffness can take up.
    """
    found = augmented_fit(fit, np.ones(len(fit.band)))
    if found is None:
        return np.zeros(3)
    moved = np.abs(fit.gradients @ found.change[: len(fit.solution.law.symbols)])
    return np.where(np.isfinite(moved), moved, 0.0)


def _numbers(fit: Fit, errors: Floats, moved: Floats) -> WorkingDepth:
    known = math.isfinite(fit.depth)
    values = fit.estimate.law.at_rest(fit.depth) if known else [math.nan] * 3
    return WorkingDepth(fit.depth, *map(Quantity, values, errors.tolist(), moved.tolist()))


def _with_surface(fit: Fit, errors: Floats) -> Floats:
    """With how far the numbers move as the depth does, by the deviation of the surface.

    The law holds at the place where the probe was; how deep that is, no fit knows better than it
    knows the surface.
    """
    law, depth = fit.estimate.law, fit.depth
    deviation = min(fit.data.contact.surface_deviation or 0.0, 0.5 * depth)
    if not deviation > 0.0:
        return errors
    moves = np.subtract(law.at_rest(depth + deviation), law.at_rest(depth - deviation))
    wider: Floats = np.hypot(errors, 0.5 * moves)
    return wider
