"""Whole curves: the minimum of the stated cost, whatever the motion, with honest error bars."""

from typing import Any

import numpy as np
import pytest

import palpate
from benchmarks.curves import (
    MOTIONS,
    UNKNOWN,
    Curves,
    Reference,
    apart_from_the_recursion,
    approach_and_retract,
    random_curves,
    rolled,
    stated_cost,
)
from benchmarks.curves import parameters as columns
from palpate import CurveFits, HuntCrossley, InvalidParameterError, fit_curves
from palpate.method.estimators.least_squares import fit_surface_position, least_squares

# ``python -m benchmarks.curves`` asks the same of hundreds of curves.
SURFACES = UNKNOWN["surface_range"]


def fitted(curves: Curves, **more: Any) -> CurveFits:
    return fit_curves(curves.penetration, curves.velocity, curves.force, **more)


def parameters(fits: CurveFits) -> np.ndarray:
    return np.stack(columns(fits), axis=1)


def excess(curves: Curves, starts: int, **more: Any) -> np.ndarray:
    """J above the lowest that SciPy finds, in σ²."""
    fits = fitted(curves, **more)
    result = np.empty(len(curves))
    for k, found in enumerate(parameters(fits)):
        row = curves.penetration[k], curves.velocity[k], curves.force[k]
        cost = stated_cost(*row, **more)
        own = cost.value(found)
        # The last step is taken without another look at the samples.
        assert own == pytest.approx(fits.cost[k], abs=1e-4 * fits.noise[k] ** 2)
        least = Reference(cost, more.get("surface_range")).least(starts)
        result[k] = (own - least) / fits.noise[k] ** 2
    return result


@pytest.mark.long
@pytest.mark.parametrize("name", MOTIONS)
def test_the_fit_of_a_curve_is_scipys_minimum(name: str) -> None:
    curves = random_curves(MOTIONS[name], 8, seed=11)
    assert (excess(curves, 7) < 1e-4).all()
    curves = random_curves(MOTIONS[name], 5, surface=True, seed=12)
    assert (excess(curves, 24, **UNKNOWN) < 1e-4).all()


