"""Drawings without what nobody sees."""

import math
import re
import xml.etree.ElementTree as ElementTree

import pytest

from palpate.figures.style import DARK, LIGHT, as_svg, slim, style


@pytest.fixture(scope="module")
def drawing() -> str:
    with style(LIGHT) as new_figure:
        figure = new_figure(figsize=(6.0, 4.0))
        axes = figure.add_subplot()
        points = [0.01 * i for i in range(1000)]
        axes.plot(points, [math.sin(7.0 * x) for x in points], marker="o", markevery=100)
        axes.plot([0.0, 1.0, math.nan, 2.0, 3.0], [0.0, 1.0, 0.0, 1.0, 0.0], "--")
        axes.fill_between([2.0, 4.0], [-1.0, 0.0], [0.0, 1.0], alpha=0.3)
        axes.set(xlabel="time [s]", ylabel="N·s/mⁿ⁺¹")
        figure.add_subplot().set_axis_off()  # an empty group
        return as_svg(figure)


def test_a_slim_drawing_is_much_smaller_and_every_reference_in_it_has_its_target(drawing):
    once = slim(drawing)
    assert len(once) < 0.75 * len(drawing)
    assert slim(once) == once
    ElementTree.fromstring(once)
    targets = set(re.findall(r' id="([^"]*)"', once))
    assert set(re.findall(r'(?:href="#|url\(#)([^")]*)', once)) <= targets
    assert set(re.findall(r' class="([^"]*)"', once)) == set(re.findall(r"\.(s\d+){", once))


def places(svg: str) -> list[float]:
    """Every place of every path, of steps the sum."""
    found = []
    for path in re.findall(r' d="([^"]*)"', svg):
        here = start = (0.0, 0.0)
        for command, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
            values = [float(number) for number in re.findall(r"-?\d*\.?\d+", numbers)]
            for k, place in enumerate(zip(values[::2], values[1::2], strict=True)):
                step = here if command == "m" else (0.0, 0.0)
                here = (place[0] + step[0], place[1] + step[1])
                found += here
                start = here if command in "Mm" and k == 0 else start
            here = start if command == "z" else here
    return found


def test_no_place_of_a_slim_drawing_moves_by_more_than_a_tenth_of_a_point(drawing):
    before, after = places(drawing), places(slim(drawing))
    assert len(before) == len(after)
    assert max(abs(a - b) for a, b in zip(before, after, strict=True)) <= 0.1


def test_drawings_of_one_page_do_not_take_each_others_styles():
    """A class means the same style in every drawing."""
    rules = {}
    for theme in (LIGHT, DARK):
        with style(theme) as new_figure:
            figure = new_figure(figsize=(3.0, 2.0))
            figure.add_subplot().plot([0.0, 1.0], color=theme.lines[0])
            for name, body in re.findall(r"\.(s\d+){([^}]*)}", slim(as_svg(figure))):
                assert rules.setdefault(name, body) == body
    assert len(rules) > 3
