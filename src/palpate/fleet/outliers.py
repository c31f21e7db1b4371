"""Contacts as arrays through the whole-curve fit, without samples that no material can have made.

:class:`palpate.OutlierRejection` compares each sample with what came before it; here the whole
contact is there, so single samples that leave their neighbours on both sides are found, and forces
at the end of the sensor's range.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.curves import CurveFits, fit_curves
from palpate.fleet.curves import Curves
from palpate.preparation.spikes import spikes_of_rows, step_of
from palpate.validation import Floats

Mask = NDArray[np.bool_]
# Equal forces at the top that are no chance, and by how many of its steps the law's force moves
# meanwhile, as in include/palpate/outlier_rejection.hpp.
_FLAT, _FLAT_STEPS = 5, 4.0


def fitted(
    curves: Curves, chosen: dict[str, Any], *, rejects: bool, threads: int
) -> tuple[CurveFits, Curves, NDArray[np.int64]]:
    """Fit curves with velocities: the fits, what they are of, and how many samples were left out.

    Parameters
    ----------
    curves : Curves
        The contacts.
    chosen : dict
        For :func:`palpate.curves.fit_curves`.
    rejects : bool
        Whether outliers are left out.
    threads : int
        That share the rows.
    """
    left_out = np.zeros(len(curves), dtype=np.int64)
    if rejects:
        curves, left_out = _without(curves, _spikes(curves, threads), left_out)
    fits = _fit(curves, chosen, threads)
    if rejects:
        ends = _ends_of_range(curves, fits)
        curves, left_out = _without(curves, ends, left_out)
        rows = np.array(sorted(ends), dtype=np.intp)
        if rows.size:
            _put(fits, rows, _fit(curves, chosen, threads, rows))
    return fits, curves, left_out


def _fit(
    curves: Curves, chosen: dict[str, Any], threads: int, rows: NDArray[np.intp] | None = None
) -> CurveFits:
    signals = [curves.penetration, curves.velocity, curves.force]
    own = chosen
    if rows is not None:
        signals = [values[rows] for values in signals if values is not None]
        own = {k: v[rows] if isinstance(v, np.ndarray) else v for k, v in chosen.items()}
    return fit_curves(*signals, threads=threads, **own)  # type: ignore[arg-type]  # all are there


def _put(fits: CurveFits, rows: NDArray[np.intp], others: CurveFits) -> None:
    for each in fields(fits):
        getattr(fits, each.name)[rows] = getattr(others, each.name)


def _without(
    curves: Curves, found: dict[int, Mask], left_out: NDArray[np.int64]
) -> tuple[Curves, NDArray[np.int64]]:
    """The same curves without some samples, of which those in hand are left as they are."""
    if not found:
        return curves, left_out
    force, counts = curves.force.copy(), left_out.copy()
    for row, mask in found.items():
        force[row, mask] = np.nan
        counts[row] += np.count_nonzero(mask)
    return replace(curves, force=force), counts


def _spikes(curves: Curves, threads: int) -> dict[int, Mask]:
    """Single samples of a channel that leave their neighbours, by the rows that have any."""
    marks = np.zeros(curves.force.shape, dtype=np.bool_)
    for values in (curves.penetration, curves.velocity, curves.force):
        assert values is not None
        marks |= spikes_of_rows(values, screened=True, threads=threads)
    return {row: marks[row] for row in np.flatnonzero(marks.any(axis=1)).tolist()}


def _ends_of_range(curves: Curves, fits: CurveFits) -> dict[int, Mask]:
    """Forces at the end of the sensor's range: equal ones on top while the law's force moves."""
    found: dict[int, Mask] = {}
    with np.errstate(invalid="ignore"):
        highest = np.fmax.reduce(curves.force, axis=1, initial=-np.inf)
        often = (curves.force == highest[:, None]).sum(axis=1) >= _FLAT
    for row in np.flatnonzero(often & np.isfinite(fits.stiffness)).tolist():
        force = curves.force[row]
        top = force == highest[row]
        runs = np.flatnonzero(np.diff(top, prepend=False, append=False)).reshape(-1, 2)
        law = _force_of_law(curves, fits, row)
        least = _FLAT_STEPS * step_of(force[np.isfinite(force)])
        for first, end in runs.tolist():
            if end - first >= _FLAT and np.ptp(law[first:end]) > least:
                found[row] = top
    return found


def _force_of_law(curves: Curves, fits: CurveFits, row: int) -> Floats:
    assert curves.velocity is not None
    depth = curves.penetration[row] - fits.surface[row]
    force: Floats = fits.law(row).force(depth, curves.velocity[row])
    return force
