"""A figure that a notebook shows by itself: only those of pyplot are shown else."""

from matplotlib.figure import Figure

from palpate.figures.slimming import slim
from palpate.figures.style import as_svg


class Drawn(Figure):
    """matplotlib's figure, in a notebook too."""

    def _repr_svg_(self) -> str:
        svg = slim(as_svg(self))
        # As wide as the cell at most.
        return svg[svg.index("<svg") :].replace(
            "<svg", '<svg style="max-width:100%;height:auto"', 1
        )
