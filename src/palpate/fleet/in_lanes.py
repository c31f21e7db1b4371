"""Contacts of equal length through the recursion in vector lanes, and their rows in blocks.

The rows are those of ``rows.py``, to rounding. Lanes keep no trace: what a row needs of one is told
from the data, and a contact of which it cannot be told is left to the recursion alone.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, compress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.error_bars import widenings
from palpate.estimators import CompiledEstimator, ContactEstimator, estimator_named
from palpate.flags import ADVICE_OF, words_of
from palpate.fleet.at_depth import numbers_at_depth
from palpate.fleet.settings import Settings
from palpate.lanes import LaneEstimates, replay_lanes
from palpate.metrics import START_UP
from palpate.preparation.gates_of_rows import gates_and_scales, percentile_of_rows
from palpate.preparation.suggestions import LARGEST
from palpate.preparation.velocity import velocity_of
from palpate.settings import OutlierRejection
from palpate.validation import Floats

if TYPE_CHECKING:
    from palpate.fleet.arrays import Curves

Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]
Columns = dict[str, Any]
#: Columns, and the rows that they are of.
Known = tuple[Columns, Rows]
#: Rows that go through lanes together: sixteen blocks of lanes.
_ROWS = 256
#: Samples that NumPy works on together: a quarter of a megabyte, which stays in a core's memory.
_SAMPLES = 32_768
#: Steps that differ by no more of a step are one step, of times whose last digits were rounded.
_EVEN = 1e-9
#: Noise is told by fourth differences, and a clock by its steps: of fewer samples nothing is.
_FEWEST = 8


def goes_through_lanes(settings: Settings) -> bool:
    """Whether a row can be made of what lanes, and the data themselves, say of a contact.

    The method has to be compiled and to take what its gate lets in, and nothing is to be prepared,
    watched or diagnosed that takes a trace.
    """
    estimator = estimator_named(settings.method)()
    gates = (settings.minimum_penetration, settings.minimum_force)
    return (
        isinstance(estimator, CompiledEstimator)
        and not estimator.chooses_samples
        and {"gate", "scale", "outlier_rejection", "sample_time"} <= set(estimator.settings)
        and settings.diagnosis != "full"
        and not settings.preparation
        and settings.estimator.get("change_detector") is None
        and all(gate is None or 0.0 <= gate <= LARGEST for gate in gates)
    )


def columns_in_lanes(curves: "Curves", settings: Settings, threads: int) -> Known:
    """Identify what lanes can: columns, and the rows that these are of.

    Parameters
    ----------
    curves : Curves
        The contacts.
    settings : Settings
        Such that :func:`goes_through_lanes`.
    threads : int
        That share the rows.
    """
    even, step = _even(curves)
    chosen = np.flatnonzero(even)
    task = _Task(curves, settings, step)
    parts = [chosen[first : first + _ROWS] for first in range(0, len(chosen), _ROWS)]
    return _joined(list(_shared(task, parts, threads)))


def _shared(task: "_Task", parts: list[Rows], threads: int) -> Iterator[Known]:
    if threads == 1 or len(parts) <= 1:
        yield from map(task.columns, parts)
        return
    pool = ThreadPoolExecutor(threads)
    try:
        yield from pool.map(task.columns, parts)
    finally:  # an interrupt leaves what was not begun
        pool.shutdown(cancel_futures=True)


def _joined(parts: Sequence[Known]) -> Known:
    parts = [(columns, rows) for columns, rows in parts if len(rows)]
    if not parts:
        return {}, np.empty(0, dtype=np.int64)
    columns: Columns = {}
    for name, first in parts[0][0].items():
        values = [part[name] for part, _ in parts]
        numbers = isinstance(first, np.ndarray)
        columns[name] = np.concatenate(values) if numbers else list(chain.from_iterable(values))
    return columns, np.concatenate([rows for _, rows in parts])


def _even(curves: "Curves") -> tuple[Flags, float]:
    """Which have a clock of even steps, the same for all; and such a step, s."""
    clocks = np.atleast_2d(curves.time)
    if clocks.shape[1] < _FEWEST or not len(curves):
        return np.zeros(len(curves), dtype=np.bool_), 1.0
    with np.errstate(all="ignore"):  # whatever a clock holds; NaN is a sample that is not there
        steps = np.diff(clocks, axis=1)
        known = steps[np.isfinite(steps)]
        step = float(np.median(known)) if known.size else 0.0
        even = ~(np.abs(steps - step) > _EVEN * step).any(axis=1)
    if not 0.0 < step <= 1e6:
        even[:] = False
    return np.broadcast_to(even, len(curves)), step


@dataclass(frozen=True, slots=True)
class _Samples:
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
    def of(cls, curves: "Curves", rows: Rows) -> "_Samples":
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
        sound = (counts >= _FEWEST) & (there == (np.arange(x.shape[1]) < counts[:, None])).all(1)
        for values in (x, v, f):
            sound &= ((np.abs(values) < LARGEST) | ~there).all(axis=1)
        return cls(x, v, f, counts, sound)

    def __getitem__(self, some: Any) -> "_Samples":
        return _Samples(
            self.x[some], self.v[some], self.f[some], self.counts[some], self.sound[some]
        )


@dataclass(frozen=True, slots=True)
class _Task:
    """Identifies some of the rows, from arrays to columns; threads share one."""

    curves: "Curves"
    settings: Settings
    step: float

    def columns(self, rows: Rows) -> Known:
        """Columns, and which of the rows they are of: those of which lanes say all."""
        samples = _Samples.of(self.curves, rows)
        estimator = estimator_named(self.settings.method)().replace(**self.settings.estimator)
        gates, scales = self._chosen(samples, estimator)
        touching, clean = self._screened(samples, estimator, gates)
        found = replay_lanes(
            samples.x,
            samples.v,
            samples.f,
            estimator.replace(sample_time=self.step, outlier_rejection=False),
            gates=gates,
            scales=scales,
            count_violated=estimator.needs_condition_10,
        )
        taken = np.count_nonzero(touching, axis=1)
        # Lanes take no sample that the gate does not let in: as many of them are the same.
        sound = samples.sound & clean & (taken > 0) & (found.samples == taken)
        sound &= (found.offset_standard_error == 0.0) & (found.surface_standard_error == 0.0)
        made = []
        for some in _blocks(np.flatnonzero(sound), samples.x.shape[1]):
            clock = self.curves.time[rows[some]] if self.curves.time.ndim == 2 else self.curves.time
            block = _Made(samples[some], touching[some], found, some, estimator, clock)
            made.append(_finite(block.columns(), rows[some]))
        return _joined(made)

    def _chosen(self, samples: _Samples, estimator: ContactEstimator) -> tuple[Floats, Floats]:
        """Gates and scales: those of the settings, or by the data."""
        gates, scales = np.zeros((len(samples.x), 3)), np.ones((len(samples.x), 3))
        for some in _blocks(np.flatnonzero(samples.sound), samples.x.shape[1]):
            block = samples[some]
            gates[some], scales[some] = gates_and_scales(block.x, block.v, block.f)
        depth, force = self.settings.minimum_penetration, self.settings.minimum_force
        gate, scale = estimator.settings["gate"], estimator.settings["scale"]
        if depth is not None:
            gates[:, 0] = depth
        if force is not None:
            gates[:, 1] = force
            gates[:, 2] = force
        if gate is not None and depth is None and force is None:
            gates[:] = gate._plain()
        if scale is not None:
            scales[:] = scale._plain()
        return gates, scales

    def _screened(
        self, samples: _Samples, estimator: ContactEstimator, gates: Floats
    ) -> tuple[Flags, Flags]:
        """Which samples are in contact, and of which contacts nothing would be left out."""
        given = estimator.settings["outlier_rejection"]
        rejection = OutlierRejection() if given is None else given
        touching = np.zeros(samples.x.shape, dtype=np.uint8)
        clean = np.zeros(len(samples.x), dtype=np.uint8)
        _core.screen_contacts(
            samples.x,
            samples.v,
            samples.f,
            gates,
            self.step,
            rejection.threshold if rejection else 0.0,
            touching,
            clean,
            1,
        )
        return touching.view(np.bool_), clean.view(np.bool_)


def _blocks(rows: Rows, samples: int) -> Iterator[Rows]:
    length = max(_SAMPLES // max(samples, 1), 1)
    for first in range(0, len(rows), length):
        yield rows[first : first + length]


def _finite(columns: Columns, rows: Rows) -> Known:
    """Those rows of which every number is one; of others the recursion says what it can."""
    numbers = [values for values in columns.values() if isinstance(values, np.ndarray)]
    sound = np.isfinite(np.stack(numbers)).all(axis=0)
    if sound.all():
        return columns, rows
    for name, values in columns.items():
        numeric = isinstance(values, np.ndarray)
        columns[name] = values[sound] if numeric else list(compress(values, sound))
    return columns, rows[sound]


class _Made:
    """The columns of some rows, as ``row_of`` makes those of one."""

    def __init__(
        self,
        samples: _Samples,
        taken: Flags,
        found: LaneEstimates,
        rows: Rows,
        estimator: ContactEstimator,
        clock: Floats,
    ) -> None:
        self.samples, self.taken, self.clock = samples, taken, clock
        self.found, self.rows, self.estimator = found, rows, estimator
        self.law = found.law_type
        self.parameters = found.parameters[rows]
        self.counts = np.count_nonzero(taken, axis=1)
        # Samples that were not taken count for nothing, but must not spoil a sum.
        self.x, self.v = np.where(taken, samples.x, 1.0), np.where(taken, samples.v, 0.0)
        self.f = np.where(taken, samples.f, 1.0)
        self.model = self.law.forces(self.parameters, self.x, self.v)

    def columns(self) -> Columns:
        columns: Columns = {}
        covariance = self.covariance
        with np.errstate(invalid="ignore"):
            errors = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        for k, name in enumerate(self.law.names()):
            columns[name] = self.parameters[:, k]
            columns[f"{name}_standard_error"] = errors[:, k]
        depth = percentile_of_rows(np.where(self.taken, self.x, np.inf), self.counts, 0.5)
        columns["depth"] = depth
        columns |= numbers_at_depth(self.law, self.parameters, covariance, depth)
        left = np.where(self.taken, self.f - self.model, 0.0)
        columns["residual"] = np.sqrt((left**2).sum(axis=1) / self.counts)
        columns["covariance"] = list(covariance.reshape(len(covariance), -1))
        columns["samples"], columns["taken"] = self.samples.counts, self.counts
        columns["flags"] = self._flags()
        lanes = "recursion" if self.found.instruction_set == "scalar" else "lanes"
        columns["fit"] = [lanes] * len(self.rows)
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
        violated = np.zeros(len(rows)) if found.violated is None else found.violated[rows]
        return [
            words_of(
                ADVICE_OF[bits],
                samples=samples,
                parameters=len(names),
                damping=b,
                violated=off / samples,
                predicts=late,
                guarded=guarded,
            )
            for bits, samples, b, off, late, guarded in zip(
                found.flags[rows].tolist(),
                self.counts.tolist(),
                damping.tolist(),
                violated.tolist(),
                self._has_prediction_error().tolist(),
                found.guarded[rows].tolist(),
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
