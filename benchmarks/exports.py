"""``python -m benchmarks.exports``: the error of each engine's force, replayed in the engine.

Laws: ball, sponge and PVC of the laboratory, and a Hertzian one of F = 2e4 x^1.5 + 3e4 x^1.5 v.
Motion: the paper's three sines, judged deeper than 2 mm. Engines that are not installed are
skipped. ``docs/validation/exports.md`` has the tables.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter

import numpy as np
from cyclopts import App
from rich.console import Console

import palpate
from benchmarks import machine, report
from benchmarks.export_identification import measure_system_identification
from benchmarks.export_laws import LAWS, MODULES, made, there, tip
from benchmarks.export_round_trip import measure_round_trip
from benchmarks.report import Limit, Row, Section
from palpate import KelvinVoigt, exports
from palpate.exports.replay_errors import drop_to
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.exports", help_format="plaintext", version_flags=[])

RECORDINGS = Path(__file__).parents[1] / "examples" / "recordings"
# m, of the drops whose restitution is compared; the second where the damping is small.
DEPTH, SHALLOW = 12e-3, 3.6e-3


def error(law: str, to: str, form: str = "auto", mass: float = 1.0) -> float:
    """Return the error of force in the real engine, %; NaN if it was not replayed."""
    found = made(law, to, form, mass).statement.compared.replayed_percent
    return float("nan") if found is None else found


def rebound_error(law: str, to: str, form: str, mass: float = 1.0, depth: float = DEPTH) -> float:
    """Return the error of restitution in the real engine in a drop to a depth, %."""
    drop = drop_to(GeneralisedHuntCrossley.of(LAWS[law]), mass, depth)
    found = made(law, to, form, mass).fragment.drop_restitution(drop)
    return float("nan") if found is None else abs(100.0 * (found / drop.restitution - 1.0))


def measure_exact() -> Section:
    """Engines that have the law itself."""
    rows = []
    if there("drake"):
        rows += [
            Row(f"Drake, point contact, {law}", error(law, "drake"), "%", limit=Limit(1e-6))
            for law in ("ball", "sponge")
        ]
    if there("opensim"):
        rows.append(Row("OpenSim, n = 1.5", error("n = 1.5", "opensim"), "%", limit=Limit(1e-5)))
    if there("mujoco"):
        rows += [
            Row(
                f"MuJoCo, callback, {law}",
                error(law, "mujoco", "callback"),
                "%",
                limit=Limit(1e-10),
            )
            for law in LAWS
        ]
    return Section("Engines that have the law: error of force on the paper's motion", rows)


def measure_pair() -> Section:
    """MuJoCo's pair of coincident geoms, by mass; and impacts."""
    rows = []
    for mass, limit in ((0.1, 0.6), (1.0, 0.6), (10.0, 1.5)):
        rows += [
            Row(
                f"force, {law}, {mass:g} kg",
                error(law, "mujoco", "pair", mass),
                "%",
                limit=Limit(limit),
            )
            for law in LAWS
        ]
    for form, limit in (("pair", 3.0), ("callback", 0.5)):
        rows += [
            Row(
                f"restitution, {form}, {law}, 1 kg to 12 mm",
                rebound_error(law, "mujoco", form),
                "%",
                limit=Limit(limit),
            )
            for law in LAWS
        ]
    for mass in (0.1, 1.0, 10.0):
        rows += [
            Row(
                f"restitution, pair, worst of the laws, {mass:g} kg to {1e3 * depth:g} mm",
                max(rebound_error(law, "mujoco", "pair", mass, depth) for law in LAWS),
                "%",
            )
            for depth in (DEPTH, SHALLOW)
        ]
    return Section("MuJoCo: pair with adhesion, and callback", rows)


def measure_kelvin_voigt() -> Section:
    """Return K and B of a Kelvin–Voigt law, fitted to the engine's force by least squares."""
    law = KelvinVoigt(2000.0, 16.6)
    rows = []
    if there("mujoco"):
        fragment = exports.export(law, "mujoco", mass=1.0, form="kelvin-voigt").fragment
        for name, value, truth in zip("KB", read_back(fragment), law.parameters, strict=True):
            off = abs(100.0 * (value / float(truth) - 1.0))
            rows.append(Row(f"mujoco, 1 ms: {name}", off, "%", limit=Limit(0.1)))
    return Section("Kelvin–Voigt, K = 2000, B = 16.6, read back from the engine", rows)


