"""The tables of ``palpate design``."""

import math
from collections.abc import Callable

import numpy as np
from rich.console import Console

from palpate import __version__
from palpate.cli.printing import print_table, say, say_command
from palpate.digits import rounded
from palpate.lab.design.planned import Design
from palpate.lab.design.precision import HORIZON, PredictedPrecision


def print_design(design: Design, console: Console) -> None:
    """Print how precisely and how soon the planned and a better motion identify the material."""
    law = design.law
    words = (law.K, law.n, law.dissipation)
    say(console, "F = {} x^{} (1 + {} v)".format(*(rounded(number, 4) for number in words)), "bold")
    say(console, _sensor(design))
    _print_precision(design, console)
    console.print()
    _print_motions(design, console)
    console.print()
    for predicted, name in _columns(design):
        for note in predicted.notes:
            say(console, f"{name}: {note}", "yellow")
    if design.better is None:
        say(console, f"no better motion: {design.reason}")
    else:
        say(console, f"better, because {design.reason}:")
        say_command(console, command_line(design) or "", "bold")
    say(
        console,
        "lower bounds on the standard errors (Cramér–Rao), for exact penetration and velocity and "
        "white noise; eq. 10 concerns --method single-stage only",
        "dim",
    )


def comment_lines(design: Design) -> dict[str, str]:
    """Return the comment lines above the header of a motion's file."""
    name, chosen = design.chosen
    law = design.law
    motion = chosen.motion
    sines = zip(motion.amplitudes, motion.frequencies, strict=True)
    terms = [f"{a:.6g} sin({w:.6g} t)" for a, w in sines]
    errors = zip(law.symbols, chosen.expected_errors[-1], strict=True)
    precision = ", ".join(f"{symbol} {_percent(float(error))}" for symbol, error in errors)
    return {
        "made by": f"palpate design; palpate {__version__}",
        "motion": f"{name}, {' + '.join([f'{motion.depth:.6g}', *terms])} m, t from the first sine",
        "guessed material": repr(law),
        "sensor": _sensor(design),
        "predicted standard errors": f"{precision} after {chosen.durations[-1]:g} s of the sines",
        **({"mind": "; ".join(chosen.notes)} if chosen.notes else {}),
    }


def command_line(design: Design) -> str | None:
    """Return the ``palpate design`` command of the better motion."""
    if design.better is None:
        return None
    motion = design.better.motion
    limits = design.limits
    options: dict[str, tuple[float, ...]] = {
        **{name: (value,) for name, value in design.law.as_dict().items()},
        "noise": (design.noise,),
        "resolution": (design.resolution,) if design.resolution else (),
        "sample-time": (design.sample_time,) if design.sample_time != 1e-3 else (),
        "depth": (motion.depth,),
        "amplitudes": motion.amplitudes,
        "frequencies": motion.frequencies,
        "max-depth": (limits.peak_penetration,),
        "max-speed": (limits.speed,),
    }
    phrases = [
        " ".join([f"--{name}", *(f"{value:.12g}" for value in values)])
        for name, values in options.items()
        if values
    ]
    flags = [*([] if design.offset else ["--no-offset"]), *(["--surface"] * design.surface)]
    return " ".join(["palpate design", *phrases, *flags])


def _columns(design: Design) -> list[tuple[PredictedPrecision, str]]:
    shown = (design.planned, "planned"), (design.better, "better")
    return [(each, name) for each, name in shown if each is not None]


def _sensor(design: Design) -> str:
    steps = f" in steps of {rounded(design.resolution, 3)} N" if design.resolution else ""
    unknown = [*(["force offset"] * design.offset), *(["surface"] * design.surface)]
    return (
        f"noise {rounded(design.noise, 3)} N{steps} (effective "
        f"{rounded(design.effective_noise, 3)} N), every {rounded(1e3 * design.sample_time, 3)} ms"
        f"; also estimated: {' and '.join(unknown) or 'nothing'}"
    )


def _print_precision(design: Design, console: Console) -> None:
    """Standard errors after each duration, and the time to each target."""
    shown = _columns(design)
    headings = [f">{name}\n{symbol}" for _, name in shown for symbol in design.law.symbols]
    rows = []
    errors, rounding, times = (
        np.hstack([getattr(predicted, name) for predicted, _ in shown])
        for name in ("relative_errors", "expected_errors", "times")
    )
    for duration, row in zip(design.planned.durations, errors.tolist(), strict=True):
        rows.append([f"± after {rounded(duration, 3)} s", *map(_percent, row)])
    if design.resolution and not np.array_equal(rounding, errors):
        rows.append(["  with rounding", *map(_percent, rounding[-1].tolist())])
    for target, row in zip(design.planned.targets, times.tolist(), strict=True):
        rows.append([f"within {target:.0%} after", *map(_seconds, row)])
    print_table(console, ["", *headings], rows)


def _print_motions(design: Design, console: Console) -> None:
    headings = ["motion", *(f">{name}" for _, name in _columns(design))]
    words: dict[str, Callable[[PredictedPrecision], str]] = {
        "mean depth": lambda o: f"{rounded(1e3 * o.motion.depth, 4)} mm",
        "sines": _sines,
        "depths reached": lambda o: (
            f"{rounded(1e3 * o.least_penetration, 3)} to {rounded(1e3 * o.peak_penetration, 3)} mm"
        ),
        "peak force": lambda o: f"{rounded(o.peak_force, 3)} N",
        "peak speed": lambda o: f"{rounded(1e3 * o.peak_speed, 3)} mm/s",
        f"over 0.1 K/B = {rounded(1e3 * design.speed_limit, 3)} mm/s\n(eq. 10)": lambda o: (
            "–" if math.isnan(o.violated_fraction) else f"{o.violated_fraction:.1%} of contact"
        ),
    }
    rows = [
        [label, *(describe(o) for o, _ in _columns(design))] for label, describe in words.items()
    ]
    print_table(console, headings, rows)


def _sines(predicted: PredictedPrecision) -> str:
    motion = predicted.motion
    sines = zip(motion.amplitudes, motion.frequencies, strict=True)
    lines = (f"{rounded(1e3 * a, 4)} mm at {rounded(w, 4)} rad/s" for a, w in sines)
    return "\n".join(lines) or "held"


def _percent(value: float) -> str:
    if math.isinf(value):
        return "unknown"
    return f"{value:.2%}" if value < 1.0 else f"{rounded(100.0 * value, 3)}%"


def _seconds(value: float) -> str:
    if math.isinf(value):
        return f"> {rounded(HORIZON, 3)} s"
    return f"{value:.3f} s" if value < 1.0 else f"{rounded(value, 3)} s"
