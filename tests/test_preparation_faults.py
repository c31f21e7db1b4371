"""Faults of a laboratory in a robot's recording: an answer that is off is not trusted."""

import math
from dataclasses import replace

import numpy as np
import pytest
from probing import BALL, PVC
from robots import NORMAL, ORIGIN, hand, table_of

from palpate import Recording, identify, prepare
from palpate.digits import with_error
from palpate.preparation.wrenches import turned

SIDE = np.cross(NORMAL, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(NORMAL, [0.0, 0.0, 1.0]))


def said(contact, step: str) -> list[str]:
    return [remark.severity for remark in contact.remarks if remark.step == step]


def marks(contact) -> set[str]:
    verdict = identify(contact).diagnosis.verdict
    return {verdict.stiffness, verdict.damping, verdict.overall}


def test_a_sound_recording_has_neither_doubt():
    contact = prepare(table_of(hand(4.0)))
    assert not said(contact, "direction")
    assert not said(contact, "saturation")


@pytest.mark.parametrize(
    "wrong", [(1.0, 1.0, -1.0), (-1.0, 1.0, 1.0)], ids=["z is turned", "x is turned"]
)
@pytest.mark.parametrize("of", ["force", "position"])
def test_an_axis_that_is_turned_is_not_to_be_trusted(of, wrong):
    felt = hand(4.0)
    contact = prepare(table_of(replace(felt, **{of: getattr(felt, of) * wrong})))
    assert "do-not-trust" in said(contact, "direction")
    assert marks(contact) == {"do-not-trust"}


def test_axes_that_are_swapped_are_not_to_be_trusted():
    felt = hand(4.0)
    contact = prepare(table_of(replace(felt, force=felt.force[:, [1, 0, 2]])))
    assert marks(contact) == {"do-not-trust"}


def test_a_wrench_in_the_tools_frame_that_is_taken_for_the_bases_is_not_to_be_trusted():
    felt = hand(4.0)
    half = 0.35
    into_tool = np.array([0.0, -0.6 * np.sin(half), -0.8 * np.sin(half), np.cos(half)])
    in_tool = turned(felt.force, np.tile(into_tool, (len(felt.time), 1)))
    assert "do-not-trust" in said(prepare(table_of(replace(felt, force=in_tool))), "direction")


def test_friction_across_the_motion_calls_for_care_with_both_numbers():
    felt = hand(4.0)
    pressed = BALL.force(felt.motion.x, felt.motion.v)
    contact = prepare(table_of(replace(felt, force=felt.force + np.outer(0.3 * pressed, SIDE))))
    assert said(contact, "direction") == ["with-care"]
    assert marks(contact) == {"with-care"}


def test_a_given_normal_needs_the_motion_or_the_force_along_it():
    felt = hand(4.0)
    assert "do-not-trust" in said(prepare(table_of(felt), normal="z"), "direction")
    slid = replace(felt, position=felt.position + np.outer(0.3 * felt.motion.x, SIDE))
    assert said(prepare(table_of(slid), spot=1.0), "direction") == ["with-care"]
    assert not said(prepare(table_of(slid), normal=NORMAL, spot=1.0), "direction")


def test_one_axis_that_is_clipped_is_seen_before_it_is_projected():
    felt = hand(4.0)
    clipped = felt.force.copy()
    clipped[:, 2] = np.minimum(clipped[:, 2], 0.6 * clipped[:, 2].max())
    contact = prepare(table_of(replace(felt, force=clipped)))
    assert said(contact, "saturation") == ["do-not-trust"]
    assert marks(contact) == {"do-not-trust"}


@pytest.mark.parametrize("value", [0.0, 1.5])
def test_an_axis_that_never_changes_is_not_measured_and_not_saturated(value):
    felt = hand(4.0, normal=np.array([0.0, 0.0, 1.0]), bias=np.zeros(3))
    alone = felt.force * [0.0, 0.0, 1.0] + [value, value, 0.0]
    contact = prepare(table_of(replace(felt, force=alone)))
    assert (said(contact, "saturation"), said(contact, "force axes")) == ([], ["note"])
    assert marks(contact) == {"trust"}


def test_a_coarse_force_is_not_taken_for_a_clipped_one():
    felt = hand(4.0)
    coarse = replace(felt, force=0.05 * np.round(felt.force / 0.05))
    assert not said(prepare(table_of(coarse)), "saturation")


