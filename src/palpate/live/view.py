"""Text of a live run: for the console, the wires and the page.

The process that shows the text composes it, because that takes most of a millisecond, which the
loop cannot spare. Each key of the page's text is the id of an element in its document.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from palpate.digits import format_quantity, parameter, rounded, with_error
from palpate.findings import Check, Finding, spoken
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.live.sinks import why_undiagnosed
from palpate.method.estimators.estimate import Estimate
from palpate.method.estimators.law_verdicts import LawVerdict
from palpate.method.estimators.viscoelastic import unpack_verdict
from palpate.output.results import view
from palpate.validation import frozen, or_nan

# Effective sample size over samples: AR(1) noise of 0.875 gives 1/15, of 0.9 it gives 1/19.
_FEW = 1.0 / 15.0
_DAMPING = GeneralisedHuntCrossley.names().index("B")
#: Unit and name of each number of the preferred law.
NUMBERS: Mapping[str, tuple[str, str]] = {
    "stiffness": ("N/m", "Dynamic stiffness K′"),
    "damping": ("N·s/m", "Dynamic damping B′"),
    "loss_tangent": ("", "Loss tangent tan δ"),
    "instantaneous_stiffness": ("N/m", "Instantaneous stiffness"),
    "relaxed_stiffness": ("N/m", "Relaxed stiffness"),
    "relaxation_time": ("s", "Relaxation time"),
}
_RESPONSE = tuple(NUMBERS)[:5]
#: Numbers by name, each with its standard error.
Numbers = dict[str, tuple[float, float]]
_UNKNOWN = math.nan, math.nan


@frozen
class LiveVerdict:
    """Verdict on the force law, from the loop's status.

    Attributes
    ----------
    law : LawVerdict
        The preferred law and the evidence for it; its depth and frequency are those of the motion.
    estimate : Estimate
        The present estimate; a law of zero force before the first sample.
    learned : bool
        Whether a sample was used, so that the estimate is a result.
    flags : list of str
        Warnings about the estimate and the verdict.
    changes : int
        Changes of the preferred law since the evidence was last discarded.
    turns : list of (float, str or None)
        Time, s, of each change, and the law preferred from then on; None: none.
    time : float
        Time of the latest sample that it speaks of, s; NaN before the first.
    """

    law: LawVerdict
    estimate: Estimate
    learned: bool
    flags: list[str]
    changes: int
    turns: list[tuple[float, str | None]]
    time: float

    @property
    def certainty(self) -> str:
        """How strong the evidence is: none, before (outdated), alone, open, weak or strong."""
        if not self.law.known:
            return "before" if self.learned else "none"
        return self.law.certainty

    @property
    def standing(self) -> str:
        """How the preferred law compares with the best other law without memory."""
        if self.law.known:
            return self.law.comparison
        outdated = "outdated: no verdict yet on the new samples"
        return outdated if self.learned else "no verdict yet"

    @property
    def since(self) -> float:
        """Time of the last change, s; NaN without one."""
        return self.turns[-1][0] if self.turns else math.nan

    def __str__(self) -> str:
        return f"{self.law.candidate} ({self.standing})" if self.learned else "no law yet"

    def lines(self) -> Iterator[str]:
        """Yield the lines that describe the verdict at the end of a run."""
        turned = f", changed {self.changes} times" if self.changes and self.law.known else ""
        yield f"law: {self}{turned}"
        yield from self.flags

    def at(self, depth: float, frequency: float) -> "LiveVerdict":
        """Return the same verdict for the numbers at a depth [m] and a frequency [rad/s]."""
        return replace(self, law=replace(self.law, depth=depth, frequency=frequency))

    def numbers(self) -> Numbers:
        """Return the :data:`NUMBERS` of the preferred law at its depth and frequency.

        Empty until the first verdict, and again after a change of material.
        """
        depth = self.law.depth
        omega = self.law.frequency
        # Depth and frequency are of the samples since a change; an outdated law has no band there.
        if not (self.law.known and self.learned and depth > 0.0 and omega > 0.0):
            return {}

        def law_response(law: GeneralisedHuntCrossley) -> tuple[float, ...]:
            whole = law.dynamic_stiffness(depth, omega)
            return (
                whole.real,
                whole.imag / omega,
                whole.imag / whole.real if whole.real else math.nan,
                law.instantaneous().stiffness_at(depth),
                law.relaxed().stiffness_at(depth),
            )

        values, errors = self.estimate.with_errors(law_response)
        pairs = zip(values.tolist(), errors.tolist(), strict=True)
        found: Numbers = dict(zip(_RESPONSE, pairs, strict=True))
        law: GeneralisedHuntCrossley = self.estimate.law
        if not law.remembers:  # its stiffness does not depend on time
            del found["instantaneous_stiffness"], found["relaxed_stiffness"]
        elif law.relaxation is not None and (time := law.relaxation_time) is not None:
            found["relaxation_time"] = time, time * law.relaxation.resolution
        return found

    def fields(self, origin: float = 0.0) -> dict[str, float | str]:
        """Return the fields of a message: text, and plain numbers in SI units.

        ``origin`` is the zero of the loop's times, s.
        """
        law = self.law
        numbers = self.numbers()
        fields: dict[str, float | str] = {
            "law": str(law.candidate) if self.learned else "",
            "standing": self.standing,
            "lead": law.lead,
            "samples": law.samples,
            "independent_samples": law.effective_samples,
            "since": origin + self.since,
            "changes": float(self.changes),
            # A probe that has not moved has neither.
            "depth": law.depth or math.nan,
            "frequency": law.frequency or math.nan,
        }
        for name in NUMBERS:
            value, error = numbers.get(name, _UNKNOWN)
            fields |= {name: value, f"{name}_standard_error": error}
        return fields | {"flags": "; ".join(self.flags)}


def verdict_on(status: Mapping[str, Any]) -> LiveVerdict | None:
    """Return the verdict on the force law in a status; None if the estimator compares no laws."""
    page = status.get("verdict")
    if page is None:
        return None
    verdict, estimate = unpack_verdict(page)
    learned = estimate.samples > 0
    findings = [*(verdict.findings if learned else ())]
    findings += _open(page, verdict, estimate) if verdict.known else ()
    flags = [*page["flags"], *(finding.titled for finding in findings)]
    turns = [(time, law) for time, law, _ in page["turns"]]
    time = or_nan(page["time"])
    return LiveVerdict(verdict, estimate, learned, flags, page["changes"], turns, time)


def _open(page: Mapping[str, Any], verdict: LawVerdict, estimate: Estimate) -> Iterator[Finding]:
    """Yield the warnings about the verdict itself."""
    late = [law for _, law, samples in page["turns"] if law and 2.0 * samples > verdict.samples]
    # Two changes while the samples doubled. The first law after a restart is no change.
    if (count := min(len(late), page["changes"])) >= 2:
        text = f"the preferred law is not settled: {count} changes while the samples doubled"
        yield Check.UNSETTLED_LAW.finding(text)
    if verdict.effective_samples < _FEW * verdict.samples:
        yield Check.CORRELATED_RESIDUALS.finding(
            "the residuals of the best law are correlated: either the sensor noise is, or no "
            "compared law holds and the error bars are too small"
        )
    damping = estimate.parameters[_DAMPING]
    error = estimate.standard_errors[_DAMPING]
    if verdict.candidate.damping != "none" and abs(damping) < 1e-6 * error:
        yield Check.NO_DAMPER.finding(
            "B is 0: laws that differ only in their damper are equivalent"
        )


# The answer: stiffness and damping at the working depth and the motion's frequency.

_UNITS = {"stiffness": "N/m", "damping": "N·s/m"}


def headline(
    found: Mapping[str, Any] | None,
    status: Mapping[str, Any],
    now: Numbers,
    at: str,
) -> list[view.NumberLine]:
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
        return [view.NumberLine(**each) for each in found["numbers"]]
    reason = why or (found or {}).get("reason") or ""
    return [view.NumberLine(name, _present(now, name), at, None, reason) for name in _UNITS]


def answer(lines: Iterable[view.NumberLine], *, reasons: bool = True) -> str:
    """Return the numbers in one line, each with its mark and what sets that."""
    return "; ".join(line.text(reasons=reasons) for line in lines)


def _present(now: Numbers, name: str) -> str:
    """Format the present estimate of a number."""
    value, error = now.get(name, _UNKNOWN)
    return "not known yet" if math.isnan(value) else with_error(value, error, unit=_UNITS[name])


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


def share(fraction: float | None) -> str:
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
        limit = f"{share(known.get('within'))} within {seconds(figures.get('limit'))}"
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


def view_texts(page: Mapping[str, Any], verdict: LiveVerdict | None, now: float) -> Words:
    """Return the texts that freeze while the view is paused; ``now`` is a sample's time, s."""
    law = page["loop"]["law"]
    depth = _describe_depth(page["depth"])
    tiles = []
    panels = [
        [f"{name.capitalize()} {depth}", unit, name, f"{name}_error"]
        for name, unit in _UNITS.items()
    ]
    for k in law.get("shown", ()):
        symbol = law["symbols"][k]
        unit = law["units"][k]
        name = law["names"][k]
        words = _parameter(page["now"], name, k, verdict)
        tiles.append([f"{symbol} [{unit}]" if unit else symbol, words])
        panels.append([symbol, unit, f"parameter_{k}", f"error_{k}"])
    changes = [
        [
            f"{rounded(max(now - each['time'], 0.0), 3)} s ago",
            *(_terms(each["law"], each.get(when, {})) for when in ("before", "after")),
        ]
        for each in reversed(page["changes"])
    ]
    texts: Words = {"numbers": tiles, "curves": panels, "changes": changes or [["none"]]}
    return texts | (law_card_texts(verdict, now) if verdict else {})


