"""How the command line reads a recording: options, a file of them, several files, places."""

import json
import tomllib

import message_files as files
import numpy as np
import pytest
from recordings import HEADER, recording, rows_of, text_of, written
from robots import hand, table_of

from palpate.preparation.wrenches import turned
from palpate.results.toml import as_toml


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


def law_of(output: str) -> dict:
    return json.loads(output)["results"][0]["law"]


def test_a_robots_table_in_millimetres_needs_no_option(run, robot):
    status, out, _ = run("identify", robot, "--json")
    assert status == 0
    whole = json.loads(out)
    assert "in mm" in whole["provenance"]["penetration"]
    assert whole["results"][0]["working_depth"]["stiffness"]["value"] == pytest.approx(
        2e3, rel=0.02
    )


def test_what_was_assumed_is_printed(run, robot):
    _, out, _ = run("identify", robot, "--normal", "0.48,-0.36,0.8", "--tare", "find")
    assert "stiffness" in out
    _, out, _ = run("identify", robot, "--start", "0.15", "--stop", "0.32")
    assert "tare: no time out of contact was found" in out


def test_a_position_that_is_named_keeps_the_orientation_of_its_topic(run, tmp_path):
    """Only the topics that are named are read; the wrench is in the tool's frame."""
    felt, maker = hand(3.0), files.Maker()
    pose = np.array([0.0, 0.2, 0.27, 0.0])  # a turn by 39°
    pose[3] = np.sqrt(1.0 - pose @ pose)
    inverse = np.tile(pose * [-1, -1, -1, 1], (len(felt.time), 1))
    rows = zip(felt.time, turned(felt.force, inverse), felt.position, strict=True)
    messages = []
    for time, force, place in rows:
        at = 1_700_000_000_000_000_000 + round(1e9 * time)
        wrench = maker.wrench(at, np.r_[force, 0.0, 0.0, 0.0], "tool")
        messages.append(("/ft", "geometry_msgs/WrenchStamped", at, wrench))
        for topic, turn in (("/arm", pose), ("/camera", np.array([0.0, 0.0, 0.0, 1.0]))):
            stamped = maker.pose(at, np.r_[place, turn])
            messages.append((topic, "geometry_msgs/PoseStamped", at, stamped))
    bag = files.rosbag2(tmp_path / "bag", messages)
    for named in (["/arm"], ["/arm", "--force", "/ft"], ["/arm.pose.position", "--force", "/ft"]):
        found = json.loads(run("identify", bag, "--position", *named, "--json")[1])["results"][0]
        assert found["working_depth"]["stiffness"]["value"] == pytest.approx(2e3, rel=0.02)


def test_several_files_are_contacts_of_one_object(run, good, tmp_path):
    again = recording(tmp_path, "again.csv")
    status, out, _ = run("identify", good, again, "--json")
    assert status == 0
    both = json.loads(out)
    assert both["files"] == [str(good), str(again)]
    assert both["samples"] == 1200
    alone = law_of(run("identify", good, "--json")[1])
    assert law_of(out)["stiffness"] == pytest.approx(alone["stiffness"], rel=0.01)


def test_options_come_from_a_file_and_the_command_line_has_the_last_word(run, tmp_path):
    rows = [[t, x, repr(1e3 * float(f))] for t, x, f in rows_of()]
    path = written(tmp_path / "n.csv", text_of(rows, ("t", "x", "load")))
    saved = tmp_path / "run.toml"
    given = ("--penetration", "x", "--unit", "force=mN", "--surface", "-0.1mm", "--strict")
    status, out, _ = run("identify", path, "--json", *given, "--save-config", saved)
    assert status == 0
    assert tomllib.loads(saved.read_text()) == {
        "method": "variable-projection",
        "penetration": "x",
        "unit": ["force=mN"],
        "surface": "-0.1mm",
        "strict": True,
    }
    assert "# force: column 'load', in mN" in saved.read_text()
    again = run("identify", path, "--json", "--config", saved)
    assert again[1] == out
    other = run("identify", path, "--json", f"--config={saved}", "--surface", "0mm")
    assert law_of(other[1]) != law_of(out)


@pytest.mark.parametrize(
    "text, words",
    [
        ("velocty = 'v'", "[velocty]"),
        ("save-config = 'x'", "'save-config' is no option"),
        ("verbose = true", "'verbose' is no option"),
        ("[identify]\nlaw = 'auto'", "'identify' is no option"),
        ("[surface]\nfit = 1", "[surface][fit]"),
        ("rate = 'fast'", "[rate]"),
        ("time = ", "not TOML"),
        ("time = " + "[" * 1000, "nests too deeply"),
        ("time = " + "[" * 1000 + "]" * 1000, "nests too deeply"),
        ("delay = '5 parsecs'", "--delay must be a number and one of s"),
    ],
)
def test_a_wrong_file_of_options_is_refused_by_name(refused, good, tmp_path, text, words):
    assert words in refused("identify", good, "--config", written(tmp_path / "run.toml", text))


def test_every_text_survives_a_file_of_options():
    options = {"time": 'quote " back \\ tab \t é 漢 \U0001f600', "unit": ["\x7f\x01"], "rate": 1e-3}
    assert tomllib.loads(as_toml({**options, "strict": True}, ["of\x01 two\nlines"])) == {
        **options, "strict": True,
    }  # fmt: skip


def test_units_are_given_one_by_one_or_together(run, tmp_path):
    rows = [[repr(1e3 * float(t)), repr(1e3 * float(x)), f] for t, x, f in rows_of()]
    path = written(tmp_path / "m.csv", text_of(rows, HEADER))
    one = run("identify", path, "--json", "--unit", "time=ms,penetration=mm")
    two = run("identify", path, "--json", "--unit", "time=ms", "--unit", "penetration=mm")
    assert one == two
    assert one[0] == 0
    status, _, err = run("identify", path, "--unit", "penetration")
    assert (status, err.count("\n")) == (2, 1)


def test_a_velocity_column_can_be_left_out(run, tmp_path):
    rows = [[*row, "0.0"] for row in rows_of()]
    path = written(tmp_path / "v.csv", text_of(rows, (*HEADER, "velocity_m_s")))
    _, out, _ = run("identify", path, "--json", "--velocity", "none")
    assert "Savitzky" in json.loads(out)["provenance"]["velocity"]


@pytest.mark.parametrize(
    "option, words",
    [
        (("--normal", "w"), "normal must be x, y, z"),
        (("--surface", "deep"), "--surface must be a number and one of m"),
        (("--tare", "soon"), "--tare must be START:STOP"),
        (("--tool-weight", "heavy"), "--tool-weight must be a number and one of N"),
        (("--spot", "wide"), "--spot must be a number and one of m"),
        (("--rate", "-1"), "rate must be in"),
        (("--force-frame", "world"), "force-frame"),
    ],
)
def test_a_wrong_option_is_one_line(refused, robot, option, words):
    assert words in refused("identify", robot, *option)
