"""What follows from the loop's verdict on laws, in the process that shows it.

The numbers take most of a millisecond, which the loop has not.
"""

import math
from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.digits import rounded, with_error
from palpate.estimators.estimate import Estimate
from palpate.estimators.law_verdicts import STRONG, UNDECIDED, Evidence, LawVerdict, verdict_of
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.quantities.derived import in_hertz
from palpate.validation import or_nan

# Of the samples, that are independent: AR(1) noise of 0.9 leaves a nineteenth, of 0.875 as many.
_FEW = 1.0 / 15.0
_DAMPING = GeneralisedHuntCrossley.names().index("damping")


def verdict_on(status: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the verdict of what a loop's board says, as plain numbers and words.

    None of an estimator that compares no laws.

    Parameters
    ----------
    status : mapping
        What the board says.
    """
    page = status.get("verdict")
    if page is None:
        return None
    evidence = Evidence(*page["evidence"])
    estimate = estimate_of(page)
    verdict = verdict_of(evidence, estimate)
    known = bool(verdict.standings)
    return {
        **verdict.as_dict(),
        "known": known,
        "offered": [str(law) for law in evidence.laws],
        "own": list(verdict.candidate.own),
        "fixed": list(page["fixed"]),
        "parameters": page["parameters"],
        "covariance": page["covariance"],
        "flags": [
            *page["flags"],
            *(verdict.flags if page["parameters"] else ()),
            *(_open(page, verdict, estimate) if known else ()),
        ],
        "since": page["turns"][-1][0] if page["turns"] else math.nan,
        "changes": page["changes"],
        "turns": [[time, law] for time, law, _ in page["turns"]],
    }


def estimate_of(page: Mapping[str, Any]) -> Estimate:
    """Return the estimate of the board; of nothing learned one of a spring of nothing."""
    if page["parameters"] is None:
        law = GeneralisedHuntCrossley(0.0, 1.0, 0.0, 1.0)
        size = law.parameters.size
        return Estimate.from_law(law, np.zeros((size, size)), status=Status.WAITING, samples=0)
    parameters = page["parameters"]
    return Estimate.from_law(
        GeneralisedHuntCrossley.from_parameters(parameters),
        np.frombuffer(b64decode(page["covariance"])).reshape(len(parameters), -1),
        status=Status.UPDATED,
        samples=1,
    )


def _open(page: Mapping[str, Any], verdict: LawVerdict, estimate: Estimate) -> list[str]:
    """Say what the samples so far leave open of the verdict itself."""
    late = [law for _, law, samples in page["turns"] if law and 2.0 * samples > verdict.samples]
    # It flickers: twice another while the samples doubled; the first after a change is no turn.
    flags, count = list[str](), min(len(late), page["changes"])
    if count >= 2:
        flags.append(
            f"the verdict is not settled: it changed {count} times while the samples doubled"
        )
    if verdict.effective_samples < _FEW * verdict.samples:
        flags.append(
            "what the best law leaves is correlated: so is the sensor's noise, or none of the laws "
            "on offer holds, and their error bars do not say so; --law any offers all"
        )
    damping, error = estimate.parameters[_DAMPING], estimate.standard_errors[_DAMPING]
    if verdict.candidate.damping != "none" and abs(damping) < 1e-6 * error:
        flags.append("B is 0: laws that differ by their damper alone are the same here")
    return flags


#: Of each number its unit, and what it is called in a sentence.
NUMBERS: Mapping[str, tuple[str, str]] = {
    "stiffness": ("N/m", "K′"),
    "damping": ("N·s/m", "B′"),
    "loss_tangent": ("", "tan δ"),
    "instantaneous_stiffness": ("N/m", "at once"),
    "relaxed_stiffness": ("N/m", "relaxed"),
    "relaxation_time": ("s", "relaxation time"),
}
_FELT = tuple(NUMBERS)[:5]

Numbers = dict[str, tuple[float, float]]


def numbers_of(verdict: Mapping[str, Any]) -> Numbers:
    """Return :data:`NUMBERS` that the law in force has, each with its standard error.

    At the motion's own depth and frequency, outside whose band a law says nothing; none before the
    first verdict, and until the next after a change of the material.

    Parameters
    ----------
    verdict : mapping
        Of :func:`verdict_on`.
    """
    parameters, depth, omega = verdict["parameters"], verdict["depth"], verdict["frequency"]
    # The motion is that of the samples since; of a law of before it says no band.
    if not (verdict["known"] and parameters and depth and omega and min(depth, omega) > 0.0):
        return {}
    estimate = estimate_of(verdict)

    def felt(law: GeneralisedHuntCrossley) -> tuple[float, ...]:
        whole = law.dynamic_stiffness(depth, omega)
        return (
            whole.real,
            whole.imag / omega,
            whole.imag / whole.real if whole.real else math.nan,
            law.instantaneous().stiffness_at(depth),
            law.relaxed().stiffness_at(depth),
        )

    values, errors = estimate.with_errors(felt)
    found = dict(zip(_FELT, zip(values.tolist(), errors.tolist(), strict=True), strict=True))
    law: GeneralisedHuntCrossley = estimate.law
    if not law.remembers:  # it is one stiffness, whenever
        del found["instantaneous_stiffness"], found["relaxed_stiffness"]
    elif law.relaxation_time is not None:
        found["relaxation_time"] = law.relaxation_time, float(estimate.standard_errors[7])
    return found


def certainty(verdict: Mapping[str, Any]) -> str:
    """How sure the verdict is, in a word: none, before, alone, open, weak or strong."""
    if not verdict["known"]:
        return "none" if verdict["parameters"] is None else "before"
    lead, second = lead_of(verdict)
    if not second:
        return "alone"
    return "open" if lead < UNDECIDED else "weak" if lead < STRONG else "strong"


def standing(verdict: Mapping[str, Any]) -> str:
    """By how much the law in force leads, in words."""
    lead, second = lead_of(verdict)
    return {
        "none": "no verdict yet",
        "before": "of before: of the samples since there is no verdict yet",
        "alone": "the only law that competes",
        "open": f"cannot be told from {second}: before it by {rounded(max(lead, 0.0), 2)}",
        "weak": f"not sure: before {second} by {rounded(lead, 2)}, and ten are strong evidence",
        "strong": f"before {second} by {rounded(lead, 3)}",
    }[certainty(verdict)]


def lead_of(verdict: Mapping[str, Any]) -> tuple[float, str]:
    """By how much the law in force leads before which other; NaN where there is none."""
    own = [each["score"] for each in verdict["standings"] if each["law"] == verdict["law"]]
    others = [each for each in verdict["standings"] if each["law"] != verdict["law"]]
    if not (own and others):
        return math.nan, ""
    return float(others[0]["score"]) - float(own[0]), str(others[0]["law"])


def in_words(verdict: Mapping[str, Any], numbers: Numbers) -> str:
    """The verdict in a line of text."""
    if verdict["parameters"] is None:
        return "no law yet"
    words = f"{verdict['law']} ({standing(verdict)})"
    if numbers:
        named = [
            f"{NUMBERS[name][1]} {written(numbers, name)}" for name in ("stiffness", "damping")
        ]
        depth, often = rounded(1e3 * verdict["depth"], 2), in_hertz(verdict["frequency"])
        words += f", {', '.join(named)} at {depth} mm and {often}"
    return words


def law_lines(verdict: Mapping[str, Any]) -> Iterator[str]:
    """The verdict at the end of a run, in lines.

    Parameters
    ----------
    verdict : mapping
        As for :func:`numbers_of`.
    """
    numbers = numbers_of(verdict)
    evidence, changes = "", int(verdict["changes"])
    if verdict["known"]:
        effective, of = rounded(verdict["effective_samples"], 3), rounded(verdict["samples"], 4)
        turned = f", changed {changes} times" if changes else ""
        evidence = f"; {effective} independent samples of {of}{turned}"
    yield f"law: {in_words(verdict, {})}{evidence}"
    if numbers:
        depth, often = rounded(1e3 * verdict["depth"], 3), in_hertz(verdict["frequency"])
        named = [f"{NUMBERS[name][1]} {written(numbers, name)}" for name in numbers]
        yield f"a small oscillation of {often} about {depth} mm: {', '.join(named)}"
    yield from verdict["flags"]


def written(numbers: Numbers, name: str) -> str:
    """One of them with its error bar and unit."""
    return with_error(*numbers[name], unit=NUMBERS[name][0])


def fields_of(verdict: Mapping[str, Any], origin: float = 0.0) -> dict[str, float | str]:
    """The verdict as fields of a message: words, and plain numbers in SI.

    Parameters
    ----------
    verdict : mapping
        As for :func:`numbers_of`.
    origin : float
        What the loop counts its times from, s.
    """
    fields: dict[str, float | str] = {
        "law": str(verdict["law"]) if verdict["parameters"] is not None else "",
        "standing": standing(verdict),
        "lead": lead_of(verdict)[0],
        "samples": or_nan(verdict["samples"]),
        "independent_samples": or_nan(verdict["effective_samples"]),
        "since": origin + float(verdict["since"]),
        "changes": float(verdict["changes"]),
        # Of a probe that has not moved there is neither.
        "depth": or_nan(verdict["depth"] or None),
        "frequency": or_nan(verdict["frequency"] or None),
    }
    numbers = numbers_of(verdict)
    for name in NUMBERS:
        value, error = numbers.get(name, (math.nan, math.nan))
        fields |= {name: value, f"{name}_standard_error": error}
    fields["flags"] = "; ".join(verdict["flags"])
    return fields


def told(verdict: Mapping[str, Any]) -> dict[str, Any]:
    """The verdict with what follows from it, for the page; without the covariance.

    Parameters
    ----------
    verdict : mapping
        As for :func:`numbers_of`.
    """
    lead, second = lead_of(verdict)
    return {
        **{name: value for name, value in verdict.items() if name != "covariance"},
        "certainty": certainty(verdict),
        "standing": standing(verdict),
        "lead": lead,
        "second": second,
        "numbers": numbers_of(verdict),
        "spectrum": _spectrum(verdict["parameters"]),
    }


def _spectrum(parameters: Sequence[float] | None) -> tuple[float, float] | None:
    """The shortest and the longest relaxation time of a spectrum, which are no estimates."""
    if parameters is None:
        return None
    relaxation = GeneralisedHuntCrossley.from_parameters(parameters).relaxation
    ends = (0.0, 0.0) if relaxation is None else relaxation.spectrum[1:]
    return ends if ends[0] else None  # one time has no shortest
