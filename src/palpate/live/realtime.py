"""Processes beside the loop, and time for the loop: priority, memory, processors."""

import ctypes
import gc
import multiprocessing
import os
import platform
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
    """Start a process that Ctrl-C does not reach, from its first instruction on.

    A terminal sends it to every process in front; who started them ends them in order. It is
    held back meanwhile, and not ignored: one that comes during the start comes after it here.
    Returned are the process and a connection; its function has the other end as last argument.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(*given, theirs), name=name, daemon=True)
    if sys.platform == "win32":
        process.start()
    else:
        resource_tracker.ensure_running()  # its own start would lift what is held back
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()  # a child begins with its parent's mask
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    theirs.close()
    return process, ours


def end(processes: Sequence[BaseProcess], patience: float) -> None:
    """Wait until they have ended, s; then end them, whether they listen or not."""
    until = time.monotonic() + patience
    try:
        for process in processes:
            process.join(max(until - time.monotonic(), 0.0))
    finally:  # of whoever asks a second time, too
        for process in processes:
            for stop in (process.terminate, process.kill):  # the other where it does not listen
                if process.is_alive():
                    stop()
                    process.join(1.0)


# Time for the loop: no collector in between, a fixed priority, memory that stays.

_PRIORITY = 50  # of 1 to 99: above all that is ordinary, below the kernel's own threads
_ALL_MEMORY = 1 | 2  # MCL_CURRENT | MCL_FUTURE, of sys/mman.h
_SET_NAME, _SET_TIMER_SLACK = 15, 29  # PR_SET_NAME, PR_SET_TIMERSLACK, of linux/prctl.h
# Number of sched_setattr: the C library has had a name for it only since glibc 2.41.
_SET_ATTRIBUTES = {"x86_64": 314, "aarch64": 274, "riscv64": 274}
# struct sched_attr of linux/sched/types.h: size, policy, flags, nice, priority, runtime, deadline,
# period, and the two bounds of utilisation.
_ATTRIBUTES = struct.Struct("=IIQiIQQQII")
_SHORTEST_SLICE, _LONGEST_SLICE = 100_000, 100_000_000  # ns, that Linux takes
_GENTLY = 5  # niceness: a third of what the loop would get


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the collector out of what runs inside, and let a sleep end when it should.

    The loop makes no cycles: what it lets go of is given back at once, without a collector. Linux
    lets a sleep end up to 50 µs late, to wake less often, unless it is told not to; and since 6.12
    it lets who asks for short slices of time go before those with longer ones.
    """
    collects = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, 1, 0, 0, 0)  # ns
            _ask_for_slices(_SHORTEST_SLICE)
    try:
        yield
    finally:
        gc.unfreeze()
        if collects:
            gc.enable()


def give_way(*, gently: bool = True) -> None:
    """Let the loop go first, whenever it wakes; to be called once in a process beside it.

    One of the cores that this process may use is left to it, where there are two or more.

    Parameters
    ----------
    gently : bool
        Programs of others get more, and sooner, too: of what only a person waits for.
    """
    with suppress(OSError, AttributeError):  # of another system, or not allowed
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        if gently:
            os.nice(_GENTLY)
            _ask_for_slices(_LONGEST_SLICE)
        cores = os.sched_getaffinity(0)
        # The first ones are those that a kernel gives its interrupts to.
        os.sched_setaffinity(0, cores - {max(cores)} or cores)


def lower_priority() -> None:
    """Let everybody else go first too, of what may take long; after :func:`give_way`."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _ask_for_slices(length: int) -> None:
    """Of time, ns: no right is needed. A Linux before 6.12 does not listen."""
    number, policy = _SET_ATTRIBUTES.get(platform.machine()), os.sched_getscheduler(0)
    if number is None or policy not in (os.SCHED_OTHER, os.SCHED_BATCH):
        return
    nice, size = os.getpriority(os.PRIO_PROCESS, 0), _ATTRIBUTES.size
    packed = _ATTRIBUTES.pack(size, policy, 0, nice, 0, length, 0, 0, 0, 0)
    ctypes.CDLL(None).syscall(number, 0, packed, 0)


def show_name(name: str) -> None:
    """Let ``top`` and ``ps`` show this process by a name, of which Linux takes 15 letters."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_NAME, f"live {name}".encode()[:15], 0, 0, 0)


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
