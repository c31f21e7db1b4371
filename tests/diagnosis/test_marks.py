"""Marks and systematic parts: what misfit, undetected causes, free air and filters add to a bar."""

import math

import faults
import numpy as np
import pytest
from scipy.signal import butter, lfilter

import palpate
from palpate.digits import percent
from palpate.findings import Check, NextStep, Remedy
from palpate.identification.diagnosis.bars import BarPart, best_remedy
from palpate.identification.diagnosis.causes import FACTOR, NUISANCES, remaining_part
from palpate.input.preparation.velocity import estimate_velocities, filter_gain, velocity_of

LAW = faults.LAW
Floats = np.ndarray


def touches(rate: float = 500.0, seconds: float = 6.0) -> tuple[Floats, Floats, Floats]:
    """Time, penetration and velocity of touches through the surface, 1.3 a second, 8 mm deep."""
    time = np.arange(round(rate * seconds)) / rate
    turn = 2.0 * math.pi * 1.3
    x = 2e-3 - 6e-3 * np.cos(turn * time) + 0.6e-3 * np.sin(2.7 * turn * time)
    v = turn * (6e-3 * np.sin(turn * time) + 2.7 * 0.6e-3 * np.cos(2.7 * turn * time))
    return time, x, v


def found(
    time: Floats, x: Floats, force: Floats, **options
) -> palpate.identification.diagnosis.Diagnosis:
    contact = palpate.prepare(time=time, penetration=x, force=force, **options)
    return palpate.identify(contact).diagnosis


def in_bars(diagnosis, *, bars: float = 3.0) -> None:
    there = diagnosis.working_depth
    truth = LAW.stiffness_at(there.depth), LAW.damping_at(there.depth)
    for quantity, true in zip((there.stiffness, there.damping), truth, strict=True):
        assert abs(quantity.value - true) < bars * quantity.whole_error


def slow(kind: str, count: int, rate: float) -> Floats:
    """Noise of unit variance that a sensor's filter has passed."""
    random = np.random.default_rng(7).standard_normal(count + 3000)
    if kind == "AR(1) 0.95":
        return lfilter([math.sqrt(1.0 - 0.95**2)], [1.0, -0.95], random)[3000:]
    b, a = butter(2, float(kind.split()[1]) / (0.5 * rate))
    passed = lfilter(b, a, random)[3000:]
    return passed / passed.std()


@pytest.mark.parametrize("kind", ["AR(1) 0.95", "low-pass 20 Hz", "low-pass 100 Hz"])
def test_a_sensor_that_filters_its_noise_is_trusted(kind):
    time, x, v = touches()
    force = faults.pushed(x, v)
    noise = 0.004 * force.max() * slow(kind, force.size, 500.0)
    diagnosis = found(time, x, force + noise)
    assert diagnosis.verdict.overall == "trust"
    in_bars(diagnosis)


def test_noise_in_proportion_to_the_force_is_trusted():
    time, x, v = touches()
    noise = np.random.default_rng(3).standard_normal(time.size)
    diagnosis = found(time, x, faults.pushed(x, v) * (1.0 + 0.01 * noise))
    assert diagnosis.verdict.overall == "trust"
    in_bars(diagnosis)


def test_heavy_tails_are_no_spikes():
    time, x, v = touches()
    force = faults.pushed(x, v)
    noise = 0.005 * force.max() * np.random.default_rng(4).standard_t(3, force.size) / math.sqrt(3)
    assert found(time, x, force + noise).verdict.overall == "trust"


def play(x: Floats, width: float) -> Floats:
    """What follows x with a play of a width to each side."""
    followed, at = np.empty_like(x), x[0]
    for k, value in enumerate(x):
        at = min(max(at, value - width), value + width)
        followed[k] = at
    return followed


@pytest.mark.parametrize("part", [0.01, 0.03])
def test_a_misfit_is_in_the_bars(part):
    """Hysteresis of the sensor, which no column describes."""
    time, x, v = touches()
    force = play(faults.pushed(x, v), part * 20.0)
    diagnosis = found(time, x, force + 0.02 * np.random.default_rng(5).standard_normal(force.size))
    there = diagnosis.working_depth
    assert diagnosis.verdict.overall != "trust"
    assert there.damping.systematic > 5.0 * there.damping.standard_error
    in_bars(diagnosis)


