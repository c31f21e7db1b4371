"""The report of an identification, in a browser: on a desk and on a phone, light and dark."""

from dataclasses import replace

import pytest
from faults import changed, remembering

import palpate

pytestmark = pytest.mark.browser


# Letters of SVG text as the screen shows them, in pixels, of drawings that are shown.
SMALLEST_LETTERS = """() => Math.min(...[...document.querySelectorAll(".drawing text")]
  .filter(each => each.getClientRects().length)
  .map(each => [parseFloat(getComputedStyle(each).fontSize), each.getScreenCTM()])
  .map(([size, turned]) => size * Math.hypot(turned.a, turned.b)))"""
SHOWN = """() => [...document.querySelectorAll(".drawing")]
  .filter(each => each.getClientRects().length).length"""


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """A report of a material that changes, and of one that remembers."""
    folder = tmp_path_factory.mktemp("reports")
    faulty = replace(changed(0.3), source="a name as long as loggers give them " * 4)
    palpate.identify(faulty).by_segment().save(folder / "changed")
    palpate.identify(remembering(0.5, 0.2), law="auto").save(folder / "remembering")
    return folder


# Each report is there in both widths and in both themes.
@pytest.mark.parametrize(
    "name, drawings, look, dark",
    [
        ("changed", 3, "desk", True),
        ("changed", 3, "phone", False),
        ("remembering", 4, "desk", False),
        ("remembering", 4, "phone", True),
    ],
)
def test_a_report_is_readable(reports, opened, name, drawings, look, dark):
    width = {"desk": 1280, "phone": 390}[look]
    url = (reports / name / "report.html").as_uri()
    with opened(url, "h1", width=width, dark=dark) as page:
        page.assert_readable()
        paper = page.evaluate("getComputedStyle(document.querySelector('.drawing path')).fill")
        assert paper == page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert page.evaluate(SHOWN) == drawings
        assert page.evaluate(SMALLEST_LETTERS) >= 8.0
        words = page.inner_text("body")
        assert words.index("stiffness") < words.index("correlation")


@pytest.mark.parametrize(
    "name, answer", [("changed", "header strong"), ("remembering", ".tile")], ids=["parts", "whole"]
)
def test_the_picture_is_on_the_first_screen_of_a_desk(reports, opened, name, answer):
    with opened((reports / name / "report.html").as_uri(), "h1") as page:
        page.set_viewport_size({"width": 1280, "height": 800})
        at = page.locator(".drawing").first.bounding_box()
        assert at["y"] < 200
        assert at["x"] + at["width"] <= 1280
        shown = page.locator(answer).first.bounding_box()
        assert shown["y"] + shown["height"] < 800


@pytest.mark.parametrize("dark", [False, True])
def test_a_cut_off_table_has_a_shadow_at_its_edge(reports, opened, dark):
    """The last column of pixels of the table differs from its paper only where more follows."""
    with opened((reports / "changed" / "report.html").as_uri(), "h1", width=390, dark=dark) as page:
        assert (
            page.locator("figcaption")  # of the residuals: the first figures fit
            .last.evaluate("each => getComputedStyle(each, '::before').content")
            .startswith('"Scroll the figure')
        )
        cut = "each => each.scrollWidth > each.clientWidth + 20"
        wide = next(each for each in page.locator(".wide").all() if each.evaluate(cut))
        shadow = wide.screenshot()
        wide.evaluate("each => { each.style.setProperty('--shade', 'transparent'); }")
        assert wide.screenshot() != shadow
        wide.evaluate("each => { each.scrollLeft = each.scrollWidth; }")
        box = wide.bounding_box()
        edge = {**box, "x": box["x"] + box["width"] - 8, "width": 8}
        plain = page.screenshot(clip=edge)
        wide.evaluate("each => { each.style.removeProperty('--shade'); }")
        assert page.screenshot(clip=edge) == plain  # nothing follows at the end
