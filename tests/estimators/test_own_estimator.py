"""A law and an estimator of one's own, made known by the same registries as the package's."""

import functools
import json
import math
import pickle
from dataclasses import dataclass, make_dataclass, replace
from typing import ClassVar

import conformance
import numpy as np
import pytest
from cases import contact_of, exciting
from scipy import optimize

import palpate
from palpate import Status, force_laws
from palpate.lab.design.precision import cramer_rao_bound
from palpate.method.estimators import contact_estimator
from palpate.output import figures
from palpate.validation import instance, number_in


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticky(force_laws.ForceLaw):
    """F = K₁ x + K₂ x² + B v + A for x > 0, else 0: four parameters."""

    K1: float
    K2: float
    B: float
    A: float
    kind: ClassVar[str] = "sticky"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m²", "N·s/m", "N")
    symbols: ClassVar[tuple[str, ...]] = ("K₁", "K₂", "B", "A")

    def _force(self, x, v):
        return self.K1 * x + self.K2 * x * x + self.B * v + self.A

    def parameter_gradient(self, penetration, velocity):
        ones = np.ones_like(penetration)
        return np.column_stack([penetration, penetration**2, velocity, ones])

    def penetration_gradient(self, penetration, velocity):
        return self.K1 + 2.0 * self.K2 * penetration


@dataclass(frozen=True, slots=True, kw_only=True)
class Fung(force_laws.ForceLaw):
    """F = A (exp(x/d) − 1) + B x v for x > 0, else 0: soft tissue (Fung 1967)."""

    A: float
    d: float
    B: float
    kind: ClassVar[str] = "fung"
    units: ClassVar[tuple[str, ...]] = ("N", "m", "N·s/m²")
    symbols: ClassVar[tuple[str, ...]] = ("A", "d", "B")

    def _force(self, x, v):
        return self.A * np.expm1(x / self.d) + self.B * x * v

    def parameter_gradient(self, penetration, velocity):
        grown = np.exp(penetration / self.d)
        by_length = -self.A * penetration / self.d**2 * grown
        return np.stack([grown - 1.0, by_length, penetration * velocity], axis=-1)

    def penetration_gradient(self, penetration, velocity):
        slope = self.A / self.d * np.exp(penetration / self.d)
        return slope + self.B * velocity


class StickyRLS(palpate.PythonEstimator):
    """Least squares of a sticky contact.

    Parameters
    ----------
    gate : ContactGate, optional
        Which samples are contact.
    sample_time : float
        s.
    """

    method = "sticky"
    law_type = Sticky
    SCALE = np.array([10e-3, 1e-4, 20e-3, 1.0])  # of the regressor

    def __init__(self, *, gate=None, sample_time=1e-3):
        instance("gate", gate, (palpate.ContactGate, type(None)))
        number_in("sample_time", sample_time, 0.0, 1e6, open_low=True)
        self._settings = {"gate": gate, "sample_time": sample_time}
        self._gate = gate or palpate.ContactGate()
        self.reset()

    def reset(self):
        self._squares = palpate.LeastSquares(4, initial_covariance=1e6)
        self._status, self._samples, self._touching = Status.WAITING, 0, False

    def leave_contact(self):
        self._touching = False
        if self._samples:
            self._status = Status.HELD

    def update(self, penetration, velocity, force, dt=None):
        if not all(map(math.isfinite, (penetration, velocity, force))):
            return Status.NOT_FINITE
        if dt is not None and not (0.0 < dt < math.inf):
            return Status.INVALID_STEP
        gate = self._gate
        least = gate.break_force if self._touching else gate.make_force
        if not (penetration > gate.minimum_penetration and force > least):
            self.leave_contact()
            return self._status
        if max(penetration, abs(velocity), force) > 1e6:
            return Status.OUT_OF_RANGE
        row = np.array([penetration, penetration**2, velocity, 1.0]) / self.SCALE
        status = self._squares.update(row, force)
        if status in (Status.UPDATED, Status.GUARDED):
            self._status, self._touching = status, True
            self._samples += 1
        return status

    def predict(self, penetration, velocity):
        if not 0.0 < penetration < 1e6:
            return 0.0
        row = np.array([penetration, penetration**2, velocity, 1.0]) / self.SCALE
        return float(row @ self._squares.parameters)

    def estimate(self):
        unit = np.outer(self.SCALE, self.SCALE)
        covariance = self._squares.noise_variance * self._squares.covariance / unit
        law = Sticky.from_parameters(self._squares.parameters / self.SCALE)
        return palpate.Estimate.from_law(
            law, covariance, status=self._status, samples=self._samples
        )


