"""The whole-curve fit of contacts as arrays of equal length; and ``identify_many``.

:class:`palpate.OutlierRejection` compares each sample with earlier ones. In this module the whole
contact is known, so outliers are single samples that depart from their neighbours on both sides,
and forces at the end of the sensor's range.
"""

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, fields, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import FleetError, InvalidParameterError, RecordingError
from palpate.findings import Check, Finding
from palpate.fleet.rows import (
    Row,
    build_table,
    failure,
    finding_cell,
    identify_rows,
    indentation_row,
    place_in_notes,
    power_law_derivatives,
    table_of_rows,
)
from palpate.fleet.tasks import AUTO, DiagnosisDepth, Settings, Table, cores
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, HuntCrossley
from palpate.identification import checks
from palpate.identification.diagnosis import Data
from palpate.identification.quantities import indentation
from palpate.identification.replaying import resolve_estimator
from palpate.input.preparation import velocity as velocities
from palpate.input.preparation.gate import choose_gate
from palpate.input.preparation.preparing import prepare
from palpate.input.preparation.touch import find_load_transfer
from palpate.input.recordings.recording import Recording, printable
from palpate.method.contact import Contact, VelocityFilter
from palpate.method.estimators import ContactEstimator, VariableProjection
from palpate.method.estimators.batch_fit import CurveFits, fit_curves
from palpate.validation import Floats, Integers, Mask, frozen, number_in, real_array, whole_in


@frozen(eq=False)
class Curves:
    """Contacts of equal length, one row each; NaN marks a missing sample.

    Attributes
    ----------
    time : numpy.ndarray, shape (samples,) or (k, samples)
        s.
    penetration, force : numpy.ndarray, shape (k, samples)
        m and N.
    velocity : numpy.ndarray, shape (k, samples), optional
        m/s. Default: computed from the penetration.
    source : str
        Name of their source.
    index : numpy.ndarray of int64, shape (k,)
        Number of each contact in the source.
    places : dict
        Positions ``x``, ``y`` and ``z`` of the contacts, m, if known.
    filters : list of VelocityFilter, optional
        Filter that computed each row's velocity. Default: None, the velocity was recorded.
    """

    time: Floats
    penetration: Floats
    force: Floats
    velocity: Floats | None = None
    source: str = ""
    index: Integers | None = None
    places: dict[str, Floats] = field(default_factory=dict)
    filters: list[VelocityFilter] | None = None

    def __len__(self) -> int:
        return len(self.penetration)

    def clock(self, row: int) -> Floats:
        """Return the times of a row, s."""
        clock: Floats = self.time[row] if self.time.ndim == 2 else self.time
        return clock

    def add_velocities(self, threads: int = 1) -> "Curves":
        """Return the curves with a velocity, which is computed if it is missing."""
        if self.velocity is not None:
            return self
        with np.errstate(divide="ignore", invalid="ignore"):  # repeated times
            velocity, filters = velocities.velocities_of_rows(self.time, self.penetration, threads)
        return replace(self, velocity=velocity, filters=filters)

    def contact(self, row: int, settings: Settings) -> Contact:
        """Return a row as a contact, prepared according to the settings.

        Raises
        ------
        PalpateError
            It cannot be prepared.
        """
        x = self.penetration[row]
        f = self.force[row]
        t = self.clock(row)
        finite = np.isfinite(x) & np.isfinite(f) & np.isfinite(t)
        velocity = None if self.velocity is None else self.velocity[row][finite]
        contact = prepare(
            time=t[finite],
            penetration=x[finite],
            force=f[finite],
            velocity=velocity,
            source=self.source,
            **settings.preparation,
        )
        return (
            contact if self.filters is None else replace(contact, velocity_filter=self.filters[row])
        )

    def fit_approach(self, row: int, settings: Settings) -> indentation.Indentation:
        """Return the fit of a row's approach, which ends at its deepest sample.

        Raises
        ------
        RecordingError
            The force does not rise.
        """
        assert settings.tip is not None
        signals = self.penetration[row], self.force[row], None
        return indentation.fit_approach(
            *signals,
            settings.tip,
            settings.poisson_ratio,
            time=self.time[row] if self.time.ndim == 2 else self.time,
            source=self.source,
        )


