"""Which samples variable projection counts, and what free air and a tare tell it."""

import numpy as np
import pytest
from probing import (
    BALL,
    MATERIALS,
    NOISE,
    PVC,
    SAMPLE_TIME,
    Motion,
    clock,
    coloured,
    contact_of,
    fed,
    joined,
    relative_error,
    tapping,
    three_sines,
    white,
)
from scipy.stats import binom

import palpate
from palpate import Contact, Scale, Status, VariableProjection, identify, lab
from palpate.input.preparation.resolution import suggest_surface_deviation
from palpate.lab.design.precision import cramer_rao_bound

SCALE = Scale(10e-3, 0.1, 20.0)
GEL = palpate.HuntCrossley(K=5e4, B=1.5e5, n=2.2)
OFFSET = "force offset larger"


def strokes(seconds: float, least: float = -2e-3, most: float = 10e-3) -> Motion:
    """A chirp from 0.5 to 3 Hz between two depths, m."""
    t, half = clock(seconds), 0.5 * (most - least)
    phase = 2.0 * np.pi * (0.5 * t + 1.25 * t**2 / seconds)
    rate = 2.0 * np.pi * (0.5 + 2.5 * t / seconds)
    return Motion(least + half * (1.0 - np.cos(phase)), half * rate * np.sin(phase))


@pytest.mark.parametrize("law", [BALL, GEL])
def test_light_contact_costs_no_more_than_the_bound(law):
    motion, noise = strokes(4.0), 0.1
    bound = cramer_rao_bound(law, motion.x, motion.v, noise, offset=True)[:3]
    errors = []
    for seed in range(40):
        force = law.force(motion.x, motion.v) + white(len(motion), seed, noise)
        estimate = fed(VariableProjection(scale=SCALE), motion, force).estimate()
        errors.append(estimate.parameters - law.parameters)
    # Forty seeds tell an RMSE to 11 %: 1.35 is three of that above the bound. It was 2 to 40.
    assert (np.sqrt(np.mean(np.square(errors), axis=0)) < 1.35 * bound).all()


def test_a_coarsely_rounded_force_has_only_rounding_noise():
    motion = strokes(4.0)
    x, v = motion.x, motion.v
    noise = 0.004 * float(GEL.force(x, v).max())
    step = 8.0 * noise
    # Free air that reads one level says nothing of the offset.
    seen, noise_in_all = x > 0.0, noise * np.sqrt(1.0 + 64.0 / 12.0)
    bound = cramer_rao_bound(GEL, x[seen], v[seen], noise_in_all, offset=True)[:3]
    forces = np.array([GEL.force(x, v) + white(len(motion), seed, noise) for seed in range(20)])
    levels = np.random.default_rng(2).uniform(-0.5, 0.5, (20, 1)) * step
    forces = step * np.round((forces + levels) / step)
    one_by_one, twice = [], []
    for each in forces:
        first, second = (VariableProjection(scale=SCALE) for _ in range(2))
        one_by_one.append(fed(first, motion, each).estimate())
        assert second._unround_as(first)
        twice.append(fed(second, motion, each).estimate())
    curves = palpate.fit_curves(*(np.tile(each, (20, 1)) for each in (x, v)), forces)
    ways = {
        "recursion": [[e.parameters, e.standard_errors] for e in one_by_one],
        "second replay": [[e.parameters, e.standard_errors] for e in twice],
        "batch": [[curves.law(k).parameters, curves.standard_errors[k, :3]] for k in range(20)],
    }
    for name, way in ways.items():
        parameters, errors = np.swapaxes(way, 0, 1)
        off = parameters - GEL.parameters
        # It was 3.7, and intervals of 95 % held 50 %; now 1.7, 1.3 and 1.4; 80, 92 and 88 %.
        most, least = (2.0, 0.7) if name == "recursion" else (1.6, 0.8)
        assert (np.sqrt(np.mean(off**2, axis=0)) < most * bound).all()
        assert np.mean(np.abs(off) < 1.96 * errors) > least


