"""Reports with a table in them, as testing machines export them, and files that look like one."""

import numpy as np
import pytest
from recordings import written

import palpate
from palpate import RecordingError, open_recording, prepare

BALL = palpate.HuntCrossley(K=6000.0, B=3000.0, n=1.3)
TIME = np.arange(600) * 0.01


def press(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Penetration, m, negative in free air, and force, N, of a probe that presses the ball."""
    phase = np.clip(2 * np.pi * 1.2 * (TIME - 1.0), 0.0, 6 * np.pi)
    depth = 0.002 - 0.006 * np.cos(phase)
    velocity = np.gradient(depth, TIME)
    inside = np.clip(depth, 0.0, None)
    force = np.where(depth > 0.0, BALL.force(inside, velocity), 0.0)
    return depth, force + 0.01 * np.random.default_rng(seed).standard_normal(TIME.size)


DEPTH, FORCE = press()
ROWS = list(zip(TIME.tolist(), DEPTH.tolist(), FORCE.tolist(), strict=True))


def lines(form: str, *scales: float) -> str:
    """The rows as text; the scales are those of time, depth and force."""
    scaled = ([value * scale for value, scale in zip(row, scales, strict=True)] for row in ROWS)
    return "".join(form.format(*row) + "\n" for row in scaled)


# Raw data as Bluehill exports it to CSV: parameters ``Group : name``, a table of results, then
# names and units of the channels, every number between quotation marks.
INSTRON = (
    'Test : Rate 1,"60.00000",mm/min\nGeneral : Start Date,"05 January 2026"\n'
    'Specimen : Thickness,"12.50000",mm\n\nResults Table 1\n,Maximum Load,Extension at Max,Energy\n'
    ',(N),(mm),(J)\n1,"18.2","8.00","0.05"\n2,"18.1","8.00","0.05"\n\n'
    "Time,Extension,Load\n(s),(mm),(N)\n" + lines('"{:.5f}","{:.5f}","{:.5f}"', 1.0, 1e3, 1.0)
)
# testXpert exports to text as in the control panel of the computer: here German, Windows-1252.
ZWICK = (
    "Prüfer;Müller\nVorkraft;0,1;N\nPrüfgeschwindigkeit;60;mm/min\n\n"
    "Prüfzeit;Standardweg;Standardkraft\ns;mm;N\n" + lines("{:.4f};{:.5f};{:.5f}", 1.0, 1e3, 1.0)
).replace(".", ",")
# Specification for the LabVIEW Measurement File (.lvm), ni.com/tutorial/4139: X_Columns No.
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tNo\nTime_Pref\tRelative\n"
    "Date\t2026/01/05\nTime\t10:00:00.1234567\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t600\t600\t\nDate\t2026/01/05\t2026/01/05\t\n"
    "Y_Unit_Label\tMillimeter\tNewton\t\nX_Dimension\tTime\tTime\t\n"
    "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\nDelta_X\t0.010000\t0.010000\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tPosition\tForce\tComment\n"
    + lines("\t{1:.6f}\t{2:.6f}\t", 1.0, 1e3, 1.0)
)
# Exponent, the software of the TA.XT analysers: a title a curve, names, units, grams by default.
TEXTURE = "ball_1,,\nForce,Distance,Time\n(g),(mm),(sec)\n\n" + lines(
    "{2:.4f},{1:.5f},{0:.3f}", 1.0, 1e3, 1e3 / 9.80665
)
# An optical micro-indenter: settings between tabs, then channels with units in their names.
INDENTER = (
    "Date\t05/01/2026\tTime\t10:00:00\tStatus\t0\nTip radius (um)\t3000\nk (N/m)\t25000\n"
    "Wavelength (nm)\t1565.2\nSMDuration (s)\t2\n\nControl mode:\tIndentation\n\n"
    "Time (s)\tLoad (uN)\tIndentation (nm)\tPiezo (nm)\tAuxiliary\n"
    + lines("{0:.4f}\t{2:.3f}\t{1:.3f}\t{1:.3f}\t0.5", 1.0, 1e9, 1e6)
)
# Trapezium exports a title a specimen, names, units, every cell between quotation marks.
TRAPEZIUM = '"1 _ 1",,\n"Time","Force","Stroke"\n"sec","N","mm"\n' + lines(
    '"{0:.4f}","{2:.5f}","{1:.5f}"', 1.0, 1e3, 1.0
)


def beside(head: str, form: str, count: int, *, missing: int = 0) -> str:
    """The rows with as many specimens side by side, the last one shorter."""
    rows = lines(form, 1.0, 1e3, 1.0).splitlines()
    blank = form.count(",") * ","
    columns = [rows] * (count - 1) + [rows[: len(rows) - missing] + [blank] * missing]
    return head + "".join(",".join(row) + "\n" for row in zip(*columns, strict=True))


NAMES = "Time,Load,Extension,"
SPECIMENS = {
    "names and units repeated": beside(
        f'"1 _ 1",,,"1 _ 2",,\n{NAMES}Time,Load,Extension\ns,N,mm,s,N,mm\n',
        "{0},{2:.5f},{1:.5f}",
        2,
    ),
    "names of the first alone": beside(
        f"{NAMES}Event,,,,\ns,N,mm,,,,,\nA,,,,B,,,\n\n", "{0},{2:.5f},{1:.5f},0", 2
    ),
    "a border between, one shorter": beside(
        "Time (s),Load (N),Extension (mm),,Time (s),Load (N),Extension (mm),\n",
        "{0},{2:.5f},{1:.5f},",
        2,
        missing=100,
    ),
    "three, and rows cut where two end": beside(
        NAMES * 3 + "\n" + "s,N,mm," * 3 + "\n", "{0},{2:.5f},{1:.5f}", 3, missing=50
    ).replace(",,\n", "\n"),
}
# Sketches and spreadsheets repeat names and units in each cell.
SERIAL = "Time: {0:.4f} s, Position: {1:.3f} mm, Force: {2:.4f} N"
WORDED = {
    "a serial monitor": lines(SERIAL, 1.0, 1e3, 1.0),
    "the Arduino's clock before it": lines("16:56:55.120 -> " + SERIAL, 1.0, 1e3, 1.0),
    "spaces alone": lines("t={0:.4f}s x={1:.3f}mm F={2:.4f}N", 1.0, 1e3, 1.0),
    "decimal commas": lines(SERIAL, 1.0, 1e3, 1.0).replace(".", ","),
    "units below names": "Time,Position,Force,state\n"
    + lines("{0:.4f} s,{1:.3f} mm,{2:.4f} N,ok", 1.0, 1e3, 1.0),
}
MACHINES = {
    "Trapezium": (TRAPEZIUM.encode(), "csv"),
    **{name: (text.encode(), "csv") for name, text in (SPECIMENS | WORDED).items()},
    "Instron": (INSTRON.encode(), "csv"),
    "Zwick": (ZWICK.encode("cp1252"), "txt"),
    "LabVIEW": (LABVIEW.replace("\n", "\r\n").encode(), "lvm"),
    "TA.XT": (TEXTURE.encode(), "csv"),
    "micro-indenter": (INDENTER.encode(), "txt"),
}


@pytest.mark.long
@pytest.mark.parametrize("content, suffix", MACHINES.values(), ids=MACHINES)
def test_a_ball_in_the_report_of_a_machine_has_its_true_stiffness(tmp_path, content, suffix):
    contact = prepare(written(tmp_path / f"report.{suffix}", content))
    found = palpate.identify(contact).dynamic_stiffness()
    true = BALL.stiffness_at(found.depth)
    error = found.stiffness.whole_error
    print(f"{found.stiffness.value:.1f} ± {error:.1f}, truth {true:.1f} N/m")
    assert abs(found.stiffness.value - true) < 3.0 * error
    assert error < 0.05 * true  # three specimens with the same noise are not independent
    count = content.count(b"Extension") if content.decode("latin-1") in SPECIMENS.values() else 1
    count = 2 if b"Event" in content else count
    assert (count - 1) * TIME.size < contact.time.size <= count * TIME.size


HEAD = "Time,Extension,Load\n(s),(mm),(N)\n"
SOME = "".join(f"{0.01 * k:.2f},{0.1 * k:.1f},{0.2 * k:.1f}\n" for k in range(40))
CHANNELS = {"Time": "s", "Extension": "mm", "Load": "N"}
PREAMBLES = {
    "dates and serial numbers": "2026,01,05\n12:30:11,0,0\n4711,0815,99\n\n",
    "ten names with numbers": "".join(f"Parameter {k},{1.5 * k}\n" for k in range(10)) + "\n",
    "ten numbers with numbers": "".join(f"{100 + k}\t{1.5 * k}\n" for k in range(10)),
    "a table of more columns": "a,b,c,d,e,f,g,h\n" + "1,2,3,4,5,6,7,8\n" * 3,
    "a table of as many columns": "Specimen,Maximum,Modulus\n1,2.5,3.5\n2,2.6,3.6\n3,1,2\n\n",
    "a unit of something else": "UNIT,N\nPEAK,7.8\n\n",
    "sections in brackets": "[Settings]\nspeed=3\n[Data]\n",
    "more notes than are searched first": "".join(f"note {k}: value {k}\n" for k in range(9000)),
    "the same and a table above": "a,b\n1,2\n3,4\n\n" + "x: y\n" * 20_000,
}


OTHER_TABLES = [PREAMBLES[f"a table of {size} columns"] for size in ("more", "as many")]


@pytest.mark.long
@pytest.mark.parametrize("preamble", PREAMBLES.values(), ids=PREAMBLES)
@pytest.mark.parametrize("below", ["", "\nMaximum,7.8\nEnd of test", "\nMean\nNo,Max,E\n1,2,3\n"])
def test_text_around_a_table_does_not_change_it(tmp_path, preamble, below):
    read = open_recording(written(tmp_path / "r.txt", preamble + HEAD + SOME + below))
    assert read.units == CHANNELS
    assert list(read.channels) == list(CHANNELS)
    assert read.channels["Load"].tolist() == [round(0.2 * k, 1) for k in range(40)]
    assert not read.faults
    assert not read.losses
    line = preamble.count("\n") + 1
    assert f"palpate takes line {line} for the header: 'Time, Extension, Load';" in read.table
    assert list(read.rows) == list(range(line + 2, line + 42))
    others = preamble in OTHER_TABLES or "No," in below
    assert ("another table" in str(read.omissions)) == others


HEADERS = {
    "blank lines between": "Time,Extension,Load\n\n(s),(mm),(N)\n\n",
    "brackets between": "Time (s),Extension (mm),Load (N)\n[one],[two],[three]\n",
    "units behind commas": '"Time, s","Extension, mm","Load, N"\n',
    "units behind words": "Zeit in s,Weg in mm,Kraft in N\n",
    "a rule below": "Time (s),Extension (mm),Load (N)\n---,---,---\n",
    "empty columns": "Time (s),Extension (mm),Load (N),,\n",
}


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS)
@pytest.mark.parametrize("rows", [2, 40])
def test_a_header_and_its_units_are_found_however_they_stand(tmp_path, header, rows):
    more = header.partition("\n")[0].count(",,")
    some = SOME.replace("\n", ",," * more + "\n").splitlines(keepends=True)[:rows]
    read = open_recording(written(tmp_path / "r.txt", "Report\n\n" + header + "".join(some)))
    assert [read.unit_of(name) for name in list(read.channels)[:3]] == ["s", "mm", "N"]
    assert [len(values) for values in read.channels.values()] == [rows] * len(read.channels)
    assert (dict(read.faults), read.losses) == ({}, ())


def test_columns_in_spaces_have_names_with_units_behind_a_space(tmp_path):
    text = "Report 5\n\n  Time (s)  Pos (mm)   F (N)\n" + SOME.replace(",", "    ")
    read = open_recording(written(tmp_path / "r.txt", text))
    assert read.units == {"Time (s)": "s", "Pos (mm)": "mm", "F (N)": "N"}


def blocks(header: str = "F\th\tt\n") -> str:
    text = "Standard\tparameters\n\n"
    for block in range(1, 4):
        rows = "".join(f"{20 * k + block}\t{100 * k}\t{0.01 * k}\n" for k in range(30))
        text += f"Block : {block}\nhmax\t[µm]\t1,500\n\n{header}{rows.replace('.', ',')}\n"
    return text


@pytest.mark.parametrize("size", [200, 1 << 20])
def test_blocks_below_the_same_header_are_contacts(tmp_path, monkeypatch, size):
    monkeypatch.setattr("palpate.input.recordings.text.BLOCK", size)
    monkeypatch.setattr("palpate.input.recordings.text.CHUNK", 177)
    path = written(tmp_path / "r.txt", blocks().encode("latin-1"))
    with pytest.raises(RecordingError, match=r"no unit of the penetration .*line 6.*; pass") as e:
        prepare(path)
    assert "--unit penetration=um,force=mN" in str(e.value)
    contact = prepare(path, units={"penetration": "um", "force": "mN"})
    assert [len(contact.time[part]) for part in contact.segments()] == [30, 30, 30]
    assert contact.force[[0, 30, 60]] == pytest.approx([1e-3, 2e-3, 3e-3])
    units = "[mN]\t[µm]\t[s]\n"
    stated = blocks("F\th\tt\n" + units)
    second = stated.index(units, stated.index(units) + 1)
    stated = stated[:second] + "\n" + stated[second:]
    again = prepare(written(tmp_path / "u.txt", stated.encode("latin-1")))
    assert [len(again.time[part]) for part in again.segments()] == [30, 30, 30]
    assert np.array_equal(again.penetration, contact.penetration)


def test_units_that_a_report_states_are_used(tmp_path):
    notes = (
        "Sampling rate (Hz):\t250\nTip diameter: 4 mm\nk (N/m)\t0.025\nSample height [mm]\t12.5\n"
    )
    notes += "Sample area: 78.5 mm²\nTest speed\t5 mm/s\nSerial number\t4711\n\n"
    rows = "".join(f"{d:.6f}\t{f:.5f}\n" for d, f in zip(1e3 * DEPTH, FORCE, strict=True))
    path = written(tmp_path / "r.txt", notes + "Indentation (mm)\tLoad (N)\n" + rows)
    read = open_recording(path)
    assert read.settings == pytest.approx(
        {"rate": 250.0, "tip radius": 2e-3, "spring constant": 0.025, "specimen height": 0.0125,
         "specimen area": 78.5e-6}
    )  # fmt: skip
    assert (read.notes["Serial number"], read.notes["Tip diameter"]) == ("4711", "4 mm")
    contact = prepare(path)
    assert contact.time[1] == pytest.approx(0.004)
    assert any("palpate uses the rate that the file states, 250 Hz" in str(f.message)
               for f in contact.findings)  # fmt: skip
    assert prepare(path, rate=100.0).time[1] == pytest.approx(0.01)


def test_the_ball_of_a_report_gives_the_modulus(printed, tmp_path):
    path = written(tmp_path / "r.txt", INDENTER.replace("(um)\t3000", "(um)\t500000"))
    assert "Young's modulus" in printed("identify", path)
    assert "Young's modulus" not in printed("identify", written(tmp_path / "i.csv", INSTRON))


def test_the_row_of_the_header_may_be_named(run, tmp_path):
    text = (
        HEAD.replace("Load", "Force")
        + SOME
        + "\nSecond\n\n"
        + HEAD
        + "".join(SOME.splitlines(keepends=True)[:20])
    )
    path = written(tmp_path / "r.txt", text)
    assert "Force" in open_recording(path).channels
    read = open_recording(path, header_row=46)
    assert (list(read.channels), len(read.rows)) == (list(CHANNELS), 20)
    for row, words in (("0", "from 1 on"), ("900", "is below the lines"), ("44", "takes line 44")):
        status, out, err = run("identify", path, "--header-row", row)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert words in err


BROKEN = {
    "a letter": b"Dear all,\nthere are 3 numbers in this letter, but no table.\n" * 3,
    "a binary file": bytes(range(256)) * 40,
    "names and numbers alone": b"Speed: 5\nMaximum: 7\nSerial: 11\n",
    "a header alone": b"Report\n\nTime,Extension,Load\n(s),(mm),(N)\n",
    "a title above numbers": b"Report of today\n\n0,1,2\n1,2,3\n",
    "an empty block": b"<DATA>\nTime, s\tFz, N\n<END DATA>\n",
    "a block for each step": b"STEP,1\nforce,0.1,0,0\ndist,1\n\nSTEP,2\nforce,1,0,0\ndist,2\n" * 9,
    "half a quotation": b'Report,"5\n\nTime,Load\n0,1\n',
}


@pytest.mark.parametrize("content", BROKEN.values(), ids=BROKEN)
def test_a_file_without_a_table_is_refused_in_one_line(run, tmp_path, content):
    path = written(tmp_path / "r.txt", content)
    status, out, err = run("identify", path)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "r.txt" in err