def fit_and_reject(
    curves: Curves,
    chosen: dict[str, Any],
    *,
    rejects: bool,
    threads: int,
) -> tuple[CurveFits, Curves, Integers]:
    """Fit curves with velocities; return fits, fitted curves, and numbers of excluded samples.

    Parameters
    ----------
    curves : Curves
        The contacts.
    chosen : dict
        Options of :func:`palpate.method.estimators.batch_fit.fit_curves`.
    rejects : bool
        Whether to exclude outliers.
    threads : int
        Number of threads that share the rows.
    """
    force = curves.force.copy()
    marks = np.zeros(curves.force.shape, dtype=np.bool_)
    signals: list[Any] = [curves.penetration, curves.velocity, force]
    if rejects:  # single samples that depart from their neighbours
        for values in signals:
            marks |= velocities.spikes_of_rows(values, screened=True, threads=threads)
        force[marks] = np.nan
    fits = fit_curves(*signals, threads=threads, **chosen)
    if rejects:
        ends = _find_saturated_samples(curves, force, fits)
        force[ends] = np.nan
        rows = np.flatnonzero(ends.any(axis=1))
        options: dict[str, Any] = {
            k: v[rows] if isinstance(v, np.ndarray) else v for k, v in chosen.items()
        }
        refits = fit_curves(*(values[rows] for values in signals), threads=threads, **options)
        for each in fields(fits):
            getattr(fits, each.name)[rows] = getattr(refits, each.name)
        marks |= ends
    return fits, replace(curves, force=force), np.count_nonzero(marks, axis=1)


def _find_saturated_samples(curves: Curves, force: Floats, fits: CurveFits) -> Mask:
    """Mark forces at the end of the sensor's range, where at least five equal the row's highest."""
    saturated = np.zeros(force.shape, dtype=np.bool_)
    with np.errstate(invalid="ignore"):
        highest = np.fmax.reduce(force, axis=1, initial=-np.inf)
        often = (force == highest[:, None]).sum(axis=1) >= 5
    for row in np.flatnonzero(often & np.isfinite(fits.K)).tolist():
        assert curves.velocity is not None
        below = curves.penetration[row] - fits.surface[row]
        motion = curves.clock(row), below, curves.velocity[row]
        end = _core.end_of_range(*motion, force[row], fits.law(row).parameters.tolist())
        saturated[row] = force[row] == end
    return saturated


# Contacts of equal length as arrays: in one whole-curve fit, or one after another in the recursion.

#: Settings that variable projection and the whole-curve fit share.
_SHARED = (
    "surface", "surface_range", "exponent", "exponent_range", "offset", "offset_deviation",
    "surface_deviation", "noise", "scale",
)  # fmt: skip


def fits_whole_curves(settings: Settings) -> bool:
    """Whether the whole-curve fit supports these settings."""
    plain = set(settings.preparation) <= {"surface"}
    return (
        plain
        and settings.preparation.get("surface") in (None, "estimate")
        and settings.of_curves.method == VariableProjection.method
        and settings.diagnosis != "full"
        and settings.minimum_penetration is None
        and settings.minimum_force is None
        and set(settings.estimator) <= {*_SHARED, "outlier_rejection"}
    )


def identify_curves(
    curves: Curves,
    settings: Settings,
    *,
    threads: int = 1,
) -> tuple[Table, Floats]:
    """Identify curves; return a table of one row each, in order, and the time of each row, s.

    With a tip each is a force curve. Else the whole-curve fit is used if it supports the settings,
    else the recursion, one curve at a time.

    Parameters
    ----------
    curves : Curves
        The contacts.
    settings : Settings
        The settings of the identification.
    threads : int
        Number of threads of the whole-curve fit. Default: 1.
    """
    count = len(curves)
    begun = perf_counter()
    if settings.tip is None and fits_whole_curves(settings):
        table = _fit_whole_curves(curves, settings, threads)
        return table, np.full(count, (perf_counter() - begun) / max(count, 1))
    columns = {"prepared": [None] * count, **_source_columns(curves)}
    rows = ({name: values[k] for name, values in columns.items()} for k in range(count))
    prepared = curves.contact if settings.tip is None else curves.fit_approach
    contacts = (partial(prepared, k, settings) for k in range(count))
    return identify_each(zip(rows, contacts, strict=True), settings, curves=True)


#: Columns known beforehand, and one of: the contact, its recording, the fit of a force curve, a
#: function that returns one of them, or the exception that prevents it.
Given: TypeAlias = tuple[Row, Any]


