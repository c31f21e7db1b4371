"""All checks together: from an identification's parts to its diagnosis."""

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.band import FEWEST_ROWS
from palpate.diagnosis.cause import Cause, Search
from palpate.diagnosis.change import Changes, changes
from palpate.diagnosis.columns import columns
from palpate.diagnosis.data import Data
from palpate.diagnosis.delay import delay, skew_matters
from palpate.diagnosis.finding import (
    MARKS,
    Diagnosis,
    Episode,
    Finding,
    Mark,
    Quantity,
    Verdict,
    WorkingDepth,
    worst,
)
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.flat import flat
from palpate.diagnosis.law import better_law, finding_of
from palpate.diagnosis.laws import Laws
from palpate.diagnosis.left_out import left_out
from palpate.diagnosis.marking import Judged, judge
from palpate.diagnosis.memory import memory
from palpate.diagnosis.misfit import (
    excitation,
    extrapolation,
    method,
    misfit,
    offset,
    ratio,
    standard_errors,
    unexplained,
)
from palpate.diagnosis.one_way import one_way
from palpate.diagnosis.surface import has_free_air, surface
from palpate.diagnosis.velocity_noise import velocity_noise
from palpate.diagnosis.working_depth import OFF, nothing_known, sign, working_depth
from palpate.digits import rounded
from palpate.estimate import Estimate
from palpate.stages import timed
from palpate.trace import Trace

_LOGGER = logging.getLogger(__name__)

#: Each looks for causes beside the fit.
SEARCHES: tuple[Search, ...] = (columns, memory, delay, surface)


@timed("diagnosis")
def diagnose_parts(
    data: Data,
    trace: Trace,
    estimate: Estimate,
    *,
    depths: Sequence[float] = (),
    laws: Laws | None = None,
) -> Diagnosis:
    """Diagnose what an estimator made of a recording.

    Parameters
    ----------
    data : Data
        The recording, whose own checks are made once for all methods.
    trace : Trace
        Of the replay.
    estimate : Estimate
        At its end.
    depths : sequence of float
        The working depth, which the verdict is about, and others, m, > 0. Unless given the median
        and the 90th percentile of the penetration of the samples taken.
    laws : Laws, optional
        What laws that are compared made of the same samples.
    """
    found = list(data.findings)
    with np.errstate(all="ignore"):  # a column of an absurd fit may overflow; it is then left out
        fit = Fit(data, trace, estimate, depths[0] if depths else None, laws)
        others = depths[1:] if depths else fit.deeper
        try:
            if len(fit.band) >= FEWEST_ROWS // 2 and fit.finite:
                return _diagnosed(fit, found, others)
        except np.linalg.LinAlgError:  # of a motion that says nothing, such as a probe held still
            pass
        found = [*data.findings, _nothing_to_check(fit)]
        unknown = tuple(nothing_known(fit.at_depth(d)) for d in (fit.depth, *others))
        return _whole(found, unknown, (), fit.laws)


def _diagnosed(fit: Fit, found: list[Finding], others: Sequence[float]) -> Diagnosis:
    changed = changes(fit)
    causes: list[Cause] = []
    for search in SEARCHES:
        begun = time.perf_counter()
        causes += search(fit)
        _LOGGER.debug("search for %s: %.4f s", search.__name__, time.perf_counter() - begun)
    if changed is not None:
        causes.append(changed.cause)
    judged = judge(causes, ratio(fit), unexplained(fit))
    checks = (
        *(flat, left_out, method, excitation, one_way),
        *(offset, velocity_noise, misfit, extrapolation),
    )
    wide = [check(fit) for check in checks]
    if not any(finding.check == "change" for finding in judged.findings):
        changed = None
    if changed is None:  # of two materials one law is none
        judged = _with_better_law(fit, judged)
    named_surface = bool(judged.findings) and judged.findings[0].check == "surface"
    found += judged.findings
    found += [f for f in wide if f is not None and not (f.check == "offset" and named_surface)]
    found += _notes(fit)
    judged = _moved_by_velocity(fit, judged, found)
    depths = tuple(working_depth(fit.at_depth(depth), judged) for depth in (fit.depth, *others))
    found += sign(fit, depths[0], found)
    return _whole(found, depths, _episodes(fit, changed), fit.laws)


