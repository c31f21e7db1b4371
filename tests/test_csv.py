"""Contacts read from CSV files: what is taken as it is, and what is refused by row and column."""

import math
from pathlib import Path

import numpy as np
import pytest
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written

from palpate import Columns, RecordingError, read_contact
from palpate.preparation.velocity import velocity_of


def with_column(rows, values):
    return [[*row, str(value)] for row, value in zip(rows, values, strict=True)]


def test_a_good_file_is_read_to_the_last_bit(tmp_path):
    path = recording(tmp_path)
    contact = read_contact(path)
    for name in ("time", "penetration", "force"):
        assert np.array_equal(getattr(contact, name), getattr(SIGNALS, name))
    assert np.array_equal(contact.velocity, velocity_of(SIGNALS.time, SIGNALS.penetration))
    assert contact.source == str(path)
    assert list(contact.segments()) == [slice(0, 600)]


def test_a_contact_says_how_each_channel_was_made(tmp_path):
    made = read_contact(recording(tmp_path)).made
    assert made["penetration"] == "column 'penetration_m'"
    assert made["force"] == "column 'force_N'"
    assert "Savitzky" in made["velocity"]


def test_a_path_may_be_text(tmp_path):
    assert len(read_contact(str(recording(tmp_path)))) == 600


def test_a_velocity_column_is_taken_as_it_is(tmp_path):
    rows = with_column(rows_of(), SIGNALS.velocity.tolist())
    path = written(tmp_path / "v.csv", text_of(rows, (*HEADER, "velocity_m_s")))
    contact = read_contact(path)
    assert np.array_equal(contact.velocity, SIGNALS.velocity)
    assert contact.made["velocity"] == "column 'velocity_m_s'"


def test_columns_of_other_names_are_mapped(tmp_path):
    rows = with_column(rows_of(), SIGNALS.velocity.tolist())
    path = written(tmp_path / "m.csv", text_of(rows, ("t", "depth", "Fz", "speed")))
    contact = read_contact(path, columns=Columns("t", "depth", "Fz", "speed"))
    assert np.array_equal(contact.force, SIGNALS.force)
    assert np.array_equal(contact.velocity, SIGNALS.velocity)


def test_columns_may_stand_in_any_order_among_others(tmp_path):
    rows = [["note", f, "7", x, t] for t, x, f in rows_of()]
    header = ("remark", "force_N", "gain", "penetration_m", "time_s")
    contact = read_contact(written(tmp_path / "o.csv", text_of(rows, header)))
    assert np.array_equal(contact.penetration, SIGNALS.penetration)
    assert np.array_equal(contact.force, SIGNALS.force)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"], ids=["comma", "semicolon", "tab"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"], ids=["unix", "windows", "old mac"])
def test_commas_semicolons_and_tabs_are_told_apart(tmp_path, delimiter, ending):
    text = text_of(rows_of(), delimiter=delimiter).replace("\n", ending)
    contact = read_contact(written(tmp_path / "d.csv", text))
    assert np.array_equal(contact.force, SIGNALS.force)


def quoted(text: str) -> str:
    return "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in text.split())


def spaced(text: str) -> str:
    return text.replace(",", " , ")


VARIANTS = {
    "a byte order mark": lambda text: "\ufeff" + text,
    "notes before the header": lambda text: "# probe 7\n#, 2 kHz\n\n" + text,
    "empty lines at the end": lambda text: text + "\n  \n\n",
    "no end of line at the end": lambda text: text.rstrip("\n"),
    "quotation marks": quoted,
    "spaces around the commas": spaced,
}


@pytest.mark.parametrize("change", VARIANTS.values(), ids=VARIANTS)
def test_how_a_file_is_written_does_not_matter(tmp_path, change):
    contact = read_contact(written(tmp_path / "v.csv", change(text_of(rows_of()))))
    assert np.array_equal(contact.time, SIGNALS.time)
    assert np.array_equal(contact.force, SIGNALS.force)


@pytest.mark.parametrize("labels", [list("aabbb"), [0, 0, 1, 1, 1], ["1.0", "1", "x", "x", "x"]])
def test_a_segment_column_marks_separate_contacts(tmp_path, labels):
    rows = with_column([["0.1", "1", "2"], ["0.2", "1", "2"], ["0", "1", "2"], ["0.1", "3", "2"],
                        ["0.2", "7", "2"]], labels)  # fmt: skip
    contact = read_contact(written(tmp_path / "s.csv", text_of(rows, (*HEADER, "segment"))))
    edges = [part.start for part in contact.segments()]
    assert edges[-1] == 2
    assert edges[0] == 0
    # Time runs back at the border only, and no velocity is taken across it.
    assert contact.velocity[:2].tolist() == [0.0, 0.0]
    assert contact.velocity[3] > 0.0


def test_not_a_number_is_a_value_that_is_not_known(tmp_path):
    rows = rows_of()
    rows[4][2], rows[5][1] = "nan", "NaN"
    contact = read_contact(written(tmp_path / "n.csv", text_of(rows)))
    assert math.isnan(contact.force[4])
    assert math.isnan(contact.penetration[5])
    assert np.isfinite(contact.force).sum() == 599


