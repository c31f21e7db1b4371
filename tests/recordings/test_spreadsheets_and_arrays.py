"""Tables in spreadsheets, in NumPy's files and in JSON, each written by somebody else's library.

The layouts are those of ECMA-376 part 1, section 18.3 (SpreadsheetML, by openpyxl); of NEP 1 (.npy
and .npz, by NumPy); of RFC 8259, and of jsonlines.org with an object a line (by json and pandas).
"""

import json
import zipfile

import numpy as np
import openpyxl
import pandas
import pytest
from cases import MATERIALS, exciting

import palpate
from palpate import InvalidParameterError, open_recording

BALL = MATERIALS["ball"]
SIGNALS = exciting(BALL, seconds=1.5, noise=0.02, seed=1)
TIME, DEPTH, FORCE = SIGNALS.time, SIGNALS.penetration, SIGNALS.force
MM = 1e3 * DEPTH
ROWS, NOTHING = [*zip(TIME.tolist(), MM.tolist(), FORCE.tolist(), strict=True)], [None] * len(TIME)
NAMES = ("time_s", "penetration_m", "force_N")
COLUMNS = dict(zip(NAMES, (TIME, DEPTH, FORCE), strict=True))


def write_xlsx(path, above=(), below=(), columns=(TIME, MM, FORCE), **sheets):
    """A sheet with a table between other rows; and further sheets of rows."""
    book = openpyxl.Workbook()
    numbers = [[v if v is None else float(v) for v in row] for row in zip(*columns, strict=True)]
    for name, rows in {"Press": [*above, *numbers, *below], **sheets}.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    del book["Sheet"]
    book.save(path)
    return path


def write_npz(path, columns=COLUMNS):
    np.savez(path, **columns, rate=1000.0, machine="X")
    return path


def write_npy(path):
    np.save(path, np.rec.fromarrays([TIME, DEPTH, FORCE], names=",".join(NAMES)))
    return path


def write_json(path, whole, lines=False):
    path.write_text("\n".join(map(json.dumps, whole)) if lines else json.dumps(whole))
    return path


def samples():
    return [{"t": t, "probe": {"depth_mm": x}, "ft": [0.0, f]} for t, x, f in ROWS]


LISTS = {name: values.tolist() for name, values in COLUMNS.items()}
IN_BRACKETS = [["Time [s]", "Indentation (mm)", "Force [N]"]]
BELOW = [["Zeit", "Eindringtiefe", "Kraft"], ["s", "mm", "N"]]
REPORT = [["Test of 2026"], [], ["Speed", 0.5, "mm/s"], ["Fmax", 25.1, "N"], []]
TABLE = "--time column[0] --position column[1] --force column[2]"
WAYS = {
    "units in brackets.xlsx": lambda path: write_xlsx(path, IN_BRACKETS),
    "units below.xlsx": lambda path: write_xlsx(path, BELOW),
    "a report.xlsx": lambda path: write_xlsx(path, [*REPORT, *BELOW, []], [[], ["Mean", 1.0, 2.0]]),
    "a list of results.xlsx": lambda path: write_xlsx(
        path, BELOW, Results=[["Test", "Fmax", "dL"], [1, 25.0, 12.0]], Info=[["Operator", "X"]]
    ),
    "results beside.xlsx": lambda path: write_xlsx(
        path,
        [["", "Speed", 0.5], ["", *BELOW[0], "", "Force max [N]"], [None, *BELOW[1]]],
        columns=(NOTHING, TIME, MM, FORCE, NOTHING, [25.0, *NOTHING[1:]]),
    ),
    "pasted as text.xlsx": lambda path: write_xlsx(
        path, [*BELOW, *([f"{v:.9f}".replace(".", ",") for v in row] for row in ROWS)], columns=()
    ),
    "a.npz": write_npz,
    "fields.npy": write_npy,
    "a table without names.npy": lambda path: np.save(path, np.column_stack([*COLUMNS.values()])),
    "lines.jsonl": lambda path: write_json(path, samples(), lines=True),
    "columns.json": lambda path: write_json(path, {"machine": "X", **LISTS}),
    "units.json": lambda path: write_json(
        path,
        {"units": {"d": "mm"}, "time": LISTS["time_s"], "d": MM.tolist(), "F": LISTS["force_N"]},
    ),
    "pandas.json": lambda path: pandas.DataFrame(COLUMNS).to_json(path, double_precision=15),
}
OPTIONS = {"a table without names.npy": TABLE, "lines.jsonl": "--force ft[1]"}


