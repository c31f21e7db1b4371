"""``python -m benchmarks.payload --seeds N``: payload, clock and stiffness from a wrench's log.

The logs are simulated by ``tests/robot_logs.py``. Printed are the median, the 95th percentile and
the worst of the errors of random set-ups, the coverage of the bars, what one fault at a time does,
and the CPU time over that of a log without a payload.
"""

import math
import time
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from rich.console import Console
from rich.table import Table

import palpate
from benchmarks.common.report import run_command
from palpate.input.preparation.force_frame import compensate_log
from palpate.input.preparation.settings import Preparation
from tests.robot_logs import (
    FAULTS,
    STILL,
    VERTICAL,
    Errors,
    Setup,
    identify,
    random_setup,
    simulate,
)

#: What a log differs in from a random set-up that presses along the normal.
KINDS: dict[str, dict[str, Any]] = {
    "many turns": {},
    "one axis": {"axes": 1},
    "quick": {"speed": 2.0},
    "drift of 0.5 N": {"drift": 0.5},
    "zeroed in air": {"zeroed": 0.2},
    "vertical, noise 0 to 30 µm": VERTICAL,
    "known payload, 0.5 to 4 kg": STILL,
    "no frame stated": {},
    "no frame, sign −1": {"sign": -1.0},
    "no frame, one axis": {"axes": 1},
    "one press, free turns": {"presses": 1, "free_height": 0.03},
}


def of_kind(kind: str, seed: int) -> Errors:
    """Identify a log of a kind."""
    options: dict[str, Any] = {}
    more: dict[str, Any] = {"touch_tilt": 0.0, "friction": 0.0, **KINDS[kind]}
    setup = random_setup(seed, **more)
    if kind.startswith("vertical"):
        setup = replace(setup, pose_noise=3e-5 * (seed % 7) / 6.0)
    if kind.startswith("known"):
        mass = 0.5 + 3.5 * (seed % 8) / 7.0
        turning = random_setup(seed, mass=mass, touch_tilt=0.0, friction=0.0)
        options["payload"] = compensate_log(simulate(turning).recording, Preparation()).payload
        setup = replace(turning, seed=seed + 1000, **STILL)
    return identify(setup, stated=not kind.startswith("no frame"), **options)


def show_kinds(console: Console, count: int, first: int) -> None:
    """Print what becomes of each kind of log."""
    within = ("mass", "clock", "mount", "S")
    headings = "asked", "S off > 5 %", "> 10 %", "trusted", "C trusted, > 20 %"
    bars = (f"{each} in 2 bars" for each in within)
    table = Table("kind", *headings, *bars, title=f"{count} logs of each kind")
    for kind in KINDS:
        rows, asked = list[Errors](), 0
        for seed in range(first, first + count):
            try:
                rows.append(of_kind(kind, seed))
            except palpate.RecordingError:
                asked += 1
        far = [each for each in rows if abs(each.absolute["S, %"]) > 10.0]
        off = sum(abs(each.absolute["S, %"]) > 5.0 for each in rows)
        trusted = sum(each.mark == "trust" for each in far)
        wrong = sum(
            abs(each.absolute["C, %"]) > 20.0 and each.damping_mark == "trust" for each in rows
        )
        shares = []
        for name in within:
            z = [v for row in rows for own, v in row.in_errors.items() if own.startswith(name)]
            shares.append(f"{np.mean(np.abs(z) < 2.0):.0%}" if z else "–")
        table.add_row(kind, *map(str, (asked, off, len(far), trusted, wrong)), *shares)
    console.print(table)


def main(seeds: int = 8, faults: int = 2, first: int = 0, kinds: int = 4) -> None:
    """Print the errors of random set-ups, of one fault at a time, and of kinds of logs.

    Parameters
    ----------
    seeds
        Number of random set-ups.
    faults
        Number of seeds of each fault.
    first
        The first seed of the set-ups and of the kinds.
    kinds
        Number of logs of each kind.
    """
    console = Console(width=120)
    if kinds:
        show_kinds(console, kinds, first)
    chosen = (("no friction", {"friction": 0.0}), ("friction 0.1 to 0.7", {})) if seeds else ()
    for title, more in chosen:
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
