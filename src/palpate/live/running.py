"""A live run: the loop in this process, each sink in a separate process."""

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from palpate.errors import InvalidParameterError
from palpate.findings import spoken
from palpate.input.preparation.online import OnlinePreparation
from palpate.input.wrench import Payload, PayloadCompensation
from palpate.live.choices import LiveCommand
from palpate.live.loop import Loop
from palpate.live.realtime import (
    ask_for_realtime,
    end,
    give_way,
    run_first,
    show_name,
    start,
)
from palpate.live.ring import ESTIMATE, SharedJson, Writer
from palpate.live.sinks import Session, Sink, Watching
from palpate.live.sources import Source
from palpate.method.estimators import ContactEstimator, VariableProjection, ViscoelasticContact
from palpate.method.settings import ChangeDetector, OutlierRejection

ASKED_EVERY = 0.02  # s between reads of commands
TOLD_EVERY = 0.2  # s between writes of the status: at least four a second
PATIENCE = 5.0  # s for a sink to end
_THERE = "there"  # sent by a sink that is ready
_IMPORTING = 30.0  # s for a sink to start, on a busy machine
_LOOKED_EVERY = 0.1  # s between checks for Ctrl-C meanwhile


def default_estimator(
    kind: type[ContactEstimator] = ViscoelasticContact, **settings: Any
) -> ContactEstimator:
    """Return an estimator with the default settings of a live run.

    The default selects the law, as :func:`palpate.identify` does. It and variable projection reject
    outliers and detect changes of material. Other methods keep the settings of their publications.

    Parameters
    ----------
    kind : type
        Class of the estimator. Default: :class:`palpate.ViscoelasticContact`.
    settings
        Further settings of the estimator.
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
    payload: Payload | None = None,
    realtime: bool = False,
    seconds: float | None = None,
) -> dict[str, Any]:
    """Identify a contact from a live source, sample by sample, until it ends or is stopped.

    Parameters
    ----------
    source : Source
        Source of samples; it is opened here, and closed at the end.
    estimator : ContactEstimator, optional
        Default: :func:`default_estimator`.
    sinks : sequence of Sink
        Consumers of the results, each in a separate process. Default: none.
    preparation : OnlinePreparation, optional
        Default: ``OnlinePreparation(sample_time=source.sample_time)``.
    payload : Payload, optional
        Tool whose weight, inertia and bias are subtracted before the preparation, sample by sample;
        the source delivers orientations. Default: none.
    realtime : bool
        Request a fixed priority and locked memory; refusals are reported. Default: False.
    seconds : float, optional
        Stop after this time, s. Default: run until the source ends.

    Returns
    -------
    dict
        The last :meth:`palpate.live.loop.Loop.status`; and under ``"failed"``, by name of the sink,
        the exit code of each process that failed or was killed.

    Raises
    ------
    InvalidParameterError
        Two sinks have the same name, or the samples do not fit the preparation.
    PalpateError
        The source cannot be opened.
    """
    if len({sink.name for sink in sinks}) < len(sinks):
        names = ", ".join(sink.name for sink in sinks)
        raise InvalidParameterError(f"sinks must have different names, not {names}")
    if preparation is None:
        preparation = OnlinePreparation(sample_time=source.sample_time)
    samples = Writer()
    estimates = Writer(width=len(ESTIMATE))
    shared_json = SharedJson()
    shared_by_sink = {sink.name: SharedJson() for sink in sinks}
    memories = {name: each.memory for name, each in shared_by_sink.items()}
    session = Session(samples.memory, estimates.memory, shared_json.memory, memories)
    chosen = estimator or default_estimator()
    step = source.sample_time
    if chosen.settings.get("sample_time", step) is None:
        chosen = chosen.replace(sample_time=step)
    compensation = None
    if payload is not None:
        compensation = PayloadCompensation(payload=payload, sample_time=step)
    loop = Loop(source, preparation, chosen, samples, estimates, compensation=compensation)
    loop.every_sample = any(getattr(sink, "every_sample", False) for sink in sinks)
    if payload is not None and payload.mark != "trust":
        reason = f": {payload.findings[0]}" if payload.findings else ""
        loop.say(f"payload {spoken(payload.mark)}{reason}")
    # Sinks read this status until the source is open.
    shared_json.write({**loop.status(), "state": "none"})
    failed: dict[str, int] = {}
    # From here on Ctrl-C only sets a flag, so that everything started is ended in order.
    with (
        _interruptible(loop),
        closing(source),
        _start_sinks(sinks, session, loop, shared_json, failed) as started,
        run_first(),
    ):
        # The sinks are ready before the source opens, so that no sample waits for them.
        for sentence in ask_for_realtime() if realtime else ():
            loop.say(sentence)
        if not loop.stopped:
            source.open()
            loop.say("started")
        loop.commands = _Asked(started, loop, shared_json, shared_by_sink, seconds)
        loop.run()
    return {**loop.status(), "failed": failed}


class _Asked:
    """Reads the sinks' commands and writes the loop's status, at fixed intervals."""

    def __init__(
        self,
        sinks: dict[str, Connection],
        loop: Loop,
        shared_json: SharedJson,
        shared_by_sink: dict[str, SharedJson],
        seconds: float | None,
    ) -> None:
        self._sinks = dict(sinks)
        self._loop = loop
        self._board = shared_json
        self._by_sink = shared_by_sink
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
            except (EOFError, OSError):  # it has ended or was killed
                del self._sinks[name]
                board = self._by_sink[name]  # nobody else writes it any more
                board.write({**board.read(), "ended": True})
                self._loop.say(f"the {name} has ended")
        self._asked = now + ASKED_EVERY
        return None


@contextmanager
def _start_sinks(
    sinks: Sequence[Sink],
    session: Session,
    loop: Loop,
    shared_json: SharedJson,
    failed: dict[str, int],
) -> Iterator[dict[str, Connection]]:
    """Start the sinks' processes; at the end wait for them and note failures."""
    processes = []
    connections = {}
    try:
        for sink in sinks:
            if loop.stopped:
                break
            process, connections[sink.name] = start(sink.name, _serve, sink, session)
            processes.append(process)
            # Anything that the sink opened here, such as a port, now belongs to its process.
            getattr(sink, "handed_over", lambda: None)()
        until = time.monotonic() + _IMPORTING
        waiting = list(connections.values())
        while waiting and not loop.stopped and time.monotonic() < until:
            ready: list[Any] = wait(waiting, _LOOKED_EVERY)
            for connection in ready:
                with suppress(EOFError):  # it has ended, which the loop reports
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
    watching = Watching(session, sink.name)
    with suppress(BrokenPipeError):
        commands.send(_THERE)
        sink.run(watching, commands)


@contextmanager
def _interruptible(loop: Loop) -> Iterator[None]:
    """Let the first Ctrl-C or SIGTERM stop the loop in order; a second one acts as usual."""
    before = dict[signal.Signals, Any]()

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def stop(*_: Any) -> None:
        loop.stopped = True
        restore()

    try:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                before[number] = signal.getsignal(number) or signal.SIG_DFL
                signal.signal(number, stop)
        yield
    finally:
        restore()