def changed(row: int, column: int, value: str) -> str:
    """The good file with one cell changed; row 0 is the first sample, on line 2."""
    rows = rows_of()
    rows[row][column] = value
    return text_of(rows)


def without(column: int) -> str:
    rows = [[cell for k, cell in enumerate(row) if k != column] for row in rows_of()]
    return text_of(rows, [name for k, name in enumerate(HEADER) if k != column])


def shortened(row: int) -> str:
    lines = text_of(rows_of()).splitlines()
    lines[row + 1] = lines[row + 1].rsplit(",", 1)[0]
    return "\n".join(lines)


def blank_line(row: int) -> str:
    lines = text_of(rows_of()).splitlines()
    lines.insert(row + 1, "")
    return "\n".join(lines)


# Content, and the words that the one line must hold beside the file's name.
BAD_FILES = {
    "empty": ("", ["empty"]),
    "of blank lines": ("\n \n\n", ["empty"]),
    "of notes only": ("# nothing\n", ["empty"]),
    "of a header only": (",".join(HEADER) + "\n", ["header but no samples"]),
    "without a time column": (without(0), ["no column 'time_s'", "penetration_m, force_N"]),
    "without a penetration column": (without(1), ["no column 'penetration_m'", "--penetration"]),
    "without a force column": (without(2), ["no column 'force_N'", "time_s, penetration_m"]),
    "with a column twice": (
        text_of([["0", "1", "2", "3"]], (*HEADER, "force_N")), ["2 columns", "'force_N'"],
    ),
    "with text in a cell": (changed(10, 2, "n/a"), ["'force_N'", "row 12", "'n/a'"]),
    "with a decimal comma": (
        text_of([["0", "0,01", "5"], ["1", "0,02", "9"]], delimiter=";"),
        ["'penetration_m'", "row 2", "'0,01'"],
    ),
    "with an underscore in a number": (changed(0, 1, "1_0"), ["'penetration_m'", "row 2", "'1_0'"]),
    "with a long text in a cell": (changed(3, 1, "x" * 5000), ["'penetration_m'", "row 5"]),
    "with an empty cell": (changed(7, 1, ""), ["'penetration_m'", "row 9", "missing"]),
    "with a cell of spaces": (changed(7, 2, "  "), ["'force_N'", "row 9", "missing"]),
    "with a short row": (shortened(20), ["'force_N'", "row 22", "missing"]),
    "cut off in the last row": (shortened(599), ["'force_N'", "row 601", "missing"]),
    "with a blank line": (blank_line(5), ["'time_s'", "row 7", "missing"]),
    "with time running back": (changed(30, 0, "0.0285"), ["'time_s'", "row 32", "from 0.029 s"]),
    "with a time repeated": (changed(30, 0, "0.029"), ["'time_s'", "row 32", "repeats"]),
    "with a time not known": (changed(30, 0, "nan"), ["'time_s'", "row 32", "not finite"]),
    "with an endless time": (changed(599, 0, "inf"), ["'time_s'", "row 601", "not finite"]),
    "with the first time not known": (changed(0, 0, "nan"), ["'time_s'", "row 2", "not finite"]),
    "with notes, and text in a cell": (
        "# a\n# b\n" + changed(0, 1, "x"), ["'penetration_m'", "row 4", "'x'"],
    ),
    "of a picture": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", ["not a text file"]),
    "of zeros": (bytes(1000), ["not a text file"]),
    "of bytes that happen to be text": (bytes(range(1, 128)), ["no column 'time_s'"]),
    "in another encoding": (text_of(rows_of()).encode("utf-16"), ["not a text file"]),
    "with a header of one endless word": ("x" * 200_000 + "\n1,2,3\n", ["row 1", "header"]),
    "with very many columns": (",".join(map(str, range(50_000))), ["no column", "49980 more"]),
    "with an endless quotation": (
        text_of([*rows_of(), ['"0.7'], *[[f"{k}" * 9] for k in range(50_000)]]), ["row 602"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("content, words", BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_refused_by_file_column_and_row(tmp_path, content, words):
    path = written(tmp_path / "bad.csv", content)
    with pytest.raises(RecordingError) as caught:
        read_contact(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    for word in words:
        assert word in message
    assert len(message) < 600 + len(str(path))
    assert message.replace(str(path), "").isprintable()


def test_time_runs_back_at_a_segments_border_only(tmp_path):
    rows = with_column([["0", "1", "1"], ["1", "1", "1"], ["0", "1", "1"], ["0", "1", "1"]], "aabb")
    with pytest.raises(RecordingError, match="row 5: 0 s repeats"):
        read_contact(written(tmp_path / "s.csv", text_of(rows, (*HEADER, "segment"))))


def test_a_velocity_column_that_was_asked_for_has_to_exist(tmp_path):
    with pytest.raises(RecordingError, match="no column 'speed'"):
        read_contact(recording(tmp_path), columns=Columns(velocity="speed"))


def test_a_folder_and_a_path_to_nothing_are_refused(tmp_path):
    for path in (tmp_path, tmp_path / "absent.csv", Path(recording(tmp_path)) / "below.csv"):
        with pytest.raises(RecordingError) as caught:
            read_contact(path)
        assert str(caught.value).startswith(f"{path}: ")
