"""The law fitted again to window means by least squares, its noise floor, and augmented fits."""

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from palpate.force_laws import ForceLaw, steps_over_breaks
from palpate.identification.diagnosis.outcome import ModelSelection
from palpate.identification.diagnosis.recording import Data
from palpate.method.contact import Contact
from palpate.method.estimators.estimate import Estimate, Trace
from palpate.method.estimators.law_verdicts import ONE_WAY
from palpate.method.estimators.least_squares import column_sizes, least_squares, robust_covariance
from palpate.method.estimators.oscillation import Oscillation
from palpate.method.estimators.viscoelastic import RelaxingEstimate
from palpate.method.rows import count_true, median, rms
from palpate.validation import Floats, Indices, Integers, Mask, Values, frozen

if TYPE_CHECKING:
    from palpate.identification.diagnosis.equivalent import EquivalentEstimate

# Means over windows of the samples in contact, and the noise of the force in free air.

MOST_ROWS = 4000
WINDOWS_A_PERIOD = 20
FEWEST_ROWS = 60  # with fewer the correlation of the residual cannot be estimated


@dataclass(frozen=True, eq=False)  # no slots: the instance caches the shared parts
class WindowedSamples:
    """Windows of samples in contact; each window gives one row of the fit.

    The fit compares window means of the force and of its columns, which removes noise faster than
    the motion. Penetration and velocity are never averaged before the law is evaluated: a smoothed
    motion is another motion, and a delay of half a sample would fit clean data better.

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (s,)
        The samples that belong to at least one window, in order.
    places : numpy.ndarray of int, shape (width, rows)
        Indices into ``samples``, one column for each window; such sums are six times faster.
    """

    samples: Indices
    places: Indices

    @classmethod
    def from_indices(cls, index: Indices) -> "WindowedSamples":
        """Return windows from the samples of each, shape (width, rows)."""
        samples = np.unique(index)
        return cls(samples, np.searchsorted(samples, index))

    @property
    def width(self) -> int:
        """Samples in a window."""
        return int(self.places.shape[0])

    def __len__(self) -> int:
        return int(self.places.shape[1])

    def mean(self, values: Floats) -> Floats:
        """Average values at ``samples``, a vector or columns, over each window."""
        sums: Floats = np.take(values, self.places, axis=0).sum(axis=0)
        return sums / self.width

    @cached_property
    def shared(self) -> tuple[Floats, ...]:
        """Fraction of its window that a row shares with the next one, two, … rows."""
        starts = self.samples[self.places[0]]
        length = self.samples[self.places[-1]] - starts + 1
        overlaps: list[Floats] = []
        for lag in range(1, len(self)):
            overlap = np.clip(1.0 - (starts[lag:] - starts[:-lag]) / length[:-lag], 0.0, None)
            if not overlap.any():
                break
            overlaps.append(overlap)
        return tuple(overlaps)

    def thin(self, every: int) -> "WindowedSamples":
        """Return every n-th window."""
        return WindowedSamples.from_indices(self.samples[self.places[:, ::every]])


