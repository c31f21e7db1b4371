"""A contact and its trace as named columns, a row a sample."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status
from palpate.contact import Contact
from palpate.errors import RecordingError
from palpate.force_laws import ForceLaw
from palpate.recordings.recording import Recording
from palpate.trace import Trace

if TYPE_CHECKING:
    from palpate.identification import Identified

_CONTACT = {"time": "s", "penetration": "m", "velocity": "m/s", "force": "N"}
#: In a file, where they are found without being named.
FILE_NAMES = {
    "time": "time_s",
    "penetration": "penetration_m",
    "velocity": "velocity_m_s",
    "force": "force_N",
}


@dataclass(frozen=True, slots=True, eq=False)
class TraceColumns:
    """Columns of equal length.

    Attributes
    ----------
    columns : dict
        Arrays by name, in their order; ``status`` is text.
    units : dict
        Of those that have one.
    """

    columns: dict[str, NDArray[Any]]
    units: dict[str, str]


def trace_columns(result: "Identified") -> TraceColumns:
    """Return the contact, what was predicted of it, and the law after each sample.

    ``time``, ``penetration``, ``velocity``, ``force``, ``segment``, ``predicted_force`` (a priori),
    ``fitted_force`` (by the final law), ``status`` and ``validity_margin`` (condition 10), then
    each parameter of the law and its ``…_standard_error``, SI; NaN where a thinned trace has none.
    """
    contact, trace, law = result.contact, result.trace, result.law
    columns: dict[str, NDArray[Any]] = {name: getattr(contact, name) for name in _CONTACT}
    columns |= {
        "segment": contact.segment,
        "predicted_force": trace.predicted_force,
        "fitted_force": result.fitted_force,
        "status": _names()[trace.status],
        "validity_margin": trace.validity_margin,
    }
    units = {**_CONTACT, "predicted_force": "N", "fitted_force": "N"}
    for k, (name, unit) in enumerate(zip(law.names(), law.units, strict=True)):
        for column, values in (
            (name, trace.parameters),
            (f"{name}_standard_error", trace.standard_errors),
        ):
            columns[column] = trace.everywhere(values[:, k])
            units |= {column: unit} if unit else {}
    return TraceColumns(columns, units)


def in_file(table: TraceColumns) -> TraceColumns:
    """The same columns by the names that they have in a file."""
    columns = {FILE_NAMES.get(name, name): values for name, values in table.columns.items()}
    units = {FILE_NAMES.get(name, name): unit for name, unit in table.units.items()}
    return TraceColumns(columns, units)


def contact_and_trace(recording: Recording, law: type[ForceLaw]) -> tuple[Contact, Trace]:
    """Return what :func:`trace_columns` made columns of, read from a file.

    Raises
    ------
    RecordingError
        A column is not there, or holds what it cannot.
    """
    time, penetration, velocity, force = map(recording.numbers, FILE_NAMES.values())
    names = law.names()
    texts = recording.channels.get("status", np.empty(0, dtype=str)).astype(str)
    known = {str(name): value for value, name in enumerate(_names())}
    if not set(texts.tolist()) <= set(known):
        raise RecordingError(f"{recording.source}: column 'status' names what is no status")
    parameters = np.column_stack([recording.numbers(name) for name in names])
    errors = np.column_stack([recording.numbers(f"{name}_standard_error") for name in names])
    after = np.flatnonzero(np.isfinite(parameters).all(axis=1))  # as every estimate is
    trace = Trace(
        parameters[after],
        errors[after],
        recording.numbers("predicted_force"),
        recording.numbers("validity_margin"),
        np.array([known[text] for text in texts.tolist()], dtype=np.uint8),
        time[after],
        None if len(after) == len(time) else after,
    )
    if len(trace) != len(time):
        raise RecordingError(f"{recording.source}: there is no column 'status'")
    contact = Contact(
        time,
        penetration=penetration,
        velocity=velocity,
        force=force,
        segment=recording.numbers("segment"),
    )
    return contact, trace


def _names() -> NDArray[np.str_]:
    """Names of the statuses, in lower case, by their numbers."""
    names = {int(status.value): status.name.lower() for status in Status}
    return np.array([names.get(k, "") for k in range(max(names) + 1)])
