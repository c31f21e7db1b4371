"""Figures of an identification: the only part that imports matplotlib.

Needs the extra ``figures``.
"""

from palpate.figures.compared import draw_comparison as draw_comparison
from palpate.figures.identified import draw as draw
from palpate.figures.maps import draw_map as draw_map
from palpate.figures.motions import draw_design as draw_design
from palpate.figures.oscillations import draw_oscillations as draw_oscillations
from palpate.figures.residuals import draw_residuals as draw_residuals
from palpate.figures.style import check_figure as check_figure
from palpate.figures.style import save as save