@pytest.mark.long
@pytest.mark.parametrize("name", WAYS)
def test_every_format_gives_the_stiffness_of_the_ball(name, tmp_path, run):
    path = tmp_path / name
    WAYS[name](path)
    options = OPTIONS.get(name, "").split()
    if options and name.endswith(".npy"):
        status, _, err = run("identify", path)
        assert status == 2
        assert TABLE in err.replace("'", "")
    status, out, err = run("identify", path, *options, "--json")
    assert (status, err) == (0, "")
    there = json.loads(out)["results"][0]["working_depth"]
    stiffness = there["stiffness"]
    bar = np.hypot(stiffness["standard_error"], stiffness["systematic"])
    assert abs(stiffness["value"] - BALL.stiffness_at(there["depth"])) < 3.0 * bar
    assert bar < 0.03 * stiffness["value"]
    assert len(open_recording(path).channels) < 5  # and nothing besides the table


def test_values_units_notes_and_rows_are_read_exactly(tmp_path):
    ways = {"a.xlsx": [[*NAMES]], "b.xlsx": [*REPORT, [*NAMES]]}
    paths = [write_xlsx(tmp_path / n, above, columns=COLUMNS.values()) for n, above in ways.items()]
    paths += [write_npz(tmp_path / "a.npz"), write_npy(tmp_path / "a.npy")]
    for path in (*paths, write_json(tmp_path / "a.json", LISTS)):
        found = open_recording(path)
        last_bit = 1e-15 * path.name.endswith(".xlsx")  # openpyxl writes 16 digits
        for name, values in COLUMNS.items():
            np.testing.assert_allclose(found.channels[name], values, rtol=last_bit, atol=0.0)
    report = open_recording(paths[1])
    assert report.notes["Speed"] == "0.5 mm/s"
    assert report.rows[0] == len(REPORT) + 2
    assert open_recording(paths[2]).notes["machine"] == "X"


def test_each_sheet_with_a_table_is_a_contact(tmp_path, run):
    rows = [*BELOW, *ROWS]
    path = write_xlsx(tmp_path / "a.xlsx", BELOW, Second=rows[:-200], List=[["Fmax"], [1, 2]])
    lengths = [part.stop - part.start for part in palpate.prepare(path).segments()]
    assert lengths == [len(TIME), len(TIME) - 200]
    assert "sheet 'List': holds only 1 rows" in open_recording(path).omissions[0]
    for sheet in ("Second", 2):
        assert len(open_recording(path, sheet=sheet).channels["Kraft"]) == len(TIME) - 200
        assert run("identify", path, "--sheet", sheet)[0] == 0
    status, _, err = run("identify", path, "--sheet", "Third")
    assert (status, err.count("\n")) == (2, 1)
    assert "--sheet with one of Press, Second, List" in err


def test_a_date_a_text_and_a_missing_value_in_a_cell(tmp_path):
    rows = [["Stamp", "Depth [mm]", "Force [N]"]]
    stamps = pandas.date_range("2026-01-02 03:04:05", periods=40, freq="10ms").to_pydatetime()
    rows += [[stamp, 0.1 * k, 0.2 * k] for k, stamp in enumerate(stamps)]
    rows[5][2], rows[9][1] = "error", None
    found = open_recording(write_xlsx(tmp_path / "a.xlsx", columns=[[]], A=rows))
    assert np.diff(found.channels["Stamp"]).tolist() == [10_000_000] * 39
    assert found.faults["Force [N]"].text == "error"
    assert (found.faults["Depth [mm]"].count, found.faults["Force [N]"].sample) == (1, 4)


def test_json_groups_are_contacts_and_null_and_times_are_read(tmp_path):
    lists = {"time": LISTS["time_s"], "depth": LISTS["penetration_m"], "force": LISTS["force_N"]}
    path = write_json(tmp_path / "a.json", {"test_1": lists, "test_2": lists})
    assert len(list(palpate.prepare(path).segments())) == 2
    stamps = [f"2026-01-02T03:04:05.{k:03}Z" for k in range(50)]
    records = [{"time": each, "force": None if k == 3 else k} for k, each in enumerate(stamps)]
    found = open_recording(write_json(tmp_path / "b.jsonl", records, lines=True))
    assert np.diff(found.channels["time"]).tolist() == [1_000_000] * 49
    assert (found.faults["force"].sample, found.faults["force"].text) == (3, "null")
    lines = (tmp_path / "b.jsonl").read_text()
    (tmp_path / "cut.jsonl").write_text(lines[:-9])
    cut = open_recording(tmp_path / "cut.jsonl")
    assert len(cut.channels["force"]) == 49
    assert cut.losses == ("line 50: is not JSON, one of 1 that palpate skipped",)


