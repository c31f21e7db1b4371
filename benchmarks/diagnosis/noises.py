"""Recordings without a fault, whose noise is not all white."""

from collections.abc import Callable

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from benchmarks.diagnosis.trials import RATES, Trial, generator, pressed
from palpate.validation import Floats

Noise = Callable[[Trial, int], Floats]  # of a trial and a number of samples, N
MOTION = ("touches", "press", "multi-sine")
SHORT = "0.5–1.5 s"
LENGTHS = {SHORT: (0.5, 1.5), "1.5–6 s": (1.5, 6.0), "6–20 s": (6.0, 20.0)}


def _white(trial: Trial, count: int) -> Floats:
    return trial.noise * trial.random.standard_normal(count)


def _autoregressive(share: float) -> Noise:
    """Each sample has a share of the one before."""

    def noise(trial: Trial, count: int) -> Floats:
        white = trial.random.standard_normal(count + 500)
        made: Floats = lfilter([np.sqrt(1.0 - share**2)], [1.0, -share], white)[500:]
        return trial.noise * made

    return noise


def _low_pass(hertz: float) -> Noise:
    """White noise behind the sensor's filter, of second order."""

    def noise(trial: Trial, count: int) -> Floats:
        if 2.2 * hertz >= trial.rate:  # nothing to filter at that rate
            return _white(trial, count)
        sections = butter(2, hertz, fs=trial.rate, output="sos")
        made = sosfilt(sections, trial.random.standard_normal(count + 500))[500:]
        return np.asarray(trial.noise * made / np.std(made))

    return noise


def _proportional(trial: Trial, count: int) -> Floats:
    """In proportion to the force, and a little everywhere."""
    every = round(1.0 / (trial.rate * trial.step))
    share = 2.0 * np.abs(trial.force[::every]) / trial.peak + 0.05
    return share * _white(trial, count)


def _heavy(trial: Trial, count: int) -> Floats:
    """Student's t with three degrees of freedom, of the same variance."""
    return np.asarray(trial.noise * trial.random.standard_t(3.0, count) / np.sqrt(3.0))


def _steps(trial: Trial, count: int) -> Floats:
    """Force in steps of 1 to 3 % of the peak."""
    every = round(1.0 / (trial.rate * trial.step))
    force = trial.force[::every]
    step = trial.random.uniform(0.01, 0.03) * trial.peak
    analogue = force + 0.1 * step * trial.random.standard_normal(count)
    return np.asarray(step * np.round(analogue / step) - force)


NOISES: dict[str, Noise] = {
    "white": _white,
    **{f"AR(1) {share:g}": _autoregressive(share) for share in (0.5, 0.8, 0.9, 0.95, 0.98)},
    **{f"low-pass {hertz:g} Hz": _low_pass(hertz) for hertz in (20.0, 50.0, 100.0, 200.0)},
    "∝ force": _proportional,
    "Student t3": _heavy,
    "steps": _steps,
    "6 × faster": _white,
}


def clean(seed: int, kind: str, motion: str, length: str) -> Trial:
    """Return a recording without a fault."""
    random = generator(seed, f"{kind}/{motion}/{length}")
    faster = 6.0 if kind == "6 × faster" else 1.0
    least = 250.0 if length == SHORT else 100.0  # else there are too few samples to check a law
    if kind in ("6 × faster", "low-pass 200 Hz", "low-pass 100 Hz"):
        least = 1000.0 if (kind, motion) == ("6 × faster", "multi-sine") else 500.0
    rates = tuple(rate for rate in RATES if rate >= least)
    seconds = random.uniform(*LENGTHS[length])
    share = np.exp(random.uniform(np.log(5e-4), np.log(1e-2)))
    made = pressed(random, motion, seconds, rates, float(share), faster)
    count = made.time[:: round(1.0 / (made.rate * made.step))].size
    made.sample(NOISES[kind](made, count))
    return made
