"""Printing where the loop was started, which nobody may hear any more."""

import os
import sys
from contextlib import suppress


def printed(words: str, end: str = "\n") -> bool:
    """Print at once; whether somebody hears it.

    Where nobody does, as the reader is gone or the disk is full, nothing more is tried: not on the
    way out either, where Python would complain.
    """
    try:
        print(words, end=end, flush=True)
    except (OSError, ValueError):
        with suppress(OSError, ValueError, AttributeError):  # it may have no descriptor
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)
        return False
    return sys.stdout is not None
