"""Figures are written whole, light or dark, for any contact that can be identified."""

import dataclasses
import functools
import itertools
import os
import re
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from cases import MATERIALS, Signals, contact_of, exciting, tapping
from drawn import Drawn
from recordings import recording

import palpate
from palpate import ESTIMATORS, InvalidParameterError, RecordingError, lab
from palpate.identification.ranking import rank
from palpate.lab.design import Motion, design
from palpate.lab.design.figures import draw_design
from palpate.output import figures
from palpate.output.figures import style
from palpate.output.figures.panels import JOINED, Subject, draw_spectrum
from palpate.output.figures.style import DARK, LIGHT

CONTACT = contact_of(tapping(MATERIALS["ball"], noise=0.02, seed=1), source="folder/probe.csv")


def holes(signals: Signals, bad: float) -> Signals:
    channels = {
        name: getattr(signals, name).copy() for name in ("penetration", "velocity", "force")
    }
    for k, channel in enumerate(channels.values()):
        channel[50 + k] = bad
    return dataclasses.replace(signals, **channels)


BALL = exciting(MATERIALS["ball"], seconds=0.5, noise=0.05, seed=2)
STILL = Signals(np.arange(500) * 1e-3, np.full(500, 0.01), np.zeros(500), np.full(500, 20.0))

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"
REAL = Path(os.environ.get("PALPATE_DATA", BESIDE))
COLUMN = 88e-3  # m, of a journal


@functools.cache
def of_example(name: str, method: str = "variable-projection") -> palpate.Identification:
    return palpate.identify(EXAMPLES / f"{name}.csv", method)


@functools.cache
def every_course(name: str):
    """To look at, not to write: only its layout is left to do."""
    return figures.draw(of_example(name), ["stiffness", "damping", "parameters"])


@functools.cache
def all_methods() -> dict[str, palpate.Identification]:
    return palpate.compare(CONTACT)


@functools.cache
def with_outliers() -> palpate.Identification:
    force = BALL.force.copy()
    force[100::57] += 30.0
    return palpate.identify(contact_of(dataclasses.replace(BALL, force=force)))


@functools.cache
def of_a_change() -> palpate.Identification:
    bench = lab.Bench(lab.MATERIALS["soft-then-hard"], lab.THREE_SINES, lab.IdealProbe())
    return palpate.identify(bench.run(0, seconds=12.0).contact).by_segment()


def titles_of(figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


@pytest.fixture
def unlaid(monkeypatch):
    """Figures are written as they are: to lay them out takes most of the time."""
    monkeypatch.setattr(style, "_as_bytes", as_they_are)


def as_they_are(figure, ending, write=style._as_bytes):
    figure.set_layout_engine(None)
    return write(figure, ending)


@pytest.mark.usefixtures("unlaid")
def test_the_command_line_writes_an_svg(run, tmp_path):
    path = tmp_path / "out.svg"
    assert f"figure: {path}" in run("compare", recording(tmp_path), "--figure", path)[1]
    assert ElementTree.parse(path).getroot().tag.endswith("svg")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.svg", "probe.csv"]


@pytest.mark.usefixtures("unlaid")
def test_the_command_line_writes_a_png_on_a_light_or_dark_background(run, tmp_path, monkeypatch):
    path, corners = tmp_path / "out.png", []
    for wide, dots, extra in ((88, 300.0, ()), (60, 30.0, ("--dark", "--json"))):
        options = ("--figure", path, "--width", f"{wide}mm", *extra)
        _, out, _ = run("identify", recording(tmp_path), *options)
        picture = matplotlib.image.imread(path)
        height, width, _ = picture.shape
        assert width == int(wide / 25.4 * dots)  # an inch
        assert height > width
        corners.append(picture[0, 0, :3].mean())
        monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 30)
    assert "figure" not in out  # JSON stays one object
    light, dark = corners
    assert light > 0.9
    assert dark < 0.2


