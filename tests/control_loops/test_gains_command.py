"""``palpate gains``: what it prints, writes and refuses."""

import json

import numpy as np
import pytest

import palpate
from palpate import control_loops
from palpate.cli.gains import read_loop
from palpate.control_loops.loop import LOOPS, loop_called

ROBOT = ["--mass", "4", "--rate", "1000", "--wanted-force", "10N", "--speed", "20mm/s"]
IMPEDANCE = ["--controller", "impedance", "--stiffness", "500", "--damping", "60", *ROBOT]
ADMITTANCE = [
    "--controller", "admittance", "--virtual-mass", "2", "--virtual-damping", "80",
    "--filter", "100Hz", *ROBOT,
]  # fmt: skip
FORCE = [
    "--controller", "force", "--proportional", "0.5", "--integral", "2", "--filter", "0.1kHz",
    "--friction", "40", *ROBOT,
]  # fmt: skip
CASES = {
    "admittance": [*ADMITTANCE, "--delay", "4ms", "--bandwidth", "10Hz"],
    "impedance": [*IMPEDANCE, "--delay", "2ms"],
    "force": [*FORCE, "--delay", "2ms"],
}


@pytest.fixture
def parameters():
    """Reads the file of parameters."""
    yaml = pytest.importorskip("yaml")
    return lambda path: yaml.safe_load(path.read_text("utf-8"))["/**"]["ros__parameters"]


@pytest.mark.parametrize("controller", LOOPS)
def test_the_json_has_the_recommended_gains_and_the_yaml_their_values(
    controller, saved, printed, tmp_path, parameters
):
    file = tmp_path / "gains.yaml"
    words = [*CASES[controller], "--json", "--ros-parameters", file]
    answer = json.loads(printed("gains", saved, *words))
    assert answer["verdict"] == "safe"
    assert answer["gain_margin"]["lower_bound"] <= answer["gain_margin"]["value"]
    best, given = answer["recommended"], parameters(file)
    if controller == "admittance":
        own = given["admittance"]
        damping = own["damping_ratio"][2] * 2.0 * (own["mass"][2] * own["stiffness"][2]) ** 0.5
        found = own["mass"][2], damping
        assert (own["mass_z"], own["damping_z"]) == pytest.approx(found, rel=1e-4)
    elif controller == "impedance":  # crisp_controllers takes no stiffness above 5000 N/m
        assert given["task"]["k_pos_z"] == min(best["stiffness"], 5000.0)
        found = given["task"]["k_pos_z"], given["task"]["d_pos_z"]
        best = {name: value * found[0] / best["stiffness"] for name, value in best.items()}
    else:
        found = given["gains"]["normal_force"]["p"], given["gains"]["normal_force"]["i"]
    assert found == pytest.approx([best[name] for name in loop_called(controller).gains], rel=1e-4)


def test_the_text_is_the_sentence_and_the_lines_of_python(saved, printed):
    text = printed("gains", saved, *CASES["impedance"])
    loop = loop_called("impedance")(
        stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3, wanted_force=10.0,
        approach_speed=0.02,
    )  # fmt: skip
    expected = str(palpate.gains(palpate.load_result(saved), loop))
    assert text.split() == expected.split()


def test_a_refusal_has_its_reason_and_status_three_and_writes_nothing(saved, run, tmp_path):
    file = tmp_path / "gains.yaml"
    status, out, err = run("gains", saved, *IMPEDANCE, "--ros-parameters", file)
    assert (status, err, file.exists()) == (3, "", False)
    assert out.startswith("Refused: ")
    assert "with a delay of 8 ms" in out
    answer = json.loads(run("gains", saved, *IMPEDANCE, "--json")[1])
    assert (answer["verdict"], answer["refusal"], answer["recommended"]) == (
        "refused", "delay", None,
    )  # fmt: skip


@pytest.mark.parametrize(
    "words, message",
    [
        ([*ADMITTANCE, "--delay", "4ms"], "admittance control needs --bandwidth"),
        ([*CASES["impedance"], "--filter", "90Hz"], "impedance control does not use --filter"),
        ([*CASES["impedance"], "--motion", "free.csv"], "--motion needs --command"),
        ([*IMPEDANCE, "--delay", "2s"], "delay must be"),
        (["--controller", "force", *ROBOT], "force control needs --proportional"),
    ],
)
def test_an_option_that_is_missing_or_too_many_is_named(words, message, saved, refused):
    assert message in refused("gains", saved, *words)


def test_delay_and_bandwidth_come_from_the_commanded_position(saved, printed, refused, tmp_path):
    time = np.arange(0.0, 4.0, 1e-3)
    command = 5.0 * (1.0 - np.cos(2.0 * np.pi * 2.0 * time))
    moved = np.interp(time - 0.033, time, command)  # as late as 60 rad/s and no delay, about
    file = tmp_path / "free.csv"
    rows = np.column_stack([time, command, moved])
    np.savetxt(file, rows, delimiter=",", header="time_s,commanded,measured", comments="")
    words = [*ADMITTANCE, "--motion", file, "--position", "measured", "--command"]
    answer = json.loads(printed("gains", saved, *words, "commanded", "--json"))
    lag = answer["following"]["delay"] + 2.0 / answer["following"]["bandwidth"]
    assert lag == pytest.approx(0.033, rel=0.05)
    assert "absent" in refused("gains", saved, *words, "absent")


@pytest.mark.long
def test_the_picture_has_two_panels_with_their_data(ball):
    pytest.importorskip("matplotlib")
    from palpate.control_loops.figures import draw_gains

    loop = loop_called("impedance")(
        stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3, wanted_force=10.0,
        approach_speed=0.02,
    )  # fmt: skip
    answer = palpate.gains(ball, loop)
    for width, dark in ((None, False), (0.088, True)):
        onsets, forces = draw_gains(answer, width=width, dark=dark).axes
        labels = onsets.get_legend_handles_labels()[1]
        assert {"this gain", "recommended", "identified damping"} <= set(labels)
        settled = forces.get_lines()[1].get_ydata()[-1]
        assert settled == pytest.approx(10.0, rel=0.02)


def test_the_loop_of_a_live_run_is_read_from_options_of_gains(tmp_path, refused):
    file = tmp_path / "robot.toml"
    file.write_text(
        'controller = "impedance"\nstiffness = 500.0\ndamping = 60.0\nmass = 4.0\nrate = 1000\n'
        'delay = "2ms"\nwanted-force = "10N"\nspeed = "20mm/s"\n'
    )
    assert read_loop(file) == control_loops.ImpedanceControl(
        stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
        wanted_force=10.0, approach_speed=0.02,
    )  # fmt: skip
    live = "live", "lab:ball", "--no-page", "--seconds", 1, "--control-loop"
    assert "omit --no-diagnosis" in refused(*live, file, "--no-diagnosis")
    file.write_text('controller = "force"\n')
    assert "needs --proportional" in refused(*live, file)
    file.write_text('controller = "impedance"\ncolour = 3\n')
    assert "colour" in refused(*live, file)
