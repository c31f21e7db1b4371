"""What the loop's session asks of a sink, which runs in a process of its own."""

from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Protocol

from palpate.live.ring import Address


@dataclass(frozen=True, slots=True)
class Session:
    """How a sink finds what the loop writes.

    Attributes
    ----------
    ring : Address
        Every sample: :class:`palpate.live.ring.Reader`.
    board : str
        The loop's own words and statistics: :class:`palpate.live.board.Board`; ``"stopped": true``
        at the end.
    boards : dict
        The boards of other sinks, by their names: what the diagnosis or the recorder says.
    own : str
        The board that this sink may write.
    """

    ring: Address
    board: str
    boards: dict[str, str]
    own: str


class Sink(Protocol):
    """Consumes what the loop found; a slow one loses rows, and says how many, and holds nothing.

    It gives way to the programs of others too, unless it has ``gently = False``: where what it does
    must not wait.
    """

    @property
    def name(self) -> str:
        """By which its board is known."""

    def run(self, session: Session, commands: Connection) -> None:
        """Go on until the board says that the loop has stopped; called in a process of its own.

        ``commands.send(Command(…))`` asks the loop for something.
        """
