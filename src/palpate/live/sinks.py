"""What becomes of what the loop found: what a sink is asked, what it sees, and how it prints."""

import math
import multiprocessing
import sys
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Protocol

import numpy as np

from palpate.live.ring import COLUMNS, MOST_PARAMETERS, Address, RowReader, SharedJson, Taken
from palpate.validation import Floats
from palpate.writing import abandon_output

# Printing where the loop was started, which nobody may hear any more.


def printed(words: str, end: str = "\n") -> bool:
    """Print at once; whether somebody hears it.

    Where nobody does, as the reader is gone or the disk is full, nothing more is tried: not on the
    way out either, where Python would complain.
    """
    try:
        print(words, end=end, flush=True)
    except (OSError, ValueError):
        abandon_output()
        return False
    return sys.stdout is not None


# What the loop's session asks of a sink, which runs in a process of its own.


@dataclass(frozen=True, slots=True)
class Session:
    """How a sink finds what the loop writes.

    Attributes
    ----------
    samples, estimates : Address
        Every sample, and the estimates: :class:`palpate.live.ring.RowReader`.
    board : str
        The loop's own words and statistics: :class:`palpate.live.ring.SharedJson`;
        ``"stopped": true`` at the end.
    boards : dict
        The boards of other sinks, by their names: what the diagnosis or the recorder says.
    own : str
        The board that this sink may write.
    """

    samples: Address
    estimates: Address
    shared_json: str
    shared_by_sink: dict[str, str]
    own: str


class Sink(Protocol):
    """Consumes what the loop found; a slow one loses rows, and says how many, and holds nothing.

    It gives way to the programs of others too, unless it has ``gently = False``: where what it does
    must not wait. The loop computes the estimate 50 times a second, unless a sink has
    ``every_sample = True``.
    """

    @property
    def name(self) -> str:
        """By which its board is known."""

    def run(self, session: Session, commands: Connection) -> None:
        """Go on until the board says that the loop has stopped; called in a process of its own.

        ``commands.send(Command(…))`` asks the loop for something.
        """


# What a sink sees of the loop.

#: Place of each column in a row.
PLACE = {name: k for k, name in enumerate(COLUMNS)}
_FIRST, _COVARIANCE = PLACE["parameter_0"], PLACE["covariance_0"]


def parameters_of(rows: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """The parameters (k, p) of a law, their standard errors, and their covariances (k, p, p)."""
    square = rows[:, _COVARIANCE : _COVARIANCE + MOST_PARAMETERS**2]
    square = square.reshape(-1, MOST_PARAMETERS, MOST_PARAMETERS)[:, :count, :count]
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diagonal(square, axis1=1, axis2=2))
    return rows[:, _FIRST : _FIRST + count], errors, square


#: In place of a verdict, until there is one of what the loop does now.
NOT_DIAGNOSED = "not diagnosed yet"
_SINCE = {
    "method": "another estimator runs now",
    "changes": "the material has changed since",
    "tare": "the force was tared since",
}


def basis_of(status: dict[str, Any]) -> dict[str, Any]:
    """What a diagnosis is of; it is another one's as soon as one of these is another."""
    changes = status.get("counts", {}).get("changes", 0)
    method = [status.get("method"), status.get("generation")]
    return {"method": method, "changes": changes, "tare": status.get("tare")}


def outdated(page: dict[str, Any], status: dict[str, Any]) -> str:
    """Why the last diagnosis is not of what the loop does now; nothing where it is."""
    now = basis_of(status)
    return " and ".join(words for name, words in _SINCE.items() if page["of"][name] != now[name])


def diagnosis_of(page: dict[str, Any] | None, status: dict[str, Any]) -> dict[str, str | float]:
    """What a reader needs of a diagnosis, None without one; no verdict where it is outdated."""
    marks = dict.fromkeys(("overall", "stiffness", "damping"), NOT_DIAGNOSED)
    time = math.nan
    if page is None or "of" not in page:
        reason = "nothing diagnoses this loop" if page is None else "the first diagnosis is to come"
    elif since := outdated(page, status):
        reason = since
    else:
        reason, marks = page["reason"], page["verdict"] or marks
        time = 1e-9 * status.get("origin", 0) + page["window"][1]
    return {
        "verdict": marks["overall"],
        "stiffness_verdict": marks["stiffness"],
        "damping_verdict": marks["damping"],
        "reason": reason,
        "diagnosis_time": time,
    }


class Watching:
    """Rows and boards of a session, and whether the loop still runs.

    The first rows are those that the loop wrote first, however long this process took to begin.

    Parameters
    ----------
    session : Session
        Where they are.
    """

    def __init__(self, session: Session) -> None:
        self.reader = RowReader(session.samples, session.estimates)
        self.shared_json = SharedJson(session.shared_json)
        self._own = SharedJson(session.own)
        self._others = {
            name: SharedJson(each)
            for name, each in session.shared_by_sink.items()
            if each != session.own
        }
        self.dropped = 0

    def take(self) -> Taken:
        """Return the rows since the last call; what was lost of them is counted."""
        taken = self.reader.take()
        self.dropped += taken.dropped
        return taken

    def status(self) -> dict[str, Any]:
        """What the loop said last."""
        return self.shared_json.read()

    def others(self) -> dict[str, dict[str, Any]]:
        """What the other sinks said last."""
        return {name: shared_json.read() for name, shared_json in self._others.items()}

    def diagnosis(self, status: dict[str, Any]) -> dict[str, str | float]:
        """What the last diagnosis says of what the loop does now."""
        return diagnosis_of(self.others().get("diagnosis"), status)

    def tell(self, page: dict[str, Any]) -> None:
        """Write the sink's own board, with the rows that it lost."""
        self._own.write({**page, "dropped": self.dropped})

    @property
    def over(self) -> bool:
        """Whether the loop has stopped, or is gone without a word."""
        parent = multiprocessing.parent_process()
        orphaned = parent is not None and not parent.is_alive()
        return orphaned or bool(self.status().get("stopped"))

    def wait(self, seconds: float) -> bool:
        """Wait; whether the loop still runs."""
        time.sleep(seconds)
        return not self.over

    def close(self) -> None:
        """Let go of the memory."""
        self.reader.close()
        for each in (self.shared_json, self._own, *self._others.values()):
            each.close()
