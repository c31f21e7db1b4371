"""The identified law itself: its parameters, how they depend on each other, and the truth."""

import itertools
import math

from rich.console import Console

from palpate.cli.layout import Column, print_table, say
from palpate.cli.truths import beside_truth, comparable, felt_beside_truth, stated_truth
from palpate.digits import with_error
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.identifying import Identification
from palpate.results.parameters import correlated, parameter_rows


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
    return [str(row) for row in parameter_rows(result)]


def _truths(result: Identification) -> list[str]:
    """The truth beside each parameter, where it is a law of the same kind."""
    law, truth, rows = result.law, stated_truth(result), parameter_rows(result)
    if truth is not None and isinstance(law, GeneralisedHuntCrossley):
        alike = law.simplest()
        law = alike if alike.kind == truth.kind else law
    if truth is None or truth.kind != law.kind:
        return [""] * len(rows)
    # How far it is from the truth only where the two mean the same.
    same = comparable(law, truth)
    values, real, errors = law.as_dict(), truth.as_dict(), result.standard_errors
    return [
        beside_truth(
            values[row.name],
            real[row.name],
            float(errors[row.index]) if row.name in same else 0.0,
        )
        if row.name in real and row.estimated
        else ""
        for row in rows
    ]


def _correlations(result: Identification) -> str:
    found, pairs = result.correlations, itertools.combinations(correlated(result), 2)
    return ", ".join(
        f"{one}–{other} {_correlation(found[i, j])}"
        for (i, one), (j, other) in pairs
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
