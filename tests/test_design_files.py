"""``palpate design``: its tables, a motion as a robot plays it, its file, and its figure."""

import json
import re

import numpy as np
import pytest

import palpate
from palpate import InvalidParameterError, figures, lab
from palpate.design import PAPER_MOTION, Motion, MotionCommand, design, write_motion

BALL = lab.BALL.law
GUESS = ["--stiffness", "2000", "--damping", "2000", "--exponent", "1", "--noise", "0.05"]
MOTIONS = {
    "the paper's": PAPER_MOTION,
    "one sine": Motion(8e-3, (6.5e-3,), (7.7,)),
    "one that leaves the material": Motion(3.8e-3, PAPER_MOTION.amplitudes, (4.0, 11.0, 15.0)),
    "of micrometres": Motion(10e-6, (2e-6, 1e-7), (300.0, 471.0)),
}


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_a_motion_to_play_begins_and_ends_at_rest_and_has_no_jump(motion):
    command = MotionCommand(motion, 3.0)
    time, x, v = command.sampled(1e-3)
    still = time < 2.0  # the pause in which a bias is measured
    for ends in (still, time >= command.duration - 0.4):
        assert (x[ends] == -command.clearance).all()
        assert (v[ends] == 0.0).all()
    assert command.clearance == pytest.approx(0.1 * motion.peak_penetration)
    step = 1e-2 / max(motion.frequencies)  # a hundredth of a radian
    x, v = command.at(np.arange(0.0, command.duration, step))
    largest = sum(a * w**2 for a, w in zip(motion.amplitudes, motion.frequencies, strict=True))
    # The approach accelerates by 1.5 V/T at most.
    largest = max(largest, 1.5 * motion.top_speed / (command.start - 2.0))
    assert np.abs(np.diff(v)).max() <= 1.01 * largest * step  # of a jump it would be V at once
    # Between its ends at most a hundredth of the acceleration is added in a step, times ω or 1/T.
    quickest = max(*motion.frequencies, 4.0 / (command.start - 2.0))
    assert np.abs(np.diff(v, 2)).max() <= 2.0 * largest * quickest * step**2
    np.testing.assert_allclose(
        np.diff(x) / step, 0.5 * (v[1:] + v[:-1]), atol=largest * quickest * step**2
    )
    assert np.abs(v).max() <= motion.top_speed * (1.0 + 1e-12)
    assert x.max() <= motion.peak_penetration * (1.0 + 1e-12)


def test_the_sines_of_a_motion_to_play_are_those_of_the_motion_for_as_long_as_asked():
    command = MotionCommand(PAPER_MOTION, 3.0)
    period = 2.0 * np.pi / 4.0
    assert 3.0 <= command.stop - command.start <= 3.0 + period
    time = np.linspace(command.start, command.stop, 500)
    np.testing.assert_allclose(command.at(time), PAPER_MOTION.at(time - command.start), atol=1e-12)


@pytest.mark.parametrize(
    "motion, seconds, words",
    [
        (Motion(1e-2), 5.0, "the probe is held"),
        (Motion(1e-2, (0.0,), (1.0,)), 5.0, "the probe is held"),
        (PAPER_MOTION, 0.0, "seconds must be in"),
        (PAPER_MOTION, float("nan"), "seconds must be finite"),
        ("sines", 5.0, "motion must be a Motion"),
        (PAPER_MOTION, 1e4, "at most 10000000 are written"),
    ],
)
def test_a_motion_that_cannot_be_played_or_written_is_refused(tmp_path, motion, seconds, words):
    with pytest.raises(InvalidParameterError, match=words):
        write_motion(MotionCommand(motion, seconds), tmp_path / "a.csv", sample_time=1e-4)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["ball", "sponge", "pvc"])
def test_what_a_design_predicts_is_what_its_file_gives_when_it_is_played(run, tmp_path, name):
    """Design, file, laboratory, identification: the standard errors, over the values.

    The bound takes the offset for unknown. The pause tells it, and so does free air: no less than
    the bound where it is known is then left, but for the tenth that approach and retreat add. Bars
    of a correlated residual are up to 1.3 times as wide as the bound (t factor, one second).
    """
    law = lab.MATERIALS[name].law
    guess = [word for key, value in law.as_dict().items() for word in (f"--{key}", str(value))]
    played, recording = tmp_path / "better.csv", tmp_path / "recording.csv"
    words = ["design", *guess, "--noise", "0.05", "--seconds", "5", "-o", played]
    assert run(*words)[0] == 0
    motion = design(law, noise=0.05).chosen[1].motion
    unknown = design(law, motion, noise=0.05, durations=(5.0,)).planned.relative_errors[0]
    known = design(law, motion, noise=0.05, durations=(5.0,), offset=False)
    known = known.planned.relative_errors[0]
    seconds = f"{MotionCommand(motion, 5.0).duration:.4g}"
    pressed = ["lab", name, "--trajectory", played, "--seconds", seconds, "-o", recording]
    assert run(*pressed, "--probe", "ideal", "--resolution", "0")[0] == 0
    found = palpate.identify(recording)
    assert found.diagnosis.verdict.overall == "trust"
    achieved = found.standard_errors / law.parameters
    assert (achieved > 0.9 * known).all()
    assert (achieved < 1.3 * unknown).all()
    assert (abs(found.law.parameters - law.parameters) < 4.0 * found.standard_errors).all()


