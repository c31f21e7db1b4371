"""Units, signs, tare, delay and surface that a user corrects, and what is said of them."""

import re

import numpy as np
import pytest

import palpate
from palpate.input.channels import choose_roles
from palpate.input.channels.signals import build_signals

TIME = np.arange(0.0, 1.0, 1e-3)
DEPTH = 5e-3 + 2e-3 * np.sin(8.0 * TIME)
FORCE = 1000.0 * DEPTH


def prepared(**corrections) -> palpate.Contact:
    given = {"time": TIME, "penetration": DEPTH, "force": FORCE}
    return palpate.prepare(**{**given, **corrections})


def test_units_bring_channels_to_si():
    milli = {"time": 1e3 * TIME, "penetration": 1e3 * DEPTH, "force": 1e3 * FORCE}
    contact = prepared(**milli, units={"time": "ms", "penetration": "mm", "force": "mN"})
    for name, expected in {"time": TIME, "penetration": DEPTH, "force": FORCE}.items():
        np.testing.assert_allclose(getattr(contact, name), expected)
    assert "in mm" in contact.provenance["penetration"]


def test_a_unit_given_has_the_last_word_over_the_recordings():
    channels = {"time_s": TIME, "penetration_m": 1e3 * DEPTH, "force_N": FORCE}
    recording = palpate.Recording(channels, units={"penetration_m": "mm"})
    contact = palpate.prepare(recording)
    np.testing.assert_allclose(contact.penetration, DEPTH)
    assert contact.provenance["penetration"] == "column 'penetration_m', in mm"
    contact = palpate.prepare(recording, units={"position": "um"})
    np.testing.assert_allclose(contact.penetration, 1e-3 * DEPTH)


def of_columns(depth: str, force: str, size: float = 1.0, metres: float = 1.0, **settings):
    channels = {"time_s": TIME, depth: DEPTH / metres, force: FORCE / size}
    return palpate.prepare(palpate.Recording(channels, source="r.csv"), **settings)


IN_POUNDS = 4.4482216152605  # N, of one pound-force
FORCES = {
    "Load (gf)": 9.80665e-3, "Load (kgf)": 9.80665, "Load [lbf]": IN_POUNDS, "force_mN": 1e-3,
    "Fz_ozf": IN_POUNDS / 16.0, "Force/cN": 1e-2, "Fz (dN)": 0.1,
    # What is no unit leaves the force in newtons.
    "Force (filtered)": 1.0, "force_N (column 3)": 1.0, "Fz (tool)": 1.0, "fz_tool": 1.0,
}  # fmt: skip
MASSES = {
    "Load (g)": 9.80665e-3, "load_kg": 9.80665, "Load (lb)": IN_POUNDS, "Load [oz]": IN_POUNDS / 16,
    "Fz [mg]": 9.80665e-6,
}  # fmt: skip
HEADERS = FORCES | MASSES


@pytest.mark.parametrize("header, size", HEADERS.items(), ids=HEADERS)
def test_the_unit_that_a_header_states_is_read(header, size):
    contact = of_columns("penetration_m", header, size)
    np.testing.assert_allclose(contact.force, FORCE, rtol=1e-12)
    assert [finding.check for finding in contact.findings] == ["units"] * (header in MASSES)
    for inches, metres in {"depth_in": 25.4e-3, "Depth (mil)": 25.4e-6}.items():
        contact = of_columns(inches, header, size, metres)
        np.testing.assert_allclose(contact.penetration, DEPTH, rtol=1e-12)


NO_FORCES = {"Load (counts)": "counts", "force_MPa": "MPa", "Force [%]": "%", "Fz (V)": "V"}


@pytest.mark.parametrize("header, unit", NO_FORCES.items())
def test_a_unit_that_is_not_a_force_is_refused_with_the_option(header, unit):
    column = rf"r.csv: column {re.escape(repr(header))}: palpate cannot convert the unit"
    words = rf"{column} {re.escape(unit)} of the force .*--unit force=N"
    with pytest.raises(palpate.RecordingError, match=words):
        of_columns("penetration_m", header)
    contact = of_columns("penetration_m", header, 0.0098, units={"force": "0.0098N"})
    np.testing.assert_allclose(contact.force, FORCE, rtol=1e-12)


