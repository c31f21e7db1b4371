"""Which samples are contact, and what happens to an estimate outside it."""

import math

import numpy as np
import pytest
from cases import MATERIALS, Signals, knowledge

import palpate
from palpate import ESTIMATORS, ConstantForgetting, ContactGate, DoubleStageRLS, Status

GATE = ContactGate(minimum_penetration=1e-3, make_force=1.0, break_force=0.5)
FREE = (-5e-3, 0.0, 0.0)
TOUCH = (10e-3, 0.01, 20.0)


def statuses(estimator, samples) -> list[str]:
    return [estimator.update(*sample).name for sample in samples]


def test_contact_is_made_above_one_force_and_lost_at_another(kind):
    forces = [0.4, 0.9, 1.0, 1.1, 0.9, 0.6, 0.5, 0.6, 0.9, 1.0, 1.2, 0.51]
    expected = ["WAITING"] * 3 + ["UPDATED"] * 3 + ["HELD"] * 4 + ["UPDATED"] * 2
    estimator = kind(gate=GATE)
    start = knowledge(estimator)
    assert statuses(estimator, [FREE] * 5) == ["WAITING"] * 5
    assert knowledge(estimator) == start
    assert statuses(estimator, [(10e-3, 0.0, force) for force in forces]) == expected
    # And deeper than the minimum penetration.
    depths = [0.9e-3, 1.0e-3, 1.1e-3, 1.0e-3, 2e-3]
    expected = ["WAITING", "WAITING", "UPDATED", "HELD", "UPDATED"]
    assert statuses(kind(gate=GATE), [(depth, 0.0, 5.0) for depth in depths]) == expected
    # Without a gate it is any penetration under any force.
    samples = [(1e-9, 0.0, 1e-9), (0.0, 0.0, 1.0), (1e-9, 0.0, 0.0), (1e-9, 0.0, 1e-9)]
    assert statuses(kind(), samples) == ["UPDATED", "HELD", "HELD", "UPDATED"]


def test_a_refused_sample_neither_makes_contact_nor_loses_it(kind):
    waiting, touching = kind(gate=GATE), kind(gate=GATE)
    touching.update(*TOUCH)
    for estimator in (waiting, touching):
        estimator.update(math.nan, 0.0, 20.0)
        estimator.update(10e-3, 0.0, 20.0, -1.0)
    # 0.9 N continues a contact, and does not make one.
    assert waiting.update(10e-3, 0.0, 0.9) is Status.WAITING
    assert touching.update(10e-3, 0.0, 0.9) is Status.UPDATED


def with_free_time(signals: Signals, where: int, samples: int) -> list[np.ndarray]:
    given = zip(signals.arrays, FREE, strict=True)
    return [np.insert(channel, where, np.full(samples, value)) for channel, value in given]


def test_an_estimate_is_resumed_on_contact_as_if_there_had_been_no_gap(kind, noisy):
    """Without forgetting there is nothing to re-arm: the gap leaves no trace at all."""
    whole, parted = (kind(gate=GATE, forgetting=ConstantForgetting(1.0)) for _ in range(2))
    trace = whole.replay(*noisy.arrays)
    gapped = parted.replay(*with_free_time(noisy, 500, 300))
    assert np.array_equal(np.delete(gapped.parameters, slice(500, 800), axis=0), trace.parameters)
    assert knowledge(parted) == knowledge(whole)


def test_forgetting_starts_afresh_with_each_contact(kind, noisy):
    """λ returns to λ₀ when contact is made again: the newest samples weigh more than before."""
    forgetting = palpate.FadingForgetting(0.95, 5.0)
    whole, parted = (kind(gate=GATE, forgetting=forgetting) for _ in range(2))
    whole.replay(*noisy.arrays)
    parted.replay(*with_free_time(noisy, 900, 1))
    assert parted.estimate().samples == whole.estimate().samples
    # After 0.9 s λ has faded to 0.999, a memory of 1000 samples; re-armed, 0.95 remembers some 20.
    assert np.all(parted.estimate().standard_errors > 1.5 * whole.estimate().standard_errors)


def test_a_prediction_is_the_force_of_the_present_law_and_none_out_of_contact(kind, noisy):
    estimator = kind()
    for row in noisy.rows[:50]:
        estimator.update(*row)
        assert estimator.predict(8e-3, -0.02) == estimator.estimate().law.force(8e-3, -0.02)
        assert estimator.predict(-1e-3, 0.05) == 0.0


@pytest.mark.parametrize("name", ["single-stage", "double-stage"])
def test_condition_ten_is_judged_at_the_speed_of_the_last_sample_taken(name):
    law = MATERIALS["ball"]  # B/K = 1: the limit is 0.1 m/s
    estimator = ESTIMATORS[name](initial=law, initial_covariance=1e-20)  # sure of it
    for velocity, margin in [(0.0, 1.0), (0.05, 0.5), (-0.05, 0.5), (0.1, 0.0), (0.2, -1.0)]:
        estimator.update(10e-3, velocity, law.force(10e-3, velocity))
        estimate = estimator.estimate()
        # P₀ = 1e-20 lets the law move by 1e-19 of an error: nothing.
        assert estimate.validity_margin == pytest.approx(margin, abs=1e-12)
        if margin:
            assert estimate.valid is (margin > 0.0)
    held = estimator.estimate().validity_margin
    estimator.update(*FREE)
    assert estimator.estimate().validity_margin == held


@pytest.mark.parametrize("name", ["kelvin-voigt", "extended-kelvin-voigt"])
def test_condition_ten_does_not_concern_a_law_without_a_logarithm(name):
    estimator = ESTIMATORS[name]()
    estimator.update(10e-3, 5.0, 20.0)
    assert estimator.estimate().valid is True
    assert estimator.estimate().validity_margin == 1.0
    # With one but without stiffness it holds at rest only.
    estimator = DoubleStageRLS(initial=palpate.HuntCrossley(0.0, 1.0, 1.0))
    assert estimator.estimate().validity_margin == 1.0