def test_a_file_says_what_it_holds_above_its_header(printed, tmp_path):
    path = tmp_path / "better.csv"
    out = printed("design", *GUESS, "-o", path, "--rate", "250", "--seconds", "2")
    assert f"motion, the better one: {path}" in out
    assert f"--trajectory {path}" in out
    recording = palpate.open_recording(path)
    assert list(recording.channels) == ["time_s", "penetration_m", "velocity_m_s"]
    time = recording.numbers("time_s")
    np.testing.assert_allclose(np.diff(time), 4e-3, atol=1e-9)
    for note in ("motion", "guessed material", "sensor", "predicted standard errors", "phases"):
        assert note in recording.notes
    motion = design(BALL, noise=0.05).chosen[1].motion
    _, x, v = MotionCommand(motion, 2.0).sampled(4e-3)
    np.testing.assert_allclose(recording.numbers("penetration_m"), x, rtol=1e-8)
    np.testing.assert_allclose(recording.numbers("velocity_m_s"), v, rtol=1e-8)


@pytest.mark.parametrize(
    "options, words",
    [
        (["--rate", "100"], "--rate is of the motion's file: name it with -o"),
        (["-o", "a.csv", "--rate", "0"], "--rate must be in"),
        (["-o", "/dev/stdout", "--json"], "cannot both go to standard output"),
        (["-o", "a.svg", "--figure", "a.svg"], "two outputs would be this file"),
        (["-o", "a.csv", "--amplitudes", "0", "--frequencies", "1"], "the probe is held"),
        (["--width", "88mm"], "name one with --figure"),
    ],
)
def test_what_cannot_be_written_is_one_line(run, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    status, out, err = run("design", *GUESS, *options)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert words in err
    assert list(tmp_path.iterdir()) == []


def test_a_motion_goes_into_a_pipe_without_the_tables_and_both_into_a_figure(
    run, printed, tmp_path
):
    status, out, err = run("design", *GUESS, "-o", "/dev/stdout", "--seconds", "1")
    assert (status, out) == (0, "")  # the file itself went to the process' own standard output
    assert "better, because" in err
    path = tmp_path / "design.svg"
    out = printed("design", *GUESS, "--figure", path, "--width", "88mm", "--json")
    assert json.loads(out)["better"] is not None
    assert path.read_text(encoding="utf-8").count("planned") >= 5


def test_a_figure_of_a_design_shows_motions_and_precision_of_both():
    result = design(BALL, noise=0.01, resolution=0.125)
    figure = figures.draw_design(result, dark=True)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[:2] == ["Penetration", "Velocity over penetration"]
    assert titles[2:] == [f"Relative standard error of {s}" for s in "KBn"]
    assert figure.get_suptitle().startswith("better: ")
    for axes, expected in zip(figure.axes[2:], result.better.relative_errors.T, strict=True):
        lines = {line.get_label(): line for line in axes.get_lines()}
        assert {"planned", "better"} <= set(lines)
        # A quick look counts one sample in several: 1 % at most.
        assert lines["better"].get_ydata()[-1] == pytest.approx(100.0 * expected[-1], rel=0.01)
    held = figures.draw_design(design(BALL, Motion(5e-3), noise=0.1))
    for axes in held.axes[2:]:
        [words] = [text.get_text() for text in axes.get_legend().get_texts()]
        assert words == "planned: not identifiable"


LAW = GUESS[:6]


def test_the_command_prints_precision_times_limit_and_a_command_to_run_next(printed):
    out = printed("design", *LAW, "--noise", "0.05")
    for words in ("after 0.5 s", "after 20 s", "within 5%", "within 1%", "100 mm/s", "eq. 10"):
        assert words in out
    assert "50.8 mm/s" in out
    [command] = re.findall(r"^palpate (design (?:.*\\\n)*.*)$", out, re.MULTILINE)
    out = printed(*command.replace("\\\n", "").split())
    assert "no better motion" in out


def test_the_command_prints_one_json_object(printed):
    options = ["--noise", "0.05", "--resolution", "0.125", "--no-offset", "--surface", "--json"]
    sines = ["--depth", "8e-3", "--amplitudes", "1e-3", "2e-3", "--frequencies", "3", "9"]
    out = printed("design", *LAW, *options, *sines)
    words = json.loads(out)
    motion = Motion(8e-3, (1e-3, 2e-3), (3.0, 9.0))
    same = design(BALL, motion, noise=0.05, resolution=0.125, offset=False, surface=True)
    command = words.pop("command")
    assert words == json.loads(json.dumps(same.as_dict()))
    assert command.endswith("--no-offset --surface")
    assert "--resolution 0.125" in command


def test_what_is_never_reached_is_null(run):
    held = ["--amplitudes", "0", "--frequencies", "1"]
    _, out, _ = run("design", *LAW, "--noise", "1", *held, "--json")
    words = json.loads(out)
    assert words["planned"]["times"][0]["stiffness"] is None
    assert words["better"] is words["command"] is None
    _, out, _ = run("design", *LAW, "--noise", "1", *held)
    assert "> 1000 s" in out
    assert "unknown" in out
    almost_undamped = [*LAW[:3], "1e-320", *LAW[4:], "--noise", "0.05", "--json"]
    assert json.loads(run("design", *almost_undamped)[1])["speed_limit"] is None