def windows_over(inside: Mask, segment: Integers, width: int) -> WindowedSamples:
    """Return windows of ``width`` samples, all of them inside, a third of a window apart.

    No window spans two segments.
    """
    if len(inside) < width:
        return WindowedSamples.from_indices(np.empty((width, 0), np.intp))
    broken = np.concatenate([[0], np.cumsum((~inside[1:]) | (np.diff(segment) != 0))])
    starts = np.arange(len(inside) - width + 1)
    unbroken = inside[starts] & (broken[starts + width - 1] == broken[starts])
    starts = starts[unbroken][:: max(width // 3, 1)]
    starts = starts[:: -(-starts.size // MOST_ROWS) or 1]
    # In a long window 64 samples resolve the motion; the noise is then averaged over those.
    within = np.unique(np.linspace(0, width - 1, min(width, 64)).round().astype(np.intp))
    return WindowedSamples.from_indices(starts + within[:, None])


FEWEST_FREE = 50  # samples above the surface; with fewer an error of the surface does not show
LOWEST_FREE = 75.0  # percent of the samples above the surface
FEWEST_WINDOWS = 3  # number of windows that do not overlap, for each interval of free air


@frozen
class FreeAir:
    """Force in free air after subtracting the mean of each interval: noise, and slopes with motion.

    Attributes
    ----------
    noise : float
        Rms of a window mean, N.
    windows : float
        Number of windows that do not overlap.
    slopes, errors : tuple of float
        ∂F/∂x [N/m] and ∂F/∂v [N·s/m] in free air, and their standard errors.
    """

    noise: float = 0.0
    windows: float = 0.0
    slopes: tuple[float, float] = (0.0, 0.0)
    errors: tuple[float, float] = (math.inf, math.inf)


def free_air_statistics(data: Data, windows: WindowedSamples) -> FreeAir:
    """Return statistics of the force over windows in free air."""
    starts = windows.samples[windows.places[0]]
    step = max(windows.width // 3, 1)
    interval = np.cumsum(np.diff(starts, prepend=starts[:1]) > max(windows.width, 2 * step))
    count = np.bincount(interval) * step / windows.width  # windows that do not overlap
    long = (count >= FEWEST_WINDOWS)[interval]
    if not long.any():
        return FreeAir()
    samples = windows.samples
    rows = windows.mean(
        np.column_stack([data.force[samples], data.penetration[samples], data.velocity[samples]])
    )
    means = np.array([np.bincount(interval, column) for column in rows.T])
    rows = (rows - (means / np.bincount(interval)).T[interval])[long]
    force = rows[:, 0]
    motion = rows[:, 1:]
    counted = count[count >= FEWEST_WINDOWS]
    freedom = 1.0 - counted.size / float(counted.sum())  # a mean of each interval is fitted
    slopes, *_ = np.linalg.lstsq(motion, force, rcond=1e-9)
    residual = force - motion @ slopes
    noise = math.sqrt(float(residual @ residual) / len(residual) / freedom)
    if counted.size < 2:  # on one approach slow noise and drift look like a slope
        return FreeAir(noise, float(counted.sum()))
    errors = np.sqrt(np.maximum(np.diag(robust_covariance(motion, residual)), 0.0))
    return FreeAir(noise, float(counted.sum()), tuple(slopes.tolist()), tuple(errors.tolist()))


# The fit.

# Residual over noise floor above which the residual is reported; clean recordings have 0.67 to 1.5.
# Without free air the slow noise is unknown: in AR(1) noise of coefficient 0.98 the residual of a
# correct law is then up to 8 times the estimated noise.
MISFIT = 3.0
MISFIT_UNKNOWN = 10.0
FEWEST_AIR = 20.0  # windows of free air that are enough to estimate the noise
NOISE_LIKE = 1.5  # residual over noise floor
SLOW = 2.0  # windows; noise correlated over more is poorly known from free air
# Largest ratio of slow to fast noise. Beyond it, it is not noise: the force begins above the
# surface.
MOST_SLOW = 10.0
FOURTH = 70.0  # 1 + 16 + 36 + 16 + 1, the variance of a fourth difference of white noise
EXPONENTS = (0.2, 6.0)  # beyond what any material shows; keeps powers finite
DEEP = 90.0  # percentile of the penetration that is reported as a second depth


@frozen
class Units:
    """Units of penetration and velocity in which K and n of a power law are nearly uncorrelated."""

    depth: float
    speed: float

    def to_local(self, law: ForceLaw) -> ForceLaw:
        """Return the law in these units: for Hunt–Crossley k = K x_rⁿ, c = B x_rⁿ V."""
        return law.scaled(self.depth, self.speed)

    def to_si(self, law: ForceLaw) -> ForceLaw:
        """Return the law in SI, for a law in these units."""
        return Units(1.0 / self.depth, 1.0 / self.speed).to_local(law)


@dataclass(frozen=True, eq=False)  # no slots: the instance caches the inverse
class Solution:
    """A least-squares solution: a law in local units, an offset, and the residual of the force.

    Attributes
    ----------
    law : ForceLaw
        In the units of the fit.
    offset : float
        N; 0 where none is estimated.
    jacobian : numpy.ndarray, shape (rows, q)
        Columns of the law's parameters, then one of the offset.
    residual : numpy.ndarray, shape (rows,)
        N.
    """

    law: ForceLaw
    offset: float
    jacobian: Floats
    residual: Floats

    @property
    def energy(self) -> float:
        """Sum of squares of the residual, N²."""
        return float(self.residual @ self.residual)

    @cached_property
    def inverse(self) -> Floats:
        """Pseudo-inverse of the Jacobian."""
        size = column_sizes(self.jacobian)
        inverse: Floats = np.linalg.pinv(self.jacobian / size) / size[:, None]
        return inverse

    def orthogonal_part(self, column: Floats) -> Floats:
        """Return the component of a column orthogonal to the Jacobian's columns."""
        remainder: Floats = column - self.jacobian @ (self.inverse @ column)
        return remainder


@frozen(eq=False)
class FitInput:
    """The identification whose law is fitted again.

    Attributes
    ----------
    data : Data
        The recording; its own checks run once for all methods.
    trace : Trace
        The replay, which marks the samples that the estimator took.
    estimate : Estimate
        The last estimate, the starting point of the least squares.
    laws : ModelSelection, optional
        The model selection, if the law was selected.
    method : str
        Name of the method, for remedies.
    response : Oscillation, optional
        Small oscillations of the selected law, which give K′ and B′.
    frequency : float
        ω of the motion, rad/s; NaN for a probe held still.
    """

    data: Data
    trace: Trace
    estimate: Estimate
    laws: ModelSelection | None = None
    method: str = "variable-projection"
    response: Oscillation | None = None
    frequency: float = math.nan


#: Largest deviation of the mean speed of an eighth of the samples, as a fraction.
STEADY = 0.1
PARTS = 8


def find_steady_speed(velocity: Floats) -> float:
    """Return the mean velocity of a motion one way at nearly one speed, m/s; 0 for any other.

    There K xⁿ + B v xⁿ is one power of the depth, K and B are open, and its slope is well known.
    """
    mean = float(velocity.mean()) if velocity.size >= PARTS else 0.0
    means = np.array([block.mean() for block in np.array_split(velocity, PARTS)]) if mean else mean
    steady = bool(np.all(np.abs(means - mean) <= STEADY * abs(mean)))
    return mean if steady and abs(mean) > ONE_WAY * rms(velocity) else 0.0


def reference_scale(value: Floats | float, force: Floats | float, by: Floats | float) -> Floats:
    """Return max(|value|, 0.1 F/by), the scale for relative changes of a stiffness or damping."""
    return np.maximum(np.abs(value), 0.1 * np.abs(force) / by)


def force_along(path: Data | Contact, estimate: Estimate, *, begins: bool = True) -> Floats:
    """Return the force of an estimate's law at every sample, N, without its offset.

    Parameters
    ----------
    path : Data or Contact
        The motion, assumed straight over gaps.
    estimate : Estimate
        An estimate of any law.
    begins : bool
        Whether the path begins with the samples of the estimate, in an unknown state.
    """
    x = path.penetration - estimate.surface
    steps = steps_over_breaks(path.time, x, path.sample_time)
    force: Floats = estimate.law.force_along(x, path.velocity, steps)
    if begins and isinstance(estimate, RelaxingEstimate):
        force += np.where(x > 0.0, estimate.start_force(np.cumsum(steps) - steps[0]), 0.0)
    return force


class Fit:
    """Least-squares fit of a law to the force, averaged over windows.

    Parameters
    ----------
    given : FitInput
        The identification.
    depth : float, optional
        The working depth, m. Default: the median penetration in contact.
    force : numpy.ndarray, optional
        Force of a relaxing law from :func:`force_along`, to avoid computing it again.
    """

    def __init__(
        self, given: FitInput, depth: float | None = None, force: Floats | None = None
    ) -> None:
        data = given.data
        trace = given.trace
        estimate = given.estimate
        self.given = given
        self.laws = given.laws
        self.method = given.method
        self.frequency = given.frequency
        moves = given.frequency > 0.0
        #: The equivalent Hunt–Crossley law; None unless the law relaxes.
        self.equivalent: EquivalentEstimate | None = None
        self._force = force
        if estimate.law.relaxes:
            depths_taken = data.penetration[trace.taken[data.known]] - estimate.surface
            below = depths_taken[depths_taken > 0.0]
            middle = median(below) if below.size else 1.0
            self._force = force_along(data, estimate) if force is None else force
            from palpate.identification.diagnosis.equivalent import equivalent_hunt_crossley

            # A probe held still has no frequency.
            oscillation_at = depth or middle, self.frequency if moves else 1.0, self._force
            data, self.equivalent = equivalent_hunt_crossley(data, estimate, *oscillation_at)
        self.data = data
        self.estimate = self.equivalent or estimate
        estimate = self.estimate
        self.with_offset = estimate.offset_standard_error > 0.0
        names = estimate.law.names()
        self.fixed = [k for k, name in enumerate(names) if name in estimate.fixed]
        self.penetration = data.penetration - estimate.surface
        self.inside: Mask = trace.taken[data.known] & (self.penetration > 0.0)
        self.rejected: Mask = trace.rejected[data.known]  # excluded as outliers
        self.outside: Mask = ~(self.inside | self.rejected)
        #: Samples above the surface according to the penetration.
        self.free: Mask = (self.penetration < 0.0) & ~self.rejected
        # Counted at any penetration: a probe that rests 0.5 mm above the material has no samples
        # above a surface that is 0.7 mm off.
        self.has_free_air = count_true(self.outside) >= FEWEST_FREE
        x = self.penetration[self.inside]
        v = data.velocity[self.inside]
        ranks = (0.0, 50.0, DEEP, 100.0)
        depths: list[float] = np.percentile(x, ranks).tolist() if x.size else [math.nan] * 4
        self.range = (depths[0], depths[3])
        self.reference, self.deep = depths[1:3]
        self.depth = self.reference if depth is None else depth
        self.speed = rms(v) or 1.0
        #: Velocity at which stiffness and force hold, m/s: the motion's if it is one, else 0.
        self.steady_speed = 0.0 if given.estimate.law.relaxes else find_steady_speed(v)
        # At one speed all laws fit as well, and their spread says nothing of the slope.
        self.response = given.response if moves and not self.steady_speed else None
        self.period = 2.0 * math.pi * float(np.std(x)) / self.speed
        scaled = self.reference, self.speed
        self.units = Units(*scaled) if estimate.law.power_law else Units(1.0, 1.0)
        self.windows: WindowedSamples = self._windows_in_contact()
        self._take_windows()

    def _take_windows(self) -> None:
        """Take motion, time and force of the samples of the windows."""
        data, samples = self.data, self.windows.samples
        self.x = self.penetration[samples] / self.units.depth
        self.v = data.velocity[samples] / self.units.speed
        self.time = self.windows.mean(data.time[samples])
        self.force = self.windows.mean(data.force[samples])

    def _windows_in_contact(self) -> WindowedSamples:
        """Return windows over the samples in contact; an excluded outlier does not end a window."""
        kept = np.flatnonzero(~self.rejected)
        most = max(count_true(self.inside) // 40, 1)
        width = np.clip(self.period / WINDOWS_A_PERIOD / self.data.sample_time, 1, most)
        windows = windows_over(self.inside[kept], self.data.segment[kept], int(width))
        return replace(windows, samples=kept[windows.samples])

    def at_depth(self, depth: float) -> "Fit":
        """Return the same fit with another working depth, m.

        Only a relaxing law is fitted again: its equivalent law holds at one depth.
        """
        if self.given.estimate.law.relaxes:
            return Fit(self.given, depth, self._force)
        copied = copy(self)
        copied.depth = depth
        for of_depth in ("gradients", "reference_scales", "deeper_half"):
            copied.__dict__.pop(of_depth, None)
        return copied

    @cached_property
    def deeper_half(self) -> "Fit | None":
        """The same fit to the windows beyond half of the working depth; None if they are few."""
        deep = self.windows.mean(self.x) * self.units.depth >= 0.5 * self.depth
        if np.count_nonzero(deep) < FEWEST_ROWS // 2:
            return None
        samples, places = self.windows.samples, self.windows.places[:, deep]
        other = copy(self)
        for kept in ("solution", "law", "covariance", "gradients", "reference_scales"):
            other.__dict__.pop(kept, None)
        for kept in ("noise_floor", "correlated_windows", "acceleration", "free_air"):
            other.__dict__.pop(kept, None)
        other.windows = WindowedSamples.from_indices(samples[places])
        other._take_windows()
        return other

    def equivalent_law_fit(self) -> "Fit":
        """Return the fit of the equivalent Hunt–Crossley law to the force as recorded."""
        return Fit(FitInput(self.given.data, self.given.trace, self.estimate), self.depth)

    @property
    def checkable(self) -> bool:
        """Whether windows are enough, the depth varies, and a finite law resists the probe."""
        if len(self.windows) < FEWEST_ROWS // 2 or not np.ptp(self.x) > 0.0:
            return False
        solution = self.solution
        scales = self.reference_scales
        numbers = solution.law.parameters, solution.residual, solution.jacobian.reshape(-1), scales
        return bool(np.isfinite(np.concatenate(numbers)).all() and (scales > 0.0).all())

    @cached_property
    def solution(self) -> Solution:
        """The least-squares solution over the windows."""
        return self.solve(self.units.to_local(self.estimate.law), self.estimate.offset)

    @cached_property
    def law(self) -> ForceLaw:
        """The law of :attr:`solution`, SI."""
        return self.units.to_si(self.solution.law)

    def explained_fraction(self, energy: float) -> float:
        """Return 1 − energy/(energy of the solution): the fraction that a better fit removes."""
        return 1.0 - energy / max(self.solution.energy, np.finfo(float).tiny)

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of parameters and offset, local units, for a correlated residual."""
        return robust_covariance(
            self.solution.jacobian, self.solution.residual, self.windows.shared
        )

    def solve(
        self,
        law: ForceLaw,
        offset: float,
        other_motion: "MovedSamples | None" = None,
        enough: float = 1e-9,
    ) -> Solution:
        """Return the least squares from a starting law in local units, to a relative ``enough``."""
        motion = other_motion or MovedSamples(self.x, self.v, self.windows, self.force)
        x = np.maximum(motion.x, 1e-12)
        names = len(law.symbols)
        high = np.full(names + 1, np.inf)
        low = -high
        linear = law.linear
        if law.power_law:
            low[2], high[2] = EXPONENTS

        def model(parameters: Floats) -> tuple[Floats, Floats]:
            if linear:
                trial = law.from_parameters(parameters[:names])
                gradient = motion.band.mean(trial.parameter_gradient(x, motion.v))
                force = gradient[:, :linear] @ parameters[:linear]
            else:
                both = law.force_and_gradient(parameters[:names], x, motion.v)
                force, gradient = map(motion.band.mean, both)
            columns = np.empty((len(gradient), names + 1))
            columns[:, :names] = gradient
            columns[:, self.fixed] = 0.0  # a fixed parameter has no gradient
            columns[:, names] = self.with_offset
            return motion.force - force - parameters[names], columns

        fitted = least_squares(model, np.array([*law.parameters, offset]), (low, high), enough)
        law = law.from_parameters(fitted.parameters[:names])
        offset = float(fitted.parameters[names])
        return Solution(
            law, offset, fitted.jacobian[:, : names + self.with_offset], fitted.residual
        )

    def stiffness(self, law: ForceLaw) -> float:
        """∂F/∂x at the working depth of a law in local units, N/m."""
        return float(self.force_stiffness_damping(law)[1])

    def damping(self, law: ForceLaw) -> float:
        """∂F/∂v at the working depth of a law in local units, N·s/m."""
        return float(self.force_stiffness_damping(law)[2])

    def force_at_depth(self, law: ForceLaw) -> float:
        """Force at the working depth of a law in local units, N."""
        return float(self.force_stiffness_damping(law)[0])

    def force_stiffness_damping(self, law: ForceLaw) -> Floats:
        """Force, stiffness and damping at the working depth of a law in local units, shape (3,)."""
        depth = self.units.depth
        speed = self.units.speed
        at_depth = law.at_speed(self.depth / depth, self.steady_speed / speed)
        numbers: Floats = np.array(at_depth) / (1.0, depth, speed)
        return numbers

    @cached_property
    def gradients(self) -> Floats:
        """Derivatives of force, stiffness, damping at the working depth in each parameter."""
        law = self.solution.law
        values = self.solution.law.parameters
        steps = 1e-5 * np.maximum(np.abs(values), 1e-3 * np.abs(values).max())
        columns = []
        for size, step in zip(steps, np.diag(steps), strict=True):
            ends = (law.from_parameters(values + change) for change in (step, -step))
            high, low = map(self.force_stiffness_damping, ends)
            columns.append((high - low) / (2.0 * size))
        gradients: Floats = np.array(columns).T
        return gradients

    @cached_property
    def reference_scales(self) -> Floats:
        """Scales of relative changes, max(|S|, 0.1 F/x) and max(|C|, 0.1 F/V), shape (2,).

        The second term keeps the scale above zero where the quantity is near zero.
        """
        force, *numbers = self.force_stiffness_damping(self.solution.law)
        return reference_scale(np.array(numbers), force, np.array([self.depth, self.speed]))

    def relative_changes(self, changes: Floats) -> tuple[float, float]:
        """Return changes of stiffness and damping at the working depth over their scales."""
        stiffness, damping = (changes / self.reference_scales).tolist()
        return stiffness, damping

    @cached_property
    def noise_floor(self) -> float:
        """Standard deviation of a window mean due to noise, N.

        The white part is the noise of a sample in contact, √(σ² + S²σ_x² + C²σ_v²), where σ may
        grow with the force. The slow part comes from the force in free air; without free air it
        comes from the residual at frequencies above the motion.
        """
        x = np.maximum(self.x, 1e-12)
        slope = self.solution.law.penetration_gradient(x, self.v) / self.units.depth
        by_x = np.mean(slope**2) * self.data.penetration_noise**2
        by_v = (self.damping(self.solution.law) * self.data.velocity_noise) ** 2
        force = max(self.data.force_noise, self._noise_in_contact)
        white = math.sqrt(force**2 + by_x + by_v) / math.sqrt(self.windows.width)
        above = self._above_band
        # Without free air its noise is 0.
        return max(white, min(self.free_air.noise, MOST_SLOW * max(white, above)) or above)

    @property
    def _noise_in_contact(self) -> float:
        """Rms of the force's white noise in contact, N, from fourth differences."""
        inside = self.inside
        force = self.data.force
        in_contact = inside[:-4] & inside[1:-3] & inside[2:-2] & inside[3:-1] & inside[4:]
        differences = np.diff(force, 4)[in_contact]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0

    @cached_property
    def correlated_windows(self) -> float:
        """Number of windows, at least 1, over which noise is correlated, estimated from free air.

        For AR(1) noise the ratio of its variance to the variance of its fourth differences is 0.9
        correlation times.
        """
        noise_known = self.free_air.noise and self._above_band > 0.0
        return max((self.noise_floor / self._above_band) ** 2, 1.0) if noise_known else 1.0

    @property
    def residual_to_noise(self) -> float:
        """Rms residual of the window means over the noise floor; 1 if only noise remains."""
        rms = math.sqrt(self.solution.energy / max(len(self.windows), 1))
        return rms / self.noise_floor if self.noise_floor > 0.0 else math.inf

    @cached_property
    def acceleration(self) -> Floats:
        """Acceleration at the samples of the windows, m/s²."""
        return self.acceleration_at(self.windows.samples)

    def acceleration_at(self, samples: Values) -> Floats:
        """Acceleration at some samples of the recording, m/s²."""
        time = np.maximum(np.gradient(self.data.time).cumsum(), self.data.time)
        rate: Floats = np.gradient(self.data.velocity, time)[samples]
        return rate

    @property
    def at_noise_floor(self) -> bool:
        """Whether the residual is so small that a cause with a small effect is only a note."""
        slow = self.correlated_windows > SLOW
        return self.residual_to_noise < (MISFIT if slow else NOISE_LIKE)

    @property
    def exceeds_noise(self) -> bool:
        """Whether the residual is more than noise."""
        # The noise is known from one period of free air, and proportionally more if it is
        # correlated over longer than a window.
        noise_well_known = self.free_air.windows >= FEWEST_AIR * self.correlated_windows
        return self.residual_to_noise > (MISFIT if noise_well_known else MISFIT_UNKNOWN)

    @cached_property
    def free_air(self) -> "FreeAir":
        """The force in free air, over windows as long as those in contact."""
        free = np.flatnonzero(self.free)
        if free.size < FEWEST_FREE:
            return FreeAir()
        # Exclude the uppermost: they are in contact if the surface is higher than assumed.
        above = self.penetration <= np.percentile(self.penetration[free], LOWEST_FREE)
        windows = windows_over(self.free & above, self.data.segment, self.windows.width)
        return free_air_statistics(self.data, windows)

    @property
    def _above_band(self) -> float:
        """Noise of a window mean from fourth differences of the residual between windows, N."""
        starts = self.windows.samples[self.windows.places[0]]
        step = int(np.median(np.diff(starts))) if len(starts) > 1 else 0
        lag = -(-self.windows.width // step) if step else 1
        if len(starts) < 4 * lag + FEWEST_ROWS or not 0 < step <= 2 * self.windows.width:
            return 0.0
        contiguous = starts[4 * lag :] - starts[: -4 * lag] == 4 * lag * step
        differences = self.solution.residual
        for _ in range(4):
            differences = differences[lag:] - differences[:-lag]
        differences = differences[contiguous]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0


@frozen(eq=False)
class MovedSamples:
    """Samples in local units with their windows, used in place of the fit's own samples."""

    x: Floats
    v: Floats
    band: WindowedSamples
    force: Floats


# A column is collinear with the fit's columns if less than this fraction of it is orthogonal.
COLLINEAR = 1e-5
# On 196 clean recordings of probe and robot (``benchmarks.diagnosis``), a cause that changes a
# result has z ≤ 3.7.
SIGNIFICANT = 4.5


@frozen
class AugmentedFit:
    """Result of a fit with one additional column.

    Attributes
    ----------
    change : numpy.ndarray
        Change of the fit's parameters when the column is added.
    amount : float
        Coefficient of the column.
    z : float
        The coefficient in standard errors, for a correlated residual.
    explained_fraction : float
        Fraction of the residual's energy that the column removes.
    """

    change: Floats
    amount: float
    z: float
    explained_fraction: float


def fit_with_column(
    fit: Fit, column: Floats, solution: Solution | None = None
) -> AugmentedFit | None:
    """Fit a column together with the law's Jacobian; None if it is collinear with the Jacobian.

    ``solution``: a solution with additional columns. Default: the solution of the fit.
    """
    solution = solution or fit.solution
    jacobian = solution.jacobian
    residual = solution.residual
    shares = solution.inverse @ column
    orthogonal = solution.orthogonal_part(column)
    square = float(orthogonal @ orthogonal)
    if not (math.isfinite(square) and square > COLLINEAR**2 * float(column @ column)):
        return None
    amount = float(orthogonal @ residual) / square
    remaining = residual - amount * orthogonal
    # The remainder is orthogonal to the other columns, so its standard error does not need them.
    others = jacobian.shape[1]
    error = math.sqrt(
        robust_covariance(orthogonal[:, None], remaining, fit.windows.shared, others)[0, 0]
    )
    z = abs(amount) / max(error, 1e-300)
    gain = fit.explained_fraction(float(remaining @ remaining))
    if z > SIGNIFICANT and fit.noise_floor > 0.0:
        # A short residual does not show the correlation length of slow noise; free air does.
        rows = (1.0 + len(fit.windows.shared)) * fit.correlated_windows
        z = min(z, math.sqrt(max(gain, 0.0) * fit.solution.energy / rows) / fit.noise_floor)
    return AugmentedFit(-amount * shares, amount, *((z, gain) if math.isfinite(z) else (0.0, 0.0)))


def standard_errors(fit: Fit) -> Floats:
    """Standard errors of force, stiffness and damping at the working depth, SI, shape (3,).

    The covariance assumes the same noise at all depths. If the noise is larger where the influences
    u are larger (White 1980), as for noise proportional to force, Σ u² e² exceeds Σ u² ⟨e²⟩; the
    variance is then scaled by their ratio.
    """
    names = len(fit.solution.law.symbols)
    residual = fit.solution.residual
    variances = np.diag(fit.gradients @ fit.covariance[:names, :names] @ fit.gradients.T)
    influences = (fit.gradients @ fit.solution.inverse[:names]) ** 2
    pooled = influences.sum(axis=1) * np.mean(residual**2)
    uneven = influences @ residual**2 / np.maximum(pooled, np.finfo(float).tiny)
    errors: Floats = np.sqrt(np.maximum(variances, 0.0) * np.maximum(uneven, 1.0))
    return errors


def distance_to_least_squares(fit: Fit) -> Floats:
    """The method's force, stiffness and damping minus the least-squares values, SI, shape (3,).

    The standard errors of the least squares do not cover this difference. A method has it if it
    forgets, or if it weighs shallow contact as much as deep contact.
    """
    identified = fit.units.to_local(fit.estimate.law)
    best = fit.solution.law
    return fit.force_stiffness_damping(identified) - fit.force_stiffness_damping(best)
