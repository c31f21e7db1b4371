"""Processes beside the loop: how they begin, and how they are ended."""

import signal
import sys
import time
from collections.abc import Sequence
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess


def start(process: BaseProcess) -> None:
    """Start a process that Ctrl-C does not reach, from its first instruction on.

    A terminal sends it to every process in front; who started them ends them in order. It is
    held back meanwhile, and not ignored: one that comes during the start comes after it here.
    """
    if sys.platform == "win32":
        process.start()
        return
    resource_tracker.ensure_running()  # its own start would lift what is held back
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()  # a child begins with its parent's mask
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end(processes: Sequence[BaseProcess], patience: float) -> None:
    """Wait until they have ended, s; then end them, whether they listen or not."""
    until = time.monotonic() + patience
    try:
        for process in processes:
            process.join(max(until - time.monotonic(), 0.0))
    finally:  # of whoever asks a second time, too
        for process in processes:
            if process.is_alive():
                process.terminate()
                process.join(1.0)
            if process.is_alive():  # it does not listen
                process.kill()
                process.join()
