"""Bytes of a text file: in which encoding they are, and how they become lines."""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from palpate.errors import RecordingError

HEAD = 1 << 16  # bytes that tell the encoding
BLOCK = 4 << 20  # bytes that are parsed at once
LONGEST_LINE = 1 << 20  # bytes
# Of a picture or an archive a tenth are control characters, and of noise too; of text none, but for
# what a bit that flipped makes of a letter.
MOST_CONTROLS = 0.02

_MARKS = {  # UTF-32 before UTF-16, whose mark it begins with
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
    codecs.BOM_UTF8: "utf-8",
}
_CONTROLS = bytes({*range(32), 127} - set(b"\t\n\r\f\x1b"))


@dataclass(slots=True)
class Text:
    """The lines of a text in any encoding, in blocks of UTF-8 that end where a line does.

    Attributes
    ----------
    chunks : iterator of bytes
        What the file holds.
    source : str
        Its name, for messages.
    encoding : str
        In which it is: found when the first block is asked for, ``"windows-1252"`` when the first
        bytes are met that no UTF-8 has.
    losses : list of str
        What was not read, in sentences.
    cut_off : bool
        Whether the last line, which has come by then, had no end.
    """

    chunks: Iterator[bytes]
    source: str
    encoding: str = "utf-8"
    losses: list[str] = field(default_factory=list)
    cut_off: bool = False

    def blocks(self) -> Iterator[bytes]:
        r"""Yield whole lines, each with its ``\n``, some megabytes at a time.

        Raises
        ------
        RecordingError
            This is no text, or its first line is too long for any.
        """
        rest = bytearray()  # what came since the last block
        empty = b""  # lines without anything, which may be the last ones
        given = False
        for chunk in self._in_utf8():
            rest += chunk
            if b"\n" not in chunk and len(rest) - rest.rfind(b"\n") > LONGEST_LINE:
                break
            if len(rest) < BLOCK:
                continue
            whole = empty + _taken(rest)
            block = _without_empty_end(whole)
            empty = whole[len(block) :]
            if block:
                given = True
                yield block
            if len(empty) > LONGEST_LINE or len(rest) > LONGEST_LINE:
                empty = b""
                break
        else:
            self.cut_off = bool(rest[rest.rfind(b"\n") + 1 :].strip())
            if last := _without_empty_end(empty + rest + b"\n"):
                yield last
            return
        if last := _without_empty_end(empty + _taken(rest)):
            given = True
            yield last
        self._too_long(given)

    def decode(self, block: bytes) -> str:
        """Return some lines as text; what is no UTF-8 is Windows-1252, or else Latin-1."""
        if self.encoding == "utf-8":
            try:
                return block.decode()
            except UnicodeDecodeError:
                self.encoding = "windows-1252"
        if self.encoding == "windows-1252":
            try:
                return block.decode("cp1252")
            except UnicodeDecodeError:
                return block.decode("latin-1")
        return block.decode(errors="replace")  # it was encoded here

    def _in_utf8(self) -> Iterator[bytes]:
        head = b""
        for chunk in self.chunks:
            head += chunk
            if len(head) >= HEAD:
                break
        self.encoding, mark = self._encoding_of(head)
        begin = head[mark:]
        ends = _Ends(alone=b"\n" not in begin and b"\n\0" not in begin)
        if self.encoding == "utf-8":
            yield ends.of(begin)
            yield from map(ends.of, self.chunks)
        else:
            decoder = codecs.getincrementaldecoder(self.encoding)("replace")
            ends = _Ends(alone="\n" not in begin.decode(self.encoding, "replace"))
            yield ends.of(decoder.decode(begin).encode(errors="replace"))
            for chunk in self.chunks:
                yield ends.of(decoder.decode(chunk).encode(errors="replace"))
            yield ends.of(decoder.decode(b"", final=True).encode(errors="replace"))
        yield ends.held

    def _encoding_of(self, head: bytes) -> tuple[str, int]:
        """The encoding, and the length of the mark that says it."""
        for mark, encoding in _MARKS.items():
            if head.startswith(mark):
                return encoding, len(mark)
        if b"\0" in head[:HEAD]:
            for encoding, zeros in (("utf-16-le", 1), ("utf-16-be", 0)):
                others = head[1 - zeros : HEAD : 2]
                # Every other byte is zero, or nearly so where some letters are not Latin.
                if head[zeros:HEAD:2].count(0) > 0.9 * len(others) and others.count(0) == 0:
                    return encoding, 0
        begin = head[:HEAD].rstrip(b"\0")  # a disk that lost power leaves zeros at the end
        controls = len(begin) - len(begin.translate(None, _CONTROLS))
        if (head and not begin) or controls > MOST_CONTROLS * len(begin):
            raise RecordingError(
                f"{self.source}: not a text file, and of no other format that is known by its "
                "content; expected a table, such as CSV"
            )
        return "utf-8", 0

    def _too_long(self, anything: bool) -> None:
        what = f"a line of more than {LONGEST_LINE >> 20} MiB"
        if not anything:
            raise RecordingError(f"{self.source}: row 1 is {what}, which is no header of a table")
        self.losses.append(f"{what} ends what could be read")


@dataclass(slots=True)
class _Ends:
    r"""One kind of line end, ``\n``; ``\r`` alone counts where the text has no other."""

    alone: bool
    held: bytes = b""

    def of(self, chunk: bytes) -> bytes:
        if self.alone:
            return chunk.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        chunk = self.held + chunk
        self.held = b""
        if b"\r" not in chunk:
            return chunk
        if chunk.endswith(b"\r"):  # its other half may come
            kept = chunk.rstrip(b"\r")
            chunk, self.held = kept, chunk[len(kept) :]
        return re.sub(rb"\r+\n", b"\n", chunk)


def _taken(rest: bytearray) -> bytes:
    """The whole lines, which are taken out."""
    cut = rest.rfind(b"\n") + 1
    lines = bytes(memoryview(rest)[:cut])
    del rest[:cut]
    return lines


def _without_empty_end(lines: bytes) -> bytes:
    stripped = len(lines.rstrip(b" \t\f\r\n"))
    return lines[: lines.find(b"\n", stripped) + 1] if stripped else b""
