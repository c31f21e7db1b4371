"""The final law on recordings, against offline least squares of the same samples."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import Floats
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import (
    ContactGate,
    Identification,
    RecordingError,
    VariableProjection,
    choose_gate,
    identify,
    prepare,
)

EXPONENTS = (0.3, 3.6)  # the default range of VariableProjection
STARTS = (0.5, 1.2, 2.0, 3.0)
UNSURE = ("exponent not identifiable", "exponent at the edge")


@dataclass(frozen=True, slots=True)
class Fit:
    """Fit RMSE% of palpate and of SciPy, and palpate's flag on the exponent."""

    ours: float
    scipy: float
    exponent: str
    flags: tuple[str, ...]


def recordings(campaign: Campaign) -> list[Group]:
    files = recorded()
    if not files:
        return [
            _group(
                "whole files", "", [], ["Skipped: no recordings in PALPATE_DATA or ../shared/data."]
            )
        ]
    groups = []
    for part, noted in (("whole files", False), ("noted windows", True)):
        items = [(file, noted) for file in files]
        fits = campaign.map(f"recordings, {part}", _compared, items)
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


def recorded() -> list[Path]:
    """Return the recordings of PALPATE_DATA or next to the checkout, if any."""
    given = os.environ.get("PALPATE_DATA")
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = Path(given) if given else beside
    return sorted(folder.glob("*.csv"))


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
    x, v, f = contact.penetration[taken], contact.velocity[taken], contact.force[taken]
    depth, speed, force = np.log(x / x.max()), v / np.abs(v).max(), f / f.max()

    def residuals(p: Floats) -> Floats:
        found: Floats = np.exp(p[2] * depth) * (p[0] + p[1] * speed) + p[3] - force
        return found

    low, high = EXPONENTS
    bounds = ([-np.inf, -np.inf, low, -np.inf], [np.inf, np.inf, high, np.inf])
    costs = [
        least_squares(residuals, [1.0, 0.1, start, 0.0], bounds=bounds, xtol=1e-12, ftol=1e-12).cost
        for start in STARTS
    ]
    return float(100.0 * np.sqrt(2.0 * min(costs) / np.sum(force**2)))
