"""From an identification to its diagnosis: runs every check of the fit and of its data."""

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from palpate.contact import VelocityFilter
from palpate.diagnosis.change import Changes, changes
from palpate.diagnosis.chosen_law import ahead, relaxed_stiffness
from palpate.diagnosis.data import VELOCITY_NONE, Data
from palpate.diagnosis.delay import (
    adhesion_or_memory,
    columns,
    delay,
    delay_error,
    delay_sensitivity,
    largest_pull,
    skew_jump,
    unseen,
)
from palpate.diagnosis.finding import (
    Diagnosis,
    Episode,
    Laws,
    Quantity,
    WorkingDepth,
    verdict_by,
)
from palpate.diagnosis.fit import FEWEST_ROWS, SIGNIFICANT, Fit, MisfitHypothesis, Search
from palpate.diagnosis.marks import (
    IN_STEP,
    OFF,
    SURE,
    Judged,
    air,
    excitation,
    extrapolation,
    judge,
    method,
    misfit,
    nothing_known,
    offset,
    precision,
    standard_errors,
    surface,
    unexplained,
    working_depth,
)
from palpate.digits import format_quantity, rounded
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.law_verdicts import ONE_WAY
from palpate.estimators.oscillation import Oscillation
from palpate.findings import MAY_CAP, SEVERITIES, Finding, Mark
from palpate.preparation.gates import dead_band_of
from palpate.preparation.held import beat_of
from palpate.preparation.velocity import filter_gain
from palpate.stages import timed

SHORTEST = 5  # samples
MOVES = 4.0  # of the noise or the step, that the law's force moves meanwhile
SOME_FLAT, MANY_FLAT = 0.01, 0.05  # of the samples in contact


def flat(fit: Fit) -> Finding | None:
    """Runs of 5 and more equal forces while the law's force moves by more than 4 max(σ, step).

    Of a force that is held, which has a check of its own, runs of more than two beats; of a dead
    band, which has one too, none. A run ends at the surface.
    """
    force, inside = fit.data.force, fit.inside | (fit.rejected & (fit.penetration > 0.0))
    shortest = max(SHORTEST, math.floor(2.0 * beat_of(force)) + 1)
    changed = np.diff(force, prepend=np.nan, append=np.nan) != 0.0
    below = fit.penetration > 0.0
    changed[1:-1] |= below[1:] != below[:-1]
    borders = np.flatnonzero(changed)
    lengths, began = np.diff(borders), borders[:-1]
    # The samples of a sensor that was lost are not taken: the one before is.
    long = (lengths >= shortest) & below[began] & (inside[began] | inside[np.maximum(began - 1, 0)])
    if band := dead_band_of(fit.data.contact):
        long &= force[began] >= band
    if not long.any():
        return None
    starts, lengths = began[long], lengths[long]
    within = np.repeat(starts - np.cumsum(lengths) + lengths, lengths) + np.arange(lengths.sum())
    model = fit.law.force(np.maximum(fit.penetration[within], 0.0), fit.data.velocity[within])
    runs = np.cumsum(lengths) - lengths
    span = np.maximum.reduceat(model, runs) - np.minimum.reduceat(model, runs)
    stuck = span > MOVES * max(fit.data.force_noise, fit.data.force_step)
    top = float(force[inside].max())
    highest = force[starts] >= top
    count = np.count_nonzero(inside)
    at_top = lengths[stuck & highest].sum() / count
    elsewhere = lengths[stuck & ~highest].sum() / count
    part = max(at_top, elsewhere)
    if part <= SOME_FLAT:
        return None
    mark: Mark = "do-not-trust" if part > MANY_FLAT else "with-care"
    if at_top < elsewhere:
        words = f"the force is constant for {part:.1%} of the contact while the probe moves"
        return Finding.of_both(mark, "stuck force", words, "check the sensor's connection")
    words = (
        f"the force stays at its largest value, {rounded(top, 3)} N, for {part:.1%} of the "
        "contact: the sensor saturates"
    )
    return Finding.of_both(mark, "saturation", words, "use a force sensor with a larger range")


def dead_band(fit: Fit) -> Finding | None:
    """The force is one value in air and at light touch, and none between it and a larger one."""
    band = dead_band_of(fit.data.contact)
    if not band:
        return None
    return Finding(
        "dead band",
        f"the force is zero below {format_quantity(band, 'N', digits=1)}: the sensor or its "
        "firmware has a dead band, and palpate leaves these samples out",
        "switch the threshold off",
    )


# Excluded outliers: always reported, and many of them call for care.

MANY_LEFT_OUT = 0.05  # of the samples in contact


