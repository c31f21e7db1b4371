"""The options of a figure that is drawn beside what is printed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cyclopts import Parameter

from palpate.cli.groups import OUTPUT
from palpate.cli.values import Dark, FigureFile, Width


@Parameter(name="*", group=OUTPUT)
@dataclass(frozen=True)
class Drawing:
    """Where a figure goes to, and how it looks."""

    figure: FigureFile = None
    "Draw it to this file (.svg, .pdf or .png)."
    dark: Dark = False
    "Draw on a dark background."
    width: Width | None = None
    "Width of the figure as it is printed, 60mm to 400mm: a journal's column is 88mm."

    def check(self, inputs: Sequence[Path] = ()) -> None:
        """Say before the work what could not be drawn after it."""
        from palpate.errors import InvalidParameterError

        if self.figure is None:
            if self.width is not None:
                raise InvalidParameterError("--width is that of a figure: name one with --figure")
            return
        from palpate.figures import check_figure

        self._metres()
        check_figure(self.figure, inputs=inputs)

    def save(self, draw: str, what: Any, inputs: Sequence[Path] = ()) -> None:
        """Draw something by a function of :mod:`palpate.figures`, where a figure is asked for."""
        if self.figure is not None:
            from palpate import figures

            drawn = getattr(figures, draw)(what, dark=self.dark, width=self._metres())
            figures.save(drawn, self.figure, inputs=inputs)

    def _metres(self) -> float | None:
        from palpate.cli.quantities import quantity
        from palpate.errors import InvalidParameterError
        from palpate.figures.sheet import NARROWEST, WIDEST

        if self.width is None:
            return None
        width = quantity("--width", self.width, "penetration")
        if not NARROWEST <= width <= WIDEST:
            limits = f"from {1e3 * NARROWEST:g}mm to {1e3 * WIDEST:g}mm"
            raise InvalidParameterError(
                f"--width must be {limits}, such as 88mm, not {self.width!r}"
            )
        return width
