"""The path from an identification to its diagnosis: causes, error bars, findings, marks."""

import logging
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from palpate.findings import MAY_CAP, SEVERITIES, Check, Finding, worst
from palpate.identification.diagnosis.bars import (
    check_precision,
    numbers_at_depth,
    systematic_errors,
    unknown_working_depth,
)
from palpate.identification.diagnosis.causes import MisfitHypothesis, Search, assess_causes
from palpate.identification.diagnosis.change import Changes, find_changes
from palpate.identification.diagnosis.delay import check_skew, find_delay, find_skew_jump
from palpate.identification.diagnosis.excitation import (
    check_excitation,
    check_extrapolation,
    check_one_way,
    check_peaks,
    explain_no_check,
)
from palpate.identification.diagnosis.fit import Fit, FitInput
from palpate.identification.diagnosis.forecast import check_forecast
from palpate.identification.diagnosis.geometry import (
    check_known_surface,
    check_unobservable,
    find_surface,
)
from palpate.identification.diagnosis.material import (
    check_behind_relaxation,
    check_relaxed_stiffness,
    check_unknown_law,
    find_adhesion_or_relaxation,
    find_material_causes,
)
from palpate.identification.diagnosis.misfit import (
    check_method,
    check_misfit,
    check_other_laws,
    drop_vain_step,
    fraction_unexplained,
)
from palpate.identification.diagnosis.outcome import (
    UNKNOWN,
    Diagnosis,
    Episode,
    ModelSelection,
    Quantity,
    Verdict,
    WorkingDepth,
)
from palpate.identification.diagnosis.sensor import (
    check_dead_band,
    check_force_jump,
    check_free_air,
    check_impact,
    check_offset,
    check_saturation,
    check_velocity_noise,
    find_sensor_causes,
)
from palpate.stages import log_stage

_LOGGER = logging.getLogger(__name__)
#: Checks of the fit as a whole.
CHECKS: tuple[Callable[[Fit], Finding | None], ...] = (
    check_saturation,
    check_dead_band,
    check_method,
    check_excitation,
    check_one_way,
    check_offset,
    check_free_air,
    check_impact,
    check_velocity_noise,
    check_misfit,
    check_other_laws,
    check_forecast,
    check_relaxed_stiffness,
    check_extrapolation,
    check_skew,
    check_unobservable,
    check_peaks,
    check_known_surface,
)
#: Searches for causes of the misfit.
SEARCHES: tuple[Search, ...] = (
    find_sensor_causes,
    find_material_causes,
    find_adhesion_or_relaxation,
    find_delay,
    find_skew_jump,
    find_surface,
)


@log_stage("diagnosis")
def diagnose_parts(
    given: FitInput, depths: Sequence[float] = (), notes: Sequence[Finding] = ()
) -> Diagnosis:
    """Diagnose the identification of a recording.

    Parameters
    ----------
    given : FitInput
        The identification.
    depths : sequence of float
        The working depth, to which the verdict refers, and further depths, m, > 0. Default: the
        median and the 90th percentile of the penetration in contact.
    notes : sequence of Finding
        Flags of the estimate and its samples. If the material changes, only those that are more
        than notes are reported: no motion identifies one law for several materials.
    """
    with np.errstate(all="ignore"):  # a column of an absurd fit may overflow and is then skipped
        fit = Fit(given, depths[0] if depths else None)
        fits = [fit.at_depth(depth) for depth in depths or (fit.depth, fit.deep)]
        try:
            if fit.checkable:
                return _diagnose(fit, fits, notes)
        except np.linalg.LinAlgError:  # a motion without information, such as a probe held still
            pass
        findings = [*given.data.findings, explain_no_check(fit), *notes]
        return assemble_diagnosis(findings, [*map(unknown_working_depth, fits)], laws=fit.laws)


