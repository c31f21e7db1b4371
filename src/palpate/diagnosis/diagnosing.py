"""All checks together: from an identification's parts to its diagnosis."""

import math
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
from palpate.diagnosis.left_out import left_out
from palpate.diagnosis.marking import Judged, judge
from palpate.diagnosis.memory import memory
from palpate.diagnosis.misfit import (
    excitation,
    method,
    misfit,
    off_least_squares,
    offset,
    ratio,
    standard_errors,
    unexplained,
)
from palpate.diagnosis.surface import has_free_air, surface
from palpate.diagnosis.velocity_noise import velocity_noise
from palpate.estimate import Estimate
from palpate.trace import Trace

#: Each looks for causes beside the fit.
SEARCHES: tuple[Search, ...] = (columns, memory, delay, surface)


def diagnose_parts(
    data: Data, trace: Trace, estimate: Estimate, *, depth: float | None = None
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
    depth : float, optional
        The working depth, m; the median penetration of the samples taken unless given.
    """
    found = list(data.findings)
    with np.errstate(all="ignore"):  # a column of an absurd fit may overflow; it is then left out
        fit = Fit(data, trace, estimate, depth)
        try:
            if len(fit.band) >= FEWEST_ROWS // 2 and fit.finite:
                return _diagnosed(fit, found)
        except np.linalg.LinAlgError:  # of a motion that says nothing, such as a probe held still
            pass
        found = [*data.findings, _nothing_to_check(fit)]
        return _whole(found, _working_depth(fit, Judged([]), known=False), ())


def _diagnosed(fit: Fit, found: list[Finding]) -> Diagnosis:
    changed = changes(fit)
    causes: list[Cause] = [cause for search in SEARCHES for cause in search(fit)]
    if changed is not None:
        causes.append(changed.cause)
    judged = judge(causes, ratio(fit), unexplained(fit))
    checks = (flat, left_out, method, excitation, offset, velocity_noise, misfit)
    wide = [check(fit) for check in checks]
    if not any(finding.check == "change" for finding in judged.findings):
        changed = None
    named_surface = bool(judged.findings) and judged.findings[0].check == "surface"
    found += judged.findings
    found += [f for f in wide if f is not None and not (f.check == "offset" and named_surface)]
    found += _notes(fit)
    working_depth = _working_depth(fit, _moved_by_velocity(judged, found), known=True)
    return _whole(found, working_depth, _episodes(fit, changed))


def _moved_by_velocity(judged: Judged, found: list[Finding]) -> Judged:
    """With what a wrong velocity does to the damping."""
    parts = [f.moves_damping_percent for f in found if f.check.startswith("velocity")]
    known = (abs(part) / 100.0 for part in parts if math.isfinite(part))
    return replace(judged, damping=max((judged.damping, *known)))


def _whole(
    found: list[Finding], working_depth: WorkingDepth, episodes: tuple[Episode, ...]
) -> Diagnosis:
    order: tuple[Mark | str, ...] = ("do-not-trust", "with-care", "note")
    sorted_ = sorted(found, key=lambda finding: order.index(finding.severity))
    severities: list[Mark] = [MARKS[2 - order.index(finding.severity)] for finding in sorted_]
    stiffness = worst(*(finding.stiffness for finding in sorted_))
    damping = worst(*(finding.damping for finding in sorted_))
    overall = worst(*severities, stiffness, "with-care" if damping != "trust" else "trust")
    return Diagnosis(Verdict(stiffness, damping, overall), tuple(sorted_), working_depth, episodes)


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
            f"the largest force is {fit.data.peak_force:.3g} N, the largest penetration "
            f"{1e3 * fit.data.peak_penetration:.3g} mm",
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


def _working_depth(fit: Fit, judged: Judged, *, known: bool) -> WorkingDepth:
    law, depth = fit.estimate.law, fit.depth
    force_error, stiffness_error, damping_error = (
        _with_surface(fit, standard_errors(fit)) if known else (math.nan, math.nan, math.nan)
    )
    if not math.isfinite(depth):
        nothing = Quantity(math.nan, math.nan, math.nan)
        return WorkingDepth(depth, nothing, nothing, nothing)
    sizes = fit.sizes if known else (0.0, 0.0)
    off = [abs(each) for each in off_least_squares(fit)[:2]] if known else [0.0, 0.0]
    return WorkingDepth(
        depth,
        Quantity(float(law.force(depth, 0.0)), force_error, 0.0),
        Quantity(
            law.stiffness_at(depth), stiffness_error, max(judged.stiffness, off[0]) * sizes[0]
        ),
        Quantity(law.damping_at(depth), damping_error, max(judged.damping, off[1]) * sizes[1]),
    )


def _with_surface(fit: Fit, errors: tuple[float, float, float]) -> tuple[float, float, float]:
    """With how far the numbers move as the depth does, by the deviation of the surface.

    The law holds at the place where the probe was; how deep that is, no fit knows better than it
    knows the surface.
    """
    law, depth = fit.estimate.law, fit.depth
    deviation = min(fit.data.contact.surface_deviation or 0.0, 0.5 * depth)
    if not deviation > 0.0:
        return errors
    low, high = depth - deviation, depth + deviation
    moves = (
        float(law.force(high, 0.0)) - float(law.force(low, 0.0)),
        law.stiffness_at(high) - law.stiffness_at(low),
        law.damping_at(high) - law.damping_at(low),
    )
    force, stiffness, damping = (
        math.hypot(error, 0.5 * move) for error, move in zip(errors, moves, strict=True)
    )
    return force, stiffness, damping


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
