"""Text of a live run: for the console, the wires and the page.

The process that shows the text composes it, because that takes most of a millisecond, which the
loop cannot spare. Each key of the page's text is the id of an element in its document.
"""

import math
from base64 import b64decode
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.digits import format_quantity, rounded, with_error
from palpate.estimators.estimate import Estimate
from palpate.estimators.law_verdicts import (
    STRONG,
    UNDECIDED,
    Evidence,
    LawVerdict,
    judge_evidence,
)
from palpate.estimators.viscoelastic import RelaxingEstimate, build_law
from palpate.findings import Check, Finding, spoken
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.live.sinks import why_undiagnosed
from palpate.quantities.derived import format_hertz
from palpate.results.parameters import describe_relaxation
from palpate.results.view import NumberLine
from palpate.validation import or_nan

# Effective sample size over samples: AR(1) noise of 0.875 gives 1/15, of 0.9 it gives 1/19.
_FEW = 1.0 / 15.0
_DAMPING = GeneralisedHuntCrossley.names().index("damping")


def verdict_on(status: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the verdict on the force law in a status; None if the estimator compares no laws."""
    page = status.get("verdict")
    if page is None:
        return None
    evidence = Evidence(*page["evidence"])
    estimate = status_estimate(page)
    verdict = judge_evidence(evidence, estimate)
    return {
        **verdict.as_dict(),
        "known": verdict.known,
        "own": list(verdict.candidate.own),
        "fixed": list(page["fixed"]),
        "parameters": page["parameters"],
        "spectrum": page["spectrum"],
        "covariance": page["covariance"],
        "flags": [
            *page["flags"],
            *(verdict.flags if page["parameters"] else ()),
            *(map(str, _open(page, verdict, estimate)) if verdict.known else ()),
        ],
        "since": page["turns"][-1][0] if page["turns"] else math.nan,
        "changes": page["changes"],
        "turns": [[time, law] for time, law, _ in page["turns"]],
    }


def status_estimate(page: Mapping[str, Any]) -> Estimate:
    """Return the estimate in the loop's status; a law of zero force before the first sample."""
    if page["parameters"] is None:
        law = GeneralisedHuntCrossley(0.0, 1.0, 0.0, 1.0)
        size = law.parameters.size
        return Estimate.from_law(law, np.zeros((size, size)), status=Status.WAITING, samples=0)
    packed = (page["covariance"], *page["spectrum"])
    covariance, times, numbers, joint = (np.frombuffer(b64decode(each)) for each in packed)
    law = build_law(times, numbers)
    value = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)
    return RelaxingEstimate(value, (), (times, numbers, joint.reshape(len(numbers) + 1, -1), []))


def _open(page: Mapping[str, Any], verdict: LawVerdict, estimate: Estimate) -> Iterator[Finding]:
    """Yield the warnings about the verdict itself."""
    late = [law for _, law, samples in page["turns"] if law and 2.0 * samples > verdict.samples]
    # Two changes while the samples doubled. The first law after a restart is no change.
    if (count := min(len(late), page["changes"])) >= 2:
        words = f"the preferred law is not settled: {count} changes while the samples doubled"
        yield Check.UNSETTLED_LAW.finding(words)
    if verdict.effective_samples < _FEW * verdict.samples:
        yield Check.CORRELATED_RESIDUALS.finding(
            "the residuals of the best law are correlated: either the sensor noise is, or no "
            "compared law holds and the error bars are too small"
        )
    damping, error = estimate.parameters[_DAMPING], estimate.standard_errors[_DAMPING]
    if verdict.candidate.damping != "none" and abs(damping) < 1e-6 * error:
        yield Check.NO_DAMPER.finding(
            "B is 0: laws that differ only in their damper are equivalent"
        )


#: Unit and name of each number.
NUMBERS: Mapping[str, tuple[str, str]] = {
    "stiffness": ("N/m", "Dynamic stiffness K′"),
    "damping": ("N·s/m", "Dynamic damping B′"),
    "loss_tangent": ("", "Loss tangent tan δ"),
    "instantaneous_stiffness": ("N/m", "Instantaneous stiffness"),
    "relaxed_stiffness": ("N/m", "Relaxed stiffness"),
    "relaxation_time": ("s", "Relaxation time"),
}
_FELT = tuple(NUMBERS)[:5]

Numbers = dict[str, tuple[float, float]]


