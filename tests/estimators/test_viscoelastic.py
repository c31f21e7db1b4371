"""The law that may relax: which form it takes, K′ and B′ with their bars, memory and its limits.

What is asked of hundreds of seeds is measured by ``python -m benchmarks.laws``.
"""

import math

import numpy as np
import pytest

import palpate
from palpate import (
    Contact,
    ContactGate,
    FlatSpectrum,
    GeneralisedHuntCrossley,
    InvalidParameterError,
    RelaxationSpectrum,
    Scale,
    SingleRelaxation,
    Status,
    ViscoelasticContact,
    identify,
)

DT = 1e-3
UNITS, GATE = Scale(10e-3, 50e-3, 20.0), ContactGate(1e-3)
NOISE = 0.1  # N, some 40 dB below the force
STIFFNESS = 1e4


def law_of(damping, relaxation=None, n=1.5):
    """Half of the relaxed stiffness relaxes."""
    p = n - 1.0 if damping == "half-space" else n
    relaxing = 0.5 * STIFFNESS if relaxation else 0.0
    return GeneralisedHuntCrossley(
        K=STIFFNESS, n=n, B=40.0 / 10e-3**p, p=p, M=relaxing, relaxation=relaxation
    )


FORGETFUL = {
    "Kelvin–Voigt": law_of("half-space", n=1.0),
    "Hunt–Crossley": law_of("hunt-crossley"),
    "half-space": law_of("half-space"),
}
BOX = FlatSpectrum(1e-3, 4.096)
RELAXATIONS = {
    "one time": SingleRelaxation(0.05),
    "two times": RelaxationSpectrum((0.02, 0.5), (0.25 * STIFFNESS, 0.25 * STIFFNESS)),
    "Fung": BOX,
}
MEMORY = law_of("hunt-crossley", BOX)


def motion(seconds=4.0):
    """An approach of 0.4 s, and three sines of 4, 11 and 15 rad/s about 10 mm."""
    time = np.arange(-0.4, seconds, DT)
    x = 10e-3 + 1e-3 * np.sin(4 * time) + 1.8e-3 * (np.sin(11 * time) + np.sin(15 * time))
    v = 4e-3 * np.cos(4 * time) + 1.8e-3 * (11 * np.cos(11 * time) + 15 * np.cos(15 * time))
    return np.where(time < 0.0, 10e-3 + 30e-3 * time, x), np.where(time < 0.0, 30e-3, v)


def pressed(law, seconds=4.0, noise=NOISE, seed=0):
    x, v = motion(seconds)
    force = law.force_along(x, v, DT)
    return x, v, force + noise * np.random.default_rng(seed).standard_normal(x.size)


def learned(samples, **settings):
    estimator = ViscoelasticContact(**{"gate": GATE, "scale": UNITS, **settings})
    estimator.replay(*samples, at=())
    estimator.finish_pending()
    return estimator


def contact_of(x, v, force):
    return Contact(DT * np.arange(x.size), penetration=x, velocity=v, force=force)


def findings_of(result, check):
    return [each for each in result.diagnosis.findings if each.check == check]


@pytest.mark.parametrize("name", FORGETFUL)
def test_each_law_without_memory_is_found_with_its_numbers(name):
    law = FORGETFUL[name]
    estimator = learned(pressed(law))
    verdict = estimator.verdict()
    assert str(verdict.candidate) == name
    assert (verdict.model_ranking[0].candidate, verdict.model_ranking[0].score) == (
        verdict.candidate, 0.0
    )  # fmt: skip
    response, exact = estimator.dynamic_stiffness(10e-3, 15.0), law.dynamic_stiffness(10e-3, 15.0)
    assert response.stiffness == pytest.approx(exact.real, rel=3e-3)
    assert response.damping == pytest.approx(exact.imag / 15.0, rel=1e-2)
    assert abs(response.stiffness - exact.real) < 4.0 * response.stiffness_error
    assert response.loss_tangent == pytest.approx(15.0 * response.damping / response.stiffness)


