"""A bar for what takes a while, on standard error, where a person looks at it."""

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from palpate.errors import printable

if TYPE_CHECKING:
    from collections.abc import Callable

    from palpate.recordings import Recording

Item = TypeVar("Item")


def opened(
    file: Path, channels: Sequence[str] | None, *, strict: bool, curve: int | None
) -> "Recording":
    """Open a recording, with a bar while it is read."""
    from palpate.recordings import open_recording

    with bar(f"reading {file}") as progress:
        return open_recording(file, channels, strict=strict, curve=curve, progress=progress)


def counted(items: Sequence[Item], words: str) -> Iterable[Item]:
    """Go through items, with a bar."""
    with bar(words) as progress:
        for k, item in enumerate(items):
            yield item
            progress((k + 1) / len(items))


@contextmanager
def bar(words: str) -> Iterator["Callable[[float], None]"]:
    """Show how much of something is done; nothing where standard error is no terminal."""
    if not sys.stderr.isatty():
        yield lambda fraction: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from palpate.cli.printing import Terminal

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Terminal(stderr=True), transient=True) as shown:
        task = shown.add_task(printable(words), total=1.0)
        yield lambda fraction: shown.update(task, completed=fraction)


@contextmanager
def rated(words: str) -> Iterator["Callable[[int, int], None]"]:
    """Show how many of how many are done, how many a second, and the time left.

    Nothing where standard error is no terminal.
    """
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    from palpate.cli.printing import Terminal

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Terminal(stderr=True), transient=True) as shown:
        task = shown.add_task(printable(words), total=None, rate="")
        first: list[tuple[float, int]] = []

        def advance(done: int, total: int) -> None:
            now = time.monotonic()
            if not first:  # what was there already took no time
                first.append((now, done))
            begun, before = first[0]
            rate = f"{(done - before) / (now - begun):.3g}/s" if done > before else ""
            shown.update(task, completed=done, total=total, rate=rate)

        yield advance