def outliers(count: int, samples: int) -> Finding:
    """Return how many samples in contact were excluded; more than 5 % call for care."""
    part = rounded(100.0 * count / samples, 2)
    return Finding.of_both(
        "with-care" if count > MANY_LEFT_OUT * samples else "trust",
        "outliers",
        f"{count} sample{'s' * (count > 1)} ({part} %) excluded as outlier{'s' * (count > 1)}",
        "if they are real, run again with --no-reject-outliers",
    )


# A motion that goes one way: it passes each depth once, at one speed.


def one_way(fit: Fit) -> Finding | None:
    """Mean velocity in contact over its root mean square is nearly ±1.

    At one speed v spring, damper and memory are functions of the depth alone, x = vt, of which the
    residual shows nothing: that of Hunt and Crossley, K xⁿ + B v xⁿ, is one power. Of laws that
    are compared any may win there, and a half-space's spring even come out negative.
    """
    v = fit.data.velocity[fit.inside]
    if not abs(float(v.mean())) > ONE_WAY * fit.speed:
        return None
    known = "exponent" in fit.estimate.fixed
    return Finding(
        "one way",
        "the probe moves one way at nearly one speed: only the shape of the law separates "
        "stiffness, damping and relaxation, which the error bars do not include",
        "press and release, at several speeds",
        stiffness="trust" if known else "do-not-trust",
        damping="do-not-trust",
        brief="the probe moves one way",
    )


# Noise of the velocity, which makes a damping look smaller than it is.

CARE, STOP = 0.05, 0.50  # of the damping, as for every cause


def velocity_noise(fit: Fit) -> Finding | None:
    """Errors in a regressor attenuate its coefficient: C is too small by σ_v²/⟨v²⟩.

    The noise σ_v is the column's own, from its fourth differences, or what the filter leaves of the
    penetration's, its steps included.
    """
    speed = float(np.mean(fit.data.velocity[fit.inside] ** 2))
    part = fit.data.velocity_noise**2 / speed if speed > 0.0 else 0.0
    if not part > CARE:
        return None
    derived = fit.data.velocity_filter is not None
    whose = (
        "the velocity, differentiated from the penetration," if derived else "the velocity column"
    )
    return Finding(
        "velocity noise",
        f"{whose} is noisy: the damping is about {min(part, 1.0):.0%} too small",
        fit.data.wider_window if derived else VELOCITY_NONE,
        damping="do-not-trust" if part > STOP else "with-care",
        moves_stiffness_percent=0.0,
        moves_damping_percent=100.0 * min(part, 1.0),
    )


# All checks together: from an identification's parts to its diagnosis.

_LOGGER = logging.getLogger(__name__)

#: Each looks at the fit as a whole.
CHECKS = (
    flat,
    dead_band,
    method,
    excitation,
    one_way,
    offset,
    air,
    velocity_noise,
    misfit,
    ahead,
    relaxed_stiffness,
    extrapolation,
)
#: Each looks for causes beside the fit.
SEARCHES: tuple[Search, ...] = (columns, adhesion_or_memory, delay, skew_jump, surface)


@timed("diagnosis")
def diagnose_parts(
    data: Data,
    trace: Trace,
    estimate: Estimate,
    *,
    depths: Sequence[float] = (),
    laws: Laws | None = None,
    notes: Sequence[Finding] = (),
    method: str = "variable-projection",
    response: Oscillation | None = None,
    frequency: float = math.nan,
) -> Diagnosis:
    """Diagnose the identification of a recording.

    Parameters
    ----------
    data : Data
        The recording; its own checks are made once for all methods.
    trace : Trace
        The replay.
    estimate : Estimate
        The last estimate.
    depths : sequence of float
        The working depth, which the verdict is about, and others, m, > 0. Default: the median and
        the 90th percentile of the penetration in contact.
    laws : Laws, optional
        Model selection on the same samples.
    notes : sequence of Finding
        Flags of the estimate and its samples. Of several materials only those that call for care:
        no motion identifies one law for all of them.
    method : str
        Name of the method, for remedies.
    response : Oscillation, optional
        What the selection of a law says of K′ and B′.
    frequency : float, optional
        ω of the motion, rad/s.
    """
    found = list(data.findings)
    with np.errstate(all="ignore"):  # a column of an absurd fit may overflow; it is then left out
        fit = Fit(
            data, trace, estimate, depths[0] if depths else None, laws, method, response, frequency
        )
        others = depths[1:] if depths else fit.deeper
        try:
            if len(fit.band) >= FEWEST_ROWS // 2 and fit.finite:
                return _diagnosed(fit, found, others, notes)
        except np.linalg.LinAlgError:  # of a motion that says nothing, such as a probe held still
            pass
        found = [*data.findings, _nothing_to_check(fit), *notes]
        unknown = tuple(nothing_known(fit.at_depth(d)) for d in (fit.depth, *others))
        return _whole(found, unknown, (), fit.laws)


