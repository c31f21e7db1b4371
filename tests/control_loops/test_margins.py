"""The gain at which a loop begins to swing, and what the answer says of it."""

import doctest
import inspect
import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate import control_loops
from palpate.control_loops.laws import KnownLaw
from palpate.control_loops.response import SampledPlant, find_onset, matrix_exponential
from palpate.control_loops.touching import find_limits, simulate_touches

COMMON = {"mass": 4.0, "wanted_force": 10.0, "approach_speed": 0.02, "tool_mass": 0.2}
LOOPS = {
    "admittance": control_loops.AdmittanceControl(
        **COMMON, sample_rate=500.0, delay=4.3e-3, virtual_mass=2.0, virtual_damping=80.0,
        bandwidth=60.0, force_filter=100.0,
    ),
    "impedance": control_loops.ImpedanceControl(
        **COMMON, sample_rate=1000.0, delay=2e-3, stiffness=500.0, damping=60.0, friction=4.0
    ),
    "force": control_loops.ForceControl(
        **COMMON, sample_rate=250.0, delay=9e-3, proportional=0.5, integral=2.0, friction=40.0,
        force_filter=50.0,
    ),
}  # fmt: skip
BALL = palpate.HuntCrossley(K=2000.0, B=2000.0, n=1.0)
RELAXING = palpate.GeneralisedHuntCrossley(
    K=1500.0, n=1.0, B=0.0, p=0.0, M=1500.0, relaxation=palpate.FlatSpectrum(0.005, 5.0)
)


@pytest.fixture(params=LOOPS.values(), ids=LOOPS)
def loop(request):
    return request.param


def knowledge(law=BALL, error=0.02, **changed):
    """What is known of a law with relative errors, recorded to 15 Hz and 30 N."""
    covariance = np.diag((error * np.abs(law.parameters)) ** 2)
    known = control_loops.KnownLaw(law, covariance, depth=6e-3)
    settings = {"frequency": 40.0, "largest_force": 30.0, "highest_frequency": 94.0, **changed}
    return control_loops.ContactKnowledge((known,), **settings)


def exact(law):
    """A law without errors."""
    size = len(law.names())
    return KnownLaw(law, np.zeros((size, size)), 6e-3).draws(1, 0.05)


def test_the_matrix_exponential_is_that_of_the_eigenvalues():
    random = np.random.default_rng(3)
    matrices = random.normal(size=(30, 5, 5)) * np.geomspace(1e-4, 30.0, 30)[:, None, None]
    matrices += matrices.transpose(0, 2, 1)  # symmetric, so that eigh is exact to rounding
    values, vectors = np.linalg.eigh(matrices)
    expected = np.einsum("cij,cj,ckj->cik", vectors, np.exp(values), vectors)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    # Squaring doubles the rounding error, ten times for the largest of these.
    assert (np.abs(matrix_exponential(matrices) - expected) / scale).max() < 1e-11


def spectral_radius(loop, stiffness, damping, factor):
    """The largest eigenvalue of the whole loop, stepped sample by sample on unit vectors."""
    from palpate.control_loops.response import _continuous

    continuous = _continuous(loop, np.array([stiffness]), np.array([damping]))[0]
    step = 1.0 / loop.sample_rate
    whole = math.floor(loop.delay / step + 1e-9)
    fraction = max(0.0, loop.delay - whole * step)
    early = matrix_exponential(continuous * fraction)
    late = matrix_exponential(continuous * (step - fraction))

    def advance(state):
        plant, commands, own = state[:4], state[4 : 5 + whole], state[5 + whole :].copy()
        force, position = plant[2], plant[0]
        if loop.name == "admittance":
            pull = -factor * force - loop.virtual_damping * own[0]
            own[0] += step * pull / loop.virtual_mass
            own[1] += step * own[0]
            command = own[1]
        elif loop.name == "impedance":
            speed = (position - own[0]) / step
            command = -factor * (loop.stiffness * position + loop.damping * speed)
            own[0] = position
        else:
            own[0] -= step * force
            command = factor * (loop.integral * own[0] - loop.proportional * force)
        line = np.append(command, commands)
        middle = early @ np.append(plant, line[whole + 1])
        after = late @ np.append(middle[:4], line[whole])
        return np.concatenate([after[:4], line[: whole + 1], own])

    size = 4 + whole + 1 + 2
    matrix = np.column_stack([advance(unit) for unit in np.eye(size)])
    return np.abs(np.linalg.eigvals(matrix)).max()


