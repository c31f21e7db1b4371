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
from palpate.fleet.running import holding_interrupts, open_client
from palpate.input.preparation.normal import parse_normal
from palpate.method.estimators import ESTIMATORS

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
def test_a_fleet_interrupted_at_its_start_can_continue(tmp_path):
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


@pytest.mark.long
@POSIX
def test_an_interrupt_waits_for_the_end_of_the_block():
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


@pytest.mark.long
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


EARLY = """
import os, signal, sys
class Finder:
    def find_spec(self, name, *more):
        if name == "palpate.errors":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from palpate.cli import main
"""
AT_THE_END = """
import os, signal, sys
import palpate.cli as cli
class Finder:
    def find_spec(self, name, *more):
        if name == "nothing":
            os.kill(os.getpid(), signal.SIGINT)
            sum(range(1000))
sys.meta_path.insert(0, Finder())
def run(words):
    try:
        import nothing
    except ImportError:
        return 0
cli._run = run
cli.main()
"""
ENDLESS = """
import sys, threading
from palpate.fleet import running
def run_fleet(*_, **options):
    threading.Thread(target=threading.Event().wait).start()
    raise KeyboardInterrupt
running.run_fleet = run_fleet
sys.argv = ["palpate", "fleet", sys.executable, "-o", "b"]
from palpate.cli import main
main()
"""


@pytest.mark.long
@POSIX
@pytest.mark.parametrize("program, lines", [(EARLY, 0), (AT_THE_END, 0), (ENDLESS, 1)])
def test_an_interrupt_ends_imports_and_waiting_threads(program, lines):
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=15
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (130, "", lines)


@pytest.mark.long
@pytest.mark.slow
def test_no_other_process_can_use_a_fleet_on_this_machine():
    pytest.importorskip("distributed")
    with open_client(workers=1) as client:
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
        normal = parse_normal([size, 0.0, size])
    assert np.allclose(normal.vector, np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0))
    for given in ("1e400,0,0", "0,0,0", "1,2", "nan,0,0"):
        with pytest.raises(InvalidParameterError):
            parse_normal(given)


def test_lab_replaces_only_what_it_wrote(tmp_path, run):
    path = tmp_path / "a.csv"
    command = ["lab", "hunt-crossley", "--K", 2000, "--B", 20, "--n", 1.3,
               "--probe", "ideal", "--seconds", 3, "-o", path]  # fmt: skip
    path.write_text("time_s,force_N\n0,0\n")
    status, _, err = run(*command)
    assert (status, err.count("\n")) == (2, 1)
    assert "palpate did not write this file" in err
    assert path.read_text() == "time_s,force_N\n0,0\n"
    path.unlink()
    assert run(*command)[0] == run(*command)[0] == 0


def test_a_model_that_no_robot_has_is_refused(tmp_path):
    pytest.importorskip("mujoco")
    from palpate.exports.mujoco.robot import ContactNames, read

    for option, size in (("", "1e300"), ('<option timestep="-1"/>', "0.01")):
        path = tmp_path / "model.xml"
        path.write_text(
            f'<mujoco>{option}<worldbody><body><freejoint/><geom name="tip" type="sphere" '
            f'size="{size}"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
            "</worldbody></mujoco>"
        )
        with pytest.raises(InvalidParameterError, match=r"model\.xml"):
            read(path, "tip", 0.01, ContactNames())


LIVE_MEMORY = """
import os, signal
from palpate.live.ring import Writer
if __name__ == "__main__":
    writer = Writer(16)
    print(os.getpid(), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="/dev/shm is Linux's")
def test_a_killed_loop_leaves_no_memory_and_no_message(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(LIVE_MEMORY)
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stderr == ""
    assert not [*Path("/dev/shm").glob(f"*{done.stdout.strip()}*")]


def test_messages_of_cyclone_dds_are_counted_and_never_block():
    pytest.importorskip("cyclonedds")
    from palpate.live.dds import _Printed

    if sys.platform == "win32":
        return
    printed, lines = _Printed(), 0
    try:
        for _ in range(100):
            for _ in range(100):
                try:
                    os.write(2, b"recvUC: malformed packet\n" * 10)
                except BlockingIOError:  # full: Cyclone DDS drops the line
                    break
            lines += len(printed.take())
    finally:
        printed.close()
    assert lines > 10_000


def test_the_summary_names_a_recorder_that_ended_early():
    from palpate.live.console import summary

    others = {"recorder": {"dropped": 0, "ended": True}, "page": {"dropped": 3}}
    [line] = [each for each in summary({}, others) if each.startswith("rows dropped")]
    assert "0 by the recorder" not in line
    assert "ended early" in line
    assert "3 by the page" in line


def test_places_that_differ_in_their_last_digits_have_no_steep_slope():
    from types import SimpleNamespace

    from palpate.identification.diagnosis.material import largest_pull

    count = 400
    free = np.arange(count) < 200
    penetration = np.where(free, -1e-3, 1e-3)
    penetration[:200] *= 1.0 + 2e-16 * (np.arange(200) % 2)
    force = np.where(free, 0.0, 1.0) + 1e-3 * np.sin(np.arange(count))
    data = SimpleNamespace(
        contact=SimpleNamespace(force=force), known=np.ones(count, bool),
        velocity=np.where(np.arange(count) % 3 == 0, -1.0, 1.0), peak_force=1.0,
    )  # fmt: skip
    fit = SimpleNamespace(
        free=free, penetration=penetration, reference=1e-3, data=data, speed=1.0,
        rejected=np.zeros(count, bool),
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert largest_pull(fit) < 1.0