def identify_each(
    contacts: Iterable[Given],
    settings: Settings,
    *,
    curves: bool = False,
) -> tuple[Table, Floats]:
    """Identify contacts one by one; return a table of one row each, or per place, and their times.

    Parameters
    ----------
    contacts : iterable of (dict, object)
        Columns known beforehand, and the contact or its source.
    settings : Settings
        The settings of preparation and identification.
    curves : bool
        Whether these are curves of an array or a force map, for which Hunt–Crossley is the default
        law. Default: False.
    """
    rows = []
    seconds = []
    begun = perf_counter()
    by = settings.of_curves if curves else settings
    for known, given in contacts:
        try:
            if isinstance(given, Exception):
                raise given
            given = given() if callable(given) else given
            if isinstance(given, Recording):
                known = {**place_in_notes(given.notes), **known}
            new = [*_identify_given(given, settings, by)]
            if not new:
                raise FleetError("the probe travels, but no place lies in the time window")
        except Exception as error:
            new = [failure(error)]
        rows += [{**row, **known} for row in new]
        spent = perf_counter() - begun
        begun = perf_counter()
        seconds += [spent / len(new)] * len(new)
    return table_of_rows(rows, settings), np.array(seconds)


def _identify_given(given: Any, settings: Settings, by: Settings) -> Iterator[Row]:
    """Yield the rows of a contact, a recording or the fit of a force curve."""
    if isinstance(given, Recording):
        curve = None if settings.tip is None else indentation.read_force_curve(given)
        if curve is not None and settings.tip is not None:
            fixed = settings.estimator.keys() & {"exponent", "surface"}
            indentation.refuse_options(fixed | settings.preparation.keys())
            given = indentation.fit_force_curve(curve, settings.tip, settings.poisson_ratio)
    if isinstance(given, indentation.Indentation):
        yield indentation_row(given, settings)
        return
    contact = given if isinstance(given, Contact) else prepare(given, **settings.preparation)
    yield from identify_rows(contact, by, columns=settings.law)


def _source_columns(curves: Curves) -> dict[str, Any]:
    """Return source, index and position columns."""
    index = {} if curves.index is None else {"index": curves.index}
    return {"source": [curves.source] * len(curves), **index, **curves.places}


def _fit_whole_curves(curves: Curves, settings: Settings, threads: int) -> Table:
    curves = curves.add_velocities(threads)
    chosen = {name: settings.estimator[name] for name in _SHARED if name in settings.estimator}
    if not settings.searches_surface and "surface_deviation" not in chosen:
        resolutions = np.empty(len(curves))
        _core.resolutions(curves.penetration, resolutions, threads)
        chosen["surface_deviation"] = resolutions
    rejects = settings.estimator.get("outlier_rejection") is not False
    elsewhere: dict[int, Finding] = {}
    if rejects:
        curves, elsewhere = _exclude_load_transfer(curves)
    fits, fitted_curves, left_out = fit_and_reject(curves, chosen, rejects=rejects, threads=threads)
    columns = {**_source_columns(curves), **_numbers(fits, settings.law)}
    columns |= _evaluate_at_depths(fitted_curves, fits, threads)
    finite = np.isfinite(curves.penetration) & np.isfinite(curves.force)
    columns["samples"] = np.count_nonzero(finite, axis=1)
    columns["taken"] = fits.taken
    columns["fit"] = ["whole-curve"] * len(curves)
    columns["method"] = [VariableProjection.method] * len(curves)
    columns["law_name"] = [HuntCrossley.kind] * len(curves)
    columns["frequency"] = _frequencies(fitted_curves, fits)
    creating = _energy_creating_rows(curves, fits, columns)
    checked = checks.check_fits(fits, left_out, creating)
    columns["flags"] = [[*map(finding_cell, findings)] for findings in checked]
    columns["error"] = [None] * len(curves)
    columns["error_kind"] = [None] * len(curves)
    for k, error in _errors(curves, fits, settings).items():
        for name, values in columns.items():
            if isinstance(values, np.ndarray) and values.dtype == np.float64 and name not in "xyz":
                values[k] = np.nan
        for name in ("flags", "fit", "covariance", "law_name"):
            columns[name][k] = None
        columns["error"][k] = error
        columns["error_kind"][k] = RecordingError.__name__
    if settings.diagnosis == "input":
        surfaces = enumerate(columns["surface"].tolist())
        columns["findings"] = [
            _describe_faults(_try_contact(curves, k, settings), d) for k, d in surfaces
        ]
        for k, finding in elsewhere.items():
            columns["findings"][k].append(finding_cell(finding))
    return build_table(columns, len(curves), settings)


