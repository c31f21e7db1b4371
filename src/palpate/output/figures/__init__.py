"""Figures of an identification, and what all figures are made of. Needs the extra ``figures``.

A figure of your own has palpate's colours, sizes and units by ``look = choose_look()`` and ``with
drawing(look, height) as figure:``. Other figures are in :mod:`palpate.lab.design.figures`,
:mod:`palpate.fleet.figures`, :mod:`palpate.control_loops.figures` and
:mod:`palpate.lab.figures`.
"""

from palpate.output.figures.field import ERRORS as ERRORS
from palpate.output.figures.field import VALUES as VALUES
from palpate.output.figures.field import draw_field as draw_field
from palpate.output.figures.identified import CITATION as CITATION
from palpate.output.figures.identified import PANELS as PANELS
from palpate.output.figures.identified import PARAMETERS as PARAMETERS
from palpate.output.figures.identified import caption as caption
from palpate.output.figures.identified import draw as draw
from palpate.output.figures.identified import draw_comparison as draw_comparison
from palpate.output.figures.identified import draw_oscillations as draw_oscillations
from palpate.output.figures.identified import methods_sentence as methods_sentence
from palpate.output.figures.panels import draw_residuals as draw_residuals
from palpate.output.figures.style import AxisScale as AxisScale
from palpate.output.figures.style import Look as Look
from palpate.output.figures.style import check_figure as check_figure
from palpate.output.figures.style import choose_look as choose_look
from palpate.output.figures.style import choose_scale as choose_scale
from palpate.output.figures.style import drawing as drawing
from palpate.output.figures.style import figure_style as figure_style
from palpate.output.figures.style import head as head
from palpate.output.figures.style import largest as largest
from palpate.output.figures.style import save as save
from palpate.output.figures.style import set_titles as set_titles