def test_a_law_flat_at_the_working_depth_takes_no_misfit(monkeypatch):
    """As a registered law with a plateau may be: its stiffness there is 0, beside a force."""
    monkeypatch.setattr(palpate.identification.diagnosis.fit.Fit, "stiffness", lambda fit, law: 0.0)
    there = palpate.diagnose(faults.clean(1)).working_depth
    assert math.isfinite(there.stiffness.systematic)


def test_friction_that_is_not_detected_is_in_the_bar_of_the_damping():
    """A short, noisy press at 50 Hz: friction of 2 % moves the damping, and is not significant."""
    time = np.arange(150) / 50.0
    turn = 2.0 * math.pi / 3.0
    x = -1e-3 + 4.5e-3 * (1.0 - np.cos(turn * time))
    v = 4.5e-3 * turn * np.sin(turn * time)
    force = faults.pushed(x, v)
    force = force + 0.02 * force.max() * np.tanh(v / 1e-4) * (x > 0.0)
    force = force + 0.015 * force.max() * np.random.default_rng(2).standard_normal(force.size)
    diagnosis = found(time, x, force)
    assert not any(f.check == "friction" and f.z > 4.5 for f in diagnosis.findings)
    damping = diagnosis.working_depth.damping
    assert damping.systematic > damping.standard_error
    in_bars(diagnosis)


def test_a_cable_force_is_found_and_widens_the_stiffness_bar():
    time, x, v = touches()
    force = faults.pushed(x, v) + 150.0 * x
    diagnosis = found(time, x, force + 0.02 * np.random.default_rng(6).standard_normal(force.size))
    assert "free air" in [finding.check for finding in diagnosis.findings]
    stiffness = diagnosis.working_depth.stiffness
    assert stiffness.systematic == pytest.approx(150.0, rel=0.2)
    in_bars(diagnosis)


@pytest.mark.parametrize("bend", [0.05, 0.25])
def test_a_sensor_with_a_curved_gain_is_found_and_in_the_bars(bend):
    """The stiffness is off by about as much as the gain changes, so 5 % may be trusted."""
    time, x, v = touches()
    force = faults.pushed(x, v)
    force = force * (1.0 + bend * force / force.max())
    diagnosis = found(time, x, force + 0.02 * np.random.default_rng(8).standard_normal(force.size))
    assert (diagnosis.verdict.stiffness == "trust") == (bend == 0.05)
    assert "sensor gain" in [finding.check for finding in diagnosis.findings]
    in_bars(diagnosis)


def test_a_wrong_surface_keeps_trust_only_if_it_explains_the_force():
    apart = faults.surface_off(0.5e-3)
    surface = palpate.diagnose(apart).findings[0]
    assert (surface.check, surface.stiffness) == ("surface", "trust")
    assert "hardly at all" in surface.message
    bent = faults.recorded(faults.FORCE - 0.9 * np.maximum(faults.FORCE / 10.0 - 0.6, 0.0))
    assert not any("hardly at all" in each.message for each in palpate.diagnose(bent).findings)


def test_the_law_tells_what_the_recording_does_not_contain():
    """10° off axis keeps cos²·⁴ of the stiffness of a law with n = 1.4, cos³·⁴ of the damping."""
    notes = {each.check: each for each in palpate.diagnose(faults.clean()).findings}
    lost = [percent(1.0 - math.cos(math.radians(10.0)) ** (1.4 + k)) for k in (1, 2)]
    assert all(part in notes["unseen"].message for part in lost)
    assert notes["unseen"].severity == "note"


@pytest.mark.parametrize("hertz", [25.0, 50.0])
def test_a_link_that_resonates_is_named_with_its_frequency(hertz):
    """Behind it the tip moves by x − ẍ/ω₀²; without noise the motion's 1 to 4 Hz show it to 5 %."""
    time, x, v = touches()
    tip = x - np.gradient(v, time) / (2.0 * np.pi * hertz) ** 2
    diagnosis = found(time, x, faults.pushed(tip, np.gradient(tip, time)))
    inertia = next(each for each in diagnosis.findings if each.check == "inertia")
    assert float(inertia.message.split()[-2]) == pytest.approx(hertz, rel=0.05)
    in_bars(diagnosis)


