"""Files that are damaged, odd or meant to harm: refused on one line, or read, and never in silence.

``hostile.py`` makes them; each run of it is a process of its own, so that one that hangs or dies is
seen, with the name of the file.
"""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ALLOWED = {"refused", "read", "read, and said"}


def judged(folder: Path, seed: int, count: int) -> list[dict]:
    """What became of so many files of the corpus, all for 0."""
    done = subprocess.run(
        [sys.executable, "hostile.py", str(folder), str(seed), str(count)],
        cwd=Path(__file__).parent, capture_output=True, text=True, timeout=900, check=False,
    )  # fmt: skip
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    last = lines[-1] if lines else "nothing"
    assert done.returncode == 0, f"status {done.returncode} after {last}: {done.stderr[-2000:]}"
    return [line for line in lines if "outcome" in line]


def check(found: list[dict]) -> None:
    wrong = [line for line in found if line["outcome"] not in ALLOWED]
    assert wrong == []
    # All three occur: were everything refused, nothing would be tested.
    assert set(Counter(line["outcome"] for line in found)) == ALLOWED


def test_a_sample_of_hostile_files_is_refused_or_read_and_said(tmp_path):
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    found = judged(tmp_path, seed=1, count=40)
    assert len(found) == 40
    check(found)


@pytest.mark.slow
def test_every_hostile_file_is_refused_or_read_and_said(tmp_path):
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    found = judged(tmp_path, seed=0, count=0)
    assert len(found) >= 300
    check(found)
