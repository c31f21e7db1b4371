"""The packages of the extra, imported where they are used."""

import os
from importlib import import_module
from typing import Any

from palpate.errors import MissingExtraError


def needed(name: str, what: str) -> Any:
    """Import a package of the extra ``fleet``.

    Parameters
    ----------
    name : str
        Of the module.
    what : str
        What takes it, for the message.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise MissingExtraError(f"{what} needs {package}: pip install 'palpate[fleet]'") from None


def line_of(error: Exception) -> str:
    """Return what a library says of an error, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
