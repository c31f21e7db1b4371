"""Many contacts at once: rows of arrays in vector lanes come out as each row would alone."""

import threading
import time

import numpy as np
import pytest

from palpate import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    InvalidParameterError,
    KelvinVoigtRLS,
    OutlierRejection,
    Scale,
    SelfPerturbation,
    SingleStageRLS,
    Status,
    VariableProjection,
    lab,
)
from palpate.lanes import ENVIRONMENT, LaneEstimates, instruction_sets, replay_lanes

IN_LANES = (SingleStageRLS, KelvinVoigtRLS, ExtendedKelvinVoigtRLS)
SETS = instruction_sets()[1:]


def _rows(contacts=40, samples=600, *, hostile=True):
    """Contacts of several materials; in every second something is wrong, at places of its own."""
    random = np.random.default_rng(5)
    x, v, force = (np.empty((contacts, samples)) for _ in range(3))
    for contact in range(contacts):
        times = random.uniform(0.0, 6.0) + 1e-3 * np.arange(samples)
        x[contact], v[contact] = lab.THREE_SINES.motion.at(times)
        force[contact] = 10.0 ** random.uniform(-1.0, 1.0) * lab.BALL.law.force(
            x[contact], v[contact]
        )
    force *= 1.0 + 2e-3 * random.standard_normal(force.shape)
    if hostile:
        some = random.random(force.shape) < 0.05
        force[1::8][some[1::8]] = np.nan
        x[3::8][some[3::8]] *= -1.0
        v[5::8][some[5::8]] = np.inf
        force[7::8, samples // 3 : samples // 2] = 0.0
        x[7::8, -samples // 5 :] = np.nan
    return x, v, force


def _one_at_a_time(rows, estimator):
    """The same by the estimator's own face, which knows nothing of lanes."""
    found = []
    for x, v, force in zip(*rows, strict=True):
        fresh = estimator.replace()
        fresh.replay(x, v, force)
        found.append(fresh.estimate())
    return found


def _with_last_bits_changed(rows, seed):
    random = np.random.default_rng(seed)
    x, v, force = rows
    up = [np.where(random.random(x.shape) < 0.5, np.inf, -np.inf) for _ in range(2)]
    return np.nextafter(x, up[0]), v, np.nextafter(force, up[1])


def _apart(parameters, alone):
    """How far parameters are apart, over their value and standard error; the worst contact's."""
    pairs = zip(parameters, alone, strict=True)
    sizes = [np.abs(one.parameters) + one.standard_errors for one in alone]
    gaps = [np.abs(found - one.parameters) for found, one in pairs]
    return max(np.max(gap / size) for gap, size in zip(gaps, sizes, strict=True))


def _check_alike(found: LaneEstimates, rows, estimator):
    """Lanes are off by no more than what the last bits of the data come to, ten times for chance:
    a lane rounds a step differently in its last bits, and a dull motion magnifies both alike."""
    alone = _one_at_a_time(rows, estimator)
    changed = [
        [each.parameters for each in _one_at_a_time(_with_last_bits_changed(rows, seed), estimator)]
        for seed in range(3)
    ]
    bound = max(_apart(parameters, alone) for parameters in changed)
    assert _apart(found.parameters, alone) <= 10.0 * bound + 1e-14
    for contact, one in enumerate(alone):
        assert found.samples[contact] == one.samples
        assert found.guarded[contact] == one.guarded
        assert int(found.status[contact]) == int(one.status)
        assert found.law(contact).symbols == one.law.symbols
        assert found.validity_margin[contact] == pytest.approx(one.validity_margin, abs=1e-6)
        assert found.standard_errors[contact] == pytest.approx(one.standard_errors, rel=1e-3)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("kind", IN_LANES)
def test_rows_come_out_as_each_would_alone(kind, name):
    rows = _rows(hostile=False)
    found = replay_lanes(*rows, kind(), instruction_set=name)
    assert found.instruction_set == name
    _check_alike(found, rows, kind())


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"forgetting": ConstantForgetting(0.95)},
        {"gate": ContactGate(1e-3, 2.0, 1.0), "scale": Scale(0.01, 0.05, 20.0)},
        {"sample_time": 0.01, "initial_covariance": 1e8},
    ],
)
@pytest.mark.parametrize("kind", IN_LANES)
def test_so_do_rows_with_something_wrong_in_them(kind, settings, name):
    rows, estimator = _rows(), kind(**settings)
    found = replay_lanes(*rows, estimator, instruction_set=name)
    assert found.instruction_set == name
    _check_alike(found, rows, estimator)


