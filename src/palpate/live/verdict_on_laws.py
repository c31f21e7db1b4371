"""The verdict of a running loop, worked out in the process that shows it."""

import math
from base64 import b64decode
from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.estimate import Estimate
from palpate.estimators.law_evidence import Evidence, verdict_of
from palpate.estimators.law_verdicts import LawVerdict
from palpate.force_laws import GeneralisedHuntCrossley

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
            *(_unsettled(page) if known else ()),
            *(_open(verdict, estimate) if known else ()),
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


def _unsettled(page: Mapping[str, Any]) -> list[str]:
    """Say of a verdict that it flickers: twice another while the samples doubled."""
    now = Evidence(*page["evidence"]).samples
    late = [law for _, law, samples in page["turns"] if law and 2.0 * samples > now]
    # The first law after a change of the material is no turn.
    count = min(len(late), page["changes"])
    if count < 2:
        return []
    return [f"the verdict is not settled: it changed {count} times while the samples doubled"]


def _open(verdict: LawVerdict, estimate: Estimate) -> list[str]:
    """Say what the samples so far leave open of the verdict itself."""
    flags = []
    if verdict.effective_samples < _FEW * verdict.samples:
        flags.append(
            "what the best law leaves is correlated: so is the sensor's noise, or none of the laws "
            "on offer holds, and their error bars do not say so; --law any offers all"
        )
    damping, error = estimate.parameters[_DAMPING], estimate.standard_errors[_DAMPING]
    if verdict.candidate.damping != "none" and abs(damping) < 1e-6 * error:
        flags.append("B is 0: laws that differ by their damper alone are the same here")
    return flags
