"""Contacts of equal length, as arrays.

Contacts as arrays through the whole-curve fit, without samples that no material can have made.

:class:`palpate.OutlierRejection` compares each sample with what came before it; here the whole
contact is there, so single samples that leave their neighbours on both sides are found, and forces
at the end of the sensor's range.
"""

import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.contact import Contact
from palpate.diagnosis import Data
from palpate.diagnosis.diagnosing import count_of_outliers
from palpate.digits import rounded
from palpate.errors import InvalidParameterError, PalpateError, RecordingError
from palpate.estimators import ContactEstimator
from palpate.estimators.curves import STATUS_WORDS, CurveFits, fit_curves
from palpate.estimators.estimate import ADVICE
from palpate.fleet.rows import (
    AT_DEPTH,
    LawsAtDepth,
    Row,
    empty_columns,
    failure,
    in_words,
    row_of,
    rows_of,
    table_of,
    table_of_rows,
    working_depths,
)
from palpate.fleet.tasks import DiagnosisDepth, Settings, cores
from palpate.identification.identified import (
    FEWEST_ABOVE,
    NEGATIVE_DAMPING,
    NEGATIVE_STIFFNESS,
    nothing_taken,
)
from palpate.preparation.gates import choose_gate, resolutions_of
from palpate.preparation.preparing import Recorded, prepare
from palpate.preparation.velocity import spikes_of_rows, step_of, velocity_of
from palpate.validation import Floats, number_in, real_array, shown, whole_in

if TYPE_CHECKING:
    import pyarrow as pa

