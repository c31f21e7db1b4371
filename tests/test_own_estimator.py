"""A law and an estimator of one's own, made known by the same registries as the package's."""

import json
import math
import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import palpate
from palpate import Status, figures, force_laws, lab
from palpate.design.precision import cramer_rao_bound
from palpate.estimators import conformance, contact_estimator
from palpate.validation import instance, number_in


@dataclass(frozen=True, slots=True)
class Sticky(force_laws.ForceLaw):
    """F = K₁ x + K₂ x² + B v + A for x > 0, else 0: four parameters."""

    stiffness: float
    quadratic_stiffness: float
    damping: float
    adhesion: float
    kind: ClassVar[str] = "sticky"
    units: ClassVar[tuple[str, ...]] = ("N/m", "N/m²", "N·s/m", "N")
    symbols: ClassVar[tuple[str, ...]] = ("K₁", "K₂", "B", "A")

    def force(self, penetration, velocity):
        x, v = np.broadcast_arrays(penetration, velocity)
        row = np.stack([x, x * x, v, np.ones_like(x, dtype=float)], axis=-1)
        force = np.where(x > 0.0, row @ self.parameters, 0.0)
        return float(force) if force.ndim == 0 else force

    def parameter_gradient(self, penetration, velocity):
        ones = np.ones_like(penetration)
        return np.column_stack([penetration, penetration**2, velocity, ones])

    def penetration_gradient(self, penetration, velocity):
        return self.stiffness + 2.0 * self.quadratic_stiffness * penetration


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
        if not penetration > 0.0:
            return 0.0
        row = np.array([penetration, penetration**2, velocity, 1.0]) / self.SCALE
        return float(row @ self._squares.parameters)

    def estimate(self):
        unit = np.outer(self.SCALE, self.SCALE)
        covariance = self._squares.noise_variance * self._squares.covariance / unit
        law = Sticky(*(self._squares.parameters / self.SCALE))
        return palpate.Estimate.from_law(
            law, covariance, status=self._status, samples=self._samples
        )


@pytest.fixture
def registered():
    force_laws.register(Sticky)
    contact_estimator.register(StickyRLS)
    yield
    del force_laws.FORCE_LAWS["sticky"], contact_estimator.ESTIMATORS["sticky"]


TRUTH = Sticky(800.0, 3e4, 12.0, 0.5)


@pytest.fixture
def recording(tmp_path, registered):
    bench = lab.Bench(lab.Homogeneous(TRUTH), lab.THREE_SINES, lab.IdealProbe())
    palpate.write_contact(bench.run(seconds=4.0).contact, tmp_path / "sticky.csv")
    return tmp_path / "sticky.csv"


def test_it_passes_the_conformance_suite(registered):
    conformance.check(StickyRLS)


def test_it_is_compared_with_the_others_and_its_four_parameters_are_drawn(recording):
    results = palpate.compare(recording)
    assert list(results)[-1] == "sticky"
    assert results["sticky"].fit_rmse_percent < 1.0
    figure = figures.draw(results["sticky"])
    labels = {"K₁ [N/m]", "K₂ [N/m²]", "B [N·s/m]", "A [N]"}
    assert labels <= {axes.get_ylabel() for axes in figure.axes}


@pytest.mark.slow
def test_the_command_line_presses_the_law_and_identifies_it(run, printed, tmp_path, registered):
    file = tmp_path / "pressed.csv"
    numbers = [f"--{name.replace('_', '-')}={value}" for name, value in TRUTH.as_dict().items()]
    quick = ("--probe", "ideal", "--seconds", 4, "-o", file)
    assert run("lab", "sticky", *numbers, *quick)[0] == 0
    out = printed("identify", file, "--method", "sticky", "--json")
    [result] = json.loads(out)["results"]
    assert result["law"]["kind"] == "sticky"
    for name, value in TRUTH.as_dict().items():
        error = result["standard_errors"][name]
        # Rounding to 1/8 N is not white here, and this estimator's bars know white noise only.
        assert abs(result["law"][name] - value) < 10.0 * error, name
    table = run("identify", file, "--method", "sticky")[1]
    assert re.search(r"A = 0\.\S* ± \S* N +truth 0\.5,", table)  # from the file's notes
    assert "A" in run("compare", file)[1]


def test_its_bound_is_known(registered):
    contact = lab.Bench(lab.BALL, lab.THREE_SINES, lab.IdealProbe()).run(seconds=4.0).truth
    bound = cramer_rao_bound(TRUTH, contact.penetration, contact.velocity, 0.05)
    assert bound.shape == TRUTH.parameters.shape
    assert np.isfinite(bound).all()


INCOMPLETE = {
    "no estimator": (contact_estimator.register, int, "must be a ContactEstimator"),
    "no law": (force_laws.register, int, "must be a dataclass of ForceLaw"),
    "a name that is taken": (
        contact_estimator.register,
        type("Other", (StickyRLS,), {"method": "single-stage"}),
        "method must be new: 'single-stage' is SingleStageRLS",
    ),
    "a part that is missing": (
        contact_estimator.register,
        type("Half", (palpate.PythonEstimator,), {"method": "half", "law_type": Sticky}),
        "Half lacks update, predict, estimate, reset, leave_contact",
    ),
}


@pytest.mark.parametrize("register, thing, words", INCOMPLETE.values(), ids=INCOMPLETE)
def test_what_is_incomplete_is_not_registered(register, thing, words):
    before = dict(contact_estimator.ESTIMATORS), dict(force_laws.FORCE_LAWS)
    with pytest.raises(palpate.InvalidParameterError, match=words):
        register(thing)
    assert before == (contact_estimator.ESTIMATORS, force_laws.FORCE_LAWS)