def test_a_wide_bar_of_an_uncertain_surface_says_so():
    contact = faults.clean()
    channels = {
        name: getattr(contact, name) for name in ("time", "penetration", "velocity", "force")
    }
    uncertain = palpate.Contact(**channels, surface_deviation=2e-3)
    reasons = [palpate.diagnose(each).working_depth.damping.reason for each in (contact, uncertain)]
    assert "surface" not in reasons[0]
    assert "by the standard error of the surface" in reasons[1]


# Priors: what the recording does not show.


def test_a_nuisance_error_is_at_most_its_prior():
    """Unseen 1.3 √π p; found all of it; excluded to s ≪ p less than s."""
    prior = NUISANCES[Check.SLOW_CHANGE]

    def left(amount: float, error: float) -> float:
        return amount * remaining_part(None, Check.SLOW_CHANGE, amount, amount / error)

    unseen = FACTOR * math.sqrt(prior.odds) * prior.width
    assert left(prior.width, 100.0 * prior.width) == pytest.approx(unseen, rel=0.01)
    assert left(prior.width, 0.1 * prior.width) == pytest.approx(prior.width, rel=0.01)
    assert left(0.01 * prior.width, 0.01 * prior.width) < 0.003 * prior.width
    assert remaining_part(None, Check.MEMORY, 1.0, 10.0) == 0.0


def test_the_next_step_is_the_one_that_lowers_the_bar_most():
    """Two parts of 0.8 with one remedy are more than one of 1; of what is detected one counts."""
    first, second = Remedy(NextStep.MOVE_MORE), Remedy(NextStep.VARY_SPEED)
    parts = [BarPart(np.array([1.0, 0.0]), "a", first)]
    parts += [BarPart(np.array([0.8, 0.0]), "b", second)] * 2
    assert best_remedy(None, parts, 0) is second
    parts[1:] = [part._replace(detected=True) for part in parts[1:]]
    assert best_remedy(None, parts, 0) is first


def test_a_step_that_is_not_predicted_to_lower_the_bar_is_not_advised():
    """Half of the recording costs more by noise than the drift did."""
    parts = [BarPart(np.array([1.0, 0.0]), "a", None)]
    parts += [BarPart(np.array([0.8, 0.0]), "b", Remedy(NextStep.TWO_HALVES, 3), detected=True)]
    assert best_remedy(None, parts, 0) is None


def saturates(force: Floats, x: Floats, v: Floats) -> Floats:
    """A sensor whose gain falls toward its limit."""
    return 1.2 * force.max() * np.tanh(force / (1.2 * force.max()))


def bottoms_out(force: Floats, x: Floats, v: Floats) -> Floats:
    """A stop at 60 % of the depth, four times as stiff."""
    knee = 0.6 * x.max()
    return force + 4.0 * LAW.stiffness_at(knee) * np.maximum(x - knee, 0.0)


@pytest.mark.parametrize("fault", [saturates, bottoms_out])
def test_an_unlisted_true_law_costs_the_stiffness_its_trust(fault):
    time, x, v = touches()
    force = fault(faults.pushed(x, v), x, v)
    noise = 0.003 * force.max() * np.random.default_rng(2).standard_normal(force.size)
    diagnosis = found(time, x, force + noise)
    assert diagnosis.verdict.stiffness != "trust"
    assert "unknown law" in [finding.check for finding in diagnosis.findings]


def test_a_law_that_relaxes_needs_a_withdrawal_or_a_hold():
    """0.4 s of loading alone, faster and faster."""
    time = np.arange(400) * 1e-3
    x = -1e-3 + 9e-3 * (time / 0.4) ** 2
    force = np.interp(x, np.linspace(0.0, 8e-3, 400), 4.0 * np.linspace(0.0, 1.0, 400) ** 1.3)
    relaxed = force - 0.3 * lfilter([0.02], [1.0, -0.98], force)
    result = palpate.identify(time=time, penetration=x, force=faults.noisy(relaxed))
    assert result.selected.law.relaxes
    assert not result.law.relaxes


def test_a_too_small_velocity_widens_the_bar_of_the_damping():
    """By 3 % of the damping, which is no reason to distrust it."""
    time, x, v = touches()
    force = faults.noisy(faults.pushed(x, v))
    diagnosis = found(time, x, force, velocity=0.97 * v)
    damping = diagnosis.working_depth.damping
    assert damping.systematic == pytest.approx(0.045 * damping.value, rel=0.7)
    assert diagnosis.verdict.damping == "trust"
    in_bars(diagnosis)