def _describe_depth(depth: Mapping[str, Any]) -> str:
    """Format the working depth of the page, and the motion's frequency."""
    if math.isnan(depth["value"]):
        return "at working depth"
    return view.describe_place(depth["value"], depth["frequency"] or math.nan)


def _parameter(found: Mapping[str, Any], name: str, k: int, verdict: LiveVerdict | None) -> str:
    """Format a parameter of the preferred law: identified, fixed, or not in this law."""
    if verdict and verdict.learned and name not in verdict.law.candidate.own:
        return "not in this law"
    if "parameters" not in found:
        return "unknown"
    fixed = verdict is not None and name in verdict.estimate.fixed
    return parameter(found["parameters"][k], found["errors"][k], fixed=fixed)


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
    return f"{' → '.join(rounded(end[0], 3) for end in ends)} N/m"


def law_card_texts(verdict: LiveVerdict, now: float) -> Words:
    """Return the texts of the page's card of force laws at time ``now``, s."""
    certainty = verdict.certainty
    turns = verdict.turns[: -_TURNS - 1 : -1]
    since = ""
    if verdict.law.known and math.isfinite(verdict.since):
        turned = f"; changed {verdict.changes} times" if verdict.changes else ""
        since = f"Preferred for {_ago(now, verdict.since)}{turned}."
    badge, kind = _BADGES[certainty]
    numbers = verdict.numbers()
    at = ""
    if numbers:
        at = f"small oscillation {view.describe_place(verdict.law.depth, verdict.law.frequency)}"
    return {
        "law-name": str(verdict.law.candidate) if verdict.learned else "Not known yet",
        "law-badge": badge,
        "law-kind": kind,
        "law-lead": verdict.standing,
        "law-since": since,
        "law-turns": [
            *(f"{_ago(now, time)} ago: {law or 'restarted'}" for time, law in turns),
            *[""] * (_TURNS - len(turns)),
        ],
        "law-at": at,
        "law-numbers": [
            [title, _law_number(verdict.estimate.law, numbers, name)]
            for name, (_, title) in NUMBERS.items()
        ],
        "law-flags": verdict.flags or ["no warnings"],
    }


