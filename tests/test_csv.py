"""CSV files: what is taken as it is, what is refused by row and column, and what is written."""

import math

import numpy as np
import pytest
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written

from palpate import Columns, RecordingError, open_recording, prepare, write_contact
from palpate.preparation.velocity import velocity_of


def with_column(rows, values):
    return [[*row, str(value)] for row, value in zip(rows, values, strict=True)]


def test_a_good_file_is_read_to_the_last_bit_and_says_how_each_channel_was_made(tmp_path):
    path = recording(tmp_path)
    contact = prepare(path)
    for name in ("time", "penetration", "force"):
        assert np.array_equal(getattr(contact, name), getattr(SIGNALS, name))
    assert np.array_equal(contact.velocity, velocity_of(SIGNALS.time, SIGNALS.penetration))
    assert contact.source == str(path)
    assert list(contact.segments()) == [slice(0, 600)]
    assert contact.provenance["penetration"] == "column 'penetration_m'"
    assert contact.provenance["force"] == "column 'force_N'"
    assert "Savitzky" in contact.provenance["velocity"]


def test_a_recording_holds_what_the_file_says_and_no_more(tmp_path):
    header = (*HEADER, "remark", "gain", "gain")
    rows = [["0", "1", "2", "a" * 100_000, "5", "7"], *[["1", "1", "3", "", "6", "8"]] * 3]
    path = written(tmp_path / "r.csv", "# probe: 7\n" + text_of(rows, header))
    read = open_recording(path)
    assert {name: channel[:2].tolist() for name, channel in read.channels.items()} == {
        "time_s": [0.0, 1.0],
        "penetration_m": [1.0, 1.0],
        "force_N": [2.0, 3.0],
        "remark": ["a" * 100_000, ""],
        # Columns of one name are told apart by their place.
        "gain (column 5)": [5.0, 6.0],
        "gain (column 6)": [7.0, 8.0],
    }
    assert read.channels["remark"].nbytes < 1000  # a long cell of text widens no other
    assert read.units == {"time_s": "s", "penetration_m": "m", "force_N": "N"}
    assert read.notes == {"probe": "7"}
    assert read.source == str(path)
    assert list(read.rows) == [3, 4, 5, 6]
    assert prepare(path, columns=Columns(force="gain (column 6)")).force[0] == 7.0


def test_columns_of_other_names_are_mapped_in_any_order(tmp_path):
    rows = with_column(rows_of(), SIGNALS.velocity.tolist())
    rows = [["note", f, "7", x, v, t] for t, x, f, v in rows]
    path = written(tmp_path / "m.csv", text_of(rows, ("remark", "Fz", "gain", "z", "speed", "t")))
    contact = prepare(path, columns=Columns("t", "z", "Fz", "speed"))
    assert np.array_equal(contact.force, SIGNALS.force)
    assert np.array_equal(contact.velocity, SIGNALS.velocity)


@pytest.mark.parametrize("labels", [list("aabbb"), [0, 0, 1, 1, 1], ["1.0", "1", "x", "x", "x"]])
def test_time_runs_back_and_velocity_jumps_at_a_segments_border_only(tmp_path, labels):
    times, depths = ["0.1", "0.2", "0", "0.1", "0.2"], "11137"
    rows = [[time, depth, "2"] for time, depth in zip(times, depths, strict=True)]
    header = (*HEADER, "segment")
    contact = prepare(written(tmp_path / "s.csv", text_of(with_column(rows, labels), header)))
    edges = [part.start for part in contact.segments()]
    assert (edges[0], edges[-1]) == (0, 2)
    assert contact.velocity[:2].tolist() == [0.0, 0.0]
    assert contact.velocity[3] > 0.0
    rows[3][0] = "0"
    with pytest.raises(RecordingError, match="row 5: 0 s repeats"):
        prepare(
            written(tmp_path / "s.csv", text_of(with_column(rows, labels), header)), strict=True
        )


def test_not_a_number_is_a_value_that_is_not_known(tmp_path):
    rows = rows_of()
    rows[4][2], rows[5][1] = "nan", "NaN"
    contact = prepare(written(tmp_path / "n.csv", text_of(rows)))
    assert math.isnan(contact.force[4])
    assert math.isnan(contact.penetration[5])
    assert np.isfinite(contact.force).sum() == 599
    # A last number need not end its line.
    text = text_of([[f"{k}", "1", "2.5" if k == 50 else "2.25"] for k in range(99)])
    for last in ("99,1,2.5", "99,1,-2.25"):
        read = open_recording(written(tmp_path / "l.csv", text + last))
        assert (len(read.rows), list(read.losses)) == (100, [])


