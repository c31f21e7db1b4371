"""Units, signs, tare, delay and surface that a user corrects, and what is said of them."""

import numpy as np
import pytest

import palpate

TIME = np.arange(0.0, 1.0, 1e-3)
DEPTH = 5e-3 + 2e-3 * np.sin(8.0 * TIME)
FORCE = 1000.0 * DEPTH


def prepared(**corrections) -> palpate.Contact:
    given = {"time": TIME, "penetration": DEPTH, "force": FORCE}
    return palpate.prepare(**{**given, **corrections})


def test_units_bring_channels_to_si():
    contact = prepared(
        time=1e3 * TIME,
        penetration=1e3 * DEPTH,
        force=1e3 * FORCE,
        units={"time": "ms", "penetration": "mm", "force": "mN"},
    )
    np.testing.assert_allclose(contact.time, TIME)
    np.testing.assert_allclose(contact.penetration, DEPTH)
    np.testing.assert_allclose(contact.force, FORCE)
    assert "in mm" in contact.provenance["penetration"]


def test_a_unit_given_has_the_last_word_over_the_recordings():
    channels = {"time_s": TIME, "penetration_m": 1e3 * DEPTH, "force_N": FORCE}
    recording = palpate.Recording(channels, units={"penetration_m": "mm"})
    np.testing.assert_allclose(palpate.prepare(recording).penetration, DEPTH)
    contact = palpate.prepare(recording, units={"penetration": "um"})
    np.testing.assert_allclose(contact.penetration, 1e-3 * DEPTH)


def test_a_turned_penetration_turns_its_velocity():
    v = np.gradient(DEPTH, TIME)
    contact = prepared(penetration=-DEPTH, velocity=-v, force=-FORCE, flip=["force", "penetration"])
    np.testing.assert_array_equal(contact.penetration, DEPTH)
    np.testing.assert_array_equal(contact.velocity, v)
    np.testing.assert_array_equal(contact.force, FORCE)
    assert contact.provenance["force"] == "its sign turned"


def test_a_tare_takes_the_mean_off():
    contact = prepared(force=FORCE + 3.0, tare=(0.2, 0.4))
    inside = (TIME >= 0.2) & (TIME <= 0.4)
    assert contact.force[inside].mean() == pytest.approx(0.0, abs=1e-12)
    assert "from 0.2 s to 0.4 s" in contact.provenance["force"]
    with pytest.raises(palpate.RecordingError, match="no sample between 7 s and 8 s"):
        prepared(tare=(7.0, 8.0))


@pytest.mark.parametrize("late", [5e-3, -3e-3, 2.4e-3])
def test_a_late_force_is_read_earlier(late):
    contact = prepared(force=1000.0 * (5e-3 + 2e-3 * np.sin(8.0 * (TIME - late))), delay=late)
    np.testing.assert_allclose(contact.force, 1000.0 * contact.penetration, atol=1e-4)
    assert len(TIME) - len(contact) == np.ceil(abs(late) / 1e-3)
    assert "ms" in contact.provenance["force"]


def test_a_delay_does_not_reach_from_one_segment_to_the_next():
    segment = (TIME > 0.5).astype(int)
    force = np.where(segment, 100.0, 1.0)
    contact = prepared(force=force, segment=segment, delay=10e-3)
    assert set(contact.force) == {1.0, 100.0}


def test_a_surface_is_where_the_penetration_is_counted_from():
    contact = prepared(surface=1e-3)
    np.testing.assert_allclose(contact.penetration, DEPTH - 1e-3)
    assert "0.001 m" in contact.provenance["penetration"]


@pytest.mark.parametrize(
    "correction, words",
    [
        ({"units": {"depth": "mm"}}, "units must be of time, penetration"),
        ({"units": {"force": "kg"}}, "unit of the force must be one of N"),
        ({"flip": ["velocity"]}, "flip must name some of force, penetration"),
        ({"tare": 3.0}, "tare must be"),
        ({"delay": np.inf}, "delay must be finite"),
        ({"delay": 60.0}, r"delay must be in \[-10, 10\]"),
        ({"surface": "x"}, "surface must be a number"),
    ],
)
def test_a_wrong_correction_is_refused(correction, words):
    with pytest.raises(palpate.InvalidParameterError, match=words):
        prepared(**correction)