def test_each_component_of_a_force_is_in_its_own_unit():
    space = {f"p{axis}_m": DEPTH for axis in "xyz"}
    force = {"fx [N]": FORCE, "fy [mN]": 1e3 * FORCE, "fz [gf]": FORCE / 9.80665e-3}
    recording = palpate.Recording({"time_s": TIME, **space, **force})
    roles = choose_roles(recording, palpate.Columns(force=",".join(force)))
    signals = build_signals(recording, roles)
    np.testing.assert_allclose(signals.force, np.column_stack([FORCE] * 3), rtol=1e-12)


def test_values_that_no_sensor_shows_are_no_numbers():
    table = {"time_s": TIME, "penetration_m": DEPTH.copy(), "force_N": FORCE.copy()}
    for name in ("penetration_m", "force_N"):
        table[name][[3, 500]] = 1e155, -1e300
    result = palpate.identify(palpate.Recording(table))
    sentences = " ".join(finding.message for finding in result.diagnosis.findings)
    words = r"excluded 2 samples of '\w+' without a usable number: '1e\+155'"
    assert len(re.findall(words, sentences)) == 2
    assert result.estimate.law.stiffness_at(5e-3) == pytest.approx(1000.0, rel=1e-3)
    with pytest.raises(palpate.RecordingError, match="no sample has a number in"):
        palpate.identify(palpate.Recording({**table, "penetration_m": 1e200 * DEPTH}))
    for size in (1e157, 1e300):
        contact = palpate.Contact(TIME, penetration=size * DEPTH, force=FORCE, velocity=0.0 * TIME)
        with pytest.raises(palpate.RecordingError, match="the penetration reaches"):
            palpate.identify(contact)


def test_a_turned_penetration_turns_its_velocity():
    v = np.gradient(DEPTH, TIME)
    contact = prepared(penetration=-DEPTH, velocity=-v, force=-FORCE, flip=["force", "penetration"])
    np.testing.assert_array_equal(contact.penetration, DEPTH)
    np.testing.assert_array_equal(contact.velocity, v)
    np.testing.assert_array_equal(contact.force, FORCE)
    assert contact.provenance["force"] == "sign reversed"


def test_a_tare_takes_the_mean_off_and_a_surface_is_counted_from():
    contact = prepared(force=FORCE + 3.0, tare=(0.2, 0.4), surface=1e-3)
    inside = (TIME >= 0.2) & (TIME <= 0.4)
    assert contact.force[inside].mean() == pytest.approx(0.0, abs=1e-12)
    assert "from 0.2 s to 0.4 s" in contact.provenance["force"]
    np.testing.assert_allclose(contact.penetration, DEPTH - 1e-3)
    assert "0.001 m" in contact.provenance["penetration"]
    with pytest.raises(palpate.InvalidParameterError, match="unit of the force must be one of N"):
        prepared(units={"force": "MPa"})
    with pytest.raises(palpate.RecordingError, match="no sample between 7 s and 8 s"):
        prepared(tare=(7.0, 8.0))


@pytest.mark.parametrize("late", [5e-3, -3e-3, 2.4e-3])
def test_a_late_force_is_read_earlier(late):
    contact = prepared(force=1000.0 * (5e-3 + 2e-3 * np.sin(8.0 * (TIME - late))), delay=late)
    np.testing.assert_allclose(contact.force, 1000.0 * contact.penetration, atol=1e-4)
    assert len(TIME) - len(contact) == np.ceil(abs(late) / 1e-3)
    assert "ms" in contact.provenance["force"]
    # It does not reach from one segment to the next.
    segment = (TIME > 0.5).astype(int)
    contact = prepared(force=np.where(segment, 100.0, 1.0), segment=segment, delay=late)
    assert set(contact.force) == {1.0, 100.0}
