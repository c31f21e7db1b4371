"""What palpate raises. Every message says what is wrong, where, and what to do."""

import warnings
from importlib import import_module
from typing import Any


def printable(words: str) -> str:
    """``words`` in signs that a terminal shows; it obeys others, which are spelled out."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in words)


class PalpateError(Exception):
    """Any error of palpate's own."""


class InvalidParameterError(PalpateError, ValueError):
    """An argument is outside its range: the message names it, its value and the range."""


class RecordingError(PalpateError, ValueError):
    """A recording cannot be used: the message names the file, the column and the row."""

    @classmethod
    def of(cls, source: str, words: str) -> "RecordingError":
        """Return the error of a file, if that is known."""
        return RecordingError(f"{source}: {words}" if source else words)


class ExportRefusedError(PalpateError, ValueError):
    """A law is not exported, and why: the message says what allows it, where anything does.

    Attributes
    ----------
    statement : Statement
        What was found before it was refused.
    """

    def __init__(self, words: str, statement: Any = None) -> None:
        super().__init__(words)
        self.statement = statement


class FleetError(PalpateError, RuntimeError):
    """A fleet cannot run: its scheduler, its workers or its folder of results; what to do."""


class MissingChannelError(RecordingError):
    """A recording has no channel of the name that was looked for.

    Attributes
    ----------
    channel : str
        The name.
    available : list of str
        What there is.
    """

    def __init__(self, channel: str, available: list[str], source: str = "") -> None:
        super().__init__(channel, available, source)
        self.channel = channel
        self.available = available
        self.source = source

    def __str__(self) -> str:
        where = f"{self.source}: " if self.source else ""
        return f"{where}no column {self.channel!r}; there are {_listed(self.available)}"


def _listed(names: list[str]) -> str:
    """The names that a person can read on a line."""
    shown = [name[:40] if name.isprintable() else repr(name[:40]) for name in names[:20]]
    more = [f"{len(names) - 20} more"] if len(names) > 20 else []
    return ", ".join(shown + more) or "none at all"


class MissingExtraError(PalpateError, ImportError):
    """An optional dependency is absent: the message names the extra that brings it."""

    @classmethod
    def of(cls, error: ImportError, what: str, extra: str) -> "MissingExtraError":
        """Return the error of a package that cannot be imported, and that something needs."""
        package = (error.name or "a package").partition(".")[0]
        return cls(f"{what} needs {package}: pip install 'palpate[{extra}]'")


def needed(module: str, what: str, extra: str) -> Any:
    """Return a module of an extra.

    Raises
    ------
    MissingExtraError
        It is not installed; the message says what needs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError.of(error, what, extra) from None


# Names before 0.1, kept for one release.


class OldName:
    """An attribute or method under its old name: it warns, and gives what has the new name."""

    def __init__(self, new: str) -> None:
        self._new = new

    def __set_name__(self, _: type, name: str) -> None:
        self._old = name

    def __get__(self, owner: Any, kind: type) -> Any:
        warn_renamed(f"{kind.__name__}.{self._old}", self._new)
        return getattr(kind if owner is None else owner, self._new)


def warn_renamed(old: str, new: str) -> None:
    """Warn whoever used an old name."""
    warnings.warn(f"{old} is now called {new}", DeprecationWarning, stacklevel=3)
