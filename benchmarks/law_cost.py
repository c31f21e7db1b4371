"""Time and allocations of an update of ``ViscoelasticContact``, and of a whole identification."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.allocations import count_allocations
from benchmarks.law_contacts import Material
from benchmarks.motion import Samples
from benchmarks.report import Limit, Row, Section
from palpate import (
    Contact,
    ContactEstimator,
    ContactGate,
    Scale,
    VariableProjection,
    ViscoelasticContact,
    identify,
    prepare,
)
from palpate.validation import Floats

PASSES = 10
LONGEST_CALL = 20.0  # µs
KINDS: tuple[type[ContactEstimator], ...] = VariableProjection, ViscoelasticContact
HOW = (
    "20 000 samples at 1 kHz of three sines on a material with two relaxation times, from Python. "
    f"A sample's time is the least of {PASSES} passes over the same samples, in turns, which "
    "excludes the machine's other work, minus that of an empty function."
)


def measure_cost() -> list[Section]:
    """Measure ns of an update, the slowest one, allocations, and CPU of an identification."""
    contact = _contact(20_000)
    columns = (contact.penetration.tolist(), contact.velocity.tolist(), contact.force.tolist())
    samples = list(zip(*columns, strict=True))
    settings = {
        "gate": ContactGate(),
        "scale": Scale(*(float(np.percentile(np.abs(column), 99.0)) for column in columns)),
    }
    least = {kind: np.full(len(samples), np.inf) for kind in KINDS}
    empty = np.full(len(samples), np.inf)
    for _ in range(PASSES):
        empty = np.minimum(empty, _times(lambda x, v, force: None, samples))
        for kind in KINDS:
            least[kind] = np.minimum(least[kind], _times(kind(**settings).update, samples))
    other, rows = VariableProjection, []
    mean = {kind: float(np.mean(each) - np.mean(empty)) for kind, each in least.items()}
    for kind, times in least.items():
        name, longest = kind.__name__, 1e-3 * float(np.max(times))
        ratio = mean[kind] / mean[other]
        rows.append(Row(f"{name}.update", mean[kind], "ns", ratio, other.__name__))
        limit = None if kind is other else Limit(LONGEST_CALL)
        rows.append(Row(f"{name}.update, slowest", longest, "µs", limit=limit))
    return [
        Section("Time of an update", rows, (HOW,)),
        count_allocations(KINDS),
        _whole(_contact(4000)),
    ]


def _contact(samples: int) -> Contact:
    """An approach, then sines of 4, 11 and 15 rad/s about 10 mm, with noise."""
    random, time = np.random.default_rng(1), 1e-3 * np.arange(samples) - 0.4
    size, turns = [1e-3, 1.8e-3, 1.8e-3], [4.0, 11.0, 15.0]
    waves = np.sin(np.outer(np.maximum(time, 0.0), turns)) @ size
    x = 10e-3 + waves + 30e-3 * np.minimum(time, 0.0)
    times, branches = np.array([0.05, 0.8]), np.array([4e3, 3e3])
    material = Material(1e4, 1.5, 4e2, 1.5, times, branches)
    force = material.elastic(x, 1e-3) + material.damper(x, np.gradient(x, 1e-3))
    return prepare(time=time, penetration=x, force=force + 0.05 * random.standard_normal(samples))


def _times(update: Callable[[float, float, float], Any], samples: Samples) -> Floats:
    """Nanoseconds of each call."""
    clock, times = time.perf_counter_ns, np.empty(len(samples))
    for k, (x, v, force) in enumerate(samples):
        begun = clock()
        update(x, v, force)
        times[k] = clock() - begun
    return times


def _whole(contact: Contact) -> Section:
    """CPU of an identification with its diagnosis, over that of the default law."""
    times: dict[str, list[float]] = {"hunt-crossley": [], "auto": []}
    for _ in range(5):
        for law, spent in times.items():
            begun = time.process_time()
            _ = identify(contact, law=law, trace=False).diagnosis
            spent.append(time.process_time() - begun)
    first = min(times["hunt-crossley"])
    rows = [
        Row(f"identify, law {law}, with its diagnosis", 1e3 * min(spent), "ms", min(spent) / first)
        for law, spent in times.items()
    ]
    return Section(f"CPU of an identification, {len(contact)} samples", rows)
