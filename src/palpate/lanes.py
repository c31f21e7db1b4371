"""Many contacts of one length at once: the same recursion, several contacts abreast.

The compiled recursion takes sixteen contacts at a time in vector lanes, with the widest
instructions that the processor has, and each comes out as it would alone: see ``docs/lanes.md``.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate._core import Status
from palpate.errors import InvalidParameterError
from palpate.estimators import CompiledEstimator, ContactEstimator
from palpate.force_laws import ForceLaw
from palpate.validation import Floats, instance, shown, unmasked, whole_in

#: Forces an instruction set, for a comparison: one of :func:`instruction_sets`.
ENVIRONMENT = "PALPATE_INSTRUCTION_SET"
_TAKEN = (Status.UPDATED, Status.GUARDED, Status.RESTARTED)
#: Samples between two looks for an interrupt, some tenths of a second.
_SAMPLES_A_CALL = 20_000_000


@dataclass(frozen=True, slots=True)
class LaneEstimates:
    """What an estimator knew of each contact after its last sample; a row a contact, SI.

    Attributes
    ----------
    law_type : type
        The force law.
    parameters : numpy.ndarray, shape (k, p)
        Of the law, in its own order.
    covariance : numpy.ndarray, shape (k, p, p)
        Of the parameters, as :attr:`Estimate.covariance`: the noise counts as white there.
    offset, offset_standard_error : numpy.ndarray, shape (k,)
        Force without contact, N, by methods that estimate it; else 0.
    surface, surface_standard_error : numpy.ndarray, shape (k,)
        Where the material begins, m, by methods that search for it; else 0.
    validity_margin : numpy.ndarray, shape (k,)
        Condition 10 as a margin, as :attr:`Estimate.validity_margin`.
    status, flags : numpy.ndarray of uint8, shape (k,)
        As numbers of :class:`Status`, and bits as in ``palpate.estimate.ADVICE``.
    samples, guarded, restarts, rejected : numpy.ndarray of uint64, shape (k,)
        Samples taken; of them those that the covariance guard touched; how often a change was
        detected; samples left out as outliers.
    violated : numpy.ndarray of uint64, shape (k,), optional
        Samples taken at which condition 10 did not hold, by the estimate after them; None unless
        they were to be counted.
    statuses : numpy.ndarray of uint8, shape (k, m), optional
        A :class:`Status` a sample; None unless they were to be kept.
    instruction_set : str
        What they were computed with; ``"scalar"`` where the lanes do not take the settings and the
        contacts went one at a time.
    """

    law_type: type[ForceLaw]
    parameters: Floats
    covariance: Floats
    offset: Floats
    offset_standard_error: Floats
    surface: Floats
    surface_standard_error: Floats
    validity_margin: Floats
    status: NDArray[np.uint8]
    flags: NDArray[np.uint8]
    samples: NDArray[np.uint64]
    guarded: NDArray[np.uint64]
    restarts: NDArray[np.uint64]
    rejected: NDArray[np.uint64]
    violated: NDArray[np.uint64] | None
    statuses: NDArray[np.uint8] | None
    instruction_set: str

    def __len__(self) -> int:
        return len(self.parameters)

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the parameters, shape (k, p), SI."""
        variances: Floats = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(np.maximum(variances, 0.0))

    def law(self, contact: int) -> ForceLaw:
        """The contact model of one contact."""
        return self.law_type.from_parameters(self.parameters[contact])


def instruction_sets() -> tuple[str, ...]:
    """Names of what :func:`replay_lanes` can compute with on this processor, the quickest last."""
    return tuple(_core.instruction_sets())


