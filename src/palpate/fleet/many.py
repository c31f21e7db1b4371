"""Many contacts here, in this process: a row for each."""

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.contact import Contact
from palpate.errors import InvalidParameterError, PalpateError
from palpate.estimators import ContactEstimator
from palpate.fleet.arrays import identify_curves
from palpate.fleet.columns import table_of_rows
from palpate.fleet.curves import Curves
from palpate.fleet.extras import cores
from palpate.fleet.rows import Row, failure, rows_of
from palpate.fleet.settings import DiagnosisDepth, Settings
from palpate.preparation.preparing import Recorded, prepare
from palpate.validation import Floats, number_in, real_array, shown, whole_in

if TYPE_CHECKING:
    import pyarrow as pa


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
    once, by the whole-curve fit of :func:`palpate.curves.fit_curves`, hundreds of times as quick.
    Other methods go through their recursion, a contact at a time.

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
