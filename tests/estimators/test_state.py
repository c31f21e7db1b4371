"""A saved state is what it was, or is refused in words; threads may share an estimator."""

import copy
import os
import pickle
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from cases import KINDS, MATERIALS, exciting, knowledge, tapping

import palpate
from palpate import ChangeDetector, InvalidParameterError, OutlierRejection
from palpate.method.estimators import CompiledEstimator

SIGNALS = tapping(MATERIALS["pvc"], noise=0.02, seed=11)


def test_reading_the_settings_does_not_change_an_estimator(kind):
    estimator = kind()
    estimator.settings["sample_time"] = 7.0
    assert estimator.settings["sample_time"] == 1e-3


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("name", KINDS)
def test_update_takes_its_arguments_by_name_too(name, watched):
    watching = {"change_detector": ChangeDetector(), "outlier_rejection": OutlierRejection()}
    by_place, by_name = (KINDS[name](**watching if watched else {}) for _ in range(2))
    for x, v, force in SIGNALS.rows[:200]:
        by_place.update(x, v, force, 2e-3)
        by_name.update(force=force, dt=2e-3, velocity=v, penetration=x)
    assert by_place._state() == by_name._state()


@pytest.mark.parametrize(
    "args, kwargs",
    [
        *((args, {}) for args in ((), (0.01, 0.01), (0.01, 0.01, 1.0, 1e-3, 5.0))),
        *((args, {}) for args in (("deep", 0.01, 1.0), (None, 0.01, 1.0), (0.01, 0.01, 1j))),
        *(((0.01, 0.01, 1.0), {name: 1.0}) for name in ("force", "depth")),
    ],
)
def test_update_of_no_sample_at_all_is_a_type_error(kind, args, kwargs):
    estimator = kind()
    before = estimator._state()
    with pytest.raises(TypeError):
        estimator.update(*args, **kwargs)
    assert estimator._state() == before


# What holds a compiled state: every estimator, with and without a detector, and the bare recursion.
COMPILED = {k: v for k, v in palpate.ESTIMATORS.items() if issubclass(v, CompiledEstimator)}
HOLDERS = {
    **COMPILED,
    **{
        f"{name} with a detector": lambda kind=kind: kind(change_detector=ChangeDetector())
        for name, kind in COMPILED.items()
    },
    "least squares": lambda: palpate.LeastSquares(3),
    "least squares of order 8": lambda: palpate.LeastSquares(8),
}


def learned(name):
    holder = HOLDERS[name]()
    if "least squares" in name:
        order = len(holder.parameters)
        for k in range(1, 30):
            holder.update([np.sin(k * i) for i in range(1, order + 1)], float(k))
    else:
        holder.replay(*SIGNALS[:300].arrays)
    return holder


def numbers(holder):
    if isinstance(holder, palpate.LeastSquares):
        return holder.parameters.tobytes(), holder.covariance.tobytes(), holder.samples
    return knowledge(holder)


def together(threads, work):
    """Do it in as many threads, which begin at once with this one."""
    start = threading.Barrier(threads + 1)

    def begin():
        start.wait()
        work()

    running = [threading.Thread(target=begin) for _ in range(threads)]
    for thread in running:
        thread.start()
    start.wait()
    return running


def mutated(state, random):
    """The state with a byte or some changed, cut out, doubled or put elsewhere."""
    changed = bytearray(state)
    place, length = int(random.integers(len(state))), int(random.integers(1, 9))
    match random.integers(5):
        case 0:
            changed[place] ^= 1 << int(random.integers(8))
        case 1:
            changed[place : place + length] = random.bytes(len(changed[place : place + length]))
        case 2:
            del changed[place : place + length]
        case 3:
            changed[place:place] = changed[:length]
        case 4:
            changed = changed[: max(place, 1)]
    return bytes(changed)


@pytest.mark.parametrize("name", HOLDERS)
def test_a_mutated_state_is_refused_in_words_or_is_the_same(name, seed):
    """Some 800 of each."""
    random = np.random.default_rng(seed)
    holder = learned(name)
    state, known = holder._state(), numbers(holder)
    for _ in range(800):
        broken = mutated(state, random)
        if broken == state:
            holder._restore(broken)
        else:
            with pytest.raises(ValueError, match=r"^state "):
                holder._restore(broken)
        assert numbers(holder) == known


