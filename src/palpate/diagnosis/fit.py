"""The law fitted once more, in averages over the motion's band, and what checks ask of that fit."""

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.data import Data
from palpate.diagnosis.finding import Laws
from palpate.estimators import ESTIMATORS
from palpate.estimators.by_law import linear_in
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.least_squares import least_squares, robust_covariance
from palpate.estimators.oscillation import Oscillation, dynamic_response
from palpate.estimators.viscoelastic import RelaxingEstimate
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, HuntCrossley, steps_over_breaks
from palpate.validation import Floats


class EquivalentEstimate(Estimate):
    """An estimate of which the law is taken for another.

    Attributes
    ----------
    own_errors : numpy.ndarray, shape (3,)
        Standard errors of force, stiffness and damping at the depth, by the identified law.
    longest : float
        The longest time that the law relaxed over, s; 0 for one without memory.
    """

    __slots__ = ("_equivalent", "longest", "own_errors")

    def __init__(
        self, estimate: Estimate, law: HuntCrossley, depth: float, frequency: float
    ) -> None:
        super().__init__(estimate, estimate._law_type, estimate.fixed)
        self._equivalent = law
        relaxation = estimate.law.relaxation
        self.longest = 0.0 if relaxation is None else relaxation.longest_time

        def numbers(law: GeneralisedHuntCrossley) -> tuple[float, float, float]:
            stiffness, damping = dynamic_response(law, depth, frequency).tolist()
            return stiffness * depth / law.exponent, stiffness, damping

        self.own_errors = estimate.with_errors(numbers)[1]

    @property
    def law(self) -> HuntCrossley:
        """The equivalent Hunt–Crossley law."""
        return self._equivalent


def force_of(data: Data, estimate: Estimate) -> Floats:
    """Force of a generalised law, and of its unknown start, at every sample, N."""
    x = data.penetration - estimate.surface
    steps = steps_over_breaks(data.time, x, data.sample_time)
    force: Floats = estimate.law.force_along(x, data.velocity, steps)
    if isinstance(estimate, RelaxingEstimate):
        force += np.where(x > 0.0, estimate.start_force(np.cumsum(steps) - steps[0]), 0.0)
    return force


def equivalent_hunt_crossley(
    data: Data, estimate: Estimate, depth: float, frequency: float, force: Floats
) -> tuple[Data, EquivalentEstimate]:
    """Subtract from the force what a generalised law adds to a Hunt–Crossley law.

    What is left is compared with that law, which has the same K′ and B′ at a depth [m] and a
    frequency ω [rad/s]: the residual is the same.
    """
    law: GeneralisedHuntCrossley = estimate.law
    stiffness, damping = dynamic_response(law, depth, frequency).tolist()
    n = law.exponent
    equivalent = HuntCrossley(stiffness / (n * depth ** (n - 1.0)), damping / depth**n, n)
    corrected = copy(data)
    own = equivalent.force(data.penetration - estimate.surface, data.velocity)
    corrected.force = data.force - (force - own)
    return corrected, EquivalentEstimate(estimate, equivalent, depth, frequency)


# The motion's band: averages over windows a twentieth of the motion's period long.

MOST_ROWS = 4000
WINDOWS_A_PERIOD = 20
FEWEST_ROWS = 60  # below that there is no saying how the residual is correlated
# Times the noise; clean recordings have 0.67 to 1.5. Without free air slow noise is not known: in
# AR(1) noise of 0.98 the residual of a good law is then up to 8 times what is.
MISFIT, MISFIT_UNKNOWN = 3.0, 10.0
FEWEST_AIR = 20.0  # windows of free air by which noise is known
NOISE_LIKE = 1.5  # times the noise
SLOW = 2.0  # windows; over more, free air's own share of the noise is uncertain
FOURTH = 70.0  # 1 + 16 + 36 + 16 + 1, the variance of a fourth difference of white noise
FEWEST_FREE = 50  # samples above the surface; with fewer an error of the surface does not show


