"""The ends of the command line: outputs that cannot take it, names, collisions and interrupts."""

import io
import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from recordings import HEADER, recording, rows_of, text_of, written

from palpate import figures
from palpate.recordings.truth import truth_of

PALPATE = [sys.executable, "-m", "palpate"]
FULL = Path("/dev/full")


@pytest.fixture
def good(tmp_path):
    return recording(tmp_path)


@pytest.fixture
def printing(run, monkeypatch):
    """Runs a command that prints to a given stream: exit status and standard error."""

    def call(stream, *arguments) -> tuple[int, str]:
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", stream)
            status, _, err = run(*arguments)
        return status, err

    return call


def stream_of(encoding: str, errors: str = "strict") -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors=errors)


@pytest.mark.parametrize(
    "command, encoding",
    [
        ("identify", "cp1252"),
        ("identify", "utf-16"),
        ("compare", "ascii"),
        ("design", "ascii"),
        ("--help", "ascii"),
    ],
)
@pytest.mark.parametrize("errors", ["strict", "surrogateescape"])  # the second in the C locale
def test_any_encoding_carries_the_tables(printing, good, command, encoding, errors):
    guess = ["--stiffness", "2000", "--damping", "2000", "--exponent", "1", "--noise", "0.05"]
    arguments = {"design": guess, "--help": []}.get(command, [good])
    stream = stream_of(encoding, errors)
    assert printing(stream, command, *arguments) == (0, "")
    printed = stream.buffer.getvalue().decode(encoding)
    assert len(printed) > 200
    assert "\\u" not in printed  # every sign of ours has one that is plain


