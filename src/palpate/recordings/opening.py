"""From a file's suffix to the function that reads it."""

import os
from collections.abc import Callable
from pathlib import Path

from palpate.errors import InvalidParameterError
from palpate.recordings.csv import read_csv
from palpate.recordings.recording import Recording

#: The function that reads a file, by the suffix of its name. Any other suffix is read as CSV.
READERS: dict[str, Callable[[Path], Recording]] = {
    ".csv": read_csv,
}


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """Read a file as it is, by the reader that :data:`READERS` has for its suffix.

    Parameters
    ----------
    path : str or path-like
        The file. A suffix that is not known, or none, is read as CSV.

    Raises
    ------
    RecordingError
        The file cannot be read, or is not of the format that its suffix says.
    """
    try:
        file = Path(path)
    except TypeError:
        raise InvalidParameterError(f"path must be a path, not {path!r}") from None
    return READERS.get(file.suffix.lower(), read_csv)(file)
