"""Processes next to the loop, and the loop's priority, memory and processors."""

import ctypes
import gc
import multiprocessing
import os
import signal
import struct
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any


def start(name: str, target: Callable[..., None], *given: Any) -> tuple[BaseProcess, Connection]:
    """Start a process that blocks Ctrl-C; return it and a connection to it.

    A terminal sends Ctrl-C to all its foreground processes; here the parent ends the others in
    order. The signal is blocked during the start, so this process receives it afterwards.
    ``target`` receives the other end of the connection as its last argument.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(*given, theirs), name=name, daemon=True)
    if sys.platform == "win32":
        process.start()
    else:
        resource_tracker.ensure_running()  # its own start would unblock the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()  # a child inherits its parent's mask
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    theirs.close()
    return process, ours


def end(processes: Sequence[BaseProcess], patience: float) -> None:
    """Wait up to ``patience`` seconds for the processes to end, then terminate or kill them."""
    until = time.monotonic() + patience
    try:
        for process in processes:
            process.join(max(until - time.monotonic(), 0.0))
    finally:  # also after a second Ctrl-C
        for process in processes:
            for stop in (process.terminate, process.kill):  # kill what ignores SIGTERM
                if process.is_alive():
                    stop()
                    process.join(1.0)


# Real-time measures: no garbage collection, the first place for the loop, locked memory.

_PRIORITY = 50  # of 1 to 99: above ordinary processes, below the kernel's own threads
_ALL_MEMORY = 1 | 2  # MCL_CURRENT | MCL_FUTURE, of sys/mman.h
_SET_NAME = 15
_SET_TIMER_SLACK = 29  # PR_SET_NAME, PR_SET_TIMERSLACK, of linux/prctl.h
_GENTLY = 5  # niceness: a third of an ordinary program's share of the processor
_FIRST = -11  # niceness of the loop, where the system permits it
_SLICE = 100_000  # ns that the loop runs at a time; the shortest that Linux accepts
# Number of sched_setattr, and its argument: size, policy, flags, niceness, priority, slice.
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
_SWITCHES = 5e-4  # s for which another thread of the loop's process may keep the interpreter


@contextmanager
def run_first() -> Iterator[None]:
    """Disable garbage collection and give this thread the first place inside a ``with`` block.

    The loop makes no reference cycles, so it frees all its memory without the collector. Linux ends
    a sleep up to 50 µs late by default. It runs the thread that asks for the shortest slice first,
    which needs no permission; a higher priority does.
    """
    collects = gc.isenabled()
    switches = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(_SWITCHES)
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, 1, 0, 0, 0)  # ns
    try:
        with _prefer_thread():
            yield
    finally:
        sys.setswitchinterval(switches)
        gc.unfreeze()
        if collects:
            gc.enable()


@contextmanager
def _prefer_thread() -> Iterator[None]:
    """Give this thread the shortest slice and, where it is permitted, a higher priority."""
    niceness = os.getpriority(os.PRIO_PROCESS, 0) if hasattr(os, "getpriority") else 0
    if not _schedule(min(niceness, _FIRST), _SLICE):
        _schedule(niceness, _SLICE)
    try:
        yield
    finally:
        _schedule(niceness, 0)


def _schedule(niceness: int, slice_ns: int) -> bool:
    """Set niceness and slice (0: the system's) of this thread; return whether it is permitted."""
    number = _SCHED_SETATTR.get(os.uname().machine) if sys.platform == "linux" else None
    if number is None or os.sched_getscheduler(0) not in (os.SCHED_OTHER, os.SCHED_BATCH):
        return False
    size = _ATTRIBUTES.size
    wanted = _ATTRIBUTES.pack(size, os.SCHED_OTHER, 0, niceness, 0, slice_ns, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, wanted, 0) == 0)


def give_way(*, gently: bool = True) -> None:
    """Give this process, one next to the loop, a lower priority than the loop.

    It also leaves a processor core to the loop: :func:`leave_core`.

    Parameters
    ----------
    gently : bool
        Whether to yield to all other programs too. Default: True.
    """
    with suppress(OSError, AttributeError):  # unsupported or not permitted
        # A child inherits the loop's first place.
        niceness = max(os.getpriority(os.PRIO_PROCESS, 0), 0)
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, min(niceness + _GENTLY * gently, 19))
    leave_core()


def leave_core() -> None:
    """Leave one processor core to the loop if this process may use two or more."""
    with suppress(OSError, AttributeError):
        cores = os.sched_getaffinity(0)
        # The kernel handles interrupts on the first cores, so the loop gets the last.
        os.sched_setaffinity(0, cores - {max(cores)} or cores)


def lower_priority() -> None:
    """Let this process yield to the others next to the loop; call after :func:`give_way`.

    It does not wait for an idle processor: on a busy machine its results would never come.
    """
    with suppress(OSError, AttributeError):
        os.nice(_GENTLY)


def show_name(name: str) -> None:
    """Set the name of this process in ``top`` and ``ps``, on Linux, of up to 15 characters."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_NAME, f"live {name}".encode()[:15], 0, 0, 0)


def ask_for_realtime() -> list[str]:
    """Request a fixed priority and locked memory; return a message for each refusal.

    SCHED_FIFO needs CAP_SYS_NICE or a limit on ``rtprio``, ``mlockall`` one on ``memlock``:
    ``/etc/security/limits.conf``.
    """
    refused = []
    try:
        # Child processes do not inherit it.
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
    except (OSError, AttributeError) as error:
        refused.append(f"no fixed priority: {_reason(error)}: set rtprio in limits.conf")
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(_ALL_MEMORY) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    except (OSError, AttributeError, TypeError) as error:  # Windows has no library without a name
        refused.append(f"memory is not locked: {_reason(error)}: set memlock in limits.conf")
    return refused


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{sys.platform} does not support it"
