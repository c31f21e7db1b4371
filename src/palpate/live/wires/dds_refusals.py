"""What Cyclone DDS itself refuses: it says so in its log only, of which the lines are counted."""

import os
import threading

_LONGEST = 80  # characters of what is shown
#: In a line of the log.
_SIGNS = ("malformed packet", "deserialization", "invalid data")


class Refusals:
    """Counts refused packets of all domains of this process.

    Cyclone DDS writes a line for each into a file, which is a pipe here; a thread reads it as it
    comes, since a pipe that is full would hold up what receives.

    Attributes
    ----------
    path : str
        The file; empty where the system has no names for pipes.
    """

    def __init__(self) -> None:
        self._count, self._words = 0, ""
        self.path = ""
        if os.path.isdir("/proc/self/fd"):  # noqa: PTH112 - a Path is not needed for this
            ours, theirs = os.pipe()
            self.path = f"/proc/self/fd/{theirs}"
            threading.Thread(target=self._count_lines, args=(ours,), daemon=True).start()

    def _count_lines(self, descriptor: int) -> None:
        rest = b""
        while data := os.read(descriptor, 1 << 16):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                words = line.decode("utf-8", "replace")
                if any(sign in words for sign in _SIGNS):
                    self._count += 1
                    self._words = words.partition("]")[2].strip()
            rest = rest[:4096]

    def since(self, count: int) -> tuple[int, str]:
        """Return how many there were after the first ``count``, and what the last one was."""
        return self._count - count, self._words.partition(" <")[0][:_LONGEST]

    @property
    def count(self) -> int:
        """How many there were so far."""
        return self._count

    @property
    def configuration(self) -> str:
        """What Cyclone DDS has to know."""
        if not self.path:
            return ""
        return (
            '<CycloneDDS><Domain id="any"><Tracing><Verbosity>warning</Verbosity>'
            f"<OutputFile>{self.path}</OutputFile></Tracing></Domain></CycloneDDS>"
        )
