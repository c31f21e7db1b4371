"""Delay and bandwidth of a position loop, from the commanded and the measured position."""

import math

import numpy as np
from numpy.typing import ArrayLike

from palpate.control_loops.response import matrix_exponential
from palpate.errors import InvalidParameterError, RecordingError
from palpate.method.estimators.least_squares import least_squares
from palpate.validation import Floats, frozen, signals

# Samples that are used: those from the first motion on.
_MOST_SAMPLES = 20_000
_FEWEST_SAMPLES = 100
# Starts of the search: bandwidths, rad/s, and delays, s.
_BANDWIDTHS = np.geomspace(5.0, 500.0, 9)
_DELAYS = np.linspace(0.0, 20e-3, 5)
_LONGEST = 0.1  # s, of the delay
_DIFFERENCE = 1e-4  # of the derivatives: of the bandwidth, and in samples
# Rms error of the best fit over the standard deviation of the position, above which the position
# does something else than follow the command.
_LARGEST_MISFIT = 0.05


@frozen
class Following:
    """How a position loop follows its command.

    Attributes
    ----------
    delay, delay_error : float
        Delay and its standard error, s.
    bandwidth, bandwidth_error : float
        Natural frequency of the critically damped loop, and its standard error, rad/s.
    """

    delay: float
    delay_error: float
    bandwidth: float
    bandwidth_error: float


def measure_following(time: ArrayLike, command: ArrayLike, position: ArrayLike) -> Following:
    """Return delay and bandwidth of a position loop, from a motion in free air.

    x = a + b · w²/(s + w)² · e^(−sτ) · x_c, with x_c held between its samples; a and b allow for
    another origin, sign and unit.

    Parameters
    ----------
    time : array_like, shape (k,)
        s, evenly spaced.
    command, position : array_like, shape (k,)
        Commanded and measured position along one axis, at least 100 samples.

    Returns
    -------
    Following
        Delay and bandwidth with their standard errors, for white noise.

    Raises
    ------
    InvalidParameterError
        The arrays differ in length.
    RecordingError
        The command does not move, too few samples are finite, or the position does not follow.

    Examples
    --------
    >>> import numpy as np
    >>> from palpate import control_loops
    >>> time = np.arange(0.0, 2.0, 0.002)
    >>> command = 0.01 * np.sin(12.0 * time) ** 2
    >>> late = 0.01 * np.sin(12.0 * np.maximum(time - 0.03, 0.0)) ** 2
    >>> measured = control_loops.measure_following(time, command, late)
    >>> bool(0.0 < measured.delay < 0.03)
    True
    """
    clock, commanded, measured = signals(time=time, command=command, position=position)
    good = np.isfinite(clock) & np.isfinite(commanded) & np.isfinite(measured)
    clock = clock[good]
    commanded = commanded[good]
    measured = measured[good]
    if len(clock) < _FEWEST_SAMPLES or not np.ptp(commanded) > 0.0:
        raise RecordingError(
            "command does not move in at least 100 samples: record a motion in free air"
        )
    step = float(np.median(np.diff(clock)))
    if not step > 0.0:
        raise InvalidParameterError("time must ascend")
    first = max(int(np.argmax(commanded != commanded[0])) - 10, 0)
    used = slice(first, first + _MOST_SAMPLES)
    search = _FollowingSearch(step, commanded[used], measured[used])
    starts = ((bandwidth, delay) for bandwidth in _BANDWIDTHS for delay in _DELAYS)
    best = min(starts, key=lambda start: float(np.sum(search.residual(*start) ** 2)))
    limits = np.array([-np.inf, 0.0]), np.array([np.inf, _LONGEST / step])
    fitted = least_squares(search.model, np.array([math.log(best[0]), best[1] / step]), limits)
    deviation = float(np.std(fitted.residual))
    if deviation > _LARGEST_MISFIT * float(np.std(search.position)):
        raise RecordingError(
            "position does not follow the command like a position loop: pass another command, "
            "or a motion in free air"
        )
    variances = np.diag(np.linalg.pinv(fitted.jacobian.T @ fitted.jacobian))
    errors = deviation * np.sqrt(variances)
    bandwidth = math.exp(fitted.parameters[0])
    delay = float(fitted.parameters[1]) * step
    return Following(delay, float(errors[1]) * step, bandwidth, bandwidth * float(errors[0]))


@frozen(eq=False)
class _FollowingSearch:
    """The samples of a motion, and the least squares of how they follow the command."""

    step: float
    command: Floats
    position: Floats

    def follow(self, bandwidth: float, delay: float) -> Floats:
        """Return the motion of a critically damped loop, exact for a held command."""
        whole = math.floor(delay / self.step + 1e-9)
        fraction = max(0.0, delay - whole * self.step)
        rate = np.array([[0.0, 1.0, 0.0], [-(bandwidth**2), -2.0 * bandwidth, bandwidth**2]])
        rate = np.vstack([rate, np.zeros(3)])
        early, rest = matrix_exponential(np.array([rate * fraction, rate * (self.step - fraction)]))
        held = rest[:2, :2] @ early[:2, :2]
        before = (rest[:2, :2] @ early[:2, 2]).tolist()
        now = rest[:2, 2].tolist()
        (a, b), (c, d) = held.tolist()
        origin = float(self.command[0])
        late = np.concatenate([np.zeros(whole + 1), self.command - origin])[: len(self.command) + 1]
        x = v = 0.0
        motion = []
        for old, new in zip(late[:-1].tolist(), late[1:].tolist(), strict=True):
            motion.append(x)
            x, v = (
                a * x + b * v + before[0] * old + now[0] * new,
                c * x + d * v + before[1] * old + now[1] * new,
            )
        return np.array(motion)

    def residual(self, bandwidth: float, delay: float) -> Floats:
        """Return what is left of the position, with the best origin and unit."""
        design = np.column_stack([np.ones(len(self.position)), self.follow(bandwidth, delay)])
        solution = np.linalg.lstsq(design, self.position, rcond=None)[0]
        residual: Floats = self.position - design @ solution
        return residual

    def model(self, place: Floats) -> tuple[Floats, Floats]:
        """Return residual and gradient, by logarithm of the bandwidth and delay in samples."""
        residual = self._residual_at(place)
        columns = []
        for k, step in enumerate(_DIFFERENCE * np.eye(2)):
            ahead = self._residual_at(place + step)
            columns.append((residual - ahead) / step[k])
        return residual, np.column_stack(columns)

    def _residual_at(self, place: Floats) -> Floats:
        return self.residual(math.exp(place[0]), place[1] * self.step)