@pytest.mark.parametrize(
    "kind, settings",
    [
        (SingleStageRLS, {"perturbation": SelfPerturbation()}),
        (SingleStageRLS, {"change_detector": ChangeDetector()}),
        (SingleStageRLS, {"outlier_rejection": OutlierRejection()}),
        (SingleStageRLS, {"exponent": 1.5}),
        (DoubleStageRLS, {}),
        (VariableProjection, {}),
    ],
    ids=lambda given: given.__name__ if isinstance(given, type) else "".join(given),
)
def test_what_lanes_do_not_take_goes_one_at_a_time_and_says_so(kind, settings):
    estimator = kind(**settings)
    rows = _rows(12, 300)
    found = replay_lanes(*rows, estimator)
    assert found.instruction_set == "scalar"
    for contact, one in enumerate(_one_at_a_time(rows, estimator)):
        assert np.array_equal(found.parameters[contact], one.parameters)
        assert np.array_equal(found.covariance[contact], one.covariance)
        assert found.offset[contact] == one.offset
        assert found.offset_standard_error[contact] == one.offset_standard_error
        assert (found.samples[contact], found.rejected[contact]) == (one.samples, one.rejected)
        assert found.restarts[contact] == one.restarts


def test_an_estimator_written_in_python_goes_one_at_a_time_too():
    from test_own_estimator import StickyRLS

    rows = _rows(3, 50)
    found = replay_lanes(*rows, StickyRLS())
    assert found.instruction_set == "scalar"
    for contact, one in enumerate(_one_at_a_time(rows, StickyRLS())):
        assert np.array_equal(found.parameters[contact], one.parameters)


def test_every_instruction_set_and_any_number_of_threads_give_the_same_bits():
    rows = _rows(100, 200)
    first, *others = [
        replay_lanes(*rows, SingleStageRLS(), instruction_set=name, threads=threads)
        for name in SETS
        for threads in (1, 2, 7)
    ]
    for other in others:
        assert np.array_equal(first.parameters, other.parameters)
        assert np.array_equal(first.covariance, other.covariance)
        assert np.array_equal(first.guarded, other.guarded)


def test_gates_and_scales_may_be_a_contact_s_own():
    rows = _rows(20, 300)
    gates = np.column_stack([np.zeros(20), np.linspace(0.5, 20.0, 20), np.linspace(0.2, 10.0, 20)])
    scales = np.column_stack([np.full(20, 0.01), np.full(20, 0.05), np.linspace(1.0, 40.0, 20)])
    found = replay_lanes(*rows, SingleStageRLS(), gates=gates, scales=scales)
    for contact in range(20):
        estimator = SingleStageRLS(gate=ContactGate(*gates[contact]), scale=Scale(*scales[contact]))
        (alone,) = _one_at_a_time([array[contact : contact + 1] for array in rows], estimator)
        assert found.samples[contact] == alone.samples
        apart = np.abs(found.parameters[contact] - alone.parameters)
        assert (apart <= 1e-9 * (np.abs(alone.parameters) + alone.standard_errors)).all()


@pytest.mark.parametrize("name", instruction_sets())
def test_samples_without_condition_10_are_counted_as_a_trace_has_them(name):
    x, v, force = _rows(20, 300)
    v *= 6.0  # so that it is violated now and then, and by starts that are still on their way
    settings = {"forgetting": ConstantForgetting(0.97)}
    found = replay_lanes(
        x, v, force, SingleStageRLS(**settings), count_violated=True, instruction_set=name
    )
    counts = []
    for row in zip(x, v, force, strict=True):
        trace = SingleStageRLS(**settings).replay(*row)
        counts.append(np.count_nonzero(~trace.validity[trace.taken]))
    assert found.violated.tolist() == counts
    assert len(set(counts)) > 10  # neither none nor all, everywhere
    assert replay_lanes(x, v, force, SingleStageRLS()).violated is None


