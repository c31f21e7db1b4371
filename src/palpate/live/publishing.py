"""Sinks that publish the estimates on a wire.

On ROS, ``…/estimate`` is a ``std_msgs/Float64MultiArray`` per sample. Its layout has one dimension,
whose label lists the names of the numbers, separated by commas. ``…/status`` is a
``diagnostic_msgs/DiagnosticArray``, four times a second: the state, and each quantity by name. Both
are standard types, which every ROS tool can echo and plot.
"""

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from palpate.digits import parameter
from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.choices import State
from palpate.live.loop import TAKEN
from palpate.live.ordering import NANO
from palpate.live.sinks import PLACE, Session, Sink, Watching, unpack_parameters
from palpate.live.sources import SOURCES, find_wire
from palpate.live.view import verdict_fields, verdict_on
from palpate.validation import Floats, shown

#: Fields before the law's parameters and their standard errors: published name, column of the ring.
BEFORE = (
    ("time", "arrived"),  # of the newest measurement, s, on the robot's clock
    ("prepared_time", "time"),  # s, of penetration, velocity and force
    ("penetration", "penetration"),
    ("velocity", "velocity"),
    ("force", "force"),
    ("predicted_force", "predicted_force"),  # one-step prediction, N
    ("state", "state"),  # palpate.live.choices.State
    ("offset", "offset"),  # N
    ("surface", "surface"),  # m
    ("margin", "margin"),  # validity margin of the linearisation (condition 10)
)
#: Fields of the last diagnosis: K′ and B′, their standard errors, depth and frequency, and marks.
DIAGNOSED = (
    "dynamic_stiffness", "dynamic_stiffness_standard_error",
    "dynamic_damping", "dynamic_damping_standard_error",
    "working_depth", "frequency", "stiffness_verdict", "damping_verdict", "verdict",
)  # fmt: skip
#: Fields at the end: the diagnosis, and the time since the last update, s.
AFTER = (*DIAGNOSED, "age")
#: Version of the published fields; it rises when a field is removed or changes its meaning.
SCHEMA = 2
_TIMES = (0, 1)
_COLUMNS = [PLACE[column] for _, column in BEFORE]
GENERATION = PLACE["method"]


