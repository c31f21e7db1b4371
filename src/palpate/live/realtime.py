"""Asking the system for time: a fixed priority, memory that stays, no collector in between."""

import ctypes
import gc
import os
import sys

_PRIORITY = 50  # of 1 to 99: above all that is ordinary, below the kernel's own threads
_ALL_MEMORY = 1 | 2  # MCL_CURRENT | MCL_FUTURE, of sys/mman.h


def ask_for_realtime() -> list[str]:
    """Ask for all of it; return what was not allowed, in sentences.

    SCHED_FIFO needs CAP_SYS_NICE or a limit on ``rtprio``, ``mlockall`` one on ``memlock``:
    ``/etc/security/limits.conf``.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
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