@pytest.mark.parametrize(
    "stiffness, damping", [(300.0, 2.0), (300.0, 60.0), (5e3, 2.0), (5e3, 60.0)]
)
@pytest.mark.parametrize("delay", [0.0, 3.7e-3])
def test_the_whole_loop_is_stable_below_the_onset_and_not_above(loop, stiffness, damping, delay):
    loop = loop.with_delay(delay)
    onset = find_onset(loop, np.array([stiffness]), np.array([damping]))
    factor = float(onset.gain[0])
    assert math.isfinite(factor)
    radii = [spectral_radius(loop, stiffness, damping, part * factor) for part in (0.3, 0.99, 1.01)]
    assert max(radii[:2]) <= 1.0 + 1e-9 < radii[2]


@pytest.mark.peers
def test_the_onset_is_the_gain_margin_of_python_control(loop):
    control = pytest.importorskip("control")
    stiffness, damping = np.array([2000.0]), np.array([20.0])
    plant = SampledPlant.of(loop, stiffness, damping)
    frequency = np.geomspace(0.3, math.pi * loop.sample_rate * (1.0 - 1e-6), 6000)
    response = plant.open_loop(loop, frequency[None, :])[0]
    phase = np.degrees(np.unwrap(np.angle(response)))
    margins = control.stability_margins((np.abs(response), phase, frequency), returnall=True)[0]
    expected = min(margin for margin in margins if margin > 0.0)
    # The oracle interpolates on its grid, 0.15 % apart.
    assert find_onset(loop, stiffness, damping).gain[0] == pytest.approx(expected, rel=0.01)


def test_a_simulated_touch_settles_below_the_onset_and_swings_above(loop):
    law = exact(BALL)
    depth = law.depth(loop.wanted_force)
    onset = float(find_onset(loop, *law.stiffness_and_damping(depth, depth)).gain[0])
    swing, bounce = find_limits(loop, law, onset, 4.0)
    # The first touch lies below the rest, where the law is softer: the linear onset is within 10 %.
    assert 0.9 * onset < bounce <= swing < 1.1 * onset
    touches = simulate_touches(loop, law, np.array([0.4, 1.3]) * onset, 4.0, with_forces=True)
    assert touches.fails.tolist() == [False, True]
    settled = touches.forces[0][np.isfinite(touches.forces[0])][-1]
    assert settled == pytest.approx(loop.wanted_force, rel=0.02)


def test_a_relaxing_material_has_the_limits_of_its_own_stiffness_at_the_frequency_of_the_swing():
    loop = LOOPS["admittance"]
    law = exact(RELAXING)
    depth = law.depth(loop.wanted_force)
    frequency = np.array([30.0])
    for _ in range(20):
        onset = find_onset(loop, *law.stiffness_and_damping(depth, frequency))
        frequency = onset.frequency
    swing, _ = find_limits(loop, law, float(onset.gain[0]), 4.0)
    assert swing == pytest.approx(float(onset.gain[0]), rel=0.1)


def test_draws_have_the_errors_of_the_law_at_its_working_depth():
    covariance = np.diag([40.0, 30.0, 0.02]) ** 2
    covariance[0, 2] = covariance[2, 0] = 0.9 * 40.0 * 0.02
    known = KnownLaw(BALL, covariance, 6e-3, stiffness_error=0.05)
    draws = known.draws(4000, 1.0)
    first = draws.first(1)
    assert (first.K[0], first.n[0]) == pytest.approx((BALL.K, BALL.n))
    force = np.log(draws.K * 6e-3**draws.n)
    row = np.array([1.0 / BALL.K, 0.0, math.log(6e-3)])
    expected = math.hypot(math.sqrt(row @ covariance @ row), 0.05)
    assert force.std() == pytest.approx(expected, rel=0.05)  # 4000 draws: 1.1 %
    assert draws.n.std() == pytest.approx(0.02, rel=0.05)