@dataclass(frozen=True, slots=True)
class Fields:
    """Fields of the published estimates of one estimator.

    Attributes
    ----------
    generation : int
        Number of the estimator; each change of estimator increases it.
    parameters : tuple of str
        Names of the law's parameters.
    origin : int
        Zero of the source's times, ns.
    """

    generation: int
    parameters: tuple[str, ...]
    origin: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all fields, in order."""
        errors = (f"{name}_standard_error" for name in self.parameters)
        return (*(name for name, _ in BEFORE), *self.parameters, *errors, *AFTER)

    def values(self, rows: Floats, after: Floats) -> Floats:
        """Return the fields of rows of the ring, shape (k, len(names)), ending with ``after``."""
        fixed = rows[:, _COLUMNS]
        fixed[:, _TIMES] += 1e-9 * self.origin
        parameters, errors, _ = unpack_parameters(rows, len(self.parameters))
        return np.hstack([fixed, parameters, errors, after])


ESTIMATE, STATUS = "std_msgs/msg/Float64MultiArray", "diagnostic_msgs/msg/DiagnosticArray"
#: Published topics: end of the name, and type.
TOPICS = (("estimate", ESTIMATE), ("status", STATUS))
# DiagnosticStatus: OK, WARN, ERROR, STALE.
_LEVELS = {"invalid": 1, "held": 1, "lost": 3}


class Wire:
    """Interface of a wire: encodes estimates and status as messages and sends them."""

    #: Scheme and address.
    name: str

    def open(self) -> None:
        """Connect; raises PalpateError if that fails."""
        raise NotImplementedError

    def estimate(self, names: tuple[str, ...], values: Sequence[float]) -> bytes:
        """Return the message of one sample."""
        raise NotImplementedError

    def status(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> bytes:
        """Return the message with the state and named values.

        Parameters
        ----------
        state : str
            A :class:`~palpate.live.choices.State`, in lower case.
        source : str
            Name of the source.
        stamp : int
            Time on the robot's clock, ns.
        values : dict
            Values by name.
        """
        raise NotImplementedError

    def put(self, topic: int, data: bytes) -> bool:
        """Send a message on one of :data:`TOPICS`; return whether the queue had room for it."""
        raise NotImplementedError

    def close(self) -> None:
        """Disconnect; may be called twice."""
        raise NotImplementedError


class RosWire(Wire):
    """Base of the ROS wires: encodes ROS 2 messages in CDR.

    Parameters
    ----------
    scheme, prefix : str
        Of the address; the topics are ``<prefix>/estimate`` and ``<prefix>/status``.
    """

    def __init__(self, scheme: str, prefix: str) -> None:
        self.name = f"{scheme}:{prefix}"
        #: Names and types of the topics.
        self.topics = [(f"{prefix}/{end}", kind) for end, kind in TOPICS]
        self._names, self._head = tuple[str, ...](), b""
        self.store: Any = None

    def open(self) -> None:
        """Load the ROS types, in the process that publishes."""
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.LATEST)

    def close(self) -> None:
        """Release the ROS types."""
        self.store = None

    def estimate(self, names: tuple[str, ...], values: Sequence[float]) -> bytes:
        """Return the message of one sample; everything but its numbers is cached."""
        if names != self._names:
            types, size = self.store.types, len(names)
            dimension = types["std_msgs/msg/MultiArrayDimension"](",".join(names), size, size)
            layout = types["std_msgs/msg/MultiArrayLayout"]([dimension], 0)
            message = types[ESTIMATE](layout, np.zeros(size))
            # The message ends with the numbers.
            self._head, self._names = self._bytes(message, ESTIMATE)[: -8 * size], names
        return self._head + np.array(values, dtype="<f8").tobytes()

    def status(self, state: str, source: str, stamp: int, values: dict[str, str | float]) -> bytes:
        """Return the message with the state; numbers have 15 digits."""
        types = self.store.types
        time = types["builtin_interfaces/msg/Time"](*divmod(max(stamp, 0), NANO))
        header = types["std_msgs/msg/Header"](time, "")
        pairs = [
            types["diagnostic_msgs/msg/KeyValue"](
                name, value if isinstance(value, str) else f"{value:.15g}"
            )
            for name, value in values.items()
        ]
        one: Any = types["diagnostic_msgs/msg/DiagnosticStatus"](
            _LEVELS.get(state, 0), "palpate", state, source, pairs
        )
        return self._bytes(types[STATUS](header, [one]), STATUS)

    def _bytes(self, message: object, type_name: str) -> bytes:
        return bytes(self.store.serialize_cdr(message, type_name, little_endian=True))


# The sink that publishes.

#: Verdicts as published numbers.
LEVELS = {"do-not-trust": 0.0, "with-care": 1.0, "trust": 2.0}
_PAUSE = 1e-3  # s between reads of new rows
_ASKED_EVERY = 0.02  # s between checks whether the loop has stopped
_TOLD_EVERY = 0.25  # s between status messages


class Publisher:
    """Sink that publishes each estimate on a wire, and the status four times a second."""

    gently = False  # a robot may act on the estimates
    every_sample = True

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        #: Such as ``publish zmq:tcp://127.0.0.1:5556``.
        self.name = f"publish {wire.name}"
        self._fields: Fields | None = None
        self._last: dict[str, float] = {}  # fields of the last published estimate
        # Time of publication; time of the last update, on the robot's clock.
        self._seen = self._learned = math.nan
        self._told = 0.0

    def run(self, session: Session, commands: Connection) -> None:
        """Publish until the loop stops."""
        self._watching = Watching(session)
        try:
            self._wire.open()
            self._go_on()
        except PalpateError as error:
            print(f"palpate: {error}", file=sys.stderr)
        finally:
            self._wire.close()
            self._watching.close()

    def _go_on(self) -> None:
        waiting = self._watching.take().rows
        over, asked = False, 0.0
        while not over:
            now = time.monotonic()
            if now >= asked:
                asked, over = now + _ASKED_EVERY, self._watching.over
            page, rows = self._watching.status(), self._watching.take().rows
            waiting = np.concatenate([waiting, rows]) if len(waiting) else rows
            # The first sample sets the zero of the times.
            if page and page["counts"]["taken"]:
                waiting = self._publish(page, waiting)
                self._tell(page, silent=not len(rows))
            if not over:
                time.sleep(_PAUSE)
        self._watching.tell({})

    def _publish(self, page: dict[str, Any], rows: Floats) -> Floats:
        """Send the rows of the estimator in the status; return those of later estimators."""
        fields = Fields(page["generation"], tuple(page["law"]["names"]), page["origin"])
        if fields != self._fields:
            self._fields, self._last, self._learned = fields, {}, math.nan
        mine = rows[:, GENERATION] == fields.generation
        # Rows of an earlier estimator, which the status no longer describes, are dropped.
        self._watching.dropped += int(np.count_nonzero(rows[:, GENERATION] < fields.generation))
        if mine.any():
            values = fields.values(rows[mine], self._after(page, rows[mine])).tolist()
            self._last = dict(zip(fields.names, values[-1], strict=True))
            self._seen = time.monotonic()
            messages = (self._wire.estimate(fields.names, each) for each in values)
            # Messages without room in the queue count as dropped rows.
            self._watching.dropped += sum(not self._wire.put(0, each) for each in messages)
        return rows[rows[:, GENERATION] > fields.generation]

    def _after(self, page: dict[str, Any], rows: Floats) -> Floats:
        """Return the diagnosis as numbers, NaN if none, and the time since the last update, s."""
        found = self._watching.diagnosis(page)
        diagnosed = np.array([[_level(found[name]) for name in DIAGNOSED]])
        # The status reports a change of material only a little later.
        changed = rows[:, PLACE["state"]] == State.CHANGED
        diagnosed = np.where(changed[:, None], math.nan, diagnosed)
        times, taken = rows[:, PLACE["arrived"]], np.isin(rows[:, PLACE["status"]], list(TAKEN))
        latest = np.maximum.accumulate(np.where(taken, np.arange(len(rows)), -1))
        learned = np.where(latest < 0, self._learned, times[latest])
        self._learned = float(learned[-1])
        return np.column_stack([diagnosed, times - learned])

    def _tell(self, page: dict[str, Any], *, silent: bool) -> None:
        """Publish the status, also without new rows, so that a lost source is reported."""
        now, last = time.monotonic(), self._last
        known = math.isfinite(last.get("time", math.nan))
        if self._fields is None or not known or now < self._told:
            return
        self._told = now + _TOLD_EVERY
        stamp = round(1e9 * (last["time"] - 1e-9 * self._fields.origin)) + self._fields.origin
        lost = silent and page["state"] == "lost"
        state = "lost" if lost else State(int(last["state"])).name.lower()
        said = describe_status(page, self._fields, {**last, "age": last["age"] + now - self._seen})
        said |= self._watching.diagnosis(page)
        self._wire.put(1, self._wire.status(state, page["source"], stamp, said))
        self._watching.tell({})


def _level(value: str | float) -> float:
    return LEVELS.get(value, math.nan) if isinstance(value, str) else value


def describe_status(
    page: dict[str, Any], fields: Fields, named: dict[str, float]
) -> dict[str, str | float]:
    """Return the values of the status message: numbers in SI units, and a text with units.

    Includes the verdict on the law if the estimator compares laws.
    """
    law = page["law"]
    said: dict[str, str | float] = {"schema": SCHEMA, "method": page["method"], "law": law["kind"]}
    said |= {"flags": "; ".join(page["flags"]), "age": named["age"]}
    verdict = verdict_on(page)
    own = verdict["own"] if verdict and verdict["parameters"] else fields.parameters
    fixed, words = verdict["fixed"] if verdict else (), []
    for place in law["shown"]:
        name, unit = fields.parameters[place], law["units"][place]
        value, error = named[name], named[f"{name}_standard_error"]
        if name in own:
            words.append(f"{name} {_parameter(value, error, unit, fixed=name in fixed)}")
        else:
            value = error = math.nan
        said |= {name: value, f"{name}_standard_error": error}
    said["words"] = ", ".join(words)
    if verdict:
        origin = 1e-9 * fields.origin  # zero of the loop's times
        said |= {f"verdict_{name}": each for name, each in verdict_fields(verdict, origin).items()}
    for name in ("lost", "repeated", "disordered", "malformed", "unpaired", "refused"):
        said[name] = page["counts"].get(name, 0)
    return said


def _parameter(value: float, error: float, unit: str, *, fixed: bool) -> str:
    if not math.isfinite(value):
        return "unknown"
    if math.isfinite(error):
        return parameter(value, error, unit=unit, fixed=fixed)
    return f"{value:.4g} {unit}".strip() + " ± unknown"


# From a command-line option to a sink.


def open_publisher(address: str) -> Sink:
    """Return the sink that publishes estimates on a wire, such as ``zmq:tcp://127.0.0.1:5556``.

    Raises
    ------
    InvalidParameterError
        The address names no wire.
    MissingExtraError
        A package that the wire needs is not installed.
    """
    kind, module, rest = find_wire(address)
    if kind is None or not kind.wire:
        known = ", ".join(f"{name}:…" for name, each in SOURCES.items() if each.wire)
        raise InvalidParameterError(
            f"--publish must begin with one of {known}, not {shown(address)}"
        )
    made: Wire = getattr(module, kind.wire)(rest)
    try:
        made.open()  # so that an address in use fails before the loop starts
    finally:
        made.close()
    return Publisher(made)