def _diagnosed(
    fit: Fit, found: list[Finding], others: Sequence[float], notes: Sequence[Finding]
) -> Diagnosis:
    changed = changes(fit)
    causes: list[MisfitHypothesis] = []
    for search in SEARCHES:
        begun = time.perf_counter()
        causes += search(fit)
        _LOGGER.debug("search for %s: %.4f s", search.__name__, time.perf_counter() - begun)
    if changed is not None:
        causes.append(changed.cause)
    selected = fit.response is not None
    judged = judge(causes, unexplained(fit), near_noise=fit.near_noise, selected=selected)
    if not any(finding.check == "change" for finding in judged.findings):
        changed = None
    named_surface = bool(judged.findings) and judged.findings[0].check == "surface"
    found += judged.findings
    if fit.equivalent is not None and not any(f.check in ("adhesion", "change") for f in found):
        found += behind_memory(fit)
    for check in CHECKS:
        finding = check(fit)
        if finding is not None and not (finding.check == "offset" and named_surface):
            found.append(finding)
    found += _notes(fit)
    judged = _with_least_parts(fit, judged, found)
    depths = tuple(working_depth(fit.at_depth(depth), judged) for depth in (fit.depth, *others))
    found += precision(fit, depths[0], judged)
    if any(finding.check == "one way" for finding in found):
        unknown = Quantity(math.nan, math.nan, math.nan)
        depths = tuple(replace(depth, damping=unknown) for depth in depths)
    episodes = () if changed is None else _episodes(fit, changed)
    said = {finding.message for finding in found}
    found += [n for n in notes if n.message not in said and not (episodes and n.severity == "note")]
    return _whole(found, depths, episodes, fit.laws)


def behind_memory(fit: Fit) -> list[Finding]:
    """Adhesion, or a change of the material, that a law which relaxes has taken for its own.

    By Hunt and Crossley's law of the same samples: with adhesion it leaves about as little as the
    law that was selected, or with a change far less.
    """
    given, trace, _ = fit._given
    plain, left = Fit(given, trace, fit.estimate, fit.depth), fit.solution.energy
    causes = []
    if largest_pull(plain) > 0.0:
        pulls = (each for each in adhesion_or_memory(plain) if each.name == "adhesion")
        causes += [(each, left / SURE) for each in pulls if each.z > SIGNIFICANT]
    if not fit.near_noise and (changed := changes(plain)) is not None:
        causes.append((changed.cause, left * SURE))
    return [
        Finding.of_both("with-care", each.name, each.sentence, each.remedy, each.z)
        for each, most in causes
        if (1.0 - each.gain) * plain.solution.energy < most
    ]


#: Checks whose findings say how far they move the numbers; none of them is a column of the fit.
OWN_MOVES = ("velocity noise", "velocity column", "free air")


def _with_least_parts(fit: Fit, judged: Judged, found: list[Finding]) -> Judged:
    """With the least systematic parts: an applied delay, the skew, the velocity and free air."""
    sources: list[tuple[str, str | None, tuple[float, float]]] = []
    if (by_delay := delay_error(fit)) > 0.0:
        words = "by the standard error of the delay"
        sources.append((words, "run again with --delay find", (0.0, by_delay)))
    if (skew := _skew(fit)) > 0.0:
        by_skew = abs(fit.stiffness(fit.solution.law)) * skew / fit.sizes[1]
        words = f"since {rounded(1e3 * skew, 2)} ms of skew between force and position is possible"
        sources.append((words, IN_STEP, (0.0, by_skew)))
    for finding in found:
        if finding.check in OWN_MOVES:
            moves = finding.moves_stiffness_percent, finding.moves_damping_percent
            by_stiffness, by_damping = (0.01 * np.abs(np.nan_to_num(moves, posinf=0.0))).tolist()
            if finding.check != "free air":  # that is of the damping itself
                by_damping *= abs(fit.damping(fit.solution.law)) / fit.sizes[1]
            parts = by_stiffness, by_damping
            sources.append((f"since {finding.brief or finding.message}", finding.remedy, parts))
    if (used := fit.data.velocity_filter) is not None and np.any(fit.v):
        moved = _velocity_error(fit, used) * abs(fit.damping(fit.solution.law))
        if moved > OFF * standard_errors(fit)[2]:
            words = "by the error of the differentiated velocity"
            sources.append((words, fit.data.wider_window, (0.0, moved / fit.sizes[1])))
    stiffness, damping = np.max([judged.least, *(parts for *_, parts in sources)], axis=0).tolist()
    return replace(judged, least=(stiffness, damping), sources=tuple(sources), skew=skew)