def test_a_figure_has_three_panels_with_the_marks_and_no_text_inside_where_a_journal_sets_it():
    figure = figures.draw(of_example("ball"))
    assert titles_of(figure)[:2] == ["Force", "Force over penetration"]
    [numbers] = figure.axes[2:]
    assert [text.get_text() for text in numbers.get_legend().texts] == [
        "stiffness 2000.7 ± 0.7 N/m: trust", "damping 17.56 ± 0.06 N·s/m: trust",
    ]  # fmt: skip
    assert figure.get_suptitle().startswith("stiffness trust; damping trust\nball.csv: ")
    column = figures.draw(of_example("ball"), width=COLUMN)
    assert titles_of(column) == ["(a)", "(b)", "(c)"]
    assert (column.get_suptitle(), column.get_supxlabel()) == ("", "")
    assert column.get_figheight() <= 120e-3 / style.INCH
    assert figures.caption(of_example("ball")).startswith("(a) force over time, measured and ")
    assert "Hunt–Crossley law" in figures.methods_sentence(of_example("ball"))


@pytest.mark.long
@pytest.mark.parametrize("method", ESTIMATORS)
def test_all_panels_are_those_whose_quantity_was_estimated(method):
    result = all_methods()[method]
    figure = figures.draw(result, ["all"])
    _, _, stiffness, damping, residual, *others = titles_of(figure)
    assert stiffness.startswith("Stiffness at 2.5")
    assert damping.startswith("Damping at 2.5")
    assert residual.startswith("Residual, measured − final law")
    if method == "single-stage":
        assert others.pop(0).startswith("Speed limit")
    symbols = [title.partition(":")[0] for title in others]
    assert symbols == [symbol for symbol in result.law.symbols if symbol in symbols]
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)


@pytest.mark.parametrize("name", [*figures.PANELS, "parameters", "K"])
def test_each_panel_stands_alone_in_axes_of_ones_own(name):
    result = of_example("ball")
    if name not in ("K", "parameters") and not figures.PANELS[name].shows(result):
        with pytest.raises(InvalidParameterError, match="shows nothing of this result"):
            figures.draw(result, [name])
        return
    figure = matplotlib.figure.Figure()
    count = 3 if name == "parameters" else 1
    axes = figure.subplots(count)
    assert figures.draw(result, [name], ax=axes) is figure
    assert not any(titles_of(figure))
    assert all(each.get_xlabel() and each.has_data() for each in figure.axes)


def test_several_results_stand_in_one_panel_with_their_names():
    results = {"a ball": of_example("ball"), "a sponge": of_example("sponge")}
    figure = figures.draw(results, ["loop", "stiffness", "n"], width=COLUMN)
    loop, stiffness, exponent = ([t.get_text() for t in a.get_legend().texts] for a in figure.axes)
    assert loop[1::2] == ["a ball, final law", "a sponge, final law"]
    assert stiffness == exponent == ["a ball", "a sponge"]
    assert_legible(figure)


@pytest.mark.parametrize(
    "panels, axes, words",
    [
        (["loup"], None, "no 'loup': choose from force, loop"),
        (["loop"], [1, 2], "2 axes for 1 panel"),
    ],
)
def test_a_panel_that_is_not_known_and_axes_too_many_are_refused(panels, axes, words):
    with pytest.raises(InvalidParameterError, match=words):
        figures.draw(of_example("ball"), panels, ax=axes)


@pytest.mark.parametrize("dark", [False, True])
def test_a_spectrum_is_drawn_as_stems(dark):
    spectrum = palpate.RelaxationSpectrum((0.01, 0.02, 0.04, 0.5), (0.0, 1500.0, 500.0, 3000.0))
    law = palpate.GeneralisedHuntCrossley(K=8e3, n=1.5, B=60.0, p=0.5, relaxation=spectrum)
    look = style.choose_look(dark=dark, width=None)
    with style.drawing(look, 3.0) as figure:
        axes = figure.subplots()
        draw_spectrum(axes, [Subject(SimpleNamespace(law=law), "")], look)
    [stems], [tops] = axes.collections, axes.lines
    assert [*map(tuple, np.array(stems.get_segments())[:, 1])] == [
        (0.02, 1.5),
        (0.04, 0.5),
        (0.5, 3.0),
    ]
    assert tops.get_xydata().tolist() == np.array(stems.get_segments())[:, 1].tolist()
    assert (axes.get_xscale(), axes.get_ylabel()) == ("log", "m [kN/mⁿ]")
    assert axes.get_xlim()[0] < 0.01
    [title] = titles_of(figure)
    assert title.replace(JOINED, " ") == "Relaxation: several relaxation times, 20 ms to 0.5 s"
    assert_legible(figure)


