"""``palpate payload``: what it prints, writes and draws, and what it refuses."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from payloads import PAYLOAD
from robot_logs import Setup, on_one_clock, simulate
from ruamel.yaml import YAML

from palpate import Payload
from palpate.cli.payload import verdict_on

SETUP = Setup(presses=1)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log as CSV, on one clock; the wrench is 10 ms late."""
    return written_log(SETUP, tmp_path_factory.mktemp("payload") / "turns.csv")


def written_log(setup, path):
    columns = on_one_clock(simulate(setup))
    header = ",".join(columns)
    rows = np.column_stack(list(columns.values()))[::2]
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def test_the_tool_is_printed_saved_and_drawn(log, printed, tmp_path):
    tool, parameters = tmp_path / "tool.toml", tmp_path / "tool.yaml"
    figure = tmp_path / "tool.svg"
    written = ("--save-config", tool, "--ros-parameters", parameters, "--figure", figure)
    out = printed("payload", log, *written)
    assert len(out.splitlines()) <= 12
    mass, error = map(float, re.search(r"mass +([\d.]+) ± ([\d.]+) kg +trust", out).groups())
    assert abs(mass - SETUP.mass) < 5e-3 * SETUP.mass
    assert 0.0 < error < 5e-3 * SETUP.mass
    assert re.search(r"turned by (29\.\d|30\.\d).*° ", out)
    assert re.search(r"clock +force (9\.[5-9]|10\.[0-5])\d* ± \S+ ms late +trust", out)
    assert re.search(r"turns \d+° about 2 axes, \d+ s of free air \(\d+ %\): enough\n", out)
    for path in (tool, parameters, figure):
        assert f"written: {path}" in out
    saved = Payload.load(tool)
    assert saved.mass == pytest.approx(mass, rel=1e-3)
    np.testing.assert_allclose(saved.centre, SETUP.centre, atol=5e-4)
    assert "free air" in tool.read_text("utf-8")
    whole = YAML(typ="safe").load(parameters.read_text("utf-8"))["/**"]["ros__parameters"]
    params = whole["sensor_filter_chain"]["filter1"]["params"]
    assert params["tool"]["mass"] == saved.mass
    text = figure.read_text("utf-8")
    assert all(words in text for words in ("As recorded", "Less weight", "two standard errors"))


def test_a_stated_delay_is_in_the_file_of_the_tool(log, printed, tmp_path):
    tool = tmp_path / "tool.toml"
    out = printed("payload", log, "--delay", "10.1ms+-0.02ms", "--save-config", tool)
    assert "force 10.100 ± 0.020 ms late" in out
    assert Payload.load(tool).delay_error == pytest.approx(2e-5, rel=0.05)


def test_the_json_has_the_fields_of_the_file(log, printed):
    found = json.loads(printed("payload", log, "--json"), parse_constant=pytest.fail)
    assert found["mark"] == "trust"
    assert found["verdict"].endswith(": enough")
    fields = {name: found[name] for name in PAYLOAD.as_dict()}
    assert fields["mass"] == pytest.approx(SETUP.mass, rel=5e-3)
    assert np.shape(fields["mount"]) == (3, 3)


def test_a_dark_figure_in_a_column_is_drawn(log, printed, tmp_path):
    path = tmp_path / "dark.svg"
    printed("payload", log, "--figure", path, "--dark", "--width", "88mm")
    assert "#16181c" in path.read_text("utf-8")


def test_equal_outputs_and_logs_without_a_pose_are_refused(log, refused, tmp_path, good):
    path = tmp_path / "tool"
    words = refused("payload", log, "--save-config", path, "--ros-parameters", path)
    assert "two outputs name this file" in words
    assert "needs a force in space and a pose" in refused("payload", good)
    assert not path.exists()


@pytest.mark.long
def test_payload_findings_are_short_and_name_existing_options(printed, tmp_path):
    reversed_log = written_log(replace(SETUP, sign=-1.0, zeroed=0.5), tmp_path / "log.csv")
    out = printed("payload", reversed_log)
    assert len(out.splitlines()) <= 12
    assert "palpate reversed its sign" in out
    assert "--flip-force" not in out
    assert "1 more with -v" in out
    assert "palpate reversed" not in printed("payload", reversed_log, "--flip-force")
    assert "next:" not in out
    still = written_log(replace(SETUP, turns=0.0, touch_tilt=0.0), tmp_path / "still.csv")
    assert "next: turn the tool by 30° about two axes" in printed("payload", still)
    assert re.search(r"bias +-[23]\.\d+.*, [45]\.\d+", out)  # as the sensor reads it


def test_a_log_without_a_torque_leaves_the_centre_of_mass_unknown(log, printed, tmp_path):
    header, rows = log.read_text().split("\n", 1)
    names = header.split(",")
    keep = [k for k, name in enumerate(names) if "torque" not in name]
    values = np.loadtxt(rows.splitlines(), delimiter=",")[:, keep]
    path = tmp_path / "force.csv"
    header = ",".join(names[k] for k in keep)
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.9g")
    out = printed("payload", path)
    assert "unknown: the log has no torque" in out
    assert "mN·m" not in out
    assert re.search(r"mass +0\.(39|40)\d+ ± \S+ kg +trust", out)


def test_a_force_in_the_axes_of_the_position_has_no_payload(log, printed, refused):
    words = refused("payload", log, "--force-frame", "base")
    assert "pass --force-frame tool if it is" in words
    assert printed("payload", log, "--force-frame", "tool") == printed("payload", log)


@pytest.mark.long
def test_the_file_serves_identify_also_by_a_file_of_options(log, printed, refused, tmp_path):
    tool, options = tmp_path / "tool.toml", tmp_path / "run.toml"
    printed("payload", log, "--save-config", tool)
    out = printed("identify", log, "--payload", tool, "--save-config", options)
    assert f'payload = "{tool}"' in options.read_text("utf-8")
    assert printed("identify", log, "--config", options) == out
    words = refused("identify", log, "--payload", tool, "--force-frame", "base")
    assert "payload excludes force_frame base" in words
    assert "No such file" in refused("identify", log, "--payload", tmp_path / "no.toml")


VERDICTS = {
    "turns 43° about 2 axes, 20 s of free air (45 %): enough": {},
    "turns 43° about 1 axis, 20 s of free air (45 %): enough, with care for mount": {
        "axes": 1,
        "mount_mark": "with-care",
    },
    "does not turn, 20 s of free air (45 %): not enough for mass and mount": {
        "axes": 0,
        "turn": 0.0,
        "mass_mark": "do-not-trust",
        "mount_mark": "do-not-trust",
        "delay_mark": "with-care",
    },
}


@pytest.mark.parametrize("words", VERDICTS)
def test_the_verdict_says_what_the_log_is_good_for(words):
    known = {"turn": np.deg2rad(43.0), "axes": 2, "free_time": 20.0, "free_share": 0.45}
    assert verdict_on(replace(PAYLOAD, **known | VERDICTS[words])) == words