#: Skew between force and position that is allowed for where nothing is known of their clocks, s.
#: Half a sample at 66 Hz would make the bar of a damping 140 % that repeats to 8 %.
USUAL_SKEW = 1e-3


def _skew(fit: Fit) -> float:
    """Skew that the law cannot tell from damping, s; 0 for Hunt–Crossley, whose damping tells it.

    K n xⁿ⁻¹ v is not B xⁿ v; but it is what a half-space, a linear damper or a branch adds.
    """
    law = fit.estimate.law if fit.equivalent is None else fit._given[2].law
    if law.power_law:
        return 0.0
    if fit.data.contact.delay is not None:
        return 0.0  # its standard error is counted
    return max(USUAL_SKEW, 0.0 if fit.response is None else fit.response.delay)


def _velocity_error(fit: Fit, used: VelocityFilter) -> float:
    """Relative error of the damping by the velocity's filter: its loss, and the noise it leaves.

    At a frequency ω the slope of a parabola through a window of T loses (ωT/2)²/10 of the velocity,
    where ω² = ⟨a²⟩/⟨v²⟩ counts, and a spline λ h ω⁴, where ω⁴ = ⟨ä²⟩/⟨v²⟩ counts, ä the jerk. The
    damping becomes as much larger, and by noise smaller, as in :func:`velocity_noise`.
    """
    speed = fit.v * fit.units.speed
    if used.degree == 2:  # of order ω², the mean over a window keeps it and lowers the noise
        rate = np.linalg.norm(fit.band.mean(fit.acceleration))
        turn = float(rate / np.linalg.norm(fit.band.mean(speed)))
    else:
        turn = math.sqrt(float(np.linalg.norm(fit.jerk) / np.linalg.norm(speed)))
    lost = 1.0 - float(filter_gain(used, min(turn * fit.data.sample_time, math.pi)))
    return lost + fit.data.velocity_noise**2 / float(np.mean(speed**2))


def _whole(
    found: list[Finding],
    depths: tuple[WorkingDepth, ...],
    episodes: tuple[Episode, ...],
    laws: Laws | None,
) -> Diagnosis:
    told = [f if f.check in MAY_CAP else _uncapped(f) for f in found]
    in_order = sorted(told, key=lambda finding: -SEVERITIES.index(finding.severity))
    of_laws = laws.verdict if laws is not None else None
    verdict, limits = verdict_by(in_order, depths[0])
    return Diagnosis(verdict, tuple(in_order), depths, episodes, of_laws, limits)


def _uncapped(finding: Finding) -> Finding:
    """A finding that changes error bars only, without marks of its own."""
    return replace(finding, severity="note", stiffness="trust", damping="trust")


def _nothing_to_check(fit: Fit) -> Finding:
    count = int(np.count_nonzero(fit.inside))
    few = count < FEWEST_ROWS
    words = f"only {count} samples in contact: too few" if few else "the motion varies too little"
    remedy = "record longer" if few else "move the probe in and out at several speeds"
    message = f"{words} to check the law"
    return Finding.of_both("do-not-trust", "excitation", message, remedy)


def _notes(fit: Fit) -> list[Finding]:
    notes = [
        Finding("skew", delay_sensitivity(fit)),
        Finding("unseen", unseen(fit)),
        Finding(
            "peak force",
            f"the largest force is {rounded(fit.data.peak_force, 3)} N, the largest penetration "
            f"{rounded(1e3 * fit.data.peak_penetration, 3)} mm",
        ),
    ]
    contact = fit.data.contact
    said = any(finding.check == "surface" for finding in contact.findings)
    if not (fit.free_air or said or contact.surface_deviation is not None):
        notes.append(
            Finding(
                "surface",
                "there is no free air in the recording, so the surface position is assumed: K, B "
                "and n depend on it, stiffness and damping at working depth do not",
                "start the recording before the touch",
            )
        )
    return notes


def _episodes(fit: Fit, changed: Changes) -> tuple[Episode, ...]:
    borders = [float(fit.data.time[0]), *changed.times, float(fit.data.time[-1])]
    episodes = []
    for ends, law in zip(pairwise(borders), changed.laws, strict=True):
        quantities = [Quantity(value, math.nan, 0.0) for value in law.at_rest(fit.depth)]
        episodes.append(Episode(*ends, law, WorkingDepth(fit.depth, *quantities)))
    return tuple(episodes)
