"""The gallery: one statement a picture, in a script of at most 30 lines."""

import runpy
from pathlib import Path

import matplotlib
import pytest

SCRIPTS = sorted((Path(__file__).parents[1] / "examples" / "gallery").glob("*.py"))
READABLE = 5.0  # points of the smallest letters: a figure of 88 mm at 300 pixels halves them


@pytest.mark.long
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_of_the_gallery_draws_at_most_three_panels_in_letters_that_can_be_read(script):
    assert len(script.read_text(encoding="utf-8").splitlines()) <= 30
    matplotlib.use("agg")
    made = runpy.run_path(str(script))
    figure = made["figure"]
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    assert 1 <= len(panels) <= 3
    assert all(axes.has_data() and axes.get_xlabel() for axes in panels)
    sizes = [text.get_fontsize() for text in figure.findobj(matplotlib.text.Text)]
    assert min(sizes) > READABLE
    assert made["__doc__"].partition("\n")[0].endswith((".", "?"))


def test_the_gallery_has_nine_pictures():
    assert len(SCRIPTS) == 9
