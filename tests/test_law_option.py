"""``--law`` and ``--frequency``, as a user meets them."""

import json
from pathlib import Path

import pytest

import palpate

PHANTOM = Path(__file__).parents[1] / "examples" / "recordings" / "phantom.csv"
BALL = PHANTOM.with_name("ball.csv")


def test_a_law_is_chosen_and_said(run):
    status, out, err = run("identify", PHANTOM, "--law", "auto")
    assert (status, err) == (0, "")
    result = palpate.identify(PHANTOM, law="auto", trace=False)
    assert str(result.law_verdict.candidate) in out
    assert "by viscoelastic" in out
    assert "independent samples of" in " ".join(out.split())


def test_the_diagnosis_is_of_the_law_that_is_asked_for(run):
    status, out, _ = run("diagnose", PHANTOM, "--law", "half-space", "--json")
    assert status == 0
    [result] = json.loads(out)["results"]
    assert result["law_verdict"]["law"] in ("half-space", "Kelvin–Voigt")
    assert result["method"] == "viscoelastic"


def test_what_an_oscillation_feels_is_printed_with_what_the_everyday_laws_say(run):
    own = palpate.identify(BALL, trace=False).dynamic_stiffness().frequency
    status, out, _ = run("identify", BALL, "--frequency", f"{own:.6f}rad/s")
    assert status == 0
    assert "of the everyday laws, by the same samples: Hunt–Crossley, before " in out
    assert "a small oscillation of " in out
    assert "K′ = 2000.7" in out
    _, printed, _ = run("identify", BALL, "--frequency", f"{own:.6f}rad/s", "--json")
    felt = json.loads(printed)["results"][0]["small_oscillation"]
    assert felt["frequency"] == pytest.approx(own, abs=1e-6)


def test_options_in_a_file_hold_the_law(run, tmp_path):
    options = tmp_path / "options.toml"
    run("identify", BALL, "--law", "half-space", "--save-config", options)
    assert 'law = "half-space"' in options.read_text()
    _, out, _ = run("identify", BALL, "--config", options, "--json")
    [result] = json.loads(out)["results"]
    assert result["law"]["damping_exponent"] == result["law"]["exponent"] - 1.0


@pytest.mark.slow  # processes of its own
def test_a_fleet_takes_the_law_too(run, tmp_path):
    status, out, _ = run("fleet", BALL, "-o", tmp_path / "out", "--law", "auto", "--json")
    assert status == 0
    assert json.loads(out)["identified"] == 1
