"""The report of an identification: the verdict first, whole without anything beside it."""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from faults import changed
from matplotlib.figure import Figure
from probing import BALL, SPONGE, tapping
from report_reading import Reading
from robots import table_of, travelling

import palpate
from palpate.identification import identified
from palpate.output import figures
from palpate.output.figures.field import draw_field
from palpate.output.figures.style import as_svg, choose_look
from palpate.output.reports.html import DRAWINGS, STYLE
from palpate.output.reports.identification import Circumstances, page
from palpate.output.results import view

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
HERE = Circumstances("today", "palpate identify <file>", 'method = "x"\n', ("a&b.csv",))


@pytest.fixture(scope="module")
def report(ball):
    """Of a recording whose words could be taken for markup."""
    odd = {**ball.contact.provenance, "<b>": "<i>not italic</i>"}
    named = replace(ball.contact, source="<script>alert(1)</script> & $x_1$.csv", provenance=odd)
    return page(replace(ball, contact=named), HERE, {"variable-projection": ball})


def test_the_page_is_whole_and_fetches_nothing(report):
    read = Reading(report)
    assert read.open == []
    assert len(read.names) == len(set(read.names))
    inside = {reference for reference in read.references if reference.startswith("#")}
    assert inside <= {f"#{name}" for name in read.names}
    assert read.references - inside == {"a&b.csv"}
    assert not re.search(r"url\((?!#)|@import|<script|<link", report)
    used = set(re.findall(r"url\(#([^)]*)\)", report))
    assert used <= set(read.names)
    assert len(report.encode()) < 1_000_000
    # The colours of drawings follow the page.
    body = report[report.index("<body>") :]
    assert body.count("var(--drawing-") > 20
    assert not re.search(r"#[0-9a-f]{6}\b", body, re.IGNORECASE)


def test_a_page_shows_numbers_then_pictures_then_tables(report, ball):
    words = Reading(report).words
    order = (
        *(each.value for each in view.number_lines(ball)),
        "force over penetration",
        "correlation",
        "palpate identify",
    )
    places = [words.index(each) for each in order]
    assert places == sorted(places)
    tiles = report[report.index('class="tiles"') : report.index("</header>")]
    assert tiles.count('class="badge yes"') == 2
    assert re.search(r"truth 2000, [+-]\d\.\d σ", words)
    # Words of a recording are no markup.
    assert "<i>not italic" in words


def test_every_section_has_the_same_words_in_every_output(report, ball, run):
    """A table over the renderers: terminal, plain text, report; of the first three a notebook."""
    out = (
        run("identify", EXAMPLES / "ball.csv", "-v")[1] + run("diagnose", EXAMPLES / "ball.csv")[1]
    )
    shown = [" ".join(each.split()) for each in (out, ball.summary(), Reading(report).words)]
    card = " ".join(Reading(ball._repr_html_()).words.split())
    numbers = [part for each in view.number_lines(ball) for part in (each.value, each.at)]
    assert all(part in each for part in numbers for each in (*shown, card))
    told = [view.depth_table(ball), view.law_section(ball)]
    for section in (
        *told,
        view.derived_section(ball),
        view.findings_section(ball),
        view.preparation_section([ball]),
    ):
        cells = [
            part for row in section.table()[1] for cell in row for part in str(cell).split("\n")
        ]
        for words in (*cells, *(part for line in section.lines for part in line[:2])):
            for each in (*shown, *([card] if section in told else [])):
                assert " ".join(words.split()) in each


def test_each_segment_between_changes_is_a_row():
    result = palpate.identify(changed(0.3)).by_segment()
    [section] = view.segment_table(result)
    assert len(section.rows) == 2
    with pytest.raises(
        palpate.InvalidParameterError, match=r"each of 2 segments \(.* to .* s, .*\)"
    ):
        _ = result.stiffness
    assert result.segments[1].damping == result.segments[1].diagnosis.working_depth.damping
    words = result.summary()
    assert "change detector" in words
    assert "fit (each part by its own law)" in words


@pytest.fixture(scope="module")
def places():
    """A ball, and a sponge 30 mm away."""
    recorded = table_of(travelling((BALL, tapping(4.0)), (SPONGE, tapping(4.0))))
    return palpate.identify(palpate.prepare(recorded)).by_place()


@pytest.mark.long
def test_the_report_of_a_travelling_probe_begins_with_its_map(places):
    text = page(places, HERE)
    words = Reading(text).words
    counts = next(view.short_answer(places, ())).lines[0].text
    order = (
        counts,
        figures.caption(places),
        "Identified values",
        "Estimates over time",
        "For a paper",
    )
    found = [words.index(each) for each in order]
    assert found == sorted(found)
    assert 'id="figure-drawing"' in text
    assert 'class="tiles"' not in text  # values of all places as one material mean nothing
    # Of the places first; what one law gives for all of them comes last, and heads nothing.
    values = words[words.index("Identified values") :]
    assert values.index("Each by itself") < values.index("One law for all places, an average")


