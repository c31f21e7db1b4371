"""A status line on the console while the loop runs, and a summary at its end."""

import math
import os
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from io import TextIOWrapper
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.errors import printable
from palpate.force_laws import FORCE_LAWS, ForceLaw
from palpate.live.choices import State
from palpate.live.sinks import (
    NOT_DIAGNOSED,
    PLACE,
    Watching,
    print_line,
    unpack_parameters,
    why_undiagnosed,
)
from palpate.live.view import (
    COUNTED,
    LiveVerdict,
    Numbers,
    answer,
    duration_rows,
    gain_texts,
    headline,
    seconds,
    verdict_on,
)
from palpate.method.estimators.estimate import Estimate
from palpate.output.results import view
from palpate.validation import Floats, or_nan

_IN_CONTACT = (State.CONTACT, State.CHANGED)
_LOOKED_AT_EVERY = 0.04  # s of the samples' clock between the penetrations used
_KEPT = 250
_LEAST = 5  # penetrations: ten seconds in contact; fewest for a median
# A shown number changes if it was off by this fraction for this long, s. At first it is also
# updated at growing intervals, up to the last of these, s.
_MOVED = 0.1
_FOR = 1.0
_SETTLED = 10.0


class _Steady:
    """A number of two digits that stays constant while the measured value changes little."""

    def __init__(self) -> None:
        self.value = self._since = self._began = math.nan
        self._wait = 0.0

    def see(self, measured: float, time: float) -> float:
        """Take the value measured at a time, s; return the number to show."""
        if abs(measured / self.value - 1.0) <= _MOVED:
            self._since = time
        if not 0.0 <= time - self._since < _FOR:
            self._began = time
            self._wait = _FOR
        elif time - self._began >= self._wait <= _SETTLED:
            self._wait *= 3.0  # the first values cover too little of the motion
        else:
            return self.value
        self.value = float(f"{measured:.1e}")
        self._since = time
        return self.value


class ShownDepth:
    """Recent median penetration in contact; it stays constant while the motion repeats."""

    def __init__(self) -> None:
        self._seen: deque[float] = deque(maxlen=_KEPT)
        self._tick = math.nan
        self._shown = _Steady()
        #: Depth, m, of two digits; NaN before the first contact.
        self.value = math.nan
        self._depth_of_law = _Steady()
        self._frequency = _Steady()

    def see(self, rows: Floats) -> None:
        """Update the depth from rows of the ring."""
        depths = rows[:, PLACE["penetration"]]
        times = rows[:, PLACE["time"]]
        touching = np.isin(rows[:, PLACE["state"]], _IN_CONTACT) & (depths > 0.0)
        depths = depths[touching]
        times = times[touching]
        ticks = times // _LOOKED_AT_EVERY
        for place in np.flatnonzero(np.diff(ticks, prepend=self._tick)).tolist():
            self._seen.append(depths[place])
            self._tick = ticks[place]
            if len(self._seen) >= _LEAST:
                self.value = self._shown.see(float(np.median(self._seen)), times[place])

    def verdict(
        self,
        status: dict[str, Any],
        time: float,
        depth: float = math.nan,
    ) -> LiveVerdict | None:
        """Return the verdict in a status, with a steady frequency, and depth if none is given."""
        verdict = verdict_on(status)
        # A probe that has not moved has neither.
        if verdict is None or not (verdict.law.depth > 0.0 and verdict.law.frequency > 0.0):
            return verdict
        steady = self._depth_of_law.see(verdict.law.depth, time)
        frequency = self._frequency.see(verdict.law.frequency, time)
        return verdict.at(depth if math.isfinite(depth) else steady, frequency)


def read_numbers(row: Floats, law: type[ForceLaw], depth: float) -> Numbers:
    """Return stiffness and damping of the estimate in a row of the ring, at a depth and at rest."""
    (parameters,), _, (covariance,) = unpack_parameters(row, len(law.symbols))
    if not (depth > 0.0 and np.isfinite(parameters).all()):
        return {}
    made = law.from_parameters(parameters)
    taken = Status(int(row[0, PLACE["status"]]))
    estimate = Estimate.from_law(made, covariance, status=taken, samples=1)
    return {"stiffness": estimate.stiffness_at(depth), "damping": estimate.damping_at(depth)}


def describe_depth(
    status: dict[str, Any],
    row: Floats,
    depth: float,
    verdict: LiveVerdict | None = None,
    found: dict[str, Any] | None = None,
) -> str:
    """Describe stiffness and damping with their marks, as diagnosed or, before, as estimated now.

    Parameters
    ----------
    status : dict
        Of the loop.
    row : numpy.ndarray
        The last row of the ring.
    depth : float
        m, of the present estimate.
    verdict : LiveVerdict, optional
        If the estimator compares laws.
    found : dict, optional
        The last status of the diagnosis.
    """
    if found and not why_undiagnosed(found, status) and found.get("numbers"):
        return answer(headline(found, status, {}, ""), reasons=False)
    kind = FORCE_LAWS.get(status.get("law", {}).get("kind", ""))
    if kind is None or not depth > 0.0:
        return "no contact yet"
    if row[PLACE["method"]] != status.get("generation"):
        return "another estimator starts"  # its law is not in the status yet
    if verdict:
        now = verdict.numbers()
        place = view.describe_place(depth, verdict.law.frequency)
    else:
        now = read_numbers(row[None], kind, depth)
        place = view.describe_place(depth)
    if not now:
        return str(verdict or "no estimate yet")
    return f"{answer(headline(found, status, now, place))}, {NOT_DIAGNOSED}"


