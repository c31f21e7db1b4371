"""Settings in, state apart: refusals, reset, copies, pickles and the same recursion twice."""

import copy
import math
import pickle

import numpy as np
import pytest
from cases import KINDS, MATERIALS, bits, exciting, knowledge, tapping

import palpate
from palpate import ConstantForgetting, ContactGate, FadingForgetting, SelfPerturbation, Status

SIGNALS = tapping(MATERIALS["pvc"], noise=0.02, seed=11)
HALF = len(SIGNALS) // 2
SETTINGS = {
    "as it comes": {},
    "everything on": {
        "forgetting": FadingForgetting(0.98, 6.0),
        "perturbation": SelfPerturbation(),
        "gate": ContactGate(3e-4, 0.2, 0.1),
        "scale": palpate.Scale(5e-3, 50e-3, 10.0),
        "sample_time": 2e-3,
    },
    "constant": {"forgetting": ConstantForgetting(0.99)},
}


@pytest.fixture(scope="module", params=SETTINGS.values(), ids=SETTINGS)
def fresh(request, kind):
    """Makes an estimator that has learned nothing."""
    return lambda: kind(**request.param)


@pytest.fixture
def halfway(fresh):
    """An estimator in the middle of a contact."""
    estimator = fresh()
    estimator.replay(*SIGNALS[:HALF].arrays)
    return estimator


BAD_NUMBERS = [math.nan, math.inf, -math.inf]
REFUSED = {
    **{f"penetration {bad}": ((bad, 0.01, 1.0), Status.NOT_FINITE) for bad in BAD_NUMBERS},
    **{f"velocity {bad}": ((0.01, bad, 1.0), Status.NOT_FINITE) for bad in BAD_NUMBERS},
    **{f"force {bad}": ((0.01, 0.01, bad), Status.NOT_FINITE) for bad in BAD_NUMBERS},
    **{
        f"dt {bad}": ((0.01, 0.01, 1.0, bad), Status.INVALID_STEP)
        for bad in (0.0, -0.0, -1e-3, *BAD_NUMBERS)
    },
    "a huge penetration": ((1e300, 0.01, 1.0), Status.OUT_OF_RANGE),
    "a huge velocity": ((0.01, -1e300, 1.0), Status.OUT_OF_RANGE),
    "a huge force": ((0.01, 0.01, 1e300), Status.OUT_OF_RANGE),
    "the largest floats": ((1.7e308, 1.7e308, 1.7e308), Status.OUT_OF_RANGE),
}


@pytest.mark.parametrize("sample, status", REFUSED.values(), ids=REFUSED)
def test_a_refused_sample_changes_nothing(halfway, sample, status):
    before = halfway._state()
    assert halfway.update(*sample) is status
    assert halfway._state() == before


@pytest.mark.parametrize("sample, status", REFUSED.values(), ids=REFUSED)
def test_a_refused_sample_before_any_contact_changes_nothing(kind, sample, status):
    estimator = kind()
    before = estimator._state()
    assert estimator.update(*sample) is status
    assert estimator._state() == before


FREE = {
    "a negative penetration": (-1e-3, 0.01, 1.0),
    "no penetration": (0.0, 0.01, 1.0),
    "a negative force": (0.01, 0.01, -1.0),
    "no force": (0.01, 0.01, 0.0),
    "minus no force": (0.01, 0.01, -0.0),
    "a huge negative penetration": (-1e300, 0.0, 1.0),
}


@pytest.mark.parametrize("sample", FREE.values(), ids=FREE)
def test_a_sample_in_the_free_teaches_nothing(halfway, sample):
    halfway.update(*SIGNALS.rows[HALF - 1])
    before = knowledge(halfway)
    assert halfway.update(*sample) is Status.HELD
    after = knowledge(halfway)
    assert after[:4] == before[:4]
    assert after[5:] == before[5:]
    assert halfway.estimate().status is Status.HELD


def test_replay_is_update_bit_for_bit(fresh):
    looped, replayed = fresh(), fresh()
    trace = replayed.replay(*SIGNALS.arrays)
    for k, row in enumerate(SIGNALS.rows):
        expected = looped.predict(*row[:2])
        assert looped.update(*row) == trace.status[k]
        estimate = looped.estimate()
        assert np.array_equal(estimate.parameters, trace.parameters[k])
        assert estimate.validity_margin == trace.validity_margin[k]
        # The trace's errors and predictions are the same formulas in another order: some roundings,
        # times up to 20 for the logarithms in e^(ln K + n ln x).
        assert trace.standard_errors[k] == pytest.approx(estimate.standard_errors, rel=1e-13)
        assert trace.predicted_force[k] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert looped._state() == replayed._state()


