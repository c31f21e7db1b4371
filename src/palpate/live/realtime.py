"""Time for the loop: no collector in between, a fixed priority, memory that stays."""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PRIORITY = 50  # of 1 to 99: above all that is ordinary, below the kernel's own threads
_ALL_MEMORY = 1 | 2  # MCL_CURRENT | MCL_FUTURE, of sys/mman.h
_SET_TIMER_SLACK = 29  # PR_SET_TIMERSLACK, of linux/prctl.h


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the collector out of what runs inside, and let a sleep end when it should.

    The loop makes no cycles: what it lets go of is given back at once, without a collector. Linux
    lets a sleep end up to 50 µs late, to wake less often, unless it is told not to.
    """
    collects = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, 1, 0, 0, 0)  # ns
    try:
        yield
    finally:
        gc.unfreeze()
        if collects:
            gc.enable()


def show_name(name: str) -> None:
    """Let ``top`` and ``ps`` show this process by a name, of which Linux takes 15 letters."""
    with suppress(OSError):
        Path("/proc/self/comm").write_text(f"live {name}"[:15])


def ask_for_realtime() -> list[str]:
    """Ask for all of it; return what was not allowed, in sentences.

    SCHED_FIFO needs CAP_SYS_NICE or a limit on ``rtprio``, ``mlockall`` one on ``memlock``:
    ``/etc/security/limits.conf``.
    """
    refused = []
    try:
        # Of this process alone, and not of those that it starts.
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
    except (OSError, AttributeError) as error:
        refused.append(f"no fixed priority: {_reason(error)}; allow rtprio in limits.conf")
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(_ALL_MEMORY) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    except (OSError, AttributeError) as error:
        refused.append(f"memory is not locked: {_reason(error)}; allow memlock in limits.conf")
    return refused


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{sys.platform} has none"
