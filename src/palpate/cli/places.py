"""The places of a probe that travels, a line each."""

import math

from rich.console import Console
from rich.text import Text

from palpate.cli.derived import with_prefix
from palpate.cli.verdicts import COLOURS
from palpate.diagnosis import Quantity
from palpate.identification import Identification

WIDTH = 100  # of a line: narrower windows wrap it, and a file holds it whole


def print_places(result: Identification, console: Console) -> None:
    """Print what was identified at each place: stiffness and damping at its own working depth."""
    from palpate.cli.tables import new_table

    table = new_table()
    headings = ("time, s", "at x, y, z, mm", "depth, mm", "stiffness, N/m", "damping, N·s/m")
    for heading in (*headings, *(["E"] if result.wanted.tip else [])):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for part in result.stretches:
        table.add_row(*_row(part))
    window = console.width
    console.width = max(window, WIDTH)  # a width that is asked for never exceeds the console's
    console.print(table, crop=False, overflow="ignore")
    console.width = window


def _row(part: Identification) -> tuple[str | Text, ...]:
    found, time = part.diagnosis, part.contact.time
    there, verdict = found.working_depth, found.verdict.overall
    place = [] if part.place is None else part.place.position.tolist()
    return (
        f"{time[0]:.1f}–{time[-1]:.1f}",
        ", ".join(f"{1e3 * each:.1f}" for each in place),
        f"{1e3 * there.depth:.2f}",
        _number(there.stiffness),
        _number(there.damping),
        *([_modulus(part)] if part.wanted.tip else []),
        Text(verdict, style=COLOURS[verdict]),
    )


def _modulus(part: Identification) -> str:
    """Young's modulus; why there is none is in the JSON."""
    found = part.elastic_modulus()
    return "refused" if found.refused else with_prefix(found.value, "Pa")


def _number(quantity: Quantity) -> str:
    """A number and its whole error: what repeats, and what the findings would move."""
    parts = [quantity.standard_error, quantity.systematic]
    error = math.hypot(*(each for each in parts if math.isfinite(each)))
    return f"{quantity.value:.4g} ± {error:.2g}" if error > 0.0 else f"{quantity.value:.4g}"