def law_numbers(verdict: Mapping[str, Any]) -> Numbers:
    """Return the :data:`NUMBERS` of the preferred law, each with its standard error.

    They hold at the depth and frequency of the motion. Empty until the first verdict of
    :func:`verdict_on`, and again after a change of material.
    """
    parameters, depth, omega = verdict["parameters"], verdict["depth"], verdict["frequency"]
    # Depth and frequency are of the samples since a change; an outdated law has no band there.
    if not (verdict["known"] and parameters and depth and omega and min(depth, omega) > 0.0):
        return {}
    estimate = status_estimate(verdict)

    def law_response(law: GeneralisedHuntCrossley) -> tuple[float, ...]:
        whole = law.dynamic_stiffness(depth, omega)
        return (
            whole.real,
            whole.imag / omega,
            whole.imag / whole.real if whole.real else math.nan,
            law.instantaneous().stiffness_at(depth),
            law.relaxed().stiffness_at(depth),
        )

    values, errors = estimate.with_errors(law_response)
    found = dict(zip(_FELT, zip(values.tolist(), errors.tolist(), strict=True), strict=True))
    law: GeneralisedHuntCrossley = estimate.law
    if not law.remembers:  # its stiffness does not depend on time
        del found["instantaneous_stiffness"], found["relaxed_stiffness"]
    elif law.relaxation is not None and (time := law.relaxation_time) is not None:
        found["relaxation_time"] = time, time * law.relaxation.resolution
    return found


def certainty(verdict: Mapping[str, Any]) -> str:
    """Return how strong the evidence is: none, before (outdated), alone, open, weak or strong."""
    if not verdict["known"]:
        return "none" if verdict["parameters"] is None else "before"
    if math.isnan(lead := bic_lead(verdict)):
        return "alone"
    return "open" if lead < UNDECIDED else "weak" if lead < STRONG else "strong"


def standing(verdict: Mapping[str, Any]) -> str:
    """Describe how the preferred law compares with the best other law without memory."""
    if not verdict["known"]:
        return {
            "none": "no verdict yet",
            "before": "outdated: no verdict yet on the new samples",
        }[certainty(verdict)]
    return LawVerdict.from_dict(verdict).comparison


def bic_lead(verdict: Mapping[str, Any]) -> float:
    """Return the preferred law's ΔBIC over the best other law without memory, NaN without one."""
    rival = LawVerdict.from_dict(verdict).rival
    return math.nan if rival is None else rival.score


def describe_verdict(verdict: Mapping[str, Any]) -> str:
    """Describe the verdict in one line."""
    known = verdict["parameters"] is not None
    return f"{verdict['law']} ({standing(verdict)})" if known else "no law yet"