@pytest.mark.parametrize("words", ["identify --help", "identify FILE -o FOLDER", "compare FILE"])
def test_the_c_locale_carries_what_is_printed(good, tmp_path, words):
    named = {"FILE": str(good), "FOLDER": str(tmp_path / "report")}
    command = [*PALPATE, *(named.get(word, word) for word in words.split())]
    locale = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": ""}
    done = subprocess.run(command, capture_output=True, env=locale, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii()
    assert len(done.stdout) > 200


@pytest.mark.parametrize("columns", [1, 20])
@pytest.mark.parametrize("command", ["identify", "compare", "diagnose", "info", "--help"])
def test_any_width_carries_the_tables(run, good, monkeypatch, command, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    status, out, err = run(command, *([] if command == "--help" else [good]))
    assert (status, err) == (0, "")
    assert len(out.splitlines()) > 20


def test_plain_signs_are_read_as_what_they_stand_for(printing, good):
    stream = stream_of("ascii")
    printing(stream, "identify", good)
    printed = stream.buffer.getvalue().decode("ascii")
    assert " +- " in printed
    assert " N*s/m^n+1" in printed


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_json_is_the_same_object_in_any_encoding(printing, tmp_path, encoding):
    file = written(tmp_path / "手.csv", "# who: Ærøskøbing\n" + text_of(rows_of()))
    stream = stream_of(encoding)
    assert printing(stream, "identify", file, "--json") == (0, "")
    whole = json.loads(stream.buffer.getvalue().decode(encoding))
    assert whole["file"] == str(file)
    assert whole["provenance"]["who"] == "Ærøskøbing"


@pytest.mark.parametrize("arguments", [("identify", "FILE"), ("compare", "FILE", "--json"),
                                       ("--help",), ("--version",)], ids=str)  # fmt: skip
@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line(printing, good, arguments):
    with FULL.open("w", encoding="utf-8") as stream:
        status, err = printing(stream, *(good if word == "FILE" else word for word in arguments))
    assert (status, err) == (2, "palpate: standard output: No space left on device\n")


@pytest.mark.parametrize("arguments", [("identify", "FILE"), ("compare", "FILE", "--json"),
                                       ("--help",), ("--version",)], ids=str)  # fmt: skip
def test_a_reader_that_has_gone_ends_it_quietly(printing, good, arguments):
    ours, theirs = os.pipe()
    os.close(ours)
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        end = printing(stream, *(good if word == "FILE" else word for word in arguments))
    assert end == (141, "")


def test_a_process_whose_reader_has_gone_says_nothing_on_its_way_out(good):
    with subprocess.Popen(
        [*PALPATE, "compare", good], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


# A formula, a script that the font lacks, control signs, markup, and a byte that is not UTF-8.
ODD = "$\\foo$ 手\x1b[31m\t[bold]\n" + os.fsdecode(b"\xff") + ".csv"


def test_a_file_of_any_name_is_identified_and_drawn(run, tmp_path):
    file = recording(tmp_path, ODD)
    status, out, err = run("identify", file, "--json", "--figure", tmp_path / (ODD + ".svg"))
    assert (status, err) == (0, "")
    assert json.loads(out)["file"] == str(file)
    assert run("compare", file)[::2] == (0, "")


@pytest.mark.parametrize("name", [ODD, 300 * "x"], ids=["odd", "long"])
def test_a_name_of_nothing_is_one_line_that_can_be_printed(run, tmp_path, name):
    status, out, err = run("identify", tmp_path / name)
    assert (status, out) == (2, "")
    assert err.endswith("\n")
    assert err[:-1].isprintable()


COLLISIONS = {
    "itself": lambda file: file,
    "a symbolic link": lambda file: linked(file, Path.symlink_to),
    "a hard link": lambda file: linked(file, Path.hardlink_to),
}


def linked(file: Path, make) -> Path:
    link = file.with_name("link.svg")
    make(link, file)
    return link


@pytest.mark.parametrize("other", COLLISIONS.values(), ids=COLLISIONS)
@pytest.mark.parametrize("command", ["identify", "compare"])
def test_a_figure_never_replaces_the_recording(run, tmp_path, monkeypatch, command, other):
    file = recording(tmp_path, "a.svg")
    before = file.read_bytes()
    figure = other(file)
    monkeypatch.setattr(figures, "draw", pytest.fail)  # it is said before the work
    monkeypatch.setattr(figures, "draw_comparison", pytest.fail)
    status, out, err = run(command, file, "--figure", figure)
    assert (status, out) == (2, "")
    assert "this file is read" in err
    assert file.read_bytes() == before


def test_lab_never_replaces_its_recording_or_its_motion(run, tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "o.svg"
    status, _, err = run("lab", "ball", "-o", file, "--picture", file, "--seconds", 90000)
    assert status == 2
    assert "two outputs would be this file" in err
    assert not file.exists()
    file = recording(tmp_path)
    before = file.read_bytes()
    status, _, err = run("lab", "ball", "--probe", "ideal", "-o", file, "--trajectory", file)
    assert status == 2
    assert "this file is read" in err
    assert file.read_bytes() == before


@pytest.mark.parametrize("name", ["x.pgf", "x.eps", "x"])
def test_a_figure_of_another_ending_is_refused_before_the_work(run, tmp_path, name):
    status, _, err = run("identify", tmp_path / "absent.csv", "--figure", tmp_path / name)
    assert status == 2
    assert "must end in .svg, .pdf or .png" in err


def test_a_missing_folder_is_called_that(run, good):
    status, _, err = run("identify", good, "--figure", good.parent / "no" / "x.svg")
    assert status == 2
    assert f"the folder {good.parent / 'no'} does not exist" in err


LAB = ("lab", "ball", "--probe", "ideal", "--seconds", "2.5", "-o")


def test_a_recording_goes_to_standard_output_without_words_in_it(run, tmp_path):
    whole, piped = tmp_path / "whole.csv", tmp_path / "piped.csv"
    with piped.open("wb") as stream:
        done = subprocess.run(
            [*PALPATE, *LAB, "/dev/stdout"], stdout=stream, stderr=subprocess.PIPE, check=True
        )
    assert b"recording: /dev/stdout" in done.stderr
    run(*LAB, whole)
    assert piped.read_bytes() == whole.read_bytes()


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_a_full_device_for_the_recording_is_one_line(run):
    status, out, err = run(*LAB, FULL)
    assert (status, out) == (2, "")
    assert (
        err == "palpate: /dev/full: No space left on device; make room, or choose another place\n"
    )
    assert stat.S_ISCHR(FULL.stat().st_mode)


def test_an_interrupted_run_leaves_no_file(run, tmp_path, monkeypatch):
    from palpate import lab

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(lab.Bench, "run", interrupted)
    assert run(*LAB, tmp_path / "x.csv") == (130, "", "")
    assert list(tmp_path.iterdir()) == []


class Interrupter:
    """An import that Ctrl-C ends."""

    def find_spec(self, name, path=None, target=None):
        if name == "palpate.cli.application":
            raise KeyboardInterrupt


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of POSIX closes the streams")
@pytest.mark.parametrize("closed", ["2>&-", "0<&- 1>&- 2>&-"])
def test_a_closed_stream_ends_nothing(tmp_path, closed):
    lab = f"{sys.executable} -m palpate lab ball --probe ideal --seconds 2.5 -v -o"
    done = subprocess.run(
        f"{lab} a.csv {closed}", shell=True, cwd=tmp_path, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr, done.stdout == b"") == (0, b"", "1>&-" in closed)
    # Nothing that was printed is in a file that took a stream's descriptor.
    subprocess.run(f"{lab} b.csv", shell=True, cwd=tmp_path, capture_output=True, check=True)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


STEERING = "\x1b[31mred\x9b2J\nof two.csv"


@pytest.mark.parametrize("command", ["identify", "compare", "diagnose", "info"])
def test_no_name_of_a_file_steers_the_terminal(run, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / STEERING, text_of(rows_of()))
    status, out, err = run(command, STEERING, "-v")
    assert (status, out.splitlines()[0]) == (0, r"\x1b[31mred\x9b2J\nof two.csv")
    for words in (out, err, run(command, f"no {STEERING}")[2], run("info", STEERING, "--json")[1]):
        assert "of two.csv" in words
        assert not any(sign in words for sign in "\x1b\x9b")


@pytest.mark.parametrize(
    "words",
    ["{}", "identify {}", "identify probe.csv --method {}", "identify probe.csv --law {}",
     "identify probe.csv --unit force={}", "identify probe.csv --{}", "lab {} -o x.csv",
     "lab ball --trajectory {} -o x.csv"],
)  # fmt: skip
def test_a_word_of_any_length_is_shown_by_its_ends(run, good, monkeypatch, words):
    monkeypatch.chdir(good.parent)
    status, out, err = run(*words.format("q" * 10_000).split())
    assert (status, out, "qqq…" in err) == (2, "", True)
    assert len(err) < 600


def test_an_interrupt_while_importing_ends_quietly(run, monkeypatch):
    monkeypatch.delitem(sys.modules, "palpate.cli.application", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Interrupter(), *sys.meta_path])
    assert run("--help") == (130, "", "")


def test_the_help_imports_nothing_that_takes_long():
    code = """
import sys
from palpate.cli.application import run
run(["--help"])
slow = ("numpy", "matplotlib", "palpate.paper", "palpate.lab", "palpate.estimators")
sys.exit(any(name.startswith(slow) for name in sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("command", ["identify", "compare", "design", "lab", "paper"])
def test_every_command_tells_the_version_of_the_package(run, command):
    assert run(command, "--version") == run("--version")


NO_TRUTH = ["", "null", "3", "[" * 100_000, '{"a":' * 50_000, '"' + "9" * 5000, "9" * 5000, "[]",
            '{"kind": []}', '{"kind": "kelvin-voigt"}',
            '{"kind": "kelvin-voigt", "stiffness": NaN, "damping": 1}',
            '{"kind": "kelvin-voigt", "stiffness": %s, "damping": 1}' % ("9" * 400),
            '{"kind": "kelvin-voigt", "stiffness": "x", "damping": {}}']  # fmt: skip


@pytest.mark.parametrize("words", NO_TRUTH, ids=lambda words: words[:30])
def test_a_note_that_states_no_truth_is_passed_over(words):
    assert truth_of({"truth": words}) is None


def test_a_note_of_any_depth_is_no_obstacle(run, tmp_path):
    file = written(tmp_path / "deep.csv", f"# truth: {'[' * 100_000}\n" + text_of(rows_of()))
    status, out, err = run("identify", file)
    assert (status, err) == (0, "")
    assert "truth, by" not in out


@pytest.mark.parametrize("size", [1e90, 1e155, 1e300])
@pytest.mark.parametrize("which", [slice(300, 301), slice(0, None, 7), slice(None)])
@pytest.mark.parametrize("columns", [(1,), (2,), (1, 2)])
@pytest.mark.parametrize("vectors", [False, True])
def test_values_beyond_any_measurement_are_no_numbers(run, tmp_path, size, which, columns, vectors):
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
    status, out, err = run("identify", file, "--json")
    if which == slice(None) or status:
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "Error" not in err
    else:
        assert err == ""
        assert "holds no number in" in json.dumps(json.loads(out)["remarks"])
    if not vectors:
        assert (status == 2) == (which == slice(None))
    status, out, err = run("identify", file, "--strict")
    assert (status, out) == (2, "")
    assert "is no measurement" in err


@pytest.mark.parametrize("digits", [400, 5000])
@pytest.mark.parametrize("option", ["--seed", "--seconds"])
def test_a_number_of_any_length_is_one_line(run, tmp_path, option, digits):
    status, out, err = run(*LAB, tmp_path / "x.csv", option, "9" * digits)
    assert (status, out) == (2, "")
    assert err.startswith("palpate: ")
    assert err.count("\n") == 1
