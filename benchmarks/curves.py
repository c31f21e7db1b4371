"""``python -m benchmarks.curves``: whole-curve fits a second, and whether each is the minimum.

Needs the ``develop`` extra. With one core: ``taskset -c 0 python -m benchmarks.curves``.
"""

from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Annotated, Any

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console
from rich.progress import track

from benchmarks import machine, report
from benchmarks.curve_reference import Reference, stated_cost
from benchmarks.curve_sets import DEPTH, MOTIONS, Curves, approach_and_retract, random_curves
from benchmarks.native_programs import BuildError, native_programs
from benchmarks.report import Limit, Row, Section
from palpate import SingleStageRLS, VariableProjection
from palpate.contact import Contact
from palpate.estimators.batch_fit import CurveFits, fit_curves
from palpate.preparation.gates import suggest_scale
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.curves", help_format="plaintext", version_flags=[])

SURFACES = (-0.2 * DEPTH, 0.2 * DEPTH)
KNOWN: dict[str, Any] = {}
UNKNOWN: dict[str, Any] = {"surface": "estimate", "surface_range": SURFACES}
ONE_WAY = "one-way approach"
LOW = "approach–retract, n 0.5 to 1"
NANO = 1e9


@app.default
def main(
    *,
    quick: Annotated[bool, Parameter(negative="")] = False,
    curves: int = 400,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    quick
        A short run, for a first look: 20 curves of each kind.
    curves
        Number of each kind.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    count = 20 if quick else curves
    try:
        compiler = native_programs().compiler
    except BuildError as error:
        compiler = f"none ({error})"
    where = machine.describe(compiler)
    sections = [measure_rates(count), measure_minima(count), measure_recursion(count)]
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    report.print_sections(sections, where, console)
    if markdown is not None:
        write_text(
            markdown, report.page("Fits of whole curves", "benchmarks.curves", sections, where)
        )


def measure_rates(count: int) -> Section:
    """Curves a second, of a thousand points, one thread."""
    update = _update_seconds()
    rows = [Row("SingleStageRLS.replay, a sample", NANO * update, "ns")]
    for name, motion in MOTIONS.items():
        known = random_curves(motion, count, seed=1)
        per_sample = _seconds(lambda s=known: _fit(s, KNOWN)) / known.force.size  # type: ignore[misc]
        rows += [
            _rate(f"surface known, {name}", known, KNOWN, 10_000),
            Row(
                "  a sample",
                NANO * per_sample,
                "ns",
                per_sample / update,
                "SingleStageRLS.replay",
                Limit(2.0),
            ),
        ]
    for name, motion in MOTIONS.items():
        unknown = random_curves(motion, count, surface=True, seed=2)
        least = 1000 if name == ONE_WAY else 3000
        rows.append(_rate(f"surface unknown, {name}", unknown, UNKNOWN, least))
        fixed = {**UNKNOWN, "exponent": 1.5}
        rows.append(_rate("  exponent fixed", unknown, fixed, None))
    notes = [
        f"{count} curves of 1000 points, one thread, fit_curves; shortest of the rounds, "
        "in time of that thread on its processor."
    ]
    return Section("Whole curves, through Python", rows, notes)


def measure_minima(count: int) -> Section:
    """Compare J with the lowest that SciPy finds from many starts."""
    rows = []
    for name, motion in MOTIONS.items():
        fraction = 0.01 if name == ONE_WAY else 0.0
        rows += _above(f"known, {name}", random_curves(motion, count, seed=3), KNOWN, fraction)
        curves = random_curves(motion, count, surface=True, seed=4)
        rows += _above(f"unknown, {name}", curves, UNKNOWN, fraction)
    low = random_curves(approach_and_retract, count, surface=True, exponents=(0.5, 1.0), seed=5)
    rows += _above(f"unknown, {LOW}", low, UNKNOWN, 0.01)
    notes = [
        "J(fit_curves) above the lowest J that Levenberg–Marquardt (SciPy) finds from 7 starts "
        "with the surface known and 24 with it unknown, in σ² of the noise."
    ]
    return Section("Minimum of the documented cost", rows, notes)


def measure_recursion(count: int) -> Section:
    """Compare the recursion with the whole-curve fit, in standard errors."""
    rows = []
    for surface, settings in ((False, KNOWN), (True, UNKNOWN)):
        word = "unknown" if surface else "known"
        for name, motion in MOTIONS.items():
            few = max(count // 4, 10) if surface else count
            curves = random_curves(motion, few, surface=surface, seed=6)
            apart = apart_from_the_recursion(
                rolled(curves) if motion is approach_and_retract else curves, settings
            )
            judged = name != ONE_WAY  # two laws fit equally well there, so either may be the result
            worst = Limit(0.5 if surface else 0.1) if judged else None
            median = Limit(0.1) if judged and surface else None
            rows += [
                Row(f"{word}, {name}: median", float(np.median(apart)), "s.e.", limit=median),
                Row("  worst", float(apart.max()), "s.e.", limit=worst),
            ]
    notes = [
        "The largest of K, B and n apart, in the standard errors of fit_curves. All free air of "
        "approach–retract curves comes before contact: the recursion does not go back to it."
    ]
    return Section("The recursion, compared with it", rows, notes)


def rolled(curves: Curves) -> Curves:
    """The same approach–retract curves with all free air before their contact."""
    quarter = curves.force.shape[1] // 4
    signals = (curves.penetration, curves.velocity, curves.force)
    x, v, f = (np.roll(values, quarter, axis=1) for values in signals)
    return Curves(x, v, f, curves.truth, curves.noise)


def _fit(curves: Curves, settings: dict[str, Any]) -> CurveFits:
    return fit_curves(curves.penetration, curves.velocity, curves.force, **settings)


def _seconds(act: Callable[[], object], rounds: int = 7) -> float:
    best = np.inf
    for _ in range(rounds):
        start = thread_time()
        act()
        best = min(best, thread_time() - start)
    return float(best)


def _update_seconds() -> float:
    curves = random_curves(MOTIONS["palpation"], 100, seed=1)
    x, v, f = (np.ravel(values) for values in (curves.penetration, curves.velocity, curves.force))
    estimator = SingleStageRLS()

    def replay() -> None:
        estimator.reset()
        estimator.replay(x, v, f)

    return _seconds(replay) / x.size


def _rate(name: str, curves: Curves, settings: dict[str, Any], least: float | None) -> Row:
    rate = len(curves) / _seconds(lambda: _fit(curves, settings))
    limit = None if least is None else Limit(least, at_least=True)
    return Row(name, rate, "curves/s", limit=limit)


def _above(name: str, curves: Curves, settings: dict[str, Any], fraction: float) -> list[Row]:
    """Count the fits above SciPy by more than 1e-4 σ², with the largest difference."""
    fits = _fit(curves, settings)
    excess = np.empty(len(curves))
    for k in track(range(len(curves)), description=name, transient=True):
        row = curves.penetration[k], curves.velocity[k], curves.force[k]
        cost = stated_cost(*row, **settings)
        reference = Reference(cost, settings.get("surface_range"))
        found = np.array([column[k] for column in parameters(fits)])
        starts = 24 if "surface" in settings else 7
        excess[k] = (cost.value(found) - reference.least(starts)) / fits.noise[k] ** 2
    above = int(np.count_nonzero(excess > 1e-4))
    allowed = int(fraction * len(curves))
    return [
        Row(f"{name}: above SciPy by 1e-4 σ²", above, f"of {len(curves)}", limit=Limit(allowed)),
        Row("  by at most", float(max(excess.max(), 0.0)), "σ²", limit=Limit(1.0)),
        Row("  SciPy above by 1e-4 σ²", int(np.count_nonzero(excess < -1e-4)), "curves"),
    ]


def parameters(fits: CurveFits) -> tuple[Any, ...]:
    """Return K, B, n, F₀ and d, one array each."""
    return fits.stiffness, fits.damping, fits.exponent, fits.offset, fits.surface


def apart_from_the_recursion(curves: Curves, settings: dict[str, Any]) -> Any:
    """Return the largest difference of K, B and n, in standard errors, for each curve."""
    fits = _fit(curves, settings)
    apart = np.empty(len(curves))
    time = 1e-3 * np.arange(curves.force.shape[1])
    for k in range(len(curves)):
        row = curves.penetration[k], curves.velocity[k], curves.force[k]
        scale = suggest_scale(Contact(time, penetration=row[0], velocity=row[1], force=row[2]))
        estimator = VariableProjection(scale=scale, **settings)
        estimator.replay(*row)
        law = estimator.estimate().parameters
        mine = np.array([column[k] for column in parameters(fits)[:3]])
        apart[k] = (np.abs(law - mine) / fits.standard_errors[k, :3]).max()
    return apart


if __name__ == "__main__":
    app()
