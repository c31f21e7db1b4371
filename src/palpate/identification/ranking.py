"""Comparison of methods: the recommended one, failures, and error bars that exclude each other."""

import itertools
import math
from collections.abc import Mapping

import numpy as np

from palpate.digits import rounded, with_error
from palpate.findings import MARKS, Check
from palpate.identification.diagnosis import Quantity
from palpate.identification.diagnosis.causes import CARE
from palpate.identification.identified import Identified
from palpate.method.estimators import ViscoelasticContact
from palpate.method.estimators.estimate import rmse_percent
from palpate.validation import Mask, frozen

EXCLUDED = 3.0  # standard errors of the difference; chosen by hand


@frozen
class Ranking:
    """Result of a comparison of methods.

    Attributes
    ----------
    recommended : str or None
        The recommended method; None if no method can be trusted.
    order : tuple of str
        The methods, the best first: by overall mark; then the methods that fit clearly worse than a
        selected relaxing law come last; then by both marks, and by the fit error.
    failing : tuple of str
        Methods whose estimate is not the least squares of their law, or that have no estimate.
    exclusions : tuple of str
        A sentence for each pair of methods whose error bars exclude each other.
    """

    recommended: str | None
    order: tuple[str, ...]
    failing: tuple[str, ...]
    exclusions: tuple[str, ...]


def rank(results: "Mapping[str, Identified]") -> Ranking:
    """Rank the identifications that :func:`palpate.compare` returned.

    Parameters
    ----------
    results : mapping
        Identifications by method name.
    """
    common = np.logical_and.reduce([result.trace.taken for result in results.values()])
    errors = {name: _common_rmse(result, common) for name, result in results.items()}
    outdone = _clearly_worse(results, errors)
    order = tuple(
        sorted(results, key=lambda name: _badness(results[name], errors[name], name in outdone))
    )
    failing = tuple(name for name in order if method_fails(results[name]))
    pairs = itertools.combinations(order, 2)
    phrases = (_exclusion(results[a], results[b]) for a, b in pairs)
    hopeless = all(r.diagnosis.verdict.overall == "do-not-trust" for r in results.values())
    best = None if hopeless else order[0]
    return Ranking(best, order, failing, tuple(word for word in phrases if word))


def method_fails(result: "Identified") -> bool:
    """Whether the method's estimate is not the least squares of its law on these samples."""
    findings = (f for f in result.diagnosis.findings if f.check == Check.METHOD)
    changes = ((f.moves_stiffness_percent, f.moves_damping_percent) for f in findings)
    return any(max(map(abs, change)) > 100.0 * CARE for change in changes)


def _common_rmse(result: "Identified", common: Mask) -> float:
    """RMSE% on the samples that all methods took; variable projection also takes shallow ones."""
    fit = rmse_percent(result.contact.force[common], result.fitted_force[common])
    return fit if math.isfinite(fit) else math.inf


# Ratio of errors below which a selected relaxing law is clearly better; chosen by hand.
CLEARLY = 0.9


def _clearly_worse(results: "Mapping[str, Identified]", errors: Mapping[str, float]) -> set[str]:
    """Return the methods that fit clearly worse than a relaxing law that was selected."""
    method = ViscoelasticContact.method
    if method not in results or not results[method].law.remembers:
        return set()
    return {name for name, fit in errors.items() if errors[method] <= CLEARLY * fit}


def _badness(result: "Identified", error: float, outdone: bool) -> tuple[float, ...]:
    verdict = result.diagnosis.verdict
    marks = verdict.overall, verdict.stiffness, verdict.damping
    overall, *others = map(MARKS.index, marks)
    # Rounded to a tenth, so that methods with one law and equal fit keep the order of the registry.
    return overall, outdone, *others, round(error, 1)


def _exclusion(result: "Identified", other: "Identified") -> str | None:
    if result.law.remembers or other.law.remembers:
        return None  # the stiffness of a relaxing law is not comparable to others
    working_depth = result.diagnosis.working_depth
    second = other.diagnosis.working_depth
    phrases = []
    for name in ("stiffness", "damping"):
        a = getattr(working_depth, name)
        b = getattr(second, name)
        apart = abs(a.value - b.value) / math.hypot(_bar(a), _bar(b))
        if apart > EXCLUDED:
            both = f"{with_error(a.value, _bar(a))} and {with_error(b.value, _bar(b))}"
            phrases.append(f"{name} {both} ({rounded(apart, 2)} standard errors)")
    if not phrases:
        return None
    return f"{result.method} and {other.method} exclude each other: {', '.join(phrases)}"


def _bar(quantity: Quantity) -> float:
    """Return both error bars together; infinite if the statistical one is unknown."""
    bar = quantity.whole_error
    return bar if math.isfinite(bar) and bar > 0.0 else math.inf
