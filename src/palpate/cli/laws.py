"""The identified law itself: its parameters, how they depend on each other, and the truth."""

import itertools
import math

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
    named = zip(
        law.names(), law.symbols, law.parameters, result.standard_errors, law.units, strict=True
    )
    return [
        f"{symbol} = {parameter(value, error, unit=unit, fixed=name in result.fixed)}"
        for name, symbol, value, error, unit in named
    ]


def _truths(result: Identification) -> list[str]:
    """The truth beside each parameter, where it is a law of the same kind."""
    law, truth = result.law, stated_truth(result)
    if truth is None or truth.kind != law.kind:
        return [""] * len(law.symbols)
    # How far it is from the truth only where the two mean the same.
    same = comparable(law, truth)
    rows = zip(law.names(), law.parameters, truth.parameters, result.standard_errors, strict=True)
    return [
        beside_truth(value, real, error if name in same else 0.0)
        for name, value, real, error in rows
    ]


def _correlations(result: Identification) -> str:
    symbols, found = result.law.symbols, result.correlations
    pairs = itertools.combinations(range(len(symbols)), 2)
    return ", ".join(
        f"{symbols[i]}–{symbols[j]} {_correlation(found[i, j])}"
        for i, j in pairs
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
