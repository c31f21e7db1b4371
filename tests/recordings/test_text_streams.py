"""Texts of any length, compressed or in pipes; NumPy and Python read the same of them."""

import bz2
import contextlib
import gzip
import io
import lzma
import os
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written

from palpate import RecordingError, open_recording, prepare
from palpate.input.recordings import opening, text

POSIX = pytest.mark.skipif(os.name != "posix", reason="no such pipes or devices")


def same(one, other) -> None:
    assert list(one.channels) == list(other.channels)
    for name, values in one.channels.items():
        assert values.dtype == other.channels[name].dtype
        if values.dtype == object:
            assert values.tolist() == other.channels[name].tolist()
        else:
            assert values.tobytes() == other.channels[name].tobytes()
    assert list(one.rows) == list(other.rows)
    for part in ("units", "notes", "faults", "losses"):
        assert getattr(one, part) == getattr(other, part)


def random_cells(generator: np.random.Generator, count: int) -> list[str]:
    """Doubles of every size, spelled as they are and with digits too many or too few."""
    bits = generator.integers(0, 2**63, count, dtype=np.int64)
    values = np.concatenate([bits.view(np.float64), generator.standard_normal(count)])
    values = values[np.isfinite(values)]
    spellings = ("{!r}", "{:.5g}", "{:.25g}", "{:+.17e}", "{:.3E}", "{:f}")
    cells = [spellings[k % 6].format(value) for k, value in enumerate(values.tolist())]
    halfway = ["1.00000000000000011102230246251565", "9007199254740993", "2.2250738585072011e-308",
               "4.9e-324", "1e400", "-1e400", "1e-400", "-0.0", "nan", "NaN", "inf", "-inf", "+1",
               ".5", "5.", "Infinity", "-nan"]  # fmt: skip
    return [cell for cell in cells if len(cell) < 60] + halfway


CELLS = random_cells(np.random.default_rng(8), 3000)


@pytest.mark.parametrize("last", ["0", '"0"'], ids=["NumPy", "cells"])  # a quoted cell
def test_a_number_is_the_one_that_python_reads(tmp_path, last):
    cells = CELLS
    content = "a;b\n" + "".join(f"{cell};{last}\n" for cell in cells)
    values = open_recording(written(tmp_path / "n.csv", content)).channels["a"]
    expected = np.array([float(cell) for cell in cells])
    assert np.array_equal(values, expected, equal_nan=True)
    known = ~np.isnan(expected)
    assert np.array_equal(np.signbit(values[known]), np.signbit(expected[known]))


# Some 40 kB: several of the blocks below, which a test makes small.
ROWS = [[repr(0.25 * k), f"{k}", repr(1.0 / (k + 1))] for k in range(1500)]
WHOLE = text_of(ROWS)
STAMPS = "time,x\n" + "".join(f"{1700000000000000001 + k},{k}\n" for k in range(1500))


def with_line(whole: str, number: int, line: str) -> str:
    lines = whole.splitlines(keepends=True)
    return "".join([*lines[:number], line + "\n", *lines[number:]])


QUOTED = "".join('"' + line.replace(",", '","') + '"\n' for line in WHOLE.splitlines())
# A word, rows too short and too long, an empty cell, a blank line, what only looks like a number.
ODD = ["x,1,2", "1,2", "1,2,3,4", "1,,2", "", " 1 , 2 ,\t3", "1,2 3,4", "1_0,2,3", "0x10,2,3",
       "nan(1),2,3", "1d5,2,3", "fain,Inf,NAN", "-,+,.", "\N{ARABIC-INDIC DIGIT ONE},2,3",
       "1e999,2,3", '"1","2","3"', '"1","2\n","3"', '"1,2,3']  # fmt: skip
