"""The process that has rospy, as palpate sees it: frames in, frames out."""

import importlib.util
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from palpate.errors import MissingExtraError, PalpateError
from palpate.live.wires.ros1_bridge import FAILED, HEAD, READY, TYPE

#: Of an address: where the master is.
OPTIONS = ("master",)
MASTER = "http://127.0.0.1:11311"
_BRIDGE = Path(__file__).with_name("ros1_bridge.py")
_SYSTEM = "/usr/bin/python3"  # for which Debian's and Ubuntu's packages of ROS 1 are
_PATIENCE = 20.0  # s: to import rospy takes 0.5 s, and the master 5 s at most to answer
_CHUNK = 1 << 16


class Frame(NamedTuple):
    """What the process says."""

    kind: int
    topic: int
    body: bytes


class Bridge:
    """A running process with rospy.

    Parameters
    ----------
    task : dict
        What it is to do.
    master : str
        URI of ROS's master; ``ROS_MASTER_URI`` or this machine's unless given.

    Raises
    ------
    MissingExtraError
        No Python here has rospy.
    PalpateError
        There is no master.
    """

    def __init__(self, task: dict[str, Any], master: str) -> None:
        self._buffer = bytearray()
        self.types: list[tuple[int, str]] = []
        environment = _environment(master or os.environ.get("ROS_MASTER_URI", MASTER))
        missing = []
        for python in _pythons():
            self._process = subprocess.Popen(
                [python, str(_BRIDGE), json.dumps(task)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,  # Ctrl-C is for palpate, which ends it
            )
            words = self._begin()
            if words is None:
                return
            self.close()
            missing.append(words)
        raise MissingExtraError(
            f"ros1: {'; '.join(missing)}; on Debian or Ubuntu: apt-get install python3-rospy"
        )

    def _begin(self) -> str | None:
        """Wait until it is ready; words, if this Python has no rospy."""
        until = time.monotonic() + _PATIENCE
        while (left := until - time.monotonic()) > 0.0:
            for frame in self.frames(left):
                if frame.kind == READY:
                    return None
                if frame.kind == TYPE:
                    self.types.append((frame.topic, frame.body.decode("utf-8", "replace")))
                elif frame.kind == FAILED:
                    words = frame.body.decode("utf-8", "replace")[:300]
                    if frame.topic:
                        return words
                    self.close()
                    raise PalpateError(f"ros1: {words}")
        self.close()
        raise PalpateError(f"ros1: rospy was not ready within {_PATIENCE:g} s")

    def waiting(self, seconds: float = 0.0) -> bool:
        """Whether something is there to be read, or comes in time."""
        assert self._process.stdout is not None
        return bool(select.select([self._process.stdout], [], [], max(seconds, 0.0))[0])

    def frames(self, seconds: float) -> Iterator[Frame]:
        """Give the frames that are there, or come in time.

        Raises
        ------
        PalpateError
            The process has ended.
        """
        if not self.waiting(seconds):
            return
        assert self._process.stdout is not None
        data = os.read(self._process.stdout.fileno(), _CHUNK)
        if not data:
            raise PalpateError("ros1: the process with rospy has ended")
        buffer = self._buffer
        buffer += data
        at = 0
        while at + HEAD.size <= len(buffer):
            length, kind, index = HEAD.unpack_from(buffer, at)
            end = at + HEAD.size + length
            if end > len(buffer):
                break
            yield Frame(kind, index, bytes(buffer[at + HEAD.size : end]))
            at = end
        del buffer[:at]

    def write(self, messages: Sequence[tuple[int, bytes]]) -> None:
        """Have messages published: the topic's index and the bytes of each."""
        assert self._process.stdin is not None
        data = b"".join(HEAD.pack(len(body), 0, index) + body for index, body in messages)
        try:
            self._process.stdin.write(data)
            self._process.stdin.flush()
        except OSError:
            raise PalpateError("ros1: the process with rospy has ended") from None

    def close(self) -> None:
        """End the process; may be called twice."""
        process = self._process
        for stream in (process.stdin, process.stdout):
            if stream is not None and not stream.closed:
                with suppress(OSError):
                    stream.close()
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _pythons() -> list[str]:
    """Those that may have rospy: ours, and the system's."""
    ours = importlib.util.find_spec("rospy") is not None
    return [*([sys.executable] if ours else []), *([_SYSTEM] if Path(_SYSTEM).exists() else [])]


def _environment(master: str) -> dict[str, str]:
    environment = {**os.environ, "ROS_MASTER_URI": master}
    environment.pop("PYTHONHOME", None)
    local = any(f"//{name}:" in master for name in ("127.0.0.1", "localhost"))
    if local and not {"ROS_IP", "ROS_HOSTNAME"} & environment.keys():
        environment["ROS_IP"] = "127.0.0.1"  # rospy then listens on this machine only
    return environment
