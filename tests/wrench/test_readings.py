"""A table states neither frame, sign nor order: free air and contact tell them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from robot_logs import IDEAL, STILL, Setup, on_one_clock, simulate
from robots import NORMAL, hand, table_of
from scipy.spatial.transform import Rotation

import palpate
from palpate import Recording, RecordingError, prepare
from palpate.input.channels import Columns
from palpate.input.preparation import Preparation
from palpate.input.preparation.force_frame import measure_payload

SETUP = Setup(seed=5, **IDEAL | {"delay": 0.01})


def table(setup: Setup, form: str = "x, y, z, w", *, base: bool = False) -> Recording:
    """The log of a set-up as a table, with its orientation in a form."""
    log = simulate(setup)
    columns = on_one_clock(log)
    names = [f"pose.orientation.{axis}" for axis in "xyzw"]
    turns = Rotation.from_quat(np.column_stack([columns.pop(name) for name in names]))
    first = np.roll(turns.as_quat(), 1, axis=1)
    forms = {
        "x, y, z, w": (("qx", "qy", "qz", "qw"), turns.as_quat()),
        "w first": (("q1", "q2", "q3", "q4"), first),
        "w last": (("q0", "q1", "q2", "q3"), turns.as_quat()),
        "angles": (("roll", "pitch", "yaw"), turns.as_euler("xyz")),
        "degrees": (("Roll", "Pitch", "Yaw"), turns.as_euler("xyz", degrees=True)),
        "vector": (("rx", "ry", "rz"), turns.as_rotvec()),
    }
    names, values = forms[form]
    if base:
        force = [f"ft.force.{axis}" for axis in "xyz"]
        own = np.column_stack([columns[name] for name in force]) - setup.bias[:3]
        turned = (turns * Rotation.from_matrix(log.mount)).apply(own)
        columns |= dict(zip(force, turned.T, strict=True))
    return Recording(columns | dict(zip(names, values.T, strict=True)), source="log.csv")


@pytest.mark.long
@pytest.mark.parametrize(
    "form, sign",
    [
        *product(("x, y, z, w", "w first"), (1.0, -1.0)),
        *(("w last", 1.0), ("angles", -1.0), ("degrees", 1.0), ("vector", 1.0)),
    ],
)
def test_a_table_is_read_as_it_was_written(form, sign):
    recording, columns = table(replace(SETUP, sign=sign), form), Columns()
    if form == "vector":
        columns = Columns(orientation="rx,ry,rz", orientation_form="rotation-vector")
    payload = measure_payload(recording, Preparation(columns=columns)).payload
    contact = prepare(recording, columns=columns)
    own = contact.prepared.payload  # one rule for both commands
    assert (payload.mass, payload.sign, payload.delay) == (own.mass, own.sign, own.delay)
    assert payload.mass == pytest.approx(SETUP.mass, rel=5e-3)
    assert (payload.sign, payload.mass_mark, payload.mount_mark) == (sign, "trust", "trust")
    turn = Rotation.from_matrix(payload.mount) * Rotation.from_rotvec(np.radians(SETUP.mount)).inv()
    assert np.degrees(turn.magnitude()) < 0.3
    there = palpate.identify(contact).diagnosis.working_depth
    rate = SETUP.stiffness * SETUP.exponent * there.depth ** (SETUP.exponent - 1.0)
    assert there.stiffness.value == pytest.approx(rate, rel=0.02)
    said = [each.message for each in contact.findings if "does not state" in each.message]
    assert any("by the free air it is that of the tool" in words for words in said)
    assert len(said) == (2 if form.startswith("w ") else 1)
    assert all("w, x, y, z" in words for words in said[1:]) == (form != "w last")


@pytest.mark.long
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turns_about_one_axis_leave_the_sign_open(sign):
    setup = replace(SETUP, axes=1, sign=sign, tilt=0.0)
    payload = measure_payload(table(setup), Preparation()).payload
    assert payload.mass == pytest.approx(SETUP.mass, rel=5e-3)
    assert (payload.mass_mark, payload.mount_mark) == ("trust", "with-care")
    assert any("--flip-force" in (each.remedy or "") for each in payload.findings)
    if sign < 0.0:
        flipped = measure_payload(table(setup), Preparation(flip=["force"])).payload
        assert flipped.mount_mark == "trust"


@pytest.mark.long
def test_a_force_in_the_axes_of_the_base_is_read_there():
    recording = table(SETUP, base=True)
    contact, stated = prepare(recording), prepare(recording, force_frame="base")
    assert contact.prepared.payload is None
    np.testing.assert_array_equal(contact.force, stated.force)


def test_ambiguous_wrench_frames_are_asked_for():
    felt = hand(6.0)
    turns = np.tile(Rotation.from_rotvec([0.115, 0.0, 0.0]).as_quat(), (len(felt.time), 1))
    named = {f"q{axis}": turns[:, k] for k, axis in enumerate("xyzw")}
    # In either axes the force points along the motion to 7°, as with a little friction.
    half = Rotation.from_rotvec([-0.0575, 0.0, 0.0]).apply(felt.force)
    recording = table_of(replace(felt, force=half), **named)
    with pytest.raises(RecordingError, match="--force-frame tool if the sensor rotates"):
        prepare(recording)
    for frame, side in (("tool", 1.0), ("base", -1.0)):
        found = prepare(recording, force_frame=frame).prepared.normal.vector
        turned = Rotation.from_rotvec([side * 0.0575, 0.0, 0.0]).apply(NORMAL)
        assert found == pytest.approx(turned, abs=3e-3)
    with pytest.raises(RecordingError, match="--orientation-form rpy for roll"):
        prepare(table(SETUP, "vector"), columns=Columns(orientation="rx,ry,rz"))


def test_the_order_of_a_quaternion_that_never_changes_is_asked():
    still = table(replace(SETUP, presses=0, **STILL), "w first")
    with pytest.raises(RecordingError, match="--orientation q2,q3,q4,q1 for w, x, y, z"):
        measure_payload(still, Preparation())
    stated = Columns(orientation="q2,q3,q4,q1")
    assert measure_payload(still, Preparation(columns=stated)).payload.axes == 0