# What the bits of an estimate's flags say, for each of their combinations.
_ADVICE_OF = [tuple(words for bit, words in ADVICE.items() if bits & bit) for bits in range(256)]


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Contacts of equal length, one row each; NaN marks a sample that is not there.

    Attributes
    ----------
    time : numpy.ndarray, shape (samples,) or (k, samples)
        s.
    penetration, force : numpy.ndarray, shape (k, samples)
        m and N.
    velocity : numpy.ndarray, shape (k, samples), optional
        m/s; worked out from the penetration where it is not given.
    source : str
        Where they are from.
    index : numpy.ndarray of int64, shape (k,)
        Which contact of the source each is.
    places : dict
        ``x``, ``y`` and ``z`` of each, m, where they are known.
    """

    time: Floats
    penetration: Floats
    force: Floats
    velocity: Floats | None = None
    source: str = ""
    index: NDArray[np.int64] | None = None
    places: dict[str, Floats] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.penetration)

    def clock(self, row: int) -> Floats:
        """The times of a row, s."""
        clock: Floats = self.time[row] if self.time.ndim == 2 else self.time
        return clock

    def known(self) -> "Curves":
        """The same, with a velocity for each row."""
        if self.velocity is not None:
            return self
        with np.errstate(divide="ignore", invalid="ignore"):  # of times that stand still
            rows = [velocity_of(self.clock(k), x) for k, x in enumerate(self.penetration)]
        velocity = np.array(rows).reshape(self.penetration.shape)
        return Curves(
            self.time, self.penetration, self.force, velocity, self.source, self.index, self.places
        )

    def wrong_clocks(self) -> dict[int, str]:
        """Which rows have times that do not increase from sample to sample, and where."""
        there = np.isfinite(self.penetration) & np.isfinite(self.force)
        clocks = np.atleast_2d(self.time)
        with np.errstate(invalid="ignore"):
            even = (np.diff(clocks, axis=1) > 0.0).all(axis=1)
        found = {}
        for row in np.flatnonzero(~np.broadcast_to(even, len(self))).tolist():
            time = self.clock(row)[there[row]]
            wrong = np.flatnonzero(~(np.diff(time) > 0.0))
            if wrong.size:
                k = int(wrong[0])
                sample = int(np.flatnonzero(there[row])[k + 1])
                found[row] = (
                    "time must be finite and increase from sample to sample; sample "
                    f"{sample} is at {time[k + 1]:.6g} s, after {time[k]:.6g} s"
                )
        return found

    def contact(self, row: int, settings: Settings) -> Contact:
        """One of them as a contact, prepared as the settings say.

        Raises
        ------
        PalpateError
            It cannot be.
        """
        x, f, t = self.penetration[row], self.force[row], self.clock(row)
        there = np.isfinite(x) & np.isfinite(f) & np.isfinite(t)
        velocity = None if self.velocity is None else self.velocity[row][there]
        return prepare(
            time=t[there],
            penetration=x[there],
            force=f[there],
            velocity=velocity,
            source=self.source,
            **settings.preparation,
        )


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
        For :func:`palpate.estimators.curves.fit_curves`.
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


# Contacts of equal length as arrays: through the whole-curve fit, or the recursion one by one.

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
    flags: list[Any] = [_ADVICE_OF[bits] for bits in fits.flags.tolist()]
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


# Many contacts here, in this process: a row for each.


def identify_many(
    contacts: "Iterable[Contact | Recorded] | None" = None,
    *,
    method: ContactEstimator | str | None = None,
    diagnosis: DiagnosisDepth = "input",
    penetration: "ArrayLike | None" = None,
    force: "ArrayLike | None" = None,
    velocity: "ArrayLike | None" = None,
    time: "ArrayLike | None" = None,
    sample_time: float | None = None,
    places: Mapping[str, "ArrayLike"] | None = None,
    preparation: Mapping[str, Any] | None = None,
    source: str = "",
    threads: int | None = None,
) -> "pa.Table":
    """Identify many contacts: a table with a row for each.

    Contacts of equal length are best given as arrays: the default method then fits all of them at
    once, by the whole-curve fit of :func:`palpate.fit_curves`, hundreds of times as quick. Other
    methods go through their recursion, a contact at a time.

    Parameters
    ----------
    contacts : iterable of Contact, Recording, path or frame, optional
        As :func:`identify` takes one; arrays in place of them unless given.
    method : ContactEstimator or str, optional
        As for :func:`identify`: method and settings, such as
        ``VariableProjection(surface="estimate")``, or a name.
    diagnosis : "none", "input" or "full"
        ``"input"`` checks the data; ``"full"`` everything, with a verdict for each contact; that
        takes the recursion, a contact at a time.
    penetration, force : array_like, shape (k, samples), optional
        m and N, one row a contact; NaN marks a sample that is not there.
    velocity : array_like, shape (k, samples), optional
        m/s; worked out from the penetration unless given.
    time : array_like, shape (samples,) or (k, samples), optional
        s; or ``sample_time``.
    sample_time : float, optional
        Time between samples, s.
    places : mapping, optional
        ``x``, ``y`` and ``z``, where each of the rows is on the material, m, shape (k,).
    preparation : mapping, optional
        What :func:`prepare` is given beside each, such as ``{"tare": "find"}``.
    source : str
        Where arrays are from, for their rows.
    threads : int, optional
        That share the whole-curve fit of arrays (default: as many as there are cores).

    Returns
    -------
    pyarrow.Table
        Law, errors, working depth, offset, surface, flags, findings and provenance, with units in
        the columns' metadata; NaN or null where a thing is not known. What cannot be identified is
        a row with its reason in ``error``. ``docs/fleet.md`` has the columns.

    Raises
    ------
    InvalidParameterError
        Neither contacts nor arrays are given, or both; arrays differ in shape; or a setting is
        outside its range.
    MissingExtraError
        pyarrow is not installed.
    """
    settings = settings_of(method, diagnosis, preparation)
    arrays = {"penetration": penetration, "force": force}
    given = [name for name, values in arrays.items() if values is not None]
    if contacts is not None and given:
        raise InvalidParameterError(f"{given[0]} must not be given beside contacts")
    if contacts is not None:
        return table_of_rows(list(_rows(contacts, settings)), settings)
    if len(given) < len(arrays):
        raise InvalidParameterError("contacts must be given, or penetration and force as arrays")
    curves = _curves(penetration, force, velocity, time, sample_time, places or {}, source)
    count = cores() if threads is None else whole_in("threads", threads, 1, 1024)
    return identify_curves(curves, settings, threads=count)


def settings_of(
    method: ContactEstimator | str | None,
    diagnosis: DiagnosisDepth = "input",
    preparation: Mapping[str, Any] | None = None,
) -> Settings:
    """Return the settings of a fleet by an estimator as :func:`palpate.identify` takes it."""
    prepared = dict(preparation or {})
    if method is None or isinstance(method, str):
        name = "variable-projection" if method is None else method
        return Settings(method=name, diagnosis=diagnosis, preparation=prepared)
    if not isinstance(method, ContactEstimator):
        raise InvalidParameterError(
            f"method must be a ContactEstimator or its name, not {shown(method)}"
        )
    usual = type(method)().settings
    own = {name: value for name, value in method.settings.items() if value != usual[name]}
    return Settings(method=method.method, estimator=own, diagnosis=diagnosis, preparation=prepared)


def _rows(contacts: "Iterable[Contact | Recorded]", settings: Settings) -> "Iterable[Row]":
    for number, given in enumerate(contacts):
        named: Row = {"index": number}
        try:
            if not isinstance(given, Contact):
                named["source"] = str(given) if isinstance(given, str | os.PathLike) else None
                given = prepare(given, **settings.preparation)
            named["source"] = given.source or named.get("source")
            rows = [{**named, **row} for row in rows_of(given, settings)]
        except (PalpateError, ArithmeticError, LookupError, TypeError, ValueError) as error:
            rows = [{**named, **failure(error)}]
        yield from rows


def _curves(
    penetration: "ArrayLike | None",
    force: "ArrayLike | None",
    velocity: "ArrayLike | None",
    time: "ArrayLike | None",
    sample_time: float | None,
    places: Mapping[str, "ArrayLike"],
    source: str,
) -> Curves:
    x = real_array("penetration", penetration)  # type: ignore[arg-type]  # it was given
    f = real_array("force", force)  # type: ignore[arg-type]
    v = None if velocity is None else real_array("velocity", velocity)
    wrong = [each.shape for each in (f, v) if each is not None and each.shape != x.shape]
    if x.ndim != 2 or wrong:
        raise InvalidParameterError(
            "penetration, force and velocity must be of one shape, (contacts, samples), not "
            f"{x.shape}{f' and {wrong[0]}' if wrong else ''}"
        )
    if (time is None) == (sample_time is None):
        raise InvalidParameterError("one of time and sample_time must be given beside arrays")
    clock: Floats
    if sample_time is not None:
        step = number_in("sample_time", sample_time, 0.0, 1e6, open_low=True)
        clock = step * np.arange(float(x.shape[1]))
    else:
        clock = real_array("time", time)  # type: ignore[arg-type]
        if clock.shape not in (x.shape, x.shape[1:]):
            raise InvalidParameterError(
                f"time must be of the shape {x.shape[1:]} or {x.shape}, not {clock.shape}"
            )
    where = {axis: real_array(axis, values) for axis, values in places.items()}
    for axis, values in where.items():
        if axis not in ("x", "y", "z") or values.shape != x.shape[:1]:
            raise InvalidParameterError(
                f"places must be x, y and z, each of the shape {x.shape[:1]}, not {axis} of "
                f"{values.shape}"
            )
    return Curves(clock, x, f, v, source, np.arange(len(x), dtype=np.int64), where)
