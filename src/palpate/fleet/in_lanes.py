"""Contacts of equal length through the recursion in vector lanes, and their rows in blocks.

The rows are those of ``rows.py``, to rounding. Lanes keep no trace: what a row needs of one is told
from the data, and a contact of which it cannot be told is left to the recursion alone.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from itertools import chain, compress
from typing import Any

import numpy as np

from palpate import _core
from palpate._core import Status
from palpate.estimators import CompiledEstimator, ContactEstimator, estimator_named
from palpate.fleet.curves import Curves
from palpate.fleet.lane_rows import FEWEST, Flags, LaneRows, Rows, Samples
from palpate.fleet.settings import Settings
from palpate.lanes import LaneEstimates, replay_lanes
from palpate.preparation.gates_of_rows import gates_of_rows, scales_of_rows
from palpate.preparation.suggestions import LARGEST
from palpate.settings import OutlierRejection
from palpate.validation import Floats

Columns = dict[str, Any]
#: Columns, and the rows that they are of.
Known = tuple[Columns, Rows]
#: Rows that go through lanes together: sixteen blocks of lanes, or of long contacts one.
_ROWS, _FEWEST_ROWS = 256, 16
#: Samples of them, where they are long: a channel is 32 MB then.
_MOST_SAMPLES = 1 << 22
#: Samples that NumPy works on together: the memory of what it makes of them, 128 kB an array, is
#: kept for the next. (1 << 12 … 15: 2200, 3000, 3900 and 3300 contacts a second, of 1000 samples.)
_SAMPLES = 1 << 14
#: Steps that differ by no more of a step are one step, of times whose last digits were rounded.
_EVEN = 1e-9
_TAKEN = (Status.UPDATED, Status.GUARDED, Status.RESTARTED)
_REFUSED = (Status.INVALID_STEP, Status.OUT_OF_RANGE)


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


def columns_in_lanes(curves: Curves, settings: Settings, threads: int) -> Known:
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
    length = _MOST_SAMPLES // max(curves.penetration.shape[1], 1)
    length = min(max(length, _FEWEST_ROWS), _ROWS)
    parts = [chosen[first : first + length] for first in range(0, len(chosen), length)]
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


def _even(curves: Curves) -> tuple[Flags, float]:
    """Which have a clock of even steps, the same for all; and such a step, s."""
    clocks = np.atleast_2d(curves.time)
    if clocks.shape[1] < FEWEST or not len(curves):
        return np.zeros(len(curves), dtype=np.bool_), 1.0
    with np.errstate(all="ignore"):  # whatever a clock holds; NaN is a sample that is not there
        steps = np.diff(clocks, axis=1)
        known = steps[np.isfinite(steps)]
        step = float(np.median(known)) if known.size else 0.0
        even = ~(np.abs(steps - step) > _EVEN * step).any(axis=1)
    usable = 0.0 < step <= 1e6
    return np.broadcast_to(even & usable, len(curves)), step


@dataclass(frozen=True, slots=True)
class _Task:
    """Identifies some of the rows, from arrays to columns; threads share one."""

    curves: Curves
    settings: Settings
    step: float

    def columns(self, rows: Rows) -> Known:
        """Columns, and which of the rows they are of: those of which lanes say all."""
        samples = Samples.of(self.curves, rows)
        estimator = estimator_named(self.settings.method)().replace(**self.settings.estimator)
        gates, scales = self._chosen(samples, estimator)
        rejection = estimator.settings["outlier_rejection"]
        if rejection is None:  # as identify has it
            rejection = OutlierRejection()
        touching, clean = self._screened(samples, rejection, gates)

        def replayed(
            some: Any, rejection: OutlierRejection | bool, **options: Any
        ) -> LaneEstimates:
            return replay_lanes(
                samples.x[some],
                samples.v[some],
                samples.f[some],
                estimator.replace(sample_time=self.step, outlier_rejection=rejection),
                gates=gates[some],
                scales=scales[some],
                count_violated=estimator.needs_condition_10,
                **options,
            )

        found = replayed(slice(None), False)
        sound = samples.sound.copy()
        alone = np.flatnonzero(sound & ~clean)
        if alone.size:
            found, refused = _with(
                found, replayed(alone, rejection, keep_statuses=True), alone, touching
            )
            sound[alone] &= ~refused
        taken = np.count_nonzero(touching, axis=1)
        # Lanes take no sample that the gate does not let in: as many of them are the same.
        sound &= (taken > 0) & (found.samples == taken)
        sound &= (found.offset_standard_error == 0.0) & (found.surface_standard_error == 0.0)
        made = []
        for some in _blocks(np.flatnonzero(sound), samples.x.shape[1]):
            clock = self.curves.time[rows[some]] if self.curves.time.ndim == 2 else self.curves.time
            block = LaneRows(
                samples[some], touching[some], found, some, estimator, clock, ~clean[some]
            )
            made.append(_finite(block.columns(), rows[some]))
        return _joined(made)

    def _chosen(self, samples: Samples, estimator: ContactEstimator) -> tuple[Floats, Floats]:
        """Gates and scales: those of the settings, or by the data."""
        gates, scales = np.zeros((len(samples.x), 3)), np.ones((len(samples.x), 3))
        for some in _blocks(np.flatnonzero(samples.sound), samples.x.shape[1]):
            block = samples[some]
            signals = block.x, block.v, block.f
            gates[some], scales[some] = gates_of_rows(*signals), scales_of_rows(*signals)
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
        self, samples: Samples, rejection: OutlierRejection | bool, gates: Floats
    ) -> tuple[Flags, Flags]:
        """Which samples are in contact, and of which contacts nothing would be left out."""
        touching = np.zeros(samples.x.shape, dtype=np.uint8)
        clean = np.zeros(len(samples.x), dtype=np.uint8)
        _core.screen_contacts(
            samples.x,
            samples.v,
            samples.f,
            gates,
            self.step,
            rejection.threshold if isinstance(rejection, OutlierRejection) else 0.0,
            touching,
            clean,
            1,
        )
        return touching.view(np.bool_), clean.view(np.bool_)


def _with(
    found: LaneEstimates, own: LaneEstimates, rows: Rows, touching: Flags
) -> tuple[LaneEstimates, Flags]:
    """Estimates with those of some rows that went alone; and where a sample was refused."""
    assert own.statuses is not None
    touching[rows] = np.isin(own.statuses, _TAKEN)
    changed: dict[str, Any] = {}
    for field in fields(found):
        values, others = getattr(found, field.name), getattr(own, field.name)
        if isinstance(values, np.ndarray):
            changed[field.name] = values.copy()
            changed[field.name][rows] = others
    return replace(found, **changed), np.count_nonzero(np.isin(own.statuses, _REFUSED), axis=1) > 0


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
