"""The final law on recordings, against offline least squares of the same samples."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common.recordings import EXPONENTS, STARTS, least_squares_law, recorded
from benchmarks.common.report import Group, Limit, Line
from benchmarks.common.workers import Workers
from palpate import (
    ContactGate,
    Identification,
    RecordingError,
    VariableProjection,
    choose_gate,
    identify,
    prepare,
)

UNSURE = ("exponent not identifiable", "exponent at the edge")


@dataclass(frozen=True, slots=True)
class Fit:
    """Fit RMSE% of palpate and of SciPy, and palpate's flag on the exponent."""

    ours: float
    scipy: float
    exponent: str
    flags: tuple[str, ...]


def recordings(workers: Workers) -> list[Group]:
    """Recordings, compared with offline least squares.

    Does `identify` find the least-squares solution on real recordings?
    """
    files = recorded()
    if not files:
        notes = ["Skipped: no recordings in PALPATE_DATA or ../shared/data."]
        return [_group("whole files", "", [], notes)]
    groups = []
    for part, noted in (("whole files", False), ("noted windows", True)):
        items = [(file, noted) for file in files]
        fits = workers.map(f"recordings, {part}", _compared, items)
        lines, notes = [], []
        for file, fit in zip(files, fits, strict=True):
            if isinstance(fit, str):
                notes.append(f"{file.stem}: skipped, {fit}.")
            else:
                lines.append(_line(file.stem, fit))
        what = (
            "The window and the gate from the notes of each recording."
            if noted
            else "The whole file, with the gate of `choose_gate`."
        )
        groups.append(_group(part, what, lines, notes))
    return groups


def _group(part: str, what: str, lines: list[Line], notes: list[str]) -> Group:
    return Group(
        f"Recordings, compared with SciPy, {part}",
        f"{what} RMSE% of `identify`'s final law over that of `scipy.optimize.least_squares` on "
        f"the same samples: K, B, n and an offset, n from {EXPONENTS[0]} to {EXPONENTS[1]}, best "
        f"of {len(STARTS)} starts. The limit applies where no flag concerns the exponent.",
        ("ratio",),
        lines,
        ("RMSE %", "SciPy RMSE %", "n ± standard error", "flags"),
        precision=".4f",
        notes=notes,
    )


def _line(name: str, fit: Fit) -> Line:
    sure = not any(flag.startswith(UNSURE) for flag in fit.flags)
    flags = "; ".join(flag.split(":")[0].split(",")[0] for flag in fit.flags)
    limits = (Limit(1.02),) if sure else ()
    beside = (fit.ours, fit.scipy, fit.exponent, flags)
    return Line(name, (fit.ours / fit.scipy,), limits, beside)


def _compared(item: tuple[Path, bool]) -> Fit | str:
    """Return the fit, or the reason why there is none."""
    file, noted = item
    notes = file.with_suffix(".json")
    window = json.loads(notes.read_text()).get("fit") if noted and notes.exists() else None
    if noted and not window:
        return "no notes"
    try:
        contact = prepare(file)
        gate = choose_gate(contact)
        if window:
            gate = ContactGate(window["x_min"], window["F_min"], window["F_min"])
            contact = contact.window(*window["time"]) if "time" in window else contact
        result = identify(contact, VariableProjection(gate=gate))
    except RecordingError as error:
        return str(error).split(";")[0].removeprefix(f"{file}: ")
    estimate = result.estimate
    exponent = f"{estimate.parameters[2]:.3f} ± {estimate.standard_errors[2]:.3f}"
    offline = _offline(result)
    return Fit(result.fit_rmse_percent, offline, exponent, estimate.flags)


def _offline(result: Identification) -> float:
    """RMSE% of the best of several starts."""
    contact, taken = result.contact, result.trace.taken
    x, v, force = contact.penetration[taken], contact.velocity[taken], contact.force[taken]
    residual = least_squares_law(x, v, force).force(x, v) - force
    return float(100.0 * np.sqrt(np.sum(residual**2) / np.sum(force**2)))
