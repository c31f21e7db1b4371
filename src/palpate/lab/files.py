"""Recordings made by the laboratory, as files."""

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.contact import Contact
from palpate.files import write_text


def write(contact: Contact, path: str | Path, notes: Mapping[str, str] | None = None) -> None:
    """Write a contact as CSV, whole or not at all, with what is known of it above the header.

    ``palpate.read_contact`` gives back the notes in ``made``, among them the truth.

    Parameters
    ----------
    contact : Contact
        For instance of :meth:`Bench.run`; its velocity is not written, as no rig records it.
    path : str or Path
        The file.
    notes : mapping, optional
        Further lines for its head.

    Raises
    ------
    RecordingError
        The path cannot be written.
    """
    head = {**(notes or {}), **contact.made}
    head.pop("velocity", None)
    text = io.StringIO()
    for name, words in head.items():
        text.write(f"# {name}: {' '.join(words.split())}\n")
    text.write("time_s,penetration_m,force_N\n")
    columns = np.column_stack([contact.time, contact.penetration, contact.force])
    np.savetxt(text, columns, fmt=("%.9g", "%.7g", "%.7g"), delimiter=",")
    write_text(Path(path), text.getvalue())
