"""A diagnosis as a person reads it."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from palpate.cli.printing import Terminal
from palpate.diagnosis import Diagnosis, Quantity
from palpate.identification import Identification
from palpate.ranking import rank

COLOURS = {"trust": "green", "with-care": "yellow", "do-not-trust": "red", "note": "dim"}


def print_verdict(result: Identification, console: Console, *, name: str = "") -> None:
    """Print the verdict of an identification, its reason, and the numbers at working depth."""
    found = result.diagnosis
    start = f"{name}: " if name else ""
    verdict = found.verdict
    words = Text(f"{start}{verdict.overall}", style=f"bold {COLOURS[verdict.overall]}")
    words.append(f" (stiffness: {verdict.stiffness}, damping: {verdict.damping})", "none")
    words.append(f": {found.reason}", "none")
    if found.remedy:
        words.append(f" ({found.remedy})", "dim")
    console.print(words, soft_wrap=True)
    if not name:
        console.print(Text(_working_depth(found)), soft_wrap=True)


def print_ranking(results: Sequence[Identification], console: Console) -> list[Identification]:
    """Print every method's verdict, the best first, and which to take; return them so ordered."""
    ranking = rank({result.method: result for result in results})
    by_name = {result.method: result for result in results}
    ordered = [by_name[name] for name in ranking.order]
    console.print(Text(f"recommended: {ranking.recommended or 'none of them'}", style="bold"))
    for result in ordered:
        print_verdict(result, console, name=result.method)
    for words in ranking.exclusions:
        console.print(Text(words, style="yellow"), soft_wrap=True)
    return ordered


def print_diagnosis(result: Identification) -> None:
    """Print the verdict and every finding with its remedy."""
    console, found = Terminal(), result.diagnosis
    console.print(Text(result.contact.source or "contact", style="bold"))
    print_verdict(result, console)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for heading in ("check", "what was found", "z", "moves S, C"):
        table.add_column(heading, justify="right" if heading in ("z", "moves S, C") else "left")
    for finding in found.findings:
        words = finding.sentence
        if finding.remedy:
            words += f"\n→ {finding.remedy}"
        table.add_row(
            Text(finding.check, style=COLOURS[finding.severity]),
            Text(words),
            "–" if math.isnan(finding.z) else f"{finding.z:.3g}",
            _moves(finding.moves_stiffness_percent, finding.moves_damping_percent),
        )
    console.print(table)
    for episode in found.episodes:
        law = ", ".join(f"{k} = {v:.4g}" for k, v in episode.law.as_dict().items())
        stiffness = episode.working_depth.stiffness.value
        words = f"{episode.start:.4g} to {episode.stop:.4g} s: {law}; stiffness {stiffness:.4g} N/m"
        console.print(Text(words), soft_wrap=True)


def _working_depth(found: Diagnosis) -> str:
    there = found.working_depth
    return (
        f"at {1e3 * there.depth:.4g} mm: force {_number(there.force)} N, stiffness "
        f"{_number(there.stiffness)} N/m, damping {_number(there.damping)} N·s/m "
        "(± repeatable ± what the findings would move)"
    )


def _number(quantity: Quantity) -> str:
    words = f"{quantity.value:.4g}"
    for error in (quantity.standard_error, quantity.systematic):
        if math.isfinite(error) and error > 0.0:
            words += f" ± {error:.2g}"
    return words


def _moves(stiffness: float, damping: float) -> str:
    if math.isnan(stiffness) or math.isnan(damping):
        return "–"
    return f"{stiffness:+.1f} %, {damping:+.1f} %"
