"""Time of one call from Python: update(), its variants, estimate()."""

from collections.abc import Callable
from time import perf_counter
from typing import Any

from benchmarks.motion import PERIOD, Samples, contact_samples
from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Case, Clock, Effort
from palpate import (
    ContactEstimator,
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    SingleStageRLS,
)

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


class Nothing:
    """The minimum: a Python method of three floats that does nothing."""

    def update(self, penetration: float, velocity: float, force: float) -> None:
        """Do nothing."""


def seconds_per_call(update: Callable[[float, float, float], Any], samples: Samples) -> float:
    """Call it with every sample."""
    start = perf_counter()
    for penetration, velocity, force in samples:
        update(penetration, velocity, force)
    return (perf_counter() - start) / len(samples)


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


def _from_the_start(estimator: ContactEstimator, samples: Samples) -> float:
    estimator.reset()
    return seconds_per_call(estimator.update, samples)


def _out_of_contact(estimator: ContactEstimator, samples: Samples) -> float:
    estimator.reset()
    estimator.update(*samples[0])
    free = [(-penetration, velocity, 0.0) for penetration, velocity, _ in samples]
    return seconds_per_call(estimator.update, free)


def _without_arguments(call: Callable[[], Any], calls: int) -> float:
    start = perf_counter()
    for _ in range(calls):
        call()
    return (perf_counter() - start) / calls


def _cases(samples: Samples, notes: list[str]) -> dict[str, Case]:
    single = SingleStageRLS()
    learned = SingleStageRLS()
    seconds_per_call(learned.update, samples)
    nothing = Nothing()
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
        estimator = kind()
        cases[f"{kind.__name__}.update"] = lambda e=estimator: _from_the_start(e, samples)  # type: ignore[misc]  # a default binds the loop's variable
    cases[WITH_DT] = lambda: _with_steps(single, samples)
    cases[OUT] = lambda: _out_of_contact(single, samples)
    cases[ESTIMATE] = lambda: _without_arguments(learned.estimate, len(samples))
    cases[LAW] = lambda: _without_arguments(lambda: learned.estimate().law, len(samples) // 10)
    return cases


def measure_calls(clock: Clock, effort: Effort) -> Section:
    """Time every call, each with a sample of the ball, from a new start in every round."""
    notes = [
        f"{PERIOD} samples of contact, each round from a new start; shortest of the rounds. "
        "Times include the loop, for penetration, velocity, force in samples; 'net' is the ratio "
        "with the empty loop subtracted on both sides.",
    ]
    samples = contact_samples(PERIOD)
    best = clock.best("calls", _cases(samples, notes), effort.call_rounds)
    loop, empty = best[LOOP], best[PYTHON]
    rows = []
    for name, seconds in best.items():
        ratio = seconds / empty
        net = (seconds - loop) / (empty - loop)
        judged = name in {f"{kind.__name__}.update" for kind in KINDS}
        if name in (LOOP, PYTHON):
            rows.append(Row(name, 1e9 * seconds, "ns"))
        elif name in (ESTIMATE, LAW):
            rows.append(Row(name, 1e9 * seconds, "ns", seconds / best[UPDATE], UPDATE))
        else:
            limit = Limit(2.5) if judged else None
            reference = f"{PYTHON} (net {net:.2f})"
            rows.append(Row(name, 1e9 * seconds, "ns", ratio, reference, limit))
    if COMPILED in best:
        ratio = best[UPDATE] / best[COMPILED]
        rows.append(Row(UPDATE, 1e9 * best[UPDATE], "ns", ratio, COMPILED))
    return Section("Calls from Python", rows, notes)
