"""Two hundred mutated files of all formats under a new seed, and the cases that are known."""

import subprocess
import sys

import attacks
import pytest

from palpate.input.recordings.opening import FORMATS

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="a process for each file is forked")


def test_each_format_has_a_file_to_mutate():
    names = (form for form in FORMATS if not form.remedy)
    assert all(any(each.endswith(form.suffixes) for each in attacks.WHOLE) for form in names)


@POSIX
@pytest.mark.long
@pytest.mark.parametrize("options", [("--files", "100"), ("--cases",)])
def test_damaged_files_never_give_trusted_wrong_numbers(options):
    """More by ``python tests/attacks.py --files 2000``; its output has the seed."""
    command = [sys.executable, attacks.__file__, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=3000)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
