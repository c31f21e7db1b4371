"""``python -m benchmarks.speed``: all results of speed and memory, with their limits.

All are ratios to something measured in the same run, or bounds that any recent machine keeps.
Needs the ``develop`` extra.
"""

import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from math import log
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.common.timing import (
    PERIOD,
    Case,
    Samples,
    best_times,
    contact_arrays,
    contact_samples,
    count_allocations,
    native_programs,
    resident,
    seconds_per_call,
    seconds_per_update,
    time_rounds,
)
from benchmarks.common.workers import in_new_process
from palpate import (
    ChangeDetector,
    ConstantForgetting,
    ContactEstimator,
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    HuntCrossley,
    KelvinVoigtRLS,
    LeastSquares,
    OutlierRejection,
    SingleStageRLS,
    VariableProjection,
)
from palpate.validation import Floats
from palpate.writing import check_outputs

KINDS: tuple[type[ContactEstimator], ...] = (
    KelvinVoigtRLS,
    ExtendedKelvinVoigtRLS,
    SingleStageRLS,
    DoubleStageRLS,
)
LOOP, PYTHON, COMPILED = "empty loop", "empty Python method", "empty compiled method"
UPDATE, WITH_DT = "SingleStageRLS.update", "SingleStageRLS.update, dt given"
OUT, ESTIMATE = "SingleStageRLS.update, out of contact", "SingleStageRLS.estimate"
LAW = "SingleStageRLS.estimate().law"
PASSES = 3  # of a replay
ROUNDS, REPLAYS, PEER_ROUNDS, STARTS = 80, 30, 12, 15
REPLAYED = 100_000  # samples
Arrays = tuple[Floats, Floats, Floats]


def main(*, only: str | None = None, markdown: Path | None = None) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    only
        One table: calls, projection, allocations, replays, peers, startup or memory.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    facts = describe_machine(native_programs().compiler)
    measures: dict[str, Callable[[], Section]] = {
        "calls": measure_calls,
        "projection": measure_projection,
        "allocations": lambda: count_allocations(KINDS),
        "replays": measure_replays,
        "peers": compare_with_peers,
        "startup": measure_startup,
        "memory": measure_memory,
    }
    sections = [measures[name]() for name in measures if only in (None, name)]
    publish(sections, facts, "Speed and memory, compared with other packages", markdown)


class Nothing:
    """The minimum: a Python method of three floats that does nothing."""

    def update(self, penetration: float, velocity: float, force: float) -> None:
        """Do nothing."""


def measure_calls() -> Section:
    """Time one call of each kind from Python, from a new start in every round."""
    notes = [
        f"{PERIOD} samples of contact, each round from a new start; shortest of the rounds. "
        "Times include the loop, for penetration, velocity, force in samples; 'net' is the ratio "
        "with the empty loop subtracted on both sides.",
    ]
    best = best_times("calls", _calls(contact_samples(PERIOD)), ROUNDS)
    loop, empty = best[LOOP], best[PYTHON]
    references = dict.fromkeys((ESTIMATE, LAW), UPDATE) | {LOOP: None, PYTHON: None}
    # Of an empty method: the single stage takes a logarithm, the double stage two regressions, and
    # each the cheap checks of the loop, without which nobody could act on an estimate.
    limits = {f"{kind.__name__}.update": Limit(3.25) for kind in KINDS} | {ESTIMATE: Limit(10.0)}
    rows = []
    for name, seconds in best.items():
        net = (seconds - loop) / (empty - loop)
        reference = references.get(name, f"{PYTHON} (net {net:.2f})")
        beside = best[UPDATE] if reference == UPDATE else empty
        ratio, to = (None, "") if reference is None else (seconds / beside, reference)
        rows.append(Row(name, 1e9 * seconds, "ns", ratio, to, limits.get(name)))
    ratio = best[UPDATE] / best[COMPILED]
    rows.append(Row(UPDATE, 1e9 * best[UPDATE], "ns", ratio, COMPILED))
    return Section("Calls from Python", rows, notes)