def thrown(mass: float, beyond: float) -> tuple[Floats, Floats, Floats]:
    """Time, penetration and force of a mass at 0.5 m/s, of which a part moves beyond the sensor."""
    step, x, v, rows = 2e-5, -4e-3, 0.5, []
    while v > -0.3 or x > -4e-3:
        force = float(LAW.force(x, v)) if x > 0.0 else 0.0
        v -= step * max(force, 0.0) / mass
        x += step * v
        rows.append((x, (1.0 - beyond / mass) * max(force, 0.0)))
    x, force = np.array(rows)[::10].T
    noise = np.random.default_rng(12).standard_normal(x.size)
    return 10.0 * step * np.arange(x.size), x, force + 1e-3 * force.max() * noise


def test_an_impact_needs_the_mass_beyond_the_sensor():
    time, x, force = thrown(0.5, 0.1)
    unknown, known = found(time, x, force), found(time, x, force, mass=0.1)
    checks = [{each.check for each in one.findings} for one in (unknown, known)]
    assert ["moving mass" in each for each in checks] == [True, False]
    assert unknown.verdict.stiffness == "with-care"
    errors = [
        abs(one.working_depth.stiffness.value / LAW.stiffness_at(one.working_depth.depth) - 1.0)
        for one in (unknown, known)
    ]
    assert errors[0] == pytest.approx(0.2, abs=0.03)  # the part of the mass beyond
    assert errors[1] < 0.03


def test_one_press_has_the_scatter_of_presses_in_its_bar():
    time = np.arange(2000) / 1000.0
    x = -1e-3 + 4.5e-3 * (1.0 - np.cos(math.pi * time))
    force = faults.pushed(x, np.gradient(x, time))
    for repeats, part in ((1, 0.07), (4, 0.0)):
        clock = np.arange(2000 * repeats) / 1000.0
        stiffness = found(clock, np.tile(x, repeats), faults.noisy(np.tile(force, repeats)))
        stiffness = stiffness.working_depth.stiffness
        assert stiffness.systematic == pytest.approx(
            part * stiffness.value, abs=0.01 * stiffness.value
        )


def test_a_strongly_curved_force_is_the_material_not_the_sensor():
    time, x, v = touches()
    force = faults.pushed(x, v)
    force = force * (1.0 + 0.6 * (force / force.max()) ** 2)
    diagnosis = found(time, x, force + 0.02 * np.random.default_rng(8).standard_normal(force.size))
    assert "sensor gain" not in [finding.check for finding in diagnosis.findings]
    assert "its sign is open" not in diagnosis.reason


# The velocity filter at low rates.


@pytest.mark.parametrize("rate, hertz", [(125.0, 4.1), (1000.0, 12.0)])
def test_a_fast_motion_keeps_its_velocity(rate, hertz):
    time = np.arange(round(4.0 * rate)) / rate
    turn = 2.0 * math.pi * hertz
    x = 4e-3 * np.sin(turn * time) + 1e-6 * np.random.default_rng(9).standard_normal(time.size)
    velocity, used, _ = estimate_velocities(time, x, [slice(None)])
    true = 4e-3 * turn * np.cos(turn * time)
    kept = float(velocity @ true / (true @ true))
    assert used.penalty is not None
    assert kept == pytest.approx(1.0, abs=2e-3)
    assert float(velocity_of(time, x, max(15e-3, 5.0 / rate)) @ true / (true @ true)) < 0.985