def test_replay_in_pieces_is_replay_as_a_whole(fresh):
    whole, pieces = fresh(), fresh()
    trace = whole.replay(*SIGNALS.arrays)
    parts = [
        pieces.replay(*SIGNALS[cut].arrays) for cut in (slice(0, 7), slice(7, 7), slice(7, None))
    ]
    joined = palpate.Trace.joined(parts, trace.parameters.shape[1])
    assert bits(joined) == bits(trace)
    assert pieces._state() == whole._state()


def test_the_sample_time_is_what_update_is_not_told(fresh):
    told, untold, replayed, spread = fresh(), fresh(), fresh(), fresh()
    step = told.settings["sample_time"]
    for row in SIGNALS.rows:
        told.update(*row, step)
        untold.update(*row)
    replayed.replay(*SIGNALS.arrays, step)
    spread.replay(*SIGNALS.arrays, np.full(len(SIGNALS), step))
    assert told._state() == untold._state() == replayed._state() == spread._state()


COPIES = {
    "pickle": lambda e: pickle.loads(pickle.dumps(e)),
    "an old pickle": lambda e: pickle.loads(pickle.dumps(e, protocol=2)),
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "copy()": lambda e: e.copy(),
}


@pytest.mark.parametrize("restored", COPIES.values(), ids=COPIES)
def test_to_save_restore_and_continue_is_never_to_have_stopped(fresh, halfway, restored):
    never_stopped = fresh()
    whole = never_stopped.replay(*SIGNALS.arrays)
    continued = restored(halfway)
    assert type(continued) is type(halfway)
    assert continued.settings == halfway.settings
    assert bits(continued.replay(*SIGNALS[HALF:].arrays)) == bits(whole[slice(HALF, None)])
    assert knowledge(continued) == knowledge(never_stopped)


@pytest.mark.parametrize("restored", COPIES.values(), ids=COPIES)
def test_a_copy_is_independent(halfway, restored):
    before = halfway._state()
    other = restored(halfway)
    other.replay(*SIGNALS[HALF:].arrays)
    assert halfway._state() == before
    assert other._state() != before


def test_reset_equals_a_fresh_one(fresh, halfway):
    halfway.reset()
    new = fresh()
    assert knowledge(halfway) == knowledge(new)
    assert bits(halfway.replay(*SIGNALS.arrays)) == bits(new.replay(*SIGNALS.arrays))


def test_replace_keeps_the_other_settings_and_learns_nothing(halfway):
    other = halfway.replace(sample_time=5e-3)
    assert other.settings == {**halfway.settings, "sample_time": 5e-3}
    assert other.estimate().samples == 0
    assert halfway.estimate().samples > 0


def test_settings_cannot_be_changed_behind_an_estimator(kind):
    estimator = kind()
    estimator.settings["sample_time"] = 7.0
    assert estimator.settings["sample_time"] == 1e-3


def test_a_state_of_another_kind_is_refused():
    state = palpate.KelvinVoigtRLS()._state()
    with pytest.raises(ValueError, match="state must be of this version and class"):
        palpate.SingleStageRLS()._restore(state)


def test_repr_names_the_class_and_every_setting(kind):
    estimator = kind(sample_time=2e-3)
    words = repr(estimator)
    assert words.startswith(f"{kind.__name__}(initial={estimator.settings['initial']!r}")
    assert "sample_time=0.002" in words


def test_a_longer_contact_counts_its_samples(kind):
    estimator = kind()
    signals = exciting(MATERIALS["ball"])
    trace = estimator.replay(*signals.arrays)
    assert estimator.estimate().samples == np.count_nonzero(trace.taken) == len(signals)


@pytest.mark.parametrize("name", KINDS)
def test_update_takes_its_arguments_by_name_too(name):
    by_place, by_name = KINDS[name](), KINDS[name]()
    for x, v, force in SIGNALS.rows[:200]:
        by_place.update(x, v, force, 2e-3)
        by_name.update(force=force, dt=2e-3, velocity=v, penetration=x)
    assert by_place._state() == by_name._state()


@pytest.mark.parametrize(
    "args, kwargs",
    [
        ((), {}),
        ((0.01, 0.01), {}),
        ((0.01, 0.01, 1.0, 1e-3, 5.0), {}),
        ((0.01, 0.01, 1.0), {"force": 1.0}),
        ((0.01, 0.01, 1.0), {"depth": 1.0}),
        (("deep", 0.01, 1.0), {}),
        ((None, 0.01, 1.0), {}),
        ((0.01, 0.01, 1j), {}),
    ],
)
def test_update_of_no_sample_at_all_is_a_type_error(kind, args, kwargs):
    estimator = kind()
    before = estimator._state()
    with pytest.raises(TypeError):
        estimator.update(*args, **kwargs)
    assert estimator._state() == before