def _exclude_load_transfer(curves: Curves) -> tuple[Curves, dict[int, Finding]]:
    """Return the curves without load transfer, and the finding of each row that has some."""
    assert curves.velocity is not None
    force = curves.force.copy()
    findings = {}
    segment = np.zeros(force.shape[1], dtype=np.int64)
    for k, channels in enumerate(zip(curves.penetration, curves.velocity, force, strict=True)):
        if (transfer := find_load_transfer(*channels, segment)) is not None:
            force[k, transfer[0]] = np.nan
            findings[k] = transfer[1]
    return replace(curves, force=force), findings


def _energy_creating_rows(
    curves: Curves,
    fits: CurveFits,
    columns: Mapping[str, Floats],
) -> Mask:
    """Mark the rows whose negative damping creates energy, as in :func:`palpate.identify`."""
    creating = np.zeros(len(curves), dtype=np.bool_)
    rows = np.flatnonzero(fits.B < 0.0)
    if not rows.size or curves.velocity is None:
        return creating
    names = ("damping", "damping_standard_error", "force")
    inside = curves.penetration[rows] > fits.surface[rows, None]
    with np.errstate(all="ignore"):
        squares = np.where(inside, np.nan_to_num(curves.velocity[rows]) ** 2, 0.0)
        speed = np.sqrt(squares.sum(axis=1) / inside.sum(axis=1))
        damping, error, force = (columns[name][rows] for name in names)
        creating[rows] = checks.creates_energy(damping, error, force, speed)
    return creating


def _frequencies(curves: Curves, fits: CurveFits) -> Floats:
    """Return rms speed over rms distance from the mean depth, in contact, rad/s; else NaN."""
    assert curves.velocity is not None
    with np.errstate(invalid="ignore"):
        inside = curves.penetration > fits.surface[:, None]
        inside &= np.isfinite(curves.velocity) & np.isfinite(curves.force)
    with np.errstate(all="ignore"):
        count = inside.sum(axis=1)
        depth = np.where(inside, curves.penetration, 0.0)
        depth = np.where(inside, depth - (depth.sum(axis=1) / count)[:, None], 0.0)
        speed = np.where(inside, curves.velocity, 0.0)
        squares = np.array([np.square(each).sum(axis=1) for each in (speed, depth)])
        frequencies = np.sqrt(squares[0] / squares[1])
    return np.where(np.isfinite(frequencies) & (frequencies > 0.0), frequencies, np.nan)


def _numbers(fits: CurveFits, law: type[ForceLaw]) -> dict[str, Any]:
    errors = fits.standard_errors
    columns: dict[str, Any] = {"residual": fits.noise}
    for k, name in enumerate(HuntCrossley.names()):
        columns[name] = getattr(fits, name).copy()
        columns[f"{name}_standard_error"] = errors[:, k].copy()
    for k, name in ((3, "offset"), (4, "surface")):
        estimated = errors[:, k] > 0.0
        columns[name] = np.where(estimated, getattr(fits, name), np.nan)
        columns[f"{name}_standard_error"] = np.where(estimated, errors[:, k], np.nan)
    covariance = fits.covariance[:, :3, :3]
    if law is GeneralisedHuntCrossley:  # K, n, B, p = n and M = 0
        for end in ("", "_standard_error"):
            columns[f"p{end}"] = columns[f"n{end}"].copy()
            columns[f"M{end}"] = np.where(fits.taken > 0, 0.0, np.nan)
        to_columns = power_law_derivatives(HuntCrossley)
        covariance = to_columns @ covariance @ to_columns.T
    columns["covariance"] = list(covariance.reshape(len(covariance), -1))
    return columns


