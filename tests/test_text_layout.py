"""What a table of text looks like is found: encoding, delimiter, header, units, vectors, times."""

import codecs

import numpy as np
import pytest
from recordings import written

from palpate import open_recording
from palpate.recordings.recording import unit_in_name

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
def test_what_most_cells_hold_counts_wherever_they_stand(tmp_path, begin, end):
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
    assert read.omissions == ("columns that were not asked for: b",)
    with pytest.raises(ValueError, match=r"no column 'c'; there are t, a\.x, a\.y, b"):
        open_recording(path, ["c"])


@pytest.mark.parametrize("damage", [b'""\r\xf8', b'"a"\rb', b'"\r"\n""\r\xf8'])
def test_a_damaged_last_line_is_left_out(tmp_path, damage):
    whole = "time,Fx\n" + "".join(f"{0.001 * k:.3f},{k}\n" for k in range(400))
    read = open_recording(written(tmp_path / "d.csv", whole.encode() + damage))
    assert read.channels["Fx"][:400].tolist() == list(range(400))
    assert any("left out" in sentence for sentence in read.losses)


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
    assert "2 rows were left out" in loss
    assert "row 3" in loss


@pytest.mark.parametrize("unit, size", [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
@pytest.mark.parametrize("name", ["time", "%time", "field.header.stamp", "Timestamp", "t"])
def test_a_whole_number_since_1970_is_exact(tmp_path, unit, size, name):
    times = [SECONDS * size + k for k in range(3)]
    text = f"{name},x\n" + "".join(f"{time},1\n" for time in times)
    assert_times(open_recording(written(tmp_path / "t.csv", text)), name, times, unit)


def test_a_number_of_that_size_is_no_time_by_another_name_and_a_fraction_stays(tmp_path):
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