@pytest.mark.parametrize("relaxation", RELAXATIONS)
@pytest.mark.parametrize("damping", ["hunt-crossley", "half-space"])
def test_a_law_that_relaxes_is_found_with_its_dynamic_stiffness(damping, relaxation):
    law = law_of(damping, RELAXATIONS[relaxation])
    estimator = learned(pressed(law))
    verdict, found = estimator.verdict(), estimator.estimate().law
    assert verdict.candidate.memory == "spectrum"
    assert verdict.rival.score > 10.0
    assert verdict.model_ranking[0].rms_error < 0.9 * verdict.rival.rms_error
    response, exact = estimator.dynamic_stiffness(10e-3, 15.0), law.dynamic_stiffness(10e-3, 15.0)
    assert response.stiffness == pytest.approx(exact.real, rel=0.01)
    assert response.damping == pytest.approx(exact.imag / 15.0, rel=0.06)
    if relaxation == "one time":  # to half the distance between two of the fixed times
        assert abs(math.log(found.relaxation_time / 0.05)) < found.relaxation.resolution < 0.43
        assert len(found.relaxation.times) == 10  # also those whose stiffness is 0
    else:
        assert found.relaxation_time is None


def noise_of(kind, seed, count):
    white = np.random.default_rng(seed).standard_normal(count)
    share = {"white": 1.0, "AR(1) 0.9": math.sqrt(1.0 - 0.81), "low-pass": 0.12}[kind]
    kept = {"white": 0.0, "AR(1) 0.9": 0.9, "low-pass": 0.88}[kind]  # 20 Hz
    now, found = 0.0, []
    for fresh in white.tolist():
        now = kept * now + share * fresh
        found.append(now)
    return NOISE * np.array(found) / np.std(found)


@pytest.mark.parametrize("kind", ["white", "AR(1) 0.9", "low-pass"])
@pytest.mark.parametrize("damping", ["hunt-crossley", "half-space"])
def test_no_memory_is_named_where_there_is_none(damping, kind):
    for seed in range(5):
        x, v, force = pressed(law_of(damping), noise=0.0)
        chosen = learned((x, v, force + noise_of(kind, seed, x.size))).verdict().candidate
        assert (chosen.damping, chosen.memory) == (damping, "none")


def test_the_sums_leave_the_residual_that_the_samples_leave():
    samples = pressed(law_of("half-space", BOX), noise=1e-3)
    estimator = learned(samples)
    law, (x, v, force) = estimator.estimate().law, samples
    model = law.force_along(x, v, DT) + estimator.estimate().offset
    taken = (x > GATE.minimum_penetration) & (force > 0.0)
    direct = np.mean((force[taken] - model[taken]) ** 2)
    by_sums = estimator.verdict().model_ranking[0].rms_error ** 2
    assert abs(direct - by_sums) < 1e-6 * np.mean(force[taken] ** 2)


def test_dynamic_stiffness_is_within_two_error_bars():
    law, within = law_of("half-space", RELAXATIONS["two times"]), np.zeros(2)
    for seed in range(8):
        result = identify(contact_of(*pressed(law, seed=seed)), law="auto", trace=False)
        felt = result.dynamic_stiffness()
        exact = law.dynamic_stiffness(felt.depth, felt.frequency)
        truths = exact.real, exact.imag / felt.frequency
        for k, (each, truth) in enumerate(zip((felt.stiffness, felt.damping), truths, strict=True)):
            within[k] += abs(each.value - truth) < 2.0 * each.whole_error
            assert each.whole_error < (0.03, 0.2)[k] * truth
    assert within.min() >= 6