def _evaluate_at_depths(curves: Curves, fits: CurveFits, threads: int) -> dict[str, Floats]:
    """Return F = K xⁿ, S = n K xⁿ⁻¹, C = B xⁿ at x = X − d, X the median position of firm contact.

    At this depth an error of the surface d changes them as little as it changes the force. Firm
    contact follows from the gate of :func:`palpate.choose_gate`, as in :func:`palpate.identify`; it
    depends on the noise, not on the fit's residuals. NaN without firm contact.
    """
    depths = np.empty((len(curves), 2))
    _core.working_depths(curves.penetration, curves.force, fits.surface, depths, threads)
    depth, largest = depths.T.copy()
    columns = {"depth": depth, "largest_depth": largest}
    with np.errstate(all="ignore"):
        k = fits.K
        c = fits.B
        n = fits.n
        power = depth**n
        log = np.log(depth)
        none = np.zeros_like(depth)
        force = k * power
        damping = c * power
        stiffness = n * force / depth
        bend = (n - 1.0) * stiffness / depth
        slope = [n * power / depth, none, (1.0 / n + log) * stiffness, none, -bend]
        for name, value, gradient in (
            ("force", force, [power, none, log * force, none, -stiffness]),
            ("stiffness", stiffness, slope),
            ("damping", damping, [none, power, log * damping, none, -n * damping / depth]),
        ):
            g = np.stack(gradient, axis=1)  # with respect to K, B, n, F₀ and d
            variance = np.einsum("ki,kij,kj->k", g, fits.covariance, g)
            columns[name] = value
            columns[f"{name}_standard_error"] = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return columns


def _errors(curves: Curves, fits: CurveFits, settings: Settings) -> dict[int, str]:
    """Return the errors of rows without numbers, in the words of :func:`palpate.identify`."""
    where = f"{curves.source}: " if curves.source else ""
    errors = {}
    if settings.searches_surface:
        above = (curves.penetration < fits.surface[:, None]).sum(axis=1)
        for k in np.flatnonzero(above < checks.FEWEST_ABOVE).tolist():
            samples = curves.penetration.shape[1]
            errors[k] = where + checks.no_approach(above[k], samples, fits.surface[k])
    for k in np.flatnonzero(fits.where_status("no contact")).tolist():
        contact = _try_contact(curves, k, Settings())
        if isinstance(contact, str):
            errors[k] = contact
        else:
            errors[k] = where + checks.no_contact_message(contact, choose_gate(contact))
    with np.errstate(invalid="ignore"):
        uneven = ~(np.diff(np.atleast_2d(curves.time), axis=1) > 0.0).all(axis=1)
    for k in np.flatnonzero(np.broadcast_to(uneven, len(curves))).tolist():
        contact = _try_contact(curves, k, Settings())
        if isinstance(contact, str):
            errors[k] = f"{where}{contact}"
    return errors


def _try_contact(curves: Curves, row: int, settings: Settings) -> Contact | str:
    """Return a row as a contact, or the message of the error that prevents it."""
    try:
        return curves.contact(row, settings)
    except Exception as error:
        return str(error)


def _describe_faults(contact: Contact | str, surface: float) -> list[dict[str, str | None]]:
    """Return the findings on the data, with penetration measured from the identified surface."""
    if isinstance(contact, str):
        return [finding_cell(Finding(Check.FILE, contact, severity="do-not-trust"))]
    if math.isfinite(surface):
        contact = replace(contact, penetration=contact.penetration - surface)
    return [finding_cell(finding) for finding in Data(contact).findings]


# Many contacts in this process: one row each.


