"""Figures are written whole, light or dark, for any contact that can be identified."""

import dataclasses
import sys
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from cases import MATERIALS, Signals, exciting, tapping
from recordings import recording

import palpate
from palpate import ESTIMATORS, Contact, InvalidParameterError, RecordingError, cli, figures


def contact_of(signals: Signals, **more) -> Contact:
    return Contact(**vars(signals), **more)


CONTACT = contact_of(tapping(MATERIALS["ball"], noise=0.02, seed=1), source="folder/probe.csv")


def holes(signals: Signals, bad: float) -> Signals:
    channels = {}
    for k, name in enumerate(("penetration", "velocity", "force")):
        channels[name] = getattr(signals, name).copy()
        channels[name][50 + k] = bad
    return dataclasses.replace(signals, **channels)


BALL = exciting(MATERIALS["ball"], seconds=0.5, noise=0.05, seed=2)
STILL = Signals(np.arange(500) * 1e-3, np.full(500, 0.01), np.zeros(500), np.full(500, 20.0))


def command(monkeypatch, *arguments) -> None:
    monkeypatch.setattr(sys, "argv", ["palpate", *map(str, arguments)])
    cli.main()


def size_of_png(path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


@pytest.mark.parametrize("subcommand", ["identify", "compare"])
def test_the_command_line_writes_an_svg(monkeypatch, capsys, tmp_path, subcommand):
    path = tmp_path / "out.svg"
    command(monkeypatch, subcommand, recording(tmp_path), "--figure", path)
    assert ElementTree.parse(path).getroot().tag.endswith("svg")
    assert f"figure: {path}" in capsys.readouterr().out
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.svg", "probe.csv"]


def test_the_command_line_writes_a_png(monkeypatch, capsys, tmp_path):
    path = tmp_path / "out.png"
    command(monkeypatch, "identify", recording(tmp_path), "--figure", path, "--json")
    width, height = size_of_png(path)
    assert min(width, height) > 500
    assert "figure" not in capsys.readouterr().out  # JSON stays one object


def test_a_dark_figure_has_a_dark_background(monkeypatch, capsys, tmp_path):
    pixels = []
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", 30)
    for extra in ((), ("--dark",)):
        path = tmp_path / "out.png"
        command(monkeypatch, "compare", recording(tmp_path), "--figure", path, *extra)
        pixels.append(matplotlib.image.imread(path)[0, 0, :3].mean())
    light, dark = pixels
    assert light > 0.9
    assert dark < 0.2


@pytest.mark.parametrize("method", ESTIMATORS)
def test_a_figure_shows_force_loop_each_parameter_and_a_judgement(method):
    result = palpate.identify(CONTACT, ESTIMATORS[method]())
    figure = figures.draw(result)
    titles = [axes.get_title() for axes in figure.axes]
    assert len(titles) == 3 + len(result.law.symbols)
    assert any("Force, and what was predicted" in title for title in titles)
    assert any("loop" in title for title in titles)
    for name in result.law.as_dict():
        assert any(title.startswith(name.replace("_", " ")) for title in titles)
    judgement = "Condition 10" if result.law.kind == "hunt-crossley" else "Prediction error"
    assert judgement in titles[-1]
    verdict, name = figure.get_suptitle().split("\n")
    assert verdict.startswith(result.diagnosis.verdict.overall)
    assert name.startswith("probe.csv: ")
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)


def test_a_comparison_names_every_method_in_its_legends():
    figure = figures.draw_comparison(palpate.compare(CONTACT))
    words = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]
    for method in ESTIMATORS:
        assert method in words


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


@pytest.mark.parametrize("contact", AWKWARD.values(), ids=AWKWARD)
def test_any_contact_that_can_be_identified_can_be_drawn(tmp_path, contact):
    """Warnings are errors here, so that nothing appears on a user's standard error."""
    with matplotlib.rc_context({"savefig.dpi": 30}):  # of 11 inches; more only takes longer
        figures.save(figures.draw(palpate.identify(contact)), tmp_path / "one.png")
        comparison = figures.draw_comparison(palpate.compare(contact))
        comparison.set_layout_engine("none")  # most of the time; the other has the same panels
        figures.save(comparison, tmp_path / "all.png")
    assert size_of_png(tmp_path / "one.png") == (330, 255)
    assert size_of_png(tmp_path / "all.png") == (330, 210)


def test_drawing_leaves_matplotlibs_settings_as_they_were():
    before = dict(matplotlib.rcParams)
    figures.draw(palpate.identify(CONTACT), dark=True)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.slow
def test_the_same_result_gives_the_same_file(tmp_path):
    result = palpate.identify(contact_of(BALL))
    for name in ("a.svg", "b.svg"):
        figures.save(figures.draw(result), tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_figure_that_was_there_survives_one_that_cannot_be_drawn(tmp_path):
    path = tmp_path / "out.xyz"
    path.write_text("mine")
    with pytest.raises(RecordingError):
        figures.save(figures.draw(palpate.identify(CONTACT)), path)
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_a_comparison_of_nothing_is_refused():
    with pytest.raises(InvalidParameterError, match="results must hold at least one"):
        figures.draw_comparison({})
