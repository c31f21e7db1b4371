"""A bar for what takes a while, on standard error, where a person looks at it."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

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
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda fraction: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from palpate.cli.printing import Terminal

    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Terminal(stderr=True), transient=True) as shown:
        task = shown.add_task(words, total=1.0)
        yield lambda fraction: shown.update(task, completed=fraction)
