"""What follows from an identified law: rebound, energy lost, and whether it pulls."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from cases import contact_of, exciting, tapping

import palpate
from palpate import Contact, HuntCrossley, KelvinVoigt, QueryOptions, identify
from palpate.digits import percent, with_error
from palpate.identification.quantities.derived import build_path
from palpate.identification.quantities.energy import find_loops
from palpate.input.preparation.touch import find_touches
from palpate.output.results.saved import derived_dict

LAW = faults.LAW


def moved(time, x, law=LAW, **others) -> Contact:
    """A contact along ``x``, without noise."""
    v = np.gradient(x, time)
    return Contact(time, penetration=x, velocity=v, force=law.force(x, v), **others)


def sine(law, *, depth=8e-3, swing=3e-3, rate=7.0, seconds=5.0, noise=0.0, seed=0) -> Contact:
    """One sine about a depth, in contact unless it swings farther."""
    time = 1e-3 * np.arange(round(seconds * 1e3))
    x = depth + swing * np.sin(rate * time)
    v = swing * rate * np.cos(rate * time)
    error = noise * np.random.default_rng(seed).standard_normal(time.size)
    return Contact(time, penetration=x, velocity=v, force=law.force(x, v) + error)


SEEDS = range(40)  # the spread of 40 normal numbers is 1 ± 0.11, their mean 0 ± 0.16


@pytest.fixture(scope="module")
def clean():
    return identify(faults.clean())


def test_every_repr_is_one_line_with_numbers_and_errors(clean):
    modulus = clean.elastic_modulus(palpate.FlatPunch(radius=5e-3))
    quantities = clean.energy, clean.passivity, clean.restitution(), modulus
    for each in (*quantities, clean.law_verdict, clean.estimate, clean.trace):
        words = repr(each)
        assert words.startswith(f"{type(each).__name__}(")
        assert len(words) <= 200, words
        assert "\n" not in words
    lost = clean.energy.measured
    assert with_error(lost.value, lost.whole_error, unit="J measured") in repr(clean.energy)
    assert f"{len(clean.trace)} samples: {clean.trace.taken.sum()} taken" in repr(clean.trace)


def test_the_rebound_defaults_to_the_fastest_approach(clean):
    found = clean.restitution()
    taken = clean.contact.velocity[clean.trace.taken]
    assert 0.98 * taken.max() < found.speed <= taken.max()
    assert found.speed == found.fastest_approach
    assert found.coefficient.value == palpate.restitution(clean.law.dissipation, found.speed)
    assert not found.remarks
    faster = clean.restitution(0.4)
    assert faster.coefficient.value == palpate.restitution(clean.law.dissipation, 0.4)
    assert "extrapolated: no approach in the recording exceeds 0.034 m/s" in faster.remarks[0]
    assert clean.with_query(QueryOptions(impact_speed=0.4)).restitution() == faster
    with pytest.raises(palpate.InvalidParameterError, match="speed must be in"):
        clean.restitution(-1.0)


@pytest.mark.slow
def test_the_error_bars_of_rebound_and_loss_hold_the_truth():
    """White noise of force and, of the loss, depth; of the rebound the bars of variable projection,
    which are ready for any other noise, are somewhat wide.
    """
    linear, rate, swing = KelvinVoigt(K=1500.0, B=8.0), 7.0, 3e-3
    exact = palpate.restitution(LAW.dissipation, 0.3), math.pi * linear.B * rate * swing**2
    deviations = []
    for seed in SEEDS:
        signals = exciting(LAW, seconds=2.0, noise=0.05, seed=seed)
        e = identify(contact_of(signals), law="hunt-crossley").restitution(0.3).coefficient
        # A delay or friction that two seconds do not exclude has a prior: some parts in a thousand.
        assert e.systematic < 0.01 * e.value
        contact = sine(linear, rate=rate, swing=swing, noise=0.05, seed=seed)
        jitter = 5e-6 * np.random.default_rng(1000 + seed).standard_normal(len(contact))
        contact = replace(contact, penetration=contact.penetration + jitter)
        lost = identify(contact, "kelvin-voigt").energy.measured
        found = np.array([[e.value, e.standard_error], [lost.value, lost.standard_error]])
        deviations.append((found[:, 0] - exact) / found[:, 1])
    spread = np.std(deviations, axis=0)
    assert np.all((spread > (0.6, 0.7)) & (spread < (1.2, 1.4)))
    assert np.all(np.abs(np.mean(deviations, axis=0)) < (0.6, 0.5))


def test_the_rebound_has_the_systematic_error_of_the_damping():
    result = identify(faults.late(10e-3))
    e, exact = result.restitution(0.1).coefficient, palpate.restitution(LAW.dissipation, 0.1)
    assert abs(e.value - exact) > 10.0 * e.standard_error  # a force 10 ms late costs half of B
    assert abs(e.value - exact) < 2.0 * e.systematic


def test_negative_or_insignificant_damping_is_reported():
    law = HuntCrossley(K=9000.0, B=9.0, n=1.4)
    found = identify(contact_of(exciting(law, noise=0.5, seed=1))).restitution()
    bound = math.hypot(found.coefficient.standard_error, found.coefficient.systematic)
    assert found.coefficient.value + 2.0 * bound > 1.0
    words = "; ".join(found.remarks)
    assert "not distinguishable from 0" in words or "damping is negative" in words
    # It is not clipped.
    law = HuntCrossley(K=9000.0, B=-9000.0, n=1.4)
    result = identify(contact_of(exciting(law, seconds=4.0, noise=0.01)))
    found = result.restitution()
    assert found.coefficient.value > 1.0
    assert "the law generates energy" in found.remarks[0]
    assert all(math.isnan(e) for e in found.approximations.values())
    drawn = result.restitution(2.0)
    assert math.isnan(drawn.coefficient.value)
    assert "does not rebound" in drawn.remarks[0]
    assert "the law generates energy" in "; ".join(result.energy.remarks)


def test_a_relaxing_law_rebounds_by_its_dynamic_stiffness():
    spectrum = palpate.RelaxationSpectrum((0.1, 0.5), (4000.0, 4000.0))
    law = palpate.GeneralisedHuntCrossley(K=9000.0, n=1.4, B=0.0, p=1.4, relaxation=spectrum)
    plain = exciting(LAW, seconds=6.0, noise=0.0)
    steps = np.full(len(plain.time), plain.time[1] - plain.time[0])
    force = law.force_along(plain.penetration, plain.velocity, steps)
    force += np.random.default_rng(2).normal(0.0, 0.02, force.size)
    result = identify(
        palpate.Contact(
            plain.time, penetration=plain.penetration, velocity=plain.velocity, force=force
        )
    )
    assert result.law.remembers
    there, found = result.diagnosis.working_depth, result.restitution(0.05)
    b = there.damping.value * result.law.n / (there.stiffness.value * there.depth)
    assert found.dissipation.value == pytest.approx(b)
    assert found.coefficient.value == palpate.restitution(found.dissipation.value, 0.05)
    assert found.coefficient.whole_error > 0.0
    assert "same K′ and B′" in found.remarks[0]
    tip = palpate.Sphere(0.1)
    modulus = result.elastic_modulus(tip).value
    whole = complex(law.dynamic_stiffness(there.depth, result.frequency)).real
    expected = 0.75 * (whole * there.depth / 1.4) / tip.force(1.0, there.depth)
    assert abs(modulus.value - expected) < 2.0 * modulus.whole_error
    assert math.isfinite(result.energy.predicted.value)
    assert result.passivity.limit < 0.0


def test_an_export_repeats_the_marks_of_the_diagnosis():
    result = identify(faults.changed(1.0))
    assert result.diagnosis.verdict.damping == "do-not-trust"
    assert "the diagnosis does not trust the damping" in result.restitution().remarks
    remarks = result.elastic_modulus(palpate.Sphere(0.2)).remarks
    assert "the diagnosis does not trust the stiffness" in remarks
    found = identify(faults.clean(), "kelvin-voigt").restitution()
    assert math.isnan(found.coefficient.value)
    [words] = found.remarks
    assert "for the kelvin-voigt law it depends on the body's mass" in words


def test_the_loss_of_a_damper_is_the_area_of_its_ellipse():
    """π B ω a² of a sine; on its way in K x̄ 2a + half of that goes in."""
    law, rate, swing, depth = KelvinVoigt(K=1500.0, B=8.0), 7.0, 3e-3, 8e-3
    contact = sine(law, rate=rate, swing=swing, depth=depth)
    found = identify(contact, "kelvin-voigt").energy
    assert found.kind == "cycle"
    assert len(found.lost) == 4  # whole ones, of five and a half
    loss = math.pi * law.B * rate * swing**2
    # Trapezoids of 1 ms: (ω dt)²/12 = 4e-6 each way.
    np.testing.assert_allclose(found.lost, loss, rtol=1e-4)
    np.testing.assert_allclose(found.predicted_lost, loss, rtol=1e-4)
    goes_in = law.K * depth * 2.0 * swing + 0.5 * loss
    np.testing.assert_allclose(found.put_in_each, goes_in, rtol=1e-4)
    assert found.fraction.value == pytest.approx(loss / goes_in, rel=1e-3)
    np.testing.assert_allclose(found.stop - found.start, 2.0 * math.pi / rate, rtol=1e-5)


def test_a_spring_loses_nothing_however_its_strokes_vary():
    spring = HuntCrossley(K=9000.0, B=0.0, n=1.4)
    found = identify(contact_of(exciting(spring, seconds=6.0))).energy
    assert found.kind == "cycle"
    assert len(found.lost) >= 3
    assert np.all(np.abs(found.lost) < 1e-4 * found.put_in_each)  # trapezoids


def test_a_touch_is_a_loop_from_free_air_to_free_air(clean):
    contact = contact_of(tapping(LAW, seconds=6.0, noise=0.01))
    result = identify(contact)
    found = result.energy
    assert found.kind == "touch"
    whole = [t for t in find_touches(contact) if t.stop < 5.999]
    assert len(found.lost) in (len(whole), len(whole) - 1)  # it may begin in contact
    assert found.measured.value == pytest.approx(found.predicted.value, rel=0.05)
    for start, stop in zip(found.start, found.stop, strict=True):
        ends = np.interp([start, stop], contact.time, contact.penetration)
        assert np.all(ends < 1e-4)
    assert found.as_dict()["loops"] == len(found.lost)
    assert clean.energy.kind == "cycle"  # it stays in contact once it is there


def test_a_loss_that_does_not_go_with_the_speed_is_said():
    """Friction costs a slow cycle as much as a quick one; a damper does not, but for the mean."""
    time = 1e-3 * np.arange(20000)
    phase = np.where(time < 18.0, 3.0 * time, 54.0 + 15.0 * (time - 18.0))
    damped = moved(time, 8e-3 + 3e-3 * np.sin(phase), HuntCrossley(K=9000.0, B=900.0, n=1.4))
    force = damped.force + 0.5 * np.tanh(damped.velocity / 1e-3)
    energy = identify(replace(damped, force=force), "variable-projection").energy
    assert energy.predicted.value == pytest.approx(energy.measured.value, rel=0.1)
    assert energy.predicted_lost[0] < 0.5 * energy.lost[0]
    assert energy.predicted_lost[-1] > 1.5 * energy.lost[-1]
    assert energy.remarks[0].startswith("the law's loss is ")
    assert "% per cycle: the material's loss depends" in energy.remarks[0]


def test_a_loss_that_is_not_the_dampers_is_said():
    """A damper without depth, and a law whose damper has it, tapping."""
    contact = contact_of(tapping(KelvinVoigt(K=1500.0, B=8.0), seconds=6.0, noise=0.01))
    energy = identify(contact, "variable-projection").energy
    accounted = energy.predicted.value / energy.measured.value
    assert accounted < 0.9
    assert energy.remarks == (
        f"the law accounts for {percent(accounted)} of the dissipated energy",
    )


def test_an_approach_alone_closes_no_loop():
    """A force curve: approach and retract are segments, and one touch."""
    time = 1e-3 * np.arange(2000)
    whole = moved(time, 5e-3 * np.sin(math.pi * (time - 0.2) / 1.6))
    split = replace(whole, segment=time > 1.0)
    found, expected = identify(split).energy, identify(whole).energy
    assert found.kind == expected.kind == "touch"
    assert found.measured.value == pytest.approx(expected.measured.value, rel=1e-12)
    later = np.where(time > 1.0, time + 60.0, time)  # what happened between is not known
    inwards = moved(time, 4e-3 * (time / 2.0) ** 2)
    for contact in (replace(split, time=later), inwards):
        found = identify(contact).energy
        assert (found.kind, found.remarks) == (
            "none",
            ("the recording has no complete touch or cycle",),
        )
        assert math.isnan(found.measured.value)


@pytest.mark.parametrize("delay", [2e-3, 10e-3, -5e-3, None])
def test_delay_and_drift_are_in_the_systematic_error_of_the_loss(clean, delay):
    contact, least = clean.contact, 10.0
    if delay is None:
        drift, least = 0.5 * contact.time / contact.time[-1], 2.0
        result = identify(replace(contact, force=contact.force + drift))
        assert "offset drift" in {finding.check for finding in result.diagnosis.findings}
    else:
        # A law with another damper takes a force that is early for its own.
        result = identify(faults.late(delay), "variable-projection")
    found = result.energy.measured
    hidden = clean.energy.measured.value - found.value
    assert delay is None or hidden * delay > 0.0
    assert least * found.standard_error < abs(hidden) < 2.0 * found.systematic
    assert delay is None or clean.energy.measured.systematic < 0.1 * found.systematic


def test_the_steps_of_an_encoder_are_in_the_error_of_the_energy_lost():
    """They go by the place, so that no number of equal loops averages them away."""
    contact = sine(LAW, noise=0.0)
    true = identify(contact).energy.measured.value
    step = 40e-6
    counted = replace(contact, penetration=step * np.floor(contact.penetration / step))
    found = identify(counted).energy.measured
    assert found.systematic > 3.0 * found.standard_error
    assert abs(found.value - true) < 2.0 * math.hypot(found.standard_error, found.systematic)


def test_gaps_and_lost_samples_are_in_no_loop():
    contact = sine(LAW, noise=0.02)
    whole = identify(contact).energy
    gone = contact.taken((contact.time < 2.0) | (contact.time > 2.3))
    cut = identify(gone).energy
    assert len(cut.lost) == len(whole.lost) - 1
    assert not np.any((cut.start < 2.0) & (cut.stop > 2.3))
    force = contact.force.copy()
    force[1000:4000:500] = np.nan
    found = identify(replace(contact, force=force)).energy
    assert found.measured.value == pytest.approx(whole.measured.value, rel=1e-3)


def test_a_spike_in_free_air_is_no_touch():
    time = 1e-3 * np.arange(3000)
    contact = moved(time, 6e-3 * np.sin(4.0 * time - 2.0))
    force = contact.force + 0.02 * np.random.default_rng(0).standard_normal(time.size)
    spiked = np.where(np.arange(time.size) == 3, 30.0, force)
    clean, found = (identify(replace(contact, force=each)).energy for each in (force, spiked))
    assert len(clean.lost) == len(found.lost) == 2
    assert found.measured.value == pytest.approx(clean.measured.value, rel=1e-3)


def test_a_rest_adds_nothing_to_the_work_that_went_in():
    """The probe shakes by 5 µm while it rests: 2000 times 15 N · 5 µm is as much as the stroke."""
    time = 1e-3 * np.arange(4000)
    still = moved(time, 8e-3 * np.clip(np.minimum(time - 0.5, 3.5 - time), -0.1, 0.5) / 0.5)
    shaken = still.penetration + 5e-6 * np.random.default_rng(0).standard_normal(time.size)
    result = identify(replace(still, penetration=shaken))
    path = build_path(result)
    assert len(find_loops(result.contact, path)) == 1
    assert result.energy.put_in == pytest.approx(path.work(still.force)[2000], rel=0.01)


def test_a_hunt_crossley_law_pulls_beyond_one_over_its_dissipation():
    result = identify(sine(HuntCrossley(K=9000.0, B=4e5, n=1.4), noise=0.01))
    found = result.passivity
    assert found.limit == pytest.approx(-9000.0 / 4e5, rel=0.02)
    assert found.fastest_withdrawal == pytest.approx(0.021, rel=0.01)
    assert found.fraction == 0.0
    assert found.lowest_force == 0.0
    assert math.isnan(found.deepest)
    faster = identify(sine(HuntCrossley(K=9000.0, B=6e5, n=1.4), noise=0.01)).passivity
    assert faster.fraction > 0.1
    assert faster.lowest_force < 0.0
    assert faster.lowest_velocity < faster.limit
    assert faster.measured_there < 0.0  # this material, which is none, does pull


def test_a_kelvin_voigt_law_pulls_at_light_touch():
    contact = contact_of(tapping(HuntCrossley(K=1500.0, B=6000.0, n=1.0), seconds=6.0, noise=0.01))
    result = identify(contact, "kelvin-voigt")
    found = result.passivity
    assert found.fraction > 0.0
    deepest = -result.law.B * contact.velocity.min() / result.law.K
    assert 0.0 < found.deepest < deepest
    assert found.measured_there > -0.01
    assert found.measured_fraction < 0.001
    # A recorded force that pulls is counted.
    contact = sine(LAW, noise=0.01)
    lower = replace(contact, force=contact.force - 7.0)
    assert identify(contact, "kelvin-voigt").passivity.measured_fraction == 0.0
    found = identify(lower, "kelvin-voigt").passivity
    # A force within 5 standard deviations of 0, 0.05 N, is passed in a hundredth of the time.
    assert found.measured_fraction == pytest.approx(np.mean(lower.force < 0.0), abs=0.01)
    assert found.measured_fraction > 0.05


@pytest.mark.long
def test_json_has_the_numbers_of_every_method():
    for name, result in palpate.compare(faults.clean()).items():
        whole = json.loads(json.dumps(result.as_dict(), allow_nan=False))
        assert whole["restitution"] == result.restitution().as_dict(), name
        assert whole["energy"] == result.energy.as_dict()
        assert whole["passivity"] == result.passivity.as_dict()
        assert "elastic_modulus" not in whole
        assert math.isfinite(result.energy.predicted.value), name
        assert 0.0 <= result.passivity.fraction <= 1.0, name


def test_the_page_shows_the_keys_that_there_are():
    root = Path(__file__).parents[2]
    page = root / "docs" / "reference" / "results.md"
    [_, shown] = re.findall(
        r"^```text\n(\{.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S
    )
    recording = "examples/recordings/tapping.csv"
    wanted = QueryOptions(impact_speed=0.3, tip=palpate.Cone(math.radians(60.0)))
    numbers = derived_dict(identify(root / recording).with_query(wanted))
    keys = [*numbers, *(key for part in numbers.values() for key in part)]
    keys += ["Flores", "kind", "half_angle", "of_tip"]
    assert sorted(re.findall(r'"(\w+)":', shown)) == sorted(keys)


@pytest.mark.parametrize("seed", range(3))
def test_the_stiffness_after_a_time_is_within_three_bars_of_the_truth(seed):
    """By the noise of 1 % of the force; three standard errors, of six numbers."""
    time = 1e-3 * np.arange(8000)
    depth = 4e-3 + 1.5e-3 * np.sin(4.0 * np.pi * time) + 1e-3 * np.sin(1.1 * time)
    law = palpate.GeneralisedHuntCrossley(
        K=4e4, n=1.5, B=100.0, p=1.5, M=6e4, relaxation=palpate.SingleRelaxation(0.2)
    )
    speed = np.gradient(depth, time)
    force = law.force_along(depth, speed, np.full(time.size, 1e-3))
    force += np.random.default_rng(seed).normal(0.0, 0.01 * force.max(), time.size)
    contact = palpate.Contact(time, penetration=depth, velocity=speed, force=force)
    result = palpate.identify(contact, trace=False)
    assert result.law.remembers
    for after in (0.05, 0.3):
        found = result.stiffness_after(after)
        truth = law.stiffness_after(result.diagnosis.working_depth.depth, after)
        assert abs(found.value - truth) <= 3.0 * found.whole_error
        assert found.whole_error < 0.3 * truth
