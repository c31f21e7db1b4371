"""``palpate lab``, as a user meets it, and its robot: geometry, and what MuJoCo makes of it."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import palpate
from palpate import GeneralisedHuntCrossley, InvalidParameterError, lab
from palpate.input.recordings.recording import read_truth
from palpate.lab.figures import NoRendererError, photograph
from palpate.lab.rig import Geometry
from palpate.output.results.truth import comparable

QUICK = ("--seconds", "4", "--seed", "3")


@pytest.mark.long
def test_identify_compares_with_the_truth_that_a_file_states(run, tmp_path):
    file = tmp_path / "ball.csv"
    run("lab", "ball", "-o", file, *QUICK)
    out = run("identify", file, "-v")[1]
    result = palpate.identify(file)
    stiffness = result.diagnosis.working_depth.stiffness
    pairs = [
        (result.law.K, result.standard_errors[0]),
        (stiffness.value, math.hypot(stiffness.standard_error, stiffness.systematic)),
    ]
    for value, error in pairs:
        distance = (value - 2000.0) / error
        assert f"truth 2000, {distance:+.2g} σ" in out
    assert "standard errors" in out
    distance = (stiffness.value - 2000.0) / stiffness.whole_error
    assert f"stiffness 2000 N/m, {distance:+.2g} σ" in run("identify", file)[1]
    compared = run("compare", file)[1]
    assert re.search(r"^truth +.* 2000 ", compared, re.MULTILINE)
    assert "K = 2000 N/mⁿ" in compared
    file.write_text(file.read_text().replace("# truth:", "# truth: not JSON"))
    assert "σ" not in run("identify", file)[1] + run("identify", file, "-v")[1]


def test_dynamic_stiffness_is_compared_with_its_truth(run, tmp_path):
    file = tmp_path / "tissue.csv"
    run("lab", "tissue", "--probe", "ideal", "-o", file, "--seconds", 4)
    out = " ".join(run("identify", file, "--method", "viscoelastic", "-v")[1].split())
    number, bars = r" ([\d.]+)", r" ± [\d.]+ ± .+?"
    rows = (f"{name}{number}{bars} truth{number}," for name in ("stiffness", "damping"))
    felt = re.search(".+?".join(rows), out)
    stiffness, real, damping, exact = map(float, felt.groups())
    # 2 s of motion: seen, 0.05 % and 1 %.
    assert stiffness == pytest.approx(real, rel=0.005)
    assert damping == pytest.approx(exact, rel=0.03)


REMEMBERING = lab.TISSUE.law
SEVERAL = palpate.RelaxationSpectrum((1e-3, 4.0), (4e3, 4e3))
NAMES = set(REMEMBERING.names())


@pytest.mark.parametrize(
    "law, same",
    [
        (REMEMBERING, NAMES),
        (replace(REMEMBERING, relaxation=palpate.FlatSpectrum(1e-3, 4.096)), NAMES),
        (replace(REMEMBERING, relaxation=palpate.FlatSpectrum(1e-3, 8.0)), set()),
        (replace(REMEMBERING, relaxation=palpate.SingleRelaxation(1.0)), set()),
        (replace(REMEMBERING, p=0.5), NAMES - {"B", "p"}),
        (replace(REMEMBERING, B=0.0, p=0.5), NAMES),
        (replace(REMEMBERING, relaxation=SEVERAL), set()),
        (REMEMBERING.relaxed(), set()),
        (lab.PVC.law, set()),
    ],
)
def test_only_numbers_that_mean_the_same_are_compared(law, same):
    assert comparable(law, REMEMBERING) == comparable(REMEMBERING, law) == same


LAWS = {
    "hunt-crossley": "--K 500 --B 100 --n 1.3",
    "kelvin-voigt": "--K 800 --B 4",
    "extended-kelvin-voigt": "--K1 500 --K2 4e4 --B 5",
    "generalised-hunt-crossley": "--K 8000 --n 1.5 --B 60 --p 0.5 --M 4000 --longest-time 0.1",
}
SPECTRUM = (
    "--K 8000 --n 1.5 --B 60 --p 0.5 --relaxation-times 0.01 "
    "--relaxation-times 1 --relaxation-stiffnesses 1000 --relaxation-stiffnesses 3000"
)


@pytest.mark.parametrize("law", LAWS)
def test_a_law_of_ones_own_is_pressed(printed, tmp_path, law):
    file = tmp_path / "own.csv"
    printed("lab", law, *LAWS[law].split(), "--probe", "ideal", "-o", file, *QUICK)
    assert json.loads(palpate.prepare(file).provenance["truth"])["kind"] == law


def test_a_spectrum_of_ones_own_is_pressed_and_stated(printed, tmp_path):
    file, kind = tmp_path / "own.csv", GeneralisedHuntCrossley.kind
    printed("lab", kind, *SPECTRUM.split(), "--probe", "ideal", "-o", file, *QUICK)
    spectrum = palpate.RelaxationSpectrum((0.01, 1.0), (1e3, 3e3))
    expected = GeneralisedHuntCrossley(K=8e3, n=1.5, B=60.0, p=0.5, relaxation=spectrum)
    assert read_truth(palpate.prepare(file).provenance) == expected


def test_sensors_can_be_switched_off(run, tmp_path):
    file = tmp_path / "ball.csv"
    off = ("--noise", 0, "--resolution", 0, "--bias", 0, "--counts", 0)
    run("lab", "ball", "-o", file, *off, *QUICK)
    law = palpate.identify(palpate.prepare(file)).law
    np.testing.assert_allclose(law.parameters, lab.BALL.law.parameters, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_the_rig_is_pictured(printed, tmp_path, ending):
    picture = tmp_path / f"rig{ending}"
    out = printed("lab", "ball", "-o", tmp_path / "b.csv", "--picture", picture, *QUICK)
    assert str(picture) in out
    assert picture.stat().st_size > 5000


PLACE = np.linspace(-0.015, 0.015, 61)
DEPTH = 6e-3 + 8e-3 * np.sin(400.0 * PLACE)
COUNT = 2.0 * np.pi / 20_000.0  # rad


def undisturbed(name: str, **settings) -> lab.Measurement:
    """Three seconds on a material, without steps of encoders or sensors."""
    robot = lab.TwinPantograph(counts_per_turn=0, **settings)
    return lab.Bench(lab.MATERIALS[name], lab.THREE_SINES, robot, lab.PERFECT).run(seconds=5.0)


@pytest.fixture(scope="module")
def ball() -> lab.Measurement:
    return undisturbed("ball")


def test_forward_kinematics_undoes_inverse_kinematics():
    geometry = Geometry()
    angles = geometry.motor_angles(PLACE, DEPTH)
    np.testing.assert_allclose(geometry.tip(angles), (PLACE, DEPTH), atol=1e-15)
    # A count of an encoder moves the tip by some ten micrometres.
    for motor in range(4):
        turned = angles.copy()
        turned[:, motor] += COUNT
        moved = np.abs(geometry.tip(turned)[1] - DEPTH)
        assert 2e-6 < moved.min() < moved.max() < 20e-6


def test_the_speeds_of_the_motors_are_the_slopes_of_their_angles():
    geometry, h = Geometry(), 1e-6
    sideways, inward = np.cos(PLACE), np.sin(DEPTH)
    angles = [
        geometry.motor_angles(PLACE + s * h * sideways, DEPTH + s * h * inward) for s in (1, -1)
    ]
    _, speeds = geometry.motor_motion(lab.Command(DEPTH, inward, PLACE, sideways))
    # Central differences of step h: rounding of 1e-16/h is the error.
    np.testing.assert_allclose(speeds, (angles[0] - angles[1]) / (2.0 * h), rtol=1e-8, atol=1e-8)


def test_the_robot_presses_with_the_law_of_the_material(ball):
    truth = ball.truth
    # Kinematics of the true motor angles finds the true tip: the constraints give by less than
    # half a micrometre under 25 N, a thirtieth of a count.
    assert np.abs(ball.contact.penetration - truth.penetration).max() < 0.5e-6
    # The torque steps once a millisecond, and the acceleration with it by some 0.1 m/s²: a slope
    # over two milliseconds can tell no better.
    slope = np.gradient(truth.penetration, 1e-3)
    assert np.abs(slope - truth.velocity)[2:-2].max() < 0.1e-3
    expected = lab.BALL.law.force(truth.penetration, truth.velocity)
    np.testing.assert_allclose(truth.force, expected, rtol=1e-12)


def test_half_the_time_step_gives_the_same_course(ball):
    finer = undisturbed("ball", time_step=0.25e-3)
    apart = np.abs(finer.truth.penetration - ball.truth.penetration)
    assert apart.max() < 3e-6  # of 12 mm


def test_encoders_round_and_have_an_unknown_zero():
    bench = lab.Bench(lab.SPONGE, lab.THREE_SINES)
    runs = [bench.run(seed, seconds=4.0) for seed in (0, 1)]
    means = []
    for run in runs:
        error = (run.contact.penetration - run.truth.penetration)[run.truth.penetration > 1e-3]
        assert 1e-6 < error.std() < 10e-6
        assert np.abs(error).max() < 4.0 * 0.5 * 20e-6  # half a count of all four motors at worst
        means.append(error.mean())
    assert means[0] != means[1]


def test_palpation_moves_sideways_over_the_border_in_contact():
    run = lab.Bench(lab.SOFT_AND_HARD, lab.PALPATION).run(seconds=8.5)
    truth, before, after = run.truth, run.truth.time < 6.7, run.truth.time > 7.3
    touching = truth.time > 2.5
    assert (truth.force[touching] > 0.5).all()
    x, v, force = truth.penetration, truth.velocity, truth.force
    soft, hard = lab.PVC.law.force(x, v), lab.INCLUSION.law.force(x, v)
    np.testing.assert_allclose(force[before], soft[before])
    np.testing.assert_allclose(force[after], hard[after])


def test_the_rig_can_be_photographed_pressing():
    try:
        pixels = photograph(lab.Bench(lab.BALL, lab.THREE_SINES), size=(160, 100))
    except NoRendererError as error:
        pytest.skip(str(error))
    assert pixels.shape == (100, 160, 3)
    assert pixels.std() > 10.0  # not one colour


def test_unresolvable_designs_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stiff = lab.Homogeneous(palpate.KelvinVoigt(K=1e4, B=1e5))
    for material, sensors, words in (
        (lab.BALL, lab.Sensors(sample_time=0.1), "sample_time must be at most"),
        (stiff, lab.Sensors(), r"diverged at t = 2\.\d+ s"),
    ):
        with pytest.raises(InvalidParameterError, match=words):
            lab.Bench(material, lab.THREE_SINES, sensors=sensors).run()
    assert not list(tmp_path.iterdir())  # MuJoCo would leave a log there
