"""Tables as text: a header line, then a sample a row; read a block at a time, and written."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.errors import MissingChannelError, RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.recording import Faults, Recording
from palpate.recordings.text.columns import Ignored, Times
from palpate.recordings.text.filling import Filling
from palpate.recordings.text.layout import Layout
from palpate.recordings.text.times import epoch_of, is_timelike, joined_stamps
from palpate.writing import write_text


def read(path: Path, request: Request) -> Recording:
    """Read a table of text: CSV, TSV and what is like them, gzip or not.

    The delimiter (comma, semicolon, tab, bar, or spaces), the decimal mark, the encoding and what
    each column holds are found. Cells that hold no number in a column of numbers are NaN, and
    counted in ``Recording.faults``; rows that cannot be read are left out, as
    ``Recording.losses`` says. Columns of the same name are distinguished by their position:
    ``force_N (column 3)``.

    Parameters
    ----------
    path : Path
        The file.
    request : Request
        What is asked for.

    Raises
    ------
    RecordingError
        The file cannot be read, is no text, or has no header; or ``strict`` is asked for and a row
        cannot be read.
    """
    filling = Filling(path, request, {})
    layout = filling.run()
    kinds = {column.name: kind for column in filling.columns if (kind := column.mistaken())}
    if kinds:  # a column began with words and went on with numbers, or the other way round
        filling = Filling(path, request, kinds)
        layout = filling.run()
    return _recording(filling, layout, request)


def _recording(filling: Filling, layout: Layout, request: Request) -> Recording:
    channels: dict[str, NDArray[Any]] = {}
    faults: dict[str, Faults] = {}
    units: dict[str, str] = {}
    for column in filling.columns:
        faults |= column.faults()
        made = column.channels()
        channels |= made
        if column.name in layout.units:
            units |= dict.fromkeys(made, layout.units[column.name])
        elif isinstance(column, Times):
            units[column.name] = "ns"
    for name, values in channels.items():
        found = epoch_of(values) if is_timelike(name) else None
        if found is not None and units.setdefault(name, found[0]) == found[0]:
            channels[name] = found[1]
    joined = joined_stamps(channels)
    channels |= joined
    units |= dict.fromkeys(joined, "ns")
    wanted = {name: values for name, values in channels.items() if request.wants(name)}
    if request.channels and not wanted:
        raise MissingChannelError(request.channels[0], layout.header, filling.source)
    rows = filling.rows.all()
    losses = filling.losses.sentences()
    if losses and not len(rows):
        raise RecordingError(f"{filling.source}: no row of it can be read: {losses[0]}")
    ignored = [column.name for column in filling.columns if isinstance(column, Ignored)]
    if filling.text.encoding != "utf-8":
        layout.notes["encoding"] = filling.text.encoding.upper().replace("WINDOWS", "Windows")
    return Recording(
        wanted,
        units={name: unit for name, unit in units.items() if name in wanted},
        source=filling.source,
        notes=layout.notes,
        rows=rows,
        faults=faults,
        losses=losses,
        omissions=[f"columns that were not asked for: {', '.join(ignored)}"] if ignored else [],
    )


def write_contact(
    contact: Contact,
    path: str | Path,
    notes: Mapping[str, str] | None = None,
    *,
    velocity: bool = False,
) -> None:
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`palpate.lab.Bench.run`. Several segments get a column.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head, before those of the contact's ``provenance``.
    velocity : bool
        Write the velocity too. Most rigs record none, and it is worked out when it is needed.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.provenance}
    if not velocity:
        head.pop("velocity", None)
    columns = {"time_s": (contact.time, "%.9g"), "penetration_m": (contact.penetration, "%.7g")}
    if velocity:
        columns["velocity_m_s"] = contact.velocity, "%.7g"
    columns["force_N"] = contact.force, "%.7g"
    if contact.segment[-1:].any():
        columns["segment"] = (contact.segment + 1).astype(np.float64), "%d"
    text = io.StringIO()
    for name, words in head.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write(",".join(columns) + "\n")
    table = np.column_stack([values for values, _ in columns.values()])
    np.savetxt(text, table, fmt=[form for _, form in columns.values()], delimiter=",")
    write_text(Path(path), text.getvalue())
