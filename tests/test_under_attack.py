"""What a user's Ctrl-C, another process and strange input must not do."""

import os
import random
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from palpate import InvalidParameterError
from palpate.estimators import ESTIMATORS
from palpate.fleet.running import client_of, holding_interrupts
from palpate.preparation.settings import normal_given

PALPATE = (sys.executable, "-m", "palpate")
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="process groups are POSIX's")


def interrupted(arguments, after, folder) -> tuple[int, str, float]:
    """Run palpate and press Ctrl-C after some seconds; status, output, seconds until the end."""
    process = subprocess.Popen(
        [*PALPATE, *map(str, arguments)], cwd=folder, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    time.sleep(after)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    begun = time.monotonic()
    try:
        said = process.communicate(timeout=60)[0]
    finally:
        process.kill()
    return process.returncode, said, time.monotonic() - begun


@POSIX
@pytest.mark.slow
def test_a_fleet_that_is_interrupted_while_it_starts_ends_and_continues(tmp_path):
    example = Path(__file__).parents[1] / "examples/recordings/sponge.csv"
    folder = tmp_path / "recordings"
    folder.mkdir()
    for k in range(4):
        (folder / f"{k}.csv").write_bytes(example.read_bytes())
    command = ["fleet", folder, "-o", tmp_path / "results", "--workers", "2"]
    chance = random.Random(40)
    for _ in range(8):
        status, said, seconds = interrupted(command, chance.uniform(0.5, 3.0), tmp_path)
        assert (status, seconds < 10.0) == (130, True), said
        assert "Traceback" not in said
    assert subprocess.run([*PALPATE, *map(str, command)], check=False).returncode == 0


@POSIX
def test_an_interrupt_is_held_until_the_end_of_the_block_and_hidden_from_processes():
    children = []

    def start():
        with holding_interrupts():
            command = [sys.executable, "-c", "import time; time.sleep(60)"]
            children.append(subprocess.Popen(command))
            os.kill(os.getpid(), signal.SIGINT)
            children[0].send_signal(signal.SIGINT)
            time.sleep(0.5)
            children.append(children[0].poll())

    with pytest.raises(KeyboardInterrupt):
        start()
    children[0].kill()
    children[0].wait()
    assert children[1] is None


@POSIX
def test_an_interrupt_during_an_import_waits_for_its_end(tmp_path):
    (tmp_path / "slow_module.py").write_text(
        "import os, signal\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "sum(range(1000))\n"
        "print('imported', flush=True)\n"
    )
    program = (
        "import palpate.cli as cli, time, sys\n"
        "def run(words):\n"
        "    import slow_module\n"
        "    time.sleep(20)\n"
        "cli._run = run\n"
        "cli.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True,
        check=False, timeout=15,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "imported\n", "")


@pytest.mark.slow
def test_no_other_process_can_use_a_fleet_on_this_machine():
    pytest.importorskip("distributed")
    with client_of(workers=1) as client:
        address = client.scheduler_info()["address"]
        assert client.submit(int, "7").result() == 7
        program = f"""
from distributed import Client
for address in ({address!r}, {address.replace("tls://", "tcp://")!r}):
    try:
        Client(address, timeout=2).submit(print).result(timeout=2)
    except Exception:
        continue
    print("got in")
"""
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60
        )
    assert done.stdout == ""


@pytest.mark.parametrize("method", ESTIMATORS)
def test_every_method_says_which_law_it_selected(method):
    estimator = ESTIMATORS[method]()
    if estimator.chooses_law:
        assert len(estimator.offered) > 0
    else:
        assert (estimator.candidate, estimator.offered) == (None, ())


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200, 1e308])
def test_a_normal_of_any_length_is_a_direction(size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        normal = normal_given([size, 0.0, size])
    assert np.allclose(normal.vector, np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0))
    for given in ("1e400,0,0", "0,0,0", "1,2", "nan,0,0"):
        with pytest.raises(InvalidParameterError):
            normal_given(given)


def test_lab_replaces_only_what_it_wrote(tmp_path, run):
    path = tmp_path / "a.csv"
    command = ["lab", "hunt-crossley", "--stiffness", 2000, "--damping", 20, "--exponent", 1.3,
               "--probe", "ideal", "--seconds", 3, "-o", path]  # fmt: skip
    path.write_text("time_s,force_N\n0,0\n")
    status, _, err = run(*command)
    assert (status, err.count("\n")) == (2, 1)
    assert "palpate did not write this file" in err
    assert path.read_text() == "time_s,force_N\n0,0\n"
    path.unlink()
    assert run(*command)[0] == run(*command)[0] == 0
