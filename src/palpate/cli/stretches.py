"""The parts of a recording that were identified by themselves: places, or stretches of time."""

from rich.console import Console
from rich.text import Text

from palpate.cli.laws import parameters
from palpate.cli.layout import Column, print_table
from palpate.cli.verdicts import COLOURS, percent
from palpate.cli.working_depths import whole_error
from palpate.diagnosis import Quantity
from palpate.digits import rounded, with_error
from palpate.identifying import Identification
from palpate.results.following import with_prefix

_NUMBERS = (Column("stiffness\nN/m", right=True), Column("damping\nN·s/m", right=True))


def stretches_of(result: Identification) -> list[Identification]:
    """Return those between changes of the material."""
    return [part for part in result.stretches if part.place is None]


def when(part: Identification) -> str:
    """Return the times of a stretch."""
    time = part.contact.time
    return f"{rounded(float(time[0]), 4)} s to {rounded(float(time[-1]), 4)} s"


def print_stretches(result: Identification, console: Console) -> None:
    """Print what was identified between changes, each with its law, at one working depth."""
    columns = [Column("time\ns"), *_NUMBERS, Column("contact model"), Column("fit", right=True)]
    rows = []
    for part in stretches_of(result):
        there = part.diagnosis.working_depth
        rows.append(
            [
                when(part).replace(" s to ", "\nto ").removesuffix(" s"),
                _number(there.stiffness),
                _number(there.damping),
                "\n".join(parameters(part)),
                percent(part.fit_rmse_percent),
            ]
        )
    print_table(console, columns, rows)


def print_places(result: Identification, console: Console) -> None:
    """Print what was identified at each place: stiffness and damping at its own working depth."""
    places = [part for part in result.stretches if part.place is not None]
    if not places:
        return
    console.print()
    columns = [
        Column("time\ns", right=True),
        Column("at x, y, z\nmm", right=True),
        Column("depth\nmm", right=True),
        *_NUMBERS,
        *([Column("Young's\nmodulus", right=True)] if result.wanted.tip else []),
        Column("verdict"),
    ]
    print_table(console, columns, [_place(part) for part in places], compact=True)


def _place(part: Identification) -> list[str | Text]:
    found, time = part.diagnosis, part.contact.time
    there, verdict = found.working_depth, found.verdict.overall
    place = [] if part.place is None else part.place.position.tolist()
    return [
        f"{time[0]:.1f}–{time[-1]:.1f}",
        ", ".join(f"{1e3 * each:.1f}" for each in place),
        _depth(1e3 * there.depth),
        _number(there.stiffness),
        _number(there.damping),
        *([_modulus(part)] if part.wanted.tip else []),
        Text(verdict, style=COLOURS[verdict]),
    ]


def _depth(millimetres: float) -> str:
    """Three digits, with a zero at their end where there is one: they stand in a column."""
    plain = 0.01 <= millimetres < 1000.0
    return f"{millimetres:#.3g}".rstrip(".") if plain else rounded(millimetres, 3)


def _modulus(part: Identification) -> str:
    """With its whole error; the JSON says why there is none."""
    found = part.elastic_modulus()
    whole = Quantity(found.value.value, whole_error(found.value), 0.0)
    return "refused" if found.refused else with_prefix(whole, "Pa")


def _number(quantity: Quantity) -> str:
    """A number and its whole error: what repeats, and what the findings would move."""
    return with_error(quantity.value, whole_error(quantity))
