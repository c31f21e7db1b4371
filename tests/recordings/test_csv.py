"""Tables of text: how they are laid out, what is refused by row and column, what is written."""

import codecs
import math

import numpy as np
import pandas
import pytest
from recordings import HEADER, SIGNALS, changed, recording, rows_of, text_of, written

from palpate import Columns, RecordingError, open_recording, prepare, write_contact
from palpate.input.preparation.velocity import velocity_of
from palpate.input.recordings.units import unit_in_name


def with_column(rows, values):
    return [[*row, str(value)] for row, value in zip(rows, values, strict=True)]


def test_a_good_file_is_read_exactly_with_its_provenance(tmp_path):
    path = recording(tmp_path)
    contact = prepare(path)
    for name in ("time", "penetration", "force"):
        assert np.array_equal(getattr(contact, name), getattr(SIGNALS, name))
    assert np.array_equal(contact.velocity, velocity_of(SIGNALS.time, SIGNALS.penetration))
    assert contact.source == str(path)
    assert list(contact.segments()) == [slice(0, 600)]
    assert contact.provenance["penetration"] == "column 'penetration_m'"
    assert contact.provenance["force"] == "column 'force_N'"
    assert "spline" in contact.provenance["velocity"]


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
def test_time_and_velocity_jump_between_segments_only(tmp_path, labels):
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
    "of blank lines": ("\n \n\n", ["empty"]),
    "of notes that say something": ("# by: me\n\n% of: a day\n", ["has only notes; expected a"]),
    "of Excel's first line and a note": ("sep=,\n#a: b", ["has only notes; expected a header"]),
    "of a header only": (",".join(HEADER) + "\n", ["the recording has no samples"]),
    "without a time column": (without(0), ["no channel looks like the time"]),
    "without a penetration column": (without(1), ["no position", "time_s, force_N"]),
    "without a force column": (without(2), ["no force", "time_s, penetration_m"]),
    "with a column twice": (
        text_of([["0", "1", "2", "3"]], (*HEADER, "force_N")),
        ["2 channels could be the force", "force_N (column 3), force_N (column 4)"],
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
    "of a picture": (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", ["neither a text file"]),
    "of zeros": (bytes(1000), ["neither a text file"]),
    "of noise without zeros": (NOISE.replace(b"\0", b"\1"), ["neither a text file"]),
    "of UTF-16 without a mark": (
        "time_s,force_N\n0,1\n".encode("utf-16-le"),
        ["neither a text file"],
    ),
    "of UTF-32": ("time_s,force_N\n0,1\n".encode("utf-32"), ["neither a text file"]),
    "of bytes that happen to be text": (bytes(range(1, 128)), ["neither a text file"]),
    "of an old Mac's lines": ("time_s,force_N\r0,1\r", ["carriage returns alone", "tr "]),
    "of a word in Latin-1": ("µ,time_s".encode("latin-1"), ["no force", "µ"]),
    "with a header of one endless word": ("x" * 200_000 + "\n1,2,3\n", ["row 1", "header"]),
    "of one endless line": ("x," * 10_000_000, ["exceeds 16 MiB"]),
    "with very many columns": (",".join(map(str, range(10_000))), ["no force", "9980 more"]),
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
        text_of([["0", "0,01", "5"], ["1", "1.00,5", "9"]], delimiter=";"),
        ["'penetration_m'", "row 3", "'1.00,5'"],
    ),
}  # fmt: skip
BAD_ROWS = {
    "a last row that is cut off": (with_row(599)[:-1], "row 601 is cut off"),
    # A disk that loses power leaves them.
    "zeros at the end": (text_of(rows_of()).encode() + bytes(3000), "row 602 is cut off"),
    "a last number that is cut off": (text_of(rows_of())[:-12], "row 601 is cut off"),
    "a row of too many cells": (changed(3, 1, "1,2"), "row 5 has more cells than the header"),
    "a zero byte": (changed(3, 1, "\0"), "row 5 contains zero bytes"),
    "an endless quotation": (
        text_of([*rows_of(), ['"0.7'], *[[f"{k}" * 9, "1", "2"] for k in range(50_000)]]),
        "row 602 has a quotation mark",
    ),
}  # fmt: skip


