"""The law fitted again to window means: least squares, noise floor, and one more column."""

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.diagnosis.equivalent import EquivalentEstimate, equivalent_hunt_crossley, force_along
from palpate.diagnosis.outcome import ModelSelection
from palpate.diagnosis.recording import Data
from palpate.diagnosis.windows import (
    FEWEST_FREE,
    FEWEST_ROWS,
    LOWEST_FREE,
    FreeAir,
    WindowedSamples,
    free_air_statistics,
    windows_in_contact,
    windows_over,
)
from palpate.estimators import ESTIMATORS
from palpate.estimators.by_law import linear_in
from palpate.estimators.estimate import Estimate, Trace
from palpate.estimators.least_squares import least_squares, robust_covariance
from palpate.estimators.oscillation import Oscillation
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

# Times the noise; clean recordings have 0.67 to 1.5. Without free air slow noise is not known: in
# AR(1) noise of 0.98 the residual of a good law is then up to 8 times what is.
MISFIT, MISFIT_UNKNOWN = 3.0, 10.0
FEWEST_AIR = 20.0  # windows of free air by which noise is known
NOISE_LIKE = 1.5  # times the noise
SLOW = 2.0  # windows; over more, free air's own share of the noise is uncertain
# Times quicker noise: more is no noise, but a force that begins above the surface.
MOST_SLOW = 10.0
FOURTH = 70.0  # 1 + 16 + 36 + 16 + 1, the variance of a fourth difference of white noise
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
        That of a law that relaxes, by :func:`force_along`, where it is known already.
    """

    def __init__(
        self,
        data: Data,
        trace: Trace,
        estimate: Estimate,
        depth: float | None = None,
        laws: ModelSelection | None = None,
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
            self._force = force_along(data, estimate) if force is None else force
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
        self.has_free_air = int(np.count_nonzero(self.outside)) >= FEWEST_FREE
        x, v = self.penetration[self.inside], data.velocity[self.inside]
        self.reference = float(np.median(x)) if x.size else math.nan
        self.depth = self.reference if depth is None else depth
        self.range = (float(x.min()), float(x.max())) if x.size else (math.nan, math.nan)
        self.deep_depths = (float(np.percentile(x, DEEP)),) if x.size else (math.nan,)
        self.speed = float(np.sqrt(np.mean(v**2))) or 1.0
        self.period = 2.0 * math.pi * float(np.std(x)) / self.speed
        scaled = self.reference, self.speed
        self.units = Units(*scaled) if estimate.law.power_law else Units(1.0, 1.0)
        self.windows: WindowedSamples = self._band()
        self.x = self.penetration[self.windows.samples] / self.units.depth
        self.v = data.velocity[self.windows.samples] / self.units.speed
        # By the depth, which is the only thing that differs between the copies of ``at_depth``.
        self._gradients: dict[float, Floats] = {}
        self._scales: dict[float, tuple[float, float]] = {}
        self.time = self.windows.mean(data.time[self.windows.samples])
        self.force = self.windows.mean(data.force[self.windows.samples])

    def _band(self) -> WindowedSamples:
        """Windows over the samples taken; one that was left out ends none."""
        kept = np.flatnonzero(~self.rejected)
        segment, sample_time = self.data.segment[kept], self.data.sample_time
        band = windows_in_contact(self.inside[kept], segment, self.period, sample_time)
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
        return other

    @property
    def identified_law(self) -> ForceLaw:
        """The law that was identified; of one that relaxes :attr:`law` is only the equivalent."""
        law: ForceLaw = self._given[2].law
        return law

    @property
    def finds_surface(self) -> bool:
        """Whether the method can estimate the position of the surface."""
        kind = ESTIMATORS.get(self.method)
        return kind is not None and "surface" in kind().settings

    @cached_property
    def finite(self) -> bool:
        """Whether a least squares of finite numbers was found, of a law that resists at all."""
        solution, sizes = self.solution, np.array(self.reference_scales)
        numbers = [solution.law.parameters, solution.residual, solution.jacobian.reshape(-1), sizes]
        known = bool(np.isfinite(np.concatenate(numbers)).all())
        return known and bool(np.ptp(self.x) > 0.0 and (sizes > 0.0).all())

    @property
    def checkable(self) -> bool:
        """Whether there are enough windows, and a least squares of finite numbers."""
        return len(self.windows) >= FEWEST_ROWS // 2 and self.finite

    @cached_property
    def solution(self) -> Solution:
        """The least squares in the band."""
        return self.solve(self.units.local(self.estimate.law), self.estimate.offset)

    @cached_property
    def law(self) -> ForceLaw:
        """The law of :attr:`solution`, SI."""
        return self.units.restored(self.solution.law)

    def explained_fraction(self, energy: float) -> float:
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
        return robust_covariance(
            self.solution.jacobian, self.solution.residual, self.windows.shared
        )

    def solve(
        self,
        law: ForceLaw,
        offset: float,
        moved: "MovedSamples | None" = None,
        enough: float = 1e-9,
    ) -> Solution:
        """The least squares next to a law in local units, within ``enough`` of its energy."""
        motion = moved or MovedSamples(self.x, self.v, self.windows, self.force)
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

    def force_stiffness_damping(self, law: ForceLaw) -> Floats:
        """Force, stiffness and damping at the working depth of a law in local units, shape (3,)."""
        return np.array([self.force_at_depth(law), self.stiffness(law), self.damping(law)])

    @property
    def gradients(self) -> Floats:
        """Of force, stiffness and damping at the working depth by the solution's parameters."""
        if self.depth in self._gradients:
            return self._gradients[self.depth]
        law = self.solution.law
        columns = []
        for k, value in enumerate(law.parameters):
            step = 1e-5 * max(abs(value), 1e-3 * float(np.abs(law.parameters).max()))
            up, down = law.parameters, law.parameters
            up[k], down[k] = value + step, value - step
            high, low = law.from_parameters(up), law.from_parameters(down)
            columns.append(
                (self.force_stiffness_damping(high) - self.force_stiffness_damping(low))
                / (2.0 * step)
            )
        gradients: Floats = np.array(columns).T
        self._gradients[self.depth] = gradients
        return gradients

    @property
    def reference_scales(self) -> tuple[float, float]:
        """What changes of stiffness and damping are relative to: |S|, |C|, or a tenth of the force.

        max(|S|, 0.1 F/x) and max(|C|, 0.1 F/V), for a quantity near zero.
        """
        if self.depth not in self._scales:
            law = self.solution.law
            force = self.force_at_depth(law)
            self._scales[self.depth] = (
                float(reference_scale(self.stiffness(law), force, self.depth)),
                float(reference_scale(self.damping(law), force, self.speed)),
            )
        return self._scales[self.depth]

    def relative_difference(
        self, numbers: tuple[float, float], law: ForceLaw
    ) -> tuple[float, float]:
        """Differences of stiffness and damping to those of a law, over the scales."""
        return (
            (numbers[0] - self.stiffness(law)) / self.reference_scales[0],
            (numbers[1] - self.damping(law)) / self.reference_scales[1],
        )

    def relative_change(self, change: Floats) -> tuple[float, float]:
        """Changes of stiffness and damping over the scales by a linear change of the parameters.

        Linear, n Δk + k Δn: the product of large changes would say 34 % where it is 2 %.
        """
        moved = self.gradients[1:] @ change[: len(self.solution.law.symbols)]
        return float(moved[0] / self.reference_scales[0]), float(
            moved[1] / self.reference_scales[1]
        )

    @cached_property
    def noise_floor(self) -> float:
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
        white = math.sqrt(force**2 + by_x + by_v) / math.sqrt(self.windows.width)
        above = self._above_band
        slow = (
            min(self.free_air.noise, MOST_SLOW * max(white, above))
            if self.free_air.noise
            else above
        )
        return max(white, slow)

    @property
    def _noise_in_contact(self) -> float:
        """Rms of the force's white noise in contact, N, by fourth differences."""
        inside, force = self.inside, self.data.force
        whole = inside[:-4] & inside[1:-3] & inside[2:-2] & inside[3:-1] & inside[4:]
        differences = np.diff(force, 4)[whole]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0

    @cached_property
    def correlated_rows(self) -> float:
        """Rows of the band over which noise is correlated, by free air.

        Of AR(1) noise the variance over that of its fourth differences is 0.9 correlation times.
        """
        above = self._above_band
        slow = (self.noise_floor / above) ** 2 if self.free_air.noise and above > 0.0 else 1.0
        return (1.0 + len(self.windows.shared)) * max(slow, 1.0)

    @property
    def residual_to_noise(self) -> float:
        """Residual of the band over its noise floor; 1 where the law holds to the noise."""
        rms = math.sqrt(self.solution.energy / max(len(self.windows), 1))
        return rms / self.noise_floor if self.noise_floor > 0.0 else math.inf

    @cached_property
    def acceleration(self) -> Floats:
        """At the band's samples, m/s²."""
        return self._rate_of(self.data.velocity)[self.windows.samples]

    @cached_property
    def jerk(self) -> Floats:
        """Rate of the acceleration at the band's samples, m/s³."""
        return self._rate_of(self._rate_of(self.data.velocity))[self.windows.samples]

    def _rate_of(self, values: Floats) -> Floats:
        time = np.maximum(np.gradient(self.data.time).cumsum(), self.data.time)
        rate: Floats = np.gradient(values, time)
        return rate

    @property
    def at_noise_floor(self) -> bool:
        """Whether the residual is so near noise that a cause that moves little is but a note."""
        slow = self.correlated_rows > SLOW * (1.0 + len(self.windows.shared))
        return self.residual_to_noise < (MISFIT if slow else NOISE_LIKE)

    @property
    def exceeds_noise(self) -> bool:
        """Whether the residual is more than noise."""
        # A period of free air, and so many times more as noise is slower than a window.
        known = (
            self.free_air.windows * (1.0 + len(self.windows.shared))
            >= FEWEST_AIR * self.correlated_rows
        )
        return self.residual_to_noise > (MISFIT if known else MISFIT_UNKNOWN)

    @cached_property
    def free_air(self) -> "FreeAir":
        """The force in free air, in windows as long as the band's."""
        free = np.flatnonzero(self.free)
        if free.size < FEWEST_FREE:
            return FreeAir()
        # The uppermost are left out: they touch where the surface is higher than assumed.
        above = self.penetration <= np.percentile(self.penetration[free], LOWEST_FREE)
        windows = windows_over(
            self.free & above, self.data.segment, self.period, self.windows.width
        )
        return free_air_statistics(self.data, windows)

    @property
    def _above_band(self) -> float:
        """Noise of a row by fourth differences of the residual, from window to window, N."""
        starts = self.windows.samples[self.windows.places[0]]
        step = int(np.median(np.diff(starts))) if len(starts) > 1 else 0
        lag = -(-self.windows.width // step) if step else 1
        if len(starts) < 4 * lag + FEWEST_ROWS or not 0 < step <= 2 * self.windows.width:
            return 0.0
        whole = starts[4 * lag :] - starts[: -4 * lag] == 4 * lag * step
        differences = self.solution.residual
        for _ in range(4):
            differences = differences[lag:] - differences[:-lag]
        differences = differences[whole]
        return float(np.sqrt(np.mean(differences**2) / FOURTH)) if differences.size else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class MovedSamples:
    """Samples in local units and the windows over them, in place of the fit's own."""

    x: Floats
    v: Floats
    band: WindowedSamples
    force: Floats


# A column of which less than this is left beside the fit's own is the fit's own.
COLLINEAR = 1e-5
# The largest z of a cause that moves any number is 3.7 on 196 clean recordings, of probe and robot.
SIGNIFICANT = 4.5


@dataclass(frozen=True, slots=True)
class AugmentedFit:
    """A column fitted together with the law's own.

    Attributes
    ----------
    change : numpy.ndarray
        Of the fit's parameters, with the column against without.
    amount : float
        Coefficient of the column.
    z : float
        The same in standard errors, for a correlated residual.
    explained_fraction : float
        Fraction of the residual's energy that it removes.
    """

    change: Floats
    amount: float
    z: float
    explained_fraction: float


def fit_with_column(
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
    error = math.sqrt(robust_covariance(left[:, None], after, fit.windows.shared, others)[0, 0])
    z, gain = abs(amount) / max(error, 1e-300), fit.explained_fraction(float(after @ after))
    if z > SIGNIFICANT and fit.noise_floor > 0.0:
        # In slow noise a short residual does not show how long it is correlated; free air does.
        known = (
            math.sqrt(max(gain, 0.0) * fit.solution.energy / fit.correlated_rows) / fit.noise_floor
        )
        z = min(z, known)
    return AugmentedFit(-amount * own, amount, *((z, gain) if math.isfinite(z) else (0.0, 0.0)))


def deeper_half_remedy(fit: Fit) -> str:
    """Next step where a law holds in no wide range of depths: half the working depth and deeper."""
    from_here = 0.5 * fit.depth + fit.estimate.surface
    if fit.range[0] + fit.estimate.surface >= from_here:
        return "use stiffness and damping at the working depth only"
    return f"identify the deeper half alone: --min-penetration {1e3 * from_here:.2g}mm"


def standard_errors(fit: Fit) -> Floats:
    """Of force, stiffness and damping at the working depth, SI, shape (3,).

    The covariance takes the noise to be the same at all depths. Where it is larger where it matters
    (White 1980), as in proportion to force, Σ u² e² exceeds Σ u² ⟨e²⟩ by the influences u.
    """
    names, residual = len(fit.solution.law.symbols), fit.solution.residual
    variances = np.diag(fit.gradients @ fit.covariance[:names, :names] @ fit.gradients.T)
    influences = (fit.gradients @ fit.solution.inverse[:names]) ** 2
    pooled = influences.sum(axis=1) * np.mean(residual**2)
    uneven = influences @ residual**2 / np.maximum(pooled, np.finfo(float).tiny)
    errors: Floats = np.sqrt(np.maximum(variances, 0.0) * np.maximum(uneven, 1.0))
    return errors


def distance_to_least_squares(fit: Fit) -> Floats:
    """How far the method's force, stiffness and damping are off its law's least squares, SI, (3,).

    A method that forgets, or weighs light touch as much as firm, has an answer of its own, and no
    error bar of the least squares is about it.
    """
    own, best = fit.units.local(fit.estimate.law), fit.solution.law
    return fit.force_stiffness_damping(own) - fit.force_stiffness_damping(best)
