"""The motion of a flange: specific force, angular velocity and acceleration, from its pose."""

from dataclasses import dataclass, replace

import numpy as np

from palpate._core import noise_of
from palpate.input.channels.frames import (
    INVERSE,
    align_signs,
    interpolate_columns,
    multiply,
    rotate,
)
from palpate.input.recordings.units import GRAVITY
from palpate.method.rows import row_norms, typical_step
from palpate.validation import Floats, Integers

# A polynomial of degree 4 over 0.1 s passes an acceleration at 2.5 Hz to within 0.3 %; one of
# degree 2 or 3 attenuates it by 9 %, which shifts the stiffness by 0.2 %.
WINDOW = 0.1
DEGREE = 4
MOST_SAMPLES = 50  # in a window


@dataclass(slots=True, eq=False)
class FlangeMotion:
    """Motion on an even clock, and its integral over time.

    Attributes
    ----------
    start, step : float
        First time and time step, s.
    values : numpy.ndarray, shape (k, 20)
        In the axes of the flange: specific force Rᵀ(g₀ − p̈), m/s²; angular velocity ω, rad/s;
        angular acceleration α, rad/s²; the products ωωᵀ: xx, yy, zz, xy, xz, yz; then the sizes
        of velocity and acceleration, m/s and m/s²; and the direction of gravity.
    integral : numpy.ndarray, shape (k, 20)
        Integral of the values from the first time, in time steps.
    noise : FlangeMotion or None
        Motion by white noise of the pose alone, without gravity; None for a motion of noise.
    """

    start: float
    step: float
    values: Floats
    integral: Floats
    noise: "FlangeMotion | None" = None

    @property
    def stop(self) -> float:
        """Last time, s."""
        return self.start + self.step * (len(self.values) - 1)

    def mean(self, start: Floats, stop: Floats, columns: int = 20) -> Floats:
        """Return the means of the first columns from each start to each stop."""
        change = self._integral_at(stop, columns) - self._integral_at(start, columns)
        means: Floats = change / ((stop - start) / self.step)[:, None]
        return means

    def _integral_at(self, time: Floats, columns: int) -> Floats:
        k, u = self._place(time)
        values = self.values[:, :columns]
        low = values[k]
        # ∫ + u (low + ½ u (high − low)) in place: a search evaluates it some 2000 times.
        integral = values[k + 1]
        integral -= low
        integral *= 0.5 * u
        integral += low
        integral *= u
        integral += self.integral[:, :columns][k]
        return integral

    def at(self, time: Floats) -> Floats:
        """Return specific force, angular velocity and acceleration at some times, shape (n, 9)."""
        k, u = self._place(time)
        interpolated: Floats = (1.0 - u) * self.values[k, :9] + u * self.values[k + 1, :9]
        return interpolated

    def _place(self, time: Floats) -> tuple[Integers, Floats]:
        """Return the sample before each time, and the part of the step after it."""
        place = np.clip((time - self.start) / self.step, 0.0, len(self.values) - 1.000001)
        k = place.astype(np.int64)
        return k, (place - k)[:, None]


def motion_of(
    time: Floats, position: Floats, orientation: Floats, window: float = WINDOW
) -> FlangeMotion:
    """Return the motion of a pose by least-squares polynomials over a window, s.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, strictly increasing.
    position : numpy.ndarray, shape (k, 3)
        m, with z up.
    orientation : numpy.ndarray, shape (k, 4)
        Unit quaternions x, y, z, w.
    """
    pose = np.column_stack([position, align_signs(orientation)])
    recorded_step = typical_step(time)
    step = max(recorded_step, window / MOST_SAMPLES)
    even = time[0] + step * np.arange(int((time[-1] - time[0]) / step) + 1)
    if step > 1.5 * recorded_step:
        pose = _mean_over_steps(time, pose, even, step)
    else:
        pose = interpolate_columns(even, time, pose)
    half = max(round(0.5 * window / step), 3)
    deviations = [noise_of(column) for column in pose.T]
    noise = np.random.default_rng(0).normal(size=pose.shape) * deviations
    noise[:, 6] += 1.0  # around the identity
    start = float(even[0])
    blur = _motion(start, noise, half, step)
    blur.values[:, 2] += GRAVITY
    blur = replace(blur, integral=_integrate(blur.values))
    return replace(_motion(start, pose, half, step), noise=blur)


def _mean_over_steps(time: Floats, columns: Floats, even: Floats, step: float) -> Floats:
    """Return the mean of each column over each step of an even clock."""
    areas = 0.5 * (columns[1:] + columns[:-1]) * np.diff(time)[:, None]
    sums = np.vstack([np.zeros(columns.shape[1]), np.cumsum(areas, axis=0)])
    start = np.clip(even - 0.5 * step, time[0], time[-1])
    stop = np.clip(even + 0.5 * step, time[0], time[-1])
    change = interpolate_columns(stop, time, sums) - interpolate_columns(start, time, sums)
    means: Floats = change / (stop - start)[:, None]
    return means


def _motion(start: float, pose: Floats, half: int, step: float) -> FlangeMotion:
    """Return the motion of positions and quaternions on an even clock."""
    smooth, first, second = (_slopes(pose, half, order, step) for order in range(3))
    length = np.linalg.norm(smooth[:, 3:], axis=1, keepdims=True)
    inverse = smooth[:, 3:] / length * INVERSE
    # ω = 2 q⁻¹q̇ and α = 2 q⁻¹q̈ in the axes of the flange: q̇⁻¹q̇ has no vector part.
    w, a = (2.0 * multiply(inverse, slope[:, 3:] / length)[:, :3] for slope in (first, second))
    down = np.array([0.0, 0.0, -1.0])
    g = rotate(GRAVITY * down - second[:, :3], inverse)
    products = [w * w, w[:, :1] * w[:, 1:], w[:, 1] * w[:, 2]]
    sizes = [row_norms(slope[:, :3]) for slope in (first, second)]
    values = np.column_stack([g, w, a, *products, *sizes, rotate(down, inverse)])
    return FlangeMotion(start, step, values, _integrate(values))


def _integrate(values: Floats) -> Floats:
    integral = np.zeros_like(values)
    np.cumsum(0.5 * (values[1:] + values[:-1]), axis=0, out=integral[1:])
    return integral


def _slopes(columns: Floats, half: int, order: int, step: float) -> Floats:
    """Derivatives of the polynomial through 2 · half + 1 samples around each sample."""
    place = np.arange(-half, half + 1) / half
    powers = np.linalg.pinv(np.vander(place, DEGREE + 1, increasing=True))
    weights = powers[order] * (1, 1, 2)[order] / (half * step) ** order
    padded = np.pad(columns, ((half, half), (0, 0)), mode="edge")
    filtered = [np.convolve(column, weights[::-1], "valid") for column in padded.T]
    return np.column_stack(filtered)