# The status line where the loop was started, and the summary at the end.

_REFRESHED_EVERY = 0.2  # s, on a terminal
_LINE_EVERY = 1.0  # s, elsewhere
_OTHERS_END = 0.5  # s for the other sinks to write their last status


class Console:
    """Prints a status line: refreshed in place on a terminal, else one line per second.

    Parameters
    ----------
    quiet : bool
        Print only messages and the final summary. Default: False.
    """

    name = "console"

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet

    def run(self, watching: Watching, commands: Connection) -> None:
        """Print until the loop stops, then print the summary."""
        if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
            sys.stdout.reconfigure(errors="replace")
        self._watching = watching
        self._terminal = sys.stdout is not None and sys.stdout.isatty()
        self._depth = ShownDepth()
        self._said = list[str]()
        self._next = 0.0
        self._heard = True
        while self._watching.wait(_REFRESHED_EVERY) and self._heard:
            self._look()
        self._watching.wait(_OTHERS_END)
        self._look()
        self._clear()
        status = self._watching.status()
        if len(now := self._watching.reader.now()) and not self._quiet:
            # A short run may end before its first line.
            self._print(printable(self._line(status, now[0])))
        if status and not status.get("stopped"):
            self._print("the loop has ended unexpectedly; its last counts:")
        for line in summary(status, self._watching.others()):
            self._print(printable(line))

    def _print(self, text: str, end: str = "\n") -> None:
        self._heard = self._heard and print_line(text, end)

    def _look(self) -> None:
        self._depth.see(self._watching.take())
        status = self._watching.status()
        for sentence in self._new(status):
            self._clear()
            self._print(printable(sentence))
        now = self._watching.reader.now()
        if not self._quiet and len(now) and not status.get("stopped"):
            self._show(printable(self._line(status, now[0])))
        self._watching.tell({})

    def _line(self, status: dict[str, Any], row: Floats) -> str:
        counts = status.get("counts", {})
        wrong = [f"{counts[key]} {words}" for key, words in COUNTED.items() if counts.get(key)]
        lateness = status.get("lateness", {})
        state = "lost"  # then there is no new row
        if status.get("state") != "lost":
            state = State(int(row[PLACE["state"]])).name.lower()
        depth = or_nan(status.get("depth") or self._depth.value)
        verdict = self._depth.verdict(status, row[PLACE["arrived"]], depth)
        parts = [
            state.ljust(7),
            describe_depth(status, row, depth, verdict, self._watching.others().get("diagnosis")),
            *(wrong or ["none lost or late"]),  # a narrow terminal cuts off the end
            f"{counts.get('taken', 0)} samples, 99 % done within {seconds(lateness.get('p99'))}",
        ]
        return " · ".join(parts)

    def _new(self, status: dict[str, Any]) -> Iterator[str]:
        """Yield the messages since the last call."""
        others = self._watching.others().items()
        said = [*status.get("said", ())]
        said += [f"{name}: {page['said']}" for name, page in others if page.get("said")]
        yield from (sentence for sentence in said if sentence not in self._said)
        self._said = said

    def _show(self, line: str) -> None:
        if self._terminal:
            with suppress(OSError):
                line = line[: os.get_terminal_size(sys.stdout.fileno()).columns - 1]
            self._print(f"\r{line}\x1b[K", end="")
        elif time.monotonic() >= self._next:
            self._next = time.monotonic() + _LINE_EVERY
            self._print(line)

    def _clear(self) -> None:
        if self._terminal:
            self._print("\r\x1b[K", end="")


def summary(status: dict[str, Any], others: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Yield the lines that summarise a run, from the last statuses of the loop and the sinks."""
    counts = status.get("counts", {})
    if (found := others.get("diagnosis")) and not why_undiagnosed(found, status):
        yield from (answer([each]) for each in headline(found, status, {}, ""))
        yield from gain_texts(found, status)[1]
    if verdict := verdict_on(status):
        yield from verdict.lines()
    taken = counts.get("taken", 0)
    learned = counts.get("learned", 0)
    changes = f"{(count := counts.get('changes', 0))} material change{'' if count == 1 else 's'}"
    yield f"{status.get('source', '')}: {taken} samples, {learned} used, {changes}"
    yield "                     p50      p99    p99.9      max   in time"
    for words, *columns, limit in duration_rows(status):
        yield f"{words:<16}" + "".join(f"{column:>9}" for column in columns) + f"   {limit}"
    faults = {words: counts.get(key, 0) for key, words in COUNTED.items()}
    yield ", ".join(f"{n} {words}" for words, n in faults.items() if n or words == COUNTED["lost"])
    if last := counts.get("last_fault"):
        yield f"the last one refused: {printable(last)}"
    dropped = [
        f"all since it ended early by the {name}"
        if page.get("ended")
        else f"{page.get('dropped', 0)} by the {name}"
        for name, page in others.items()
    ]
    if dropped:
        yield f"rows dropped: {', '.join(dropped)}"
    if recorded := others.get("recorder", {}).get("said"):
        yield str(recorded)
