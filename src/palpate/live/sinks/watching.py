"""What a sink sees of the loop."""

import multiprocessing
import time
from typing import Any

from palpate.live.board import Board
from palpate.live.ring import COLUMNS, Reader, Taken
from palpate.live.sinks.sink import Session

#: Place of each column in a row.
PLACE = {name: k for k, name in enumerate(COLUMNS)}


class Watching:
    """Ring and boards of a session, and whether the loop still runs.

    The first rows are those that the loop wrote first, however long this process took to begin.

    Parameters
    ----------
    session : Session
        Where they are.
    """

    def __init__(self, session: Session) -> None:
        self._reader, self._board = Reader(session.ring), Board(session.board)
        self._own = Board(session.own)
        self._others = {
            name: Board(each) for name, each in session.boards.items() if each != session.own
        }
        self.dropped = 0

    def take(self) -> Taken:
        """Return the rows since the last call; what was lost of them is counted."""
        taken = self._reader.take()
        self.dropped += taken.dropped
        return taken

    def go_back(self, to: int) -> None:
        """Take the rows from a count on again."""
        self._reader.go_back(to)

    def status(self) -> dict[str, Any]:
        """What the loop said last."""
        return self._board.read()

    def others(self) -> dict[str, dict[str, Any]]:
        """What the other sinks said last."""
        return {name: board.read() for name, board in self._others.items()}

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
        self._reader.close()
        for each in (self._board, self._own, *self._others.values()):
            each.close()