def changed(row: int, column: int, value: str) -> str:
    """The good file with one cell changed; row 0 is the first sample, on line 2."""
    rows = rows_of()
    rows[row][column] = value
    return text_of(rows)


def without(column: int) -> str:
    rows = [[cell for k, cell in enumerate(row) if k != column] for row in rows_of()]
    return text_of(rows, [name for k, name in enumerate(HEADER) if k != column])


def with_row(row: int, *cells: str) -> str:
    rows = rows_of()
    rows[row] = list(cells) or rows[row][:-1]
    return text_of(rows)


REMARKED = (*HEADER, "remark")
NOISE = bytes((37 * k * k + k) % 256 for k in range(5000))
# Content, and the words that the one line must hold beside the file's name.
BAD_FILES = {
    "empty": ("", ["empty"]),
    "of notes that say something": ("# by: me\n\n% of: a day\n", ["holds notes only; expected a"]),
    "of Excel's first line and a note": ("sep=,\n#a: b", ["holds notes only; expected a header"]),
    "of a header only": (",".join(HEADER) + "\n", ["columns but no samples"]),
    "without a time column": (without(0), ["no channel looks like the time"]),
    "without a penetration column": (without(1), ["no column 'penetration_m'", "time_s, force_N"]),
    "without a force column": (without(2), ["no column 'force_N'", "time_s, penetration_m"]),
    "with a column twice": (
        text_of([["0", "1", "2", "3"]], (*HEADER, "force_N")),
        ["2 could be the force", "force_N (column 3), force_N (column 4)"],
    ),
    # What follows a remark of two lines stands a line further down.
    "with time running back behind two lines": (
        text_of([["0", "1", "1", '"two\nlines"'], ["1", "1", "1"], ["0.5", "1", "1"]], REMARKED),
        ["row 5: 0.5 s runs back"],
    ),
    "with time running back": (changed(30, 0, "0.0285"), ["'time_s'", "row 32", "from 0.029 s"]),
    "with a time not known": (changed(30, 0, "nan"), ["'time_s'", "row 32", "not finite"]),
    "with words for numbers": (
        "# a\n# b\n" + text_of([["0", "x", "1"], ["1", "y", "1"], ["2", "0.1", "1"]]),
        ["'penetration_m'", "row 4", "'x'"],
    ),
    "of a picture": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", ["not a text file"]),
    "of zeros": (bytes(1000), ["not a text file"]),
    "of noise without zeros": (NOISE.replace(b"\0", b"\1"), ["not a text file"]),
    "of UTF-16 without a mark": ("time_s,force_N\n0,1\n".encode("utf-16-le"), ["not a text file"]),
    "of UTF-32": ("time_s,force_N\n0,1\n".encode("utf-32"), ["not a text file"]),
    "of bytes that happen to be text": (bytes(range(1, 128)), ["not a text file"]),
    "of an old Mac's lines": ("time_s,force_N\r0,1\r", ["carriage returns alone", "tr "]),
    "of a word in Latin-1": ("µ,time_s".encode("latin-1"), ["no column", "µ"]),
    "with a header of one endless word": ("x" * 200_000 + "\n1,2,3\n", ["row 1", "header"]),
    "of one endless line": ("x," * 10_000_000, ["a line of more than 16 MiB"]),
    "with very many columns": (",".join(map(str, range(10_000))), ["no column", "9980 more"]),
    "with more columns than any table": ("," * 99_999, ["100000 columns", "at most 65536"]),
    "of rows that are all but empty": ("," * 5_000 + "\n" + "1\n" * 9, ["row 2", "half"]),
    "of rows longer than the header": ("a,b\n1,2,3\n1,2,3\n", ["row 2", "more cells", "row 2"]),
}

