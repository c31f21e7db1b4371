"""Whatever is typed: a result or one line that refuses it, and files that were there stay."""

import io
import random
import sys

import pytest
from recordings import recording

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
GUESS = ["--stiffness", "2000", "--damping", "2000", "--exponent", "1", "--noise", "0.05"]
COMMANDS = {
    "identify": (["probe.csv"], READING),
    "compare": (["probe.csv"], READING),
    "design": (GUESS, ["--stiffness", "--exponent", "--noise", "--resolution", "--sample-time",
                       "--depth", "--amplitudes", "--frequencies", "--max-depth", "--max-speed",
                       "--no-offset", "--surface", "--json"]),
    "lab": (["ball", "--probe", "ideal", "--seconds", "2.5", "-o", "lab.csv"],
            ["--trajectory", "--seed", "--picture", "--stiffness", "--damping", "--probe",
             "--noise", "--resolution", "--bias", "--counts"]),
    "paper": (["--only", "nothing"], ["-o", "--seeds", "--workers"]),
}  # fmt: skip


def typed(chance: random.Random) -> list[str]:
    """A command line that begins like a good one."""
    name = chance.choice(list(COMMANDS))
    given, options = COMMANDS[name]
    words = [name, *given]
    for _ in range(chance.choice([0, 1, 1, 2])):
        words.append(chance.choice(options))
        words += chance.choices(WORDS, k=chance.choice([0, 1, 1, 1, 2]))
    place = chance.randrange(len(words))
    # Without --only the paper would run for minutes; and lab writes where it is asked to.
    if chance.random() < 0.4 and name != "paper" and words[place] != "lab.csv":
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


def test_a_word_in_the_wrong_place_ends_in_a_line(folder, monkeypatch, run):
    check_some(folder, monkeypatch, run, seed=0, count=50)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9))
def test_no_words_end_in_a_traceback(folder, monkeypatch, run, seed):
    check_some(folder, monkeypatch, run, seed, count=800)
