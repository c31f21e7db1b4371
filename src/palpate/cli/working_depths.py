"""Force, stiffness and damping at working depth: what every result leads with."""

import math

from rich.console import Console

from palpate.cli.layout import Column, fits, print_table, say
from palpate.cli.truths import LEGEND, beside_truth, truth_at_rest
from palpate.diagnosis import Quantity, WorkingDepth
from palpate.diagnosis.data import in_words
from palpate.diagnosis.fit import DEEP
from palpate.digits import with_error
from palpate.force_laws import ForceLaw
from palpate.identifying import Identification

_BARS = "± repeatable ± what the findings would move"
_RELAXED = "once the material has relaxed"
_ROWS = (("force", "N"), ("stiffness", "N/m"), ("damping", "N·s/m"))


def print_working_depths(result: Identification, console: Console) -> None:
    """Print the three with both error bars, and with the truth where the file states it."""
    truth, depths = truth_at_rest(result), result.working_depths
    names = ["median" if result.depth is None else "as asked", f"{DEEP:.0f}th percentile"]
    headings = [
        f"at {in_words(there.depth, 'm', digits=4)}\n{name}"
        for there, name in zip(depths, names, strict=False)
    ]
    columns = [Column(""), *map(Column, headings)]
    rows = [[name, *(_cell(there, name, unit, truth) for there in depths)] for name, unit in _ROWS]
    if fits(console, columns, rows):
        print_table(console, columns, rows)
    else:  # a block for each depth
        columns = [Column("depth"), *(Column(name) for name, _ in _ROWS)]
        names = [heading.replace("\n", ", ") for heading in headings]
        blocks = zip(names, *(row[1:] for row in rows), strict=True)
        print_table(console, columns, [list(block) for block in blocks])
    words = [_BARS, *([_RELAXED] if result.law.remembers else []), *([LEGEND] if truth else [])]
    say(console, "; ".join(words), "dim")


def whole_error(quantity: Quantity) -> float:
    """Return what repeats and what the findings would move together; NaN where one is unknown."""
    return math.hypot(quantity.standard_error, quantity.systematic)


def _cell(there: WorkingDepth, name: str, unit: str, truth: ForceLaw | None) -> str:
    found: Quantity = getattr(there, name)
    words = with_error(found.value, found.standard_error, found.systematic, unit=unit)
    if truth is None:
        return words
    real = at_rest(truth, there.depth)[name]
    return f"{words}\n{beside_truth(found.value, real, whole_error(found))}"


def at_rest(law: ForceLaw, depth: float) -> dict[str, float]:
    """Return force, stiffness and damping of a law at a depth, SI."""
    return {
        "force": float(law.force(depth, 0.0)),
        "stiffness": float(law.stiffness_at(depth)),
        "damping": float(law.damping_at(depth)),
    }