def _calls(samples: Samples) -> dict[str, Case]:
    single, learned, nothing = SingleStageRLS(), SingleStageRLS(), Nothing()
    compiled = native_programs().empty_method.Nothing()
    seconds_per_call(learned.update, samples)
    lifted = SingleStageRLS()
    lifted.update(*samples[0])
    free = [(-penetration, velocity, 0.0) for penetration, velocity, _ in samples]
    return {
        LOOP: lambda: _empty_loop(samples),
        PYTHON: lambda: seconds_per_call(nothing.update, samples),
        COMPILED: lambda: seconds_per_call(compiled.update, samples),
        **{f"{kind.__name__}.update": partial(seconds_per_update, kind(), samples)
           for kind in KINDS},
        WITH_DT: lambda: _with_steps(single, samples),
        OUT: lambda: seconds_per_call(lifted.update, free),
        ESTIMATE: lambda: _without_arguments(learned.estimate, len(samples)),
        LAW: lambda: _without_arguments(lambda: learned.estimate().law, len(samples) // 10),
    }  # fmt: skip


def _empty_loop(samples: Samples) -> float:
    start = perf_counter()
    for _penetration, _velocity, _force in samples:
        pass
    return (perf_counter() - start) / len(samples)


def _with_steps(estimator: ContactEstimator, samples: Samples) -> float:
    # Not quite a millisecond apart, as a real clock ticks: λ needs its exponential every time.
    stepped = [(*sample, 1e-3 + 1e-9 * (k % 97)) for k, sample in enumerate(samples)]
    estimator.reset()
    update = estimator.update
    start = perf_counter()
    for penetration, velocity, force, dt in stepped:
        update(penetration, velocity, force, dt)
    return (perf_counter() - start) / len(samples)


def _without_arguments(call: Any, calls: int) -> float:
    start = perf_counter()
    for _ in range(calls):
        call()
    return (perf_counter() - start) / calls


PROJECTION, EARLY = "VariableProjection.update", "SingleStageRLS.update, first 2 s"


def measure_projection() -> Section:
    """Time the default estimator, its change detector and its outlier rejection."""
    samples, learned = contact_samples(10_000), VariableProjection()
    seconds_per_call(learned.update, samples)
    single, projection = SingleStageRLS(), VariableProjection()
    detecting = VariableProjection(change_detector=ChangeDetector())
    rejecting = VariableProjection(outlier_rejection=OutlierRejection())
    both = detecting.replace(outlier_rejection=OutlierRejection())
    references: dict[str, Case] = {
        UPDATE: partial(seconds_per_update, single, samples),
        EARLY: partial(seconds_per_update, single, samples[:2000]),
    }
    # Its time, what that is compared with, and the limit of the ratio.
    calls: dict[str, tuple[Case, str, Limit | None]] = {
        # 2.45 to 2.9 were measured of one and the same core on one day.
        PROJECTION: (partial(seconds_per_update, projection, samples), UPDATE, Limit(3.0)),
        "VariableProjection.update, first 2 s": (
            # A search for the exponent comes at most every 64th sample once there are thousands,
            # and more often before.
            partial(seconds_per_update, projection, samples[:2000]), EARLY, Limit(4.0)),
        "VariableProjection.estimate": (
            lambda: _without_arguments(learned.estimate, 2000), PROJECTION, Limit(10.0)),
        "… with a ChangeDetector": (
            partial(seconds_per_update, detecting, samples), PROJECTION, None),
        "… with an OutlierRejection": (
            partial(seconds_per_update, rejecting, samples), PROJECTION, None),
        "… with both": (partial(seconds_per_update, both, samples), PROJECTION, Limit(1.4)),
    }  # fmt: skip
    cases = references | {name: case for name, (case, _, _) in calls.items()}
    best = best_times("projection", cases, ROUNDS)
    rows = [Row(name, 1e9 * best[name], "ns") for name in references]
    for name, (_, reference, limit) in calls.items():
        ratio = best[name] / best[reference]
        rows.append(Row(name, 1e9 * best[name], "ns", ratio, reference, limit))
    notes = [
        "10 000 updates on the ball, 2000 for the first 2 s, when the global search runs more "
        "often; 2000 estimates. Shortest of the rounds."
    ]
    return Section("Calls of VariableProjection from Python", rows, notes)


class NativeReplay:
    """Runs the C++ program; keeps each estimator's best times and last law.

    ``again`` writes into memory used before, as a program would; ``anew`` into new memory, as
    Python does.
    """

    def __init__(self, arrays: Arrays, folder: Path) -> None:
        np.concatenate(arrays).tofile(folder / "contact.bin")
        self._command = [str(native_programs().replay), str(folder / "contact.bin"), str(PASSES)]
        self.again: dict[str, float] = {}
        self.anew: dict[str, float] = {}
        self.laws: dict[str, list[float]] = {}

    def __call__(self) -> float:
        """Run it once; the times are in ``again`` and ``anew``."""
        done = subprocess.run(self._command, capture_output=True, text=True, check=True)
        for line in done.stdout.splitlines():
            name, again, anew, *law = line.split()
            self.again[name] = min(float(again), self.again.get(name, np.inf))
            self.anew[name] = min(float(anew), self.anew.get(name, np.inf))
            self.laws[name] = [float(value) for value in law]
        return 0.0


def measure_replays() -> Section:
    """Time replay(), update() in a loop and the program alternately, per sample."""
    samples = contact_samples(REPLAYED)
    penetration, velocity, force = np.array(samples).T.copy()
    arrays = (penetration, velocity, force)
    cases: dict[str, Case] = {}
    for kind in KINDS:
        one, other, name = kind(), kind(), kind.__name__
        cases[f"{name}.update"] = partial(seconds_per_update, one, samples)
        cases[f"{name}.arrays"] = partial(_update_from_arrays, one, arrays)
        cases[f"{name}.replay"] = partial(_replay, other, arrays)
    with tempfile.TemporaryDirectory() as folder:
        native = NativeReplay(arrays, Path(folder))
        rounds = time_rounds("replays", {**cases, "C++": native}, REPLAYS)
    best = {name: min(times) for name, times in rounds.items()}
    notes = [
        f"{REPLAYED} samples; per sample, shortest of the rounds. A replay writes 8 numbers and a "
        "status a sample (KelvinVoigtRLS 6) into new memory; the system provides its pages as "
        "they are first written.",
        _agreement(arrays, native),
    ]
    return Section("Replay of a whole trace, per sample", _replay_rows(best, native), notes)


def _replay(estimator: ContactEstimator, arrays: Arrays) -> float:
    best = float("inf")
    for _ in range(PASSES):
        estimator.reset()
        start = perf_counter()
        estimator.replay(*arrays)
        best = min(best, perf_counter() - start)
    return best / len(arrays[0])


def _update_from_arrays(estimator: ContactEstimator, arrays: Arrays) -> float:
    """Time per sample, from the arrays that replay() takes, converted to numbers first."""
    estimator.reset()
    update = estimator.update
    start = perf_counter()
    for penetration, velocity, force in zip(*(array.tolist() for array in arrays), strict=True):
        update(penetration, velocity, force)
    return (perf_counter() - start) / len(arrays[0])


def _replay_rows(best: dict[str, float], native: NativeReplay) -> list[Row]:
    rows = []
    for name in (kind.__name__ for kind in KINDS):
        update, replay = best[f"{name}.update"], best[f"{name}.replay"]
        for reference, seconds, limit in (
            ("update() in a Python loop over ready-made numbers", update, Limit(1.0)),
            ("update() in a Python loop over the arrays", best[f"{name}.arrays"], Limit(1.0)),
            ("C++, into existing memory", native.again[name], Limit(1.5)),
            ("C++, into new memory", native.anew[name], None),
        ):
            words = f"{reference}: {1e9 * seconds:.3g} ns"
            rows.append(Row(f"{name}.replay", 1e9 * replay, "ns", replay / seconds, words, limit))
    return rows


def _agreement(arrays: Arrays, native: NativeReplay) -> str:
    """Return a sentence on whether both gave the same law."""
    differing = [
        kind.__name__
        for kind in KINDS
        if kind().replay(*arrays).parameters[-1].tolist() != native.laws[kind.__name__]
    ]
    if differing:
        return f"last law differs between Python and C++: {', '.join(differing)}"
    return "The final law of each method is the same in Python and in C++, bit for bit."


def measure_startup() -> Section:
    """Start processes alternately; medians."""
    program = str(Path(sys.executable).with_name("palpate"))
    everything = "import numpy; from palpate import identify"  # loads palpate's modules
    cases = {
        "bare Python": _process(sys.executable, "-c", "pass"),
        "import numpy": _process(sys.executable, "-c", "import numpy"),
        "import numpy, palpate": _process(sys.executable, "-c", everything),
        "palpate --help": _process(program, "--help"),
    }
    for case in cases.values():
        case()  # fills the caches of the disk and of bytecode
    rounds = time_rounds("starting", cases, STARTS)
    times = {name: 1e3 * median(values) for name, values in rounds.items()}
    more = times.pop("import numpy, palpate") - times["import numpy"]
    times = {"import palpate, beyond NumPy": more, **times}
    limits = {"import palpate, beyond NumPy": Limit(120.0), "palpate --help": Limit(400.0)}
    rows = [Row(name, time, "ms", limit=limits.get(name)) for name, time in times.items()]
    notes = [f"Complete processes, with warm disk caches; medians of {STARTS} rounds."]
    return Section("Starting", rows, notes)


def _process(*command: str) -> Case:
    def case() -> float:
        start = perf_counter()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        return perf_counter() - start

    return case


def extra_bytes(samples: int) -> dict[str, int]:
    """Replay, and return how far the peak lies above the start and the trace."""
    SingleStageRLS().replay(*contact_arrays(1000))
    arrays = contact_arrays(samples)
    before = resident("VmRSS")
    trace = SingleStageRLS().replay(*arrays)
    grown = resident("VmHWM") - before
    columns = (getattr(trace, field.name) for field in fields(trace))
    size = sum(column.nbytes for column in columns if isinstance(column, np.ndarray))
    inputs = sum(array.nbytes for array in arrays)
    return {"inputs": inputs, "trace": size, "extra": grown - size}


def measure_memory() -> Section:
    """Compare a short and a long replay at 1 kHz."""
    megabyte = 1e6
    rows, extras = [], []
    for minutes in (15, 60):
        sizes = in_new_process(extra_bytes, minutes * 60_000)
        extras.append(sizes["extra"] / megabyte)
        name = f"{minutes} min at 1 kHz"
        rows.append(Row(f"{name}: inputs", sizes["inputs"] / megabyte, "MB"))
        rows.append(Row(f"{name}: trace returned", sizes["trace"] / megabyte, "MB"))
        rows.append(Row(f"{name}: extra at the peak", extras[-1], "MB", limit=Limit(8.0)))
    growth = extras[1] - extras[0]
    rows.append(
        Row("extra of the longer minus that of the shorter", growth, "MB", limit=Limit(1.0))
    )
    notes = ["Peak resident memory of a separate process, SingleStageRLS.replay."]
    return Section("Memory of a long replay", rows, notes)


Peer = Callable[[Samples], Floats]

START = 1e3  # P₀
PEER_SAMPLES = 20_000


def palpate_single_stage(samples: Samples) -> Floats:
    """Run our estimator, with its gate and its checks; the law ln K = B/K = n = 0 is θ = 0."""
    estimator = SingleStageRLS(
        initial=HuntCrossley(K=1.0, B=0.0, n=0.0),
        initial_covariance=START,
        forgetting=ConstantForgetting(1.0),
    )
    update = estimator.update
    for penetration, velocity, force in samples:
        update(penetration, velocity, force)
    law = estimator.estimate().law
    assert isinstance(law, HuntCrossley)
    return np.array([log(law.K), law.dissipation, law.n])


def palpate_least_squares(samples: Samples) -> Floats:
    """Run our plain engine, with rows created in Python."""
    engine = LeastSquares(3, initial_covariance=START)
    update = engine.update
    for penetration, velocity, force in samples:
        update((1.0, velocity, log(penetration)), log(force))
    return engine.parameters


def plain_numpy(samples: Samples) -> Floats:
    """Eq. 13 in NumPy, with its faster functions: dot() for @, += for +."""
    theta, p, row = np.zeros(3), START * np.eye(3), np.ones(3)
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        g = p.dot(row)
        gain = g / (1.0 + row.dot(g))
        theta += gain * (log(force) - row.dot(theta))
        p -= gain[:, None] * g
    return theta


def numpy_without_temporaries(samples: Samples) -> Floats:
    """The same with every array allocated in advance, our fastest version."""
    theta, p, row = np.zeros(3), START * np.eye(3), np.ones(3)
    g, gain, move, fall = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    column = gain[:, None]
    add, subtract, multiply, divide = np.add, np.subtract, np.multiply, np.divide
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        p.dot(row, g)
        divide(g, 1.0 + row.dot(g), gain)
        multiply(gain, log(force) - row.dot(theta), move)
        add(theta, move, theta)
        multiply(column, g, fall)
        subtract(p, fall, p)
    return theta


def padasip_rls(samples: Samples) -> Floats:
    """FilterRLS: P₀ = I/eps, and zero weights instead of random ones, its default."""
    from padasip.filters import FilterRLS

    rls = FilterRLS(3, mu=1.0, eps=1.0 / START, w="zeros")
    adapt, row = rls.adapt, np.ones(3)
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        adapt(log(force), row)
    return np.asarray(rls.w)


def filterpy_kalman(samples: Samples) -> Floats:
    """KalmanFilter as RLS: F = I and Q = 0, so predict() is not called; R = 1."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=3, dim_z=1)
    kalman.P = START * np.eye(3)
    kalman.R = np.eye(1)
    update, row, output = kalman.update, np.ones((1, 3)), np.ones((1, 1))
    for penetration, velocity, force in samples:
        row[0, 1], row[0, 2] = velocity, log(penetration)
        output[0, 0] = log(force)
        update(output, H=row)
    return np.asarray(kalman.x[:, 0])


def statsmodels_whole(samples: Samples) -> Floats:
    """RecursiveLS.filter() over the whole record: it cannot add one sample."""
    from statsmodels.regression.recursive_ls import RecursiveLS

    x, v, force = np.array(samples).T
    rows = np.column_stack([np.ones_like(v), v, np.log(x)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = RecursiveLS(
            np.log(force), rows, initialization="approximate_diffuse", initial_variance=START
        )
        return np.asarray(model.filter().params)


SINGLE_STAGE, ENGINE = "palpate SingleStageRLS", "palpate LeastSquares"
OURS: dict[str, Peer] = {SINGLE_STAGE: palpate_single_stage, ENGINE: palpate_least_squares}
ONLINE: dict[str, Peer] = {
    "plain NumPy": plain_numpy,
    "padasip FilterRLS": padasip_rls,
    "filterpy KalmanFilter": filterpy_kalman,
}
BESIDES: dict[str, Peer] = {
    "NumPy without temporaries": numpy_without_temporaries,
    "statsmodels RecursiveLS, whole record": statsmodels_whole,
}
NOTES = (
    "Ratios: the other package's time over palpate's. θ starts at 0 and P at 1e3 I for all: "
    "padasip with w='zeros' and eps=1e-3; filterpy with F = I, Q = 0, R = 1 and no predict(); "
    "statsmodels with initialization='approximate_diffuse' and initial_variance=1e3 (its default "
    "is exactly diffuse).",
    "statsmodels is not online: append() and extend() are not implemented for RecursiveLS, so "
    "each new sample needs the whole record again.",
)


def compare_with_peers() -> Section:
    """Time every package on the same samples, and compare the last θ."""
    samples = contact_samples(PEER_SAMPLES)
    peers = {**OURS, **ONLINE, **BESIDES}
    cases = {name: partial(_peer_seconds, peer, samples) for name, peer in peers.items()}
    best = best_times("other packages", cases, PEER_ROUNDS)
    rows = [*_speeds(best), *_differences(peers, samples)]
    title = "Compared with other packages: single-stage regression, per sample"
    return Section(title, rows, NOTES)


def _peer_seconds(peer: Peer, samples: Samples) -> float:
    start = perf_counter()
    peer(samples)
    return (perf_counter() - start) / len(samples)


def _speeds(best: dict[str, float]) -> list[Row]:
    rows = []
    ours = best[SINGLE_STAGE]
    for name, seconds in best.items():
        if name == SINGLE_STAGE:
            rows.append(Row(name, 1e9 * seconds, "ns"))
            continue
        # NumPy's calls differ by a fifth between its builds: 45 to 55 were measured.
        limit = at_least(40.0) if name in ONLINE else None
        rows.append(Row(name, 1e9 * seconds, "ns", seconds / ours, SINGLE_STAGE, limit))
    fastest = min((name for name in best if name in ONLINE), key=best.__getitem__)
    seconds = best[fastest]
    rows.append(Row(fastest, 1e9 * seconds, "ns", seconds / best[ENGINE], ENGINE))
    return rows


def _differences(peers: dict[str, Peer], samples: Samples) -> list[Row]:
    ours = OURS[ENGINE](samples)
    rows = []
    for name, peer in peers.items():
        if name != ENGINE:
            difference = float(np.max(np.abs(peer(samples) / ours - 1.0)))
            reference = f"of {ENGINE}"
            label = f"{name}: difference of θ, relative"
            rows.append(Row(label, difference, "", None, reference, Limit(1e-9)))
    return rows


if __name__ == "__main__":
    run_command(main)
