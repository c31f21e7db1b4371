"""The SQLite files of bags of ROS 2 (``.db3``), read without a trace beside them."""

import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from palpate.recordings.messages.blocks import Block
from palpate.recordings.messages.collection import Collection
from palpate.recordings.messages.files import name_of, opened
from palpate.recordings.messages.schemas import topic_of
from palpate.recordings.messages.topic import Topic

_BATCH = 8 << 20  # bytes of messages that are held at once
# Rows are taken out of their tuples so often that Python's garbage collector, which runs every 700
# new ones, has no reason to: it would take two thirds of the time.
_ROWS = 256
_KINDS = (int, int, bytes, int)
_LONGEST = 1_000_000_000  # bytes of a value, by SQLite's own limit
_LAST_ROW = (1 << 63) - 1
_SMALLEST_ROW = 8  # bytes, in the file
# Damaged places that are passed over; at each some 100 rows are looked for, in some 10 ms.
_MOST_GAPS = 200


def read_into(path: Path, collection: Collection, part: tuple[float, float] = (0.0, 1.0)) -> None:
    """Read a file into a collection, which may have others too.

    Parameters
    ----------
    path : Path
        The file.
    collection : Collection
        Takes the messages.
    part : tuple of float
        Of all that is to be read, for the progress.
    """
    words = name_of(path)
    with opened(path, collection) as file:
        begin = file.read(16)
    if not begin.startswith(b"SQLite format 3\0"):
        raise collection.error(f"{words} is no SQLite database", "record it again")
    try:
        with _settled(path) as (name, size), closing(sqlite3.connect(name, uri=True)) as database:
            _Database(database, words, size, collection, part).read()
    except (sqlite3.Error, OSError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise collection.error(
            f"{words} cannot be read: {reason}", "sqlite3 FILE .recover may save some of it"
        ) from None


@contextmanager
def _settled(path: Path) -> Iterator[tuple[str, int]]:
    """The name by which SQLite opens a file and writes nothing; and its size.

    What a recorder that was killed left in a log beside the file is part of it: SQLite would write
    it into the file, so a copy is read.
    """
    logs = [path.with_name(path.name + suffix) for suffix in ("-wal", "-journal")]
    logs = [log for log in logs if log.is_file() and log.stat().st_size]
    if not logs:
        name = quote(os.fsencode(path.absolute()))
        yield f"file:{name}?mode=ro&immutable=1", path.stat().st_size
        return
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        copy = Path(folder) / "bag.db3"
        shutil.copyfile(path, copy)
        for log in logs:
            shutil.copyfile(log, copy.with_name(copy.name + log.name[len(path.name) :]))
        size = sum(each.stat().st_size for each in (path, *logs))
        yield f"file:{quote(os.fsencode(copy))}", size


@dataclass(slots=True)
class _Rows:
    """Messages, and the number of the last one."""

    topics: list[int] = field(default_factory=list)
    times: list[int] = field(default_factory=list)
    texts: list[bytes] = field(default_factory=list)
    last: int = 0
    held: int = 0  # bytes

    def extend(self, rows: list[tuple[Any, ...]]) -> int:
        """Add rows, without those that are no messages; return how many these are."""
        self.last = rows[-1][3]
        columns = zip(zip(*rows, strict=True), _KINDS, strict=True)
        good = rows
        if any(set(map(type, column)) != {kind} for column, kind in columns):
            good = [row for row in rows if tuple(map(type, row)) == _KINDS]
        if good:
            topics, times, texts, _ = zip(*good, strict=True)
            self.topics += topics
            self.times += times
            self.texts += texts
            self.held += sum(map(len, texts))
        return len(rows) - len(good)


class _Database:
    def __init__(
        self,
        database: sqlite3.Connection,
        name: str,
        size: int,
        collection: Collection,
        part: tuple[float, float],
    ) -> None:
        self.database = database
        self.name = name
        self.size = size
        self.collection = collection
        self.part = part
        self.topics: dict[int, Topic] = {}
        self.bad = 0  # rows that are no messages
        self._step = _ROWS
        self._error: sqlite3.DatabaseError | None = None
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        # No value is longer than the file, whatever a schema would make of it.
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 1 << 20), _LONGEST))
        database.execute("PRAGMA trusted_schema = OFF")
        # Else SQLite refuses all of a file that is shorter than it says. Nothing is ever written.
        database.execute("PRAGMA writable_schema = ON")

    def read(self) -> None:
        self._check()
        self._find_topics()
        begin, end = self.part
        done = 0
        for rows in self._batches():
            done += self._take(rows)
            self.collection.request.report(begin + (end - begin) * min(done / self.size, 1.0))
        if self.bad:
            self._lost(f"{self.bad} rows are no messages")

    def _check(self) -> None:
        """Only tables: a view could go on for ever."""
        found = dict(
            self.database.execute(
                "SELECT name, type || ' ' || sql FROM sqlite_master "
                "WHERE name IN ('messages', 'topics', 'message_definitions')"
            )
        )
        for name in ("messages", "topics"):
            words = str(found.get(name, "")).upper()
            if not words.startswith("TABLE CREATE TABLE") or " AS " in words:
                raise self.collection.error(
                    f"{self.name} has no table {name!r} of a ROS 2 bag", "check the file"
                )

    def _find_topics(self) -> None:
        definitions: dict[str, tuple[str, bytes]] = {}
        try:
            for name, form, text in self.database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            ):
                definitions[str(name)] = str(form), str(text).encode()
        except sqlite3.Error:  # bags before ROS 2 Iron have none
            pass
        for number, name, type_name, encoding in self.database.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ):
            form, text = definitions.get(str(type_name), ("ros2msg", b""))
            form = form if form in ("ros2msg", "ros2idl") else "ros2msg"
            make = partial(topic_of, str(encoding), form, str(type_name), text)
            self.topics[number] = self.collection.topic(
                str(name), str(type_name), str(encoding), make, len(text)
            )

    def _batches(self) -> Iterator["_Rows"]:
        """All rows that can be selected: where pages are damaged, those before and after."""
        following = -(1 << 62)
        left = self.size // _SMALLEST_ROW  # a page may be found twice in a damaged tree
        for _ in range(_MOST_GAPS):
            try:
                cursor = self.database.execute(
                    "SELECT topic_id, timestamp, data, rowid FROM messages WHERE rowid >= ? "
                    "ORDER BY rowid",
                    (following,),
                )
                while (rows := self._fetch(cursor)).topics:
                    following = min(max(following, rows.last + 1), _LAST_ROW)
                    left -= len(rows.topics)
                    yield rows
                    if self._error:
                        raise self._error
                    if left < 0:
                        raise sqlite3.DatabaseError("rows are repeated without an end")
                return
            except sqlite3.DatabaseError as error:
                words = str(error)
            self._error = None
            self._step = 1 if self._step > 1 else _ROWS
            if self._step == 1:  # once more, up to the very row
                continue
            found = self._readable_from(following)
            if found is None:
                self._lost(f"{words}: the messages from number {max(following, 1)} on are lost")
                return
            self._lost(f"{words}: messages {max(following, 1)} to {found - 1} are lost")
            following = found
        self._lost(f"the messages from number {following} on are lost: there were more gaps before")

    def _fetch(self, cursor: sqlite3.Cursor) -> "_Rows":
        """Some rows; those before an error, which is kept, where there are any."""
        rows = _Rows()
        try:
            while rows.held < _BATCH and (some := cursor.fetchmany(self._step)):
                self.bad += rows.extend(some)
        except sqlite3.DatabaseError as error:
            if not rows.topics:
                raise
            self._error = error
        return rows

    def _readable_from(self, number: int) -> int | None:
        """The first row from a number on that can be read again, where it is beyond damage."""
        low, step = max(number, 0), 1
        while not self._reads(low + step):
            step *= 2
            if low + step > _LAST_ROW or step > 1 << 40:
                return None
        bad, good = low + step // 2, low + step
        while good - bad > 1:
            middle = (bad + good) // 2
            if self._reads(middle):
                good = middle
            else:
                bad = middle
        return good

    def _reads(self, number: int) -> bool:
        try:
            row = self.database.execute(
                "SELECT data FROM messages WHERE rowid >= ? ORDER BY rowid LIMIT 1", (number,)
            ).fetchone()
        except sqlite3.DatabaseError:
            return False
        return row is not None

    def _take(self, rows: "_Rows") -> int:
        """Take rows; return how many bytes they have."""
        data = np.frombuffer(b"".join(rows.texts), np.uint8)
        lengths = np.fromiter(map(len, rows.texts), np.int64, len(rows.texts))
        starts = np.cumsum(lengths) - lengths
        numbers = np.array(rows.topics)
        logged = np.array(rows.times, np.int64)
        for number in np.unique(numbers).tolist():
            which = numbers == number
            topic = self.topics.get(number)
            if topic is None:
                self.bad += int(which.sum())
                continue
            topic.add(Block(data, starts[which], lengths[which], logged[which]))
        return len(data)

    def _lost(self, sentence: str) -> None:
        self.collection.lost(f"{self.name}: {sentence}")