STICKY, FUNG = Sticky(K1=800.0, K2=3e4, B=12.0, A=0.5), Fung(A=0.8, d=4e-3, B=1500.0)
TRUTHS = {"sticky": STICKY, "fung": FUNG}


@pytest.fixture
def registered():
    for law in TRUTHS.values():
        force_laws.register(type(law))
    yield
    for kind in TRUTHS:
        del force_laws.FORCE_LAWS[kind], contact_estimator.ESTIMATORS[kind]


@pytest.mark.long
@pytest.mark.parametrize("name", ["fung", "own"])
@pytest.mark.parametrize("promise", conformance.CHECKS.values(), ids=conformance.CHECKS)
def test_custom_laws_and_methods_pass_the_conformance_tests(promise, name, registered, monkeypatch):
    """On the first half second, in which the ball is touched twice: Python is slow."""
    shorter = functools.partial(conformance._tapping, 0.5)
    monkeypatch.setattr(conformance, "_tapping", shorter)
    kind = palpate.ESTIMATORS.get(name, StickyRLS)
    promise(kind, conformance.variants(kind)["everything"])


def test_a_custom_method_replaces_the_default_of_its_law(registered):
    contact_estimator.register(StickyRLS)
    assert palpate.ESTIMATORS["sticky"] is StickyRLS
    assert pickle.loads(pickle.dumps(palpate.ESTIMATORS["fung"]())).law_type is Fung


def fitted(law, seed, seconds=2.0):
    """What the least squares of a law makes of 0.05 N of noise, and the samples."""
    signals = exciting(law, seconds=seconds, noise=0.05, seed=seed)
    estimator = palpate.ESTIMATORS[law.kind]()
    estimator.replay(*signals.arrays, at=())
    estimator.finish_pending()
    return estimator.estimate(), signals


@pytest.mark.parametrize("name", TRUTHS)
def test_binned_samples_keep_the_optimum_and_the_bars(name, registered):
    truth = TRUTHS[name]
    estimate, signals = fitted(truth, seed=1)
    x, v, force = signals.arrays
    # The offset and the adhesion of the sticky law are one: SciPy keeps the offset at its estimate.
    free = 1.0 if name == "fung" else 0.0

    def residual(found):
        law = truth.from_parameters(found[:-1] * truth.parameters)
        return law.force(x, v) + free * found[-1] + (1.0 - free) * estimate.offset - force

    start = np.append(np.ones_like(truth.parameters), 0.0)
    best = optimize.least_squares(residual, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    noise = np.sqrt(2.0 * best.cost / len(x))
    bars = noise * np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)))[:-1] * truth.parameters
    apart = (estimate.parameters - best.x[:-1] * truth.parameters) / bars
    # Within a cell a law is as good as linear, to this part of an error.
    assert np.abs(apart).max() < 0.02
    if free:
        np.testing.assert_allclose(estimate.standard_errors, bars, rtol=5e-3)


@pytest.mark.slow
def test_the_bars_of_a_law_of_ones_own_hold_and_are_at_the_bound(registered):
    estimates = [fitted(FUNG, seed)[0] for seed in range(100)]
    errors = np.array([each.parameters - FUNG.parameters for each in estimates])
    bars = np.array([each.standard_errors for each in estimates])
    x, v, _ = exciting(FUNG, seconds=2.0).arrays
    slopes = np.column_stack([FUNG.parameter_gradient(x, v), np.ones_like(x)])
    bound = 0.05 * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))[:3]
    # A spread of 100 is known to 7 %, and their part within two bars to 2 %.
    np.testing.assert_allclose(np.sqrt(np.mean(errors**2, axis=0)) / bound, 1.0, atol=0.21)
    np.testing.assert_allclose(bars.mean(axis=0) / bound, 1.0, atol=0.02)
    assert ((np.abs(errors) < 1.96 * bars).mean(axis=0) > 0.88).all()


