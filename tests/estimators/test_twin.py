"""Every estimator against its slow twin, sample by sample, and against batch least squares."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from cases import KINDS, MATERIALS, Signals, exciting

import palpate
from palpate import ConstantForgetting, ContactGate, FadingForgetting, SelfPerturbation, Status


class Recursion:
    """Eq. 13 with self-perturbation, as printed; every row is kept."""

    def __init__(self, theta: np.ndarray, covariance: np.ndarray) -> None:
        self.theta = theta
        self.covariance = covariance
        self.rows: list[np.ndarray] = []
        self.outputs: list[float] = []
        self.factors: list[float] = []

    def update(self, phi: np.ndarray, y: float, lam: float, perturbation: float) -> None:
        g = self.covariance @ phi
        gain = g / (lam + phi @ g)
        self.theta = self.theta + gain * (y - phi @ self.theta)
        identity = np.eye(phi.size)
        self.covariance = (self.covariance - np.outer(gain, g) + perturbation * identity) / lam
        self.rows.append(phi)
        self.outputs.append(y)
        self.factors.append(lam)

    def noise_variance(self) -> float:
        """Weighted residual sum over Σw − p, the weight of a row being the λ of all later ones."""
        later = np.append(np.cumprod(self.factors[:0:-1])[::-1], 1.0)
        freedom = later.sum() - self.theta.size
        if freedom < 1.0:
            return 1.0
        residual = np.array(self.outputs) - np.array(self.rows) @ self.theta
        return float(later @ residual**2 / freedom)


class KelvinVoigtTwin:
    """Section 6: y = F, φ = [x, v]."""

    def __init__(self, initial: Any, covariance: np.ndarray, units: tuple[float, ...]) -> None:
        self.recursion = Recursion(self.to_theta(initial.parameters, units), covariance)

    @staticmethod
    def regressor(x: float, v: float) -> np.ndarray:
        return np.array([x, v])

    @classmethod
    def to_theta(cls, law: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        return law * cls.regressor(*units[:2]) / units[2]

    @classmethod
    def to_law(cls, theta: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        return theta * units[2] / cls.regressor(*units[:2])

    def predict(self, x: float, v: float) -> float:
        return float(self.regressor(x, v) @ self.recursion.theta)

    def learn(self, x: float, v: float, force: float, lam: float, perturbation: float) -> None:
        self.recursion.update(self.regressor(x, v), force, lam, perturbation)

    @property
    def theta(self) -> np.ndarray:
        return self.recursion.theta

    def scaled_covariance(self) -> np.ndarray:
        return self.recursion.noise_variance() * self.recursion.covariance


class ExtendedKelvinVoigtTwin(KelvinVoigtTwin):
    """Section 6: y = F, φ = [x, x², v]."""

    @staticmethod
    def regressor(x: float, v: float) -> np.ndarray:
        return np.array([x, x**2, v])


class SingleStageTwin(KelvinVoigtTwin):
    """Section 4: y = ln F, φ = [1, v, ln x], θ = [ln K, B/K, n]."""

    @staticmethod
    def to_theta(law: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        x0, v0, f0 = units
        stiffness, damping, exponent = law
        return np.array([np.log(stiffness * x0**exponent / f0), damping / stiffness * v0, exponent])

    @staticmethod
    def to_law(theta: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        x0, v0, f0 = units
        stiffness = np.exp(theta[0]) * f0 / x0 ** theta[2]
        return np.array([stiffness, theta[1] / v0 * stiffness, theta[2]])

    @staticmethod
    def regressor(x: float, v: float) -> np.ndarray:
        return np.array([1.0, v, np.log(x)])

    def predict(self, x: float, v: float) -> float:
        log_stiffness, dissipation, exponent = self.theta
        return float(np.exp(log_stiffness) * x**exponent * (1.0 + dissipation * v))

    def learn(self, x: float, v: float, force: float, lam: float, perturbation: float) -> None:
        self.recursion.update(self.regressor(x, v), np.log(force), lam, perturbation)


class DoubleStageTwin:
    """Section 5: K̂, B̂ from F with the previous n̂; then n̂ from ln(F / (K̂ + B̂ v))."""

    def __init__(self, initial: Any, covariance: np.ndarray, units: tuple[float, ...]) -> None:
        theta = self.to_theta(initial.parameters, units)
        self.one = Recursion(theta[:2], covariance[:2, :2])
        self.two = Recursion(theta[2:], covariance[2:, 2:])

    @staticmethod
    def to_theta(law: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        x0, v0, f0 = units
        unit = x0 ** law[2] / f0
        return np.array([law[0] * unit, law[1] * unit * v0, law[2]])

    @staticmethod
    def to_law(theta: np.ndarray, units: tuple[float, ...]) -> np.ndarray:
        x0, v0, f0 = units
        unit = f0 / x0 ** theta[2]
        return np.array([theta[0] * unit, theta[1] * unit / v0, theta[2]])

    def predict(self, x: float, v: float) -> float:
        stiffness, damping, exponent = self.theta
        return float(stiffness * x**exponent + damping * x**exponent * v)

    def learn(self, x: float, v: float, force: float, lam: float, perturbation: float) -> None:
        power = x ** self.two.theta[0]
        self.one.update(np.array([power, power * v]), force, lam, perturbation)
        rate = self.one.theta @ np.array([1.0, v])
        if rate > 0.0:
            self.two.update(np.array([np.log(x)]), np.log(force / rate), lam, perturbation)

    @property
    def theta(self) -> np.ndarray:
        return np.concatenate([self.one.theta, self.two.theta])

    def scaled_covariance(self) -> np.ndarray:
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = self.one.noise_variance() * self.one.covariance
        covariance[2, 2] = self.two.noise_variance() * self.two.covariance[0, 0]
        return covariance


TWINS = {
    "kelvin-voigt": KelvinVoigtTwin,
    "extended-kelvin-voigt": ExtendedKelvinVoigtTwin,
    "single-stage": SingleStageTwin,
    "double-stage": DoubleStageTwin,
}


class Twin:
    """An estimator's twin: the gate, λ over time and self-perturbation around one of the above."""

    def __init__(self, estimator: Any) -> None:
        settings = estimator.settings
        scale = settings["scale"]
        self.units = (scale.penetration, scale.velocity, scale.force) if scale else (1.0, 1.0, 1.0)
        given = np.asarray(settings["initial_covariance"], dtype=np.float64)
        size = settings["initial"].parameters.size
        covariance = given if given.ndim == 2 else np.diag(np.broadcast_to(given, size))
        self.method = TWINS[estimator.method](settings["initial"], covariance, self.units)
        self.forgetting = settings["forgetting"]
        self.perturbation = settings["perturbation"]
        self.gate = settings["gate"]
        self.touching = False
        self.touched = False
        self.perturbed = 0  # samples
        self.since = 0.0  # contact was made, or λ went back to λ₀, s

    def update(self, x: float, v: float, force: float, dt: float) -> tuple[float, str]:
        """The a-priori force [N] and what was done with the sample."""
        x0, v0, f0 = self.units
        inner = x / x0, v / v0, force / f0
        if not self.in_contact(x, force):
            self.touching = False
            return float("nan"), "HELD" if self.touched else "WAITING"
        self.since = self.since + dt if self.touching else 0.0
        self.touching = self.touched = True
        predicted = self.method.predict(*inner[:2]) * f0
        perturbation = 0.0
        if self.perturbation:
            error = force - predicted
            size = float(np.rint(self.perturbation.sensitivity * error**2))
            if size > 0.0:
                self.since = 0.0
                self.perturbed += 1
            perturbation = self.perturbation.gain * size
        self.method.learn(*inner, self.factor(), perturbation)
        return predicted, "UPDATED"

    def in_contact(self, x: float, force: float) -> bool:
        if self.gate is None:
            return x > 0.0 and force > 0.0
        threshold = self.gate.break_force if self.touching else self.gate.make_force
        return x > self.gate.minimum_penetration and force > threshold

    def factor(self) -> float:
        """λ = 1 − (1 − λ₀) e^(−α t), t since contact or perturbation; or a constant."""
        if isinstance(self.forgetting, FadingForgetting):
            start, rate = self.forgetting.initial_factor, self.forgetting.rate
            return 1.0 - (1.0 - start) * np.exp(-rate * self.since)
        return self.forgetting.factor

    @property
    def law(self) -> np.ndarray:
        return self.method.to_law(self.method.theta, self.units)

    def covariance(self) -> np.ndarray:
        """Of the law, by the delta method with a numerical Jacobian."""
        theta = self.method.theta
        columns = []
        for i, value in enumerate(theta):
            step = np.zeros_like(theta)
            step[i] = 1e-6 * max(abs(value), 1.0)
            high, low = (self.method.to_law(theta + s, self.units) for s in (step, -step))
            columns.append((high - low) / (2.0 * step[i]))
        jacobian = np.array(columns).T
        return jacobian @ self.method.scaled_covariance() @ jacobian.T


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
    signals = exciting(law, seconds=0.4, noise=0.05, seed=seed)
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
    twin = agree(estimator, noisy[:400])
    if "perturbation" in settings:
        return
    expected, estimate = twin.covariance(), estimator.estimate()
    deviation = np.sqrt(np.diag(expected))
    unit = np.outer(deviation, deviation)
    # The twin's Jacobian is a central difference, good to about 1e-9.
    np.testing.assert_allclose(estimate.covariance / unit, expected / unit, atol=1e-8)
    np.testing.assert_allclose(estimate.standard_errors, deviation, rtol=1e-8)


