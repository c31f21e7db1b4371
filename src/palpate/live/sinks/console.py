"""A line of figures where the loop was started, and a summary at the end."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from io import TextIOWrapper
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from palpate.errors import printable
from palpate.live.law_numbers import law_lines
from palpate.live.sinks.figures import WorkingDepth, at_depth, percent, seconds
from palpate.live.sinks.printing import printed
from palpate.live.sinks.sink import Session
from palpate.live.sinks.watching import PLACE, Watching
from palpate.live.states import State
from palpate.live.verdict_on_laws import verdict_on

_REFRESHED_EVERY = 0.2  # s, on a terminal
_LINE_EVERY = 1.0  # s, elsewhere
_OTHERS_END = 0.5  # s that the other sinks have to say their last
#: What is counted, in the order of how grave it is; those that are 0 are left out of the line.
COUNTED = (
    ("lost", "lost before the loop"),
    ("malformed", "malformed"),
    ("unpaired", "unpaired"),
    ("refused", "refused"),
    ("repeated", "repeated"),
    ("disordered", "out of order"),
    ("gaps", "gaps"),
    ("jumps", "jumps of the clock"),
    ("silences", "silences"),
    ("late", "late"),
)


class Console:
    """One line, written anew where there is a terminal; else a line a second.

    Parameters
    ----------
    quiet : bool
        Only what is said, and the summary at the end.
    """

    name = "console"

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet

    def run(self, session: Session, commands: Connection) -> None:
        """Print until the loop stops, and then the summary."""
        if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
            sys.stdout.reconfigure(errors="replace")
        watching = Watching(session)
        terminal = sys.stdout is not None and sys.stdout.isatty()
        _Printing(watching, terminal=terminal, quiet=self._quiet).run()
        watching.close()


class _Printing:
    def __init__(self, watching: Watching, *, terminal: bool, quiet: bool) -> None:
        self._watching, self._terminal, self._quiet = watching, terminal, quiet
        self._depth, self._said = WorkingDepth(), list[str]()
        self._row, self._next, self._heard = np.empty(0), 0.0, True

    def run(self) -> None:
        while self._watching.wait(_REFRESHED_EVERY) and self._heard:
            self._look()
        self._watching.wait(_OTHERS_END)
        self._look()
        self._clear()
        status = self._watching.status()
        if len(self._row) and not self._quiet:  # a short run may end between two looks
            self._print(printable(_line(status, self._row, self._depth.value)))
        if status and not status.get("stopped"):
            self._print("the loop has ended without a word; this is what it counted last:")
        for line in summary(status, self._watching.others()):
            self._print(printable(line))

    def _print(self, words: str, end: str = "\n") -> None:
        self._heard = self._heard and printed(words, end)

    def _look(self) -> None:
        rows = self._watching.take().rows
        status = self._watching.status()
        if len(rows):
            self._row = rows[-1]
            self._depth.see(rows)
        for sentence in self._new(status):
            self._clear()
            self._print(printable(sentence))
        if not self._quiet and len(self._row) and not status.get("stopped"):
            self._show(printable(_line(status, self._row, self._depth.value)))
        self._watching.tell({})

    def _new(self, status: dict[str, Any]) -> Iterator[str]:
        """What was said since the last look: of the last sentences those that were not there."""
        said = [*status.get("said", ())]
        said += [f"{name}: {page['said']}" for name, page in self._others_saying()]
        for sentence in said:
            if sentence not in self._said:
                yield sentence
        self._said = said

    def _others_saying(self) -> list[tuple[str, dict[str, Any]]]:
        return [(name, page) for name, page in self._watching.others().items() if page.get("said")]

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


def _line(status: dict[str, Any], row: Any, depth: float) -> str:
    counts = status.get("counts", {})
    wrong = [f"{counts[key]} {words}" for key, words in COUNTED if counts.get(key)]
    lateness = status.get("lateness", {})
    state = State(int(row[PLACE["state"]])).name.lower()
    if status.get("state") == "lost":  # of which there is no row
        state = "lost"
    parts = [
        state.ljust(7),
        at_depth(status, row, depth),
        *(wrong or ["none lost or late"]),  # of a long line a narrow terminal has only the first
        f"{counts.get('taken', 0)} samples, 99 % within {seconds(lateness.get('p99'))}",
    ]
    return " · ".join(parts)


def summary(status: dict[str, Any], others: dict[str, dict[str, Any]]) -> Iterator[str]:
    """How a run went, in lines.

    Parameters
    ----------
    status : dict
        What the loop said last.
    others : dict
        What each sink said last, by its name.
    """
    counts = status.get("counts", {})
    if verdict := verdict_on(status):
        yield from law_lines(verdict)
    taken, learned = counts.get("taken", 0), counts.get("learned", 0)
    yield f"{status.get('source', '')}: {taken} samples, {learned} learned, " + _many(
        counts.get("changes", 0), "change"
    )
    yield "                     p50      p99    p99.9      max   in time"
    for name, words in (("cycle", "update, estimate"), ("lateness", "after its sample")):
        figures = status.get(name, {})
        known = figures if figures.get("count") else {}
        columns = [seconds(known.get(key)) for key in ("p50", "p99", "p99.9", "max")]
        limit = f"{percent(known.get('within'))} within {seconds(figures.get('limit'))}"
        yield f"{words:<16}" + "".join(f"{each:>9}" for each in columns) + f"   {limit}"
    yield ", ".join(f"{counts.get(key, 0)} {words}" for key, words in COUNTED)
    dropped = [f"{page.get('dropped', 0)} by the {name}" for name, page in others.items()]
    if dropped:
        yield f"rows dropped: {', '.join(dropped)}"
    if recorded := others.get("recorder", {}).get("said"):
        yield str(recorded)


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