@pytest.mark.long
def test_a_custom_law_works_in_every_command(run, tmp_path, registered, undrawn):
    file, folder = tmp_path / "pressed.csv", tmp_path / "result"
    numbers = [f"--{name}={value}" for name, value in FUNG.as_dict().items()]
    quick = ("--probe", "ideal", "--seconds", 3, "-o", file)
    assert run("lab", "fung", *numbers, *quick)[0] == 0
    status, out, _ = run("identify", file, "--law", "fung", "-o", folder, "-v")
    assert status == 0
    assert "truth 0.004" in out  # from the file's notes
    [result] = json.loads((folder / "result.json").read_text(encoding="utf-8"))["results"]
    for name, value in FUNG.as_dict().items():
        assert result["law"][name] == pytest.approx(
            value, abs=4.0 * result["standard_errors"][name]
        )
    saved = palpate.load_result(folder)
    assert {"kind": "fung", **saved.law.as_dict()} == result["law"]
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "Contact model: fung" in report
    assert (
        run("export", folder, "--to", "mujoco", "--mass", 1, "--allow", "-o", tmp_path / "out")[0]
        == 0
    )
    assert "nearest along this motion" in (tmp_path / "out" / "statement.md").read_text("utf-8")
    results = palpate.compare(file)
    assert list(results)[-2:] == list(TRUTHS)
    best = min(results.values(), key=lambda each: each.fit_rmse_percent)
    assert best.law.kind == "fung"
    figure = figures.draw(results["fung"], ["stiffness", "parameters"])
    labels = {"A [N]", "d [m]", "B [N·s/m²]"}
    assert labels <= {axes.get_ylabel() for axes in figure.axes}
    bound = cramer_rao_bound(FUNG, *exciting(FUNG).arrays[:2], 0.05)
    assert np.isfinite(bound).all()


def test_a_change_of_a_material_is_found_by_its_own_law(registered):
    before, after = (
        exciting(FUNG, seconds=6.0, noise=0.05),
        exciting(Fung(A=1.2, d=4e-3, B=1500.0), seconds=6.0, noise=0.05),
    )
    force = np.where(before.time < 3.0, before.force, after.force)
    contact = contact_of(replace(before, force=force))
    findings = palpate.diagnose(contact, law="fung").findings
    assert "change" in {each.check for each in findings}


INCOMPLETE = {
    "no estimator": (contact_estimator.register, int, "must be a ContactEstimator"),
    "no law": (force_laws.register, int, "must be a dataclass of ForceLaw"),
    "a law whose coefficient is called as what is felt": (
        force_laws.register,
        make_dataclass("Named", [("stiffness", float)], bases=(Sticky,), frozen=True, kw_only=True),
        "Named.stiffness is felt at a depth: name a coefficient by its symbol",
    ),
    "a name that is taken": (
        contact_estimator.register,
        type("Other", (StickyRLS,), {"method": "single-stage"}),
        "method 'single-stage' is taken by SingleStageRLS: choose another",
    ),
    "a part that is missing": (
        contact_estimator.register,
        type("Half", (palpate.PythonEstimator,), {"method": "half", "law_type": Sticky}),
        "Half lacks update, predict, estimate, reset, leave_contact",
    ),
}


@pytest.mark.parametrize("register, thing, words", INCOMPLETE.values(), ids=INCOMPLETE)
def test_incomplete_laws_and_methods_are_not_registered(register, thing, words):
    before = dict(contact_estimator.ESTIMATORS), dict(force_laws.FORCE_LAWS)
    with pytest.raises(palpate.InvalidParameterError, match=words):
        register(thing)
    assert before == (contact_estimator.ESTIMATORS, force_laws.FORCE_LAWS)
