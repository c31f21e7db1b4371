"""How the command line reads a recording: options, a file of them, several files, places."""

import json
import tomllib

import message_files as files
import numpy as np
import pytest
from recordings import HEADER, recording, rows_of, text_of, written
from robots import hand, table_of

from palpate.preparation.settings import turned
from palpate.results.saved import as_toml


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """A robot's table, with units in the names."""
    recorded = table_of(hand(4.0))
    path = tmp_path_factory.mktemp("robot") / "robot.csv"
    names = list(recorded.channels)
    values = np.column_stack([recorded.channels[name] for name in names])
    scale = np.array([1e3 if name.startswith("p") else 1.0 for name in names])
    header = ",".join(name.replace("_m", "_mm") for name in names)
    np.savetxt(path, values * scale, delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def test_a_robots_table_in_millimetres_needs_no_option(run, printed, robot):
    out = printed("identify", robot, "--json")
    assert "in mm" in json.loads(out)["provenance"]["penetration"]
    assert result_of(out)["working_depth"]["stiffness"]["value"] == pytest.approx(2e3, rel=0.02)
    assert "stiffness" in run("identify", robot, "--normal", "0.48,-0.36,0.8", "--tare", "find")[1]
    _, out, _ = run("identify", robot, "--start", "0.15", "--stop", "0.32")
    assert "tare: no time out of contact was found" in out


def result_of(output: str) -> dict:
    return json.loads(output)["results"][0]


def test_a_position_that_is_named_keeps_the_orientation_of_its_topic(run, tmp_path):
    """Only the topics that are named are read; the wrench is in the tool's frame."""
    felt, maker = hand(2.0), files.Maker()
    turn = np.array([0.0, 0.2, 0.27, 0.0])  # by 39°
    turn[3] = np.sqrt(1.0 - turn @ turn)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(felt.time), 1))
    turns = np.tile(turn, (len(felt.time), 1))
    in_tool = turned(felt.force, turns * [-1, -1, -1, 1])
    wrenches = np.hstack([in_tool, np.zeros_like(in_tool)])
    stamps = 1_700_000_000_000_000_000 + np.rint(1e9 * felt.time).astype(np.int64)
    given = files.Values(stamps, wrenches, np.hstack([felt.position, still]))
    messages = files.wrenches_and_poses(given, frame="tool", pose="/camera")
    for at, row in zip(stamps, np.hstack([felt.position, turns]), strict=True):
        messages.append(("/arm", "geometry_msgs/PoseStamped", int(at), maker.pose(at, row)))
    bag = files.rosbag2(tmp_path / "bag", messages)
    for named in (["/arm"], ["/arm", "--force", "/ft"], ["/arm.pose.position", "--force", "/ft"]):
        found = result_of(run("identify", bag, "--position", *named, "--json")[1])
        assert found["working_depth"]["stiffness"]["value"] == pytest.approx(2e3, rel=0.02)


def test_several_files_are_contacts_of_one_object(run, printed, good, tmp_path):
    again = recording(tmp_path, "again.csv")
    out = printed("identify", good, again, "--json")
    both = json.loads(out)
    assert both["files"] == [str(good), str(again)]
    assert both["samples"] == 1200
    alone = result_of(run("identify", good, "--json")[1])["law"]
    assert result_of(out)["law"]["stiffness"] == pytest.approx(alone["stiffness"], rel=0.01)


def test_options_come_from_a_file_and_the_command_line_has_the_last_word(run, printed, tmp_path):
    rows = [[t, x, repr(1e3 * float(f))] for t, x, f in rows_of()]
    path = written(tmp_path / "n.csv", text_of(rows, ("t", "x", "load")))
    saved = tmp_path / "run.toml"
    given = ("--penetration", "x", "--unit", "force=mN", "--surface", "-0.1mm", "--strict")
    out = printed("identify", path, "--json", *given, "--save-config", saved)
    changed = {"penetration": "x", "unit": ["force=mN"], "surface": "-0.1mm", "strict": True}
    assert tomllib.loads(saved.read_text()) == {"method": "variable-projection", **changed}
    assert "# force: column 'load', in mN" in saved.read_text()
    assert run("identify", path, "--json", "--config", saved)[1] == out
    other = run("identify", path, "--json", f"--config={saved}", "--surface", "0mm")
    assert result_of(other[1])["law"] != result_of(out)["law"]
    text = 'quote " back \\ tab \t é 漢 \U0001f600'  # every text survives
    options = {"time": text, "unit": ["a", "\x7f\x01"], "rate": 1e-3, "strict": True}
    assert tomllib.loads(as_toml(options, ["of two\nlines"])) == options


@pytest.mark.parametrize(
    "text, words",
    [
        ("velocty = 'v'", "[velocty]"),
        ("save-config = 'x'", "'save-config' is no option"),
        ("verbose = true", "'verbose' is no option"),
        ("[identify]\nlaw = 'auto'", "'identify' is no option"),
        ("rate = 'fast'", "[rate]"),
        ("time = ", "not TOML"),
        ("time = " + "[" * 1000, "nests too deeply"),
        ("time = " + "[" * 1000 + "]" * 1000, "nests too deeply"),
    ],
)
def test_a_wrong_file_of_options_is_refused_by_name(refused, good, tmp_path, text, words):
    assert words in refused("identify", good, "--config", written(tmp_path / "run.toml", text))


def test_units_are_given_one_by_one_or_together(run, refused, tmp_path):
    rows = [[repr(1e3 * float(t)), repr(1e3 * float(x)), f] for t, x, f in rows_of()]
    path = written(tmp_path / "m.csv", text_of(rows, HEADER))
    one = run("identify", path, "--json", "--unit", "time=ms,penetration=mm")
    two = run("identify", path, "--json", "--unit", "time=ms", "--unit", "penetration=mm")
    assert one == two
    assert one[0] == 0
    refused("identify", path, "--unit", "penetration")
    # And a velocity column can be left out.
    rows = [[*row, "0.0"] for row in rows_of()]
    path = written(tmp_path / "v.csv", text_of(rows, (*HEADER, "velocity_m_s")))
    _, out, _ = run("identify", path, "--json", "--velocity", "none")
    assert "Savitzky" in json.loads(out)["provenance"]["velocity"]


@pytest.mark.parametrize(
    "option, words",
    [
        (("--normal", "w"), "normal must be x, y, z"),
        (("--surface", "deep"), "--surface must be a number and one of m"),
        (("--rate", "-1"), "rate must be in"),
        (("--force-frame", "world"), "force-frame"),
    ],
)
def test_a_wrong_option_is_one_line(refused, robot, option, words):
    assert words in refused("identify", robot, *option)
