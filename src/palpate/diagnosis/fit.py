"""The law fitted once more, in the motion's band, and all that its checks ask of that fit."""

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.covariance import robust_covariance
from palpate.diagnosis.alike import as_hunt_crossley
from palpate.diagnosis.band import Band, band_of
from palpate.diagnosis.data import Data
from palpate.diagnosis.laws import Laws
from palpate.estimate import Estimate
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, HuntCrossley
from palpate.trace import Trace
from palpate.validation import Floats

EXPONENTS = (0.2, 6.0)  # beyond what any material shows; keeps powers finite
MOST_STEPS = 25
DEEP = 90.0  # percentile of the penetration that is looked at beside the working depth


@dataclass(frozen=True, slots=True)
class Units:
    """In which penetration and velocity are counted, so that a power law's K and n part."""

    depth: float
    speed: float

    def local(self, law: ForceLaw) -> ForceLaw:
        """Return the law in these units: for Hunt–Crossley k = K x_rⁿ, c = B x_rⁿ V."""
        if isinstance(law, HuntCrossley):
            power = self.depth**law.exponent
            k, c = law.stiffness * power, law.damping * power * self.speed
            return HuntCrossley(k, c, law.exponent)
        return law

    def restored(self, law: ForceLaw) -> ForceLaw:
        """Return a law that is in these units, in SI."""
        return Units(1.0 / self.depth, 1.0 / self.speed).local(law)


