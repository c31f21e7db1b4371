"""A session: one loop in this process, each sink in a process of its own."""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from palpate.errors import InvalidParameterError
from palpate.estimators import ContactEstimator, VariableProjection, ViscoelasticContact
from palpate.live.choices import LiveCommand
from palpate.live.loop import Loop
from palpate.live.realtime import ask_for_realtime, end, give_way, show_name, start, undisturbed
from palpate.live.ring import ESTIMATE, SharedJson, Writer
from palpate.live.sinks import Session, Sink
from palpate.live.sources import Source
from palpate.preparation import OnlinePreparation
from palpate.settings import ChangeDetector, OutlierRejection

ASKED_EVERY = 0.02  # s: how often the loop looks for commands
TOLD_EVERY = 0.25  # s: how often it writes its statistics
PATIENCE = 5.0  # s: that a sink has to end
_THERE = "there"  # what a sink sends when it has begun
_IMPORTING = 30.0  # s that a sink has to begin, on a busy machine
_LOOKED_EVERY = 0.1  # s, meanwhile: whether somebody has asked to stop


def default_estimator(
    kind: type[ContactEstimator] = VariableProjection, **settings: Any
) -> ContactEstimator:
    """Return an estimator as a run begins with it.

    Variable projection, and the estimator that compares laws, leave outliers out and find
    changes; others, such as the paper's, are as their authors have them.

    Parameters
    ----------
    kind : type
        The method.
    settings
        Of it, beside these.
    """
    if kind in (VariableProjection, ViscoelasticContact):
        usual = {"outlier_rejection": OutlierRejection(), "change_detector": ChangeDetector()}
        settings = usual | settings
    return kind(**settings)


def run(
    source: Source,
    estimator: ContactEstimator | None = None,
    sinks: Sequence[Sink] = (),
    *,
    preparation: OnlinePreparation | None = None,
    realtime: bool = False,
    seconds: float | None = None,
) -> dict[str, Any]:
    """Identify what a source delivers, sample by sample, until it ends or somebody stops it.

    Parameters
    ----------
    source : Source
        It is opened, and closed at the end.
    estimator : ContactEstimator, optional
        Variable projection with outlier rejection and change detection unless given.
    sinks : sequence of Sink
        Each runs in a process of its own.
    preparation : OnlinePreparation, optional
        Of the source's sample time unless given.
    realtime : bool
        Ask for a fixed priority and locked memory; what is not allowed is said.
    seconds : float, optional
        Stop after this time, s.

    Returns
    -------
    dict
        What :meth:`palpate.live.loop.Loop.status` says at the end; and, as ``"failed"``, the sinks
        whose processes ended with an error or were killed, each with its exit code.

    Raises
    ------
    InvalidParameterError
        Two sinks have one name, or what the source delivers does not fit the preparation.
    PalpateError
        The source cannot be opened.
    """
    if len({sink.name for sink in sinks}) < len(sinks):
        names = ", ".join(sink.name for sink in sinks)
        raise InvalidParameterError(f"sinks must have different names, not {names}")
    if preparation is None:
        preparation = OnlinePreparation(sample_time=source.sample_time)
    # From here on Ctrl-C only leaves word: whatever is begun is known, and ended in order.
    with _interruptible() as stops, ExitStack() as kept:
        samples = kept.enter_context(closing(Writer()))
        estimates = kept.enter_context(closing(Writer(width=len(ESTIMATE))))
        shared_json = kept.enter_context(closing(SharedJson()))
        shared_by_sink = {sink.name: kept.enter_context(closing(SharedJson())) for sink in sinks}
        addresses = {name: each.name for name, each in shared_by_sink.items()}
        session = Session(samples.address, estimates.address, shared_json.name, addresses, "")
        kept.callback(source.close)
        chosen = estimator or default_estimator()
        if chosen.settings.get("sample_time", source.sample_time) is None:
            chosen = chosen.replace(sample_time=source.sample_time)
        every = any(getattr(sink, "every_sample", False) for sink in sinks)
        loop = Loop(source, preparation, chosen, samples, estimates, every_sample=every)
        stops(loop)
        failed: dict[str, int] = {}
        with _started(sinks, session, loop, shared_json, failed) as started, undisturbed():
            # All is there before the first sample: none waits while others begin.
            for sentence in ask_for_realtime() if realtime else ():
                loop.say(sentence)
            if not loop.stopped:
                source.open()
                loop.say("started")
            loop.commands = _Asked(started, loop, shared_json, seconds)
            loop.run()
        return {**loop.status(), "failed": failed}