def band_and_height(axes) -> tuple[float, float]:
    """Height of the band at the end of the recording, and of the panel, in the axis' units."""
    [band] = axes.collections[:1]
    points = np.vstack([path.vertices for path in band.get_paths()])
    right = points[points[:, 0] > points[:, 0].max() - 0.02 * np.ptp(points[:, 0]), 1]
    low, high = axes.get_ylim()
    return float(np.ptp(right)), high - low


@pytest.mark.long
@pytest.mark.parametrize("name", ["ball", "sponge", "tapping", "microscale"])
def test_the_band_of_every_parameter_is_seen(name):
    for axes in every_course(name).axes:
        band, height = band_and_height(axes)
        # A twentieth of a panel is 4 mm on paper, and 1 mm in a column.
        assert 0.05 * height < band < height, axes.get_title(loc="left")


def test_the_last_bar_drawn_is_the_whole_error_of_the_result():
    result = of_example("ball", "kelvin-voigt")
    stiffness = result.diagnosis.working_depth.stiffness
    [axes] = figures.draw(result, ["stiffness"]).axes
    bars = [bar.get_segments() for bar in axes.collections[1:] if len(bar.get_paths()) == 1]
    heights = sorted(float(np.ptp(bar[0][:, 1])) for bar in bars)
    whole = np.hypot(stiffness.standard_error, stiffness.systematic)
    assert heights == pytest.approx([4.0 * stiffness.standard_error, 4.0 * whole])
    assert heights[0] < heights[1]


def test_the_stiffness_curve_ends_at_the_result_and_its_bar():
    result = of_example("ball")
    axes = every_course("ball").axes[0]
    depth = result.diagnosis.working_depth.depth
    last = axes.get_lines()[0].get_ydata()[-1]
    assert last == pytest.approx(result.law.stiffness_at(depth))
    # Of a law of n = 1 it is K; its error is less than that of K, with which the exponent's goes.
    assert last == pytest.approx(result.law.K, rel=0.01)
    assert band_and_height(axes)[0] < 4.0 * result.standard_errors[0] / 5.0


def test_each_segment_has_a_box_of_its_own():
    result = of_a_change()
    assert len(result.segments) == 2
    stiffness = figures.draw(result).axes[2]
    assert stiffness.get_title(loc="left").endswith("of each segment")
    [boxes] = stiffness.patches
    corners = boxes.get_path().vertices.reshape(2, 5, 2)
    for part, box in zip(result.segments, corners, strict=True):
        value = part.diagnosis.working_depth.stiffness.value
        assert box[:, 1].min() < value < box[:, 1].max()
        assert box[:, 0].min() >= part.contact.time[0]


def test_a_comparison_figure_names_every_method_by_rank():
    figure = figures.draw_comparison(all_methods())
    rows = {axes.get_title(loc="left").split(":")[0]: axes for axes in figure.axes}
    ranking = rank(all_methods())
    named = [f"{i + 1}. {method}" for i, method in enumerate(ranking.order)]
    assert [name for name in rows if name[:1].isdigit()] == named
    assert len({rows[name].get_lines()[0].get_color() for name in named}) == min(len(ESTIMATORS), 7)
    assert figure.get_suptitle().startswith(f"recommended: {ranking.recommended}")