def replay_lanes(
    penetration: "ArrayLike",
    velocity: "ArrayLike",
    force: "ArrayLike",
    estimator: ContactEstimator,
    *,
    gates: "ArrayLike | None" = None,
    scales: "ArrayLike | None" = None,
    count_violated: bool = False,
    keep_statuses: bool = False,
    threads: int = 1,
    instruction_set: str | None = None,
) -> LaneEstimates:
    """Identify each row of arrays from a fresh start, and return what is known at its end.

    :class:`SingleStageRLS`, :class:`KelvinVoigtRLS` and :class:`ExtendedKelvinVoigtRLS` go through
    vector lanes, under any settings but a ``perturbation``, a ``change_detector`` and an
    ``outlier_rejection``. With one of these, and for all other estimators, the contacts go through
    the estimator one at a time: same results, only slower. ``instruction_set`` of the result says
    which it was. Lanes and one at a time differ by what a last bit of the data comes to.

    Threads run without the interpreter's lock; do not change the arrays meanwhile.

    Parameters
    ----------
    penetration, velocity, force : array_like, shape (k, m)
        A contact a row, m, m/s and N, a sample every ``sample_time`` of the estimator. Samples that
        are not finite are refused one by one, as by ``update``: a row with fewer ends in NaN.
    estimator : ContactEstimator
        Method and settings; what it has learned itself does not matter, and does not change.
    gates : array_like, shape (k, 3), optional
        A gate a contact in place of the estimator's: ``minimum_penetration`` [m], ``make_force``
        and ``break_force`` [N].
    scales : array_like, shape (k, 3), optional
        Units of the arithmetic a contact in place of the estimator's: m, m/s and N.
    count_violated : bool
        Count the samples at which condition 10 did not hold, of laws that it concerns.
    keep_statuses : bool
        Keep what was done with every sample. Lanes do not know: all rows then go one at a time.
    threads : int
        How many share the rows, 1 to 1024.
    instruction_set : str, optional
        One of :func:`instruction_sets`; the environment's ``PALPATE_INSTRUCTION_SET`` or the last
        of them unless given. All but ``"scalar"`` give the same bits.

    Raises
    ------
    InvalidParameterError
        Arrays that do not go together, an instruction set that is not there, a gate or scale out of
        its range, or gates or scales for an estimator without the setting.
    """
    instance("estimator", estimator, ContactEstimator)
    rows = _rows(penetration=penetration, velocity=velocity, force=force)
    count, samples = rows["penetration"].shape
    own = {
        name: _own(name, values, count, estimator)
        for name, values in (("gates", gates), ("scales", scales))
    }
    workers = whole_in("threads", threads, 1, 1024)
    chosen = _instruction_set(instruction_set)
    out = _Columns.empty(
        (count, samples), len(estimator.law_type.symbols), count_violated, keep_statuses
    )
    used = "scalar"
    for part in _parts(count, samples, workers):
        signals = [np.ascontiguousarray(array[part], dtype=np.float64) for array in rows.values()]
        settings = [None if array is None else array[part] for array in own.values()]
        if isinstance(estimator, CompiledEstimator):
            try:
                if estimator._replay_many(*signals, *settings, *out.of(part), workers, chosen):
                    used = chosen
            except ValueError as error:
                raise InvalidParameterError(str(error)) from None
        else:
            _one_by_one(estimator, signals, settings, out, part)
    return out.estimates(estimator.law_type, used)


@dataclass(frozen=True, slots=True)
class _Columns:
    """Memory that the compiled code writes, a row a contact."""

    parameters: Floats
    covariance: Floats
    others: Floats  # offset, its variance, surface, its variance, validity margin
    status: NDArray[np.uint8]  # and flags
    counts: NDArray[np.uint64]  # samples, guarded, restarts, rejected
    violated: NDArray[np.uint64] | None
    statuses: NDArray[np.uint8] | None

    @classmethod
    def empty(cls, shape: tuple[int, int], size: int, violated: bool, statuses: bool) -> "_Columns":
        count = shape[0]
        return cls(
            np.empty((count, size)),
            np.empty((count, size, size)),
            np.empty((count, 5)),
            np.empty((count, 2), np.uint8),
            np.empty((count, 4), np.uint64),
            np.zeros(count, np.uint64) if violated else None,
            np.empty(shape, np.uint8) if statuses else None,
        )

    def of(self, part: slice) -> list[Any]:
        columns = (getattr(self, field.name) for field in fields(self))
        return [None if column is None else column[part] for column in columns]

    def estimates(self, law_type: type[ForceLaw], instruction_set: str) -> LaneEstimates:
        offset, offset_variance, surface, surface_variance, margin = self.others.T.copy()
        status, flags = self.status.T.copy()
        samples, guarded, restarts, rejected = self.counts.T.copy()
        return LaneEstimates(
            law_type=law_type,
            parameters=self.parameters,
            covariance=self.covariance,
            offset=offset,
            offset_standard_error=np.sqrt(np.maximum(offset_variance, 0.0)),
            surface=surface,
            surface_standard_error=np.sqrt(np.maximum(surface_variance, 0.0)),
            validity_margin=margin,
            status=status,
            flags=flags,
            samples=samples,
            guarded=guarded,
            restarts=restarts,
            rejected=rejected,
            violated=self.violated,
            statuses=self.statuses,
            instruction_set=instruction_set,
        )