@pytest.mark.parametrize("content, words", BAD_CELLS.values(), ids=BAD_CELLS)
def test_a_bad_cell_becomes_nan_with_a_warning_or_strict_refuses(tmp_path, content, words):
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
def test_a_bad_row_is_skipped_with_a_warning_or_strict_refuses(tmp_path, content, words):
    path = written(tmp_path / "rows.csv", content)
    read = open_recording(path)
    [loss] = read.losses
    assert words in loss
    assert len(read.rows) == len(read.channel("force_N")) == len(content.splitlines()) - 2
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(path, strict=True)
    assert str(caught.value).startswith(f"{path}: ")
    assert "drop --strict" in str(caught.value)


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
    with pytest.raises(RecordingError, match=r"check the path|name a recording file") as caught:
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


COLUMNS = {"time": [0.0, 0.5, 1.25], "Fx": [-1.5, 2.0, 1e-3]}

TABLES = {
    "commas": "time,Fx\n0,-1.5\n0.5,2\n1.25,1e-3\n",
    "semicolons": "time;Fx\n0;-1.5\n0.5;2\n1.25;1e-3\n",
    "tabs": "time\tFx\n0\t-1.5\n0.5\t2\n1.25\t1e-3\n",
    "bars": "time | Fx\n0 | -1.5\n0.5 | 2\n1.25 | 1e-3\n",
    "a space": "time Fx\n0 -1.5\n0.5 2\n1.25 1e-3\n",
    "runs of spaces": "  time      Fx\n  0.00    -1.5\n  0.50     2.0  \n 1.25   1e-3\n",
    "spaces and tabs": "time \t Fx\n0 \t-1.5\n0.5\t 2\n1.25  1e-3\n",
    "a decimal comma": "time;Fx\n0;-1,5\n0,5;2\n1,25;1e-3\n",
    "a decimal comma and tabs": "time\tFx\n0\t-1,5\n0,5\t2\n1,25\t0,001\n",
    "a quoted decimal comma": 'time,Fx\n"0,0","-1,5"\n"0,5","2,0"\n"1,25","0,001"\n',
    "Excel's first line": "sep=;\ntime;Fx\n0;-1.5\n0.5;2\n1.25;1e-3\n",
    "quotes": '"time","Fx"\n"0","-1.5"\n"0.5","2"\n"1.25","1e-3"\n',
    "NumPy's header": "# time,Fx\n0,-1.5\n0.5,2\n1.25,1e-3\n",
    "MATLAB's header": "% time,Fx\n0,-1.5\n0.5,2\n1.25,1e-3\n",
    "a comma at the end of rows": "time,Fx\n0,-1.5,\n0.5,2,\n1.25,1e-3,\n",
    "notes": "# probe: 3\n#, 2 kHz\n\n# made by hand\ntime,Fx\n0,-1.5\n0.5,2\n1.25,1e-3\n",
    "spaces around the commas": "time , Fx\n0 , -1.5\n0.5 , 2\n1.25 , 1e-3\n",
    "empty lines at the end": "time,Fx\n0,-1.5\n0.5,2\n1.25,1e-3\n\n  \n\n",
    "no end of line at the end": "time,Fx\n0,-1.5\n0.5,2\n1.25,1e-3",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_a_table_is_read_however_it_is_divided(tmp_path, text):
    read = open_recording(written(tmp_path / "t.txt", text))
    assert {name: values.tolist() for name, values in read.channels.items()} == COLUMNS
    assert (list(read.losses), dict(read.faults)) == ([], {})


def test_without_a_header_columns_are_numbered_and_that_is_said(tmp_path):
    read = open_recording(written(tmp_path / "t.csv", "0.1,2\n0.2,3\n"))
    found = {name: values.tolist() for name, values in read.channels.items()}
    assert found == {"column 1": [0.1, 0.2], "column 2": [2.0, 3.0]}
    assert "numbered" in read.notes["header"]
    assert list(read.rows) == [1, 2]
    # A frame whose columns are numbered has a header.
    read = open_recording(written(tmp_path / "t.csv", ",0,1\n0,0.1,2\n1,0.2,3\n"))
    assert list(read.channels) == ["(column 1)", "0", "1"]
    assert read.channels["1"].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("row", ["s,mm,N", "[s],[mm],[N]", "(s),(mm),(N)", "s , mm , N"])
def test_a_row_of_units_is_no_sample_and_a_row_of_words_is(tmp_path, row):
    read = open_recording(written(tmp_path / "t.csv", f"time,pos,force\n{row}\n0,1,2\n1,2,3\n"))
    assert read.units == {"time": "s", "pos": "mm", "force": "N"}
    assert read.channels["pos"].tolist() == [1.0, 2.0]
    assert list(read.rows) == [3, 4]
    read = open_recording(written(tmp_path / "t.csv", "time,phase,remark\n0,s,\n1,m,\n"))
    assert (read.units, read.faults) == ({}, {})
    assert read.channels["phase"].tolist() == ["s", "m"]
    assert read.channels["remark"].tolist() == ["", ""]


NAMES = {
    "force_N": "N", "Fx [mN]": "mN", "penetration (mm)": "mm", "pos_mm": "mm", "time_ms": "ms",
    "t/s": "s", "v_m_s": "m/s", "speed_mm_s": "mm/s", "v / (mm/s)": "mm/s", "F/N": "N",
    "depth [μm]": "µm", "Tz_Nm": "Nm", "time [min]": "min", "velocity (m/s)": "m/s",
    "force_min": None, "velocity": None, "N": None, "/ft/N": None, "angle [deg]": None,
    "freq_hz": None, "in_impact": None, "": None, "Load (gf)": "gf", "Fz_kgf": "kgf",
    "Force [lbs]": "lb", "Force (KN)": "kN", "depth_in": "in", "Extension (in)": "in",
    "velocity m/s": "m/s", "force_N (column 3)": "N", "Fx (filtered) [cN]": "cN", "Load ozf": "ozf",
    "pos_in_base": None, "plug_in": None, "force_z": None, "fz_tool": None, "force_mn": None,
}  # fmt: skip


@pytest.mark.parametrize("name, unit", NAMES.items(), ids=repr)
def test_a_name_says_its_unit(name, unit):
    assert unit_in_name(name) == unit


VECTORS = ['"[0.1, 0.2, -3e-1]"', '"(0.1, 0.2, -0.3)"', "[0.1 0.2 -0.3]", "0.1 0.2 -0.3",
           '"array([0.1, 0.2, -0.3])"', '"[ 0.1   0.2\n -0.3]"', '"0.1, 0.2, -0.3"',
           '"array([0.1, 0.2, -0.3], dtype=float32)"', '"[[0.1], [0.2], [-0.3]]"']  # fmt: skip


@pytest.mark.parametrize("cell", VECTORS)
def test_a_vector_in_a_cell_is_a_channel_for_each_place(tmp_path, cell):
    read = open_recording(written(tmp_path / "v.csv", f"t,pos_mm,F\n0,{cell},1\n1,{cell},2\n"))
    columns = {"t": [0.0, 1.0], "F": [1.0, 2.0]}
    columns |= {f"pos_mm[{k}]": [value] * 2 for k, value in enumerate((0.1, 0.2, -0.3))}
    assert {name: values.tolist() for name, values in read.channels.items()} == columns
    assert read.units["pos_mm[2]"] == "mm"


def test_a_vector_of_another_length_is_not_known(tmp_path):
    read = open_recording(written(tmp_path / "v.csv", "t,p\n0,[1 2]\n1,[1 2 3]\n2,[3 4]\n"))
    assert read.faults["p[0]"].sample == 1
    assert read.faults["p[1]"].text == "[1 2 3]"
    assert np.isnan(read.channels["p[1]"][1])


@pytest.mark.parametrize("begin, end", [("x", "1.5"), ("1.50", "x")])
def test_the_majority_of_cells_decides_the_type_of_a_column(tmp_path, begin, end):
    """The column begins unlike the rest, over more rows than are looked at first."""
    rows = [f"{k},{begin if k < 1500 else end},{'x' if k % 2 else k}" for k in range(4000)]
    read = open_recording(written(tmp_path / "h.csv", "t,c,half\n" + "\n".join(rows) + "\n"))
    assert read.faults["half"].count == 2000
    if end == "x":  # the text is as it stood, not as a number was
        assert read.channels["c"].tolist() == [begin] * 1500 + [end] * 2500
    else:
        assert read.faults["c"].count == 1500
        assert read.channels["c"][1500] == 1.5


def test_only_the_channels_that_are_asked_for_are_read(tmp_path):
    path = written(tmp_path / "c.csv", "t,a.x,a.y,b\n0,1,2,3\n1,2,3,4\n")
    read = open_recording(path, ["t", "a"])
    assert list(read.channels) == ["t", "a.x", "a.y"]
    assert read.omissions == ("columns not requested: b",)
    with pytest.raises(ValueError, match=r"no column 'c'; available: t, a\.x, a\.y, b"):
        open_recording(path, ["c"])


@pytest.mark.parametrize("damage", [b'""\r\xf8', b'"a"\rb', b'"\r"\n""\r\xf8'])
def test_a_damaged_last_line_is_left_out(tmp_path, damage):
    whole = "time,Fx\n" + "".join(f"{0.001 * k:.3f},{k}\n" for k in range(400))
    read = open_recording(written(tmp_path / "d.csv", whole.encode() + damage))
    assert read.channels["Fx"][:400].tolist() == list(range(400))
    assert any("palpate skipped" in sentence for sentence in read.losses)


TEXT = "# who: Ærøskøbing\ntime_s,penetration_m,force_N,remark\n0,1,2,5 µm\n1,1,3,é\n"
ENCODINGS = {
    "UTF-8": (b"", "utf-8", None),
    "UTF-8 with a mark": (codecs.BOM_UTF8, "utf-8", None),
    "UTF-16 with a mark": (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16-LE"),
    "UTF-16, big end first": (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16-BE"),
    "Latin-1": (b"", "latin-1", "Windows-1252"),
    "Windows-1252": (b"", "cp1252", "Windows-1252"),
}


@pytest.mark.parametrize("mark, encoding, said", ENCODINGS.values(), ids=ENCODINGS)
@pytest.mark.parametrize("ending", ["\n", "\r\n"], ids=["unix", "windows"])
def test_a_text_is_read_in_its_encoding_which_is_said(tmp_path, mark, encoding, said, ending):
    text = TEXT.replace("5 µm", "5 “€”") if encoding == "cp1252" else TEXT
    content = mark + text.replace("\n", ending).encode(encoding)
    read = open_recording(written(tmp_path / "e.csv", content))
    assert read.channels["force_N"].tolist() == [2.0, 3.0]
    assert read.channels["remark"].tolist() == ["5 “€”" if encoding == "cp1252" else "5 µm", "é"]
    assert read.notes["who"] == "Ærøskøbing"
    assert read.notes.get("encoding") == said


# 2024-02-29 12:30:00 UTC: 19782 days from 1970 and 12.5 h.
SECONDS = (19782 * 24 + 12) * 3600 + 1800
NANOSECONDS = SECONDS * 10**9
DATES = {
    "2024-02-29T12:30:00": 0,
    "2024-02-29 12:30:00": 0,
    "2024-02-29T12:30": 0,
    "2024-02-29T12:30:00Z": 0,
    "2024-02-29T12:30:00.25Z": 250_000_000,
    "2024-02-29T12:30:00.123456789": 123_456_789,
    "2024-02-29T12:30:00.1234567899Z": 123_456_789,
    "2024-02-29T14:30:00.000000001+02:00": 1,
    "2024-02-29T05:30:00-0700": 0,
    '"2024-02-29 12:30:00,5"': 500_000_000,
    "2024/02/29/12:30:00.000004": 4000,
    "29.2.2024 12:30:00.5": 500_000_000 - 19782 * 86_400 * 10**9,  # only differences matter
}


def assert_times(read, name, times, unit):
    """Whole numbers of this unit, exact."""
    assert read.channels[name].dtype == np.int64
    assert read.channels[name].tolist() == times
    assert read.units[name] == unit


@pytest.mark.parametrize("cell, nanoseconds", DATES.items(), ids=DATES)
def test_a_date_is_nanoseconds_since_1970(tmp_path, cell, nanoseconds):
    read = open_recording(written(tmp_path / "t.csv", f"when,x\n{cell},1\n{cell},2\n"))
    assert_times(read, "when", [NANOSECONDS + nanoseconds] * 2, "ns")


def test_a_row_without_a_time_is_left_out_and_said(tmp_path):
    rows = ["2024-02-29T12:30:00", "", "2024-02-30T12:30:00", "2024-02-29T12:30:01"]
    text = "when,x\n" + "".join(f"{cell},{k}\n" for k, cell in enumerate(rows))
    read = open_recording(written(tmp_path / "t.csv", text))
    assert read.channels["x"].tolist() == [0.0, 3.0]
    assert list(read.rows) == [2, 5]
    [loss] = read.losses
    assert "skipped 2 rows" in loss
    assert loss.endswith("the first is row 3")
    with pytest.raises(RecordingError, match=r"row 3 \('2024-02-30T12.*'\) has no valid time in"):
        open_recording(written(tmp_path / "u.csv", text.replace(",1\n", "")), strict=True)


@pytest.mark.parametrize("unit, size", [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
@pytest.mark.parametrize("name", ["time", "%time", "field.header.stamp", "Timestamp", "t"])
def test_a_whole_number_since_1970_is_exact(tmp_path, unit, size, name):
    times = [SECONDS * size + k for k in range(3)]
    text = f"{name},x\n" + "".join(f"{time},1\n" for time in times)
    assert_times(open_recording(written(tmp_path / "t.csv", text)), name, times, unit)


@pytest.mark.parametrize(
    "name, first", [("rosbagTimestamp", NANOSECONDS), ("bag", NANOSECONDS), ("%time", 10**9)]
)
def test_whole_nanoseconds_are_times_by_their_size(tmp_path, name, first):
    times = [first + 10**6 * k for k in range(3)]
    text = f"{name},field.x\n" + "".join(f"{time},1\n" for time in times)
    read = open_recording(written(tmp_path / "t.csv", text))
    assert (read.channels[name].tolist(), read.units) == (times, {name: "ns"})


def test_a_large_number_is_a_time_only_by_its_name(tmp_path):
    read = open_recording(written(tmp_path / "t.csv", "t,n\n0,1700000000\n1,1700000001\n"))
    assert {values.dtype for values in read.channels.values()} == {np.dtype(float)}
    assert read.units == {}
    read = open_recording(written(tmp_path / "t.csv", "time,x\n1700000000.25,1\n1700000000.5,1\n"))
    assert read.channels["time"].tolist() == [1700000000.25, 1700000000.5]
    assert read.units["time"] == "s"


@pytest.mark.parametrize(
    "seconds, nanoseconds, name",
    [
        ("field.header.stamp.secs", "field.header.stamp.nsecs", "field.header.stamp"),
        ("/ft/header/stamp/sec", "/ft/header/stamp/nanosec", "/ft/header/stamp"),
        ("sec", "nsec", "stamp"),
    ],
)
def test_seconds_and_nanoseconds_make_one_stamp(tmp_path, seconds, nanoseconds, name):
    text = f"{seconds},{nanoseconds},x\n{SECONDS},999999999,1\n{SECONDS + 1},1,2\n"
    read = open_recording(written(tmp_path / "t.csv", text))
    assert_times(read, name, [NANOSECONDS + 10**9 - 1, NANOSECONDS + 10**9 + 1], "ns")
    assert seconds in read.channels


# One word or comma does not undo a table.

SMALL, LARGE = 998.25, 1_063_208.5
THOUSANDS = {
    "of commas and points": ('"{:,.3f}"', ","),
    "of commas alone": ('"{:,.0f}"', ","),
    "of points": ("{:,.3f}", ";"),
    "of apostrophes": ("{:,.3f}", "'"),
    "of narrow spaces": ("{:,.2f}", "\u202f"),
}


@pytest.mark.parametrize("form, mark", THOUSANDS.values(), ids=THOUSANDS)
def test_thousands_are_read(tmp_path, form, mark):
    german = str.maketrans(",.", ".,")
    cell = {";": lambda x: form.format(x).translate(german)}.get(
        mark, lambda x: form.format(x).replace(",", mark)
    )
    between = "," if form.startswith('"') else ";"
    point = "," if mark == ";" else "."
    values = np.linspace(SMALL, LARGE, 50)
    lines = [
        f"time{between}Load (mN)",
        *(f"{k}{point}5{between}{cell(v)}" for k, v in enumerate(values)),
    ]
    read = open_recording(written(tmp_path / "t.csv", "\n".join(lines) + "\n"))
    np.testing.assert_allclose(read.channels["Load (mN)"], values, atol=0.51)
    assert not read.faults


def test_an_ambiguous_comma_is_no_thousands_separator(tmp_path):
    text = "time;force\n0.5;1,063\n0.6;0,412\n0.7;1,204\n"
    read = open_recording(written(tmp_path / "t.csv", text))
    assert read.channels["force"].dtype.kind not in "fi"
    with pytest.raises(RecordingError, match="no position and no force; 'force' holds text"):
        prepare(read)


HEADERS = {
    "rostopic's": ("%time,field.header.frame_id,field.z,field.force", ","),
    "NumPy's": ("# time phase z force", " "),
    "with tabs": ("#time\tstate\tz\tforce", "\t"),
}


@pytest.mark.parametrize("header, mark", HEADERS.values(), ids=HEADERS)
def test_a_header_in_a_comment_stays_beside_a_column_of_words(tmp_path, header, mark):
    rows = [mark.join([f"{k}", "base", f"{-k}.5", f"{2 * k}"]) for k in range(4)]
    read = open_recording(written(tmp_path / "t.csv", "\n".join([header, *rows]) + "\n"))
    assert list(read.channels) == [
        name.lstrip("#") for name in header.removeprefix("# ").split(mark)
    ]
    assert [values[0] for values in read.channels.values()] == [0.0, "base", 0.5, 0.0]
    # Without any header the first row is a sample too; with one above words it is the header.
    read = open_recording(written(tmp_path / "t.csv", "\n".join(rows) + "\n"))
    assert [len(values) for values in read.channels.values()] == [4] * 4
    assert next(iter(read.channels)) == "column 1"


TIMES_OF_DAY = {
    "with points": ("13:59:59.990", "14:00:00.000"),
    "with commas": ('"13:59:59,990"', '"14:00:00,000"'),
    "across midnight": ("23:59:59.990", "00:00:00.000"),
    "of twelve hours": ("12:59:59.990 PM", "1:00:00.000 PM"),
    "in minutes and seconds": ("59:59.990", "60:00.000"),
}


@pytest.mark.parametrize("first, second", TIMES_OF_DAY.values(), ids=TIMES_OF_DAY)
def test_a_time_of_day_is_a_time(tmp_path, first, second):
    second = second.replace("60:00", "1:00:00")
    path = written(tmp_path / "t.csv", f"clock,depth_mm,force_N\n{first},1,2\n{second},2,3\n")
    contact = prepare(path)
    np.testing.assert_allclose(contact.time, [0.0, 0.01], atol=1e-12)
    cells = [cell.strip('"') for cell in (first, second)]
    frame = pandas.DataFrame({"clock": cells, "depth_mm": ["1,000.5", "2"], "force_N": ["2", "3"]})
    np.testing.assert_allclose(prepare(frame).time, [0.0, 0.01], atol=1e-12)
    assert prepare(frame).penetration[0] == pytest.approx(1.0005)
