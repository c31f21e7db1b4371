"""Contacts of equal length as arrays: through the whole-curve fit, or the recursion one by one."""

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.curves import STATUS_WORDS, CurveFits
from palpate.diagnosis import Data
from palpate.diagnosis.left_out import count_of_outliers
from palpate.digits import rounded
from palpate.errors import RecordingError
from palpate.flags import ADVICE_OF, NEGATIVE_DAMPING, NEGATIVE_STIFFNESS
from palpate.fleet.at_depth import AT_DEPTH, LawsAtDepth, working_depths
from palpate.fleet.columns import empty_columns, table_of
from palpate.fleet.curves import Curves
from palpate.fleet.outliers import fitted
from palpate.fleet.rows import failure, in_words, row_of
from palpate.fleet.settings import Settings
from palpate.preparation.resolution import resolutions_of
from palpate.preparation.suggestions import choose_gate
from palpate.refusals import FEWEST_ABOVE, nothing_taken
from palpate.validation import Floats

if TYPE_CHECKING:
    import pyarrow as pa

#: Settings of variable projection that the whole-curve fit has too.
_SHARED = (
    "surface", "surface_range", "exponent", "exponent_range", "offset", "offset_deviation",
    "surface_deviation", "noise", "scale",
)  # fmt: skip
_NAMES = ("source", "index", "part", "x", "y", "z")


def fits_whole_curves(settings: Settings) -> bool:
    """Whether the whole-curve fit answers what these settings ask."""
    plain = set(settings.preparation) <= {"surface"}
    gated = settings.minimum_penetration is not None or settings.minimum_force is not None
    return (
        settings.method == "variable-projection"
        and settings.diagnosis != "full"
        and plain
        and settings.preparation.get("surface") in (None, "estimate")
        and not gated
        and set(settings.estimator) <= {*_SHARED, "outlier_rejection"}
    )


def searches_whole_curves(settings: Settings) -> bool:
    """Whether a force curve is searched for its surface by the whole-curve fit.

    The recursion answers the same after every sample, and takes a thousand times as long.
    """
    own = Settings(method=settings.method, estimator=settings.estimator, diagnosis="none")
    gated = settings.minimum_penetration is not None or settings.minimum_force is not None
    full = settings.diagnosis == "full"
    return settings.searches_surface and fits_whole_curves(own) and not (gated or full)


def row_of_curve(contact: Contact, settings: Settings) -> dict[str, Any]:
    """Search one contact for its surface by the whole-curve fit, wherever it may be within.

    Raises
    ------
    RecordingError
        The probe never touches, or there is no free approach.
    """
    low, high = float(np.nanmin(contact.penetration)), float(np.nanmax(contact.penetration))
    # A tip that moves 60 µm through the air is pressed in by 0.1 µm: within an 80th of the range
    # from its end, which alone would be called its edge.
    span = low, high + (high - low) / 79.0
    chosen = {"surface_range": span, "offset_deviation": contact.tare_deviation}
    own = Settings(
        method=settings.method, estimator={**chosen, **settings.estimator}, diagnosis="none"
    )
    curve = Curves(
        contact.sample_time * np.arange(float(len(contact))),  # times of a segment begin anew
        contact.penetration[None],
        contact.force[None],
        contact.velocity[None],
        contact.source,
    )
    [row] = _together(curve, own, 1).to_pylist()
    if row["error"] is not None:
        raise RecordingError(row["error"])
    if settings.diagnosis == "input":
        row["findings"] = _in_words(contact, row["surface"])
    left_to_others = {*_NAMES, "method", "checked", "version", "settings"}
    row = {name: value for name, value in row.items() if name not in left_to_others}
    return {**row, "prepared": json.dumps(dict(contact.provenance), ensure_ascii=False)}


def identify_curves(curves: Curves, settings: Settings, *, threads: int = 1) -> "pa.Table":
    """Identify each of the curves: a table with a row for each, in their order.

    By the whole-curve fit where the settings allow that, else one by one by the recursion.

    Parameters
    ----------
    curves : Curves
        The contacts.
    settings : Settings
        How they are identified.
    threads : int
        That share the rows of the whole-curve fit.
    """
    if fits_whole_curves(settings):
        return _together(curves, settings, threads)
    columns = _named(curves, settings)
    for k in range(len(curves)):
        for name, value in _row(curves, k, settings).items():
            columns[name][k] = value
    return table_of(columns, settings)


def _row(curves: Curves, row: int, settings: Settings) -> dict[str, Any]:
    try:
        return {**row_of(curves.contact(row, settings), settings), "prepared": None}
    except Exception as error:
        return failure(error)


def _named(curves: Curves, settings: Settings) -> dict[str, Any]:
    """Columns of which nothing is known but which contacts they are of."""
    columns = empty_columns(settings, len(curves))
    columns["source"] = [curves.source] * len(curves)
    if curves.index is not None:
        columns["index"] = curves.index
    return columns | curves.places


