"""``palpate design`` as a user meets it."""

import json
import re

from palpate import lab
from palpate.design import Motion, design

BALL = lab.BALL.law
GUESS = ["--stiffness", "2000", "--damping", "2000", "--exponent", "1"]


def test_the_command_prints_precision_times_limit_and_a_command_to_run_next(run):
    status, out, err = run("design", *GUESS, "--noise", "0.05")
    assert (status, err) == (0, "")
    for words in ("after 0.5 s", "after 20 s", "within 5%", "within 1%", "100 mm/s", "eq. 10"):
        assert words in out
    assert "50.8 mm/s" in out
    [command] = re.findall(r"^palpate (design (?:.*\\\n)*.*)$", out, re.MULTILINE)
    status, out, err = run(*command.replace("\\\n", "").split())
    assert (status, err) == (0, "")
    assert "no better motion" in out


def test_the_command_prints_one_json_object(run):
    options = ["--noise", "0.05", "--resolution", "0.125", "--no-offset", "--surface", "--json"]
    sines = ["--depth", "8e-3", "--amplitudes", "1e-3", "2e-3", "--frequencies", "3", "9"]
    status, out, err = run("design", *GUESS, *options, *sines)
    assert (status, err) == (0, "")
    words = json.loads(out)
    motion = Motion(8e-3, (1e-3, 2e-3), (3.0, 9.0))
    same = design(BALL, motion, noise=0.05, resolution=0.125, offset=False, surface=True)
    command = words.pop("command")
    assert words == json.loads(json.dumps(same.as_dict()))
    assert command.endswith("--no-offset --surface")
    assert "--resolution 0.125" in command


def test_what_is_never_reached_is_null(run):
    held = ["--amplitudes", "0", "--frequencies", "1"]
    _, out, _ = run("design", *GUESS, "--noise", "1", *held, "--json")
    words = json.loads(out)
    assert words["planned"]["times"][0]["stiffness"] is None
    assert words["better"] is words["command"] is None
    _, out, _ = run("design", *GUESS, "--noise", "1", *held)
    assert "> 1000 s" in out
    assert "unknown" in out
    almost_undamped = [*GUESS[:3], "1e-320", *GUESS[4:], "--noise", "0.05", "--json"]
    assert json.loads(run("design", *almost_undamped)[1])["speed_limit"] is None