@pytest.mark.parametrize("air", [True, False])
def test_a_material_that_recovers_slowly_does_no_harm(air):
    motion = strokes(4.0)
    force = BALL.force(motion.x, motion.v)
    force[(motion.v < 0.0) & (motion.x < 2e-3)] = 0.0  # no contact on the way out
    seen = np.full(len(motion), True) if air else motion.x > 0.0
    kept = Motion(motion.x[seen], motion.v[seen])
    force = force[seen] + white(len(kept), 3)
    estimate = fed(VariableProjection(scale=SCALE), kept, force).estimate()
    # A gate at F > 0 takes 5 to 10 %.
    assert np.abs(estimate.parameters / BALL.parameters - 1.0).max() < 0.02


def test_firm_contact_is_updated_and_what_is_in_doubt_is_held():
    motion = strokes(2.0)
    force = BALL.force(motion.x, motion.v) + white(len(motion), 4)
    trace = VariableProjection(scale=SCALE).replay(motion.x, motion.v, force)
    assert (trace.status[motion.x > 1e-3] == Status.UPDATED).all()
    assert not trace.taken[motion.x <= 0.0].any()
    light = (motion.x > 0.0) & ~trace.taken
    assert light.any()
    assert set(trace.status[light].tolist()) == {int(Status.WAITING), int(Status.HELD)}


def test_free_air_tells_the_offset():
    motion = strokes(4.0)
    force = PVC.force(motion.x, motion.v) + 1.5 + white(len(motion), 5)
    inside = motion.x > 0.0
    estimates = [
        fed(VariableProjection(scale=SCALE), part, f).estimate()
        for part, f in (
            (motion, force),
            (Motion(motion.x[inside], motion.v[inside]), force[inside]),
        )
    ]
    assert abs(estimates[0].offset - 1.5) < 4.0 * estimates[0].offset_standard_error
    assert estimates[0].offset_standard_error < 0.8 * estimates[1].offset_standard_error


def test_correlated_noise_costs_no_more_than_least_squares():
    t, law, zero = clock(8.0), PVC, 0.3
    motion = Motion(4e-3 + 8e-3 * np.sin(9.0 * t), 72e-3 * np.cos(9.0 * t))
    force, inside = law.force(motion.x, motion.v) + zero, motion.x > 0.0
    slopes = np.column_stack([np.zeros((len(motion), 3)), np.ones(len(motion))])
    slopes[inside, :3] = law.parameter_gradient(motion.x[inside], motion.v[inside])
    sizes = np.linalg.norm(slopes, axis=0)
    ours, plain, inside_bars = [], [], []
    for seed in range(24):
        noise = coloured(len(motion), seed, memory=0.95)
        estimate = fed(VariableProjection(scale=SCALE), motion, force + noise).estimate()
        bars = [*estimate.standard_errors, estimate.offset_standard_error]
        ours.append([*(estimate.parameters - law.parameters), estimate.offset - zero])
        inside_bars.append(np.abs(ours[-1]) < 1.96 * np.array(bars))
        # Of all samples, with free air; to first order, which such errors are small enough for.
        plain.append(np.linalg.lstsq(slopes / sizes, noise, rcond=None)[0] / sizes)
    ratio = np.linalg.norm(ours, axis=0) / np.linalg.norm(plain, axis=0)
    # Selected by neighbours, and judged by white errors, n had 1.4 and the offset 2.1.
    assert (ratio[2:] < 1.2).all()
    assert np.mean(inside_bars) > 0.85


def test_an_untared_force_is_no_stiffness():
    motion = strokes(4.0, least=5e-3, most=7e-3)  # never in free air
    force = BALL.force(motion.x, motion.v) + 5.0 + white(len(motion), 6)
    estimate = fed(VariableProjection(scale=SCALE), motion, force).estimate()
    assert np.abs(estimate.parameters - BALL.parameters)[0] < 3.0 * estimate.standard_errors[0]
    assert estimate.flags == ()


@pytest.mark.parametrize("least", [-2e-3, 5e-3])  # with free air and without
def test_a_wrong_tare_is_flagged_and_a_good_one_used(least):
    motion = strokes(4.0, least, 7e-3 if least > 0.0 else 10e-3)
    clean = BALL.force(motion.x, motion.v) + white(len(motion), 7)
    tared = VariableProjection(scale=SCALE, offset_deviation=5e-3)
    good = fed(tared.replace(), motion, clean).estimate()
    wrong = fed(tared.replace(), motion, clean + 5.0).estimate()
    assert not any(flag.startswith(OFFSET) for flag in good.flags)
    assert any(flag.startswith(OFFSET) for flag in wrong.flags)
    for estimate in (good, wrong):
        error = np.abs(estimate.parameters - BALL.parameters)
        assert (error < 4.0 * estimate.standard_errors).all()
    assert good.offset_standard_error < 6e-3