def test_a_tool_that_turns_calls_for_care_with_both_numbers():
    felt = hand(3.0)
    angle = 0.08 * np.sin(2.0 * felt.time)
    quaternions = np.column_stack([np.sin(angle / 2), 0.0 * angle, 0.0 * angle, np.cos(angle / 2)])
    contact = prepare(table_of(felt, **{f"q{k}": quaternions[:, k] for k in range(4)}))
    assert said(contact, "orientation") == ["with-care"]
    assert marks(contact) == {"with-care"}


def test_a_position_that_was_commanded_calls_for_care():
    felt = table_of(hand(3.0))
    renamed = {
        f"{name[:2]}_cmd_m" if name.startswith("p") else name: values
        for name, values in felt.channels.items()
    }
    contact = prepare(Recording(renamed))
    assert said(contact, "channels") == ["with-care"]
    assert "commanded, not measured" in contact.remarks[0].sentence
    beside = {**renamed, **felt.channels}
    assert not said(prepare(Recording(beside)), "channels")  # what was measured is there


def test_options_that_find_nothing_to_act_on_are_named():
    felt = hand(2.0)
    along = Recording({"t": felt.time, "z_m": -felt.motion.x, "Fz_N": felt.force @ NORMAL})
    contact = prepare(along, normal="z", tool_weight=1.0)
    assert [r.sentence for r in contact.remarks if r.step == "options"] == [
        "--normal and --tool-weight did nothing: position and force are not both in space"
    ]
    assert not said(prepare(table_of(felt), normal=NORMAL), "options")


def test_stiffness_at_a_depth_is_known_no_better_than_the_depth():
    """Of pvc, F = K x²: 20 µm of the surface are many errors of a stiffness whose law is known."""
    for seed in range(6):
        contact = prepare(table_of(hand(6.0, PVC, seed=seed)))
        there = identify(contact).diagnosis.working_depth
        # Three standard errors: of six runs one is beyond by chance in sixty.
        error = there.stiffness.value - PVC.stiffness_at(there.depth)
        assert abs(error) < 3.0 * there.stiffness.standard_error
        slope = PVC.stiffness * PVC.exponent * (PVC.exponent - 1.0)
        assert there.stiffness.standard_error > 0.9 * slope * contact.surface_deviation


def test_parameters_are_known_no_better_than_the_surface():
    """Of pvc, an exponent of 2: a surface that is 20 µm off is no offset of the force."""
    for seed in range(1000, 1006):
        result = identify(prepare(table_of(hand(6.0, PVC, seed=seed))))
        # Three standard errors of three numbers that hang together, as above.
        away = np.abs(result.law.parameters - PVC.parameters)
        assert (away < 3.0 * result.standard_errors).all()
        assert (result.standard_errors > result.estimate.standard_errors).all()


@pytest.mark.slow
def test_a_table_of_places_is_whole_in_a_narrow_window(capsys, monkeypatch, tmp_path):
    from palpate.cli import main

    monkeypatch.setenv("COLUMNS", "60")
    apart = [hand(3.0, origin=ORIGIN + far) for far in (0.0, np.array([18e-3, 24e-3, 0.0]))]
    position, force = (
        np.vstack([getattr(each, name) for each in apart]) for name in ("position", "force")
    )
    columns = np.column_stack([1e-3 * np.arange(len(position)), position, force])
    file = tmp_path / "robot.csv"
    header = "time_s,x_m,y_m,z_m,Fx_N,Fy_N,Fz_N"
    np.savetxt(file, columns, delimiter=",", header=header, comments="")
    monkeypatch.setattr("sys.argv", ["palpate", "identify", str(file)])
    main()
    said = capsys.readouterr().out
    places = identify(prepare(file)).by_place().stretches
    assert said.count("at x, y, z, mm ") == len(places) == 2
    for part in places:
        stiffness = part.diagnosis.working_depth.stiffness
        error = math.hypot(stiffness.standard_error, stiffness.systematic)
        assert f"stiffness, N/m {with_error(stiffness.value, error)}" in " ".join(said.split())
    assert "…" not in said
    assert max(map(len, said.replace(str(file), "").splitlines())) <= 60
