"""Figures of an identification, and the style of all figures. Needs the extra ``figures``.

Other figures are in :mod:`palpate.design.figures`, :mod:`palpate.fleet.figures` and
:mod:`palpate.lab.figures`.
"""

from palpate.figures.identified import CITATION as CITATION
from palpate.figures.identified import PANELS as PANELS
from palpate.figures.identified import caption as caption
from palpate.figures.identified import draw as draw
from palpate.figures.identified import draw_comparison as draw_comparison
from palpate.figures.identified import draw_oscillations as draw_oscillations
from palpate.figures.identified import methods_sentence as methods_sentence
from palpate.figures.panels import draw_residuals as draw_residuals
from palpate.figures.style import check_figure as check_figure
from palpate.figures.style import save as save
