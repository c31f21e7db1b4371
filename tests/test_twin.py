"""Every estimator against its slow twin, sample by sample, on signals that excite it."""

import dataclasses

import numpy as np
import pytest
from cases import KINDS, MATERIALS, Signals, exciting
from twin import Twin

import palpate
from palpate import ConstantForgetting, ContactGate, SelfPerturbation, Status

# In these units every entry of φ is near 1, so P₀ = 10 I costs about P₀|φ|² = 10–100 roundings and
# the start-up a few hundred more: 1e-10 leaves them a factor of ten. The default P₀, which costs
# far more, has its own test below.
SCALE = palpate.Scale(15e-3, 50e-3, 30.0)
COVARIANCE = 10.0
TOLERANCE = 1e-10
GATE = ContactGate(minimum_penetration=3e-4, make_force=0.2, break_force=0.1)
PERTURBATIONS = {"unperturbed": None, "self-perturbed": SelfPerturbation()}
SETTINGS = {
    "fading": {},
    "self-perturbed": {"perturbation": SelfPerturbation()},
    "constant": {"forgetting": ConstantForgetting(0.995)},
    "none": {"forgetting": ConstantForgetting(1.0)},
}


def stepping(law, seed: int = 3) -> Signals:
    """The material turns 1.5 times as stiff half-way."""
    signals = exciting(law, seconds=0.6, noise=0.05, seed=seed)
    factor = np.where(np.arange(len(signals)) < len(signals) // 2, 1.0, 1.5)
    return dataclasses.replace(signals, force=factor * signals.force)


def agree(estimator, signals: Signals, dt=None) -> Twin:
    """Run the signals through both and compare them at every sample."""
    steps = np.broadcast_to(1e-3 if dt is None else dt, len(signals))
    twin = Twin(estimator)
    trace = estimator.replay(*signals.arrays, dt)
    predicted, status, laws = np.empty(len(signals)), [], np.empty_like(trace.parameters)
    for k, (row, step) in enumerate(zip(signals.rows, steps.tolist(), strict=True)):
        predicted[k], name = twin.update(*row, step)
        status.append(Status[name])
        laws[k] = twin.law
    assert trace.status.tolist() == status
    # Relative, but no finer than for the law it ends with: B passes through zero on its way.
    error = np.abs(trace.parameters - laws) / np.maximum(np.abs(laws), np.abs(laws[-1]))
    assert error.max() <= TOLERANCE
    misfit = np.abs(trace.predicted_force - predicted)[trace.taken]
    assert misfit.max() <= TOLERANCE * np.max(np.abs(signals.force))
    return twin


def estimator_of(kind, **settings):
    return kind(**{"scale": SCALE, "initial_covariance": COVARIANCE, "gate": GATE, **settings})


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_an_estimator_agrees_with_its_twin_and_so_does_the_covariance(kind, noisy, settings):
    """The covariance is that of the weighted data by the delta method."""
    estimator = estimator_of(kind, **settings)
    twin = agree(estimator, noisy[:600])
    if "perturbation" in settings:
        return
    expected, estimate = twin.covariance(), estimator.estimate()
    deviation = np.sqrt(np.diag(expected))
    unit = np.outer(deviation, deviation)
    # The twin's Jacobian is a central difference, good to about 1e-9.
    np.testing.assert_allclose(estimate.covariance / unit, expected / unit, atol=1e-8)
    np.testing.assert_allclose(estimate.standard_errors, deviation, rtol=1e-8)


@pytest.mark.parametrize("perturbation", PERTURBATIONS.values(), ids=PERTURBATIONS)
def test_an_estimator_agrees_with_its_twin_through_lost_contact(kind, broken, perturbation):
    broken = broken[:1400]  # by then it is lost and made again twice
    estimator = estimator_of(kind, perturbation=perturbation)
    status = estimator.replace().replay(*broken.arrays).status
    remade = (status[:-1] == Status.HELD) & (status[1:] == Status.UPDATED)
    assert remade.sum() >= 2  # or the motion tests nothing
    agree(estimator, broken)


@pytest.mark.parametrize("perturbation", PERTURBATIONS.values(), ids=PERTURBATIONS)
def test_an_estimator_agrees_with_its_twin_across_a_stiffness_step(kind, material, perturbation):
    twin = agree(estimator_of(kind, perturbation=perturbation), stepping(material))
    assert (twin.perturbed > 0) == (perturbation is not None)


def test_an_estimator_agrees_with_its_twin_on_an_uneven_clock(kind):
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(0.2e-3, 3e-3, 600))
    signals = exciting(MATERIALS["pvc"], time=time, noise=0.05, seed=4)
    agree(estimator_of(kind), signals, dt=np.diff(time, prepend=0.0))


@pytest.mark.parametrize("name", KINDS)
def test_an_estimator_as_it_comes_agrees_with_its_twin(name):
    estimator = KINDS[name]()
    signals = exciting(MATERIALS["pvc"], seconds=0.6, noise=0.05, seed=5)
    twin = Twin(estimator)
    trace = estimator.replay(*signals.arrays)
    predicted = np.array([twin.update(*row, 1e-3)[0] for row in signals.rows])
    # Cancellation in P − L gᵀ costs P₀|φ|² roundings, here up to 1e10 × 0.0027: 7e-9.
    error = np.abs(trace.predicted_force - predicted)
    assert error.max() <= 1e-8 * np.max(signals.force)
