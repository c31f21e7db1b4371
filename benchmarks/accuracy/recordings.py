"""The final law on recordings, against offline least squares of the same samples."""

import json
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
        results = workers.map(f"recordings, {part}", _compared, items)
        lines = [each for each in results if isinstance(each, Line)]
        notes = [each for each in results if isinstance(each, str)]
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


def _compared(item: tuple[Path, bool]) -> Line | str:
    """Return the line of a recording, or the reason why it has none."""
    file, noted = item
    notes = file.with_suffix(".json")
    window = json.loads(notes.read_text()).get("fit") if noted and notes.exists() else None
    if noted and not window:
        return f"{file.stem}: skipped, no notes."
    try:
        contact = prepare(file)
        gate = choose_gate(contact)
        if window:
            gate = ContactGate(window["x_min"], window["F_min"], window["F_min"])
            contact = contact.window(*window["time"]) if "time" in window else contact
        result = identify(contact, VariableProjection(gate=gate))
    except RecordingError as error:
        return f"{file.stem}: skipped, {str(error).split(';')[0].removeprefix(f'{file}: ')}."
    estimate, ours, offline = result.estimate, result.fit_rmse_percent, _offline(result)
    exponent = f"{estimate.parameters[2]:.3f} ± {estimate.standard_errors[2]:.3f}"
    sure = not any(flag.startswith(UNSURE) for flag in estimate.flags)
    flags = "; ".join(flag.split(":")[0].split(",")[0] for flag in estimate.flags)
    beside = (ours, offline, exponent, flags)
    return Line(file.stem, (ours / offline,), (Limit(1.02),) if sure else (), beside)


def _offline(result: Identification) -> float:
    """RMSE% of the best of several starts."""
    contact, taken = result.contact, result.trace.taken
    x, v, force = contact.penetration[taken], contact.velocity[taken], contact.force[taken]
    residual = least_squares_law(x, v, force).force(x, v) - force
    return float(100.0 * np.sqrt(np.sum(residual**2) / np.sum(force**2)))
