"""``python -m benchmarks.speed``: all results of speed and memory, with their limits.

All are ratios to something measured in the same run, or bounds that any recent machine keeps.
Needs the ``develop`` extra.
"""

import json
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
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
    write_json,
)
from benchmarks.common.timing import (
    PERIOD,
    BuildError,
    Case,
    Clock,
    Effort,
    Samples,
    clock,
    compiler,
    contact_arrays,
    contact_samples,
    count_allocations,
    native_programs,
    resident,
    seconds_per_call,
    seconds_per_update,
)
from benchmarks.online_preparation import measure_preparation
from palpate import (
    ConstantForgetting,
    Contact,
    ContactEstimator,
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    HuntCrossley,
    KelvinVoigtRLS,
    LeastSquares,
    SingleStageRLS,
    VariableProjection,
    identify,
)
from palpate.estimators.estimate import Traced
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
Arrays = tuple[Floats, Floats, Floats]


def main(
    *,
    quick: bool = False,
    only: str | None = None,
    memory_of: Annotated[int | None, Parameter(show=False)] = None,
    as_json: Annotated[Path | None, Parameter(name="--json")] = None,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    quick
        A short run, for a first look: fewer rounds, shorter recordings.
    only
        One table: calls, preparation, allocations, replays, traces, peers, startup or memory.
    memory_of
        Print the bytes of one replay of so many samples.
    as_json
        Write everything to this file as JSON.
    markdown
        Write the tables to this file as Markdown.
    """
    if memory_of is not None:
        print(json.dumps(extra_bytes(memory_of)))
        return
    check_outputs([path for path in (as_json, markdown) if path is not None])
    effort = Effort.quick() if quick else Effort()
    facts = describe_machine(compiler())
    with clock() as running:
        measures: dict[str, Callable[[], Section]] = {
            "calls": lambda: measure_calls(running, effort),
            "preparation": lambda: measure_preparation(running, effort),
            "allocations": lambda: count_allocations(KINDS),
            "replays": lambda: measure_replays(running, effort),
            "traces": lambda: measure_traces(running, effort),
            "peers": lambda: compare_with_peers(running, effort),
            "startup": lambda: measure_startup(running, effort),
            "memory": lambda: measure_memory(effort),
        }
        sections = [measures[name]() for name in measures if only in (None, name)]
    publish(sections, facts, "Speed and memory, compared with other packages", markdown)
    write_json(as_json, sections, facts)


class Nothing:
    """The minimum: a Python method of three floats that does nothing."""

    def update(self, penetration: float, velocity: float, force: float) -> None:
        """Do nothing."""


def measure_calls(clock: Clock, effort: Effort) -> Section:
    """Time one call of each kind from Python, from a new start in every round."""
    notes = [
        f"{PERIOD} samples of contact, each round from a new start; shortest of the rounds. "
        "Times include the loop, for penetration, velocity, force in samples; 'net' is the ratio "
        "with the empty loop subtracted on both sides.",
    ]
    samples = contact_samples(PERIOD)
    best = clock.best("calls", _calls(samples, notes), effort.call_rounds)
    loop, empty = best[LOOP], best[PYTHON]
    references = dict.fromkeys((ESTIMATE, LAW), UPDATE) | {LOOP: None, PYTHON: None}
    limits = {f"{kind.__name__}.update": Limit(2.5) for kind in KINDS}
    rows = []
    for name, seconds in best.items():
        net = (seconds - loop) / (empty - loop)
        reference = references.get(name, f"{PYTHON} (net {net:.2f})")
        beside = best[UPDATE] if reference == UPDATE else empty
        ratio, to = (None, "") if reference is None else (seconds / beside, reference)
        rows.append(Row(name, 1e9 * seconds, "ns", ratio, to, limits.get(name)))
    if COMPILED in best:
        ratio = best[UPDATE] / best[COMPILED]
        rows.append(Row(UPDATE, 1e9 * best[UPDATE], "ns", ratio, COMPILED))
    return Section("Calls from Python", rows, notes)


def _calls(samples: Samples, notes: list[str]) -> dict[str, Case]:
    single, learned, nothing = SingleStageRLS(), SingleStageRLS(), Nothing()
    seconds_per_call(learned.update, samples)
    free = [(-penetration, velocity, 0.0) for penetration, velocity, _ in samples]
    cases: dict[str, Case] = {
        LOOP: lambda: _empty_loop(samples),
        PYTHON: lambda: seconds_per_call(nothing.update, samples),
    }
    try:
        compiled = native_programs().empty_method.Nothing()
        cases[COMPILED] = lambda: seconds_per_call(compiled.update, samples)
    except BuildError as error:
        notes.append(f"no {COMPILED}: {error}")
    for kind in KINDS:
        cases[f"{kind.__name__}.update"] = partial(seconds_per_update, kind(), samples)
    return {
        **cases,
        WITH_DT: lambda: _with_steps(single, samples),
        OUT: lambda: _out_of_contact(single, samples[0], free),
        ESTIMATE: lambda: _without_arguments(learned.estimate, len(samples)),
        LAW: lambda: _without_arguments(lambda: learned.estimate().law, len(samples) // 10),
    }


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


def _out_of_contact(
    estimator: ContactEstimator, touch: tuple[float, float, float], free: Samples
) -> float:
    estimator.reset()
    estimator.update(*touch)
    return seconds_per_call(estimator.update, free)


def _without_arguments(call: Any, calls: int) -> float:
    start = perf_counter()
    for _ in range(calls):
        call()
    return (perf_counter() - start) / calls


class NativeReplay:
    """Runs the C++ program; keeps each estimator's times and last law.

    ``again`` writes into memory used before, as a program would; ``anew`` into new memory, as
    Python does.
    """

    def __init__(self, arrays: Arrays, folder: Path) -> None:
        self._file = folder / "contact.bin"
        np.concatenate(arrays).tofile(self._file)
        self._program = native_programs().replay
        self.again: dict[str, list[float]] = {}
        self.anew: dict[str, list[float]] = {}
        self.laws: dict[str, list[float]] = {}

    def __call__(self) -> float:
        """Run it once; the times are in ``again`` and ``anew``."""
        command = [str(self._program), str(self._file), str(PASSES)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        for line in done.stdout.splitlines():
            name, again, anew, *law = line.split()
            self.again.setdefault(name, []).append(float(again))
            self.anew.setdefault(name, []).append(float(anew))
            self.laws[name] = [float(value) for value in law]
        return 0.0


def measure_replays(clock: Clock, effort: Effort) -> Section:
    """Time replay(), update() in a loop and the program alternately, per sample."""
    samples = contact_samples(effort.replay_samples)
    penetration, velocity, force = np.array(samples).T.copy()
    arrays = (penetration, velocity, force)
    cases: dict[str, Case] = {}
    for kind in KINDS:
        one, other, name = kind(), kind(), kind.__name__
        cases[f"{name}.update"] = partial(seconds_per_update, one, samples)
        cases[f"{name}.arrays"] = partial(_update_from_arrays, one, arrays)
        cases[f"{name}.replay"] = partial(_replay, other, arrays)
    notes = [
        f"{effort.replay_samples} samples; per sample, shortest of the rounds. A replay writes 8 "
        "numbers and a status a sample (KelvinVoigtRLS 6) into new memory; the system provides "
        "its pages as they are first written.",
    ]
    with tempfile.TemporaryDirectory() as folder:
        native: NativeReplay | None = None
        try:
            native = NativeReplay(arrays, Path(folder))
            cases["C++"] = native
        except BuildError as error:
            notes.append(f"no C++ program: {error}")
        best = clock.best("replays", cases, effort.replay_rounds, passes=1)
    if native is not None:
        notes.append(_agreement(arrays, native))
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


def _replay_rows(best: dict[str, float], native: NativeReplay | None) -> list[Row]:
    rows = []
    for name in (kind.__name__ for kind in KINDS):
        update, replay = best[f"{name}.update"], best[f"{name}.replay"]
        references: list[tuple[str, float, Limit | None]] = [
            ("update() in a Python loop over ready-made numbers", update, Limit(1.0)),
            ("update() in a Python loop over the arrays", best[f"{name}.arrays"], Limit(1.0)),
        ]
        if native is not None:
            references += [
                ("C++, into existing memory", min(native.again[name]), Limit(1.5)),
                ("C++, into new memory", min(native.anew[name]), None),
            ]
        for reference, seconds, limit in references:
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


def measure_startup(clock: Clock, effort: Effort) -> Section:
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
    rounds = clock.rounds("starting", cases, effort.start_rounds)
    times = {name: 1e3 * median(values) for name, values in rounds.items()}
    more = times.pop("import numpy, palpate") - times["import numpy"]
    times = {"import palpate, beyond NumPy": more, **times}
    limits = {"import palpate, beyond NumPy": Limit(120.0), "palpate --help": Limit(400.0)}
    rows = [Row(name, time, "ms", limit=limits.get(name)) for name, time in times.items()]
    notes = [f"Complete processes, with warm disk caches; medians of {effort.start_rounds} rounds."]
    return Section("Starting", rows, notes)


def _process(*command: str) -> Case:
    def case() -> float:
        start = perf_counter()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        return perf_counter() - start

    return case


SHORT = 1000  # samples of a curve
ESTIMATES = 2000  # of a trace, as identify has it by default
Rows = NDArray[np.int64] | None


def _seconds(estimator: ContactEstimator, arrays: Arrays, at: Rows) -> float:
    """Seconds a sample."""
    estimator.reset()
    start = perf_counter()
    estimator.replay(*arrays, at=at)
    return (perf_counter() - start) / len(arrays[0])


def _identification(contact: Contact, trace: Traced) -> float:
    """Seconds a sample, of a whole identification without its diagnosis."""
    start = perf_counter()
    identify(contact, trace=trace)
    return (perf_counter() - start) / len(contact)


def _trace_cases(arrays: Arrays) -> dict[str, Case]:
    penetration, velocity, force = (channel[:SHORT].copy() for channel in arrays)
    short = (penetration, velocity, force)
    count = len(arrays[0])
    none = np.empty(0, dtype=np.int64)
    some = np.linspace(0, count - 1, min(count, ESTIMATES)).astype(np.int64)
    single, projection = SingleStageRLS(), VariableProjection()
    time = 1e-3 * np.arange(SHORT)
    contact = Contact(time, penetration=penetration, velocity=velocity, force=force)
    return {
        "single": lambda: _seconds(single, arrays, None),
        "full": lambda: _seconds(projection, arrays, None),
        "thinned": lambda: _seconds(projection, arrays, some),
        "none": lambda: _seconds(projection, arrays, none),
        "short single": lambda: _seconds(single, short, None),
        "short full": lambda: _seconds(projection, short, None),
        "short none": lambda: _seconds(projection, short, none),
        "identify full": lambda: _identification(contact, "full"),
        "identify none": lambda: _identification(contact, False),
    }


def measure_traces(clock: Clock, effort: Effort) -> Section:
    """Time them alternately, per sample."""
    penetration, velocity, force = np.array(contact_samples(effort.replay_samples)).T.copy()
    cases = _trace_cases((penetration, velocity, force))
    best = clock.best("traces", cases, effort.replay_rounds, passes=2)
    ns = {name: 1e9 * seconds for name, seconds in best.items()}

    def row(name: str, words: str, beside: str, reference: str, limit: float | None) -> Row:
        kept = None if limit is None else Limit(limit)
        shown = f"{reference}: {ns[beside]:.3g} ns"
        return Row(words, ns[name], "ns", ns[name] / ns[beside], shown, kept)

    replay, whole = "full trace of SingleStageRLS", f"identify(trace=False), {SHORT} samples"
    rows = [
        row("thinned", f"{ESTIMATES} estimates", "single", replay, 3.5),
        row("full", "full trace", "single", replay, None),
        row("none", "no estimates", "thinned", f"{ESTIMATES} estimates", 1.1),
        row("short full", f"full trace of {SHORT} samples", "short single", replay, None),
        row("short none", f"{SHORT} samples, no estimates", "short single", replay, None),
        row("identify none", whole, "identify full", "with a full trace", None),
    ]
    notes = [
        f"{effort.replay_samples} samples, all in contact; per sample, shortest round. In the "
        "first thousand a search over the whole range of exponents is due after every 64th part "
        "of the samples, 180 of them, with any trace.",
    ]
    return Section("Trace of VariableProjection, per sample", rows, notes)


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


def _in_a_process(samples: int) -> dict[str, int]:
    command = [sys.executable, "-m", "benchmarks.speed", "--memory-of", str(samples)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result: dict[str, int] = json.loads(done.stdout)
    return result


def measure_memory(effort: Effort) -> Section:
    """Compare a short and a long replay at 1 kHz."""
    megabyte = 1e6
    rows, extras = [], []
    for minutes in effort.memory_minutes:
        sizes = _in_a_process(minutes * 60_000)
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
        initial=HuntCrossley(stiffness=1.0, damping=0.0, exponent=0.0),
        initial_covariance=START,
        forgetting=ConstantForgetting(1.0),
    )
    update = estimator.update
    for penetration, velocity, force in samples:
        update(penetration, velocity, force)
    law = estimator.estimate().law
    assert isinstance(law, HuntCrossley)
    return np.array([log(law.stiffness), law.dissipation, law.exponent])


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


def compare_with_peers(clock: Clock, effort: Effort) -> Section:
    """Time every package on the same samples, and compare the last θ."""
    samples = contact_samples(PEER_SAMPLES)
    peers, notes = _installed({**OURS, **ONLINE, **BESIDES}, samples[:10])
    cases = {name: lambda p=peer: _peer_seconds(p, samples) for name, peer in peers.items()}
    best = clock.best("other packages", cases, effort.peer_rounds)
    rows = [*_speeds(best), *_differences(peers, samples)]
    title = "Compared with other packages: single-stage regression, per sample"
    return Section(title, rows, [*NOTES, *notes])


def _installed(peers: dict[str, Peer], samples: Samples) -> tuple[dict[str, Peer], list[str]]:
    """Return those that can be imported, and a note on each that cannot."""
    present, notes = {}, []
    for name, peer in peers.items():
        try:
            peer(samples)
            present[name] = peer
        except ImportError as error:
            notes.append(f"no {name}: {error}; it is in the 'benchmark' extra")
    return present, notes


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
        limit = at_least(50.0) if name in ONLINE else None
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