def test_the_map_shows_stiffness_error_and_verdict(places):
    figure = figures.draw(places)
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    along_normal = np.argmax(np.abs(places.segments[0].place.normal.vector))
    across = np.delete(np.arange(3), along_normal)
    spread = np.ptp([part.place.position[across] for part in places.segments], axis=0)
    across = across[np.argsort(-spread, kind="stable")]
    kinds = {part.diagnosis.verdict.overall.replace("-", " ") for part in places.segments}
    bars = figure.axes[2:]
    for axes, bar, name in zip(panels, bars, ("value", "whole_error"), strict=True):
        shown = {
            (*np.round(at, 9), round(float(value), 6))
            for dots in axes.collections
            if dots.get_array() is not None  # the legend's
            for at, value in zip(dots.get_offsets(), dots.get_array(), strict=True)
        }
        stiffnesses = [part.diagnosis.working_depth.stiffness for part in places.segments]
        scale = {"[mN/m]": 1e3, "[N/m]": 1.0, "[kN/m]": 1e-3}[bar.get_ylabel()]
        assert shown == {
            (*np.round(1e3 * part.place.position[across], 9), round(scale * getattr(each, name), 6))
            for part, each in zip(places.segments, stiffnesses, strict=True)
        }
        assert {each.get_text() for each in axes.get_legend().get_texts()} == kinds
        assert axes.get_xlabel() == f"{'xyz'[across[0]]} [mm]"


def test_a_contact_that_says_nothing_has_no_error_bars():
    time = np.arange(400) * 1e-3
    depth = np.full(400, 5e-3)
    contact = palpate.Contact(time, penetration=depth, velocity=0.0 * time, force=0.0 * time + 2.0)
    shown = palpate.identify(contact)._repr_html_()
    assert "do not trust" in shown
    assert "± unknown" in shown
    assert Reading(shown).open == []


@pytest.mark.long
@pytest.mark.parametrize("law", [None, "auto"])
def test_a_report_diagnoses_and_draws_once_per_method(run, tmp_path, monkeypatch, law):
    done = Counter()

    def counted(where, name, of=lambda *_: ""):
        real = getattr(where, name)

        def call(*given, **more):
            done[f"{name} {of(*given)}".strip()] += 1
            return real(*given, **more)

        monkeypatch.setattr(where, name, call)

    counted(identified, "diagnose_parts")
    counted(Figure, "draw", lambda figure, renderer: type(renderer).__name__)
    words = ["--law", law] if law else []
    assert run("identify", EXAMPLES / "ball.csv", "-o", tmp_path / "out", *words)[0] == 0
    assert done["diagnose_parts"] == len(palpate.ESTIMATORS)
    assert done["draw MixedModeRenderer"] == 3


def test_only_a_drawing_wider_than_the_phone_scrolls():
    """The live page has the same styles, and its charts fit."""
    rules = re.findall(r"([^{}]+)\{[^{}]*Scroll the figure sideways", STYLE + DRAWINGS)
    assert [rule.strip().splitlines()[-1].strip() for rule in rules] == [
        ".drawing + figcaption::before"
    ]


def test_a_map_of_places_shows_the_peak_of_its_trusted_values():
    """A few stiff places among many are the inclusion that one looks for."""
    soft, peak = [300.0] * 98, [900.0, 2000.0]
    values = np.array([*soft, *peak, 1e7])
    marks = np.array(["trust"] * 100 + ["do-not-trust"])
    figure = Figure()
    axes = figure.subplots()
    at = np.column_stack([np.arange(101.0), np.zeros(101)])
    look = choose_look(dark=False, width=None)
    draw_field(axes, at, values, marks == "trust", "stiffness [N/m]", look)
    assert {dots.get_clim() for dots in axes.collections} == {(300.0, 2000.0)}


def test_a_drawing_is_compact_and_keeps_its_end_points():
    """Pages hold tens of drawings: a paper's page was twice as long with white space and zeros."""
    figure = Figure()
    axes = figure.subplots()
    [line] = axes.plot(np.arange(50.0), np.cumsum(np.random.default_rng(1).normal(size=50)))
    svg = as_svg(figure)
    assert re.search(r">\n\s*<", svg) is None
    assert svg.count("font-family") <= 1 + svg.count("<style")
    assert not re.search(r"[\d]\.\d{3,}", "".join(re.findall(r' d="[^"]*"', svg)))
    path = max(re.findall(r' d="([^"]*)"', svg), key=len)
    numbers = [float(each) for each in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", path)]
    x, y = numbers[-2:]
    figure.dpi = 72.0
    height = figure.bbox.height
    expected = axes.transData.transform(line.get_xydata()[-1])
    assert (x, y) == pytest.approx((expected[0], height - expected[1]), abs=0.02)
    assert len(path) < 18 * 50