def test_a_tight_tare_gives_way_where_the_surface_is_wrong():
    motion = strokes(4.0, least=3e-3, most=9e-3)
    force = BALL.force(motion.x, motion.v) + white(len(motion), 8)
    moved = Motion(motion.x + 0.3e-3, motion.v)
    estimate = fed(VariableProjection(scale=SCALE, offset_deviation=2e-3), moved, force).estimate()
    # 5 % is the damping term's own share, x against x + 0.3 mm; a tare that held took 15 %.
    assert abs(estimate.law.K / BALL.K - 1.0) < 0.05
    assert any(flag.startswith(OFFSET) for flag in estimate.flags)


def test_the_error_bars_cover_the_zero_of_an_encoder():
    rest, deep = np.full(1000, -1e-3), strokes(4.0, least=5e-3)
    motion = Motion(np.concatenate([rest, deep.x]), np.concatenate([0.0 * rest, deep.v]))
    step, hidden = 20e-6, 6e-6  # the zero lies anywhere within a step
    x = step * np.round((motion.x + hidden) / step)
    force = BALL.force(motion.x, motion.v) + white(len(motion), 10, 0.02)
    contact = contact_of(Motion(x, motion.v), force)
    suggested = identify(contact).estimator.settings["surface_deviation"]
    # Of the rounding, step/√12, which fourth differences see up to a quarter larger.
    assert 2.0 < suggested / (step / np.sqrt(12.0)) < 2.6

    away = []  # the largest error, in standard errors
    for deviation in (None, 1e-9):
        found = identify(contact, VariableProjection(surface_deviation=deviation)).estimate
        errors = np.abs(found.parameters - BALL.parameters) / found.standard_errors
        away.append(errors.max())
    assert away[0] < 3.0
    assert away[1] > 4.0  # as free air says the offset to a millinewton
    exact = contact_of(motion, BALL.force(motion.x, motion.v))
    assert suggest_surface_deviation(exact) is not None  # a motion's own steps
    still = Contact(exact.time, penetration=0.0 * motion.x, velocity=motion.v, force=exact.force)
    assert suggest_surface_deviation(still) is None


def test_a_tare_reaches_the_estimator_through_prepare_and_identify():
    rest, motion = np.full(1000, -1e-3), strokes(3.0, least=3e-3, most=9e-3)
    x = np.concatenate([rest, motion.x])
    v = np.concatenate([0.0 * rest, motion.v])
    force = BALL.force(x, v) + 0.7 + white(len(x), 9)
    arrays = {"time": SAMPLE_TIME * np.arange(len(x)), "penetration": x, "velocity": v}
    contact = palpate.prepare(**arrays, force=force, tare=(0.0, 0.9))
    assert contact.tare_deviation == pytest.approx(NOISE / np.sqrt(901), rel=0.3)
    assert contact.window(0.5).tare_deviation == contact.tare_deviation
    for touch, method, deviation in (
        (contact, None, contact.tare_deviation),
        (contact, VariableProjection(offset_deviation=0.1), 0.1),
        (palpate.prepare(**arrays, force=force), None, None),
    ):
        found = identify(touch, *([] if method is None else [method]))
        assert found.estimator.settings["offset_deviation"] == deviation
    contact = lab.Bench(lab.BALL, lab.THREE_SINES, lab.IdealProbe()).run(1).contact
    # The mean of a pause of 0.05 N noise in steps of 1/8 N, and what those steps leave of it.
    assert 1e-3 < contact.tare_deviation < 6e-3


def test_identify_sets_no_force_gate_but_keeps_a_given_one():
    motion = strokes(2.0)
    contact = contact_of(motion, BALL.force(motion.x, motion.v) + white(len(motion), 10))
    assert identify(contact).estimator.settings["gate"] is None
    results = palpate.compare(contact)
    assert results["variable-projection"].estimator.settings["gate"] is None
    assert results["single-stage"].gate.make_force > 0.0
    depths = [result.diagnosis.working_depth.depth for result in results.values()]
    assert depths == pytest.approx([depths[0]] * len(depths), rel=0.02)
    gate = palpate.ContactGate(1e-3, 2.0)
    firm = (contact.penetration > 1e-3) & (contact.force > 2.0)
    taken = identify(contact, VariableProjection(gate=gate)).trace.taken
    assert not (taken & (contact.penetration <= 1e-3)).any()
    assert taken[firm].all()