@dataclass(frozen=True, eq=False)  # no slots: what rows share is kept in the instance
class Band:
    """Windows wholly in contact, each a row.

    Everything that a fit compares is averaged over them, force and columns alike: noise that the
    motion is too slow to have made is gone. Penetration and velocity are never averaged, since a
    smoothed motion is another motion (a delay of half a sample would fit clean data better).

    Attributes
    ----------
    samples : numpy.ndarray of int, shape (s,)
        The samples that some window holds, in order.
    windows : numpy.ndarray of int, shape (width, rows)
        Places in ``samples``; a column each, over which sums run six times quicker.
    period : float
        2π sd(x)/rms(v), s.
    """

    samples: NDArray[np.intp]
    windows: NDArray[np.intp]
    period: float

    @property
    def width(self) -> int:
        """Samples in a window."""
        return int(self.windows.shape[0])

    def __len__(self) -> int:
        return int(self.windows.shape[1])

    def mean(self, values: Floats) -> Floats:
        """Average over each window of values at ``samples``, a vector or columns."""
        sums: Floats = np.take(values, self.windows, axis=0).sum(axis=0)
        return sums / self.width

    @cached_property
    def shared(self) -> tuple[Floats, ...]:
        """Part of its window that each row shares with the next, the next but one, and so on."""
        first = self.samples[self.windows[0]]
        length = self.samples[self.windows[-1]] - first + 1
        parts: list[Floats] = []
        for lag in range(1, len(self)):
            part = np.clip(1.0 - (first[lag:] - first[:-lag]) / length[:-lag], 0.0, None)
            if not part.any():
                break
            parts.append(part)
        return tuple(parts)

    def thinned(self, every: int) -> "Band":
        """Return one in so many of the windows."""
        index = self.samples[self.windows[:, ::every]]
        samples = np.unique(index)
        return Band(samples, np.searchsorted(samples, index), self.period)


