"""Which law it is, online: verdicts, memory, numbers and their limits.

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
    PowerLawRelaxation,
    Scale,
    SingleRelaxation,
    Status,
    ViscoelasticContact,
    identify,
)

DT = 1e-3
UNITS, GATE = Scale(10e-3, 50e-3, 20.0), ContactGate(1e-3)
NOISE = 0.1  # N, some 40 dB below the force


def law_of(damping, memory=0.0, relaxation=None, n=1.5):
    p = n - 1.0 if damping == "half-space" else n
    size = 0.0 if damping == "none" else 40.0 / 10e-3**p
    stiffness = 10.0 / 10e-3**n
    return GeneralisedHuntCrossley(stiffness, n, size, p, memory * stiffness, relaxation)


BOX = FlatSpectrum(1e-3, 4.096)
EVERYDAY = {
    "Kelvin–Voigt": law_of("half-space", n=1.0),
    "Hunt–Crossley": law_of("hunt-crossley"),
    "half-space": law_of("half-space"),
    "Hunt–Crossley with a flat spectrum": law_of("hunt-crossley", 0.5, BOX),
    "half-space with a flat spectrum": law_of("half-space", 0.5, BOX),
}
ONE_TIME, POWER_LAW = SingleRelaxation(0.05), PowerLawRelaxation(0.3, 1.5e-3, 5.7)
FULL = {
    "spring with one relaxation time": law_of("none", 0.5, ONE_TIME),
    "Hunt–Crossley with one relaxation time": law_of("hunt-crossley", 0.5, ONE_TIME),
    "half-space with power-law relaxation": law_of("half-space", 1.0, POWER_LAW),
}


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


@pytest.mark.parametrize("name", EVERYDAY)
def test_each_everyday_law_is_found_with_its_numbers(name):
    law = EVERYDAY[name]
    estimator = learned(pressed(law))
    assert str(estimator.verdict().candidate) == name
    told, exact = estimator.dynamic_stiffness(10e-3, 15.0), law.dynamic_stiffness(10e-3, 15.0)
    # Three times what 100 seeds leave (benchmarks.laws).
    assert told.stiffness == pytest.approx(exact.real, rel=3e-3)
    assert told.damping == pytest.approx(exact.imag / 15.0, rel=1e-2)
    assert abs(told.stiffness - exact.real) < 4.0 * told.stiffness_error
    assert told.loss_tangent == pytest.approx(15.0 * told.damping / told.stiffness)


@pytest.mark.parametrize("name", FULL)
def test_of_all_laws_the_right_one_is_found(name):
    verdict = learned(pressed(FULL[name]), memory="any").verdict()
    assert str(verdict.candidate) == name
    assert len(verdict.model_ranking) == 11
    assert verdict.model_ranking[0].score == 0.0
    assert verdict.model_ranking[0].candidate == verdict.candidate
    assert verdict.model_ranking[1].score > 2.0


@pytest.mark.parametrize("correlation", [0.0, 0.9], ids=["white", "AR(1) 0.9"])
@pytest.mark.parametrize("damping", ["hunt-crossley", "half-space"])
def test_no_memory_is_found_where_there_is_none(damping, correlation):
    for seed in range(5):
        x, v, force = pressed(law_of(damping), noise=0.0)
        rng, now = np.random.default_rng(seed), 0.0
        for k, fresh in enumerate(rng.standard_normal(x.size).tolist()):
            now = correlation * now + math.sqrt(1.0 - correlation**2) * fresh
            force[k] += NOISE * now
        chosen = learned((x, v, force)).verdict().candidate
        assert (chosen.damping, chosen.memory) == (damping, "none")


def test_the_sums_leave_the_residual_that_the_samples_leave():
    samples = pressed(law_of("half-space", 0.5, BOX), noise=1e-3)
    estimator = learned(samples)
    law, (x, v, force) = estimator.estimate().law, samples
    model = law.relaxed().force(x, v) + estimator.estimate().offset
    for rung in range(6):  # the branches of the bank
        numbers = (0.0, law.exponent, 0.0, 0.0, law.relaxation_stiffness / 6.0)
        branch = GeneralisedHuntCrossley(*numbers, SingleRelaxation(2.0 * DT * 4.0**rung))
        model = model + branch.force_along(x, v, DT)
    taken = (x > GATE.minimum_penetration) & (force > 0.0)
    direct = np.mean((force[taken] - model[taken]) ** 2)
    by_sums = estimator.verdict().model_ranking[0].rms_error ** 2
    assert abs(direct - by_sums) < 1e-6 * np.mean(force[taken] ** 2)


@pytest.mark.parametrize("ends", [(1e-3, 4.096), (1e-3, 20.0), (3e-4, 8.0)], ids=str)
def test_error_bars_hold_where_a_spectrum_ends_elsewhere(ends):
    law = law_of("hunt-crossley", 1.0, FlatSpectrum(*ends))
    result = identify(contact_of(*pressed(law, 16.0, noise=1e-4)), law="auto", trace=False)
    assert result.law.remembers
    # Of ends that lie elsewhere M is of another range of times.
    for name in ("stiffness", "exponent", "damping"):
        k = law.names().index(name)
        assert result.standard_errors[k] > 0.0
        if name != "damping" or result.law.damping_exponent == result.law.exponent:
            away = abs(result.law.parameters[k] - law.parameters[k])
            assert away < 4.0 * result.standard_errors[k]
    felt = result.dynamic_stiffness()
    exact = law.dynamic_stiffness(felt.depth, felt.frequency)
    assert felt.stiffness.value == pytest.approx(exact.real, rel=0.01)
    assert felt.damping.value == pytest.approx(exact.imag / felt.frequency, rel=0.03)


def test_relaxation_times_are_looked_for_as_far_as_the_contact_shows_them():
    quick = law_of("hunt-crossley", 1.0, FlatSpectrum(1e-3, 4.096))
    slow = law_of("hunt-crossley", 1.0, FlatSpectrum(1e-3, 20.0))
    steps = []
    for law in (law_of("hunt-crossley"), quick, slow):
        contact = contact_of(*pressed(law, 16.0))
        steps.append(identify(contact, law="auto", trace=False).estimator.settings["sample_time"])
    assert steps == pytest.approx([DT, DT, 4.0 * DT])
    given = identify(contact, ViscoelasticContact(sample_time=2e-3), trace=False)
    assert given.estimator.settings["sample_time"] == 2e-3


def test_uneven_time_steps_tell_the_same_law():
    law = law_of("hunt-crossley", 0.5, BOX)
    rng = np.random.default_rng(5)
    kept = np.sort(rng.choice(np.arange(1, 4400), 3000, replace=False))
    x, v, force = pressed(law)
    estimator = learned((x[kept], v[kept], force[kept], DT * np.diff(kept, prepend=0)))
    assert str(estimator.verdict().candidate) == "Hunt–Crossley with a flat spectrum"
    told, exact = estimator.dynamic_stiffness(10e-3, 15.0), law.dynamic_stiffness(10e-3, 15.0)
    # Between samples up to 10 ms apart xⁿ is not even: a percent of the memory's part.
    assert told.stiffness == pytest.approx(exact.real, rel=1e-2)


def test_memory_goes_on_through_lost_contact_and_refused_samples():
    law = law_of("hunt-crossley", 0.5, BOX)
    x, v = motion()
    x = x - 9e-3  # out of contact every swing
    force = law.force_along(x, v, DT) + 0.01 * np.random.default_rng(2).standard_normal(x.size)
    force[1000:1500:50] = math.nan
    estimator = ViscoelasticContact(gate=ContactGate(1e-4), scale=Scale(5e-3, 50e-3, 5.0))
    trace = estimator.replay(x, v, force)
    estimator.finish_pending()
    assert (trace.status[1000:1500:50] == Status.NOT_FINITE).all()
    assert str(estimator.verdict().candidate) == "Hunt–Crossley with a flat spectrum"
    assert estimator.estimate().law.exponent == pytest.approx(1.5, abs=0.02)


def test_samples_that_begin_in_contact_are_flagged_until_what_nobody_saw_is_forgotten():
    law = law_of("hunt-crossley", 0.5, BOX)
    x, v, force = (channel[800:] for channel in pressed(law))
    estimator = ViscoelasticContact(gate=GATE, scale=UNITS)
    estimator.replay(x[:400], v[:400], force[:400], at=())
    early = estimator.estimate()
    assert any("begin in contact" in flag for flag in early.flags)
    assert not early.law.remembers
    estimator.replay(x[400:], v[400:], force[400:], at=())
    estimator.finish_pending()
    late = estimator.estimate()
    assert late.law.remembers
    assert not any("begin in contact" in flag for flag in late.flags)
    # By what is remembered longer than that K and M stay off: 2.3 deviations of 20 seeds.
    assert any("begin in contact" in flag for flag in estimator.verdict().flags)


def test_memory_is_carried_over_breaks_between_which_the_probe_goes_on_unseen():
    law = law_of("hunt-crossley", 1.0, BOX)
    time = np.arange(0.0, 40.0, DT)
    x, v = 6e-3 - 5e-3 * np.cos(7.0 * time), 35e-3 * np.sin(7.0 * time)
    force = law.force_along(x, v, DT) + 0.05 * np.random.default_rng(6).standard_normal(x.size)
    seen = (time < 4.0) | (time % 4.0 < 1.0)
    segment = np.cumsum(np.diff(np.flatnonzero(seen), prepend=0) > 1)
    seen_only = {"penetration": x[seen], "velocity": v[seen], "force": force[seen]}
    contact = Contact(time[seen], **seen_only, segment=segment)
    result = identify(contact, ViscoelasticContact(gate=GATE))
    assert str(result.law_verdict.candidate) == "Hunt–Crossley with a flat spectrum"
    # Taken for rested after each break it is half as much again.
    assert result.law.stiffness == pytest.approx(law.stiffness, rel=0.1)
    # What stands beside it knows of the breaks too: rested, the fit leaves a tenth of the force.
    assert result.fit_rmse_percent < 2.0


def test_laws_that_an_approach_alone_cannot_tell_apart_are_named_and_the_damping_not_trusted():
    samples = [channel[:395] for channel in pressed(law_of("hunt-crossley"))]
    verdict = learned(samples).verdict()
    first, second = (each.candidate for each in verdict.model_ranking[:2])
    assert {first.damping, second.damping} == {"hunt-crossley", "half-space"}
    assert f"do not distinguish it from {second}" in verdict.flags[0]
    assert any("moves one way" in flag for flag in verdict.flags)
    alone = learned(samples, damping="hunt-crossley", memory="none").estimate()
    assert any("damping not identifiable" in flag for flag in alone.flags)
    # What the damper may have, the spring may not: K is a sixth of it off.
    assert abs(alone.law.stiffness - 1e4) < 2.0 * alone.standard_errors[0]
    remembering = [channel[:395] for channel in pressed(law_of("hunt-crossley", 0.5, BOX))]
    for law in ("auto", "hunt-crossley"):
        diagnosis = palpate.diagnose(contact_of(*remembering), law=law)
        assert diagnosis.verdict.damping == "do-not-trust"
        assert any(finding.check == "one way" for finding in diagnosis.findings)


def test_laws_with_memory_that_do_not_compete_yet_are_said_to_be_missing():
    x, v, force = pressed(law_of("hunt-crossley", 0.5, BOX))
    few = np.flatnonzero(x > GATE.minimum_penetration)[90]
    early = learned((x[:few], v[:few], force[:few])).verdict()
    assert early.model_ranking
    assert early.samples < 100.0
    assert any("too few samples yet to compare laws with memory" in flag for flag in early.flags)
    assert not any("laws with memory" in flag for flag in learned((x, v, force)).verdict().flags)
    # Of what forgets within a hundred samples none ever does.
    brief = learned((x, v, force), forgetting=palpate.ConstantForgetting(0.985))
    assert any("laws with memory" in flag for flag in brief.verdict().flags)


def test_a_gate_that_noise_opens_is_said_to_bias_the_stiffness():
    x, v, force = pressed(law_of("hunt-crossley"))
    noisy = force + 1.0 * np.random.default_rng(8).standard_normal(force.size)
    for gate, samples, warned in (
        (None, noisy, True), (None, force, False), (ContactGate(5e-3), noisy, False)
    ):  # fmt: skip
        flags = learned((x, v, samples), gate=gate).verdict().flags
        assert any("within the noise" in flag for flag in flags) == warned


def test_a_smooth_residual_is_not_taken_for_white_noise():
    law = law_of("hunt-crossley", 1.0, SingleRelaxation(0.08))  # none of the everyday ones
    time = np.arange(0.0, 1.3, DT)
    corners = [0.0, 0.1, 0.2, 1.0, 1.1, 1.3]
    x = np.interp(time, corners, [-2e-3, -2e-3, 4e-3, 4e-3, -2e-3, -2e-3])
    v = np.gradient(x, DT)
    force = law.force_along(x, v, DT)
    force += 1e-3 * np.random.default_rng(0).standard_normal(x.size)
    scale = Scale(4e-3, 6e-2, 6.0)
    verdict = learned((x, v, force), gate=ContactGate(4e-5), scale=scale).verdict()
    assert verdict.model_ranking[0].rms_error > 0.01  # ten times the noise
    assert verdict.effective_samples < 0.2 * verdict.samples


def test_what_a_tare_or_free_air_says_is_dropped_where_the_contact_contradicts_it():
    x, v, force = pressed(law_of("hunt-crossley"))
    estimate = learned((x, v, force + 5.0), offset_deviation=1e-3).estimate()
    assert estimate.offset == pytest.approx(5.0, abs=0.2)
    assert any("tare" in flag for flag in estimate.flags)


def test_frequencies_that_the_motion_did_not_contain_are_refused():
    estimator = learned(pressed(law_of("hunt-crossley", 0.5, BOX)))
    low, high = estimator.verdict().band
    assert low < 11.0 < high
    for frequency in (0.9 * low, 1.1 * high, math.nan, -1.0):
        with pytest.raises(InvalidParameterError, match="frequency must"):
            estimator.dynamic_stiffness(10e-3, frequency)
    with pytest.raises(InvalidParameterError, match="frequency not known yet"):
        ViscoelasticContact().dynamic_stiffness()


def test_a_kind_of_memory_that_is_named_is_taken_for_granted():
    verdict = learned(pressed(law_of("hunt-crossley")), memory="flat").verdict()
    assert {standing.candidate.memory for standing in verdict.model_ranking} == {"flat"}
    for memory in ("auto", "flat"):
        with pytest.raises(InvalidParameterError, match="no law has damping="):
            ViscoelasticContact(damping="none", memory=memory)


def test_forgetting_follows_a_material_that_changes():
    x, v, soft = pressed(law_of("hunt-crossley"))
    forgetting = palpate.ConstantForgetting(0.998)
    estimator = ViscoelasticContact(gate=GATE, scale=UNITS, memory="none", forgetting=forgetting)
    estimator.replay(x, v, soft, at=())
    estimator.replay(x[400:], v[400:], 2.0 * soft[400:], at=())
    estimator.finish_pending()
    # Of e^(−8) of the old samples nothing is left; 500 new ones tell it to a percent.
    assert estimator.estimate().law.force(10e-3, 0.0) == pytest.approx(20.0, rel=0.02)


def test_a_change_of_a_material_that_remembers_restarts_it_with_its_memory():
    law = law_of("hunt-crossley", 0.5, BOX)
    x, v = motion()
    x, v = np.append(x, x[400:]), np.append(v, v[400:])
    force = law.force_along(x, v, DT)
    force[4400:] *= 1.3
    force += NOISE * np.random.default_rng(4).standard_normal(x.size)
    detector = palpate.ChangeDetector()
    estimator = ViscoelasticContact(gate=GATE, scale=UNITS, change_detector=detector)
    trace = estimator.replay(x, v, force)
    estimator.finish_pending()
    [alarm] = np.flatnonzero(trace.status == Status.RESTARTED)
    assert 0 <= alarm - 4400 < 30
    assert estimator.verdict().candidate.memory == "flat"
    told, exact = estimator.dynamic_stiffness(10e-3, 15.0), law.dynamic_stiffness(10e-3, 15.0)
    assert told.stiffness == pytest.approx(1.3 * exact.real, rel=5e-3)


def test_an_identification_predicts_and_is_diagnosed_with_its_memory():
    law = law_of("half-space", 0.5, BOX)
    contact = contact_of(*pressed(law))
    result, plain = identify(contact, "viscoelastic"), identify(contact)
    assert result.fit_rmse_percent < 0.3 * plain.fit_rmse_percent
    assert result.diagnosis.verdict.stiffness == "trust"
    assert str(result.law_verdict).startswith(
        "law: half-space damping with a flat relaxation spectrum, preferred over "
    )
    assert result.as_dict()["law_verdict"]["model_ranking"][0]["score"] == 0.0
    assert plain.law_verdict.candidate == result.law_verdict.candidate
    relaxed = law.relaxed()
    depth = result.diagnosis.working_depth.depth
    # Of the relaxed material: sums and branches part a percent of the memory.
    assert result.stiffness_at(depth).value == pytest.approx(relaxed.stiffness_at(depth), rel=0.02)
    # Of the damper alone it would be less; the segment's first cycles are not closed.
    energy = result.energy
    assert energy.predicted.value == pytest.approx(energy.measured.value, rel=0.03)
    assert energy.remarks == ()
