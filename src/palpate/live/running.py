"""A session: one loop in this process, each sink in a process of its own."""

import gc
import multiprocessing
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any

from palpate.estimators import ContactEstimator, VariableProjection
from palpate.live.board import Board
from palpate.live.commands import Command
from palpate.live.loop import Loop
from palpate.live.realtime import ask_for_realtime
from palpate.live.ring import Writer
from palpate.live.sinks.sink import Session, Sink
from palpate.live.sources.source import Source
from palpate.preparation import OnlinePreparation
from palpate.settings import ChangeDetector, OutlierRejection

ASKED_EVERY = 0.02  # s: how often the loop looks for commands
TOLD_EVERY = 0.25  # s: how often it writes its statistics
PATIENCE = 5.0  # s: that a sink has to end


def default_estimator() -> ContactEstimator:
    """Variable projection that leaves outliers out and finds changes."""
    return VariableProjection(
        outlier_rejection=OutlierRejection(), change_detector=ChangeDetector()
    )


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
        Ask for a fixed priority and locked memory, and keep the collector out of the loop.
    seconds : float, optional
        Stop after this time.

    Returns
    -------
    dict
        What :meth:`palpate.live.loop.Loop.status` says at the end.
    """
    ring, board = Writer(), Board()
    boards = {sink.name: Board() for sink in sinks}
    names = {name: each.name for name, each in boards.items()}
    try:
        source.open()
        if preparation is None:
            preparation = OnlinePreparation(sample_time=source.sample_time)
        loop = Loop(source, preparation, estimator or default_estimator(), ring)
        session = Session(ring.address, board.name, names, "")
        with _started(sinks, session, names) as connections, _interruptible(loop):
            loop.commands = _Asked(connections, loop, board, seconds)
            loop.say("started")
            for sentence in ask_for_realtime() if realtime else ():
                loop.say(sentence)
            try:
                loop.run()
            finally:
                board.write({**loop.status(), "stopped": True})
                gc.enable()
        return loop.status()
    finally:
        source.close()
        for each in (board, *boards.values()):
            each.close()
        ring.close()


class _Asked:
    """Commands of the sinks, looked for now and then; and the board, written now and then."""

    def __init__(
        self, connections: Sequence[Connection], loop: Loop, board: Board, seconds: float | None
    ) -> None:
        self._connections, self._loop, self._board = list(connections), loop, board
        self._asked = self._told = 0.0
        self._until = float("inf") if seconds is None else time.monotonic() + seconds

    def __call__(self) -> Command | None:
        now = time.monotonic()
        if now < self._asked:
            return None
        if now >= self._until:
            self._until = float("inf")
            return Command("stop")
        if now >= self._told:
            self._told = now + TOLD_EVERY
            self._board.write(self._loop.status())
        for connection in list(self._connections):
            try:
                if connection.poll():
                    command = connection.recv()
                    if isinstance(command, Command):
                        return command
            except (EOFError, OSError):  # the sink has ended
                self._connections.remove(connection)
        self._asked = now + ASKED_EVERY
        return None


@contextmanager
def _started(
    sinks: Sequence[Sink], session: Session, names: dict[str, str]
) -> Iterator[list[Connection]]:
    """Start the sinks' processes; at the end they have a while to finish."""
    context = multiprocessing.get_context("spawn")
    processes, connections = [], []
    for sink in sinks:
        ours, theirs = context.Pipe()
        own = Session(session.ring, session.board, names, names[sink.name])
        process = context.Process(target=_serve, args=(sink, own, theirs), name=sink.name)
        process.daemon = True
        process.start()
        theirs.close()
        processes.append(process)
        connections.append(ours)
    try:
        yield connections
    finally:
        until = time.monotonic() + PATIENCE
        for process in processes:
            process.join(max(until - time.monotonic(), 0.0))
            if process.is_alive():
                process.terminate()
                process.join()
        for connection in connections:
            connection.close()


def _serve(sink: Sink, session: Session, commands: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the loop stops, and says so on the board
    with suppress(BrokenPipeError):
        sink.run(session, commands)


@contextmanager
def _interruptible(loop: Loop) -> Iterator[None]:
    """Ctrl-C stops the loop in order; a second one as ever."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: Any) -> None:
        loop.stopped = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