def test_one_cycle_that_begins_in_contact_has_its_damping():
    law, time = law_of("hunt-crossley", RELAXATIONS["one time"]), np.arange(0.0, 4.0, DT)
    x, v = 10e-3 + 4e-3 * np.sin(8.0 * time), 32e-3 * np.cos(8.0 * time)
    force = law.force_along(x, v, DT) + 0.02 * np.random.default_rng(1).standard_normal(x.size)
    cycle = slice(2000, 2000 + round(2.0 * math.pi / 8.0 / DT))
    result = identify(contact_of(x[cycle], v[cycle], force[cycle]), law="auto", trace=False)
    felt = result.dynamic_stiffness()
    exact = law.dynamic_stiffness(felt.depth, felt.frequency)
    assert result.estimator.evidence().begun
    assert felt.damping.value == pytest.approx(exact.imag / felt.frequency, rel=0.08)


def test_uneven_time_steps_tell_the_same_law():
    rng = np.random.default_rng(5)
    kept = np.sort(rng.choice(np.arange(1, 4400), 3000, replace=False))
    x, v, force = pressed(MEMORY)
    estimator = learned((x[kept], v[kept], force[kept], DT * np.diff(kept, prepend=0)))
    assert str(estimator.verdict().candidate) == "Hunt–Crossley with relaxation"
    response, exact = (
        estimator.dynamic_stiffness(10e-3, 15.0),
        MEMORY.dynamic_stiffness(10e-3, 15.0),
    )
    # Between samples up to 10 ms apart xⁿ is not linear: 1 % of the relaxing part.
    assert response.stiffness == pytest.approx(exact.real, rel=1e-2)


def test_memory_goes_on_through_lost_contact_and_refused_samples():
    x, v = motion()
    x = x - 9e-3  # out of contact every swing
    force = MEMORY.force_along(x, v, DT) + 0.01 * np.random.default_rng(2).standard_normal(x.size)
    force[1000:1500:50] = math.nan
    estimator = ViscoelasticContact(gate=ContactGate(1e-4), scale=Scale(5e-3, 50e-3, 5.0))
    trace = estimator.replay(x, v, force)
    estimator.finish_pending()
    assert (trace.status[1000:1500:50] == Status.NOT_FINITE).all()
    assert str(estimator.verdict().candidate) == "Hunt–Crossley with relaxation"
    assert estimator.estimate().law.n == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize("missing", [5, 3000])
def test_memory_is_carried_over_breaks(missing):
    """Of a probe that moves on unseen in between, in contact."""
    law = law_of("hunt-crossley", RELAXATIONS["one time"])
    time = np.arange(0.0, 20.0, DT)
    x = 6e-3 - 3e-3 * np.cos(7.0 * time) - 2e-3 * np.cos(17.0 * time)
    v = 21e-3 * np.sin(7.0 * time) + 34e-3 * np.sin(17.0 * time)
    force = law.force_along(x, v, DT) + 0.02 * np.random.default_rng(6).standard_normal(x.size)
    seen = (time < 4.0) | (np.arange(time.size) % 4000 >= missing)
    segment = np.cumsum(np.diff(np.flatnonzero(seen), prepend=0) > 1)
    seen_only = {"penetration": x[seen], "velocity": v[seen], "force": force[seen]}
    contact = Contact(time[seen], **seen_only, segment=segment)
    result = identify(contact, law="auto", trace=False)
    assert result.law.remembers
    felt = result.dynamic_stiffness()
    exact = law.dynamic_stiffness(felt.depth, felt.frequency)
    assert felt.stiffness.value == pytest.approx(exact.real, rel=0.01)
    assert felt.damping.value == pytest.approx(exact.imag / felt.frequency, rel=0.06)
    # If the material had rested during each break, the fit would leave a tenth of the force.
    assert result.fit_rmse_percent < 2.0


def test_laws_that_an_approach_cannot_distinguish_are_named():
    samples = [channel[:395] for channel in pressed(law_of("hunt-crossley"))]
    verdict = learned(samples).verdict()
    assert {verdict.candidate.damping, verdict.rival.candidate.damping} == {
        "hunt-crossley", "half-space"
    }  # fmt: skip
    assert f"do not distinguish it from {verdict.rival.candidate.title}" in verdict.flags[0]
    assert f"cannot be distinguished from {verdict.rival.candidate.title}, rms" in str(verdict)
    assert any("moves one way" in flag for flag in verdict.flags)
    alone = learned(samples, damping="hunt-crossley", memory="none").estimate()
    assert any("damping not identifiable" in flag for flag in alone.flags)
    remembering = [channel[:395] for channel in pressed(MEMORY)]
    for law in ("auto", "hunt-crossley"):
        diagnosis = palpate.diagnose(contact_of(*remembering), law=law)
        assert diagnosis.verdict.damping == "do-not-trust"
        assert any(finding.check == "one way" for finding in diagnosis.findings)


