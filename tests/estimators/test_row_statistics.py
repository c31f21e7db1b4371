"""Order statistics of rows: NumPy's, to the bit, whatever the numbers are like."""

import math

import numpy as np
import pytest

from palpate.input.preparation.gate import LARGEST
from palpate.input.preparation.resolution import estimate_resolutions, noise_of
from palpate.input.preparation.velocity import find_spikes, largest_of, spikes_of_rows, step_of

# So many that cells are looked through, and so few that they are not.
SIZES = [1, 2, 3, 4, 5, 6, 127, 128, 129, 1000, 2001]


def channels(size):
    """Numbers that are even, in heaps, equal, of one absurd size, rounded, or smooth."""
    random = np.random.default_rng(size)
    normal = random.standard_normal(size)
    far, absurd = normal.copy(), normal.copy()
    far[size // 2] = 1e300
    absurd[size // 2], absurd[-1] = 1.7e308, -1.7e308
    return {
        "normal": normal,
        "cubed": normal**5,
        "equal": np.full(size, 0.3),
        "zeros of either sign": np.where(normal > 0.0, 0.0, -0.0),
        "one far away": far,
        "the range of a double": absurd,
        "tiny": normal * 5e-324,
        "rounded": np.round(normal, 1),
        "smooth": np.sin(np.arange(size) / 30.0),
        "in two heaps": np.where(normal > 0.0, normal, 1e9 + normal),
    }


@pytest.mark.parametrize("size", SIZES)
def test_noise_and_steps_are_those_of_numpy(size):
    for name, values in channels(size).items():
        with np.errstate(over="ignore"):
            fourth = np.abs(np.diff(values[np.abs(values) < LARGEST], n=4))
            gaps = np.diff(np.unique(values))
            step = np.median(gaps) if gaps.size else 0.0
        noise = np.median(fourth) / 0.6745 / np.sqrt(70.0) if fourth.size else 0.0
        assert noise_of(values) == noise, name
        assert step_of(values) == step, name
        assert largest_of(values) == np.percentile(np.abs(values), 99.9), name


def test_missing_samples_count_for_nothing():
    values = np.random.default_rng(2).standard_normal(900)
    holes = [math.nan, math.inf, math.nan, -math.inf, math.nan]
    with_holes = np.insert(values, [0, 5, 5, 300, 900], holes)
    assert noise_of(with_holes) == noise_of(values)
    assert step_of(with_holes) == step_of(values)
    assert (
        estimate_resolutions(with_holes[None]).tolist()
        == estimate_resolutions(values[None]).tolist()
    )
    nothing = np.full(9, math.nan)
    for none in (nothing, nothing[:0]):
        assert (noise_of(none), step_of(none), largest_of(none)) == (0.0, 0.0, 0.0)
    assert np.isnan(estimate_resolutions(np.array([nothing, np.ones(9)]))).all()
    for samples in (0, 1, 4):
        rows = np.ones((3, samples))
        assert np.isnan(estimate_resolutions(rows)).all()
        assert not spikes_of_rows(rows).any()
        assert len(estimate_resolutions(rows[:0])) == 0


def test_a_spike_is_found_beside_samples_that_are_not_there():
    random = np.random.default_rng(3)
    values = np.sin(np.arange(500) / 40.0) + 1e-3 * random.standard_normal(500)
    values[100] += 0.5
    values[[97, 98, 103]] = math.nan, math.inf, math.nan
    values[301:304] += 0.5  # three are a step
    rows = np.stack([values, np.ones(500), np.full(500, math.nan)])
    for screened in (True, False):
        found = spikes_of_rows(rows, screened=screened, threads=2)
        assert np.argwhere(found).tolist() == [[0, 100]]
    assert np.flatnonzero(find_spikes(values)).tolist() == [100]


@pytest.mark.parametrize("place", [0, 1, -2, -1])
def test_only_a_spike_at_an_end_is_called_one(place):
    random = np.random.default_rng(4)
    values = np.sin(np.arange(500) / 40.0) + 1e-3 * random.standard_normal(500)
    assert not find_spikes(values).any()
    assert not find_spikes(np.cumsum(np.abs(values))).any()
    values[place] += 0.5
    for screened in (True, False):
        found = spikes_of_rows(values[None], screened=screened)[0]
        assert np.flatnonzero(found).tolist() == [place % 500]
