"""What palpate does, said on standard error while it does it."""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from palpate.errors import printable

_LEVELS = {1: logging.INFO, 2: logging.DEBUG}


class _Lines(logging.Handler):
    """A line for each record, above a progress bar where there is one."""

    def __init__(self) -> None:
        super().__init__()
        self._begun = time.perf_counter()

    def emit(self, record: logging.LogRecord) -> None:
        """Print it: seconds since the start, where it comes from, and what it says."""
        words = " ".join(record.getMessage().split())
        where = record.name.removeprefix("palpate.")
        line = printable(f"{time.perf_counter() - self._begun:7.3f} s  {where}: {words}")
        with suppress(OSError):  # there is nobody left to tell
            # Looked up each time: a bar takes its place for as long as it is shown.
            print(line, file=sys.stderr)


@contextmanager
def logged(loudness: int) -> Iterator[None]:
    """Print what palpate's modules say: at 1 what is done, at 2 how, too."""
    logger = logging.getLogger("palpate")
    handler, level = _Lines(), logger.level
    logger.addHandler(handler)
    logger.setLevel(_LEVELS[loudness])
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
