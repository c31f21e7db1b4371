"""Force maps, compared with nanite: the fit alone, and the modulus from the whole curve."""

import json
import math
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.recordings import recorded
from benchmarks.common.report import Limit, Row, Section, at_least
from benchmarks.common.timing import least_seconds
from palpate.identification.quantities.elastic_modulus import Sphere
from palpate.identification.quantities.indentation import fit_force_curve
from palpate.input.recordings.opening import FORCE_CURVES
from palpate.method.estimators.batch_fit import CurveFits, fit_curves

_ALONE = Path(__file__).with_name("nanite_alone.py")


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
    seconds, fits = least_seconds(lambda: [_fit(curve) for curve in curves])
    ratios = [_modulus(*each) / each[1]["E"] for each in zip(fits, theirs, strict=True)]
    rate, reference = len(curves) / seconds, len(curves) / sum(c["seconds"] for c in theirs)
    within = sum(abs(ratio - 1.0) <= 0.01 for ratio in ratios)
    samples = round(float(np.mean([len(curve["force"]) for curve in curves])))
    rows = [
        Row(f"curves of some {samples} points, fitted", rate, "curves/s", rate / reference,
            "nanite, fit alone", at_least(10.0)),
        Row(f"E within 1 % of nanite's, of {len(curves)}", within, "",
            limit=at_least(len(curves))),
        Row("largest difference of E", 100.0 * max(abs(r - 1.0) for r in ratios), "%"),
    ]  # fmt: skip
    rows += _compare_moduli(theirs, files, seconds)
    notes = ["fit alone: approach, exponent 1.5, no weights; each curve by a separate call"]
    notes += ["modulus: each program with its own baseline and contact point, sphere of 5 µm"]
    return Section(title, rows, notes)


def _compare_moduli(theirs: list[dict[str, Any]], files: list[Path], alone: float) -> list[Row]:
    """Compare the moduli of whole curves, and the time of all with that of the fit alone."""
    reader, tip = FORCE_CURVES.reader(), Sphere(5e-6)
    curves = [
        curve
        for file in files
        for curve in reader.read_curves(file, range(reader.count_curves(file)), 4e9)
    ][: len(theirs)]
    best, fits = least_seconds(lambda: [fit_force_curve(curve, tip) for curve in curves])
    good, others = [], []
    for fit, other in zip(fits, theirs, strict=True):
        value = fit.modulus.value
        if other["rating"] >= 5.0:
            good.append(abs(value.value / other["modulus"] - 1.0))
        else:
            near = abs(value.value - other["modulus"]) <= 2.0 * value.whole_error
            others.append(near or fit.modulus.mark == "do-not-trust")
    return [
        Row(f"E of the {len(good)} curves that nanite rates at least 5 of 10, largest difference",
            100.0 * max(good, default=math.nan), "%", limit=Limit(5.0)),
        Row(f"E of the {len(others)} others within two error bars, or not trusted", sum(others), "",
            limit=at_least(len(others))),
        Row("modulus of whole curves", len(curves) / best, "curves/s", alone / best,
            "the fit alone", at_least(0.5)),
    ]  # fmt: skip


def _fit(curve: dict[str, Any]) -> CurveFits:
    x = curve["penetration"]
    return fit_curves(
        x[None],
        np.zeros((1, x.size)),
        curve["force"][None],
        surface="estimate",
        surface_range=(float(x.min()), float(x.max())),
        exponent=1.5,
    )


def _modulus(fit: CurveFits, other: dict[str, Any]) -> float:
    reduced = 0.75 * float(fit.K[0]) / math.sqrt(other["R"])
    return reduced * (1.0 - float(other["nu"]) ** 2)
