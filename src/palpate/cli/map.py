"""The command ``palpate map``."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from palpate.cli.options import Depth, Drawing, Folder, quantity
from palpate.cli.printing import Terminal, say, say_path

_FIGURE = Path("map.svg")


def map(
    results: Folder,
    /,
    *,
    by: str = "x,y",
    of: Literal["stiffness", "damping", "force", "exponent"] = "stiffness",
    at: Depth | None = None,
    drawing: Drawing = Drawing(),
) -> None:
    """Draw what a fleet found over where it was found, with its error beside it.

    For example:

        palpate map results/ --by x,y --figure stiffness.svg
        palpate map results/ --by x,y --at 2mm --figure map.pdf --width 180mm

    Parameters
    ----------
    results
        Folder that ``palpate fleet`` wrote.
    by
        Two columns to draw over, such as x,y; or one, such as x or index.
    of
        What is drawn, at the working depth of each contact.
    at
        One depth for all, such as 2mm: only so are places compared that were pressed differently.
    """
    from palpate.fleet.maps import map_of
    from palpate.fleet.results import read_results

    if drawing.figure is None:
        drawing = replace(drawing, figure=_FIGURE)
    drawing.check()
    depth = None if at is None else quantity("--at", at, "penetration")
    found = map_of(read_results(results), by.split(","), of=of, depth=depth)
    drawing.save("palpate.fleet.figures.draw_map", found)
    console = Terminal()
    say(console, found.summary)
    say_path(console, f"figure: {drawing.figure}")
