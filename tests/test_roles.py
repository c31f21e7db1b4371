"""Which channel is which, time as it was stamped, and two clocks made one."""

import dataclasses

import numpy as np
import pytest
from robots import hand, topics_of

from palpate import MissingChannelError, Recording, RecordingError, prepare
from palpate.preparation import Columns
from palpate.preparation.clocks import gaps, rows_of, signals_of
from palpate.preparation.roles import roles_of, vectors_of

SPACE = {"position": ("px_m", "py_m", "pz_m"), "force": ("fx_N", "fy_N", "fz_N")}


def recording(*names: str, **units: str) -> Recording:
    return Recording({name: np.arange(5.0) for name in names}, units=units, source="r.csv")


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
    assert roles.reasons["force"] == "has this name"


def test_several_that_could_be_it_are_named_with_the_option():
    names = [f"{topic}.wrench.force.{axis}" for topic in ("/left", "/right") for axis in "xyz"]
    both = recording("time", "x", "y", "z", *names)
    words = r"2 channels could be the force: /left\.wrench\.force\.x .*--force"
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
    with pytest.raises(MissingChannelError, match=r"r\.csv: no column 'force_N'; available: t, z$"):
        roles_of(recording("t", "z"))
    with pytest.raises(MissingChannelError, match="no column '/ft'"):
        roles_of(recording("t", "z", "Fz"), Columns(force="/ft"))
    with pytest.raises(RecordingError, match="must name one channel or three"):
        roles_of(recording("t", "z", "Fz"), Columns(force="t,z"))
    # A few numbered or lettered channels are no vector.
    for names in (["a1", "a2", "a3", "a4", "a5"], ["x", "y"], ["q0", "q1"], []):
        assert vectors_of(names) == []


def test_without_a_time_the_rate_has_to_be_given():
    bare = Recording({"depth": np.linspace(0, 1e-3, 50), "Fz": np.linspace(0, 2.0, 50)})
    with pytest.raises(RecordingError, match=r"no channel looks like the time; .*--rate"):
        prepare(bare)
    assert prepare(bare, rate=500.0).time[-1] == 49 / 500.0


RAMP = np.linspace(-1e-3, 9e-3, 200)


STEPS = 1e-3 * np.arange(200)


def table(time) -> Recording:
    depth = RAMP[: len(time)]
    channels = {"time_s": time, "penetration_m": depth, "force_N": 50 * depth}
    return Recording(channels, source="r.csv")


def test_samples_whose_time_does_not_increase_are_skipped_counted_and_said():
    time = STEPS.copy()
    time[50], time[80], time[120] = time[49], 0.0791 - 0.001, np.nan
    contact = prepare(table(time))
    assert len(contact) == 197
    [finding] = contact.findings
    assert finding.message == (
        "palpate skipped 3 of 200 samples: 1 without a time, 1 with the previous time, "
        "1 with an earlier time"
    )
    assert finding.severity == "note"
    with pytest.raises(RecordingError, match=r"sample 50: 0.049 s repeats the previous time"):
        prepare(table(time), strict=True)
    # Many of them call for care.
    many = STEPS.copy()
    many[10::20] = many[9::20]
    contact = prepare(table(many))
    assert len(contact) == 190
    assert contact.findings[0].severity == "with-care"
    # A time that a flipped bit made is none.
    time = STEPS.copy()
    time[[0, 90]] = -1.6e190, 4e200
    contact = prepare(table(time))
    assert len(contact) == 198
    assert "2 without a time" in contact.findings[0].message
    with pytest.raises(RecordingError, match=r"sample 0: -1\.6e"):
        prepare(table(time), strict=True)
    with pytest.raises(RecordingError, match="no sample has a valid time"):
        prepare(table(np.full(200, 1e190)))


def test_a_recorder_that_was_started_again_begins_another_contact():
    time = np.concatenate([STEPS[:120], STEPS[:80]])
    contact = prepare(table(time))
    assert [part.start for part in contact.segments()] == [0, 120]
    assert "the recorder restarted once" in contact.findings[0].message
    with pytest.raises(RecordingError, match=r"sample 120: 0 s runs back from 0.119 s"):
        prepare(table(time), strict=True)
    with pytest.raises(RecordingError, match="the time runs backward"):
        prepare(table(STEPS[::-1]))


def test_a_gap_parts_contacts_and_a_change_of_rate_does_not():
    part = np.zeros(300, dtype=np.int64)
    steps = np.where(np.arange(299) < 150, 1e-4, 5e-3)
    assert not gaps(np.concatenate([[0], np.cumsum(steps)]), part).any()
    steps = np.full(299, 1e-3)
    steps[[60, 200]] = 0.05
    assert np.flatnonzero(gaps(np.concatenate([[0], np.cumsum(steps)]), part)).tolist() == [61, 201]
    contact = prepare(table(np.concatenate([STEPS[:100], 2.0 + STEPS[:100]])))
    assert [part.start for part in contact.segments()] == [0, 100]
    assert "a gap in time, 1.9 s" in contact.findings[0].message


def test_whole_nanoseconds_stay_exact():
    stamp = 1_700_000_000_000_000_000 + 1_000_000 * np.arange(200) + np.arange(200) % 3
    channels = {"stamp": stamp, "penetration_m": RAMP, "force_N": RAMP}
    contact = prepare(Recording(channels, units={"stamp": "ns"}))
    np.testing.assert_array_equal(contact.time, 1e-9 * (stamp - stamp[0]))
    assert rows_of(stamp).skipped == 0


@pytest.mark.parametrize("every", [1, 4])
def test_the_faster_of_two_clocks_is_interpolated_at_the_times_of_the_slower(every):
    recorded = topics_of(hand(2.0), every=every)
    signals = signals_of(recorded, roles_of(recorded))
    assert np.median(np.diff(signals.time)) == pytest.approx(every * 1e-3)
    assert every == 1 or "at the times of '/pose" in signals.made["force"]
    # A straight line between two samples 1 ms apart is off by ẍ Δt²/8 at most: some 40 nm here.
    truth = hand(2.0)
    along = np.interp(signals.time, truth.time, truth.position[:, 2])
    assert np.median(np.abs(signals.depth[:, 2] - along)) < 2e-6


def changed(recorded: Recording, **channels) -> Recording:
    return dataclasses.replace(recorded, channels={**recorded.channels, **channels})


def test_no_sample_is_made_up_in_a_gap_of_the_other_clock():
    recorded = topics_of(hand(2.0))
    keep = (np.arange(2000) < 600) | (np.arange(2000) >= 900)
    ft = {name: each[keep] for name, each in recorded.channels.items() if name.startswith("/ft")}
    cut = changed(recorded, **ft)
    signals = signals_of(cut, roles_of(cut))
    inside = (signals.time > 0.6005) & (signals.time < 0.899)
    assert not inside.any()
    assert np.unique(signals.part).size == 2


def test_clocks_without_a_time_in_common_or_of_another_length_are_refused():
    recorded, name = topics_of(hand(1.0)), "/pose.header.stamp"
    apart = changed(recorded, **{name: recorded.channels[name] + 10_000_000_000})
    with pytest.raises(RecordingError, match="do not overlap"):
        prepare(apart)
    short = {"time_s": np.arange(5.0), "penetration_m": np.arange(4.0), "force_N": np.arange(5.0)}
    with pytest.raises(RecordingError, match="'time_s' has 5, depth has 4"):
        prepare(Recording(short))
