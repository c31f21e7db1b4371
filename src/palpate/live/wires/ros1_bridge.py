"""Between ROS 1 and palpate: run by a Python that has rospy, which may be another than palpate's.

It takes what to do from its first argument, in JSON, and speaks in frames through its standard
input and output: the length of what follows, uint32; a kind, one byte; the index of a topic, one
byte; and a body. Little-endian. rospy has a process of its own in any case: its threads would hold
the interpreter's lock while the loop needs it.
"""

import fcntl
import json
import os
import socket
import struct
import sys
import threading
import time
from contextlib import suppress
from typing import Any

HEAD = struct.Struct("<IBB")
STAMPED = struct.Struct("<qH")  # when a message came, ns since 1970; which publisher sent it
READY, FAILED, TYPE, MESSAGE = range(4)
PIPE = 1 << 20  # bytes: some 8000 messages wait in it
TIMEOUT = 5.0  # s: that the master may take to answer
LONGEST = 65_000  # bytes of a message; longer ones are passed on as nothing, to be counted


class Frames:
    """Writes frames, from any thread."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.lock = threading.Lock()

    def write(self, kind: int, index: int = 0, body: bytes = b"") -> None:
        """Write one."""
        data = memoryview(HEAD.pack(len(body), kind, index) + body)
        try:
            with self.lock:
                while data:
                    data = data[os.write(self.descriptor, data) :]
        except OSError:  # palpate has ended
            os._exit(0)


def joined(frames: Frames, task: dict[str, Any]) -> Any:
    """Join ROS as a node; the master has been found then."""
    try:
        import rosgraph
        import rospy
    except ImportError as error:
        frames.write(FAILED, 1, f"{sys.executable} cannot import rospy: {error}".encode())
        sys.exit(1)

    master = rosgraph.get_master_uri()
    socket.setdefaulttimeout(TIMEOUT)
    try:
        types = dict(rosgraph.Master("/palpate").getTopicTypes())
    except Exception as error:  # of sockets, XML, HTTP: whatever it is, there is no master
        words = f"no master of ROS answers at {master}: {error}"
        frames.write(FAILED, 0, " ".join(words.split()).encode())
        sys.exit(1)
    socket.setdefaulttimeout(None)
    for index, name in enumerate(task["topics"]):
        if name in types:
            frames.write(TYPE, index, types[name].encode())
    rospy.init_node("palpate", anonymous=True, disable_signals=True, disable_rosout=True)
    return rospy


def subscribe(rospy: Any, frames: Frames, task: dict[str, Any]) -> None:
    """Pass on every message of some topics, as bytes."""
    senders: dict[tuple[str, str, int], int] = {}

    def take(message: Any, index: int) -> None:
        now = time.time_ns()
        header = message._connection_header
        caller = header.get("callerid", ""), header.get("type", "*"), index
        if caller not in senders:
            senders[caller] = len(senders) % 65_536
            frames.write(TYPE, index, header.get("type", "*").encode())
        body = message._buff if len(message._buff) <= LONGEST else b""
        frames.write(MESSAGE, index, STAMPED.pack(now, senders[caller]) + body)

    for index, name in enumerate(task["topics"]):
        rospy.Subscriber(
            name, rospy.AnyMsg, take, callback_args=index, tcp_nodelay=True, buff_size=1 << 18
        )
    frames.write(READY)
    os.read(0, 1)  # until palpate closes its end


def publish(rospy: Any, frames: Frames, task: dict[str, Any]) -> None:
    """Publish every message that palpate writes."""
    publishers = []
    for name, (kind, checksum, text) in zip(task["topics"], task["types"], strict=True):
        made = type(
            "Message",
            (rospy.AnyMsg,),
            {"_type": kind, "_md5sum": checksum, "_full_text": text, "_has_header": False},
        )
        sender = rospy.Publisher(name, made, queue_size=task["queue"], tcp_nodelay=True)
        publishers.append((sender, made))
    frames.write(READY)
    with os.fdopen(0, "rb", buffering=1 << 16) as given:
        while len(head := given.read(HEAD.size)) == HEAD.size:
            length, _, index = HEAD.unpack(head)
            sender, made = publishers[index]
            message = made()
            message._buff = given.read(length)
            sender.publish(message)
    time.sleep(0.2)  # for what waits in rospy's queues


def main() -> None:
    """Do what the first argument says."""
    # What rospy prints is no frame.
    frames = Frames(os.dup(1))
    os.dup2(2, 1)
    with suppress(OSError):
        fcntl.fcntl(frames.descriptor, 1031, PIPE)  # F_SETPIPE_SZ, of Linux
    task = json.loads(sys.argv[1])
    rospy = joined(frames, task)
    (subscribe if task["mode"] == "subscribe" else publish)(rospy, frames, task)
    os._exit(0)


if __name__ == "__main__":
    sys.path.pop(0)  # this folder, whose modules are palpate's
    main()
