"""Faults of a laboratory in a robot's recording: an answer that is off is not trusted."""

import math
from dataclasses import replace

import numpy as np
import pytest
from probing import BALL, PVC
from robots import NORMAL, ORIGIN, hand, table_of

from palpate import Recording, identify, prepare
from palpate.digits import with_error
from palpate.preparation.settings import turned

SIDE = np.cross(NORMAL, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(NORMAL, [0.0, 0.0, 1.0]))
FELT = hand(4.0)


def said(contact, step: str) -> list[str]:
    return [finding.severity for finding in contact.findings if finding.check == step]


def marks(contact) -> set[str]:
    verdict = identify(contact).diagnosis.verdict
    return {verdict.stiffness, verdict.damping, verdict.overall}


def test_a_sound_recording_has_no_doubt_and_a_coarse_one_is_not_taken_for_clipped():
    contact = prepare(table_of(FELT))
    assert not said(contact, "direction")
    assert not said(contact, "saturation")
    coarse = replace(FELT, force=0.05 * np.round(FELT.force / 0.05))
    assert not said(prepare(table_of(coarse)), "saturation")


TURN = np.array([0.0, -0.6 * np.sin(0.35), -0.8 * np.sin(0.35), np.cos(0.35)])
OF_OTHER_AXES = {
    "the force's z is turned": {"force": FELT.force * [1.0, 1.0, -1.0]},
    "the force's x is turned": {"force": FELT.force * [-1.0, 1.0, 1.0]},
    "the position's z is turned": {"position": FELT.position * [1.0, 1.0, -1.0]},
    "the position's x is turned": {"position": FELT.position * [-1.0, 1.0, 1.0]},
    "axes are swapped": {"force": FELT.force[:, [1, 0, 2]]},
    "the tool's frame": {"force": turned(FELT.force, np.tile(TURN, (len(FELT.time), 1)))},
}


@pytest.mark.parametrize("channel", OF_OTHER_AXES.values(), ids=OF_OTHER_AXES)
def test_a_channel_in_other_axes_is_not_to_be_trusted(channel):
    contact = prepare(table_of(replace(FELT, **channel)))
    assert "do-not-trust" in said(contact, "direction")
    assert marks(contact) == {"do-not-trust"}


def test_friction_across_the_motion_calls_for_care_with_both_numbers():
    pressed = BALL.force(FELT.motion.x, FELT.motion.v)
    contact = prepare(table_of(replace(FELT, force=FELT.force + np.outer(0.3 * pressed, SIDE))))
    assert said(contact, "direction") == ["with-care"]
    assert marks(contact) == {"with-care"}


def test_a_given_normal_needs_the_motion_or_the_force_along_it():
    assert "do-not-trust" in said(prepare(table_of(FELT), normal="z"), "direction")
    slid = replace(FELT, position=FELT.position + np.outer(0.3 * FELT.motion.x, SIDE))
    assert said(prepare(table_of(slid), spot=1.0), "direction") == ["with-care"]
    assert not said(prepare(table_of(slid), normal=NORMAL, spot=1.0), "direction")


def test_one_axis_that_is_clipped_is_seen_and_one_that_never_changes_is_not_saturated():
    clipped = FELT.force.copy()
    clipped[:, 2] = np.minimum(clipped[:, 2], 0.6 * clipped[:, 2].max())
    contact = prepare(table_of(replace(FELT, force=clipped)))
    assert said(contact, "saturation") == ["do-not-trust"]
    assert marks(contact) == {"do-not-trust"}
    felt = hand(4.0, normal=np.array([0.0, 0.0, 1.0]), bias=np.zeros(3))
    for value in (0.0, 1.5):
        alone = felt.force * [0.0, 0.0, 1.0] + [value, value, 0.0]
        contact = prepare(table_of(replace(felt, force=alone)))
        assert (said(contact, "saturation"), said(contact, "force axes")) == ([], ["note"])
        assert marks(contact) == {"trust"}


def test_a_tool_that_turns_calls_for_care_with_both_numbers():
    felt = hand(3.0)
    angle = 0.08 * np.sin(2.0 * felt.time)
    quaternions = np.column_stack([np.sin(angle / 2), 0.0 * angle, 0.0 * angle, np.cos(angle / 2)])
    contact = prepare(table_of(felt, **{f"q{k}": quaternions[:, k] for k in range(4)}))
    assert said(contact, "orientation") == ["with-care"]
    assert marks(contact) == {"with-care"}


def test_a_position_that_was_commanded_calls_for_care():
    felt = table_of(FELT).channels
    renamed = {f"{n[:2]}_cmd_m" if n.startswith("p") else n: each for n, each in felt.items()}
    contact = prepare(Recording(renamed))
    assert said(contact, "channels") == ["with-care"]
    assert "commanded, not measured" in contact.findings[0].message
    assert not said(prepare(Recording({**renamed, **felt})), "channels")  # measured is there


def test_options_that_find_nothing_to_act_on_are_named():
    along = Recording({"t": FELT.time, "z_m": -FELT.motion.x, "Fz_N": FELT.force @ NORMAL})
    contact = prepare(along, normal="z", tool_weight=1.0)
    assert [r.message for r in contact.findings if r.check == "options"] == [
        "--normal and --tool-weight did nothing: position and force are not both in space"
    ]
    assert not said(prepare(table_of(FELT), normal=NORMAL), "options")


def test_stiffness_and_parameters_are_known_no_better_than_the_surface():
    """Of pvc, F = K x²: 20 µm of the surface are many errors of a stiffness whose law is known."""
    for seed in range(1000, 1006):
        contact = prepare(table_of(hand(6.0, PVC, seed=seed)))
        result = identify(contact)
        there = result.diagnosis.working_depth
        # Three standard errors: of six runs one is beyond by chance in sixty.
        error = there.stiffness.value - PVC.stiffness_at(there.depth)
        assert abs(error) < 3.0 * there.stiffness.standard_error
        slope = PVC.stiffness * PVC.exponent * (PVC.exponent - 1.0)
        assert there.stiffness.standard_error > 0.9 * slope * contact.surface_deviation
        # A surface that is 20 µm off is no offset of the force; three numbers that hang together.
        away = np.abs(result.law.parameters - PVC.parameters)
        assert (away < 3.0 * result.standard_errors).all()
        assert (result.standard_errors > result.estimate.standard_errors).all()


@pytest.mark.slow
def test_a_table_of_places_is_whole_in_a_narrow_window(capsys, monkeypatch, tmp_path):
    from palpate.cli import main

    monkeypatch.setenv("COLUMNS", "60")
    apart = [hand(3.0, origin=ORIGIN + far) for far in (0.0, np.array([18e-3, 24e-3, 0.0]))]
    columns = np.vstack([np.hstack([each.position, each.force]) for each in apart])
    columns = np.column_stack([1e-3 * np.arange(len(columns)), columns])
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
