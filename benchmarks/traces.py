"""A trace of variable projection: full, thinned and none, compared with a single-stage replay.

``python -m benchmarks.traces`` measures this alone.
"""

from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from benchmarks import machine, report
from benchmarks.motion import contact_samples
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Case, Clock, Effort, clock
from palpate import Contact, ContactEstimator, SingleStageRLS, VariableProjection, identify
from palpate.estimators.estimate import Traced

SHORT = 1000  # samples of a curve
ESTIMATES = 2000  # of a trace, as identify has it by default
Arrays = tuple[NDArray[np.float64], ...]
Rows = NDArray[np.int64] | None


def _replay(estimator: ContactEstimator, arrays: Arrays, at: Rows) -> float:
    """Seconds a sample."""
    estimator.reset()
    start = perf_counter()
    estimator.replay(*arrays, at=at)
    return (perf_counter() - start) / len(arrays[0])


def _identify(contact: Contact, trace: Traced) -> float:
    """Seconds a sample, of a whole identification without its diagnosis."""
    start = perf_counter()
    identify(contact, trace=trace)
    return (perf_counter() - start) / len(contact)


def _cases(arrays: Arrays) -> dict[str, Case]:
    short = tuple(channel[:SHORT].copy() for channel in arrays)
    count = len(arrays[0])
    none = np.empty(0, dtype=np.int64)
    some = np.linspace(0, count - 1, min(count, ESTIMATES)).astype(np.int64)
    single, projection = SingleStageRLS(), VariableProjection()
    penetration, velocity, force = short
    time = 1e-3 * np.arange(SHORT)
    contact = Contact(time, penetration=penetration, velocity=velocity, force=force)
    return {
        "single": lambda: _replay(single, arrays, None),
        "full": lambda: _replay(projection, arrays, None),
        "thinned": lambda: _replay(projection, arrays, some),
        "none": lambda: _replay(projection, arrays, none),
        "short single": lambda: _replay(single, short, None),
        "short full": lambda: _replay(projection, short, None),
        "short none": lambda: _replay(projection, short, none),
        "identify full": lambda: _identify(contact, "full"),
        "identify none": lambda: _identify(contact, False),
    }


def measure_traces(running: Clock, effort: Effort) -> Section:
    """Time them alternately, per sample."""
    penetration, velocity, force = np.array(contact_samples(effort.replay_samples)).T.copy()
    cases = _cases((penetration, velocity, force))
    best = running.best("traces", cases, effort.replay_rounds, passes=2)
    ns = {name: 1e9 * seconds for name, seconds in best.items()}

    def row(name: str, words: str, beside: str, reference: str, limit: float | None) -> Row:
        kept = None if limit is None else Limit(limit)
        shown = f"{reference}: {ns[beside]:.3g} ns"
        return Row(words, ns[name], "ns", ns[name] / ns[beside], shown, kept)

    replay = "full trace of SingleStageRLS"
    rows = [
        row("thinned", f"{ESTIMATES} estimates", "single", replay, 3.5),
        row("full", "full trace", "single", replay, None),
        row("none", "no estimates", "thinned", f"{ESTIMATES} estimates", 1.1),
        row("short full", f"full trace of {SHORT} samples", "short single", replay, None),
        row("short none", f"{SHORT} samples, no estimates", "short single", replay, None),
        row(
            "identify none",
            f"identify(trace=False), {SHORT} samples",
            "identify full",
            "with a full trace",
            None,
        ),
    ]
    notes = [
        f"{effort.replay_samples} samples, all in contact; per sample, shortest round. In the "
        "first thousand a search over the whole range of exponents is due after every 64th part "
        "of the samples, 180 of them, with any trace.",
    ]
    return Section("Trace of VariableProjection, per sample", rows, notes)


def main() -> None:
    """Measure, and print a table."""
    with clock() as running:
        section = measure_traces(running, Effort())
    console = Console(highlight=False, width=140)
    report.print_sections([section], machine.describe("that of the extension"), console)


if __name__ == "__main__":
    main()