def test_an_exponent_at_the_end_of_its_range_is_flagged():
    law = GeneralisedHuntCrossley(K=10.0 / 10e-3**3.6, n=3.6, B=0.0, p=3.6)
    samples = [channel[:395] for channel in pressed(law, noise=0.01)]  # one way
    estimate = learned(samples).estimate()
    assert any("exponent at the edge of its range" in flag for flag in estimate.flags)
    result = identify(contact_of(*samples), law="auto", trace=False)
    assert result.diagnosis.verdict.damping == "do-not-trust"


@pytest.mark.parametrize("count", [60, 150, 190])
def test_fewer_than_two_hundred_samples_are_identified(count):
    law = law_of("hunt-crossley", RELAXATIONS["one time"])
    every = slice(None, None, 4400 // count)
    x, v, force = (channel[every] for channel in pressed(law))
    time = DT * every.step * np.arange(x.size)
    contact = Contact(time, penetration=x, velocity=v, force=force)
    result = identify(contact, law="auto", trace=False)
    felt = result.dynamic_stiffness()
    exact = law.dynamic_stiffness(felt.depth, felt.frequency)
    assert result.law.remembers
    assert result.law_verdict.effective_samples > 0.1 * result.law_verdict.samples
    # By 40 samples in contact at 16 Hz its own error is 1 %.
    assert felt.stiffness.value == pytest.approx(exact.real, rel=0.015 if count == 60 else 0.01)
    assert felt.damping.value == pytest.approx(exact.imag / felt.frequency, rel=0.06)


def test_laws_that_do_not_compete_yet_are_named():
    brief = learned(pressed(MEMORY), forgetting=palpate.ConstantForgetting(0.93)).verdict()
    assert brief.samples < 20.0
    assert any("too few samples yet to compare laws with memory" in flag for flag in brief.flags)
    assert not any("laws with memory" in flag for flag in learned(pressed(MEMORY)).verdict().flags)


def test_a_smooth_residual_is_not_taken_for_white_noise():
    x, v, force = pressed(MEMORY)
    verdict = learned((x, v, force), memory="none").verdict()
    assert verdict.model_ranking[0].rms_error > 3.0 * NOISE
    assert verdict.effective_samples < 0.2 * verdict.samples


def test_a_tare_that_the_contact_contradicts_is_dropped():
    x, v, force = pressed(law_of("hunt-crossley"))
    estimate = learned((x, v, force + 5.0), offset_deviation=1e-3).estimate()
    assert estimate.offset == pytest.approx(5.0, abs=0.2)
    assert any("tare" in flag for flag in estimate.flags)


def test_frequencies_that_the_motion_did_not_contain_are_refused():
    estimator = learned(pressed(MEMORY))
    low, high = estimator.verdict().band
    assert low < 11.0 < high
    for frequency in (0.9 * low, 1.1 * high, math.nan, -1.0):
        with pytest.raises(InvalidParameterError, match="frequency must"):
            estimator.dynamic_stiffness(10e-3, frequency)
    with pytest.raises(InvalidParameterError, match="frequency is unknown"):
        ViscoelasticContact().dynamic_stiffness()


def test_options_choose_the_candidate_laws():
    offered = {str(each) for each in ViscoelasticContact(damping="half-space").offered}
    assert offered == {"Kelvin–Voigt", "half-space", "half-space with relaxation"}
    alone = learned(pressed(law_of("none", RELAXATIONS["one time"])), damping="none").verdict()
    assert str(alone.candidate) == "spring with relaxation"
    assert "the only candidate" in str(alone)
    for memory in ("any", "flat", "single", "power-law"):
        with pytest.raises(InvalidParameterError, match="memory must be one of auto, none"):
            ViscoelasticContact(memory=memory)
    for damping in ("none", "linear"):
        with pytest.raises(InvalidParameterError, match="no law has damping="):
            ViscoelasticContact(damping=damping, memory="none")
    with pytest.raises(InvalidParameterError, match="longest_time must be in"):
        ViscoelasticContact(longest_time=3e-3)


def test_forgetting_follows_a_material_that_changes():
    x, v, soft = pressed(law_of("hunt-crossley"))
    forgetting = palpate.ConstantForgetting(0.998)
    estimator = ViscoelasticContact(gate=GATE, scale=UNITS, memory="none", forgetting=forgetting)
    estimator.replay(x, v, soft, at=())
    estimator.replay(x[400:], v[400:], 2.0 * soft[400:], at=())
    estimator.finish_pending()
    # e^(−8) of the old samples remains; 500 new ones determine the force to 1 %.
    assert estimator.estimate().law.force(10e-3, 0.0) == pytest.approx(20.0, rel=0.02)


def test_a_change_of_a_relaxing_material_restarts_the_estimator():
    x, v = motion()
    x, v = np.append(x, x[400:]), np.append(v, v[400:])
    force = MEMORY.force_along(x, v, DT)
    force[4400:] *= 1.3
    force += NOISE * np.random.default_rng(4).standard_normal(x.size)
    detector = palpate.ChangeDetector()
    estimator = ViscoelasticContact(gate=GATE, scale=UNITS, change_detector=detector)
    trace = estimator.replay(x, v, force)
    estimator.finish_pending()
    [alarm] = np.flatnonzero(trace.status == Status.RESTARTED)
    assert 0 <= alarm - 4400 < 30
    assert estimator.verdict().candidate.memory == "spectrum"
    response, exact = (
        estimator.dynamic_stiffness(10e-3, 15.0),
        MEMORY.dynamic_stiffness(10e-3, 15.0),
    )
    assert response.stiffness == pytest.approx(1.3 * exact.real, rel=1e-2)


@pytest.mark.parametrize("delay", [0, 10])
def test_a_late_force_is_found_beside_the_relaxation(delay):
    # A damper hides a delay of up to B/K; this one is 4 ms at 10 mm.
    law = law_of("half-space", RELAXATIONS["two times"])
    x, v, force = pressed(law.with_parameters(law.parameters * [1.0, 1.0, 0.25, 1.0, 1.0]))
    late = contact_of(x[delay:], v[delay:], force[: force.size - delay])
    result = identify(late, law="auto", trace=False)
    said = findings_of(result, "late force")
    assert len(said) == (delay > 0)
    assert all(each.damping == "with-care" for each in said)


def test_a_known_exponent_is_kept_with_memory():
    free, kept = (learned(pressed(MEMORY), exponent=n).estimate() for n in (None, 1.5))
    assert kept.law.remembers
    assert (kept.law.n, kept.standard_errors[1]) == (1.5, 0.0)
    assert kept.standard_errors[0] < free.standard_errors[0]


def test_an_identification_predicts_and_is_diagnosed_with_its_memory():
    law = law_of("half-space", BOX)
    contact = contact_of(*pressed(law))
    result, plain = identify(contact), identify(contact, law="hunt-crossley")
    assert result.fit_rmse_percent < 0.3 * plain.fit_rmse_percent
    assert result.diagnosis.verdict.stiffness == "trust"
    assert findings_of(result, "relaxed stiffness")  # nobody held the probe
    assert str(result.law_verdict).startswith(
        "law: half-space damping with relaxation, rms error 99.8 mN, 0.439 N without relaxation ("
    )
    assert result.as_dict()["law_verdict"]["model_ranking"][0]["score"] == 0.0
    energy = result.energy
    assert energy.predicted.value == pytest.approx(energy.measured.value, rel=0.03)
    assert energy.remarks == ()
