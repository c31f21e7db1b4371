"""Sinks, which consume the loop's results: their interface, their data and their printing."""

import math
import multiprocessing
import sys
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from typing import Any, Protocol

import numpy as np

from palpate.live.ring import COLUMNS, MOST_PARAMETERS, Memory, RowReader, SharedJson
from palpate.validation import Floats, frozen, or_nan
from palpate.writing import abandon_output

# Printing to a terminal that may have gone.


def print_line(text: str, end: str = "\n") -> bool:
    """Print and flush; return whether the output still has a reader.

    If the reader is gone or the disk is full, standard output is abandoned, so that Python does not
    complain about it at exit.
    """
    try:
        print(text, end=end, flush=True)
    except (OSError, ValueError):
        abandon_output()
        return False
    return sys.stdout is not None


# The interface of a sink, which runs in a separate process.


@frozen
class Session:
    """The shared memory through which the loop and its sinks exchange data.

    Attributes
    ----------
    samples, estimates : ctypes array
        Every sample, and the estimates: :class:`palpate.live.ring.RowReader`.
    shared_json : ctypes array
        The loop's status, a :class:`palpate.live.ring.SharedJson`; ``"stopped": true`` at the end.
    shared_by_sink : dict
        Name of each sink, such as the diagnosis or the recorder, to its status.
    """

    samples: Memory
    estimates: Memory
    shared_json: Memory
    shared_by_sink: dict[str, Memory]


class Sink(Protocol):
    """Consumes the loop's results. A slow sink loses rows and counts them; the loop never waits.

    A sink with ``gently = False`` keeps its priority over other programs; else it yields to them.
    The loop computes the estimate 50 times a second, or for every sample if one sink has
    ``every_sample = True``.
    """

    @property
    def name(self) -> str:
        """Unique name of the sink."""

    def run(self, watching: "Watching", commands: Connection) -> None:
        """Run, in a separate process, until the loop has stopped: ``watching.wait(seconds)``.

        ``commands.send(LiveCommand(…))`` sends the loop a command.
        """


# The data that a sink reads.

#: Place of each column in a row.
PLACE = {name: k for k, name in enumerate(COLUMNS)}
_FIRST = PLACE["parameter_0"]
_COVARIANCE = PLACE["covariance_0"]


def unpack_parameters(rows: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Return the parameters (k, p) of a law, their standard errors and covariances (k, p, p)."""
    square = rows[:, _COVARIANCE : _COVARIANCE + MOST_PARAMETERS**2]
    square = square.reshape(-1, MOST_PARAMETERS, MOST_PARAMETERS)[:, :count, :count]
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diagonal(square, axis1=1, axis2=2))
    return rows[:, _FIRST : _FIRST + count], errors, square


_NUMBERS = ("stiffness", "damping")
#: Published in place of a verdict until there is a current one.
NOT_DIAGNOSED = "not diagnosed yet"
UNDIAGNOSED = "this run has no diagnosis: start it without --no-diagnosis"
NO_DIAGNOSIS_YET = "the first diagnosis has not finished yet"
_SINCE = {
    "method": "the estimator was changed since",
    "changes": "the material has changed since",
    "tare": "the force was tared since",
    "depth": "another working depth was chosen since",
}


def diagnosis_basis(status: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields on which a diagnosis depends; it is outdated as soon as one differs."""
    changes = status.get("counts", {}).get("changes", 0)
    method = [status.get("method"), status.get("generation")]
    shared = {name: status.get(name) for name in ("tare", "depth")}
    return {"method": method, "changes": changes, **shared}


def why_outdated(page: Mapping[str, Any], status: Mapping[str, Any]) -> str:
    """Return why the last diagnosis is outdated; empty if it is not."""
    now = diagnosis_basis(status)
    return " and ".join(words for name, words in _SINCE.items() if page["of"][name] != now[name])


def why_undiagnosed(page: Mapping[str, Any] | None, status: Mapping[str, Any]) -> str:
    """Return why no diagnosis holds; empty if the last one does."""
    if page is None or "of" not in page:
        return UNDIAGNOSED if page is None else NO_DIAGNOSIS_YET
    return why_outdated(page, status)


def diagnosis_fields(
    page: Mapping[str, Any] | None, status: Mapping[str, Any]
) -> dict[str, str | float]:
    """Return the published fields of a diagnosis; without numbers if it is outdated or None."""
    reason = why_undiagnosed(page, status)
    known: Mapping[str, Any] = {} if page is None or reason else page
    numbers: dict[str, Any] = next(iter(known.get("working_depths", ())), {})
    fields: dict[str, str | float] = {"answer": known.get("answer", "")}
    for name in _NUMBERS:
        there = numbers.get(name, {})
        errors = (or_nan(there.get(part)) for part in ("standard_error", "systematic"))
        fields |= {
            f"{name}_verdict": there.get("mark") or NOT_DIAGNOSED,
            f"{name}_reason": reason or there.get("reason") or known.get("reason", ""),
            f"diagnosed_{name}": or_nan(there.get("value")),
            f"diagnosed_{name}_standard_error": math.hypot(*errors),
        }
    time = 1e-9 * status.get("origin", 0) + known["window"][1] if known else math.nan
    return fields | {
        "diagnosed_depth": or_nan(numbers.get("depth")),
        "diagnosed_frequency": or_nan(known.get("frequency")),
        "diagnosis_time": time,
    }


class Watching:
    """Reads the rows and statuses of a session, from the loop's first row on, for one sink."""

    def __init__(self, session: Session, sink: str) -> None:
        self.reader = RowReader(session.samples, session.estimates)
        self.shared_json = SharedJson(session.shared_json)
        self.shared_json.read()  # a later read, while the loop writes, has this one at least
        self._others = {name: SharedJson(each) for name, each in session.shared_by_sink.items()}
        self._own = self._others.pop(sink)
        self.dropped = 0

    def take(self) -> Floats:
        """Return the rows since the last call, and count those that the ring lost."""
        rows, dropped = self.reader.take()
        self.dropped += dropped
        return rows

    def status(self) -> dict[str, Any]:
        """Return the loop's last status."""
        return self.shared_json.read()

    def others(self) -> dict[str, dict[str, Any]]:
        """Return the last status of each other sink."""
        return {name: shared_json.read() for name, shared_json in self._others.items()}

    def diagnosis(self, status: dict[str, Any]) -> dict[str, str | float]:
        """Return the published fields of the last diagnosis."""
        return diagnosis_fields(self.others().get("diagnosis"), status)

    def tell(self, page: dict[str, Any]) -> None:
        """Write the sink's status, with its number of lost rows."""
        self._own.write({**page, "dropped": self.dropped})

    @property
    def over(self) -> bool:
        """Whether the loop has stopped or crashed."""
        parent = multiprocessing.parent_process()
        orphaned = parent is not None and not parent.is_alive()
        return orphaned or bool(self.status().get("stopped"))

    def wait(self, seconds: float) -> bool:
        """Wait, and return whether the loop still runs."""
        time.sleep(seconds)
        return not self.over
