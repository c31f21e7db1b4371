"""Where the material begins is found, with an error bar, from samples that include the approach."""

from typing import Any

import numpy as np
import pytest
from probing import (
    MATERIALS,
    NOISE,
    PVC,
    SAMPLE_TIME,
    Floats,
    Motion,
    fed,
    joined,
    relative_error,
    tapping,
    three_sines,
    white,
)
from scipy.stats import binom

from palpate import (
    Contact,
    HuntCrossley,
    InvalidParameterError,
    RecordingError,
    Scale,
    Status,
    VariableProjection,
    identify,
)

def searching(**settings: Any) -> VariableProjection:
    return VariableProjection(surface="estimate", **settings)


def approached(seconds: float, surface: float, from_height: float = 3e-3) -> Motion:
    """Down at 13 mm/s from the free to 10 mm below ``surface``, then the three sines."""
    down = np.arange(-from_height, 10e-3, 13e-3 * SAMPLE_TIME)
    stroke = Motion(surface + down, np.full(down.size, 13e-3))
    sines = three_sines(seconds - SAMPLE_TIME * down.size)
    return joined(stroke, Motion(surface + sines.x, sines.v))


def felt_below(
    law: HuntCrossley, motion: Motion, surface: float, seed: int, offset: float = 0.0
) -> Floats:
    clean = law.force(motion.x - surface, motion.v)
    return clean + offset + white(len(motion), seed)


def contact_of(motion: Motion, force: Floats, **more: Any) -> Contact:
    return Contact(motion.time, penetration=motion.x, velocity=motion.v, force=force, **more)


@pytest.mark.parametrize("surface", [-1.9e-3, 0.0, 0.33e-3, 1.9e-3])
def test_the_surface_of_the_phantom_is_found_within_40_micrometres(surface: float) -> None:
    motion = approached(20.0, surface)
    for seed in range(3):
        force = felt_below(PVC, motion, surface, seed, offset=0.1)
        estimate = fed(searching(), motion, force).estimate()
        assert abs(estimate.surface - surface) <= 40e-6
        # Four standard errors, of 12 numbers in all.
        assert abs(estimate.surface - surface) < 4.0 * estimate.surface_standard_error
        assert abs(estimate.offset - 0.1) < 4.0 * estimate.offset_standard_error
        assert relative_error(estimate.law, PVC)[0] <= 0.015
        assert not estimate.flags


@pytest.mark.parametrize("name", MATERIALS)
def test_the_law_is_in_its_own_coordinate_and_predictions_in_the_penetrations(name: str) -> None:
    law, surface = MATERIALS[name], -0.7e-3
    motion = tapping(10.0, surface)
    estimator = fed(searching(), motion, felt_below(law, motion, surface, 1))
    estimate = estimator.estimate()
    assert (np.abs(estimate.parameters - law.parameters) < 4 * estimate.standard_errors).all()
    depth = 8e-3
    predicted = estimator.predict(surface + depth, 0.02)
    # A few of its standard deviations, the noise over the root of some thousand samples.
    assert predicted == pytest.approx(law.force(depth, 0.02), abs=0.2 * NOISE)
    assert estimator.predict(surface - 2e-3, 0.0) == pytest.approx(0.0, abs=0.2 * NOISE)
    own = estimate.law.force(surface + depth - estimate.surface, 0.02) + estimate.offset
    assert predicted == pytest.approx(own, rel=1e-12)


def check_coverage(law: HuntCrossley, seeds: range) -> None:
    inside, laws = 0, np.zeros(3)
    for seed in seeds:
        # Anywhere between two candidates: 0.1 mm apart.
        surface = np.random.default_rng(seed).uniform(-1e-3, 1e-3)
        motion = tapping(4.0, surface)
        force = felt_below(law, motion, surface, seed)
        estimate = fed(searching(), motion, force).estimate()
        inside += abs(estimate.surface - surface) < 1.96 * estimate.surface_standard_error
        laws += np.abs(estimate.parameters - law.parameters) < 1.96 * estimate.standard_errors
    low = binom.ppf(0.001, len(seeds), 0.95)
    # Bars allow for how little is known of the noise, and hold the truth more often where it is
    # white: in up to 98.5 %.
    high = binom.ppf(0.999, len(seeds), 0.985)
    assert low <= inside <= high
    assert (laws >= low).all()
    assert (laws <= high).all()


@pytest.mark.parametrize("name", ["ball", "pvc"])
def test_the_error_bar_of_the_surface_is_true(name: str) -> None:
    check_coverage(MATERIALS[name], range(30))


@pytest.mark.slow
@pytest.mark.parametrize("name", MATERIALS)
def test_the_error_bar_of_the_surface_is_true_over_many_seeds(name: str) -> None:
    check_coverage(MATERIALS[name], range(1000, 1600))