def quickening(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One way, faster with depth."""
    return 1.3 * time**1.5 - 0.3, time**0.5


@pytest.mark.long
@pytest.mark.parametrize("offset", [True, False])
def test_short_one_way_curves_end_in_the_better_of_their_valleys(offset: bool) -> None:
    # J has one at stiffness below 0, beside that of the other exponent.
    curves = random_curves(quickening, 50, samples=40, seed=0)
    assert (excess(curves, 5, offset=offset) < 1e-2).all()


def test_a_fixed_exponent_gives_scipys_minimum_too() -> None:
    curves = random_curves(approach_and_retract, 5, surface=True, exponents=(1.5, 1.5), seed=13)
    assert (excess(curves, 24, exponent=1.5, **UNKNOWN) < 1e-4).all()
    assert (excess(curves, 4, exponent=1.5, offset=False) < 1e-4).all()
    fits = fitted(curves, exponent=1.5, **UNKNOWN)
    assert (fits.n == 1.5).all()
    assert (fits.standard_errors[:, 2] == 0.0).all()


def test_the_recursion_lies_within_a_tenth_of_a_standard_error() -> None:
    curves = random_curves(MOTIONS["palpation"], 20, seed=6)
    assert apart_from_the_recursion(curves, {}).max() < 0.1
    curves = rolled(random_curves(approach_and_retract, 20, seed=6))
    assert apart_from_the_recursion(curves, {}).max() < 0.1
    # With the surface unknown within half of one.
    curves = random_curves(MOTIONS["palpation"], 4, surface=True, seed=7)
    apart = apart_from_the_recursion(curves, UNKNOWN)
    assert np.median(apart) < 0.1
    assert apart.max() < 0.5


@pytest.mark.parametrize("seed", range(6))
def test_all_fits_of_a_law_end_in_the_same_minimum(seed: int) -> None:
    curves = random_curves(approach_and_retract, 1, surface=True, exponents=(1.0, 2.2), seed=seed)
    fits, noise = fitted(curves, **UNKNOWN), float(curves.noise[0])
    samples = np.array([curves.penetration[0], curves.velocity[0], curves.force[0]])
    depth, speed, largest = samples.max(axis=1)
    samples = samples[:, samples[0] > SURFACES[0] - 0.1 * depth]  # as fit_curves takes them
    x, v, force = samples = samples / [[depth], [speed], [1.0]]
    starts = np.array([(largest, 0.0, n, 0.0, 0.0) for n in (1.0, 1.5, 2.0)])
    found = fit_surface_position(samples, starts)

    def model(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        law, below = HuntCrossley.from_parameters(parameters[:3]), x - parameters[4]
        inside, below = below > 0.0, np.where(below > 0.0, below, 1.0)
        rows = [*law.parameter_gradient(below, v).T, -law.penetration_gradient(below, v)]
        jacobian = np.insert(np.array(rows).T * inside[:, None], 3, 1.0, axis=1)
        return force - jacobian[:, [0, 1, 3]] @ parameters[[0, 1, 3]], jacobian

    each = [least_squares(model, start) for start in starts]
    twin = min(each, key=lambda one: float(one.residual @ one.residual))
    errors = np.sqrt(np.diag(np.linalg.inv(found.jacobian.T @ found.jacobian))) * noise
    assert (np.abs(twin.parameters - found.parameters) < 1e-2 * errors).all()
    # Weak priors move the answer, and its bars allow for noise that is no white one.
    own = fits.standard_errors[0, 4]
    assert abs(found.parameters[4] * depth - fits.surface[0]) < 0.2 * own
    assert 0.8 < own / (errors[4] * depth) < 2.2


@pytest.mark.parametrize("surface", [False, True])
def test_error_bars_hold_the_truth(surface: bool) -> None:
    curves = random_curves(approach_and_retract, 300, surface=surface, seed=21)
    fits = fitted(curves, **(UNKNOWN if surface else {}))
    # About n = 1 a kink may keep a descent from settling; what it ends with counts all the same.
    assert np.count_nonzero(fits.status) <= (6 if surface else 0)
    # Where noise is 3 % of the peak some exponents are known to no better than 0.2.
    assert np.count_nonzero(fits.flags) <= (6 if surface else 0)
    open_ = 5 if surface else 4
    z = ((parameters(fits) - curves.truth)[:, :open_]) / fits.standard_errors[:, :open_]
    # 95 in 100 promised; of 300 four standard deviations are 5 %.
    held = (np.abs(z) < 1.96).mean(axis=0)
    assert (held > 0.90).all()
    assert (np.sqrt((z**2).mean(axis=0)) > 0.6).all()
    assert fits.noise == pytest.approx(curves.noise, rel=0.15)


@pytest.mark.parametrize("motion", ["approach–retract", "palpation"])
@pytest.mark.parametrize("shift", [-6e-3, -3e-3, 3e-3, 40e-3])
@pytest.mark.parametrize("approach", [True, False], ids=["approach", "contact only"])
def test_a_surface_outside_the_default_range_is_found(
    motion: str, shift: float, approach: bool
) -> None:
    curves = random_curves(MOTIONS[motion], 20, seed=3)
    there = approach | (curves.penetration > 1.5e-3)
    force = np.where(there, curves.force, np.nan)
    fits = fit_curves(curves.penetration + shift, curves.velocity, force, surface="estimate")
    assert fits.status_names.count("fitted") >= 19
    z = (fits.surface - shift) / fits.standard_errors[:, 4]
    assert np.abs(z).max() < 4.0
    errors = fits.standard_errors[:, :3]
    assert (np.abs(parameters(fits)[:, :3] - curves.truth[:, :3]) < 4.0 * errors).all()


def test_a_surface_at_the_edge_of_its_range_is_not_called_fitted() -> None:
    curves = random_curves(approach_and_retract, 2, seed=3)
    narrow = fitted(curves, surface="estimate", surface_range=(1e-3, 2e-3))
    assert set(narrow.status_names) == {"surface at the edge of its range"}
    # Far above the first sample, by 15 travels of the probe: even the wider range ends before it.
    depth, speed = approach_and_retract(np.linspace(0.0, 1.0, 400))
    depth, speed = 5.5e-3 + 5e-4 * depth, 1e-3 * speed
    force = HuntCrossley(K=4e4, B=1e6, n=2.0).force(depth + 10e-3, speed)
    rising = fit_curves(depth, speed, force, surface="estimate", noise=1e-4)
    assert rising.status_names == ["surface at the edge of its range"]


@pytest.mark.parametrize("more", [{}, UNKNOWN])
def test_threads_instruction_sets_and_neighbours_change_no_bit(more: dict[str, Any]) -> None:
    curves = random_curves(approach_and_retract, 40, surface=bool(more), seed=31)
    alone = fitted(curves, **more)
    shared = fitted(curves, threads=3, **more)
    for name in ("K", "covariance", "cost", "taken", "flags"):
        assert np.array_equal(getattr(alone, name), getattr(shared, name))
    one = fit_curves(curves.penetration[7], curves.velocity[7], curves.force[7], **more)
    assert one.K[0] == alone.K[7]
    numbers = {set_: core_numbers(curves, more, set_) for set_ in ("baseline", "")}
    assert np.array_equal(numbers["baseline"], numbers[""])
    assert np.array_equal(numbers[""][:, 0], alone.K)


def core_numbers(curves: Curves, more: dict[str, Any], instruction_set: str) -> np.ndarray:
    count = len(curves)
    numbers, covariances = np.empty((count, 13)), np.empty((count, 5, 5))
    status, flags = np.empty(count, np.int64), np.empty((count, 2), np.uint8)
    channels = curves.penetration, curves.velocity, curves.force
    priors = (0.3, 3.6), True, 0.0, np.zeros(count), np.zeros(count)
    results = numbers, covariances, status, flags
    searched = more.get("surface_range"), (0.0, 0.0, 0.0)
    palpate._core.fit_curves(*channels, *priors, *searched, *results, None, 1, instruction_set)
    return numbers


def test_samples_that_are_nan_are_not_there() -> None:
    curves = random_curves(MOTIONS["palpation"], 2, seed=41)
    short = fit_curves(*(a[:, :700] for a in (curves.penetration, curves.velocity, curves.force)))
    force = curves.force.copy()
    force[:, 700:] = np.nan
    filled = fit_curves(curves.penetration, curves.velocity, force)
    assert np.array_equal(short.K, filled.K)
    assert np.array_equal(short.covariance, filled.covariance)


def test_a_tare_is_a_prior_and_its_contradiction_is_flagged() -> None:
    curves = random_curves(MOTIONS["palpation"], 3, seed=42)
    inside = curves.penetration > 0.0
    force = np.where(inside, curves.force + 0.5, np.nan)  # no free air, and 0.5 N beside the tare
    tares = [0.001, np.nan, 0.001]
    fits = fit_curves(curves.penetration, curves.velocity, force, offset_deviation=tares)
    assert [bool(flags & 64) for flags in fits.flags.tolist()] == [True, False, True]
    assert "tare" in fits.describe_flags(0)[-1]
    assert fits.offset[0] == pytest.approx(curves.truth[0, 3] + 0.5, abs=0.05)


def test_curves_without_contact_have_no_answer() -> None:
    nothing = np.full((1, 50), -1e-3)
    fits = fit_curves(nothing, nothing, nothing)
    assert fits.status_names == ["no contact"]
    assert np.isnan(fits.K[0])
    assert fits.taken[0] == 0
    assert len(fit_curves(*[np.empty((0, 10))] * 3)) == 0
    with pytest.raises(InvalidParameterError, match="the curve has no contact"):
        stated_cost(nothing[0], nothing[0], nothing[0])
    x = np.linspace(1e-3, 5e-3, 100)
    v = np.full_like(x, 0.01)
    fits = fit_curves(x, v, HuntCrossley(K=100.0, B=0.0, n=1.5).force(x, v), noise=1e-3)
    assert isinstance(fits.law(0), HuntCrossley)
    assert any("damping" in words for words in fits.describe_flags(0))


def test_units_change_nothing() -> None:
    curves = random_curves(approach_and_retract, 4, surface=True, seed=51)
    usual = fitted(curves, **UNKNOWN)
    channels = 1e-6 * curves.penetration, 1e-6 * curves.velocity, 1e-9 * curves.force
    reach = (1e-6 * SURFACES[0], 1e-6 * SURFACES[1])
    small = fit_curves(*channels, surface="estimate", surface_range=reach)
    assert small.n == pytest.approx(usual.n, rel=1e-6)
    assert small.surface == pytest.approx(1e-6 * usual.surface, rel=1e-6)
    own = 1e-6 * usual.standard_errors[:, 4]
    assert small.standard_errors[:, 4] == pytest.approx(own, rel=1e-4)


def test_a_range_without_a_search_or_wrong_shapes_are_refused() -> None:
    with pytest.raises(InvalidParameterError, match="surface_range needs"):
        fit_curves(*[np.ones((2, 5))] * 3, surface_range=(0.0, 1e-3))
    for shape, other in (((2, 5), (2, 6)), ((2, 5, 1), (2, 5, 1))):
        with pytest.raises(InvalidParameterError, match="must all have shape"):
            fit_curves(np.ones(shape), np.ones(shape), np.ones(other))
