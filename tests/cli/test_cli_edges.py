"""The ends of the command line: bad input, outputs that cannot take it, names and interrupts."""

import io
import json
import os
import random
import shlex
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from recordings import HEADER, changed, recording, rows_of, text_of, written

import palpate
from palpate.cli.application import COMMANDS
from palpate.input.recordings.recording import read_truth
from palpate.output import figures

PALPATE = [sys.executable, "-m", "palpate"]
FULL = Path("/dev/full")
GUESS = "--K 2000 --B 2000 --n 1 --noise 0.05"
LAB = ("lab", "ball", "--probe", "ideal", "--seconds", "2.5", "-o")


@pytest.fixture
def printing(run, monkeypatch):
    """Runs a command that prints to a given stream: exit status and standard error."""

    def call(stream, words) -> tuple[int, str]:
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", stream)
            status, _, err = run(*words.split())
        return status, err

    return call


@pytest.mark.long
@pytest.mark.parametrize(
    "words, encoding, errors",
    [
        ("identify probe.csv", "cp1252", "strict"),
        ("identify probe.csv", "utf-16", "strict"),
        ("compare probe.csv", "ascii", "surrogateescape"),  # as in the C locale
        (f"design {GUESS}", "ascii", "strict"),
        ("--help", "latin-1", "strict"),
        ("identify --help", "ascii", "surrogateescape"),
    ],
)
def test_any_encoding_carries_the_tables(printing, good, words, encoding, errors):
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors=errors)
    assert printing(stream, words) == (0, "")
    printed = stream.buffer.getvalue().decode(encoding)
    assert len(printed) > 200
    assert "\\u" not in printed  # every sign of ours has one that is plain
    assert encoding != "ascii" or "--" in words or " +- " in printed