def _together(curves: Curves, settings: Settings, threads: int) -> "pa.Table":
    curves = curves.known()
    chosen = {name: settings.estimator[name] for name in _SHARED if name in settings.estimator}
    if not settings.searches_surface and "surface_deviation" not in chosen:
        chosen["surface_deviation"] = resolutions_of(curves.penetration, threads=threads)
    rejects = settings.estimator.get("outlier_rejection") is not False
    fits, kept, left_out = fitted(curves, chosen, rejects=rejects, threads=threads)
    columns = _named(curves, settings)
    columns |= _numbers(fits)
    columns |= _at_depths(kept, fits, threads)
    columns["samples"] = _samples(curves)
    columns["taken"] = fits.taken
    columns["fit"] = ["whole-curve"] * len(curves)
    columns["flags"] = _flags(fits, left_out)
    errors = _errors(curves, fits, settings)
    for k, error in errors.items():
        for name, values in columns.items():
            if isinstance(values, np.ndarray) and values.dtype == np.float64 and name not in "xyz":
                values[k] = np.nan
        columns["flags"][k] = columns["fit"][k] = columns["covariance"][k] = None
        columns["error"][k], columns["error_kind"][k] = str(error), type(error).__name__
    if settings.diagnosis == "input":
        for k in range(len(curves)):
            columns["findings"][k] = _findings(curves, k, settings, columns["surface"][k])
    return table_of(columns, settings)


def _samples(curves: Curves) -> NDArray[np.int64]:
    """How many samples of each are there."""
    whole = np.full(len(curves), curves.penetration.shape[1])
    with np.errstate(invalid="ignore"):  # a sum is not finite where one of its terms is not
        gaps = ~np.isfinite(curves.penetration.sum(axis=1) + curves.force.sum(axis=1))
    for k in np.flatnonzero(gaps).tolist():
        there = np.isfinite(curves.penetration[k]) & np.isfinite(curves.force[k])
        whole[k] = np.count_nonzero(there)
    return whole


def _numbers(fits: CurveFits) -> dict[str, Any]:
    errors = fits.standard_errors
    found: dict[str, Any] = {"residual": fits.noise}
    for k, name in enumerate(("stiffness", "damping", "exponent")):
        found[name] = getattr(fits, name).copy()
        found[f"{name}_standard_error"] = errors[:, k].copy()
    for k, name in ((3, "offset"), (4, "surface")):
        estimated = errors[:, k] > 0.0
        found[name] = np.where(estimated, getattr(fits, name), np.nan)
        found[f"{name}_standard_error"] = np.where(estimated, errors[:, k], np.nan)
    found["covariance"] = list(fits.covariance[:, :3, :3].reshape(-1, 9))
    return found


def _at_depths(curves: Curves, fits: CurveFits, threads: int) -> dict[str, Floats]:
    depth, largest = working_depths(curves.penetration, curves.force, fits, threads=threads)
    found: dict[str, Floats] = {"depth": depth, "largest_depth": largest}
    laws = LawsAtDepth.of(fits, depth)
    for name in AT_DEPTH:
        value, error = getattr(laws, name)
        found[f"{name}_at_depth"], found[f"{name}_at_depth_standard_error"] = value, error
    return found


def _flags(fits: CurveFits, left_out: NDArray[np.int64]) -> list[Any]:
    few = fits.taken < 30  # ten samples a parameter
    pulling, giving = fits.stiffness < 0.0, fits.damping < 0.0
    unsettled = fits.status == STATUS_WORDS.index("did not settle")
    flags: list[Any] = [ADVICE_OF[bits] for bits in fits.flags.tolist()]
    for k in np.flatnonzero(few | pulling | giving | unsettled | (left_out > 0)).tolist():
        more = [f"only {fits.taken[k]} samples in contact"] if few[k] else []
        more += [NEGATIVE_STIFFNESS] if pulling[k] else []
        more += [NEGATIVE_DAMPING] if giving[k] else []
        if unsettled[k]:
            more.append("the search for the least squares did not settle: others may fit better")
        if left_out[k]:
            count = int(left_out[k])
            more.append(count_of_outliers(count, count + int(fits.taken[k])))
        flags[k] = [*flags[k], *more]
    return flags


def _errors(curves: Curves, fits: CurveFits, settings: Settings) -> dict[int, RecordingError]:
    """Why some have no numbers: as :func:`palpate.identify` says it."""
    where = f"{curves.source}: " if curves.source else ""
    found = {k: RecordingError(f"{where}{words}") for k, words in curves.wrong_clocks().items()}
    for k in np.flatnonzero(fits.status == STATUS_WORDS.index("no contact")).tolist():
        found.setdefault(k, RecordingError(_why_nothing(curves, k)))
    if settings.searches_surface:
        above = (curves.penetration < fits.surface[:, None]).sum(axis=1)
        for k in np.flatnonzero(above < FEWEST_ABOVE).tolist():
            found.setdefault(
                k,
                RecordingError(
                    f"{where}the search for the surface needs the free approach: {above[k]} of "
                    f"{curves.penetration.shape[1]} samples lie above the best surface, "
                    f"{rounded(fits.surface[k], 3)} m, and at least {FEWEST_ABOVE} have to; record "
                    "from before the touch, or give the penetration from a known surface"
                ),
            )
    return found


def _why_nothing(curves: Curves, row: int) -> str:
    try:
        contact = curves.contact(row, Settings())
    except Exception as error:
        return str(error)
    return nothing_taken(contact, choose_gate(contact))


def _findings(curves: Curves, row: int, settings: Settings, surface: float) -> list[str]:
    try:
        contact = curves.contact(row, settings)
    except Exception as error:
        return [f"do-not-trust: file: {error}"]
    return _in_words(contact, surface)


def _in_words(contact: Contact, surface: float) -> list[str]:
    """What the checks say of the data, the penetration counted from the surface that was found."""
    if math.isfinite(surface):
        contact = replace(contact, penetration=contact.penetration - surface)
    return [in_words(each) for each in Data(contact).findings]