def _with_better_law(fit: Fit, judged: Judged) -> Judged:
    """With the law that explains the samples better, and how far it moves the numbers."""
    cause = better_law(fit)
    if cause is None:
        return judged
    checks = [finding.check for finding in judged.findings]
    found = finding_of(cause, late="delay" in checks)
    # What explains most is said first; of a memory that is what the memory's own finding says.
    first = cause.gain > max((each.gain for each, _ in judged.counted), default=0.0)
    place = 0 if first and checks[:1] not in (["memory"], ["surface"]) else 1
    findings = [*judged.findings[:place], found, *judged.findings[place:]]
    return replace(judged, findings=findings, counted=(*judged.counted, (cause, 1.0)))


def _moved_by_velocity(fit: Fit, judged: Judged, found: list[Finding]) -> Judged:
    """With what a wrong velocity does to the damping, and the filter that it was made with.

    At a frequency ω the slope of the parabola through a window of T keeps 1 − (ωT/2)²/10 of the
    velocity, and the damping becomes as much larger: 0.1 % at 2 Hz by the usual 15 ms.
    """
    parts = [f.moves_damping_percent for f in found if f.check.startswith("velocity")]
    known = [abs(part) / 100.0 for part in parts if math.isfinite(part)]
    prepared = fit.data.contact.prepared
    if prepared is not None and prepared.window is not None and fit.period > 0.0:
        lost = (math.pi * prepared.window / fit.period) ** 2 / 10.0
        moved = lost * abs(fit.damping(fit.solution.law))
        known += [moved / fit.sizes[1]] if moved > OFF * standard_errors(fit)[2] else []
    return replace(judged, damping=max((judged.damping, *known)))


def _whole(
    found: list[Finding],
    depths: tuple[WorkingDepth, ...],
    episodes: tuple[Episode, ...],
    laws: Laws | None,
) -> Diagnosis:
    order: tuple[Mark | str, ...] = ("do-not-trust", "with-care", "note")
    sorted_ = sorted(found, key=lambda finding: order.index(finding.severity))
    severities: list[Mark] = [MARKS[2 - order.index(finding.severity)] for finding in sorted_]
    stiffness = worst(*(finding.stiffness for finding in sorted_))
    damping = worst(*(finding.damping for finding in sorted_))
    overall = worst(*severities, stiffness, "with-care" if damping != "trust" else "trust")
    verdict = Verdict(stiffness, damping, overall)
    of_laws = laws.verdict if laws is not None else None
    return Diagnosis(verdict, tuple(sorted_), depths, episodes, of_laws)


def _nothing_to_check(fit: Fit) -> Finding:
    count = int(np.count_nonzero(fit.inside))
    few = count < FEWEST_ROWS
    words = f"only {count} samples in contact: too few" if few else "the motion says too little"
    return Finding(
        "excitation",
        f"{words} to check the law",
        "record longer" if few else "move the probe: palpate design finds a motion",
        stiffness="do-not-trust",
        damping="do-not-trust",
        severity="do-not-trust",
    )


def _notes(fit: Fit) -> list[Finding]:
    notes = [
        Finding("skew", skew_matters(fit), severity="note"),
        Finding(
            "peak force",
            f"the largest force is {rounded(fit.data.peak_force, 3)} N, the largest penetration "
            f"{rounded(1e3 * fit.data.peak_penetration, 3)} mm",
            severity="note",
        ),
    ]
    if not has_free_air(fit) and not _surface_said(fit):
        notes.append(
            Finding(
                "surface",
                "the probe is never out of contact: where the surface lies is an assumption, and "
                "K, B and n are for it; stiffness and damping at working depth hold all the same",
                "record from before the touch",
                severity="note",
            )
        )
    return notes


def _surface_said(fit: Fit) -> bool:
    """Whether the preparation found a surface, or said that it is an assumption."""
    contact = fit.data.contact
    said = any(remark.step == "surface" for remark in contact.remarks)
    return said or contact.surface_deviation is not None


def _episodes(fit: Fit, changed: Changes | None) -> tuple[Episode, ...]:
    if changed is None:
        return ()
    borders = [float(fit.data.time[0]), *changed.times, float(fit.data.time[-1])]
    episodes = []
    for start, stop, law in zip(borders[:-1], borders[1:], changed.laws, strict=True):
        numbers = (
            law.force(fit.depth, 0.0),
            law.stiffness_at(fit.depth),
            law.damping_at(fit.depth),
        )
        quantities = [Quantity(float(value), math.nan, 0.0) for value in numbers]
        episodes.append(Episode(start, stop, law, WorkingDepth(fit.depth, *quantities)))
    return tuple(episodes)