def band_of(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], period: float, sample_time: float
) -> Band:
    """Windows over the samples that are inside, within one segment.

    Parameters
    ----------
    inside : numpy.ndarray of bool, shape (k,)
        The samples in contact.
    segment : numpy.ndarray of int, shape (k,)
        Windows do not reach from one to the next.
    period : float
        Of the motion, s.
    sample_time : float
        s.
    """
    count = int(np.count_nonzero(inside))
    width = int(np.clip(period / WINDOWS_A_PERIOD / sample_time, 1, max(count // 40, 1)))
    return _windows(inside, segment, period, width)


def _windows(
    inside: NDArray[np.bool_], segment: NDArray[np.int64], period: float, width: int
) -> Band:
    """Windows of so many samples that are wholly inside, each a third of it after the last."""
    if len(inside) < width:
        return Band(np.empty(0, np.intp), np.empty((width, 0), np.intp), period)
    broken = np.concatenate([[0], np.cumsum((~inside[1:]) | (np.diff(segment) != 0))])
    starts = np.arange(len(inside) - width + 1)
    whole = inside[starts] & (broken[starts + width - 1] == broken[starts])
    starts = starts[whole][:: max(width // 3, 1)]
    starts = starts[:: -(-starts.size // MOST_ROWS) or 1]
    # Of a long window 64 samples tell as much of the motion; noise is then averaged over them.
    within = np.unique(np.linspace(0, width - 1, min(width, 64)).round().astype(np.intp))
    index = starts + within[:, None]
    samples = np.unique(index)
    return Band(samples, np.searchsorted(samples, index), period)


# The law fitted once more, in the motion's band, and all that its checks ask of that fit.

EXPONENTS = (0.2, 6.0)  # beyond what any material shows; keeps powers finite
DEEP = 90.0  # percentile of the penetration that is looked at beside the working depth


@dataclass(frozen=True, slots=True)
class Units:
    """In which penetration and velocity are counted, so that a power law's K and n part."""

    depth: float
    speed: float

    def local(self, law: ForceLaw) -> ForceLaw:
        """Return the law in these units: for Hunt–Crossley k = K x_rⁿ, c = B x_rⁿ V."""
        return law.scaled(self.depth, self.speed)

    def restored(self, law: ForceLaw) -> ForceLaw:
        """Return a law that is in these units, in SI."""
        return Units(1.0 / self.depth, 1.0 / self.speed).local(law)


@dataclass(frozen=True, eq=False)  # no slots: the inverse is kept in the instance
class Solution:
    """A law in local units and an offset, with what they leave of the force.

    Attributes
    ----------
    law : ForceLaw
        In the units of the fit.
    offset : float
        N; 0 where none is estimated.
    jacobian : numpy.ndarray, shape (rows, q)
        Columns of the law's parameters and, last, of the offset.
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
        size = np.linalg.norm(self.jacobian, axis=0)
        size[size == 0.0] = 1.0
        inverse: Floats = np.linalg.pinv(self.jacobian / size) / size[:, None]
        return inverse

    def without(self, column: Floats) -> Floats:
        """What is left of a column beside those of the Jacobian."""
        left: Floats = column - self.jacobian @ (self.inverse @ column)
        return left


def reference_scale(value: Floats | float, force: Floats | float, by: Floats | float) -> Floats:
    """Return what a stiffness or damping is compared with: itself, or a tenth of F/x or F/V."""
    return np.maximum(np.abs(value), 0.1 * np.abs(force) / by)


class Fit:
    """A law's least squares of force in the motion's band.

    Parameters
    ----------
    data : Data
        The recording.
    trace : Trace
        Says which samples were taken.
    estimate : Estimate
        Where the search for the least squares starts.
    depth : float, optional
        The working depth, m. Default: the median penetration in contact.
    laws : Laws, optional
        The selection of the law, where there was one.
    method : str
        That made the estimate, for remedies.
    response : Oscillation, optional
        What the selection says of K′ and B′.
    frequency : float, optional
        ω of the motion, rad/s. Default: by the samples in contact.
    force : numpy.ndarray, optional
        That of a law that relaxes, by :func:`force_of`, where it is known already.
    """

    def __init__(
        self,
        data: Data,
        trace: Trace,
        estimate: Estimate,
        depth: float | None = None,
        laws: Laws | None = None,
        method: str = "variable-projection",
        response: Oscillation | None = None,
        frequency: float = math.nan,
        force: Floats | None = None,
    ) -> None:
        self._given, self.laws, self.method = (data, trace, estimate), laws, method
        self.response = response if frequency > 0.0 else None
        self.frequency = frequency
        #: Of a law that relaxes: the equivalent Hunt–Crossley law.
        self.equivalent: EquivalentEstimate | None = None
        if estimate.law.relaxes:
            known = data.penetration[trace.taken[data.known]] - estimate.surface
            middle = float(np.median(known[known > 0.0])) if (known > 0.0).any() else 1.0
            # A probe that is held still has no frequency of its own.
            turn = frequency if frequency > 0.0 else 1.0
            self._force = force_of(data, estimate) if force is None else force
            by = depth or middle, turn, self._force
            data, self.equivalent = equivalent_hunt_crossley(data, estimate, *by)
        self.data, self.estimate = data, self.equivalent or estimate
        estimate = self.estimate
        self.with_offset = estimate.offset_standard_error > 0.0
        names = estimate.law.names()
        self.fixed = [k for k, name in enumerate(names) if name in estimate.fixed]
        self.penetration = data.penetration - estimate.surface
        self.inside: NDArray[np.bool_] = trace.taken[data.known] & (self.penetration > 0.0)
        self.rejected: NDArray[np.bool_] = trace.rejected[data.known]  # left out as outliers
        self.outside: NDArray[np.bool_] = ~(self.inside | self.rejected)
        #: Above the surface, by the penetration.
        self.free: NDArray[np.bool_] = (self.penetration < 0.0) & ~self.rejected
        # At whatever penetration is given for them: a probe that rests 0.5 mm above the material
        # has no samples above a surface that is 0.7 mm off.
        self.free_air = int(np.count_nonzero(self.outside)) >= FEWEST_FREE
        x, v = self.penetration[self.inside], data.velocity[self.inside]
        self.reference = float(np.median(x)) if x.size else math.nan
        self.depth = self.reference if depth is None else depth
        self.range = (float(x.min()), float(x.max())) if x.size else (math.nan, math.nan)
        self.deeper = (float(np.percentile(x, DEEP)),) if x.size else (math.nan,)
        self.speed = float(np.sqrt(np.mean(v**2))) or 1.0
        self.period = 2.0 * math.pi * float(np.std(x)) / self.speed
        scaled = self.reference, self.speed
        self.units = Units(*scaled) if estimate.law.power_law else Units(1.0, 1.0)
        self.band: Band = self._band()
        self.x = self.penetration[self.band.samples] / self.units.depth
        self.v = data.velocity[self.band.samples] / self.units.speed
        self.powers: dict[tuple[float, bool], Floats] = {}  # xⁿ and xⁿv in the band, by n
        self.time = self.band.mean(data.time[self.band.samples])
        self.force = self.band.mean(data.force[self.band.samples])

    def _band(self) -> Band:
        """Windows over the samples taken; one that was left out ends none."""
        kept = np.flatnonzero(~self.rejected)
        segment, sample_time = self.data.segment[kept], self.data.sample_time
        band = band_of(self.inside[kept], segment, self.period, sample_time)
        return replace(band, samples=kept[band.samples])

    def at_depth(self, depth: float) -> "Fit":
        """Return the same fit with another working depth, m.

        Only an equivalent law has to be fitted again: it is equivalent at one depth.
        """
        if self._given[2].law.relaxes:
            by_law = self.response, self.frequency, self._force
            return Fit(*self._given, depth, self.laws, self.method, *by_law)
        other = copy(self)
        other.depth = depth
        for name in ("gradients", "sizes"):  # cached, and of the depth
            other.__dict__.pop(name, None)
        return other

    @property
    def finds_surface(self) -> bool:
        """Whether the method can estimate the position of the surface."""
        kind = ESTIMATORS.get(self.method)
        return kind is not None and "surface" in kind().settings

    @cached_property
    def finite(self) -> bool:
        """Whether a least squares of finite numbers was found, of a law that resists at all."""
        solution, sizes = self.solution, np.array(self.sizes)
        numbers = [solution.law.parameters, solution.residual, solution.jacobian.reshape(-1), sizes]
        known = bool(np.isfinite(np.concatenate(numbers)).all())
        return known and bool(np.ptp(self.x) > 0.0 and (sizes > 0.0).all())

    @cached_property
    def solution(self) -> Solution:
        """The least squares in the band."""
        return self.solve(self.units.local(self.estimate.law), self.estimate.offset)

    @cached_property
    def law(self) -> ForceLaw:
        """The law of :attr:`solution`, SI."""
        return self.units.restored(self.solution.law)

    def gain(self, energy: float) -> float:
        """Fraction of the solution's energy that is gone where so much is left."""
        return 1.0 - energy / max(self.solution.energy, np.finfo(float).tiny)

    @cached_property
    def linear(self) -> list[int]:
        """Places of the law's parameters in which the force is linear."""
        return list(range(self.law.linear) or linear_in(type(self.law)))

    @cached_property
    def by_linear(self) -> Floats:
        """The force less what is there of the law where these are 0, N."""
        if self.law.linear:
            return self.force
        own, found = self.linear, self.solution
        return found.residual + found.offset + found.jacobian[:, own] @ found.law.parameters[own]

    @cached_property
    def covariance(self) -> Floats:
        """Of the solution's parameters and offset, in local units, for a correlated residual."""
        return robust_covariance(self.solution.jacobian, self.solution.residual, self.band.shared)

    def solve(
        self,
        law: ForceLaw,
        offset: float,
        moved: "MovedSamples | None" = None,
        enough: float = 1e-9,
    ) -> Solution:
        """The least squares next to a law in local units, within ``enough`` of its energy."""
        motion = moved or MovedSamples(self.x, self.v, self.band, self.force)
        x, names = np.maximum(motion.x, 1e-12), len(law.symbols)
        high = np.full(names + 1, np.inf)
        low, linear = -high, law.linear
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
            gradient[:, self.fixed] = 0.0  # what was given no least squares moves
            zero = np.full(len(gradient), float(self.with_offset))
            return motion.force - force - parameters[names], np.column_stack([gradient, zero])

        found = least_squares(model, np.array([*law.parameters, offset]), (low, high), enough)
        law, offset = law.from_parameters(found.parameters[:names]), float(found.parameters[names])
        return Solution(law, offset, found.jacobian[:, : names + self.with_offset], found.residual)

    def stiffness(self, law: ForceLaw) -> float:
        """∂F/∂x at the working depth of a law in local units, N/m."""
        return float(law.stiffness_at(self.depth / self.units.depth)) / self.units.depth

    def damping(self, law: ForceLaw) -> float:
        """∂F/∂v at the working depth of a law in local units, N·s/m."""
        return float(law.damping_at(self.depth / self.units.depth)) / self.units.speed

    def force_at_depth(self, law: ForceLaw) -> float:
        """Force at the working depth and at rest of a law in local units, N."""
        return float(law.force(self.depth / self.units.depth, 0.0))

    def felt(self, law: ForceLaw) -> Floats:
        """Force, stiffness and damping at the working depth of a law in local units, shape (3,)."""
        return np.array([self.force_at_depth(law), self.stiffness(law), self.damping(law)])

    @cached_property
    def gradients(self) -> Floats:
        """Of force, stiffness and damping at the working depth by the solution's parameters."""
        law = self.solution.law
        columns = []
        for k, value in enumerate(law.parameters):
            step = 1e-5 * max(abs(value), 1e-3 * float(np.abs(law.parameters).max()))
            up, down = law.parameters, law.parameters
            up[k], down[k] = value + step, value - step
            high, low = law.from_parameters(up), law.from_parameters(down)
            columns.append((self.felt(high) - self.felt(low)) / (2.0 * step))
        return np.array(columns).T

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """What moves of stiffness and damping are counted in: |S|, |C|, or a tenth of the force's.

        max(|S|, 0.1 F/x) and max(|C|, 0.1 F/V), for a quantity near zero.
        """
        force, law = self.force_at_depth(self.solution.law), self.solution.law
        return (
            float(reference_scale(self.stiffness(law), force, self.depth)),
            float(reference_scale(self.damping(law), force, self.speed)),
        )

    def apart(self, found: tuple[float, float], law: ForceLaw) -> tuple[float, float]:
        """How far stiffness and damping are off those of a law in local units, of their sizes."""
        return (
            (found[0] - self.stiffness(law)) / self.sizes[0],
            (found[1] - self.damping(law)) / self.sizes[1],
        )

    def moves(self, change: Floats) -> tuple[float, float]:
        """Relative moves of stiffness and damping by a linear change of the parameters.

        Linear, n Δk + k Δn: the product of large changes would say 34 % where it is 2 %.
        """
        moved = self.gradients[1:] @ change[: len(self.solution.law.symbols)]
        return float(moved[0] / self.sizes[0]), float(moved[1] / self.sizes[1])

    @cached_property
    def floor(self) -> float:
        """What noise leaves of a row of the band, N.

        White noise is that of a sample, √(σ² + S²σ_x² + C²σ_v²), in contact, where it may grow with
        the force. Of slow noise the force in free air tells, or without free air what the residual
        shows above the band of the motion.
        """
        x = np.maximum(self.x, 1e-12)
        slope = self.solution.law.penetration_gradient(x, self.v) / self.units.depth
        by_x = np.mean(slope**2) * self.data.penetration_noise**2
        by_v = (self.damping(self.solution.law) * self.data.velocity_noise) ** 2
        force = max(self.data.force_noise, self._noise_in_contact)
        white = math.sqrt(force**2 + by_x + by_v) / math.sqrt(self.band.width)
        above = self._above_band
        slow = min(self.air.noise, MOST_SLOW * max(white, above)) if self.air.noise else above
        return max(white, slow)

    @property
    def _noise_in_contact(self) -> float:
        """Rms of the force's white noise in contact, N, by fourth differences."""
        inside, force = self.inside, self.data.force
        whole = inside[:-4] & inside[1:-3] & inside[2:-2] & inside[3:-1] & inside[4:]
        differences = np.diff(force, 4)[whole]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0

    @cached_property
    def correlated(self) -> float:
        """Rows of the band over which noise is correlated, by free air.

        Of AR(1) noise the variance over that of its fourth differences is 0.9 correlation times.
        """
        above = self._above_band
        slow = (self.floor / above) ** 2 if self.air.noise and above > 0.0 else 1.0
        return (1.0 + len(self.band.shared)) * max(slow, 1.0)

    @property
    def ratio(self) -> float:
        """Residual of the band over its noise floor; 1 where the law holds to the noise."""
        rms = math.sqrt(self.solution.energy / max(len(self.band), 1))
        return rms / self.floor if self.floor > 0.0 else math.inf

    @cached_property
    def acceleration(self) -> Floats:
        """At the band's samples, m/s²."""
        return self._rate_of(self.data.velocity)[self.band.samples]

    @cached_property
    def jerk(self) -> Floats:
        """Rate of the acceleration at the band's samples, m/s³."""
        return self._rate_of(self._rate_of(self.data.velocity))[self.band.samples]

    def _rate_of(self, values: Floats) -> Floats:
        time = np.maximum(np.gradient(self.data.time).cumsum(), self.data.time)
        rate: Floats = np.gradient(values, time)
        return rate

    @property
    def near_noise(self) -> bool:
        """Whether the residual is so near noise that a cause that moves little is but a note."""
        slow = self.correlated > SLOW * (1.0 + len(self.band.shared))
        return self.ratio < (MISFIT if slow else NOISE_LIKE)

    @property
    def misfits(self) -> bool:
        """Whether the residual is more than noise."""
        # A period of free air, and so many times more as noise is slower than a window.
        known = self.air.windows * (1.0 + len(self.band.shared)) >= FEWEST_AIR * self.correlated
        return self.ratio > (MISFIT if known else MISFIT_UNKNOWN)

    @cached_property
    def air(self) -> "FreeAir":
        """The force in free air, in windows as long as the band's."""
        free = np.flatnonzero(self.free)
        if free.size < FEWEST_FREE:
            return FreeAir()
        # The uppermost are left out: they touch where the surface is higher than assumed.
        above = self.penetration <= np.percentile(self.penetration[free], LOWEST_FREE)
        windows = _windows(self.free & above, self.data.segment, self.period, self.band.width)
        return _free_air(self, windows)

    @property
    def _above_band(self) -> float:
        """Noise of a row by fourth differences of the residual, from window to window, N."""
        starts = self.band.samples[self.band.windows[0]]
        step = int(np.median(np.diff(starts))) if len(starts) > 1 else 0
        lag = -(-self.band.width // step) if step else 1
        if len(starts) < 4 * lag + FEWEST_ROWS or not 0 < step <= 2 * self.band.width:
            return 0.0
        whole = starts[4 * lag :] - starts[: -4 * lag] == 4 * lag * step
        differences = self.solution.residual
        for _ in range(4):
            differences = differences[lag:] - differences[:-lag]
        differences = differences[whole]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0


# Free air: what the sensor reads where nothing is touched.

LOWEST_FREE = 75.0  # percent of the samples above the surface
FEWEST_WINDOWS = 3  # of a stretch, beside one another
# Times quicker noise: more is no noise, but a force that begins above the surface.
MOST_SLOW = 10.0


@dataclass(frozen=True, slots=True)
class FreeAir:
    """Force in free air beside a constant of each stretch: noise, and what moves with the probe.

    Attributes
    ----------
    noise : float
        Rms of a window's mean, N.
    windows : float
        How many there are beside one another.
    slopes, errors : tuple of float
        ∂F/∂x [N/m] and ∂F/∂v [N·s/m] in free air, and their standard errors.
    """

    noise: float = 0.0
    windows: float = 0.0
    slopes: tuple[float, float] = (0.0, 0.0)
    errors: tuple[float, float] = (math.inf, math.inf)


def _free_air(fit: Fit, band: Band) -> FreeAir:
    starts = band.samples[band.windows[0]]
    step = max(band.width // 3, 1)
    stretch = np.cumsum(np.diff(starts, prepend=starts[:1]) > max(band.width, 2 * step))
    count = np.bincount(stretch) * step / band.width  # windows beside one another
    long = (count >= FEWEST_WINDOWS)[stretch]
    if not long.any():
        return FreeAir()
    at, data = band.samples, fit.data
    rows = band.mean(np.column_stack([data.force[at], data.penetration[at], data.velocity[at]]))
    means = np.array([np.bincount(stretch, column) for column in rows.T])
    rows = (rows - (means / np.bincount(stretch)).T[stretch])[long]
    force, motion = rows[:, 0], rows[:, 1:]
    counted = count[count >= FEWEST_WINDOWS]
    left = 1.0 - counted.size / float(counted.sum())  # their own means take the rest
    slopes, *_ = np.linalg.lstsq(motion, force, rcond=1e-9)
    residual = force - motion @ slopes
    noise = math.sqrt(float(residual @ residual) / len(residual) / left)
    if counted.size < 2:  # on one approach slow noise and drift look like a slope
        return FreeAir(noise, float(counted.sum()))
    errors = np.sqrt(np.maximum(np.diag(robust_covariance(motion, residual)), 0.0))
    return FreeAir(noise, float(counted.sum()), tuple(slopes.tolist()), tuple(errors.tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class MovedSamples:
    """Samples in local units and the windows over them, in place of the fit's own."""

    x: Floats
    v: Floats
    band: Band
    force: Floats


# A cause of misfit: how significant it is, what it explains and how far it changes the result.

# The largest z of a cause that moves any number is 3.7 on 196 clean recordings, of probe and robot.
SIGNIFICANT = 4.5
# A column of which less than this is left beside the fit's own is the fit's own.
COLLINEAR = 1e-5


@dataclass(frozen=True, slots=True)
class MisfitHypothesis:
    """What one cause would explain in addition to the law.

    Attributes
    ----------
    name : str
        Of the cause.
    z : float
        Its coefficient in standard errors, for a correlated residual.
    gain : float
        Fraction of the residual's energy that it removes.
    parameter : float
        How far it moves the law's stiffness parameter, of its size.
    sentence : str
        For a person.
    remedy : str or None
        What to do.
    moves : callable
        Gives how far stiffness and damping of a fit move, at its working depth, of their size.
    stiffness, damping : float
        That of the fit it was found in.
    """

    name: str
    z: float
    gain: float
    parameter: float
    sentence: str
    remedy: str | None
    moves: "Moves"
    stiffness: float
    damping: float
    #: Whether it explains the force to the noise, so that its influence is all there is.
    settled: bool = True

    @property
    def family(self) -> str:
        """Drift and change are one, a slow change of the material; so are a delay and its jump."""
        families = {"gain drift": "change", "skew jump": "delay"}
        return families.get(self.name, self.name)

    @property
    def small(self) -> bool:
        """Whether it moves next to nothing: S and C under 2 %, K under 3 %.

        Half an encoder count is a dead band; it is significant on a stiff material and moves the
        damping by 1 %: 18 of 200 clean runs of the robot, which are not to be blamed.
        """
        moved = max(abs(self.stiffness), abs(self.damping))
        return moved < 0.02 and abs(self.parameter) < 0.03


@dataclass(frozen=True, slots=True)
class AugmentedFit:
    """A column fitted together with the law's own.

    Attributes
    ----------
    change : numpy.ndarray
        Of the fit's parameters, with the column against without.
    amount : float
        Coefficient of the column.
    z, gain : float
        As in :class:`MisfitHypothesis`.
    """

    change: Floats
    amount: float
    z: float
    gain: float


def augmented_fit(
    fit: Fit, column: Floats, solution: Solution | None = None
) -> AugmentedFit | None:
    """Fit a column together with the law's Jacobian; None if it is collinear with that.

    ``solution``: with columns next to the law's. Default: that of the fit.
    """
    solution = solution or fit.solution
    jacobian, residual = solution.jacobian, solution.residual
    own, left = solution.inverse @ column, solution.without(column)
    if not np.isfinite(left).all() or float(left @ left) <= COLLINEAR**2 * float(column @ column):
        return None
    amount = float(left @ residual / (left @ left))
    after = residual - amount * left
    # What is left of the column is orthogonal to the others: its own error needs none of them.
    others = jacobian.shape[1]
    error = math.sqrt(robust_covariance(left[:, None], after, fit.band.shared, others)[0, 0])
    z, gain = abs(amount) / max(error, 1e-300), fit.gain(float(after @ after))
    if z > SIGNIFICANT and fit.floor > 0.0:
        # In slow noise a short residual does not show how long it is correlated; free air does.
        known = math.sqrt(max(gain, 0.0) * fit.solution.energy / fit.correlated) / fit.floor
        z = min(z, known)
    return AugmentedFit(-amount * own, amount, *((z, gain) if math.isfinite(z) else (0.0, 0.0)))


#: How far something moves stiffness and damping at a fit's working depth, of their size.
Moves = Callable[[Fit], tuple[float, float]]
Search = Callable[[Fit], list[MisfitHypothesis]]


def deeper_half(fit: Fit) -> str:
    """Next step where a law holds in no wide range of depths: half the working depth and deeper."""
    from_here = 0.5 * fit.depth + fit.estimate.surface
    if fit.range[0] + fit.estimate.surface >= from_here:
        return "use stiffness and damping at the working depth only"
    return f"identify the deeper half alone: --min-penetration {1e3 * from_here:.2g}mm"