@pytest.mark.parametrize("kind", [SingleStageRLS, DoubleStageRLS])
def test_statuses_are_those_of_a_trace(kind):
    rows = _rows(8, 200)
    estimator = kind(outlier_rejection=OutlierRejection())
    found = replay_lanes(*rows, estimator, keep_statuses=True, threads=2)
    assert found.instruction_set == "scalar"
    for statuses, *row in zip(found.statuses, *rows, strict=True):
        assert statuses.tolist() == estimator.replace().replay(*row).status.tolist()


def test_arrays_of_other_types_and_layouts_are_taken():
    x, v, force = _rows(20, 100, hostile=False)
    single = [array.astype(np.float32) for array in (x, v, force)]
    expected = replay_lanes(*[array.astype(np.float64) for array in single], KelvinVoigtRLS())
    for rows in (single, [np.asfortranarray(array) for array in single]):
        found = replay_lanes(*rows, KelvinVoigtRLS())
        assert np.array_equal(found.parameters, expected.parameters)


def test_no_contacts_and_no_samples_are_no_error():
    empty = np.empty((0, 100))
    assert len(replay_lanes(empty, empty, empty, SingleStageRLS())) == 0
    none = np.empty((5, 0))
    found = replay_lanes(none, none, none, SingleStageRLS())
    assert (found.samples == 0).all()
    assert (found.status == int(Status.WAITING)).all()
    assert np.array_equal(found.parameters[3], SingleStageRLS().estimate().parameters)


def test_the_estimator_given_is_left_as_it_is():
    rows, estimator = _rows(5, 100), SingleStageRLS()
    estimator.update(0.01, 0.0, 20.0)
    before = estimator.estimate()
    found = replay_lanes(*rows, estimator)
    assert np.array_equal(estimator.estimate().parameters, before.parameters)
    assert np.array_equal(found.parameters, replay_lanes(*rows, SingleStageRLS()).parameters)


def test_the_environment_chooses_the_instruction_set(monkeypatch):
    rows = _rows(5, 50)
    monkeypatch.setenv(ENVIRONMENT, "baseline")
    assert replay_lanes(*rows, SingleStageRLS()).instruction_set == "baseline"
    assert replay_lanes(*rows, SingleStageRLS(), instruction_set="scalar").instruction_set == (
        "scalar"
    )
    monkeypatch.setenv(ENVIRONMENT, "abacus")
    with pytest.raises(InvalidParameterError, match="instruction_set must be one of scalar, base"):
        replay_lanes(*rows, SingleStageRLS())


@pytest.mark.parametrize(
    "change, words",
    [
        ({"penetration": np.zeros(5)}, "penetration must be an array of numbers, contacts × samp"),
        ({"force": [["a"]]}, "force must be an array of numbers"),
        ({"force": np.zeros((5, 9))}, "arrays must have the same shape: penetration is"),
        ({"estimator": "single-stage"}, "estimator must be a ContactEstimator"),
        ({"threads": 0}, "threads must be in"),
        ({"gates": np.zeros((4, 3))}, "gates must be of shape"),
        ({"gates": np.tile([0.0, 1.0, 2.0], (5, 1))}, "contact 0: gate.break_force must be in"),
        ({"scales": np.full((5, 3), np.nan)}, "contact 0: scale.penetration must be in"),
        ({"instruction_set": "neon"}, "instruction_set must be one of scalar"),
    ],
)
def test_nonsense_is_refused_by_name(change, words):
    given = dict(zip(("penetration", "velocity", "force"), _rows(5, 10), strict=True))
    given |= {"estimator": SingleStageRLS(), **change}
    with pytest.raises(InvalidParameterError, match=words):
        replay_lanes(**given)


def test_the_interpreter_runs_on_meanwhile():
    rows = _rows(512, 4000, hostile=False)
    worker = threading.Thread(target=replay_lanes, args=(*rows, DoubleStageRLS()))
    worker.start()
    turns = 0
    while worker.is_alive():
        time.sleep(1e-3)
        turns += 1
    worker.join()
    assert turns > 5  # of some hundred; were the lock held, one or two
