"""Recordings made by the laboratory, as files."""

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.contact import Contact
from palpate.writing import write_text


def write(
    contact: Contact,
    path: str | Path,
    notes: Mapping[str, str] | None = None,
    *,
    velocity: bool = False,
) -> None:
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    ``palpate.read_contact`` gives back the notes in ``made``, among them the truth.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`Bench.run`. Where it has several segments, they get a column.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head.
    velocity : bool
        Write the velocity too. Most rigs record none, and a reader works it out.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.made}
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
