"""``python -m benchmarks.payload --seeds N``: payload, clock and stiffness from a wrench's log.

The logs are simulated by ``tests/robot_logs.py``. Printed are the median, the 95th percentile and
the worst of the errors of random set-ups, the coverage of the bars, what one fault at a time does,
and the CPU time over that of a log without a payload.
"""

import math
import time
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

import palpate
from benchmarks.common.report import run_command
from tests.robot_logs import FAULTS, Setup, identify, random_setup, simulate


def main(seeds: int = 8, faults: int = 2, first: int = 0) -> None:
    """Print the errors of random set-ups, and of one fault at a time.

    Parameters
    ----------
    seeds
        Number of random set-ups.
    faults
        Number of seeds of each fault.
    first
        The first seed of the set-ups.
    """
    console = Console(width=120)
    for title, more in (("no friction", {"friction": 0.0}), ("friction 0.1 to 0.7", {})):
        rows = [
            identify(random_setup(seed, touch_tilt=0.0, **more))
            for seed in range(first, first + seeds)
        ]
        table = Table("", "median", "p95", "worst", title=f"{seeds} random set-ups, {title}")
        for name in rows[0].absolute:
            sizes = np.abs([each.absolute[name] for each in rows])
            shown = (np.median(sizes), np.percentile(sizes, 95.0), sizes.max())
            table.add_row(name, *(f"{each:.2f}" for each in shown))
        for name in ("mass", "mount", "clock", "S", "C"):
            z = [v for row in rows for own, v in row.in_errors.items() if own.startswith(name)]
            table.add_row(f"{name} within its 95 % bar", f"{np.mean(np.abs(z) < 1.96):.0%}")
        trusted = sum(abs(r.absolute["C, %"]) > 20.0 and r.damping_mark == "trust" for r in rows)
        table.add_row("damping trusted, off by > 20 %", str(trusted))
        console.print(table)
    table = Table("fault", "S, %", "of C's bar", "verdict of S, C", title="one fault at a time")
    for name, fault in FAULTS.items():
        rows = [identify(Setup(seed=seed, **fault)) for seed in range(faults)]
        errors = " ".join(f"{each.absolute['S, %']:+.2f}" for each in rows)
        bars = " ".join(f"{each.in_errors['C']:+.1f}" for each in rows)
        marks = [f"{each.mark}/{each.damping_mark}" for each in rows]
        same = len({*marks}) == 1
        table.add_row(name, errors, bars, marks[0] if same else ", ".join(marks))
    console.print(table)
    times: dict[Literal["tool", "base"], float] = {"tool": math.inf, "base": math.inf}
    log = simulate(Setup())
    for _ in range(3):
        for frame in times:
            begun = time.process_time()
            palpate.identify(palpate.prepare(log.recording, force_frame=frame))
            times[frame] = min(times[frame], time.process_time() - begun)
    ratio = times["tool"] / times["base"]
    console.print(
        f"CPU of prepare and identify: {times['tool']:.2f} s, {ratio:.2f} times that without"
    )


if __name__ == "__main__":
    run_command(main)