def test_a_worse_known_law_has_a_lower_bound_and_the_same_value(loop):
    margins = [
        control_loops.gains_for(knowledge(error=error), loop).gain_margin for error in (0.01, 0.1)
    ]
    assert margins[0].value == pytest.approx(margins[1].value)
    assert margins[1].lower_bound < margins[0].lower_bound < margins[0].value


def test_a_law_that_may_have_no_damping_at_all_still_has_a_margin():
    loop = replace(LOOPS["impedance"], friction=0.0)  # nor has the robot
    known = control_loops.KnownLaw(BALL, np.diag([1.0, 4e6, 1e-6]), 6e-3, damping_error=1.0)
    both = replace(knowledge(), laws=(known,))
    margin = control_loops.gains_for(both, loop).gain_margin
    assert margin.lower_bound > 0.8 * margin.value


def test_recommended_gains_are_safe_by_the_same_rule(loop):
    known = knowledge()
    best = control_loops.gains_for(known, loop).recommended
    assert control_loops.gains_for(known, best.scaled(0.99)).verdict == "safe"
    assert control_loops.gains_for(known, best.scaled(1.1)).verdict != "safe"


def test_each_verdict_is_that_of_its_bound(loop):
    known = knowledge()
    bound = control_loops.gains_for(known, loop).gain_margin.lower_bound
    parts = {"safe": 0.4, "little-margin": 0.7, "not-safe": 1.2}
    for verdict, part in parts.items():
        found = control_loops.gains_for(known, loop.scaled(part * bound))
        assert found.verdict == verdict
        assert found.describe()[0].lower().startswith(verdict.replace("-", " "))
        assert len(found.describe()) <= 11


def test_a_loop_that_would_swing_faster_than_recorded_has_no_more_margin(loop):
    slow = knowledge(frequency=6.0, highest_frequency=6.0)
    bounds = [
        control_loops.gains_for(each, loop).gain_margin.lower_bound for each in (slow, knowledge())
    ]
    assert bounds[0] < 1.01 * bounds[1]  # the impedance's onset hardly depends on the contact


def test_the_bound_is_the_least_over_all_laws(loop):
    one = knowledge()
    other = knowledge(palpate.KelvinVoigt(K=2600.0, B=6.0))
    both = replace(one, laws=(*one.laws, *other.laws))
    bounds = [
        control_loops.gains_for(each, loop).gain_margin.lower_bound for each in (one, other, both)
    ]
    assert bounds[2] == pytest.approx(min(bounds[:2]), rel=0.02)


REFUSALS = {
    "delay": ({}, {"delay": None}),
    "stiffness": ({"stiffness_mark": "do-not-trust"}, {}),
    "force": ({"largest_force": 2.4}, {}),
    "frequency": ({"frequency": 1.0, "highest_frequency": 1.0}, {}),
}


@pytest.mark.parametrize("why", REFUSALS)
def test_gains_are_refused_with_the_reason(why):
    known, changed = REFUSALS[why]
    loop = replace(LOOPS["force"], **changed)
    answer = control_loops.gains_for(knowledge(**known), loop)
    assert (answer.verdict, answer.refusal, answer.recommended) == ("refused", why, None)
    assert answer.describe()[0].startswith("Refused: ")
    with pytest.raises(palpate.InvalidParameterError, match="no gain is recommended"):
        answer.parameters()


def test_without_a_delay_the_margins_of_four_delays_fall():
    loop = replace(LOOPS["impedance"], delay=None)
    margins = control_loops.gains_for(knowledge(), loop).by_delay
    assert list(margins) == [0.0, 2e-3, 4e-3, 8e-3]
    assert all(a.lower_bound > b.lower_bound for a, b in itertools.pairwise(margins.values()))


