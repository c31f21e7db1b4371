"""A delay of the force: found, taken out with its error, and one that jumps midway."""

from dataclasses import replace

import faults
import numpy as np
import pytest

import palpate
from palpate.method.contact import Delay

CLEAN = palpate.HuntCrossley(K=9000.0, B=15000.0, n=1.4)


def recording(late, seed=0, **options) -> palpate.Contact:
    """A probing whose force is late by so much, s, or by a function of time."""
    behind = late(faults.TIME) if callable(late) else late
    force = np.interp(faults.TIME - behind, faults.TIME, faults.FORCE)
    return faults.contact(faults.TIME, faults.X, faults.noisy(force, seed), **options)


def damping_error(diagnosis) -> tuple[float, float]:
    """Error of the damping and its whole bar, of the true damping."""
    at = diagnosis.working_depth
    truth = CLEAN.damping_at(at.depth)
    return at.damping.value / truth - 1.0, at.damping.whole_error / truth


@pytest.mark.parametrize("late", [20e-3, -3e-3, 0.0])
def test_the_remedy_of_a_delay_finds_it_and_the_damping_is_right(late):
    for seed in range(3):
        contact = recording(late, seed, delay="find")
        delay = contact.delay
        assert delay.found
        assert abs(delay.seconds - late) < 3.5 * delay.standard_error < 0.7e-3
        diagnosis = palpate.diagnose(contact)
        error, bar = damping_error(diagnosis)
        assert abs(error) < min(2.0 * bar, 0.04)
        assert "delay" not in [f.check for f in diagnosis.findings if f.severity != "note"]
        [skew] = [finding for finding in diagnosis.findings if finding.check == "skew"]
        assert skew.message.startswith("a delay was taken out: the force was ")


def test_the_remaining_delay_is_stated_in_total():
    diagnosis = palpate.diagnose(recording(20e-3, delay=12e-3))
    [finding] = [each for each in diagnosis.findings if each.check == "delay"]
    assert float(finding.message.split()[3]) == pytest.approx(20.0, abs=0.5)
    assert "in total" in finding.message
    assert "--delay find" in finding.remedy


def test_the_damping_has_the_error_of_a_delay_that_was_passed():
    known, half = (recording(5e-3, delay=each) for each in ((5e-3, 2e-5), 5e-3))
    assert known.delay == Delay(5e-3, 2e-5)
    assert half.delay.standard_error == pytest.approx(0.5 * faults.STEP)
    narrow, wide = (palpate.diagnose(each).working_depth for each in (known, half))
    least = 0.5 * faults.STEP * wide.stiffness.value
    assert narrow.damping.systematic < 0.5 * wide.damping.systematic < 0.5 * least
    # A law that shows the skew knows it better than ± 8 ms, whatever is stated.
    rough = palpate.diagnose(recording(5e-3, delay=(5e-3, 8e-3))).working_depth
    assert least > rough.damping.systematic > wide.damping.systematic


def test_no_clock_error_is_counted_twice():
    contact = recording(0.0)
    stated, by_payload, by_law = (
        palpate.diagnose(replace(contact, delay=Delay(0.0, 1e-4, **origin))).working_depth
        for origin in ({}, {"found": True}, {"found": True, "from_contact": True})
    )
    assert stated == by_payload
    least = 1e-4 * by_law.stiffness.value
    assert stated.damping.systematic < least < by_law.damping.systematic


def test_a_fleet_and_several_files_take_the_same_delay_out():
    contact = recording(5e-3)
    arrays = {name: getattr(contact, name) for name in ("time", "penetration", "force")}
    table = palpate.identify_many(
        time=arrays.pop("time"),
        preparation={"delay": "find"},
        **{name: values[None] for name, values in arrays.items()},
    )
    alone = palpate.identify(palpate.prepare(**{**arrays, "time": contact.time}, delay="find"))
    assert table["B"][0].as_py() == pytest.approx(alone.law.B, rel=1e-9)
    one, other = recording(5e-3, delay=5e-3), recording(5e-3, delay=(5e-3, 2e-3))
    both = palpate.input.preparation.preparing.join_contacts([one, other])
    assert both.delay == other.delay


def test_a_saved_result_has_the_delay_that_was_taken_out(tmp_path, undrawn):
    result = palpate.identify(recording(5e-3, delay="find"))
    result.save(tmp_path)
    assert palpate.load_result(tmp_path).contact.delay == result.contact.delay


def test_a_delay_that_cannot_be_found_is_an_error_that_says_so():
    with pytest.raises(palpate.InvalidParameterError, match="delay must be 'find'"):
        recording(0.0, delay="soon")
    with pytest.raises(palpate.RecordingError, match="there is no contact"):
        faults.contact(faults.TIME, faults.X - 1.0, faults.FORCE, delay="find")
    with pytest.raises(palpate.RecordingError, match="the longest that is looked at"):
        recording(80e-3, delay="find")
    lost = np.where(np.arange(faults.X.size) % 23 == 0, np.nan, faults.X)  # no run of a window
    with pytest.raises(palpate.RecordingError, match="too few samples are in contact"):
        faults.contact(faults.TIME, lost, faults.FORCE, delay="find")


@pytest.mark.parametrize("jump", [-12e-3, 4e-3])
def test_a_skew_that_jumps_is_found_with_its_time(jump):
    diagnosis = palpate.diagnose(recording(lambda time: np.where(time > 3.1, jump, 0.0)))
    [finding] = [each for each in diagnosis.findings if each.check == "skew jump"]
    assert finding.message.startswith("from 3.1")
    assert f"{'later' if jump > 0.0 else 'earlier'}: samples of one channel" in finding.message
    assert "--stop 3.1" in finding.remedy
    error, bar = damping_error(diagnosis)
    assert diagnosis.verdict.damping != "trust"
    assert abs(error) < 2.0 * bar


@pytest.mark.long
def test_a_clean_skew_does_not_jump():
    for seed in range(6):
        for late in (0.0, 5e-3):
            findings = palpate.diagnose(recording(late, seed)).findings
            assert "skew jump" not in [finding.check for finding in findings]


def test_delay_removal_keeps_a_rounded_force_on_its_levels():
    """Interpolated, K, B, n were 3 to 7 bounds off at 8 sigma: the rounding was not taken out."""
    time = np.arange(4000) / 1000.0
    x, v = 3e-3 * np.sin(9.0 * time), 27e-3 * np.cos(9.0 * time)
    later = 3e-3 * np.sin(9.0 * (time - 3.4e-3))
    force = 0.25 * np.round(1e3 * np.maximum(later, 0.0) / 0.25)
    contact = palpate.prepare(time=time, penetration=x, velocity=v, force=force, delay=3.4e-3)
    assert np.array_equal(contact.force, 0.25 * np.round(contact.force / 0.25))
    expected = 3e-3 * np.sin(9.0 * contact.time)
    np.testing.assert_allclose(contact.penetration, expected, atol=1e-7)
    assert np.abs(contact.force - 1e3 * np.maximum(contact.penetration, 0.0)).max() < 0.13