def _rows(**arrays: "ArrayLike") -> dict[str, NDArray[Any]]:
    """Each as an array of rows, all of one shape; what is not float64 is converted part by part."""
    result: dict[str, NDArray[Any]] = {}
    for name, values in arrays.items():
        unmasked(name, values)
        try:
            array = np.asarray(values)
        except Exception:  # an object's own __array__ may raise anything
            array = np.array(None)
        if array.dtype.kind not in "fiub" or array.ndim != 2:
            raise InvalidParameterError(
                f"{name} must be an array of numbers, contacts × samples, not {shown(values)}"
            )
        result[name] = array
    if len({array.shape for array in result.values()}) != 1:
        shapes = ", ".join(f"{name} is {array.shape}" for name, array in result.items())
        raise InvalidParameterError(f"arrays must have the same shape: {shapes}")
    return result


def _own(
    name: str, values: "ArrayLike | None", count: int, estimator: ContactEstimator
) -> Floats | None:
    """Gates or scales of the contacts' own; their ranges are for the compiled code to check."""
    if values is None:
        return None
    if name[:-1] not in estimator.settings:
        raise InvalidParameterError(
            f"{name} must be None for {type(estimator).__name__}, which has no {name[:-1]}"
        )
    array = _rows(**{name: values})[name]
    if array.shape != (count, 3):
        raise InvalidParameterError(f"{name} must be of shape ({count}, 3), not {array.shape}")
    return np.ascontiguousarray(array, dtype=np.float64)


def _instruction_set(name: str | None) -> str:
    available = instruction_sets()
    if name is None:
        name = os.environ.get(ENVIRONMENT) or available[-1]
    if name not in available:
        raise InvalidParameterError(
            f"instruction_set must be one of {', '.join(available)} on this processor, "
            f"not {shown(name)}"
        )
    return name


def _parts(count: int, samples: int, threads: int) -> Iterator[slice]:
    """Parts of the rows, after each of which Python may be interrupted."""
    lanes = 16 * 16 * threads  # whole blocks of lanes for every thread
    rows = max(_SAMPLES_A_CALL * threads // max(samples, 1) // lanes, 1) * lanes
    for first in range(0, count, rows):
        yield slice(first, min(first + rows, count))


def _one_by_one(
    estimator: ContactEstimator,
    signals: list[Floats],
    settings: list[Floats | None],
    out: _Columns,
    part: slice,
) -> None:
    """The same for an estimator written in Python."""
    from palpate.settings import ContactGate, Scale

    gates, scales = settings
    for row, contact in enumerate(range(part.start, part.stop)):
        changes: dict[str, Any] = {}
        if gates is not None:
            changes["gate"] = ContactGate(*gates[row].tolist())
        if scales is not None:
            changes["scale"] = Scale(*scales[row].tolist())
        fresh = estimator.replace(**changes)
        samples = zip(*(array[row].tolist() for array in signals), strict=True)
        for k, sample in enumerate(samples):
            status = fresh.update(*sample)
            if out.statuses is not None:
                out.statuses[contact, k] = int(status)
            if out.violated is not None and status in _TAKEN and not fresh.estimate().valid:
                out.violated[contact] += np.uint64(1)
        now = fresh.estimate()
        out.parameters[contact] = now.parameters
        out.covariance[contact] = now.covariance
        out.others[contact] = (
            now.offset,
            now.offset_standard_error**2,
            now.surface,
            now.surface_standard_error**2,
            now.validity_margin,
        )
        out.status[contact] = int(now.status), now._value.flags
        out.counts[contact] = now.samples, now.guarded, now.restarts, now.rejected