@pytest.mark.parametrize("name", HOLDERS)
def test_a_copy_has_the_same_state_to_the_last_byte(name):
    holder = learned(name)
    assert copy.copy(holder)._state() == holder._state() == learned(name)._state()


def sealed(memory, state):
    """A saved state of this memory: the heading of another, and the checksum (FNV-1a)."""
    checksum = 14695981039346656037
    for byte in memory:
        checksum = (checksum ^ byte) * 1099511628211 % (1 << 64)
    heading = b";".join(state.split(b";", 4)[:4])
    return heading + b";%016x\n" % checksum + memory


def use_changed_states(name, count):
    """Restore states with a right checksum and one or two changed numbers; use what is accepted."""
    random, state = np.random.default_rng(8), learned(name)._state()
    memory = state.partition(b"\n")[2]
    assert sealed(memory, state) == state
    for _ in range(count):
        changed = np.frombuffer(memory, np.uint32).copy()
        places = random.integers(changed.size, size=2)
        changed[places] = random.choice([1, 8, 33, 255, 1 << 16, 1 << 31, 2**32 - 1], 2)
        holder = HOLDERS[name]()
        with suppress(ValueError):  # it is refused
            holder._restore(sealed(changed.tobytes(), state))
            if "least squares" not in name:
                holder.replay(*SIGNALS[:600].arrays)
                holder.estimate()


@pytest.mark.long
@pytest.mark.parametrize("name", HOLDERS)
def test_a_changed_state_with_a_right_checksum_ends_no_process(name):
    program = "import sys, test_state; test_state.use_changed_states(sys.argv[1], 200)"
    folders = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program, name], check=True, timeout=120,
        env={**os.environ, "PYTHONPATH": folders},
    )  # fmt: skip


def test_a_mutated_pickle_is_refused_in_words():
    whole = pickle.dumps(learned("least squares"))
    at = whole.index(b"palpate-state") + 100
    broken = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]
    with pytest.raises(InvalidParameterError, match="checksum does not match"):
        pickle.loads(broken)


# Made when they are wanted: pytest keeps what a test is given beyond the end of the process, and
# nanobind would call it leaked.
OTHERS = {
    "another class": (palpate.KelvinVoigtRLS, {}, "of this version and class"),
    "another detector": (
        palpate.SingleStageRLS,
        {"change_detector": ChangeDetector()},
        "of this version and class",
    ),
    "other settings": (palpate.SingleStageRLS, {"sample_time": 2e-3}, "with the same settings"),
}


@pytest.mark.parametrize("other, settings, words", OTHERS.values(), ids=OTHERS)
def test_a_state_of_another_estimator_or_version_is_refused(other, settings, words):
    estimator = palpate.SingleStageRLS()
    with pytest.raises(ValueError, match=words):
        estimator._restore(other(**settings)._state())
    older = estimator._state().replace(b";", b";0.0.9-", 1)
    with pytest.raises(ValueError, match=r"state must be of this version and class, palpate-state"):
        estimator._restore(older)
    with pytest.raises(ValueError, match="must be bytes that an estimator saved"):
        estimator._restore(b"")


def test_eight_threads_share_an_estimator_and_lose_nothing():
    """Each replay is taken whole, and all are alike, so that their order does not matter."""
    signals = exciting(MATERIALS["pvc"], seconds=2.0, noise=0.02, seed=3)
    shared, alone = palpate.SingleStageRLS(), palpate.SingleStageRLS()
    for thread in together(8, lambda: [shared.replay(*signals.arrays) for _ in range(10)]):
        thread.join()
    for _ in range(80):
        alone.replay(*signals.arrays)
    assert knowledge(shared) == knowledge(alone)


def test_samples_from_other_threads_wait_for_a_replay():
    signals = exciting(MATERIALS["pvc"], seconds=20.0, noise=0.02, seed=3)
    estimator, seen = palpate.VariableProjection(), []

    def watch():
        for _ in range(50):
            estimator.update(-1.0, 0.0, 0.0)
            seen.append(estimator.estimate().samples)

    watching = together(7, watch)
    estimator.replay(*signals.arrays)
    for thread in watching:
        thread.join()
    assert set(seen) <= {0, len(signals)}  # a replay is taken whole
    assert estimator.estimate().samples == len(signals)
    assert len(estimator.replay(*signals[:5].arrays)) == 5