# Where the material begins is found, with an error bar, from the approach.
def searching(**settings):
    return VariableProjection(surface="estimate", **settings)


def approached(seconds, surface, from_height=3e-3):
    """Down at 13 mm/s from the free to 10 mm below ``surface``, then the three sines."""
    down = np.arange(-from_height, 10e-3, 13e-3 * SAMPLE_TIME)
    stroke = Motion(surface + down, np.full(down.size, 13e-3))
    sines = three_sines(seconds - SAMPLE_TIME * down.size)
    return joined(stroke, Motion(surface + sines.x, sines.v))


def felt_below(law, motion, surface, seed, offset=0.0):
    clean = law.force(motion.x - surface, motion.v)
    return clean + offset + white(len(motion), seed)


@pytest.mark.long
@pytest.mark.parametrize("surface", [-1.9e-3, 0.0, 0.33e-3, 1.9e-3])
def test_the_surface_of_the_phantom_is_found_within_40_micrometres(surface):
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
def test_predictions_take_the_penetration_of_the_recording(name):
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


SEEDS = [("ball", range(30)), ("pvc", range(30))]
MANY = [pytest.param(name, range(1000, 1600), marks=pytest.mark.slow) for name in MATERIALS]


@pytest.mark.long
@pytest.mark.parametrize("name, seeds", SEEDS + MANY)
def test_the_error_bar_of_the_surface_is_true(name, seeds):
    law, inside, laws = MATERIALS[name], 0, np.zeros(3)
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


def test_a_surface_beyond_the_range_is_flagged():
    motion = tapping(5.0, 1e-3)
    force = felt_below(PVC, motion, 1e-3, 2)
    estimator = searching(surface_range=(-0.5e-3, 0.5e-3))
    flags = fed(estimator, motion, force).estimate().flags
    assert any(flag.startswith("surface at the edge") for flag in flags)
    wider = estimator.replace(surface_range=(-0.5e-3, 2e-3))
    assert not fed(wider, motion, force).estimate().flags


def test_identify_finds_the_surface_of_a_contact_with_free_approach():
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


def test_segments_of_one_contact_are_separated_without_inventing_a_sample():
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


@pytest.mark.long
@pytest.mark.parametrize("rise", [0.0, 5e-3])
def test_a_contact_without_free_approach_is_refused_in_plain_words(rise):
    motion = three_sines(2.0)
    deeper = Motion(motion.x + rise, motion.v)
    contact = contact_of(deeper, felt_below(PVC, deeper, 0.0, 5), source="pressed.csv")
    with pytest.raises(
        palpate.RecordingError, match=r"pressed\.csv: .*surface.*free approach"
    ) as refusal:
        identify(contact, searching())
    assert "0 of 2000 samples" in str(refusal.value)
    assert identify(contact).law.n > 0.0  # with the surface known there is no such need
    motion = approached(2.0, 0.0, from_height=3e-3)
    force = felt_below(PVC, motion, 0.0, 6)
    touch = int(np.argmax(motion.x > 0.0))
    # The surface is known to some ten samples of this approach (13 µm each).
    enough, few = slice(touch - 60, None), slice(touch - 5, None)
    identify(contact_of(motion[enough], force[enough]), searching())
    with pytest.raises(palpate.RecordingError, match="at least 20"):
        identify(contact_of(motion[few], force[few]), searching())


def test_a_near_approach_counts_without_positive_force():
    estimator = VariableProjection(surface="estimate")  # ±2 mm, and 1 mm before them
    assert estimator.update(-5e-3, 0.01, -0.01) == Status.WAITING
    assert estimator.update(-2.5e-3, 0.01, -0.01) == Status.UPDATED
    assert estimator.update(1e-3, 0.01, -0.01) == Status.UPDATED
    assert estimator.update(-5e-3, -0.01, 0.0) == Status.HELD
    assert estimator.estimate().samples == 2