def test_a_surface_beyond_the_range_is_flagged() -> None:
    motion = tapping(5.0, 1e-3)
    force = felt_below(PVC, motion, 1e-3, 2)
    estimator = searching(surface_range=(-0.5e-3, 0.5e-3))
    flags = fed(estimator, motion, force).estimate().flags
    assert any(flag.startswith("surface at the edge") for flag in flags)
    wider = estimator.replace(surface_range=(-0.5e-3, 2e-3))
    assert not fed(wider, motion, force).estimate().flags


def test_identify_finds_the_surface_of_a_contact_with_free_approach() -> None:
    surface = 0.4e-3
    motion = approached(5.0, surface)
    contact = contact_of(motion, felt_below(PVC, motion, surface, 3))
    result = identify(contact, searching())
    assert abs(result.estimate.surface - surface) < 4.0 * result.estimate.surface_standard_error
    assert result.as_dict()["surface"] == result.estimate.surface
    # A fit to all samples leaves the noise: the force is 8 N in the mean.
    residual = result.fitted_force - contact.force
    assert np.std(residual) == pytest.approx(NOISE, rel=0.05)
    ignoring = identify(contact).law
    assert relative_error(result.law, PVC)[0] < 0.2 * relative_error(ignoring, PVC)[0]


def test_segments_of_one_contact_are_separated_without_inventing_a_sample() -> None:
    # At x = 0 this material is 1.5 mm deep: a sample there without force would be a lie.
    surface = -1.5e-3
    motion = tapping(1.5, surface)
    force = felt_below(MATERIALS["ball"], motion, surface, 4)
    segments = np.arange(len(motion)) // 40
    contact = contact_of(motion, force, segment=segments)
    result = identify(contact, searching())
    assert result.estimate.samples == np.count_nonzero(result.trace.taken)
    whole = identify(contact_of(motion, force), searching())
    # Time steps differ at the borders, but nothing is forgotten.
    assert np.array_equal(result.estimate.parameters, whole.estimate.parameters)
    assert result.estimate.surface == whole.estimate.surface


@pytest.mark.parametrize("rise", [0.0, 5e-3])
def test_a_contact_without_free_approach_is_refused_in_plain_words(rise: float) -> None:
    motion = three_sines(2.0)
    deeper = Motion(motion.x + rise, motion.v)
    contact = contact_of(deeper, felt_below(PVC, deeper, 0.0, 5), source="pressed.csv")
    with pytest.raises(RecordingError, match=r"pressed\.csv: .*surface.*free approach") as refusal:
        identify(contact, searching())
    assert "0 of 2000 samples" in str(refusal.value)
    assert identify(contact).law.exponent > 0.0  # with the surface known there is no such need
    motion = approached(2.0, 0.0, from_height=3e-3)
    force = felt_below(PVC, motion, 0.0, 6)
    touch = int(np.argmax(motion.x > 0.0))
    # The surface is known to some ten samples of this approach (13 µm each).
    enough, few = slice(touch - 60, None), slice(touch - 5, None)
    identify(contact_of(motion[enough], force[enough]), searching())
    with pytest.raises(RecordingError, match="at least 20"):
        identify(contact_of(motion[few], force[few]), searching())


def test_the_approach_counts_without_positive_force_and_far_away_it_does_not() -> None:
    estimator = VariableProjection(surface="estimate")  # ±2 mm, and 1 mm before them
    assert estimator.update(-5e-3, 0.01, -0.01) == Status.WAITING
    assert estimator.update(-2.5e-3, 0.01, -0.01) == Status.UPDATED
    assert estimator.update(1e-3, 0.01, -0.01) == Status.UPDATED
    assert estimator.update(-5e-3, -0.01, 0.0) == Status.HELD
    assert estimator.estimate().samples == 2


NEEDLE = Scale(1e-6, 1.0, 1.0)


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"surface": "search"}, "surface must be 'estimate' or None, not 'search'"),
        ({"surface": 0.0}, "surface must be 'estimate' or None, not 0.0"),
        ({"surface": None, "surface_range": (-1e-3, 1e-3)}, "_range is for surface='estimate'"),
        ({"surface_range": (1e-3, -1e-3)}, "surface_range .* holds nothing"),
        ({"surface_range": (1e-3, 1e-3)}, "surface_range .* holds nothing"),
        ({"surface_range": (0.0, 0.06)}, r"surface_range must be in .*0.06"),
        ({"surface_range": 1e-3}, r"surface_range must be \(lowest, highest"),
        ({"surface_range": (0.0, np.nan)}, "surface_range must be finite"),
        ({"surface_range": (0.0, 1e-3), "scale": NEEDLE}, r"in \[-5e-06, 5e-06\], not 0.001"),
    ],
)
def test_a_wrong_surface_setting_is_named_with_its_value(settings: dict, message: str) -> None:
    with pytest.raises(InvalidParameterError, match=message):
        VariableProjection(**{"surface": "estimate", **settings})