def read_back(fragment: exports.Fragment) -> tuple[float, float]:
    """Return K and B by least squares of the engine's force along the motion of the export."""
    motion = fragment.request.motion.firm()
    ran = fragment.replay(motion)
    assert ran is not None
    columns = np.column_stack([motion.penetration, motion.velocity])[motion.judged]
    found = np.linalg.lstsq(columns, ran.force[motion.judged], rcond=None)[0]
    return float(found[0]), float(found[1])


def measure_others() -> Section:
    """Return the errors of engines with another exponent."""
    rows = []
    if there("drake"):
        for form, law, limit in (
            ("nested-spheres", "n = 1.5", 1.0),
            ("nested-spheres", "PVC", 1.0),
        ):
            rows.append(
                Row(f"Drake, {form}, {law}", error(law, "drake", form), "%", limit=Limit(limit))
            )
        rows += [
            Row(f"Drake, SAP, {law}: Kelvin–Voigt, as it is", error(law, "drake", "sap"), "%")
            for law in LAWS
        ]
    if there("opensim"):
        rows += [Row(f"OpenSim, {law}, as it is", error(law, "opensim"), "%") for law in LAWS]
    if there("mujoco"):
        rows += [
            Row(f"MuJoCo, one contact, {law}, as it is", error(law, "mujoco", "kelvin-voigt"), "%")
            for law in LAWS
        ]
        rows += [
            Row(f"MuJoCo, two contacts, {law}, as it is", error(law, "mujoco", "two-contacts"), "%")
            for law in LAWS
        ]
    return Section("Engines of other laws", rows)


def measure_prediction() -> Section:
    """Compare the predicted error with the replayed one, in percentage points."""
    rows = []
    for to in MODULES:
        if not there(to):
            continue
        engine = exports.engine_called(to)
        for form in engine.forms:
            gaps = {}
            for law in LAWS:
                try:
                    found = made(law, to, form).statement.compared
                except palpate.PalpateError:  # this law does not have the form
                    continue
                if found.replayed_percent is not None:
                    gaps[law] = abs(found.replayed_percent - found.predicted_percent)
            if gaps:
                worst = max(gaps, key=lambda law: gaps[law])
                rows.append(Row(f"{to}, {form}: {worst}", gaps[worst], "points", limit=Limit(0.1)))
    return Section("Predicted against replayed: the worst of the laws", rows)


def measure_time() -> Section:
    """Time one export of an identified recording with its replay, seconds."""
    rows = []
    for name in ("ball", "sponge", "phantom"):
        result = palpate.identify(RECORDINGS / f"{name}.csv")
        for to in MODULES:
            if there(to):
                begun = perf_counter()
                found = exports.export(
                    result, to, mass=1.0, allow=True, tip_radius=tip(to)
                ).statement
                seconds = perf_counter() - begun
                rows.append(Row(f"{name} to {to}: {words(found)}", seconds, "s", limit=Limit(30.0)))
    return Section("An example's recording: one export with its replay", rows)


def words(found: exports.Statement) -> str:
    """Return the three numbers of a statement."""
    errors = found.compared
    three = (errors.percent, errors.against_measured_percent, errors.law_leaves_percent)
    law, measured, leaves = (f"{each:.2g}" for each in three if each is not None)
    return f"{found.fragment.form}; {law} % of the law, {measured} of the measured ({leaves})"


SECTIONS: tuple[Callable[[], Section], ...] = (
    measure_exact,
    measure_pair,
    measure_kelvin_voigt,
    measure_others,
    measure_prediction,
    measure_round_trip,
    measure_time,
    measure_system_identification,
)


def measured(only: str | None) -> Iterator[Section]:
    """Yield each section as soon as it is measured, except empty ones."""
    for measure in SECTIONS:
        if only is None or only in measure.__name__:
            section = measure()
            if section.rows:
                yield section


@app.default
def main(*, only: str | None = None, markdown: Path | None = None) -> None:
    """Measure, and print each table as soon as it is complete.

    Parameters
    ----------
    only
        Only the sections with this in their name, such as pair.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    sections, begun = [], perf_counter()
    for section in measured(only):
        sections.append(section)
        report.print_sections([section], {"after": f"{perf_counter() - begun:.0f} s"}, console)
    where = machine.describe("")
    console.print(report.verdict(sections), style="bold")
    if markdown is not None:
        write_text(
            markdown,
            report.page(
                "Exported contacts, replayed in the engines", "benchmarks.exports", sections, where
            ),
        )


if __name__ == "__main__":
    app()
