"""``palpate lab``, as a user meets it."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import palpate
from palpate import lab
from palpate.cli.tables import comparable

pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'palpate[lab]'")

QUICK = ("--seconds", "4", "--seed", "3")


def test_identify_shows_the_truth_that_a_file_states_and_how_far_it_is(run, tmp_path):
    file = tmp_path / "ball.csv"
    run("lab", "ball", "-o", file, *QUICK)
    out = run("identify", file)[1]
    result = palpate.identify(file)
    stiffness = result.diagnosis.working_depth.stiffness
    pairs = [
        (result.law.stiffness, result.standard_errors[0]),
        (stiffness.value, math.hypot(stiffness.standard_error, stiffness.systematic)),
    ]
    for value, error in pairs:
        distance = (value - 2000.0) / error
        assert f"truth 2000, {distance:+.2g} σ" in out
    assert "standard errors" in out
    compared = run("compare", file)[1]
    assert re.search(r"^truth +.* 2000 ", compared, re.MULTILINE)
    assert "K = 2000 N/mⁿ" in compared
    file.write_text(file.read_text().replace("# truth:", "# truth: not JSON"))
    assert "σ" not in run("identify", file)[1]


def test_what_an_oscillation_feels_is_shown_beside_the_truth_of_what_remembers(run, tmp_path):
    file = tmp_path / "tissue.csv"
    run("lab", "tissue", "--probe", "ideal", "-o", file, "--seconds", 4)
    out = " ".join(run("identify", file, "--method", "viscoelastic")[1].split())
    felt = re.search(
        r"feels ([\d.]+) ± .+ N/m \(truth ([\d.]+).+ and ([\d.]+) ± .+ \(truth ([\d.]+)", out
    )
    stiffness, real, damping, exact = map(float, felt.groups())
    # 2 s of motion: seen, 0.05 % and 1 %.
    assert stiffness == pytest.approx(real, rel=0.005)
    assert damping == pytest.approx(exact, rel=0.03)


REMEMBERING = lab.TISSUE.law
NAMES = set(REMEMBERING.names())


@pytest.mark.parametrize(
    "law, same",
    [
        (REMEMBERING, NAMES),
        (replace(REMEMBERING, relaxation=palpate.FlatSpectrum(1e-3, 4.096)), NAMES),
        (replace(REMEMBERING, relaxation=palpate.FlatSpectrum(1e-3, 8.0)), set()),
        (replace(REMEMBERING, relaxation=palpate.SingleRelaxation(1.0)), set()),
        (replace(REMEMBERING, damping_exponent=0.5), NAMES - {"damping", "damping_exponent"}),
        (replace(REMEMBERING, damping=0.0, damping_exponent=0.5), NAMES),
        (REMEMBERING.relaxed(), set()),
        (lab.PVC.law, set()),
    ],
)
def test_only_numbers_that_mean_the_same_are_compared(law, same):
    assert comparable(law, REMEMBERING) == comparable(REMEMBERING, law) == same


LAWS = {
    "hunt-crossley": "--stiffness 500 --damping 100 --exponent 1.3",
    "kelvin-voigt": "--stiffness 800 --damping 4",
    "extended-kelvin-voigt": "--stiffness 500 --quadratic-stiffness 4e4 --damping 5",
    "generalised-hunt-crossley": "--stiffness 8000 --exponent 1.5 --damping 60 "
    "--damping-exponent 0.5 --relaxation-stiffness 4000 --longest-time 0.1",
}


@pytest.mark.parametrize("law", LAWS)
def test_a_law_of_ones_own_is_pressed(printed, tmp_path, law):
    file = tmp_path / "own.csv"
    printed("lab", law, *LAWS[law].split(), "--probe", "ideal", "-o", file, *QUICK)
    assert json.loads(palpate.prepare(file).provenance["truth"])["kind"] == law


def test_a_law_that_remembers_is_found_beside_a_truth_of_another_form(run, printed, tmp_path):
    file = tmp_path / "own.csv"
    law = "extended-kelvin-voigt"
    run("lab", law, *LAWS[law].split(), "--probe", "ideal", "-o", file, *QUICK)
    out = printed("identify", file, "--law", "single")
    assert "relaxation" in out  # which the file's law has none of


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