@pytest.mark.long
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


PRIOR = 1e3
# The recursion squares the condition number of the data (about 1e2 here, times the prior's
# √P₀ = 32), so it is left with 16 − 2·3.5 digits.
BATCH = 1e-9


@pytest.mark.parametrize("name", ["kelvin-voigt", "extended-kelvin-voigt", "single-stage"])
def test_without_forgetting_an_estimator_is_batch_least_squares(name, noisy):
    settings = {"initial_covariance": PRIOR, "forgetting": ConstantForgetting(1.0)}
    estimator = KINDS[name](scale=SCALE, **settings)
    estimator.replay(*noisy.arrays)
    units = SCALE.penetration, SCALE.velocity, SCALE.force
    x, v, force = (channel / unit for channel, unit in zip(noisy.arrays, units, strict=True))
    columns, outputs = {
        "kelvin-voigt": ([x, v], force),
        "extended-kelvin-voigt": ([x, x**2, v], force),
        "single-stage": ([np.ones_like(x), v, np.log(x)], np.log(force)),
    }[name]
    start = TWINS[name].to_theta(estimator.settings["initial"].parameters, units)
    # The start is further rows.
    rows = np.vstack([np.column_stack(columns), np.eye(start.size) / np.sqrt(PRIOR)])
    whole = np.concatenate([outputs, start / np.sqrt(PRIOR)])
    theta = np.linalg.lstsq(rows, whole, rcond=None)[0]
    expected = TWINS[name].to_law(theta, units)
    np.testing.assert_allclose(estimator.estimate().parameters, expected, rtol=BATCH)
