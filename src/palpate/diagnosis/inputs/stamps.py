"""Time stamps of arrival in place of sampling."""

import numpy as np

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Finding
from palpate.validation import Floats

WIDTH = 7  # samples of a local parabola
MOST = 20_000  # samples that are looked at
# Residual against the stamps over that against the index: recordings have 1.13 and less, jittered
# stamps 4 to 7.5, and missing samples 0.4 to 0.7.
RATIO = 2.0
UNEVEN = 0.2  # sd(Δt)/mean


def stamps(data: Data) -> Finding | None:
    """A parabola in time that fits twice worse by the stamps than by the count of samples."""
    part = slice(0, MOST)
    time, x = data.time[part], data.penetration[part]
    steps = np.diff(time)
    steps = steps[(np.diff(data.segment[part]) == 0) & (steps > 0.0)]
    if steps.size < 10 * WIDTH or float(steps.std()) <= UNEVEN * float(steps.mean()):
        return None
    by_index = _misfit(np.arange(len(x), dtype=np.float64), x)
    ratio = _misfit(time, x) / by_index if by_index > 0.0 else 0.0
    if ratio <= RATIO:
        return None
    words = "the time stamps jump where the penetration runs smoothly: they are of arrival"
    return Finding(
        "time stamps",
        f"{words}, not of sampling",
        "stamp where the sensor is sampled, or give the samples even times",
        z=ratio,
        stiffness="with-care",
        damping="with-care",
    )


def _misfit(time: Floats, x: Floats) -> float:
    """Median residual of the middle of a window against the parabola through it."""
    windows = np.lib.stride_tricks.sliding_window_view(np.arange(len(x)), WIDTH)
    t = time[windows] - time[windows[:, WIDTH // 2], None]
    t = t / np.maximum(np.abs(t).max(axis=1, keepdims=True), 1e-300)
    basis = np.stack([np.ones_like(t), t, t**2], axis=2)
    normal = basis.transpose(0, 2, 1) @ basis + 1e-9 * np.eye(3)
    right = (basis * x[windows][:, :, None]).sum(axis=1)
    middle = np.linalg.solve(normal, right[:, :, None])[:, 0, 0]
    return float(np.median(np.abs(x[windows[:, WIDTH // 2]] - middle)))
