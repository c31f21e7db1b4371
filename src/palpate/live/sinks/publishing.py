"""Estimates published back on a wire, for the robot or whoever listens."""

import math
import sys
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any, Protocol

import numpy as np

from palpate.digits import parameter
from palpate.errors import PalpateError
from palpate.live.law_numbers import fields_of
from palpate.live.loop import TAKEN
from palpate.live.sinks.sink import Session
from palpate.live.sinks.watching import PLACE, Watching
from palpate.live.states import State
from palpate.live.verdict_on_laws import verdict_on
from palpate.live.wires.estimates import GENERATION, SCHEMA, Fields
from palpate.live.wires.ros_estimates import TOPICS, RosEncoder
from palpate.validation import Floats

#: Of an estimate, in place of words.
LEVELS = {"do-not-trust": 0.0, "with-care": 1.0, "trust": 2.0}
_PAUSE = 1e-3  # s: how often new rows are looked for
_ASKED_EVERY = 0.02  # s: whether the loop has stopped
_TOLD_EVERY = 0.25  # s: the status, and the sink's own board


_now = time.monotonic


class Wire(Protocol):
    """One way of publishing."""

    @property
    def name(self) -> str:
        """Scheme and address."""

    def open(self) -> None:
        """Begin; PalpateError where it cannot."""

    def send(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> int:
        """Send estimates, one after the other; return how many of them could not be sent."""

    def tell(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> None:
        """Send what is said in words, and a few numbers."""

    def close(self) -> None:
        """End; may be called twice."""


class Publisher:
    """Publishes each estimate, and a few times a second the state in words.

    Parameters
    ----------
    wire : Wire
        Where.
    """

    gently = False  # a robot may act on what is published

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    @property
    def name(self) -> str:
        """Scheme and address, for instance ``publish zmq:tcp://127.0.0.1:5556``."""
        return f"publish {self._wire.name}"

    def check(self) -> None:
        """Begin and end, so that an address in use is known before the loop begins.

        Raises
        ------
        PalpateError
            It cannot be published there.
        """
        try:
            self._wire.open()
        finally:
            self._wire.close()

    def run(self, session: Session, commands: Connection) -> None:
        """Publish what the loop finds until it stops."""
        watching = Watching(session)
        try:
            self._wire.open()
            _Publishing(self._wire, watching).run()
        except PalpateError as error:
            watching.tell({"fault": str(error)})
            print(f"palpate: {error}", file=sys.stderr)
        finally:
            self._wire.close()
            watching.close()


class _Publishing:
    def __init__(self, wire: Wire, watching: Watching) -> None:
        self._wire, self._watching = wire, watching
        self._sent = 0
        self._fields: Fields | None = None
        self._last: dict[str, float] = {}  # of what was published
        self._seen = self._learned = math.nan  # when; and when a sample was, by the robot's clock
        self._told = 0.0

    def run(self) -> None:
        waiting = self._watching.take().rows
        over, asked = False, 0.0
        while not over:
            now = _now()
            if now >= asked:
                asked, over = now + _ASKED_EVERY, self._watching.over
            page, rows = self._watching.status(), self._watching.take().rows
            waiting = np.concatenate([waiting, rows]) if len(waiting) else rows
            # What times are counted from is known with the first sample.
            if page and page["counts"]["taken"]:
                waiting = self._publish(page, waiting)
                self._tell(page, silent=not len(rows))
            if not over:
                time.sleep(_PAUSE)
        self._report()

    def _publish(self, page: dict[str, Any], rows: Floats) -> Floats:
        """Send rows whose estimator the board knows by now; return the others."""
        fields = self._fields
        if fields is None or (fields.generation, fields.origin) != (
            page["generation"],
            page["origin"],
        ):
            fields = self._fields = Fields.of(page)
            self._last, self._learned = {}, math.nan
        mine = rows[:, GENERATION] == fields.generation
        # Rows of the estimator before, which the board does not know any more, are not published.
        self._watching.dropped += int(np.count_nonzero(rows[:, GENERATION] < fields.generation))
        if mine.any():
            values = fields.values(rows[mine], self._after(page, rows[mine])).tolist()
            self._last, self._seen = dict(zip(fields.names, values[-1], strict=True)), _now()
            refused = self._wire.send(fields.names, values)
            self._watching.dropped += refused  # they came to nobody, as those that the ring lost
            self._sent += len(values) - refused
        return rows[rows[:, GENERATION] > fields.generation]

    def _after(self, page: dict[str, Any], rows: Floats) -> Floats:
        """The verdict as a number, NaN of none; and s since a sample was learned."""
        level = LEVELS.get(str(self._watching.diagnosis(page)["verdict"]), math.nan)
        # Of a change the board does not know at once.
        levels = np.where(rows[:, PLACE["state"]] == State.CHANGED, math.nan, level)
        times, taken = rows[:, PLACE["arrived"]], np.isin(rows[:, PLACE["status"]], list(TAKEN))
        latest = np.maximum.accumulate(np.where(taken, np.arange(len(rows)), -1))
        learned = np.where(latest < 0, self._learned, times[latest])
        self._learned = float(learned[-1])
        return np.column_stack([levels, times - learned])

    def _tell(self, page: dict[str, Any], *, silent: bool) -> None:
        """Say it whether rows come or not: of a source that is lost there are none."""
        now, last = _now(), self._last
        if now < self._told or not last or self._fields is None:
            return
        if not math.isfinite(last["time"]):
            return
        self._told = now + _TOLD_EVERY
        stamp = round(1e9 * (last["time"] - 1e-9 * self._fields.origin)) + self._fields.origin
        lost = silent and page["state"] == "lost"
        state = "lost" if lost else State(int(last["state"])).name.lower()
        said = words_of(page, self._fields, {**last, "age": last["age"] + now - self._seen})
        said |= self._watching.diagnosis(page)
        self._wire.tell(state, page["source"], stamp, said)
        self._report()

    def _report(self) -> None:
        self._watching.tell({"published": self._sent})


def words_of(
    page: dict[str, Any], fields: Fields, named: dict[str, float]
) -> dict[str, str | float]:
    """What is said beside the estimates: numbers as such in SI, and in a sentence with their units.

    And which law it is, by an estimator that compares laws.
    """
    law = page["law"]
    said: dict[str, str | float] = {"schema": SCHEMA, "method": page["method"], "law": law["kind"]}
    said |= {"flags": "; ".join(page["flags"]), "age": named["age"]}
    verdict = verdict_on(page)
    own = verdict["own"] if verdict and verdict["parameters"] else fields.parameters
    fixed, words = verdict["fixed"] if verdict else (), []
    for place in law.get("shown", range(len(fields.parameters))):
        name, unit = fields.parameters[place], law["units"][place]
        value, error = named[name], named[f"{name}_standard_error"]
        if name in own:
            words.append(f"{name} {_parameter(value, error, unit, fixed=name in fixed)}")
        else:
            value = error = math.nan
        said |= {name: value, f"{name}_standard_error": error}
    said["words"] = ", ".join(words)
    if verdict:
        origin = 1e-9 * fields.origin  # what the loop counts its times from
        said |= {f"verdict_{name}": each for name, each in fields_of(verdict, origin).items()}
    for name in ("lost", "repeated", "disordered", "malformed", "unpaired", "refused"):
        said[name] = page["counts"].get(name, 0)
    return said


def _parameter(value: float, error: float, unit: str, *, fixed: bool) -> str:
    if not math.isfinite(value):
        return "not known"
    if math.isfinite(error):
        return parameter(value, error, unit=unit, fixed=fixed)
    return f"{value:.4g} {unit}".strip() + ", error not known"


class RosWire:
    """What wires of ROS have in common: a prefix of topics, and messages.

    Parameters
    ----------
    scheme, prefix : str
        Of the address; topics are ``<prefix>/estimate`` and ``<prefix>/status``.
    """

    def __init__(self, scheme: str, prefix: str) -> None:
        self._scheme, self._prefix = scheme, prefix
        self._encoder: RosEncoder | None = None

    @property
    def name(self) -> str:
        """Scheme and prefix."""
        return f"{self._scheme}:{self._prefix}"

    @property
    def encoder(self) -> RosEncoder:
        """Made when it is first needed, in the process that needs it."""
        if self._encoder is None:
            self._encoder = RosEncoder()
        return self._encoder

    def close(self) -> None:
        """Forget what only this process can have."""
        self._encoder = None

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Names and types of the topics."""
        return [(f"{self._prefix}/{end}", kind) for end, kind in TOPICS]

    def estimates(self, names: tuple[str, ...], values: Sequence[Sequence[float]]) -> list[bytes]:
        """Return messages of estimates."""
        return [self.encoder.estimate(names, each) for each in values]
