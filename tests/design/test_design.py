"""Designs: precision against the bound, motions as a robot plays them, tables, files, figures."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import approx_fprime

import palpate
from palpate import (
    ExtendedKelvinVoigt,
    HuntCrossley,
    InvalidParameterError,
    KelvinVoigt,
    lab,
)
from palpate.lab.design import (
    PAPER_MOTION,
    Motion,
    MotionCommand,
    design,
    effective_noise,
    write_motion,
)
from palpate.lab.design.figures import draw_design
from palpate.lab.design.precision import cramer_rao_bound, jacobian, mean_rounding_error

BALL, SPONGE, PHANTOM = lab.BALL.law, lab.SPONGE.law, lab.PVC.law
MATERIALS = [BALL, SPONGE, PHANTOM]


def bound_of(law, motion, duration, noise=0.05, step=1e-3, **unknown):
    _, x, v = motion.sampled(duration, step)
    deep = x > 0.0
    bound = cramer_rao_bound(law, x[deep], v[deep], noise, **unknown)
    return bound[:3] / law.parameters


def test_the_papers_motion_has_the_papers_top_speed():
    time, step = np.linspace(0.0, 3.0, 50), 1e-6
    ahead, behind = PAPER_MOTION.at(time + step)[0], PAPER_MOTION.at(time - step)[0]
    assert PAPER_MOTION.at(time)[1] == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-8)
    _, x, v = PAPER_MOTION.sampled(20.0, 1e-3)
    assert np.abs(v).max() == pytest.approx(50.8e-3)
    assert PAPER_MOTION.top_speed == pytest.approx(50.8e-3)
    assert PAPER_MOTION.least_penetration <= x.min()
    assert x.max() <= PAPER_MOTION.peak_penetration


@pytest.mark.long
@pytest.mark.parametrize("surface", [False, True])
@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("law", MATERIALS, ids=repr)
def test_the_precision_is_the_bound_of_the_samples(law, offset, surface):
    result = design(law, noise=0.05, offset=offset, surface=surface)
    for row, duration in enumerate(result.planned.durations):
        expected = bound_of(law, PAPER_MOTION, duration, offset=offset, surface=surface)
        # Summed in another order, and inverted at condition numbers up to 1e8.
        assert result.planned.relative_errors[row] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("law", MATERIALS, ids=repr)
def test_a_target_is_met_at_its_time_and_not_a_sample_before(law):
    outlook = design(law, noise=0.05).planned
    for target, times in zip(outlook.targets, outlook.times, strict=True):
        for column, time in enumerate(times):
            if time > 20.0:  # there one sample in several is counted
                continue
            after = bound_of(law, PAPER_MOTION, time, offset=True)
            before = bound_of(law, PAPER_MOTION, time - 1e-3, offset=True)
            assert after[column] <= target < before[column]


def test_a_design_beyond_the_horizon_takes_infinite_time():
    outlook = design(BALL, Motion(0.01, (1e-5,), (1.0,)), noise=1.0).planned
    assert np.isinf(outlook.times).all()
    assert bound_of(BALL, outlook.motion, 1000.0, noise=1.0, offset=True).min() > 0.05
    for held in (Motion(0.01), Motion(0.01, (0.0,), (3.0,))):
        result = design(BALL, held, noise=0.05)
        assert np.isinf(result.planned.relative_errors).all()
        assert np.isinf(result.planned.times).all()
        assert "held" in result.planned.notes[0]
        assert result.better is None
        assert "pass --max-speed" in result.reason
    assert design(BALL, Motion(0.01), noise=0.05, max_speed=0.05).better.worst < 0.01


def test_free_samples_do_not_count_and_the_lift_is_told():
    motion = Motion(2e-3, (3e-3,), (5.0,))
    outlook = design(BALL, motion, noise=0.05).planned
    assert outlook.leaves_contact
    assert "rises to -1 mm" in outlook.notes[0]
    expected = bound_of(BALL, motion, 20.0, offset=True)
    assert outlook.relative_errors[-1] == pytest.approx(expected, rel=1e-6)


def test_speed_limit_and_peak_force_are_those_of_the_motion():
    _, x, v = PAPER_MOTION.sampled(20.0, 1e-3)
    sponge, ball = design(SPONGE, noise=0.05), design(BALL, noise=0.05).planned
    assert sponge.speed_limit == pytest.approx(0.01)  # equation 10
    assert sponge.planned.violated_fraction == np.mean(np.abs(v) >= 0.01)
    assert sponge.planned.peak_speed == pytest.approx(50.8e-3)
    assert ball.violated_fraction == 0.0
    assert ball.peak_force == BALL.force(x, v).max()


def test_a_motion_faster_than_law_or_filter_is_flagged():
    fast = design(HuntCrossley(K=300.0, B=9000.0, n=1.0), noise=0.05)
    assert "the law becomes adhesive" in fast.planned.notes[0]
    assert fast.better.motion.top_speed <= 300.0 / 9000.0
    quick = design(BALL, Motion(0.01, (1e-3,), (60.0,)), noise=0.05)
    assert "rad/s by 2 %" in quick.planned.notes[0]


def test_rounding_adds_a_twelfth_of_the_squared_step():
    assert effective_noise(0.05, 0.0) == 0.05
    noise = effective_noise(0.05, 0.125)
    assert noise == pytest.approx(math.sqrt(0.05**2 + 0.125**2 / 12.0))
    rounded, noisy = design(BALL, noise=0.05, resolution=0.125), design(BALL, noise=noise)
    assert rounded.planned.relative_errors == pytest.approx(noisy.planned.relative_errors)
    assert mean_rounding_error(0.05, 0.0).size == 0
    assert mean_rounding_error(1.0, 1.0).size == 0
    outlook = design(BALL, noise=0.0625, resolution=0.125).planned
    assert outlook.expected_errors == pytest.approx(outlook.relative_errors, rel=1e-2)
    assert outlook.notes == ()


@pytest.mark.parametrize("law", MATERIALS, ids=repr)
def test_steps_that_a_motion_repeats_are_in_the_expected_errors(law):
    noise, step, runs = 0.01, 0.125, 40
    motion = Motion(8e-3, (6.5e-3,), (7.74,))
    outlook = design(law, motion, noise=noise, resolution=step, durations=(5.0,)).planned
    _, x, v = motion.sampled(5.0, 1e-3)
    draw = np.random.default_rng(20120628)
    squares = []
    for scale in (0.9, 1.0, 1.1):
        rows = jacobian(law, x, v, offset=True)
        force = scale * law.force(x, v)
        for _ in range(runs):
            shifted = force + draw.uniform(0.0, step)
            rounded = np.round((shifted + noise * draw.standard_normal(x.size)) / step) * step
            errors = np.linalg.lstsq(rows, rounded - shifted, rcond=None)[0][:3]
            squares.append((errors / law.parameters) ** 2)
    # 120 draws, whose phases make a few runs count most; the harmonics left out count as white.
    expected = outlook.expected_errors[0]
    assert np.sqrt(np.mean(squares, axis=0)) / expected == pytest.approx(np.ones(3), abs=0.2)
    assert np.all(expected > 1.05 * outlook.relative_errors[0])
    if law is SPONGE:
        assert "repeats with the motion" in outlook.notes[0]


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((0.0,), r"depth must be in \(0, 10\], not 0"),
        ((0.01, (1e-3,), ()), "equal in number, not 1 and 0"),
        ((0.01, (1e-3, -1e-3), (1.0, 2.0)), r"amplitudes\[1\] must be in \[0, 10\], not -0.001"),
        ((0.01, (1e-3,), (0.0,)), r"frequencies\[0\] must be in \(0, 100000\], not 0.0"),
        ((0.01, 1e-3, (1.0,)), "amplitudes must be a sequence of numbers, not 0.001"),
        ({"law": KelvinVoigt(K=1.0, B=1.0)}, "law must be a HuntCrossley"),
        (
            {"law": HuntCrossley(K=0.0, B=1.0, n=1.0)},
            r"K must be in \(0, 1e\+20\], not 0.0",
        ),
        ({"motion": 0.01}, "motion must be a Motion, not 0.01"),
        ({"noise": 0.0}, r"noise must be in \[1e-15, 1e\+15\], not 0.0"),
        ({"resolution": -0.1}, r"resolution must be in \[0, 1e\+15\], not -0.1"),
        ({"sample_time": 0.1}, r"frequencies\[1\] must be in \(0, 10\], not 11.0"),
        ({"durations": ()}, "durations must be a sequence of at least one number"),
        ({"durations": (1.0, 2000.0)}, r"durations\[1\] must be in \[0.001, 1000\], not 2000.0"),
        ({"max_depth": 0.0}, r"max_depth must be in \(0, 10\], not 0.0"),
        ({"max_speed": math.inf}, "max_speed must be finite, not inf"),
    ],
)
def test_wrong_arguments_of_motions_and_designs_are_named(arguments, message):
    def make():
        if isinstance(arguments, tuple):
            return Motion(*arguments)
        return design(**{"law": BALL, "motion": PAPER_MOTION, "noise": 0.05, **arguments})

    with pytest.raises(InvalidParameterError, match=message):
        make()


LAWS = [
    KelvinVoigt(K=900.0, B=12.0),
    ExtendedKelvinVoigt(K1=500.0, K2=4e4, B=9.0),
    lab.BALL.law,
    lab.PVC.law,
    HuntCrossley(K=300.0, B=3000.0, n=1.3),
]
SOFT = HuntCrossley(K=300.0, B=900.0, n=1.3)


def paper_motion(duration=5.0, step=1e-2):
    return PAPER_MOTION.sampled(duration, step)[1:]


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_a_sensitivity_is_the_derivative_of_the_force(law):
    x, v = paper_motion()

    def force(parameters):
        return type(law).from_parameters(parameters).force(x, v)

    numerical = approx_fprime(law.parameters, force, 1.5e-8 * law.parameters)
    error = np.abs(jacobian(law, x, v) - numerical).max(axis=0)
    # Forward differences err by about the square root of the floats' epsilon.
    assert np.all(error < 1e-6 * np.abs(numerical).max(axis=0))


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_the_surface_counts_by_the_derivative_of_the_force_by_its_place(law):
    x, v = paper_motion()
    step = 1e-7
    slope = (law.force(x - step, v) - law.force(x + step, v)) / (2.0 * step)
    rows = jacobian(law, x, v, surface=True)
    assert rows[:, -1] == pytest.approx(slope, rel=1e-6, abs=1e-6 * np.abs(slope).max())


GUESS = ["--K", "2000", "--B", "2000", "--n", "1", "--noise", "0.05"]
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


def test_a_motion_to_play_has_the_sines_of_the_design():
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
        (PAPER_MOTION, 1e4, "more than 10000000: make it shorter"),
    ],
)
def test_a_motion_that_cannot_be_played_or_written_is_refused(tmp_path, motion, seconds, words):
    with pytest.raises(InvalidParameterError, match=words):
        write_motion(MotionCommand(motion, seconds), tmp_path / "a.csv", sample_time=1e-4)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
@pytest.mark.parametrize("name", ["ball", "sponge", "pvc"])
def test_a_played_design_gives_the_predicted_precision(run, tmp_path, name):
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
    assert f"better motion: {path}" in out
    assert f"--trajectory {path}" in out
    recording = palpate.open_recording(path)
    assert list(recording.channels) == ["time_s", "penetration_m", "velocity_m_s"]
    np.testing.assert_allclose(np.diff(recording.numbers("time_s")), 4e-3, atol=1e-9)
    for note in ("motion", "guessed material", "sensor", "predicted standard errors", "phases"):
        assert note in recording.notes
    _, x, v = MotionCommand(design(BALL, noise=0.05).chosen[1].motion, 2.0).sampled(4e-3)
    np.testing.assert_allclose(recording.numbers("penetration_m"), x, rtol=1e-8)
    np.testing.assert_allclose(recording.numbers("velocity_m_s"), v, rtol=1e-8)


@pytest.mark.parametrize(
    "options, words",
    [
        (["--rate", "100"], "--rate needs a file for the motion: add -o FILE"),
        (["-o", "a.csv", "--rate", "0"], "--rate must be in"),
        (["-o", "/dev/stdout", "--json"], "cannot both write to standard output"),
        (["-o", "a.svg", "--figure", "a.svg"], "two outputs name this file"),
        (["-o", "a.csv", "--amplitudes", "0", "--frequencies", "1"], "the probe is held"),
        (["--width", "88mm"], "pass --figure"),
    ],
)
def test_a_failed_write_is_one_line(refused, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused("design", *GUESS, *options)
    assert list(tmp_path.iterdir()) == []


def test_a_motion_written_to_a_pipe_has_no_tables(run, printed, tmp_path):
    status, out, err = run("design", *GUESS, "-o", "/dev/stdout", "--seconds", "1")
    assert (status, out) == (0, "")  # the file itself went to the process' own standard output
    assert "better, because" in err
    path = tmp_path / "design.svg"
    out = printed("design", *GUESS, "--figure", path, "--width", "88mm", "--json")
    assert json.loads(out)["better"] is not None
    assert path.read_text(encoding="utf-8").count("planned") == 2  # of the panels of the motion


def test_a_figure_of_a_design_shows_motions_and_precision_of_both():
    result = design(BALL, noise=0.03, resolution=0.125)
    figure = draw_design(result, dark=True)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[:2] == ["Penetration", "Velocity over penetration"]
    assert titles[2:] == [f"Relative standard error of {s}" for s in "KBn"]
    assert figure.get_suptitle().startswith("better: ")
    for axes, expected in zip(figure.axes[2:], result.better.relative_errors.T, strict=True):
        lines = {line.get_label(): line for line in axes.get_lines()}
        assert {"planned", "better"} <= set(lines)
        # A quick look counts one sample in several: 1 % at most.
        assert lines["better"].get_ydata()[-1] == pytest.approx(100.0 * expected[-1], rel=0.01)
    held = draw_design(design(BALL, Motion(5e-3), noise=0.1))
    for axes in held.axes[2:]:
        [words] = [text.get_text() for text in axes.get_legend().get_texts()]
        assert words == "planned: not identifiable"


LAW = GUESS[:6]


def test_design_prints_precision_and_the_next_command(printed):
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
    words = json.loads(printed("design", *LAW, *options, *sines))
    motion = Motion(8e-3, (1e-3, 2e-3), (3.0, 9.0))
    same = design(BALL, motion, noise=0.05, resolution=0.125, offset=False, surface=True)
    command = words.pop("command")
    assert words == json.loads(json.dumps(same.as_dict()))
    assert command.endswith("--no-offset --surface")
    assert "--resolution 0.125" in command


def test_targets_that_are_never_reached_are_null(run):
    held = ["--amplitudes", "0", "--frequencies", "1"]
    words = json.loads(run("design", *LAW, "--noise", "1", *held, "--json")[1])
    assert words["planned"]["times"][0]["K"] is None
    assert words["better"] is words["command"] is None
    out = run("design", *LAW, "--noise", "1", *held)[1]
    assert "> 1000 s" in out
    assert "unknown" in out
    almost_undamped = [*LAW[:3], "1e-320", *LAW[4:], "--noise", "0.05", "--json"]
    assert json.loads(run("design", *almost_undamped)[1])["speed_limit"] is None


def test_the_command_takes_units_and_a_recording(run, printed):
    ball = str(Path(__file__).parents[2] / "examples" / "recordings" / "ball.csv")
    words = ["--noise", "0.05", "--depth", "5mm", "--amplitudes", "1mm", "--frequencies", "2Hz"]
    found = json.loads(printed("design", ball, *words, "--json"))
    assert found["law"]["K"] == pytest.approx(2000.0, rel=0.02)
    [frequency] = found["planned"]["motion"]["frequencies"]
    assert frequency == pytest.approx(4.0 * np.pi)
    assert "in place of them" in run("design", ball, "--K", "3", "--noise", "1")[2]
    assert f"not a command: run palpate identify {ball}" in run(ball)[2]