@dataclass(frozen=True, slots=True, eq=False)
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
        The working depth, m; the median penetration of the samples taken unless given.
    laws : Laws, optional
        That were compared by the same samples.
    """

    def __init__(
        self,
        data: Data,
        trace: Trace,
        estimate: Estimate,
        depth: float | None = None,
        laws: Laws | None = None,
    ) -> None:
        self._given, self.laws = (data, trace, estimate), laws
        if isinstance(estimate.law, GeneralisedHuntCrossley):
            known = data.penetration[trace.taken[data.known]] - estimate.surface
            middle = float(np.median(known[known > 0.0])) if (known > 0.0).any() else 1.0
            data, estimate = as_hunt_crossley(data, estimate, depth or middle)
        self.data, self.estimate = data, estimate
        self.with_offset = estimate.offset_standard_error > 0.0
        names = estimate.law.names()
        self.fixed = [k for k, name in enumerate(names) if name in estimate.fixed]
        self.penetration = data.penetration - estimate.surface
        self.inside: NDArray[np.bool_] = trace.taken[data.known] & (self.penetration > 0.0)
        self.rejected: NDArray[np.bool_] = trace.rejected[data.known]  # left out as outliers
        self.outside: NDArray[np.bool_] = ~(self.inside | self.rejected)
        x, v = self.penetration[self.inside], data.velocity[self.inside]
        self.reference = float(np.median(x)) if x.size else math.nan
        self.depth = self.reference if depth is None else depth
        self.range = (float(x.min()), float(x.max())) if x.size else (math.nan, math.nan)
        self.deeper = (float(np.percentile(x, DEEP)),) if x.size else (math.nan,)
        self.speed = float(np.sqrt(np.mean(v**2))) or 1.0
        self.period = 2.0 * math.pi * float(np.std(x)) / self.speed
        hunt_crossley = isinstance(estimate.law, HuntCrossley)
        self.units = Units(self.reference, self.speed) if hunt_crossley else Units(1.0, 1.0)
        self.band: Band = self._band()
        self.x = self.penetration[self.band.samples] / self.units.depth
        self.v = data.velocity[self.band.samples] / self.units.speed
        self.powers: dict[float, Floats] = {}  # xⁿ and xⁿv in the band, by n
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

        It is made again only of a law that is taken for another, which is like it at that depth.
        """
        if isinstance(self._given[2].law, GeneralisedHuntCrossley):
            return Fit(*self._given, depth, self.laws)
        other = copy(self)
        other.depth = depth
        for name in ("gradients", "sizes"):  # cached, and of the depth
            other.__dict__.pop(name, None)
        return other

    @cached_property
    def finite(self) -> bool:
        """Whether a least squares of finite numbers was found, of a law that resists at all."""
        parts = self.solution.law.parameters, self.solution.residual, self.solution.jacobian
        known = all(np.isfinite(part).all() for part in parts) and self.period > 0.0
        return known and all(math.isfinite(size) and size > 0.0 for size in self.sizes)

    @cached_property
    def solution(self) -> Solution:
        """The least squares in the band."""
        return self.solve(self.units.local(self.estimate.law), self.estimate.offset)

    @cached_property
    def law(self) -> ForceLaw:
        """The law of :attr:`solution`, SI."""
        return self.units.restored(self.solution.law)

    @cached_property
    def covariance(self) -> Floats:
        """Of the solution's parameters and offset, in local units, for a correlated residual."""
        return robust_covariance(self.solution.jacobian, self.solution.residual, self.band.shared)

    def at(self, law: ForceLaw, offset: float, moved: "Motion | None" = None) -> Solution:
        """Jacobian and residual of a law in local units."""
        motion = moved or Motion(self.x, self.v, self.band, self.force)
        x = np.maximum(motion.x, 1e-12)
        gradient = motion.band.mean(law.parameter_gradient(x, motion.v))
        # The force is linear in all parameters but the exponent.
        linear = 2 if isinstance(law, HuntCrossley) else len(law.symbols)
        model = gradient[:, :linear] @ law.parameters[:linear]
        gradient[:, self.fixed] = 0.0  # what was given no least squares moves
        if self.with_offset:
            gradient = np.column_stack([gradient, np.ones(len(gradient))])
        return Solution(law, offset, gradient, motion.force - model - offset)

    def solve(
        self, law: ForceLaw, offset: float, moved: "Motion | None" = None, enough: float = 1e-9
    ) -> Solution:
        """Levenberg–Marquardt from a law in local units; one step where the law is linear.

        Until a step gains less than ``enough`` of the energy.
        """
        best, damping = self.at(law, offset, moved), 1e-9
        for _ in range(MOST_STEPS):
            change = _step(best.jacobian, best.residual, damping)
            trial = self.at(*self._moved(best, change), moved)
            if not trial.energy < best.energy:
                damping = max(damping, 1e-6) * 10.0
                if damping > 1e3:
                    break
                continue
            gained = best.energy - trial.energy
            best, damping = trial, damping / 10.0
            if gained < enough * best.energy:
                break
        return best

    def _moved(self, from_: Solution, change: Floats) -> tuple[ForceLaw, float]:
        names = len(from_.law.symbols)
        parameters = from_.law.parameters + change[:names]
        if isinstance(from_.law, HuntCrossley):
            parameters[2] = np.clip(parameters[2], *EXPONENTS)
        return type(from_.law)(*parameters), from_.offset + float(change[names:].sum())

    def stiffness(self, law: ForceLaw) -> float:
        """∂F/∂x at the working depth of a law in local units, N/m."""
        return float(law.stiffness_at(self.depth / self.units.depth)) / self.units.depth

    def damping(self, law: ForceLaw) -> float:
        """∂F/∂v at the working depth of a law in local units, N·s/m."""
        return float(law.damping_at(self.depth / self.units.depth)) / self.units.speed

    def force_at_depth(self, law: ForceLaw) -> float:
        """Force at the working depth and at rest of a law in local units, N."""
        return float(law.force(self.depth / self.units.depth, 0.0))

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
            columns.append(
                [
                    (quantity(high) - quantity(low)) / (2.0 * step)
                    for quantity in (self.force_at_depth, self.stiffness, self.damping)
                ]
            )
        return np.array(columns).T

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """What moves of stiffness and damping are counted in: |S|, |C|, or a tenth of the force's.

        max(|S|, 0.1 F/x) and max(|C|, 0.1 F/V), for a quantity near zero.
        """
        force, law = abs(self.force_at_depth(self.solution.law)), self.solution.law
        return (
            max(abs(self.stiffness(law)), 0.1 * force / self.depth),
            max(abs(self.damping(law)), 0.1 * force / self.speed),
        )

    def between(self, before: ForceLaw, after: ForceLaw) -> tuple[float, float]:
        """Relative moves of stiffness and damping from one law in local units to another."""
        return (
            (self.stiffness(after) - self.stiffness(before)) / self.sizes[0],
            (self.damping(after) - self.damping(before)) / self.sizes[1],
        )

    def moves(self, change: Floats) -> tuple[float, float]:
        """Relative moves of stiffness and damping by a linear change of the parameters.

        Linear, n Δk + k Δn: the product of large changes would say 34 % where it is 2 %.
        """
        moved = self.gradients[1:] @ change[: len(self.solution.law.symbols)]
        return float(moved[0] / self.sizes[0]), float(moved[1] / self.sizes[1])

    @cached_property
    def noise(self) -> float:
        """Noise floor of a sample's force, N: √(σ² + S²σ_x² + C²σ_v²)."""
        x = np.maximum(self.x, 1e-12)
        slope = self.solution.law.penetration_gradient(x, self.v) / self.units.depth
        by_x = np.mean(slope**2) * self.data.penetration_noise**2
        by_v = (self.damping(self.solution.law) * self.data.velocity_noise) ** 2
        return math.sqrt(self.data.force_noise**2 + by_x + by_v)

    @cached_property
    def floor(self) -> float:
        """What noise leaves of a row of the band, N."""
        return self.noise / math.sqrt(self.band.width)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Samples in local units and the windows over them, in place of the fit's own."""

    x: Floats
    v: Floats
    band: Band
    force: Floats


def _step(jacobian: Floats, residual: Floats, damping: float) -> Floats:
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0
    unit = jacobian / size
    held = np.sqrt(damping) * np.eye(len(size))
    wanted = np.concatenate([residual, np.zeros(len(size))])
    step: Floats = np.linalg.lstsq(np.vstack([unit, held]), wanted, rcond=None)[0] / size
    return step
