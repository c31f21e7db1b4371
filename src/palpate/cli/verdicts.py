"""A diagnosis as a person reads it."""

import math

from rich.console import Console
from rich.text import Text

from palpate.cli.layout import Cell, Column, print_table, say, say_path
from palpate.cli.printing import Terminal
from palpate.cli.working_depths import print_working_depths
from palpate.diagnosis import Episode
from palpate.digits import rounded
from palpate.identifying import Identification

COLOURS = {"trust": "green", "with-care": "yellow", "do-not-trust": "red", "note": "dim"}


def print_verdict(result: Identification, console: Console, *, name: str = "") -> None:
    """Print the verdict of an identification, its reason, and what to do about it."""
    found = result.diagnosis
    verdict = found.verdict
    words = Text(f"{name}: " if name else "")
    words.append(verdict.overall, f"bold {COLOURS[verdict.overall]}")
    words.append(f" (stiffness: {verdict.stiffness}, damping: {verdict.damping}): {found.reason}")
    if found.remedy:
        words.append(f" ({found.remedy})", "dim")
    say(console, words)


def print_diagnosis(result: Identification) -> None:
    """Print the verdict, the numbers that it is about, and every finding with its remedy."""
    console, found = Terminal(), result.diagnosis
    say_path(console, result.contact.source or "contact", "bold")
    print_verdict(result, console)
    console.print()
    print_working_depths(result, console)
    console.print()
    columns = [
        Column("check"),
        Column("what was found", prose=True),
        Column("z", right=True),
        Column("moves S, C", right=True),
    ]
    rows: list[list[Cell]] = []
    for finding in found.findings:
        remedy = f"\n→ {finding.remedy}" if finding.remedy else ""
        rows.append(
            [
                Text(finding.check, style=COLOURS[finding.severity]),
                f"{finding.sentence}{remedy}",
                "–" if math.isnan(finding.z) else rounded(finding.z, 3),
                _moves(finding.moves_stiffness_percent, finding.moves_damping_percent),
            ]
        )
    print_table(console, columns, rows)
    say(console, "z: standard errors; S, C: stiffness and damping at working depth", "dim")
    for episode in found.episodes:
        say(console, _episode(episode))


def percent(value: float) -> str:
    """Return a percentage of the force; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.2f} %"


def share(value: float) -> str:
    """Return a fraction as a percentage; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.1%}"


def _episode(episode: Episode) -> str:
    law = ", ".join(f"{name} = {rounded(v, 4)}" for name, v in episode.law.as_dict().items())
    stiffness = rounded(episode.working_depth.stiffness.value, 4)
    times = f"{rounded(episode.start, 4)} to {rounded(episode.stop, 4)} s"
    return f"{times}: {law}; stiffness {stiffness} N/m"


def _moves(stiffness: float, damping: float) -> str:
    if math.isnan(stiffness) or math.isnan(damping):
        return "–"
    return f"{_signed(stiffness)} %, {_signed(damping)} %"


def _signed(value: float) -> str:
    if abs(value) < 1000.0:
        return f"{value:+.1f}"
    return f"{'-' if value < 0.0 else '+'}{rounded(abs(value), 3)}"
