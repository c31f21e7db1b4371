"""Force maps: the fit alone, with the exponent of a paraboloid, compared with nanite's."""

import json
import math
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.recordings import recorded
from benchmarks.common.report import Row, Section, at_least
from palpate.estimators.batch_fit import fit_curves

_ALONE = Path(__file__).with_name("nanite_alone.py")
_ROUNDS = 5


def measure(python: str, most: int = 10_000) -> Section:
    """Fit the same segments of the same curves by both, one core."""
    title = "Force maps, compared with nanite"
    files = recorded("afm_maps/*.jpk-force-map")
    if not files:
        return Section(title, [], ["skipped: PALPATE_DATA has no force maps"])
    with tempfile.TemporaryDirectory() as scratch:
        # -P: otherwise the program would import this module, which is next to it, as nanite.
        command = [python, "-P", str(_ALONE), scratch, *map(str, files)]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False,
            env={"PATH": os.environ["PATH"], "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        if done.returncode:
            words = (done.stderr.strip().splitlines() or ["it ended"])[-1]
            return Section(title, [], [f"skipped: cannot run nanite by {python}: {words}"])
        theirs = json.loads(done.stdout.splitlines()[-1])[:most]
        curves = [dict(np.load(Path(scratch) / each["file"])) for each in theirs]
    seconds, ratios = _ours(theirs, curves)
    rate, reference = len(curves) / seconds, len(curves) / sum(c["seconds"] for c in theirs)
    within = sum(abs(ratio - 1.0) <= 0.01 for ratio in ratios)
    samples = round(float(np.mean([len(curve["force"]) for curve in curves])))
    rows = [
        Row(f"curves of some {samples} points, fitted", rate, "curves/s", rate / reference,
            "nanite, fit alone", at_least(10.0)),
        Row("nanite", reference, "curves/s"),
        Row(f"E within 1 % of nanite's, of {len(curves)}", within, "",
            limit=at_least(len(curves))),
        Row("largest difference of E", 100.0 * max(abs(r - 1.0) for r in ratios), "%"),
    ]  # fmt: skip
    notes = ["approach, exponent 1.5, no weights; each curve by a separate call"]
    return Section(title, rows, notes)


def _ours(theirs: list[dict[str, Any]], curves: list[dict[str, Any]]) -> tuple[float, list[float]]:
    """Seconds of all fits, the best of some rounds, and our E over theirs."""
    best, ratios = math.inf, []
    for _ in range(_ROUNDS):
        begun, fits = time.perf_counter(), []
        for curve in curves:
            x, force = curve["penetration"], curve["force"]
            fits.append(
                fit_curves(
                    x[None],
                    np.zeros((1, x.size)),
                    force[None],
                    surface="estimate",
                    surface_range=(float(x.min()), float(x.max())),
                    exponent=1.5,
                )
            )
        best = min(best, time.perf_counter() - begun)
    for fit, other in zip(fits, theirs, strict=True):
        modulus = 0.75 * float(fit.stiffness[0]) * (1.0 - other["nu"] ** 2) / math.sqrt(other["R"])
        ratios.append(modulus / other["E"])
    return best, ratios
