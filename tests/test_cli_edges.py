"""The ends of the command line: outputs that cannot take it, names, collisions and interrupts."""

import io
import json
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from recordings import HEADER, recording, rows_of, text_of, written

import palpate
from palpate import figures
from palpate.cli.application import COMMANDS
from palpate.recordings.recording import truth_of

PALPATE = [sys.executable, "-m", "palpate"]
FULL = Path("/dev/full")
GUESS = "--stiffness 2000 --damping 2000 --exponent 1 --noise 0.05"
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


def test_the_c_locale_carries_what_is_printed_and_written(good):
    locale = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": ""}
    written = ["--figure", "probe.svg", "--save-config", "run.toml"]
    command = [*PALPATE, "identify", "probe.csv", *written]
    done = subprocess.run(command, capture_output=True, env=locale, check=False, timeout=60)
    assert (done.returncode, done.stderr, done.stdout.isascii()) == (0, b"", True)
    assert b"N*s/m^n+1" in done.stdout


@pytest.mark.parametrize(
    "command, columns",
    [("identify", 1), ("compare", 1), ("diagnose", 1), ("info", 1), ("--help", 1), ("info", 20)],
)
def test_any_width_carries_the_tables(run, good, monkeypatch, command, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    status, out, err = run(command, *([] if command == "--help" else [good]))
    assert (status, err) == (0, "")
    assert len(out.splitlines()) > 20


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
def test_a_reader_that_has_gone_ends_it_quietly(printing, good, words):
    ours, theirs = os.pipe()
    os.close(ours)
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        assert printing(stream, words) == (141, "")


def test_a_process_whose_reader_has_gone_says_nothing_on_its_way_out(good):
    with subprocess.Popen(
        [*PALPATE, "info", good], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


# A formula, a script that the font lacks, control signs, markup, and a byte that is not UTF-8.
ODD = "$\\foo$ 手\x1b[31m\x9b\t[bold]\n" + os.fsdecode(b"\xff") + ".csv"


def test_a_file_of_any_name_is_identified_and_drawn(run, tmp_path):
    file = recording(tmp_path, ODD)
    status, out, err = run("identify", file, "--json", "--figure", tmp_path / (ODD + ".svg"))
    assert (status, err) == (0, "")
    assert json.loads(out)["file"] == str(file)


@pytest.mark.parametrize("command", ["identify", "compare"])
def test_a_figure_never_replaces_the_recording(refused, tmp_path, monkeypatch, command):
    file = recording(tmp_path, "a.svg")
    before = file.read_bytes()
    link = tmp_path / "link.svg"
    link.hardlink_to(file)
    monkeypatch.setattr(figures, "draw", pytest.fail)  # it is said before the work
    monkeypatch.setattr(figures, "draw_comparison", pytest.fail)
    assert "this file is read" in refused(command, file, "--figure", link)
    assert file.read_bytes() == before


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
slow = "numpy", "matplotlib", "palpate.paper", "palpate.lab", "palpate.estimators"
for command in ("--version", "", *{COMMANDS}):
    sys.argv[1:] = [command] if command == "--version" else [*command.split(), "--help"]
    main()
    found = (*slow, "cyclopts", "rich") if command == "--version" else slow
    assert not [name for name in sys.modules if name.startswith(found)], command
"""


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
            '{"kind": "kelvin-voigt", "stiffness": NaN, "damping": 1}',
            '{"kind": "kelvin-voigt", "stiffness": %s, "damping": 1}' % ("9" * 400),
            '{"kind": "kelvin-voigt", "stiffness": "x", "damping": {}}']  # fmt: skip


def test_a_note_that_states_no_truth_is_passed_over(run, tmp_path):
    assert [truth_of({"truth": words}) for words in NO_TRUTH] == [None] * len(NO_TRUTH)
    file = written(tmp_path / "deep.csv", f"# truth: {'[' * 100_000}\n" + text_of(rows_of()))
    status, out, err = run("identify", file)
    assert (status, err, "truth" in out) == (0, "", False)


SIZES = (1e90, 1e155, 1e300)
WHICH = (slice(300, 301), slice(0, None, 7), slice(None))
FAR = ((1,), (2,), (1, 2))


@pytest.mark.parametrize("vectors", [False, True])
@pytest.mark.parametrize(
    "size, which, columns",
    [(SIZES[(i + j) % 3], WHICH[i], FAR[j]) for i in range(3) for j in range(3)],
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
    assert "is no measurement" in refused("identify", file, "--strict")
    if which == slice(None):
        assert "Error" not in refused("identify", file)
        return
    status, out, err = run("identify", file, "--json")
    if not status:
        assert err == ""
        assert "holds no number in" in json.dumps(json.loads(out)["findings"])
    assert vectors or not status
