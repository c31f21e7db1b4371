"""Which channel is which: by its name, its unit, or the one that it can only be."""

import numpy as np
import pytest

from palpate import MissingChannelError, Recording, RecordingError, prepare
from palpate.preparation import Columns, roles_of
from palpate.preparation.roles import vectors_of

SPACE = {"position": ("px_m", "py_m", "pz_m"), "force": ("fx_N", "fy_N", "fz_N")}


def recording(*names: str, **units: str) -> Recording:
    values = {name: np.arange(5.0) for name in names}
    return Recording(values, units=units, source="r.csv")


WRITTEN = "time_s penetration_m force_N velocity_m_s segment"
BRACKETS = "Time [s];Displacement (mm);Force [mN]"
COMMANDED = "time_s position_command_m position_m force_N"
ARRAYS = "time " + " ".join([f"pos[{k}]" for k in range(3)] + [f"wrench[{k}]" for k in range(6)])
MESSAGE = ["wrench.force", "wrench.torque", "pose.position"]
TABLES = {
    "the names that palpate writes": (WRITTEN, "penetration_m", "force_N"),
    "a script's own": ("t depth_mm Fz", "depth_mm", "Fz"),
    "units in brackets": (BRACKETS, "Displacement (mm)", "Force [mN]"),
    "a testing machine's": ("Time/s;Indentation/mm;Load/N", "Indentation/mm", "Load/N"),
    "a robot's, in space": ("time px_m py_m pz_m fx_N fy_N fz_N q0 q1 q2 q3", *SPACE.values()),
    "what was commanded beside it": (COMMANDED, "position_m", "force_N"),
    "a wrench with its torque": ("t x y z Fx Fy Fz Mx My Mz", tuple("xyz"), ("Fx", "Fy", "Fz")),
    "arrays": (
        ARRAYS,
        tuple(f"pos[{k}]" for k in range(3)),
        tuple(f"wrench[{k}]" for k in range(3)),
    ),
    "a flattened message": (
        " ".join(["%time", *(f"field.{each}.{axis}" for each in MESSAGE for axis in "xyz")]),
        tuple(f"field.pose.position.{axis}" for axis in "xyz"),
        tuple(f"field.wrench.force.{axis}" for axis in "xyz"),
    ),
}


@pytest.mark.parametrize("names, depth, force", TABLES.values(), ids=TABLES)
def test_the_channels_are_known_by_their_names(names, depth, force):
    split = names.split(";") if ";" in names else names.split()
    roles = roles_of(recording(*split))
    assert roles.depth == (depth if isinstance(depth, tuple) else (depth,))
    assert roles.force == (force if isinstance(force, tuple) else (force,))
    assert roles.time == split[0]
    counted = ("penetration", "depth", "Indentation")
    assert roles.is_penetration == roles.depth[0].startswith(counted)


def test_a_unit_tells_what_a_name_does_not_and_reasons_are_given():
    roles = roles_of(recording("t", "a", "b", a="mm", b="mN"))
    assert (roles.depth, roles.force) == (("a",), ("b",))
    roles = roles_of(recording("time", *SPACE["position"], "force_N"))
    assert roles.reasons["position"].startswith("the only position in space")
    assert roles.reasons["force"] == "it has this name"


def test_several_that_could_be_it_are_named_with_the_option():
    names = [f"{topic}.wrench.force.{axis}" for topic in ("/left", "/right") for axis in "xyz"]
    both = recording("time", "x", "y", "z", *names)
    words = r"2 could be the force: /left\.wrench\.force\.x .*--force"
    with pytest.raises(RecordingError, match=words):
        roles_of(both)
    for name in ("/left", "/left.wrench", "/left.wrench.force", ",".join(names[:3])):
        assert roles_of(both, Columns(force=name)).force == tuple(names[:3])


def test_of_several_orientations_the_positions_own_topic_has_the_right_one():
    places = [f"{topic}.pose.position.{axis}" for topic in ("/camera", "/arm") for axis in "xyz"]
    turns = [name.replace("position", "orientation") for name in places]
    turns += [f"{topic}.pose.orientation.w" for topic in ("/camera", "/arm")]
    force = [f"/ft.wrench.force.{axis}" for axis in "xyz"]
    both = recording("time", *places, *turns, *force)
    for name in ("/arm", "/arm.pose.position"):
        own = roles_of(both, Columns(position=name)).orientation
        assert own == tuple(f"/arm.pose.orientation.{axis}" for axis in "xyzw")
    given = roles_of(both, Columns(position="/arm", orientation="/camera")).orientation
    assert given == tuple(f"/camera.pose.orientation.{axis}" for axis in "xyzw")


def test_what_is_not_there_is_said_with_what_is():
    with pytest.raises(MissingChannelError, match=r"r\.csv: no column 'force_N'; there are t, z$"):
        roles_of(recording("t", "z"))
    with pytest.raises(MissingChannelError, match="no column '/ft'"):
        roles_of(recording("t", "z", "Fz"), Columns(force="/ft"))
    with pytest.raises(RecordingError, match="must be one channel or three"):
        roles_of(recording("t", "z", "Fz"), Columns(force="t,z"))
    # A few numbered or lettered channels are no vector.
    for names in (["a1", "a2", "a3", "a4", "a5"], ["x", "y"], ["q0", "q1"], []):
        assert vectors_of(names) == []


def test_without_a_time_the_rate_has_to_be_given():
    bare = Recording({"depth": np.linspace(0, 1e-3, 50), "Fz": np.linspace(0, 2.0, 50)})
    with pytest.raises(RecordingError, match=r"no channel looks like the time; .*--rate"):
        prepare(bare)
    assert prepare(bare, rate=500.0).time[-1] == 49 / 500.0