def _diagnose(fit: Fit, fits: Sequence[Fit], notes: Sequence[Finding]) -> Diagnosis:
    """Find causes, compute error bars at all depths, collect findings and decide the marks."""
    all_causes, changed = _find_causes(fit)
    unexplained = fraction_unexplained(fit)
    causes = assess_causes(fit, all_causes, unexplained)
    if not has_reported(causes.findings, Check.CHANGE):
        changed = None
    jump = check_force_jump(fit)
    unknown = check_unknown_law(fit, all_causes, unexplained)
    candidates = (*fit.given.data.findings, jump, *causes.findings, unknown)
    findings = [finding for finding in candidates if finding is not None]
    if fit.equivalent is not None and not has_reported(findings, Check.ADHESION, Check.CHANGE):
        findings += check_behind_relaxation(fit)
    for check in CHECKS:
        finding = check(fit)
        # An error of the surface position makes the offset wrong too.
        explained = check is check_offset and has_reported(causes.findings[:1], Check.SURFACE)
        if finding is not None and not explained:
            findings.append(finding)
    systematic = systematic_errors(fit, causes, findings)
    depths = [numbers_at_depth(each, systematic) for each in fits]
    findings += check_precision(fit, depths[0], systematic)
    if has_reported(findings, Check.ONE_WAY):
        depths = [replace(depth, damping=UNKNOWN) for depth in depths]
    episodes = () if changed is None else _episodes(fit, changed)
    reported = {finding.check for finding in findings}
    new_notes = (note for note in notes if note.check not in reported)
    findings += (note for note in new_notes if not (episodes and note.severity == "note"))
    findings = [drop_vain_step(fit, finding) for finding in findings]
    return assemble_diagnosis(findings, depths, episodes, fit.laws)


def _find_causes(fit: Fit) -> tuple[list[MisfitHypothesis], Changes | None]:
    """Search for all causes; also return the changes of the material."""
    changed = find_changes(fit)
    causes: list[MisfitHypothesis] = [] if changed is None else [changed.cause]
    for search in SEARCHES:
        begun = time.perf_counter()
        causes += search(fit)
        _LOGGER.debug("%s: %.4f s", search.__name__, time.perf_counter() - begun)
    return causes, changed


def has_reported(findings: Iterable[Finding], *checks: str) -> bool:
    """Whether one of the checks has a finding."""
    return any(finding.check in checks for finding in findings)


def assemble_diagnosis(
    findings: Iterable[Finding],
    depths: Sequence[WorkingDepth],
    episodes: tuple[Episode, ...] = (),
    laws: ModelSelection | None = None,
) -> Diagnosis:
    """Sort the findings by severity and decide the marks; some findings only widen error bars."""
    no_marks: Any = {"severity": "note", "stiffness": "trust", "damping": "trust"}
    capped = [f if f.check in MAY_CAP else replace(f, **no_marks) for f in findings]
    in_order = sorted(capped, key=lambda finding: -SEVERITIES.index(finding.severity))
    selection = laws.verdict if laws is not None else None
    verdict, limits = _decide_marks(in_order, depths[0])
    return Diagnosis(verdict, tuple(in_order), tuple(depths), episodes, selection, limits)


def _episodes(fit: Fit, changed: Changes) -> tuple[Episode, ...]:
    borders = [float(fit.data.time[0]), *changed.times, float(fit.data.time[-1])]
    episodes = []
    for ends, law in zip(pairwise(borders), changed.laws, strict=True):
        quantities = [Quantity(value, math.nan, 0.0) for value in law.at_rest(fit.depth)]
        episodes.append(Episode(*ends, law, WorkingDepth(fit.depth, *quantities)))
    return tuple(episodes)


def _decide_marks(
    findings: Sequence[Finding], at: WorkingDepth
) -> tuple[Verdict, tuple[Finding | None, Finding | None]]:
    """Return the verdict, and for stiffness and damping the finding that decides the mark."""
    marks = []
    limits = []
    # A fault of the recording is more informative than a wide error bar, so it comes first.
    ordered = sorted(findings, key=lambda each: each.check == Check.PRECISION)
    for mark_by in map(attrgetter, ("stiffness", "damping")):
        mark = worst(*map(mark_by, ordered))
        deciding = (each for each in ordered if mark_by(each) == mark)
        marks.append(mark)
        limits.append(None if mark == "trust" else next(deciding))
    # A damping that is not reported does not count.
    has_damping = math.isfinite(at.damping.value)
    overall = worst(*marks) if has_damping else marks[0]
    return Verdict(marks[0], marks[1], overall), (limits[0], limits[1])