ODD_QUOTED = ['"1","2",3', '"1","2""5","3"', '"1","2,3"', '"1","2\n","3"']
CORPUS = {
    "plain numbers": WHOLE,
    "quotation marks": QUOTED,
    "quoted decimal commas": QUOTED.replace(".", ","),
    "quoted decimal commas and semicolons": QUOTED.replace('","', '";"').replace(".", ","),
    **{f"one row {line!r}": with_line(WHOLE, 900, line) for line in ODD},
    **{f"quoted, one row {line!r}": with_line(QUOTED, 900, line) for line in ODD_QUOTED},
    "semicolons": WHOLE.replace(",", ";"),
    "decimal commas": WHOLE.replace(",", ";").replace(".", ","),
    "runs of spaces": WHOLE.replace(",", "   "),
    "carriage returns": WHOLE.replace("\n", "\r\n"),
    "doubled carriage returns": WHOLE.replace("\n", "\r\r\n"),
    "a column of words": WHOLE.replace("\n", ",load\n"),
    "nanoseconds": STAMPS,
    "a bad nanosecond": with_line(STAMPS, 900, "x,1"),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("content", CORPUS.values(), ids=CORPUS)
def test_small_blocks_and_either_parser_read_the_same(tmp_path, monkeypatch, content):
    """Cell by cell is the reference; the same numbers bit for bit, and the same rows are lost."""
    path = written(tmp_path / "c.csv", content)
    with monkeypatch.context() as only_cells:
        only_cells.setattr(text._Table, "_take_at_once", lambda *_: False)
        expected = open_recording(path)
    same(open_recording(path), expected)
    for name, size in {"BLOCK": 10_000, "HEAD": 1_000, "CHUNK": 1_111, "PIECE": 2_222}.items():
        monkeypatch.setattr(text, name, size)
    same(open_recording(path), expected)
    module = (gzip, bz2, lzma)[len(content) % 3]
    same(open_recording(written(path, module.compress(content.encode()))), expected)


def test_progress_runs_from_nothing_to_all(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK", 10_000)
    monkeypatch.setattr(text, "CHUNK", 5_000)
    said = []
    open_recording(written(tmp_path / "c.csv", text_of(4 * ROWS)), progress=said.append)
    assert len(said) > 5
    assert said == sorted(said)
    assert said[-1] == 1.0


def test_python_without_lzma_reads_a_csv_and_says_why_it_reads_no_xz(tmp_path):
    """As in a browser, where ``import lzma`` fails."""
    plain = written(tmp_path / "c.csv", text_of(rows_of()))
    packed = written(tmp_path / "d.csv.xz", lzma.compress(plain.read_bytes()))
    script = (
        "import sys; sys.modules.update(lzma=None, _lzma=None); import palpate\n"
        "print(len(palpate.open_recording(sys.argv[1]).rows))\n"
        "try: palpate.open_recording(sys.argv[2])\n"
        "except palpate.RecordingError as error: print(error)"
    )
    words = [sys.executable, "-c", script, plain, packed]
    rows, refusal = subprocess.check_output(words, text=True).splitlines()
    assert rows == "600"
    assert "d.csv.xz" in refusal
    assert "lacks the module lzma" in refusal


def test_compressed_recordings_of_any_name_are_read(tmp_path):
    content = text_of(rows_of()).encode()
    # Members that follow each other, and zeros behind them, are one text.
    members = gzip.compress(content[:9999]) + gzip.compress(content[9999:]) + bytes(600)
    for name in ("probe.csv.gz", "probe.csv", "probe"):
        for packed in (gzip.compress(content), members):
            read = open_recording(written(tmp_path / name, packed))
            assert np.array_equal(read.channels["force_N"], SIGNALS.force)
            assert (len(read.rows), list(read.losses)) == (600, [])


@pytest.mark.parametrize("left", [0.3, 0.7, 0.999])
def test_a_truncated_compressed_recording_is_read_to_its_end(tmp_path, left):
    packed = gzip.compress(text_of(rows_of()).encode())
    path = written(tmp_path / "t.csv.gz", packed[: int(left * len(packed))])
    read = open_recording(path)
    assert any("the compressed data end early" in loss for loss in read.losses)
    assert np.array_equal(read.channels["force_N"], SIGNALS.force[: len(read.rows)])
    assert len(read.rows) > 0.8 * left * 600
    with pytest.raises(RecordingError, match=r"end early|cut off"):
        open_recording(path, strict=True)
    damaged = bytearray(packed)
    damaged[-6] ^= 1  # of the check at the end
    read = open_recording(written(path, bytes(damaged)))
    assert len(read.rows) == 600
    assert read.losses[0].startswith("the compressed data end early or are damaged")
    with pytest.raises(RecordingError, match=r"file cannot be read .*; copy"):
        open_recording(written(path, packed[:2] + b"\xff" * 50))


@pytest.mark.slow
def test_hostile_files_are_read_quickly(tmp_path):
    """Each would take hours by the square of its length."""
    begin = "t,v\n0,1\n"
    for content in (
        begin + "1," + "1" + " " * 39_000 + "\n",
        begin + "1,(" + "[" * 39_000 + "\n",
        begin + '"\n' * 60_000,
        begin + '1,"' + "\n" * 60_000,
        begin + "1," + "9" * 900_000 + "\n",
        begin + "1," + "," * 900_000 + "\n",
        "(" * 9_000 + "," + " ] " * 3_000 + "\n0,1\n",
        "t," + "# x: y\n" * 60_000,
    ):
        path = written(tmp_path / "l.csv", content)
        start = time.process_time()
        open_recording(path)
        open_recording(written(path, gzip.compress(content.encode()) + bytes(9)))
        assert time.process_time() - start < 5.0


@POSIX
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_refused(device):
    with pytest.raises(
        RecordingError, match=rf"^{device}: palpate cannot read a recording from a device"
    ):
        open_recording(device)


@POSIX
def test_a_pipe_is_read_like_a_file(tmp_path, monkeypatch):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    content = gzip.compress(text_of(rows_of()).encode())

    def write():
        with contextlib.suppress(BrokenPipeError), path.open("wb") as pipe:
            pipe.write(content)

    for most in (opening.MAX_SIZE, 100):
        writer = threading.Thread(target=write)
        writer.start()
        if most > 100:
            contact = prepare(open_recording(path, max_size=most))
            assert np.array_equal(contact.force, SIGNALS.force)
            assert contact.source == str(path)
        else:
            with pytest.raises(
                RecordingError, match=r"pipe\.csv: more than .* write the data to a file"
            ):
                open_recording(path, max_size=most)
        writer.join()


@pytest.mark.parametrize("command", ["identify", "compare", "diagnose"])
def test_a_command_reads_its_standard_input(tmp_path, monkeypatch, run, command):
    def given(content):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(content)))
        return run(command, "-")

    status, out, err = given(recording(tmp_path).read_bytes())
    assert (status in (0, 3), err) == (True, "")
    assert "standard input" in out
    status, out, err = given(b"")
    assert (status, out) == (2, "")
    assert "standard input: the file is empty" in err


def test_another_program_may_give_the_standard_input(tmp_path):
    content = recording(tmp_path).read_bytes()
    code = "import palpate; r = palpate.open_recording('-'); print(len(r.rows), r.source)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, input=content)
    assert (done.stdout.decode().strip(), done.stderr) == ("600 standard input", b"")


def test_complete_rows_of_a_truncated_file_are_read(tmp_path):
    """Wherever a writer was stopped: each row is one that it wrote, or it is not there."""
    content = text_of(rows_of()).encode()
    wrote = open_recording(written(tmp_path / "t.csv", content))
    for left in range(1800, 5800, 173):
        read = open_recording(written(tmp_path / "t.csv", content[:left]))
        whole = content[:left].count(b"\n") - 1
        assert len(read.rows) in (whole, whole + 1)
        for name in HEADER:
            assert np.array_equal(read.channels[name][:whole], wrote.channels[name][:whole])
