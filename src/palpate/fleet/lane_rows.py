"""Rows of contacts that went through lanes, a block of them at a time."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.error_bars import widenings
from palpate.estimators import ContactEstimator
from palpate.flags import ADVICE_OF, words_of
from palpate.fleet.at_depth import numbers_at_depth
from palpate.fleet.curves import Curves
from palpate.force_laws import HuntCrossley
from palpate.lanes import LaneEstimates
from palpate.metrics import START_UP
from palpate.preparation.gates_of_rows import percentile_of_rows
from palpate.preparation.suggestions import LARGEST
from palpate.preparation.velocity import velocity_of
from palpate.validation import Floats

Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]
#: Noise is told by fourth differences, and a clock by its steps: of fewer samples nothing is.
FEWEST = 8


@dataclass(frozen=True, slots=True)
class Samples:
    """Some of the contacts, a row each; NaN after the last sample of a row.

    Attributes
    ----------
    x, v, f : numpy.ndarray, shape (k, m)
        Penetration, velocity and force, SI.
    counts : numpy.ndarray of int64, shape (k,)
        Samples of each.
    sound : numpy.ndarray of bool, shape (k,)
        Whether there is no gap in it, a velocity of each sample, and nothing absurd.
    """

    x: Floats
    v: Floats
    f: Floats
    counts: Rows
    sound: Flags

    @classmethod
    def of(cls, curves: Curves, rows: Rows) -> "Samples":
        """Copy some of the contacts."""
        x, f = curves.penetration[rows], curves.force[rows]
        times = curves.time[rows] if curves.time.ndim == 2 else curves.time
        there = np.isfinite(x) & np.isfinite(f) & np.isfinite(times)
        counts = np.count_nonzero(there, axis=1)
        x[~there] = f[~there] = np.nan
        if curves.velocity is None:
            v = np.array([velocity_of(curves.clock(row), x[k]) for k, row in enumerate(rows)])
            v = v.reshape(x.shape)
        else:
            v = curves.velocity[rows]
            v[~there] = np.nan
        sound = (counts >= FEWEST) & (there == (np.arange(x.shape[1]) < counts[:, None])).all(1)
        for values in (x, v, f):
            sound &= ((np.abs(values) < LARGEST) | ~there).all(axis=1)
        return cls(x, v, f, counts, sound)

    def __getitem__(self, some: Any) -> "Samples":
        return Samples(
            self.x[some], self.v[some], self.f[some], self.counts[some], self.sound[some]
        )


class LaneRows:
    """The columns of some rows, as ``row_of`` makes those of one.

    Parameters
    ----------
    samples : Samples
        The contacts, as many as ``rows``.
    taken : numpy.ndarray of bool, shape (k, m)
        The samples that went into the estimates.
    found : LaneEstimates
        Of these contacts, and others.
    rows : numpy.ndarray of int64, shape (k,)
        Which of the estimates are of these.
    estimator : ContactEstimator
        Their settings.
    clock : numpy.ndarray, shape (m,) or (k, m)
        Times of the samples, s.
    alone : numpy.ndarray of bool, shape (k,)
        Which went one at a time.
    """

    def __init__(
        self,
        samples: Samples,
        taken: Flags,
        found: LaneEstimates,
        rows: Rows,
        estimator: ContactEstimator,
        clock: Floats,
        alone: Flags,
    ) -> None:
        self.alone = alone | (found.instruction_set == "scalar")
        self.samples, self.taken, self.clock = samples, taken, clock
        self.found, self.rows, self.estimator = found, rows, estimator
        self.law = found.law_type
        self.parameters = found.parameters[rows]
        self.counts = np.count_nonzero(taken, axis=1)
        # Samples that were not taken count for nothing, but must not spoil a sum.
        self.x, self.v = np.where(taken, samples.x, 1.0), np.where(taken, samples.v, 0.0)
        self.f = np.where(taken, samples.f, 1.0)
        self.model = self.law.forces(self.parameters, self.x, self.v)

    def columns(self) -> dict[str, Any]:
        """Return what is known of each, by the names of the table's columns."""
        columns: dict[str, Any] = {}
        covariance = self.covariance
        with np.errstate(invalid="ignore"):
            errors = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        for k, name in enumerate(self.law.names()):
            columns[name] = self.parameters[:, k]
            columns[f"{name}_standard_error"] = errors[:, k]
        depth = percentile_of_rows(self.x, self.taken, 0.5)
        columns["depth"] = depth
        columns["largest_depth"] = np.where(self.taken, self.x, -np.inf).max(axis=1)
        columns |= numbers_at_depth(self.law, self.parameters, covariance, depth)
        left = np.where(self.taken, self.f - self.model, 0.0)
        columns["residual"] = np.sqrt((left**2).sum(axis=1) / self.counts)
        columns["covariance"] = list(covariance.reshape(len(covariance), -1))
        columns["samples"], columns["taken"] = self.samples.counts, self.counts
        columns["flags"] = self._flags()
        columns["fit"] = ["recursion" if alone else "lanes" for alone in self.alone.tolist()]
        return columns

    @cached_property
    def covariance(self) -> Floats:
        """As wide as a correlated residual makes it: that of ``joint_covariance``."""
        own = self.found.covariance[self.rows]
        if self.estimator.minimises is None:
            return own
        identified = np.array([name not in self.estimator.fixed for name in self.law.names()])
        widths = np.ones(self.parameters.shape)
        slopes = self.law.gradients(self.parameters, self.x, self.v)
        widths[:, identified] = widenings(
            slopes[:, :, identified],
            self.model,
            self.f,
            self.taken,
            logarithmic=self.estimator.minimises == "logarithm",
        )
        return own * widths[:, :, None] * widths[:, None, :]

    def _flags(self) -> list[list[str]]:
        found, rows = self.found, self.rows
        names = self.law.names()
        damping = self.parameters[:, names.index("damping")]
        signed = issubclass(self.law, HuntCrossley)
        stiffness = self.parameters[:, 0] if signed else np.zeros(len(rows))
        violated = np.zeros(len(rows)) if found.violated is None else found.violated[rows]
        return [
            words_of(
                ADVICE_OF[bits],
                samples=samples,
                taken=samples,
                parameters=len(names),
                stiffness=k,
                damping=b,
                violated=off / samples,
                predicts=late,
                guarded=guarded,
                left_out=left_out,
            )
            for bits, samples, k, b, off, late, guarded, left_out in zip(
                found.flags[rows].tolist(),
                self.counts.tolist(),
                stiffness.tolist(),
                damping.tolist(),
                violated.tolist(),
                self._has_prediction_error().tolist(),
                found.guarded[rows].tolist(),
                found.rejected[rows].tolist(),
                strict=True,
            )
        ]

    def _has_prediction_error(self) -> Flags:
        """As ``has_prediction_error`` of each: contact, and force, after the first 0.2 s."""
        clocks = np.broadcast_to(self.clock, self.x.shape)
        steps = np.diff(clocks, axis=1, prepend=0.0)
        steps[:, 0] = np.nanmedian(steps[:, 1:])
        elapsed = np.cumsum(np.where(self.taken, steps, 0.0), axis=1)
        late = self.taken & (elapsed > START_UP)
        enough: Flags = (np.where(late, self.f, 0.0) ** 2).sum(axis=1) > 0.0
        return enough
