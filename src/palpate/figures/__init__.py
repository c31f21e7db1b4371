"""Figures of an identification: the only part that imports matplotlib.

Needs the extra ``figures``.
"""

from palpate.figures.compared import draw_comparison
from palpate.figures.identified import draw
from palpate.figures.maps import draw_map
from palpate.figures.motions import draw_design
from palpate.figures.oscillations import draw_oscillations
from palpate.figures.residuals import draw_residuals
from palpate.figures.style import check_figure, save

__all__ = [
    "check_figure",
    "draw",
    "draw_comparison",
    "draw_design",
    "draw_map",
    "draw_oscillations",
    "draw_residuals",
    "save",
]
