"""Processes beside the loop: how they begin, and how they are ended."""

import signal
import threading
import time
from collections.abc import Sequence
from multiprocessing.process import BaseProcess


def start(process: BaseProcess) -> None:
    """Start a process that Ctrl-C does not reach, from its first instruction on.

    A terminal sends it to every process in front; who started them ends them in order.
    """
    if threading.current_thread() is not threading.main_thread():  # which alone may say so
        process.start()
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, before)


def end(processes: Sequence[BaseProcess], patience: float) -> None:
    """Wait until they have ended, s; then end them, whether they listen or not."""
    until = time.monotonic() + patience
    for process in processes:
        process.join(max(until - time.monotonic(), 0.0))
    for process in processes:
        if process.is_alive():
            process.terminate()
            process.join(1.0)
        if process.is_alive():  # it does not listen
            process.kill()
            process.join()