@pytest.mark.parametrize("samples, degree", [(5, 2), (15, 2), (5, 4), (15, 4)])
def test_the_gain_of_a_filter_is_what_it_keeps_of_a_sine(samples, degree):
    k = np.arange(-(samples // 2), samples // 2 + 1)
    turn = 0.3
    fit = np.polynomial.Polynomial.fit(k, np.sin(turn * k), degree).deriv()(0.0)
    used = palpate.VelocityFilter(samples, degree)
    assert filter_gain(used, turn) == pytest.approx(fit / turn, rel=1e-9)


def test_a_clean_fast_motion_is_trusted_and_its_damping_is_right():
    time = np.arange(2000) / 500.0
    turn = 2.0 * math.pi * 8.0
    x = 4e-3 - 6e-3 * np.cos(turn * time)
    v = 6e-3 * turn * np.sin(turn * time)
    force = faults.pushed(x, v) + 0.05 * np.random.default_rng(11).standard_normal(time.size)
    diagnosis = found(time, x, force)
    assert diagnosis.verdict.overall == "trust"
    damping = diagnosis.working_depth.damping
    assert damping.value == pytest.approx(LAW.damping_at(diagnosis.working_depth.depth), rel=0.02)


# A lag that the law cannot tell from damping.


def kelvin(**given) -> palpate.identification.diagnosis.Diagnosis:
    """F = 1300 x + 17 v in touches at 1 kHz, by the law that is selected."""
    time, x, v = touches(1000.0)
    force = np.where(x > 0.0, 1300.0 * x + 17.0 * v, 0.0)
    return found(time, x, faults.noisy(force), **given)


def test_the_bar_includes_1_ms_of_lag_if_the_law_cannot_tell_it():
    """B′ = B − K′ δ exactly; with clocks that agree to 0.1 ms it is a tenth."""
    usual, known = kelvin(), kelvin(delay=(0.0, 1e-4))
    for diagnosis, skew in ((usual, 1e-3), (known, 1e-4)):
        there = diagnosis.working_depth
        assert there.damping.systematic == pytest.approx(skew * 1300.0, rel=0.2)
        assert diagnosis.verdict.stiffness == "trust"
    assert usual.verdict.damping == "with-care"
    assert usual.reason.startswith(
        "the damping is known to ± 8 %, if force and position were recorded within"
    )
    assert usual.remedy.step is NextStep.IN_STEP
    assert known.verdict.damping == "trust"


# One way: each depth at one speed.


def approach(**given) -> palpate.Identification:
    """From 1 mm above the surface to 5 mm at 10 mm/s, which wavers by 3 %."""
    time = np.arange(600) * 1e-3
    x = -1e-3 + 10e-3 * time + 1e-5 * np.sin(30.0 * time)
    law = palpate.HuntCrossley(K=2e6, B=4e5, n=2.0)
    force = faults.pushed(x, np.gradient(x, time), law)
    contact = palpate.prepare(time=time, penetration=x, force=faults.noisy(force))
    return palpate.identify(contact, **given)


def test_at_one_speed_there_is_a_stiffness_and_no_damping():
    free, known = approach(), approach(estimator=palpate.VariableProjection(exponent=2.0))
    for result in (free, known):
        diagnosis = result.diagnosis
        there, verdict = diagnosis.working_depth, diagnosis.verdict
        [said] = [each for each in diagnosis.findings if each.check == "one way"]
        assert "the stiffness holds at 10 mm/s" in said.message
        assert "10 mm/s" in result.summary()
        assert there.speed == pytest.approx(10e-3, rel=0.01)
        true = palpate.HuntCrossley(K=2e6, B=4e5, n=2.0).stiffness_at(there.depth, there.speed)
        assert abs(there.stiffness.value - true) < 3.0 * there.stiffness.whole_error
        assert math.isnan(there.damping.value)
        assert (verdict.stiffness, verdict.damping) == ("trust", "do-not-trust")
        assert verdict.overall == "trust"  # a damping that is not given has no say


def test_one_way_at_several_speeds_gives_no_stiffness_to_trust():
    time = np.arange(600) * 1e-3
    x = -1e-3 + 5e-3 * time + 10e-3 * time**2
    law = palpate.HuntCrossley(K=2e6, B=4e5, n=2.0)
    force = faults.noisy(faults.pushed(x, np.gradient(x, time), law))
    found = palpate.diagnose(palpate.prepare(time=time, penetration=x, force=force))
    assert math.isnan(found.working_depth.damping.value)
    assert found.working_depth.speed == 0.0
    assert found.verdict.stiffness == "do-not-trust"


# The law that answers, and the frequency it answers at.


def test_depth_and_frequency_are_the_same_for_every_method():
    results = palpate.compare(faults.remembering(0.5, 0.1))
    results["selected"] = palpate.identify(faults.remembering(0.5, 0.1))
    for numbers in ("frequency", "depths"):
        values = np.array([getattr(each, numbers) for each in results.values()])
        assert np.ptp(values, axis=0) == pytest.approx(0.0, abs=0.02 * values.max())
