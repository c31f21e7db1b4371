"""What the loop asks of a source."""

from typing import Any, Protocol

from palpate.live.arrivals import Arrival, Counts


class EndOfSourceError(Exception):
    """A source has no more samples, and will have none; in words, where that is a surprise."""


class Source(Protocol):
    """Where samples come from: a recording, the laboratory, or a robot on the wire.

    The loop's own thread calls all of it. ``take`` is the only place where the loop waits.

    A source may have more: ``offers``, a mapping of what it can be asked for to the choices;
    ``chosen``, what is chosen now; ``news()``, sentences since the last call; ``rest``, the time at
    its start in which nothing is touched, s; ``pace``, how fast its clock goes; and ``origin``,
    what its times are counted from, ns since 1970.
    """

    @property
    def name(self) -> str:
        """What a person calls it."""

    @property
    def sample_time(self) -> float:
        """Nominal time between samples, s."""

    @property
    def counts(self) -> Counts:
        """What was lost, repeated or malformed so far."""

    def open(self) -> None:
        """Begin to deliver.

        Raises
        ------
        PalpateError
            It cannot: the address is in use, the topic is of another type, the file is damaged.
        """

    def take(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None where none came in time [s].

        Raises
        ------
        EndOfSourceError
            There will be none.
        """

    def ask(self, options: dict[str, Any]) -> str:
        """Do what a person asks of the source itself; return what was done, in words.

        Raises
        ------
        InvalidParameterError
            It cannot do that.
        """

    def close(self) -> None:
        """Let go of files and sockets; may be called twice."""


def news_of(source: Source) -> list[str]:
    """What a source has to say since it was last asked."""
    news = getattr(source, "news", None)
    return news() if news is not None else []
