"""``palpate identify`` on an hour of a robot's recording, step by step, over reading it raw.

``python -m benchmarks.whole_identification --minutes 60`` writes wrenches and poses of a probe that
taps a ball, at 1 kHz, into an MCAP file, and times each step of the command.
"""

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.common.report import describe_machine, list_facts, markdown_table, run_command, show
from benchmarks.common.timing import resident
from benchmarks.reading import BEGIN, STEP, Sent, by_mcap_stream, stamped, write_mcap
from palpate import HuntCrossley, identify, open_recording, prepare

SEED = 1
BALL = HuntCrossley(K=2000.0, B=2000.0, n=1.0)
NORMAL = np.array([0.48, -0.36, 0.8])
NOISE = 0.05  # N, on each axis
PERIOD = 3.0  # s, of a stroke: down to 10 mm from 3 mm above, with a sine on it
Result = TypeVar("Result")


def messages(minutes: float, seed: int = SEED, law: HuntCrossley = BALL) -> Iterator[Sent]:
    """Yield poses and wrenches of a tapping probe, 300 µs apart."""
    random = np.random.default_rng(seed)
    count, piece = int(minutes * 60_000), 60_000
    for first in range(0, count, piece):
        t = 1e-3 * np.arange(first, min(first + piece, count))
        slow, fast = 2 * np.pi / PERIOD, 2 * np.pi * 5.0
        x = 3.5e-3 - 6.5e-3 * np.cos(slow * t) + 1e-3 * np.sin(fast * t)
        v = 6.5e-3 * slow * np.sin(slow * t) + 1e-3 * fast * np.cos(fast * t)
        force = law.force(x, v)[:, None] * NORMAL + NOISE * random.standard_normal((t.size, 3))
        wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
        # The pose is sampled 300 µs later.
        position = np.array([0.4, -0.1, 0.2]) - (x + 3e-4 * v)[:, None] * NORMAL
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (t.size, 1))
        pose = np.concatenate([position, upright], axis=1)
        for k in range(t.size):
            at = BEGIN + (first + k) * STEP
            yield True, at, stamped(at, is_wrench=True) + wrench[k].tobytes()
            yield False, at + 300_000, stamped(at + 300_000, is_wrench=False) + pose[k].tobytes()


def main(*, minutes: float = 2.0) -> None:
    """Write, read and identify.

    Parameters
    ----------
    minutes
        Duration of the recording.
    """
    rows: list[tuple[str, float]] = []

    def timed(name: str, work: Callable[[], Result]) -> Result:
        begin = time.perf_counter()
        result = work()
        rows.append((name, time.perf_counter() - begin))
        return result

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "taps.mcap"
        write_mcap(path, messages(minutes))
        timed("raw messages, by the stream reader of mcap", lambda: by_mcap_stream(path))
        recording = timed("to arrays", lambda: open_recording(path))
        contact = timed("prepared", lambda: prepare(recording))
        result = timed("identified", lambda: identify(contact))
        verdict = timed("diagnosed", lambda: result.diagnosis).verdict
    arrays = sum(values.nbytes for values in recording.channels.values())
    cells = [[name, f"{seconds:.2f}", f"{seconds / rows[0][1]:.2f}"] for name, seconds in rows]
    lines = [
        *(f"{minutes:g} minutes at 1 kHz, seed {SEED}", ""),
        *markdown_table(("step", "s", "over the raw reading"), cells),
        *("", f"{result.law}: {verdict.overall}", ""),
        f"peak memory {resident('VmHWM') / arrays:.2f} of the arrays that were read",
        *("", *list_facts(describe_machine())),
    ]
    show(lines)


if __name__ == "__main__":
    run_command(main)