def law_lines(verdict: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that describe the verdict at the end of a run."""
    changes = int(verdict["changes"])
    turned = f", changed {changes} times" if changes and verdict["known"] else ""
    yield f"law: {describe_verdict(verdict)}{turned}"
    yield from verdict["flags"]


def format_law_number(numbers: Numbers, name: str) -> str:
    """Format one of the numbers with its standard error and unit."""
    return with_error(*numbers[name], unit=NUMBERS[name][0])


def verdict_fields(verdict: Mapping[str, Any], origin: float = 0.0) -> dict[str, float | str]:
    """Return the verdict as fields of a message: text, and plain numbers in SI units.

    ``origin`` is the zero of the loop's times, s.
    """
    fields: dict[str, float | str] = {
        "law": str(verdict["law"]) if verdict["parameters"] is not None else "",
        "standing": standing(verdict),
        "lead": bic_lead(verdict),
        "samples": or_nan(verdict["samples"]),
        "independent_samples": or_nan(verdict["effective_samples"]),
        "since": origin + float(verdict["since"]),
        "changes": float(verdict["changes"]),
        # A probe that has not moved has neither.
        "depth": or_nan(verdict["depth"] or None),
        "frequency": or_nan(verdict["frequency"] or None),
    }
    numbers = law_numbers(verdict)
    for name in NUMBERS:
        value, error = numbers.get(name, (math.nan, math.nan))
        fields |= {name: value, f"{name}_standard_error": error}
    fields["flags"] = "; ".join(verdict["flags"])
    return fields


# The answer: stiffness and damping at the working depth and the motion's frequency.

_UNITS = {"stiffness": "N/m", "damping": "N·s/m"}


def headline(
    found: Mapping[str, Any] | None, status: Mapping[str, Any], now: Numbers, at: str
) -> list[NumberLine]:
    """Return the two numbers as diagnosed; while no diagnosis holds, as estimated now at a place.

    Parameters
    ----------
    found, status : mapping
        The last status of the diagnosis, if there is one, and of the loop.
    now : mapping
        The present estimate of each number, with its standard error.
    at : str
        Where the present estimate holds, such as ``"at 8.8 mm, 1.8 Hz"``.
    """
    why = why_undiagnosed(found, status)
    if found and not why and found.get("numbers"):
        return [NumberLine(**each) for each in found["numbers"]]
    reason = why or (found or {}).get("reason") or ""
    return [NumberLine(name, _present(now, name), at, None, reason) for name in _UNITS]


def _present(now: Numbers, name: str) -> str:
    """Format the present estimate of a number."""
    value, error = now.get(name, (math.nan, math.nan))
    return with_error(value, error, unit=_UNITS[name]) if math.isfinite(value) else "unknown"


def where(depth: float, frequency: float | None) -> str:
    """Format a working depth and, if known, a frequency: ``at 8.8 mm, 1.8 Hz``."""
    often = f", {format_hertz(frequency)}" if frequency else ""
    return f"at {format_quantity(depth, 'm')}{often}"


def answer(lines: Iterable[NumberLine], *, reasons: bool = True) -> str:
    """Return the numbers in one line, each with its mark and what sets that."""
    texts = []
    for each in lines:
        text = " ".join(filter(None, (each.name, each.value, each.at)))
        if each.mark is not None:
            why = "; ".join(filter(None, (each.reason, each.skew))) if reasons else ""
            text += f" ({': '.join(filter(None, (spoken(each.mark), why)))})"
        texts.append(text)
    return "; ".join(texts)


# Times and counts of a run.

#: Counters and their names, most severe first.
COUNTED = {
    "lost": "lost before the loop",
    "malformed": "malformed",
    "unpaired": "unpaired",
    "refused": "rejected",
    "repeated": "repeated",
    "disordered": "out of order",
    "gaps": "gaps",
    "jumps": "clock jumps",
    "silences": "silences",
    "late": "late",
}


def seconds(value: float | None) -> str:
    """Format a duration: 6.3 µs, 0.4 ms, 2 s."""
    return "–" if value is None or not math.isfinite(value) else format_quantity(value, "s")


def percent(fraction: float | None) -> str:
    """Format a fraction with as many digits as its distance from 1 needs: 99.993 %."""
    if fraction is None or not math.isfinite(fraction):
        return "–"
    rest = round(100.0 * (1.0 - fraction), 9)
    digits = 0 if rest <= 0.0 else min(max(1 - math.floor(math.log10(rest)), 0), 4)
    # Rounded down, except for floating-point error: 100 % is printed only for all.
    shown = math.floor(100.0 * fraction * 10**digits + 1e-6) / 10**digits
    return f"{shown:.{digits}f} %"


def duration_rows(status: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield a row per duration: name, median, 99 %, 99.9 %, longest, share within the limit."""
    for name, words in (("cycle", "update, estimate"), ("lateness", "sample to result")):
        figures = status.get(name) or {}
        known = figures if figures.get("count") else {}
        columns = [seconds(known.get(key)) for key in ("p50", "p99", "p99.9", "max")]
        limit = f"{percent(known.get('within'))} within {seconds(figures.get('limit'))}"
        yield [words, *columns, limit]


# The page's text: id of an element to the text that it shows.

_STATES = {
    "free": ("○", "Free", "The probe is out of contact; the estimate is held."),
    "contact": ("●", "Contact", "Every sample updates the estimate."),
    "held": ("Ⅱ", "Held", "Samples do not update the estimate until you press Resume."),
    "changed": ("◆", "Changed", "The material has changed; palpate restarted the estimate."),
    "invalid": ("✕", "Invalid", "palpate rejects the samples; the estimate is held."),
    "lost": ("?", "Lost", "No samples arrive; the estimate is held."),
    "taring": ("▽", "Taring", "palpate measures the force offset: keep the probe out of contact."),
    "none": ("·", "Starting", "palpate opens the source."),
    "dead": ("✕", "Stopped", "The loop does not respond; the page shows its last result."),
    "ended": ("■", "Ended", "The run has ended; the page shows its last result."),
}
_BADGES = {
    "none": ("not known yet", "open"), "before": ("outdated", "no"),
    "alone": ("only law", "open"), "open": ("undecided", "no"),
    "weak": ("weak evidence", "partly"), "strong": ("strong evidence", "yes"),
}  # fmt: skip
_MARKS = {"trust": "yes", "with-care": "partly", "do-not-trust": "no"}
_TURNS = 4

Words = dict[str, Any]


def view_texts(page: Mapping[str, Any], verdict: Mapping[str, Any] | None, now: float) -> Words:
    """Return the texts that freeze while the view is paused; ``now`` is a sample's time, s."""
    loop, depth, found = page["loop"], page["depth"], page["now"]
    law, tiles = loop.get("law") or {}, []
    panels = [
        [f"{name.capitalize()} {_describe_depth(depth)}", unit, name, f"{name}_error"]
        for name, unit in _UNITS.items()
    ]
    for k in law.get("shown", ()):
        symbol, unit, name = law["symbols"][k], law["units"][k], law["names"][k]
        words = _parameter(found, name, k, verdict)
        title = f"{name.replace('_', ' ').capitalize()} {symbol}"
        tiles.append([f"{title} [{unit}]" if unit else title, words])
        panels.append([symbol, unit, f"parameter_{k}", f"error_{k}"])
    changes = [
        [
            f"{rounded(max(now - each['time'], 0.0), 3)} s ago",
            _terms(each["law"], each.get("before", {})),
            _terms(each["law"], each.get("after", {})),
        ]
        for each in reversed(page["changes"])
    ]
    view: Words = {"numbers": tiles, "curves": panels}
    view["changes"] = changes or [["none"]]
    return view | (law_card_texts(verdict, now) if verdict else {})


def _describe_depth(depth: Mapping[str, Any]) -> str:
    """Format the working depth of the page, and the motion's frequency."""
    known = math.isfinite(depth["value"])
    return where(depth["value"], depth["frequency"]) if known else "at working depth"


def _parameter(
    found: Mapping[str, Any], name: str, k: int, verdict: Mapping[str, Any] | None
) -> str:
    """Format a parameter of the preferred law: identified, fixed, or not in this law."""
    if verdict and verdict["parameters"] is None:
        return "unknown"
    if verdict and name not in verdict["own"]:
        return "not in this law"
    if verdict and name in verdict["fixed"]:
        return f"{rounded(verdict['parameters'][k], 6)} (fixed)"
    if "parameters" not in found:
        return "unknown"
    return with_error(found["parameters"][k], found["errors"][k])


def _terms(law: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Return a line for each parameter: ``K = 99000 ± 1100 N/mⁿ``."""
    terms = [
        f"{law['symbols'][k]} = {with_error(value, found['errors'][k], unit=law['units'][k])}"
        for k, value in enumerate(found.get("parameters", ()))
        if k in law["shown"] and math.isfinite(value)
    ]
    return terms or ["unknown"]


def describe_change(change: Mapping[str, Any]) -> str:
    """Format the stiffness before and after a change of material."""
    ends = ((change.get(name) or {}).get("stiffness", [math.nan]) for name in ("before", "after"))
    return f"{' → '.join(rounded(each[0], 3) for each in ends)} N/m"


def law_card_texts(verdict: Mapping[str, Any], now: float) -> Words:
    """Return the texts of the page's card of force laws at time ``now``, s."""
    sure, turns = certainty(verdict), verdict["turns"][: -_TURNS - 1 : -1]
    since, (badge, kind) = "", _BADGES[sure]
    if sure not in ("none", "before") and math.isfinite(verdict["since"]):
        turned = f"; changed {count} times" if (count := verdict["changes"]) else ""
        since = f"Preferred for {_ago(now, verdict['since'])}{turned}."
    numbers, often = law_numbers(verdict), verdict["frequency"]
    return {
        "law-name": "Not known yet" if sure == "none" else verdict["law"],
        "law-badge": badge,
        "law-kind": kind,
        "law-lead": standing(verdict),
        "law-since": since,
        "law-turns": [
            *(f"{_ago(now, time)} ago: {law or 'restarted'}" for time, law in turns),
            *[""] * (_TURNS - len(turns)),
        ],
        "law-at": f"small oscillation {where(verdict['depth'], often)}" if numbers else "",
        "law-numbers": [
            [
                long,
                format_law_number(numbers, name)
                if name in numbers
                else _absent(verdict, numbers, name),
            ]
            for name, (_, long) in NUMBERS.items()
        ],
        "law-flags": verdict["flags"] or ["no warnings"],
    }


def _ago(now: float, then: float) -> str:
    return f"{max(now - then, 0.0):.1f} s"


def _absent(verdict: Mapping[str, Any], numbers: Numbers, name: str) -> str:
    """Describe why a law has no such number."""
    if not numbers:
        return "–"
    if name != "relaxation_time":
        return "equals K′: no memory"
    law = status_estimate(verdict).law
    return describe_relaxation(law) if law.remembers else "no memory"


def fact_texts(page: Mapping[str, Any], state: str, contact_force: float | None = None) -> Words:
    """Return the texts that continue while the view is paused: answer, state, counts, times.

    ``contact_force`` is the present force, N, if the probe is in contact.
    """
    loop, others = page["loop"], page["others"]
    lamp, title, words = _STATES.get(state, _STATES["none"])
    fault = loop.get("fault") or loop.get("tare_refused")
    recorder, truth = others.get("recorder", {}), loop.get("chosen", {}).get("truth")
    recorded = recorder.get("said") or ""
    if recorder.get("on"):
        size = rounded(recorder.get("bytes", math.nan) / 1e6, 2)
        recorded = f"{recorded or recorder.get('path')}, {size} MB"
    facts: Words = {
        "lamp": lamp,
        "state-name": title,
        "state-words": (state not in ("dead", "ended") and fault) or words,
        "source": loop.get("source", ""),
        "recorded": recorded,
        "said": loop.get("said", [])[::-1],
        "times": list(duration_rows(loop)),
        "counts": _counts(loop.get("counts", {}), others, page["page"]),
    }
    if isinstance(truth, Mapping):
        numbers = {name: each for name, each in truth.items() if isinstance(each, float)}
        terms = (f"{name.replace('_', ' ')} = {rounded(x, 4)}" for name, x in numbers.items())
        facts["truth"] = f"True values: {', '.join([str(truth.get('kind')), *terms])}"
    if contact_force is not None:
        contact = f"The probe is in contact with {rounded(contact_force, 3)} N."
        facts["tare-warning"] = f"{contact} palpate refuses a tare while the probe presses."
    facts["working"] = list(_tiles(page, found := others.get("diagnosis")))
    if found and found.get("at"):
        facts["diagnosis"] = list(_diagnosis(found))
    return facts


def _counts(
    counts: Mapping[str, Any], others: Mapping[str, Any], own: Mapping[str, Any]
) -> list[list[str]]:
    """Return the rows of counts; a count that should be 0 but is not is marked ``bad``."""
    rows = [[words, counts.get(key, 0), ""] for key, words in _FINE.items()]
    rows += [[words, counts.get(key, 0), "bad"] for key, words in COUNTED.items()]
    rows += [
        ["page: dropped", own.get("dropped", 0), "bad"],
        ["page: skipped", own.get("skipped", 0), "bad"],
        ["page: bad requests", own.get("malformed", 0) + own.get("refused", 0), "bad"],
        ["page: stalled", own.get("stalled", 0) + own.get("turned_away", 0), "bad"],
        ["page: browsers", own.get("clients", 0), ""],
    ]
    rows += [[f"{name}: dropped", each.get("dropped", 0), "bad"] for name, each in others.items()]
    return [[name, str(count), kind if count else ""] for name, count, kind in rows]


_FINE = {"taken": "samples", "learned": "used", "changes": "changes"}


def _tiles(page: Mapping[str, Any], found: Mapping[str, Any] | None) -> Iterator[list[str]]:
    """Yield title, value, class and text of the mark, reason, and estimate now of each number."""
    now, depth = page["now"], page["depth"]
    for line in headline(found, page["loop"], now, _describe_depth(depth)):
        title = f"{line.name.capitalize()} {line.at}{' (chosen)' * depth['chosen']}"
        why, mark, last = "; ".join(filter(None, (line.reason, line.skew))), "no verdict", ""
        if line.mark is not None:
            mark, last = spoken(line.mark), f"now {_present(now, line.name)}"
        yield [title, line.value, _MARKS.get(line.mark or "", "open"), mark, why, last]


def _diagnosis(found: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield the remedy, if any, and the law, method and samples of the diagnosis: text, class."""
    if found.get("remedy"):
        yield [found["remedy"], ""]
    last = rounded(found["window"][1] - found["window"][0], 2)
    how = ", by ".join(filter(None, (found.get("law"), found["method"])))
    words = f"{how}, the last {last} s at {found['at']}, {found['samples']} samples; "
    yield [f"{words}± includes the systematic uncertainty", "soft"]