def identify_many(
    contacts: Iterable[Any] | None = None,
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
) -> Table:
    """Identify many contacts; return a table with one row each.

    Pass contacts of equal length as arrays: the default method then fits all of them in one call of
    :func:`palpate.fit_curves`, hundreds of times faster. Other methods run their recursion, one
    contact at a time.

    Parameters
    ----------
    contacts : iterable of Contact, Recording, path or frame, optional
        Inputs of :func:`identify`. Default: none; pass arrays instead.
    method : ContactEstimator or str, optional
        Name of the method, or an estimator with its settings, such as
        ``VariableProjection(surface="estimate")``. Default: for contacts the default of
        :func:`identify`, which selects the law; for arrays :class:`VariableProjection`.
    diagnosis : "none", "input" or "full"
        ``"input"`` (default) checks the data; ``"full"`` also checks the fits and gives each
        contact a verdict, which needs the recursion, one contact at a time.
    penetration, force : array_like, shape (k, samples), optional
        m and N, one row per contact; NaN marks a missing sample.
    velocity : array_like, shape (k, samples), optional
        m/s. Default: computed from the penetration.
    time : array_like, shape (samples,) or (k, samples), optional
        s. Required with arrays, or ``sample_time``.
    sample_time : float, optional
        Time between samples, s, > 0.
    places : mapping, optional
        Positions ``x``, ``y`` and ``z`` of the contacts on the material, m, shape (k,).
    preparation : mapping, optional
        Options for :func:`prepare`, such as ``{"tare": "find"}``. Default: none.
    source : str
        Name of the arrays' source in the rows. Default: "".
    threads : int, optional
        Number of threads of the whole-curve fit. Default: one per core.

    Returns
    -------
    pyarrow.Table
        Law, errors, working depth, offset, surface, flags, findings and provenance, with units in
        the columns' metadata; NaN or null for unknown values. A contact that cannot be identified
        is a row with the reason in ``error``. ``docs/reference/formats.md`` lists the columns.

    Raises
    ------
    InvalidParameterError
        Neither contacts nor arrays were passed, or both; arrays differ in shape; or a setting is
        outside its range.
    MissingExtraError
        pyarrow is not installed.

    Examples
    --------
    >>> import palpate
    >>> files = [f"examples/recordings/{name}.csv" for name in ("ball", "sponge")]
    >>> table = palpate.identify_many(files)
    >>> [round(stiffness, -1) for stiffness in table["stiffness"].to_pylist()]  # N/m
    [2000.0, 300.0]
    """
    chosen = resolve_estimator(VariableProjection() if method is None else method)
    usual = type(chosen)().settings
    settings = Settings(
        method=AUTO if method is None and contacts is not None else chosen.method,
        estimator={name: each for name, each in chosen.settings.items() if each != usual[name]},
        diagnosis=diagnosis,
        preparation=dict(preparation or {}),
    )
    arrays = {"penetration": penetration, "force": force}
    given = [name for name, values in arrays.items() if values is not None]
    if contacts is not None and given:
        raise InvalidParameterError(f"pass either contacts or arrays, not contacts and {given[0]}")
    if contacts is not None:
        return identify_each(_number_contacts(contacts), settings)[0]
    if len(given) < len(arrays):
        raise InvalidParameterError("pass contacts, or the arrays penetration and force")
    curves = _curves(penetration, force, velocity, time, sample_time, places or {}, source)
    count = cores() if threads is None else whole_in("threads", threads, 1, 1024)
    return identify_curves(curves, settings, threads=count)[0]


def _number_contacts(contacts: Iterable[Any]) -> Iterator[Given]:
    for number, contact in enumerate(contacts):
        source = contact.source if isinstance(contact, Contact | Recording) else None
        if isinstance(contact, str | os.PathLike):
            source = printable(Path(contact))
        yield {"index": number, "source": source or None}, contact


def _curves(
    penetration: "ArrayLike | None",
    force: "ArrayLike | None",
    velocity: "ArrayLike | None",
    time: "ArrayLike | None",
    sample_time: float | None,
    places: Mapping[str, "ArrayLike"],
    source: str,
) -> Curves:
    x = real_array("penetration", penetration)  # type: ignore[arg-type]  # not None
    f = real_array("force", force)  # type: ignore[arg-type]
    v = None if velocity is None else real_array("velocity", velocity)
    wrong = [each.shape for each in (f, v) if each is not None and each.shape != x.shape]
    if x.ndim != 2 or wrong:
        raise InvalidParameterError(
            "penetration, force and velocity must have the same shape (contacts, samples), not "
            f"{x.shape}{f' and {wrong[0]}' if wrong else ''}"
        )
    if (time is None) == (sample_time is None):
        raise InvalidParameterError("arrays need either time or sample_time")
    clock: Floats
    if sample_time is not None:
        step = number_in("sample_time", sample_time, 0.0, 1e6, open_low=True)
        clock = step * np.arange(float(x.shape[1]))
    else:
        clock = real_array("time", time)  # type: ignore[arg-type]
        if clock.shape not in (x.shape, x.shape[1:]):
            raise InvalidParameterError(
                f"time must have the shape {x.shape[1:]} or {x.shape}, not {clock.shape}"
            )
    where = {axis: real_array(axis, values) for axis, values in places.items()}
    for axis, values in where.items():
        if axis not in ("x", "y", "z") or values.shape != x.shape[:1]:
            raise InvalidParameterError(
                f"places may have x, y and z, each of shape {x.shape[:1]}, not {axis} of shape "
                f"{values.shape}"
            )
    return Curves(clock, x, f, v, source, np.arange(len(x), dtype=np.int64), where)