def luminance(colour: str) -> float:
    """Of WCAG 2: linear light, weighted as an eye does."""
    light = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(light <= 0.04045, light / 12.92, ((light + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_every_line_stands_out_from_its_background(theme):
    for colour in (theme.ink, theme.measured, *theme.lines):
        low, high = sorted([luminance(colour), luminance(theme.background)])
        least = 7.0 if colour is theme.ink else 3.0  # of text, WCAG 2 AAA; of graphics, AA
        assert (high + 0.05) / (low + 0.05) >= least


LAW = palpate.HuntCrossley(K=2000.0, B=2000.0, n=1.0)
# Each kind of figure, of contacts that fill panels in different ways.
DRAWINGS = {
    "a sponge": (figures.draw, lambda: of_example("sponge")),
    "a light contact": (figures.draw, lambda: of_example("tapping", "single-stage")),
    "outliers": (figures.draw, with_outliers),
    "a change": (figures.draw, of_a_change),
    "a comparison": (figures.draw_comparison, all_methods),
    "residuals": (figures.draw_residuals, lambda: of_example("microscale")),
    "a design": (draw_design, lambda: design(LAW, noise=0.05)),
    "a held probe": (draw_design, lambda: design(LAW, Motion(5e-3), noise=1.0)),
}


def assert_legible(figure) -> None:
    drawn = Drawn(figure)
    assert drawn.legends_on_data() == []
    assert drawn.overlaps() == []
    assert drawn.cut() == []


# CI draws these, and the others are slow.
QUICKLY = {(name, COLUMN) for name in ("a sponge", "outliers", "a change", "a comparison")}
QUICKLY |= {("a design", COLUMN), ("a sponge", None)}


@pytest.mark.parametrize(
    "name, width",
    [
        pytest.param(*each, marks=pytest.mark.long if each in QUICKLY else pytest.mark.slow)
        for each in itertools.product(DRAWINGS, (60e-3, COLUMN, 180e-3, None))
    ],
)
def test_no_legend_lies_on_data_and_no_text_on_text(name, width):
    draw, of = DRAWINGS[name]
    assert_legible(draw(of(), width=width))


@pytest.mark.slow
@pytest.mark.parametrize("width", [None, COLUMN])
@pytest.mark.parametrize(
    "path", sorted(REAL.glob("*_*.csv")), ids=lambda path: getattr(path, "stem", "none")
)
def test_figures_of_real_recordings_are_legible(path, width):
    results = palpate.compare(path)
    for result in results.values():
        assert_legible(figures.draw(result, width=width))
    assert_legible(figures.draw_comparison(results, width=width))
    assert_legible(figures.draw_residuals(results["variable-projection"], width=width))


@pytest.mark.parametrize("width", [60e-3, COLUMN, 180e-3, 400e-3])
def test_a_width_is_kept_and_letters_stay_legible(width):
    figure = figures.draw_residuals(of_example("ball"), width=width)
    assert figure.get_figwidth() == pytest.approx(width / 25.4e-3)
    sizes = {text.get_fontsize() for text in figure.findobj(matplotlib.text.Text)}
    assert min(sizes) > 6.0  # points: below, journals send figures back


@pytest.mark.parametrize("width", [5e-3, 0.5, float("nan"), "wide"])
def test_a_width_that_no_paper_has_is_refused(width):
    with pytest.raises(InvalidParameterError, match="width must be"):
        figures.draw(of_example("ball"), width=width)


@pytest.mark.parametrize(
    "options, words",
    [
        (["--width", "88mm"], "pass --figure"),
        (["--figure", "out.svg", "--width", "88"], "from 60mm to 400mm, such as 88mm, not '88'"),
        (["--figure", "out.svg", "--width", "5cm"], "from 60mm to 400mm"),
        (["--figure", "out.svg", "--width", "wide"], "--width must be a number and one of m, cm"),
    ],
)
@pytest.mark.parametrize("subcommand", ["identify", "compare"])
def test_a_wrong_width_is_one_line_before_the_work(refused, subcommand, options, words):
    assert words in refused(subcommand, "absent.csv", *options)


def test_text_stays_text_in_an_svg_that_stays_small():
    svg = as_they_are(figures.draw(of_example("sponge")), ".svg").decode()
    words = "".join(ElementTree.fromstring(svg).itertext())
    for each in ("Force over penetration", "penetration [mm]", "sponge.csv"):
        assert each in words
    fonts = re.findall(r"font(?:-family)?: ([^;\"]*)", svg)
    assert fonts
    assert all(each.endswith("sans-serif") for each in fonts)  # what any reader has
    assert len(svg) < 250e3
    assert len(as_they_are(figures.draw_residuals(of_example("sponge")), ".svg")) < 150e3


def test_the_fonts_of_a_pdf_are_in_it_as_outlines_that_can_be_edited(tmp_path):
    figures.save(figures.draw_residuals(of_example("ball"), width=60e-3), tmp_path / "out.pdf")
    content = (tmp_path / "out.pdf").read_bytes()
    assert b"/CIDFontType2" in content  # type 42, TrueType
    assert b"/Type3" not in content


def test_only_the_residual_of_a_wrong_law_leaves_the_noise_band():
    figure = figures.draw_residuals(of_example("ball"))
    assert titles_of(figure)[:3] == ["Over time", "Over depth", "Over velocity"]
    for axes in figure.axes[:3]:
        median, *band = axes.get_lines()[:3]
        # Three quarters of the pieces: the band of a piece is itself of few samples.
        assert np.nanmax(abs(median.get_ydata())) < 0.75 * max(line.get_ydata()[0] for line in band)
    figure = figures.draw_residuals(of_example("sponge", "kelvin-voigt"))
    [median, upper, _] = figure.axes[0].get_lines()[:3]
    assert np.nanmax(abs(median.get_ydata())) > abs(upper.get_ydata()[0])


AWKWARD = {
    "of one sample": contact_of(BALL[:1]),
    "that never moves": contact_of(STILL),
    "with samples not known": contact_of(holes(BALL, np.nan)),
    "with infinite samples": contact_of(holes(BALL, np.inf)),
    "with absurd samples": contact_of(holes(BALL, 1e200)),
    "of separate clocks": contact_of(
        dataclasses.replace(BALL, time=np.tile(BALL.time[:250], 2)), segment=np.arange(500) // 250
    ),
    "of nanometres and piconewtons": contact_of(
        dataclasses.replace(
            BALL, penetration=1e-7 * BALL.penetration, velocity=1e-7 * BALL.velocity,
            force=1e-12 * BALL.force,
        )
    ),
    "of many samples": contact_of(exciting(MATERIALS["ball"], seconds=15.0, noise=0.05, seed=3)),
}  # fmt: skip


# With samples not known one is drawn in test_thinned_trace.py too.
QUICK = ("of one sample", "that never moves")


@pytest.mark.usefixtures("unlaid")
@pytest.mark.parametrize(
    "contact",
    [
        pytest.param(
            contact, id=name, marks=pytest.mark.long if name in QUICK else pytest.mark.slow
        )
        for name, contact in AWKWARD.items()
    ],
)
def test_any_contact_that_can_be_identified_can_be_drawn(tmp_path, contact):
    """Warnings are errors here, so that nothing appears on a user's standard error."""
    result = palpate.identify(contact)
    other = palpate.identify(contact, "kelvin-voigt")  # of each law would take long
    both = figures.draw_comparison({"one": result, "other": other})
    path = tmp_path / "drawn.png"
    for figure in (figures.draw(result), both, figures.draw_residuals(result)):
        with matplotlib.rc_context({"savefig.dpi": 30}):  # of 11 inches; more only takes longer
            figures.save(figure, path)
        assert matplotlib.image.imread(path).shape[1] == 330


def test_drawing_leaves_matplotlibs_settings_as_they_were():
    before = dict(matplotlib.rcParams)
    figures.draw_residuals(of_example("ball"), dark=True)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.slow
def test_the_same_result_gives_the_same_file(tmp_path):
    result = palpate.identify(contact_of(BALL))
    for name in ("a.svg", "b.svg"):
        figures.save(figures.draw(result), tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_failed_figure_keeps_the_old_file(tmp_path):
    path = tmp_path / "out.xyz"
    path.write_text("mine")
    with pytest.raises(RecordingError):
        figures.save(matplotlib.figure.Figure(), path)
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_a_comparison_of_nothing_is_refused():
    with pytest.raises(InvalidParameterError, match="results is empty: pass at least one"):
        figures.draw_comparison({})
