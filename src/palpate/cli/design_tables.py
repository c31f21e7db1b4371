"""A planned motion's design as tables that a person reads."""

import math
from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np
from rich.table import Table
from rich.text import Text

from palpate.cli.printing import Terminal
from palpate.cli.tables import new_table
from palpate.design.planned import Design
from palpate.design.precision import HORIZON
from palpate.design.predicted_precision import PredictedPrecision


def print_design(design: Design, lines: Sequence[str] = (), *, stderr: bool = False) -> None:
    """Print what the planned motion and a better one would identify, how soon, and more lines."""
    console = Terminal(stderr=stderr)
    law = design.law
    console.print(
        Text(f"F = {law.stiffness:.4g} x^{law.exponent:.3g} (1 + {law.dissipation:.3g} v)", "bold")
    )
    console.print(Text(_sensor(design)), soft_wrap=True)
    console.print(_precision(design))
    console.print()
    console.print(_motions(design))
    console.print()
    for predicted, name in _columns(design):
        for note in predicted.notes:
            console.print(Text(f"{name}: {note}", "yellow"), soft_wrap=True)
    if design.better is None:
        console.print(Text(f"no better motion: {design.reason}"), soft_wrap=True)
    else:
        console.print(Text(f"better, because {design.reason}:"), soft_wrap=True)
        console.print(Text(command_line(design) or "", "bold"), soft_wrap=True)
    console.print(
        Text(
            "least standard errors that any unbiased method can have (Cramér–Rao), for exact "
            "penetration and velocity and white noise; eq. 10 matters to the single stage only",
            "dim",
        ),
        soft_wrap=True,
    )
    for line in lines:
        console.print(Text(line), soft_wrap=True)


def notes_of(design: Design) -> dict[str, str]:
    """Return what stands above the header of a motion's file."""
    name, chosen = design.chosen
    law, motion = design.law, chosen.motion
    sines = zip(motion.amplitudes, motion.frequencies, strict=True)
    terms = [f"{a:.6g} sin({w:.6g} t)" for a, w in sines]
    errors = zip(law.symbols, chosen.expected_errors[-1], strict=True)
    precision = ", ".join(f"{symbol} {_percent(float(error))}" for symbol, error in errors)
    return {
        "made by": f"palpate design; palpate {version('palpate')}",
        "motion": f"{name}, {' + '.join([f'{motion.depth:.6g}', *terms])} m from the sines' start",
        "guessed material": repr(law),
        "sensor": _sensor(design),
        "predicted standard errors": f"{precision} after {chosen.durations[-1]:g} s of the sines",
        **({"mind": "; ".join(chosen.notes)} if chosen.notes else {}),
    }


def command_line(design: Design) -> str | None:
    """Return the command that designs with the better motion in place of the planned one."""
    if design.better is None:
        return None
    law, motion, limits = design.law, design.better.motion, design.limits
    options: dict[str, tuple[float, ...]] = {
        "stiffness": (law.stiffness,),
        "damping": (law.damping,),
        "exponent": (law.exponent,),
        "noise": (design.noise,),
        "resolution": (design.resolution,) if design.resolution else (),
        "sample-time": (design.sample_time,) if design.sample_time != 1e-3 else (),
        "depth": (motion.depth,),
        "amplitudes": motion.amplitudes,
        "frequencies": motion.frequencies,
        "max-depth": (limits.peak_penetration,),
        "max-speed": (limits.speed,),
    }
    words = [
        " ".join([f"--{name}", *(f"{value:.12g}" for value in values)])
        for name, values in options.items()
        if values
    ]
    flags = [*([] if design.offset else ["--no-offset"]), *(["--surface"] * design.surface)]
    return " ".join(["palpate design", *words, *flags])


def _columns(design: Design) -> list[tuple[PredictedPrecision, str]]:
    better = [] if design.better is None else [(design.better, "better")]
    return [(design.planned, "planned"), *better]


def _sensor(design: Design) -> str:
    steps = f" in steps of {design.resolution:.3g} N" if design.resolution else ""
    unknown = [*(["force offset"] * design.offset), *(["surface"] * design.surface)]
    return (
        f"noise {design.noise:.3g} N{steps}, together {design.effective_noise:.3g} N, every "
        f"{1e3 * design.sample_time:.3g} ms; also unknown: {' and '.join(unknown) or 'nothing'}"
    )


def _precision(design: Design) -> Table:
    """Standard errors after each duration, and the time to each target."""
    table = new_table()
    table.add_column("")
    for _, name in _columns(design):
        for symbol in design.law.symbols:
            table.add_column(f"{name} {symbol}", justify="right")
    for row, duration in enumerate(design.planned.durations):
        errors = [e for predicted, _ in _columns(design) for e in predicted.relative_errors[row]]
        table.add_row(f"± after {duration:g} s", *(_percent(float(e)) for e in errors))
    if design.resolution and not all(
        np.array_equal(o.expected_errors, o.relative_errors) for o, _ in _columns(design)
    ):
        errors = [e for predicted, _ in _columns(design) for e in predicted.expected_errors[-1]]
        table.add_row("  with rounding", *(_percent(float(e)) for e in errors))
    for row, target in enumerate(design.planned.targets):
        times = [t for predicted, _ in _columns(design) for t in predicted.times[row]]
        table.add_row(f"within {target:.0%} after", *(_seconds(float(t)) for t in times))
    return table


def _motions(design: Design) -> Table:
    table = new_table()
    table.add_column("motion")
    for _, name in _columns(design):
        table.add_column(name, justify="right")
    rows: dict[str, Callable[[PredictedPrecision], str]] = {
        "mean depth": lambda o: f"{1e3 * o.motion.depth:.4g} mm",
        "sines": _sines,
        "depths reached": lambda o: (
            f"{1e3 * o.least_penetration:.3g} to {1e3 * o.peak_penetration:.3g} mm"
        ),
        "peak force": lambda o: f"{o.peak_force:.3g} N",
        "peak speed": lambda o: f"{1e3 * o.peak_speed:.3g} mm/s",
        f"over 0.1 K/B = {1e3 * design.speed_limit:.3g} mm/s (eq. 10)": lambda o: (
            "–" if math.isnan(o.violated_fraction) else f"{o.violated_fraction:.1%} of contact"
        ),
    }
    for label, word in rows.items():
        table.add_row(label, *(word(predicted) for predicted, _ in _columns(design)))
    return table


def _sines(predicted: PredictedPrecision) -> str:
    motion = predicted.motion
    lines = [
        f"{1e3 * a:.4g} mm at {w:.4g} rad/s"
        for a, w in zip(motion.amplitudes, motion.frequencies, strict=True)
    ]
    return "\n".join(lines) or "held"


def _percent(value: float) -> str:
    if math.isinf(value):
        return "unknown"
    return f"{value:.2%}" if value < 1.0 else f"{value:.1e}" if value > 1e3 else f"{value:.0%}"


def _seconds(value: float) -> str:
    if math.isinf(value):
        return f"> {HORIZON:g} s"
    return f"{value:.3f} s" if value < 1.0 else f"{value:.3g} s"