def test_a_hard_contact_that_always_bounces_is_approached_more_slowly():
    metal = palpate.KelvinVoigt(K=1e5, B=5.0)
    loop = replace(LOOPS["force"], approach_speed=0.1)
    answer = control_loops.gains_for(knowledge(metal), loop)
    assert answer.verdict == "not-safe"
    assert answer.recommended.approach_speed < 0.05
    again = control_loops.gains_for(knowledge(metal), answer.recommended)
    assert again.bounce_speed > again.loop.approach_speed


@pytest.mark.parametrize(
    "field, value", [("mass", 0.0), ("delay", 0.2), ("sample_rate", math.nan), ("tool_mass", 5.0)]
)
def test_a_number_outside_its_range_is_named(field, value):
    with pytest.raises(palpate.InvalidParameterError, match=field):
        replace(LOOPS["impedance"], **{field: value})


def test_an_identification_and_its_saved_result_give_the_same_answer(ball, saved, loop):
    once, again = palpate.gains(ball, loop), palpate.gains(palpate.load_result(saved), loop)
    assert again.as_dict()["gain_margin"]["lower_bound"] == pytest.approx(
        once.gain_margin.lower_bound, rel=1e-3
    )


def test_the_highest_recorded_frequency_is_that_of_the_fastest_sine(ball):
    # 4, 11 and 15 rad/s; the approach of 0.4 s widens the last.
    assert control_loops.contact_knowledge(ball).recorded_frequency == pytest.approx(15.0, rel=0.1)


def test_the_delay_and_the_bandwidth_of_a_position_loop_are_measured():
    random = np.random.default_rng(2)
    time = np.arange(0.0, 4.0, 2e-3)
    move = np.floor(time / 0.5)
    part = np.clip((time - 0.5 * move) / 0.15, 0.0, 1.0)
    blend = part**2 * (3.0 - 2.0 * part)
    command = 0.01 * np.where(move % 2 == 0, blend, 1.0 - blend)
    bandwidth, delay, fine = 50.0, 6.5e-3, 1e-5
    late = np.arange(-delay, 4.0 - delay, fine)
    held = command[np.clip(np.floor(late / 2e-3 + 1e-9), 0, None).astype(int)]
    x = v = 0.0
    positions = np.empty(len(held))
    for k, target in enumerate(held.tolist()):
        positions[k] = x
        v += fine * (bandwidth**2 * (target - x) - 2.0 * bandwidth * v)
        x += fine * v
    measured = -1e3 * positions[::200] + 7.0 + 0.05 * random.standard_normal(2000)  # mm, reversed
    found = control_loops.measure_following(time, command, measured)
    assert abs(found.delay - delay) < 4.0 * found.delay_error < 1e-3
    assert abs(found.bandwidth - bandwidth) < 4.0 * found.bandwidth_error < 3.0


def test_a_position_that_does_not_follow_is_refused():
    time = np.arange(0.0, 1.0, 1e-3)
    with pytest.raises(palpate.RecordingError, match="does not follow"):
        control_loops.measure_following(time, np.sin(9.0 * time), np.sin(31.0 * time))
    with pytest.raises(palpate.RecordingError, match="does not move"):
        control_loops.measure_following(time, np.ones(1000), np.sin(time))


def test_every_example_of_the_module_runs(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    runner, parser = doctest.DocTestRunner(verbose=False), doctest.DocTestParser()
    names = [name for name, each in vars(control_loops).items() if inspect.isroutine(each)]
    names += [name for name, each in vars(control_loops).items() if inspect.isclass(each)]
    failures = []
    for name in names:
        text = inspect.getdoc(getattr(control_loops, name))
        runner.run(parser.get_doctest(text, {}, name, None, None), out=failures.append)
    assert len(names) > 12
    assert "".join(failures) == ""
