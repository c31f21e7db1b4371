"""The identified law itself: its parameters, how they depend on each other, and the truth."""

import itertools
import math

import numpy as np
from rich.console import Console

from palpate.cli.layout import Column, print_table, say
from palpate.cli.truths import beside_truth, comparable, felt_beside_truth, stated_truth
from palpate.digits import parameter, with_error
from palpate.identification import Identification


def print_law(result: Identification, console: Console) -> None:
    """Print each parameter with its standard error, what correlates, and what is known beside."""
    lines, truths = parameters(result), _truths(result)
    columns = [Column("contact model")]
    if any(truths):
        columns.append(Column(""))
        print_table(console, columns, [list(row) for row in zip(lines, truths, strict=True)])
    else:
        print_table(console, columns, [[line] for line in lines])
    if words := _correlations(result):
        say(console, f"correlation {words}")
    for line in _beside(result):
        say(console, line)


def parameters(result: Identification) -> list[str]:
    """Return a line for each parameter: ``K = 2002.0 ± 1.9 N/mⁿ``."""
    law = result.law
    return [
        f"{law.symbols[k]} = "
        + parameter(
            float(law.parameters[k]),
            float(result.standard_errors[k]),
            unit=law.units[k],
            fixed=law.names()[k] in result.fixed,
        )
        for k in _shown(result)
    ]


def _shown(result: Identification) -> list[int]:
    """Places of the parameters that say something: not of a memory that there is none of."""
    law, truth = result.law, stated_truth(result)
    real = truth.as_dict() if truth is not None and truth.kind == law.kind else {}
    return [
        place
        for place, (name, value) in enumerate(law.as_dict().items())
        if name not in law.optional or value or real.get(name)
    ]


def _truths(result: Identification) -> list[str]:
    """The truth beside each parameter, where it is a law of the same kind.

    How far away it is, where the two mean the same.
    """
    law, truth, shown = result.law, stated_truth(result), _shown(result)
    if truth is None or truth.kind != law.kind:
        return [""] * len(shown)
    errors = result.standard_errors if comparable(law, truth) else np.zeros(law.parameters.size)
    return [beside_truth(law.parameters[k], truth.parameters[k], errors[k]) for k in shown]


def _correlations(result: Identification) -> str:
    symbols, found = result.law.symbols, result.correlations
    # Of two that are one number, as n and p of Hunt and Crossley's damper, the first.
    apart = [k for k in range(len(symbols)) if not (np.abs(found[k, :k]) > 1.0 - 1e-9).any()]
    return ", ".join(
        f"{symbols[i]}–{symbols[j]} {_correlation(found[i, j])}"
        for i, j in itertools.combinations(apart, 2)
        if math.isfinite(found[i, j])
    )


def _correlation(value: float) -> str:
    """With as many digits as keep it apart from one, up to four."""
    words = next((w for w in (f"{value:.{k}f}" for k in (2, 3, 4)) if abs(float(w)) < 1.0), "")
    return words or f"{value:.4f}"


def _beside(result: Identification) -> list[str]:
    """What was estimated beside the law."""
    estimate, lines = result.estimate, []
    if estimate.offset_standard_error > 0.0:
        words = with_error(estimate.offset, estimate.offset_standard_error, unit="N")
        lines.append(f"force offset {words}")
    if estimate.surface_standard_error > 0.0:
        error = 1e3 * estimate.surface_standard_error
        lines.append(f"surface at {with_error(1e3 * estimate.surface, error, unit='mm')}")
    if felt := felt_beside_truth(result):
        lines.append(felt)
    return lines
