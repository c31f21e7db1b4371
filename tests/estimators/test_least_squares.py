"""The bare engine, for a regression of one's own."""

import copy
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

from palpate import InvalidParameterError, LeastSquares, Status

ORDERS = range(1, 9)


def data(order: int, samples: int = 300, seed: int = 0):
    """Rows, outputs and what they were made from."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-3.0, 3.0, order)
    rows = rng.standard_normal((samples, order))
    return rows, rows @ theta + 0.1 * rng.standard_normal(samples), theta


def taught(order: int, **arguments) -> LeastSquares:
    engine = LeastSquares(order, **arguments)
    for row, output in zip(*data(order)[:2], strict=True):
        assert engine.update(row, float(output)) is Status.UPDATED
    return engine


def batch(rows, outputs, start, prior):
    root = np.linalg.cholesky(np.linalg.inv(prior)).T
    stacked = np.vstack([rows, root])
    return np.linalg.lstsq(stacked, np.concatenate([outputs, root @ start]), rcond=None)[0]


@pytest.mark.parametrize("order", ORDERS)
def test_the_engine_is_batch_least_squares(order):
    engine = taught(order)
    rows, outputs, _ = data(order)
    expected = batch(rows, outputs, np.zeros(order), 1e6 * np.eye(order))
    # White rows are conditioned below 2; P₀ = 1e6 costs its 1e6 roundings, 2e-10, at the start.
    np.testing.assert_allclose(engine.parameters, expected, rtol=1e-9)
    information = rows.T @ rows + 1e-6 * np.eye(order)
    np.testing.assert_allclose(engine.covariance @ information, np.eye(order), atol=1e-9)
    assert engine.samples == len(rows)
    residual = outputs - rows @ engine.parameters
    # The start's part, |θ|²/1e6, is taken out of a sum of about 3.
    expected = residual @ residual / (len(rows) - order)
    assert engine.noise_variance == pytest.approx(expected, rel=1e-8)
    prediction = float(np.dot(rows[0], engine.parameters))
    assert engine.predict(rows[0]) == pytest.approx(prediction, rel=1e-12)
    # A start with its own covariance is more rows; no large P₀, no cancellation.
    rng = np.random.default_rng(order)
    square = rng.standard_normal((order, order))
    prior = square @ square.T + np.eye(order)
    start = {"initial": rng.standard_normal(order), "initial_covariance": (prior + prior.T) / 2.0}
    engine = taught(order, **start)
    expected = batch(rows, outputs, *start.values())
    np.testing.assert_allclose(engine.parameters, expected, rtol=1e-11, atol=1e-13)
    # Forgetting weighs a row, and the start, by all later factors.
    factor, fading = 0.98, LeastSquares(order, **start)
    for row, output in zip(rows, outputs, strict=True):
        fading.update(row, float(output), factor)
    roots = factor ** (0.5 * np.arange(len(rows))[::-1])
    weak = prior / factor ** len(rows)
    expected = batch(roots[:, None] * rows, roots * outputs, start["initial"], weak)
    np.testing.assert_allclose(fading.parameters, expected, rtol=1e-9, atol=1e-12)
    engine.reset()
    assert engine._state() == LeastSquares(order, **start)._state()


def test_a_row_is_any_sequence_of_numbers():
    for row in ([1.0, 2.0], (1.0, 2.0), np.array([1.0, 2.0]), [1, 2]):
        engine = LeastSquares(2)
        assert engine.noise_variance == 1.0
        assert engine.update(row, 3) is Status.UPDATED
        # The start weighs 1/(5 P₀) = 2e-7.
        assert engine.predict(row) == pytest.approx(3.0, rel=1e-5)


REFUSED = {
    "a regressor that is not a number": (([math.nan, 1.0], 1.0), Status.NOT_FINITE),
    "an output that is not a number": (([1.0, 1.0], math.nan), Status.NOT_FINITE),
    "a factor that is not a number": (([1.0, 1.0], 1.0, math.nan), Status.OUT_OF_RANGE),
    "no factor": (([1.0, 1.0], 1.0, 0.0), Status.OUT_OF_RANGE),
    "a negative perturbation": (([1.0, 1.0], 1.0, 1.0, -1.0), Status.OUT_OF_RANGE),
    "an infinite perturbation": (([1.0, 1.0], 1.0, 1.0, math.inf), Status.NOT_FINITE),
    "an output beyond the arithmetic": (([1.0, 1.0], 1e300), Status.OUT_OF_RANGE),
    "finite numbers whose sum is not": (([1.7e308, 1.7e308], 1.0), Status.OUT_OF_RANGE),
}


@pytest.mark.parametrize("arguments, status", REFUSED.values(), ids=REFUSED)
def test_a_refused_row_changes_nothing(arguments, status):
    engine = taught(2)
    before = engine._state()
    assert engine.update(*arguments) is status
    assert engine._state() == before


@pytest.mark.parametrize(
    "row, error, words",
    [
        *((row, ValueError, "2 entries") for row in ([1.0], [1.0, 2.0, 3.0], [])),
        *(
            (row, TypeError, "regressor must hold numbers")
            for row in ("12", ["1", "2"], [1.0, None], [[1.0], [2.0]], [1.0, 2j])
        ),
    ],
)
def test_a_row_of_wrong_size_or_type_is_an_error(row, error, words):
    engine = taught(2)
    before = engine._state()
    for call in (lambda: engine.update(row, 1.0), lambda: engine.predict(row)):
        with pytest.raises(error, match=words):
            call()
    assert engine._state() == before


COPIES = {
    "pickle": lambda e: pickle.loads(pickle.dumps(e)),
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "copy()": lambda e: e.copy(),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("restored", COPIES.values(), ids=COPIES)
def test_to_save_restore_and_continue_is_never_to_have_stopped(order, restored):
    never_stopped = taught(order)
    continued = restored(taught(order))
    rows, outputs, _ = data(order, seed=1)
    for row, output in zip(rows, outputs, strict=True):
        for engine in (never_stopped, continued):
            engine.update(row, float(output), forgetting_factor=0.99)
    assert continued._state() == never_stopped._state()
    assert isinstance(continued, LeastSquares)


def test_an_order_outside_1_to_8_is_refused():
    for order in (0, 9, -1, 2.0, "2", None):
        with pytest.raises(InvalidParameterError, match=r"order .*\[1, 8\].*not"):
            LeastSquares(order)
    for initial in ([1.0], [1.0, math.nan], [1.0, math.inf], [1.0, 1e101]):
        with pytest.raises(InvalidParameterError, match="initial must be 2 finite coefficients"):
            LeastSquares(2, initial=initial)


def exactly_positive_definite(matrix: np.ndarray) -> bool:
    """By elimination in fractions: no rounding of the test's own."""
    rows = [[Fraction(value) for value in row] for row in matrix.tolist()]
    for k, pivot_row in enumerate(rows):
        if pivot_row[k] <= 0:
            return False
        for row in rows[k + 1 :]:
            ratio = row[k] / pivot_row[k]
            row[:] = [a - ratio * b for a, b in zip(row, pivot_row, strict=True)]
    return True


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("spread", [0.0, 1e-9, 1e-7, 1e-5])
def test_nearly_equal_rows_keep_the_covariance_definite(order, spread):
    """Here P − L gᵀ cancels until rounding alone decides the sign of a pivot."""
    rng = np.random.default_rng(order)
    engine = LeastSquares(order)
    base = rng.uniform(0.5, 2.0, order)
    for k in range(400):
        engine.update(base * (1.0 + spread * rng.standard_normal(order)), 1.0, 0.98)
        if k % 20 == 0 or k < 20:
            assert exactly_positive_definite(engine.covariance), k