# What is left out and said, unless every row has to be read.
BAD_CELLS = {
    "text in a cell": (changed(10, 2, "n/a"), ["'force_N'", "row 12", "'n/a'"]),
    "an empty cell": (changed(7, 1, ""), ["'penetration_m'", "row 9", "missing"]),
    "a short row": (with_row(20), ["'force_N'", "row 22", "missing"]),
    "a blank line": (with_row(5, ""), ["'time_s'", "row 7", "missing"]),
    "notes, and text in a cell": (
        "# a\n# b\n" + changed(0, 1, "x"), ["'penetration_m'", "row 4", "'x'"],
    ),
    "a point beside decimal commas, which may mark thousands": (
        text_of([["0", "0,01", "5"], ["1", "1.002", "9"], ["2", "0,03", "9"]], delimiter=";"),
        ["'penetration_m'", "row 3", "'1.002'"],
    ),
    "two decimal marks": (
        text_of([["0", "0,01", "5"], ["1", "1.002,5", "9"]], delimiter=";"),
        ["'penetration_m'", "row 3", "'1.002,5'"],
    ),
}  # fmt: skip
BAD_ROWS = {
    "a last row that is cut off": (with_row(599)[:-1], "row 601 is cut off"),
    # A disk that loses power leaves them.
    "zeros at the end": (text_of(rows_of()).encode() + bytes(3000), "row 602 is cut off"),
    "a last number that is cut off": (text_of(rows_of())[:-12], "row 601 is cut off"),
    "a row of too many cells": (changed(3, 1, "1,2"), "row 5 has more cells than the header"),
    "a zero byte": (changed(3, 1, "\0"), "row 5 holds zero bytes"),
    "an endless quotation": (
        text_of([*rows_of(), ['"0.7'], *[[f"{k}" * 9, "1", "2"] for k in range(50_000)]]),
        "row 602 cannot be read: a quotation",
    ),
}  # fmt: skip


@pytest.mark.parametrize("content, words", BAD_CELLS.values(), ids=BAD_CELLS)
def test_a_bad_cell_is_not_known_and_said_unless_all_must_be_read(tmp_path, content, words):
    read = open_recording(written(tmp_path / "cells.csv", content))
    name = words[0].strip("'")
    fault = read.faults[name]
    numbers = read.numbers(name)
    assert fault.count == np.isnan(numbers).sum() == 1
    assert np.isnan(numbers[fault.sample])
    with pytest.raises(RecordingError) as caught:
        read.numbers(name, strict=True)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("content, words", BAD_ROWS.values(), ids=BAD_ROWS)
def test_a_bad_row_is_left_out_and_said_unless_all_must_be_read(tmp_path, content, words):
    path = written(tmp_path / "rows.csv", content)
    read = open_recording(path)
    [loss] = read.losses
    assert words in loss
    assert len(read.rows) == len(read.channel("force_N")) == len(content.splitlines()) - 2
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(path, strict=True)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("content, words", BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_refused_by_file_column_and_row(tmp_path, content, words):
    path = written(tmp_path / "bad.csv", content)
    with pytest.raises(RecordingError) as caught:
        prepare(path, strict=True)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    for word in words:
        assert word in message
    assert len(message) < 600 + len(str(path))
    assert message.replace(str(path), "").isprintable()


@pytest.mark.parametrize("name", ["", "absent.csv", "probe.csv/below.csv", "a" * 300, "zero\0.csv"])
def test_a_path_to_no_file_is_refused_in_words(tmp_path, name):
    recording(tmp_path)
    with pytest.raises(RecordingError, match=r"check the path|give the file") as caught:
        prepare(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: ")


def test_a_written_contact_is_read_back_with_its_notes_and_its_segments(tmp_path):
    given = prepare(**vars(SIGNALS), segment=np.arange(600) // 200, provenance={"tare": "none"})
    write_contact(given, tmp_path / "w.csv")
    assert "velocity" not in (tmp_path / "w.csv").read_text()  # which can be worked out
    write_contact(given, tmp_path / "w.csv", {"made by": "a test"}, velocity=True)
    read = prepare(tmp_path / "w.csv")
    for name in ("time", "penetration", "velocity", "force"):
        expected = getattr(given, name)
        atol = 1e-7 * np.abs(expected).max()  # seven digits
        np.testing.assert_allclose(getattr(read, name), expected, rtol=1e-6, atol=atol)
    assert list(read.segments()) == list(given.segments())
    assert read.provenance["made by"] == "a test"
    assert read.provenance["tare"] == "none"