@pytest.mark.long
def test_the_c_locale_carries_what_is_printed_and_written(good):
    locale = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": ""}
    written = ["--figure", "probe.svg", "--save-config", "run.toml"]
    command = [*PALPATE, "identify", "probe.csv", *written]
    done = subprocess.run(command, capture_output=True, env=locale, check=False, timeout=60)
    assert (done.returncode, done.stderr, done.stdout.isascii()) == (0, b"", True)
    assert b"N*s/m^n+1" in done.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    "command, columns",
    [("identify", 1), ("compare", 1), ("diagnose", 1), ("info", 1), ("--help", 1), ("info", 20)],
)
def test_any_width_carries_the_tables(printed, good, monkeypatch, command, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert len(printed(command, *([] if command == "--help" else [good])).splitlines()) > 20


def test_json_is_one_line_that_any_encoding_carries(run, tmp_path):
    file = written(tmp_path / "手.csv", "# who: Ærøskøbing\n" + text_of(rows_of()))
    status, out, err = run("identify", file, "--json")
    assert (status, err, out.isascii(), out.count("\n")) == (0, "", True, 1)
    assert json.loads(out)["file"] == str(file)
    assert json.loads(out)["provenance"]["who"] == "Ærøskøbing"


PRINTING = pytest.mark.parametrize(
    "words", ["identify probe.csv", "info probe.csv --json", "--help", "--version"]
)


@PRINTING
@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line(printing, good, words):
    with FULL.open("w", encoding="utf-8") as stream:
        status, err = printing(stream, words)
    assert (status, err) == (2, "palpate: standard output: No space left on device\n")


@PRINTING
def test_a_closed_pipe_ends_the_command_quietly(printing, good, words):
    ours, theirs = os.pipe()
    os.close(ours)
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        assert printing(stream, words) == (141, "")


@pytest.mark.long
def test_a_broken_pipe_prints_nothing(good):
    with subprocess.Popen(
        [*PALPATE, "info", good], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


# A formula, a script that the font lacks, control signs, markup, and a byte that is not UTF-8.
ODD = "$\\foo$ 手\x1b[31m\x9b\t[bold]\n" + os.fsdecode(b"\xff") + ".csv"


def test_a_file_of_any_name_is_identified_and_drawn(printed, tmp_path):
    file = recording(tmp_path, ODD)
    out = printed("identify", file, "--json", "--figure", tmp_path / (ODD + ".svg"))
    assert json.loads(out)["file"] == str(file)


@pytest.mark.parametrize("command", ["identify", "compare"])
def test_a_figure_never_replaces_the_recording(refused, tmp_path, monkeypatch, command):
    file = recording(tmp_path, "a.svg")
    before = file.read_bytes()
    link = tmp_path / "link.svg"
    link.hardlink_to(file)
    monkeypatch.setattr(figures, "draw", pytest.fail)  # it is said before the work
    monkeypatch.setattr(figures, "draw_comparison", pytest.fail)
    assert "this is an input file" in refused(command, file, "--figure", link)
    assert file.read_bytes() == before


@pytest.mark.long
def test_a_recording_goes_to_standard_output_without_words_in_it(run, tmp_path):
    whole, piped = tmp_path / "whole.csv", tmp_path / "piped.csv"
    with piped.open("wb") as stream:
        done = subprocess.run(
            [*PALPATE, *LAB, "/dev/stdout"], stdout=stream, stderr=subprocess.PIPE, check=True
        )
    assert b"recording: /dev/stdout" in done.stderr
    run(*LAB, whole)
    assert piped.read_bytes() == whole.read_bytes()


class Interrupter:
    """An import that Ctrl-C ends."""

    def find_spec(self, name, path=None, target=None):
        if name == "palpate.cli.application":
            raise KeyboardInterrupt


def test_an_interrupt_while_importing_ends_quietly(run, monkeypatch):
    monkeypatch.delitem(sys.modules, "palpate.cli.application", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Interrupter(), *sys.meta_path])
    assert run("--help") == (130, "", "")


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="a shell of POSIX closes the streams")
@pytest.mark.parametrize("closed", ["2>&-", "0<&- 1>&- 2>&-"])
def test_a_closed_stream_ends_nothing(run, tmp_path, closed):
    command = " ".join([*PALPATE, *LAB, "a.csv -v", closed])
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr, done.stdout == b"") == (0, b"", "1>&-" in closed)
    # Nothing that was printed is in a file that took a stream's descriptor.
    run(*LAB, tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


@pytest.mark.parametrize("command", ["identify", "compare", "diagnose", "info"])
def test_no_name_of_a_file_steers_the_terminal(run, refused, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / ODD, text_of(rows_of()))
    status, out, err = run(command, ODD, "-v")
    assert (status, out.splitlines()[0]) == (0, r"$\foo$ 手\x1b[31m\x9b\t[bold]\n\xff.csv")
    for words in (out, err, refused(command, f"no {ODD}"), run("info", ODD, "--json")[1]):
        assert "[bold]" in words
        assert not any(sign in words for sign in "\x1b\x9b\udcff")


@pytest.mark.parametrize(
    "words",
    ["{}", "identify {}", "identify probe.csv --method {}", "identify probe.csv --law {}",
     "identify probe.csv --unit force={}", "identify probe.csv --{}", "lab {} -o x.csv",
     "lab ball --trajectory {} -o x.csv"],
)  # fmt: skip
def test_a_word_of_any_length_is_shown_by_its_ends(refused, good, words):
    line = refused(*words.format("q" * 10_000).split())
    assert ("qqq…" in line, len(line) < 600) == (True, True)


@pytest.mark.parametrize("option, digits", [("--seed", 400), ("--seconds", 5000)])
def test_a_number_of_any_length_is_one_line(refused, tmp_path, option, digits):
    assert len(refused(*LAB, tmp_path / "x.csv", option, "9" * digits)) < 600


HELPED = f"""
import sys
from palpate.cli import main
slow = "numpy", "matplotlib", "palpate.lab", "palpate.method.estimators"
for command in ("--version", "", *{COMMANDS}):
    sys.argv[1:] = [command] if command == "--version" else [*command.split(), "--help"]
    main()
    found = (*slow, "cyclopts", "rich") if command == "--version" else slow
    assert not [name for name in sys.modules if name.startswith(found)], command
"""


@pytest.mark.long
def test_help_and_version_import_nothing_that_takes_long():
    """The version needs no library of the command line at all."""
    done = subprocess.run([sys.executable, "-c", HELPED], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("Usage: ") == 1 + len(COMMANDS)


@pytest.mark.parametrize("words", ["", "identify ", "lab "])
def test_the_version_is_the_packages_wherever_it_is_asked_for(run, words):
    assert run(*f"{words}--version".split()) == (0, f"{metadata.version('palpate')}\n", "")
    assert palpate.__version__ == metadata.version("palpate")
    assert "__version__" in dir(palpate)


NO_TRUTH = ["", "null", "3", "[" * 100_000, '{"a":' * 50_000, '"' + "9" * 5000, "9" * 5000, "[]",
            '{"kind": []}', '{"kind": "magic"}', '{"kind": "kelvin-voigt"}',
            '{"kind": "kelvin-voigt", "K": NaN, "B": 1}',
            '{"kind": "kelvin-voigt", "K": %s, "B": 1}' % ("9" * 400),
            '{"kind": "kelvin-voigt", "K": "x", "B": {}}']  # fmt: skip


def test_a_note_that_states_no_truth_is_passed_over(run, tmp_path):
    assert [read_truth({"truth": words}) for words in NO_TRUTH] == [None] * len(NO_TRUTH)
    file = written(tmp_path / "deep.csv", f"# truth: {'[' * 100_000}\n" + text_of(rows_of()))
    status, out, err = run("identify", file)
    assert (status, err, "truth" in out) == (0, "", False)


SIZES = (1e90, 1e155, 1e300)
WHICH = (slice(300, 301), slice(0, None, 7), slice(None))
FAR = ((1,), (2,), (1, 2))


@pytest.mark.long
@pytest.mark.parametrize(
    "size, which, columns, vectors",
    [(SIZES[(i + j) % 3], WHICH[i], FAR[j], i != j) for i in range(3) for j in range(3)],
)
def test_values_beyond_any_measurement_are_no_numbers(
    run, refused, tmp_path, size, which, columns, vectors
):
    """LAPACK prints its own words on standard output where it is given infinities."""
    rows = rows_of()
    for row in rows[which]:
        for column in columns:
            row[column] = repr(size * float(row[column]))
    header = HEADER
    if vectors:
        header = ("time_s", "x_m", "y_m", "z_m", "fx_N", "fy_N", "fz_N")
        rows = [[t, "0", "0", f"-{x}".replace("--", ""), "0.1", f, f] for t, x, f in rows]
    file = written(tmp_path / "far.csv", text_of(rows, header))
    assert "is beyond 1e+30" in refused("identify", file, "--strict")
    if which == slice(None):
        assert "Error" not in refused("identify", file)
        return
    status, out, err = run("identify", file, "--json")
    if not status:
        assert err == ""
        assert "without a usable number" in json.dumps(json.loads(out)["findings"])
    assert vectors or not status


RECORDINGS = Path(__file__).parents[2] / "examples" / "recordings"
NAMED = {
    "BALL": str(RECORDINGS / "ball.csv"),
    "GUESS": "--K 2000 --B 2000 --n 1",
    "HALF-SPACE": "generalised-hunt-crossley --K 8000 --n 1.5 --B 60",
}
#: Of each command line words that its one line has.
REFUSED = {
    "identify": ["FILES"],
    "press": ["press"],
    "identif --help": ["identif", 'Did you mean "identify"?'],
    "identify absent.csv": ["absent.csv: No such file or directory"],
    "identify 'two\nlines.csv'": ["No such file"],
    "identify folder.svg": ["folder.svg: the folder holds no ROS 2 bag"],
    "compare bad.csv --strict --dark --figure out.svg": ["bad.csv: ", "row 5"],
    "diagnose bad.csv --strict --json": ["bad.csv: ", "row 5"],
    "info bad.h5": ["not an HDF5 file"],
    "identify -- -v": ["-v: No such file or directory; check the path"],
    "identify probe.csv --config none.toml": ["none.toml: No such file"],
    "identify probe.csv --config folder.svg": ["folder.svg: ", "Is a directory"],
    "identify probe.csv --config": ["--config requires an argument"],
    # What is no option, or no value of one.
    "identify probe.csv --surfce fit": ["--surfce", "Did you mean --surface?"],
    "identify probe.csv --start soon": ["--start", "soon"],
    "identify probe.csv --at 3kg": ["--at must be a number and one of m, cm, mm"],
    "identify probe.csv --delay soon": ["--delay must be a number and one of s, ms"],
    "identify probe.csv --delay 5ms+-soon": ["--delay must be a number and one of s, ms"],
    "identify probe.csv --unit force=MPa": ["unit of the force must be one of N"],
    "identify probe.csv --frequency 5parsec": ["--frequency must be a number and one of Hz, rad/s"],
    # Laws and methods.
    "identify probe.csv --method spring": ["method must be one of", "single-stage", "'spring'"],
    "identify probe.csv --law springy": ["law must be one of hunt-crossley, auto, half-space"],
    "identify probe.csv --law auto --method single-stage": ["does not identify law auto"],
    "identify probe.csv --law auto --surface estimate": ["estimate the surface", "--surface fit"],
    "identify probe.csv --method single-stage --surface estimate": ["single-stage cannot estimate"],
    "identify BALL --frequency 500Hz -o out": ["band of the motion"],
    # Samples of which none is left.
    "identify probe.csv --start 5": ["no sample between 5 s", "0.599 s"],
    "identify probe.csv --min-penetration 1": ["no contact found", "above 1 m"],
    "identify probe.csv --force Fz": ["no column 'Fz'", "force_N", "--time", "info probe.csv"],
    # Figures.
    "identify probe.csv --figure out.eps": ["out.eps", "end in .svg, .pdf or .png"],
    "identify probe.csv --figure folder.svg": ["folder.svg"],
    # Other commands.
    "design GUESS": ["--noise"],
    "lab bal -o x.csv": ["MATERIAL must be one of ball, sponge"],
    "lab ball -o x.csv --trajectory sines": ["must be one of three-sines, two-sines"],
    "lab ball -o x.csv --trajectory gone.csv": ["gone.csv: No such file"],
    "lab ball -o x.csv --K 3": ["--K has no effect on ball"],
    "lab hunt-crossley -o x.csv --K 3": ["takes exactly --K, --B, --n"],
    "lab HALF-SPACE -o x.csv": ["--p, and optionally --M"],
    "lab HALF-SPACE --p 0.5 --M 3 -o x.csv": ["longest_time must be above 0"],
    "lab HALF-SPACE --p 0.5 --relaxation-times 1 -o x.csv": ["must be given together"],
    "lab HALF-SPACE --B 1 -o x.csv": ["--B takes one number"],
    "lab ball -o x.csv --picture rig.bmp": ["must end in .svg, .pdf or .png"],
    "lab ball -o x.csv --picture rig.svg --probe ideal": [
        "needs a robot: use --probe twin-pantograph"
    ],
    "lab ball -o absent/x.csv --seconds 90000": ["absent"],
    "lab ball -o . --seconds 90000": ["this is a folder"],
    "lab ball -o o.svg --picture o.svg --seconds 90000": ["two outputs name this file"],
    "lab ball --probe ideal -o probe.csv --trajectory probe.csv": ["this is an input file"],
}


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("words", REFUSED)
def test_wrong_commands_are_refused_in_one_line_and_write_nothing(refused, good, words):
    written(good.with_name("bad.csv"), changed(3, 0, "0.0015"))
    written(good.with_name("bad.h5"), bytes(1000))
    good.with_name("folder.svg").mkdir()
    there = contents(good.parent)
    command = [part for word in shlex.split(words) for part in NAMED.get(word, word).split(" ")]
    line = refused(*command)
    assert all(expected in line for expected in REFUSED[words])
    assert contents(good.parent) == there


NEVER = {
    "never in contact": [["0", "-0.01", "0.0"], ["0.1", "-0.01", "0.0"], ["0.2", "-0.02", "0.1"]],
    "pulling all along": [["0", "0.01", "-1"], ["0.1", "0.01", "-1"], ["0.2", "0.01", "-1"]],
    "of nothing known": [["0", "nan", "nan"], ["0.1", "nan", "nan"]],
    "of absurd values": [["0", "1e300", "1e300"], ["1", "2e300", "-1e308"], ["2", "3e300", "1e308"],
                         ["3", "1e300", "-1e308"], ["4", "1e300", "1e308"], ["5", "1e300", "1"]],
}  # fmt: skip


@pytest.mark.parametrize("name", NEVER)
def test_a_probe_that_never_touches_is_one_line(refused, tmp_path, name):
    path = written(tmp_path / "never.csv", text_of(NEVER[name]))
    numbers = not name.startswith("of ")
    words = "no contact found" if numbers else "column 'penetration_m': no sample has a"
    assert f"{path}: {words}" in refused("identify", path)


WORDS = [
    "", "-", "--", "-1", "0", "0.5", "3", "1e-320", "1e308", "1e400", "-1e400", "nan", "inf",
    "9" * 400, "9" * 5000, "0x10", "1_000", "١٢", "½", "true", "None", "a" * 300, "a/" * 3000,
    "\udcff", "\udcff.svg", "a\nb", "\x1b[31m", "[[[[", "{0}", "%s", "$HOME", "~",
    "$\\foo$", "手", "'", '"', "\\", "*", "1,2", "1 2", "--help", "--version", "-h", "@file",
    "/", "no/x.svg", "x.svg", "X.PNG", "x.pgf", ".svg", "dir.svg", "loop.svg", "probe.svg",
    "/dev/null", "probe.csv", "time_s", "force_N", "single-stage", "ball",
    "pvc", "hunt-crossley", "two-sines", "near-surface", "ideal",
]  # fmt: skip
READING = ["--method", "--figure", "--dark", "--json", "--no-json", "--time", "--penetration",
           "--force", "--velocity", "--start", "--stop", "--min-penetration", "--min-force",
           "--velocity-window"]  # fmt: skip
TYPED = {
    "identify": (["probe.csv"], READING),
    "compare": (["probe.csv"], READING),
    "design": (GUESS.split(),
               ["--K", "--n", "--noise", "--resolution", "--sample-time", "--depth",
                "--amplitudes", "--frequencies", "--max-depth", "--max-speed", "--no-offset",
                "--surface", "--json"]),
    "lab": (["ball", "--probe", "ideal", "--seconds", "2.5", "-o", "lab.csv"],
            ["--trajectory", "--seed", "--picture", "--K", "--B", "--probe",
             "--noise", "--resolution", "--bias", "--counts"]),
}  # fmt: skip


def typed(chance: random.Random) -> list[str]:
    """A command line that begins like a good one."""
    name = chance.choice(list(TYPED))
    given, options = TYPED[name]
    words = [name, *given]
    for _ in range(chance.choice([0, 1, 1, 2])):
        words.append(chance.choice(options))
        words += chance.choices(WORDS, k=chance.choice([0, 1, 1, 1, 2]))
    place = chance.randrange(len(words))
    # lab writes where it is asked to.
    if chance.random() < 0.4 and words[place] != "lab.csv":
        words[place] = chance.choice(WORDS)
    return words


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A recording, and names that are taken by something else."""
    monkeypatch.chdir(tmp_path)
    recording(tmp_path)
    (tmp_path / "dir.svg").mkdir()
    (tmp_path / "loop.svg").symlink_to("loop.svg")
    (tmp_path / "probe.svg").symlink_to("probe.csv")
    return tmp_path


def check_some(folder, monkeypatch, run, seed: int, count: int) -> None:
    chance = random.Random(seed)
    file = folder / "probe.csv"
    content = file.read_bytes()
    for _ in range(count):
        words = typed(chance)
        stream = io.TextIOWrapper(io.BytesIO(), chance.choice(["utf-8", "ascii", "cp1252"]))
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", stream)
            status, _, err = run(*words)
        lines = err.splitlines()
        assert status in (0, 2), words
        assert len(lines) == (status == 2), (words, lines)
        assert not list(folder.glob(".*")), words
        if words[1:2] == ["probe.csv"]:
            assert file.read_bytes() == content, words
        else:  # it was not read, and may have been asked to be replaced
            file.write_bytes(content)


def test_a_word_in_the_wrong_place_is_one_line(folder, monkeypatch, run):
    check_some(folder, monkeypatch, run, seed=0, count=30)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9))
def test_no_command_line_ends_in_a_traceback(folder, monkeypatch, run, seed):
    check_some(folder, monkeypatch, run, seed, count=800)