def bomb(path, member):
    """A workbook one of whose members states and holds 20 MB of blanks."""
    whole = write_xlsx(path.with_name("whole.xlsx"), BELOW)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for info in old.infolist():
            more = b" " * 20_000_000 if info.filename == member else b""
            new.writestr(info.filename, old.read(info) + more)


OBJECTS = {**COLUMNS, "force_N": np.array([None] * len(TIME))}
FORMULAS = [[*NAMES], *([k * 0.01, k * 1e-4, f"=B{k + 2}*2"] for k in range(50))]
BROKEN = {
    "empty.xlsx": (lambda path: openpyxl.Workbook().save(path), "holds no table of numbers"),
    "text.xlsx": (
        lambda path: write_xlsx(path, [["only", "words"]] * 50, columns=()),
        "no table of numbers",
    ),
    "formulas.xlsx": (lambda path: write_xlsx(path, FORMULAS, columns=()), "without values"),
    "not a workbook.xlsx": (lambda path: write_npz(path.with_suffix(".npz")).rename(path), "damag"),
    "sheet.xlsx": (lambda path: bomb(path, "xl/worksheets/sheet1.xml"), "larger --max-size"),
    "styles.xlsx": (lambda path: bomb(path, "xl/styles.xml"), "larger --max-size"),
    "zeros.npz": (lambda path: np.savez_compressed(path, a=np.zeros(2_000_000)), "larger --max"),
    "objects.npz": (lambda path: write_npz(path, OBJECTS), "force_N: holds Python objects"),
    "object.npy": (lambda path: np.save(path, {"a": 1}, allow_pickle=True), "Python objects"),
    "cut.json": (
        lambda path: path.write_text(json.dumps(LISTS)[:-999]),
        "is not JSON, or is cut off",
    ),
    "deep.json": (lambda path: path.write_text("[" * 100_000), "nested too deeply"),
    "number.json": (lambda path: path.write_text("17"), "no arrays of numbers"),
    "keys.jsonl": (
        lambda path: write_json(path, [{str(k): 1} for k in range(4000)], lines=True),
        "larger --max-size",
    ),
    "labview.tdms": (lambda path: path.write_bytes(b"TDSm" + bytes(99)), "save it as CSV"),
    "old.xls": (lambda path: path.write_bytes(b"\xd0\xcf\x11\xe0" + bytes(99)), ".xlsx or CSV"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_file_without_a_table_is_refused_on_one_line(name, tmp_path, run):
    write, words = BROKEN[name]
    write(tmp_path / name)
    status, out, err = run("identify", tmp_path / name, "--max-size", "10MB")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert name in err
    assert words in err


def test_arrays_are_identified_by_their_names_in_every_form():
    space = np.column_stack([0.0 * DEPTH, 0.0 * DEPTH, 0.3 - DEPTH])
    along = np.column_stack([0.0 * FORCE, 0.0 * FORCE, FORCE])
    clocks, rate = {"time": TIME}, {"rate": 1.0 / SIGNALS.time[1]}
    for given in (
        {**clocks, "penetration": DEPTH, "force": FORCE},
        {**rate, "penetration": DEPTH, "force": FORCE},
        {**rate, "position": 0.3 - DEPTH, "force": FORCE},
        {**clocks, "position": space, "force": along},
    ):
        there = palpate.identify(**given).diagnosis.working_depth
        off = there.stiffness.value - BALL.stiffness_at(there.depth)
        assert abs(off) < 3.0 * there.stiffness.whole_error


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: palpate.identify(TIME, DEPTH, FORCE), "time=t, penetration=x, force=F"),
        (lambda: palpate.identify(DEPTH, FORCE), "time=t, penetration=x, force=F"),
        (lambda: palpate.identify(rate=1e3, time=TIME, penetration=DEPTH, force=FORCE), "not both"),
        (lambda: palpate.identify(penetration=DEPTH, force=FORCE), "or the sample rate as rate"),
        (lambda: palpate.identify(position=DEPTH, force=FORCE), "one of time, rate and no_time"),
        (lambda: palpate.identify(time=TIME, position=DEPTH[:9], force=FORCE), "one row for each"),
    ],
)
def test_inconsistent_arrays_are_refused_by_name(call, words):
    with pytest.raises(InvalidParameterError, match=words):
        call()


def test_a_sheet_beyond_the_rows_of_a_spreadsheet_ends(tmp_path):
    path = write_xlsx(tmp_path / "a.xlsx", BELOW)
    far = b'<row r="99999999999"><c r="A99999999999"><v>1</v></c></row></sheetData>'
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / "far.xlsx", "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"</sheetData>", far))
    assert len(open_recording(tmp_path / "far.xlsx").channels["Kraft"]) == len(TIME)