def _ago(now: float, then: float) -> str:
    return f"{max(now - then, 0.0):.1f} s"


def _law_number(law: GeneralisedHuntCrossley, numbers: Numbers, name: str) -> str:
    """Format one of the numbers, or describe why the law has none."""
    if name in numbers:
        return with_error(*numbers[name], unit=NUMBERS[name][0])
    if not numbers:
        return "–"
    if law.remembers:
        return law.describe_relaxation()
    return "no memory" if name == "relaxation_time" else "equals K′: no memory"


def fact_texts(page: Mapping[str, Any], state: str, contact_force: float | None = None) -> Words:
    """Return the texts that continue while the view is paused: answer, state, counts, times.

    ``contact_force`` is the present force, N, if the probe is in contact.
    """
    loop = page["loop"]
    others = page["others"]
    lamp, title, words = _STATES[state]
    fault = loop.get("fault") or loop.get("tare_refused")
    recorder = others.get("recorder", {})
    truth = loop.get("chosen", {}).get("truth")
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
    if found and found.get("lines"):
        facts["diagnosis"] = found["lines"]
    verdict, lines = gain_texts(found, loop)
    facts["gains-verdict"] = verdict
    facts["gains"] = [[line, ""] for line in lines]
    return facts


def gain_texts(
    found: Mapping[str, Any] | None, status: Mapping[str, Any]
) -> tuple[str, Iterable[str]]:
    """Return the verdict on the gains of the control loop and its lines, or why there is none."""
    if not found or "gains" not in found:
        return "no control loop; --control-loop FILE names one", ()
    if why := why_undiagnosed(found, status) or (not found["gains"] and found["reason"]):
        return f"not known: {why}", ()
    return found["gains"]["verdict"].replace("-", " "), found["gains"]["lines"]


def _counts(
    counts: Mapping[str, Any],
    others: Mapping[str, Any],
    own: Mapping[str, Any],
) -> list[list[str]]:
    """Return the rows of counts; a count that should be 0 but is not is marked ``bad``."""
    rows = [[words, counts.get(key, 0), ""] for key, words in _FINE.items()]
    rows += [[words, counts.get(key, 0), "bad"] for key, words in COUNTED.items()]
    rows += [
        [f"page: {name.replace('_', ' ')}", count, "bad" * (name != "browsers")]
        for name, count in own.items()
    ]
    rows += [[f"{name}: dropped", each.get("dropped", 0), "bad"] for name, each in others.items()]
    return [[name, str(count), kind if count else ""] for name, count, kind in rows]


_FINE = {"taken": "samples", "learned": "used", "changes": "changes"}


def _tiles(page: Mapping[str, Any], found: Mapping[str, Any] | None) -> Iterator[list[str]]:
    """Yield title, value, class and text of the mark, reason, and estimate now of each number."""
    now = page["now"]
    depth = page["depth"]
    for line in headline(found, page["loop"], now, _describe_depth(depth)):
        title = f"{line.name.capitalize()} {line.at}{' (chosen)' * depth['chosen']}"
        mark = "no verdict"
        last = ""
        if line.mark is not None:
            mark = spoken(line.mark)
            last = f"now {_present(now, line.name)}"
        yield [title, line.value, _MARKS.get(line.mark or "", "open"), mark, line.reason, last]