class _Asked:
    """Commands of the sinks, looked for now and then; and the board, written now and then."""

    def __init__(
        self,
        sinks: dict[str, Connection],
        loop: Loop,
        shared_json: SharedJson,
        seconds: float | None,
    ) -> None:
        self._sinks, self._loop, self._board = dict(sinks), loop, shared_json
        self._asked = self._told = 0.0
        self._until = float("inf") if seconds is None else time.monotonic() + seconds

    def __call__(self) -> LiveCommand | None:
        now = time.monotonic()
        if now < self._asked:
            return None
        if now >= self._until:
            self._until = float("inf")
            return LiveCommand("stop")
        if now >= self._told:
            self._told = now + TOLD_EVERY
            for sentence in getattr(self._loop.source, "news", list)():
                self._loop.say(sentence)
            self._board.write(self._loop.status())
        for name, connection in list(self._sinks.items()):
            try:
                if connection.poll() and isinstance(command := connection.recv(), LiveCommand):
                    return command
            except (EOFError, OSError):  # it has ended, by itself or by another's hand
                del self._sinks[name]
                self._loop.say(f"the {name} has ended")
        self._asked = now + ASKED_EVERY
        return None


@contextmanager
def _started(
    sinks: Sequence[Sink],
    session: Session,
    loop: Loop,
    shared_json: SharedJson,
    failed: dict[str, int],
) -> Iterator[dict[str, Connection]]:
    """Start the sinks' processes; at the end they have a while to finish; failures are noted."""
    processes: list[BaseProcess] = []
    connections: dict[str, Connection] = {}
    try:
        for sink in sinks:
            if loop.stopped:
                break
            own = replace(session, own=session.shared_by_sink[sink.name])
            process, connections[sink.name] = start(sink.name, _serve, sink, own)
            processes.append(process)
            # What it opened in this process, such as a port, is the other's own now.
            getattr(sink, "handed_over", lambda: None)()
        until = time.monotonic() + _IMPORTING
        waiting = list(connections.values())
        while waiting and not loop.stopped and time.monotonic() < until:
            ready: list[Any] = wait(waiting, _LOOKED_EVERY)
            for connection in ready:
                with suppress(EOFError):  # it has ended: the loop says so
                    connection.recv()
                waiting.remove(connection)
        yield connections
    finally:
        shared_json.write({"stopped": True, **loop.status()})
        end(processes, PATIENCE)
        failed |= {each.name: each.exitcode for each in processes if each.exitcode}
        for connection in connections.values():
            connection.close()


def _serve(sink: Sink, session: Session, commands: Connection) -> None:
    show_name(sink.name)
    give_way(gently=getattr(sink, "gently", True))
    with suppress(BrokenPipeError):
        commands.send(_THERE)
        sink.run(session, commands)


@contextmanager
def _interruptible() -> Iterator[Callable[[Loop], None]]:
    """Ctrl-C, or a request to terminate, stops a loop in order; a second one as ever.

    It stops the loop, which is said by what is yielded, even if it comes before there is one.
    """
    loops, before, came = list[Loop](), dict[signal.Signals, Any](), False

    def stops(loop: Loop) -> None:
        loops.append(loop)
        loop.stopped = came

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def stop(*_: Any) -> None:
        nonlocal came
        came = True
        for loop in loops:
            loop.stopped = True
        restore()

    try:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                before[number] = signal.getsignal(number) or signal.SIG_DFL
                signal.signal(number, stop)
        yield stops
    finally:
        restore()
