"""Texts in the encodings that recorders write."""

import pytest
from recordings import SIGNALS, rows_of, text_of, written

from palpate import RecordingError, open_recording, prepare

TEXT = "# who: Ærøskøbing\ntime_s,penetration_m,force_N,remark\n0,1,2,5 µm\n1,1,3,é\n"

ENCODINGS = {
    "UTF-8": (TEXT.encode(), None),
    "UTF-8 with a mark": (TEXT.encode("utf-8-sig"), None),
    "UTF-16 with a mark": (TEXT.encode("utf-16"), "UTF-16-LE"),
    "UTF-16, big end first": (b"\xfe\xff" + TEXT.encode("utf-16-be"), "UTF-16-BE"),
    "Latin-1": (TEXT.encode("latin-1"), "Windows-1252"),
}


@pytest.mark.parametrize("content, said", ENCODINGS.values(), ids=ENCODINGS)
@pytest.mark.parametrize("ending", ["\n", "\r\n"], ids=["unix", "windows"])
def test_a_text_is_read_in_its_encoding_which_is_said(tmp_path, content, said, ending):
    for encoding in ("utf-16-le", "utf-16-be"):
        if said == encoding.upper():
            content = content.replace("\n".encode(encoding), ending.encode(encoding))
    if said in (None, "Windows-1252"):
        content = content.replace(b"\n", ending.encode())
    read = open_recording(written(tmp_path / "e.csv", content))
    assert read.channels["force_N"].tolist() == [2.0, 3.0]
    assert read.channels["remark"].tolist() == ["5 µm", "é"]
    assert read.notes["who"] == "Ærøskøbing"
    assert read.notes.get("encoding") == said


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_numbers_are_the_same_to_the_last_bit(tmp_path, encoding):
    contact = prepare(written(tmp_path / "e.csv", text_of(rows_of()).encode(encoding)))
    assert (contact.force == SIGNALS.force).all()


def test_what_is_only_in_windows_1252_is_read_as_that(tmp_path):
    read = open_recording(written(tmp_path / "e.csv", b"t,remark\n0,\x80 5\n1,\x93a\x94\n"))
    assert read.channels["remark"].tolist() == ["€ 5", "“a”"]


def test_bytes_that_no_encoding_explains_are_refused_in_a_line(tmp_path):
    noise = bytes((37 * k * k + k) % 256 for k in range(5000))
    unmarked = [TEXT.encode(each) for each in ("utf-16-le", "utf-16-be", "utf-32")]
    others = noise.replace(b"\0", b"\1"), bytes(5000), b"\x7fELF" + bytes(100)
    for content in (noise, *others, *unmarked):
        path = written(tmp_path / "n.csv", content)
        with pytest.raises(RecordingError, match="not a text file"):
            open_recording(path)


def test_zeros_at_the_end_are_said(tmp_path):
    """A disk that loses power leaves them."""
    content = text_of(rows_of()).encode() + bytes(3000)
    read = open_recording(written(tmp_path / "z.csv", content))
    assert len(read.rows) == 600
    assert read.losses == ["row 602 is cut off, for the file ends within it: left out"]
