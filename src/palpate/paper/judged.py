"""A claim of the paper beside the function that judges it from an experiment's numbers."""

from collections.abc import Callable, Mapping
from typing import Any

from palpate.paper.experiment import Claim, Finding

Numbers = Mapping[str, Any]
Judge = Callable[[Numbers], Finding]
Judged = tuple[Claim, Judge]


def findings(judged: tuple[Judged, ...], numbers: Numbers) -> dict[str, Finding]:
    """Judge every claim, by its key."""
    return {claim.key: judge(numbers) for claim, judge in judged}


def unchecked(why: str) -> Judge:
    """Return a judge that says why a claim cannot be checked here."""
    return lambda numbers: Finding(None, None, why)
