"""``python -m benchmarks.exports``: the error of each engine's force, replayed in the engine.

Laws: ball, sponge and PVC of the laboratory, and a Hertzian one of F = 2e4 x^1.5 + 3e4 x^1.5 v.
Motion: the paper's three sines, judged deeper than 2 mm. Engines that are not installed are
skipped. ``docs/validation/exports.md`` has the tables.
"""

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NoReturn

import numpy as np
from rich.console import Console
from rich.progress import track

import palpate
from benchmarks import engine_logs, sliding
from benchmarks.common.report import Limit, Row, Section, describe_machine, publish, run_command
from palpate import HuntCrossley, KelvinVoigt, exports, lab
from palpate.exports.newton import NewtonScene
from palpate.exports.replay_errors import drop_to, force_error
from palpate.exports.usd import UsdMaterial
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, engines, literature
from palpate.validation import Floats
from palpate.writing import check_outputs

RECORDINGS = Path(__file__).parents[1] / "examples" / "recordings"
# m, of the drops whose restitution is compared; the second where the damping is small.
DEPTH, SHALLOW = 12e-3, 3.6e-3
SEEDS, NOISE = 20, 0.05  # of a round trip; N
LAWS: dict[str, ForceLaw] = {
    "ball": lab.BALL.law,
    "sponge": lab.SPONGE.law,
    "n = 1.5": HuntCrossley(K=2e4, B=3e4, n=1.5),
    "PVC": lab.PVC.law,
}
#: The engines that palpate runs, and the seconds of an export in those that compile nothing.
ENGINES = ("drake", "opensim", "mujoco", "mjx", "mujoco-warp", "newton")
TIMED = ENGINES[:3]
KELVIN_VOIGT = KelvinVoigt(K=2000.0, B=16.6)
GRAVITY = 9.81  # m/s²
PRESS, FRICTION = 20.0, 0.5  # N, and the coefficient of the friction that is measured
RADIUS = 30e-3  # m, of the tip, for engines whose law has it


@lru_cache(maxsize=64)
def made(law: str, to: str, form: str = "auto", mass: float = 1.0) -> exports.Export:
    """Return the export of one of the laws, whatever its error."""
    return exports.export(LAWS[law], to, form=form, mass=mass, allow=True, tip_radius=tip(to))


def tip(to: str) -> float | None:
    """Return the tip's radius, m, for the engines whose law has it."""
    return RADIUS if to == "opensim" else None


def there(engine: str) -> bool:
    """Whether an engine is installed."""
    return exports.engine_called(engine).version() is not None


def error(law: str, to: str, form: str = "auto", mass: float = 1.0) -> float:
    """Return the error of force in the real engine, %; NaN if it was not replayed."""
    found = made(law, to, form, mass).statement.compared.replayed_percent
    return float("nan") if found is None else found


def rebound_error(law: str, to: str, form: str, mass: float = 1.0, depth: float = DEPTH) -> float:
    """Return the error of restitution in the real engine in a drop to a depth, %."""
    drop = drop_to(GeneralisedHuntCrossley.of(LAWS[law]), mass, depth)
    found = made(law, to, form, mass).fragment.drop_restitution(drop)
    return float("nan") if found is None else abs(100.0 * (found / drop.restitution - 1.0))


def force_rows(
    words: str,
    to: str,
    form: str = "auto",
    laws: Sequence[str] = tuple(LAWS),
    limit: float | None = None,
    mass: float = 1.0,
) -> list[Row]:
    """Return the error of force of each law in an engine that is installed."""
    bound = None if limit is None else Limit(limit)
    return [
        Row(words.format(law), error(law, to, form, mass), "%", limit=bound)
        for law in (laws if there(to) else ())
    ]


def measure_exact() -> Section:
    """Engines that have the law itself."""
    rows = [
        *force_rows("Drake, point contact, {}", "drake", laws=("ball", "sponge"), limit=1e-6),
        *force_rows("OpenSim, {}", "opensim", laws=("n = 1.5",), limit=1e-5),
        *force_rows("MuJoCo, callback, {}", "mujoco", "callback", limit=1e-10),
    ]
    return Section("Engines that have the law: error of force on the paper's motion", rows)


def measure_pair() -> Section:
    """MuJoCo's pair of coincident geoms, by mass; and impacts."""
    rows = []
    for mass, limit in ((0.1, 0.6), (1.0, 0.6), (10.0, 1.5)):
        words = f"force, {{}}, {mass:g} kg"
        rows += force_rows(words, "mujoco", "pair", limit=limit, mass=mass)
    laws = tuple(LAWS) if there("mujoco") else ()
    for form, bound in (("pair", Limit(3.0)), ("callback", Limit(0.5))):
        for law in laws:
            found = rebound_error(law, "mujoco", form)
            rows.append(Row(f"restitution, {form}, {law}, 1 kg to 12 mm", found, "%", limit=bound))
    for mass, depth in product((0.1, 1.0, 10.0), (DEPTH, SHALLOW)) if laws else ():
        worst = max(rebound_error(law, "mujoco", "pair", mass, depth) for law in laws)
        words = f"restitution, pair, worst of the laws, {mass:g} kg to {1e3 * depth:g} mm"
        rows.append(Row(words, worst, "%"))
    return Section("MuJoCo: pair with adhesion, and callback", rows)


def measure_kelvin_voigt() -> Section:
    """Return K and B of a Kelvin–Voigt law, fitted to the engine's force by least squares."""
    law = KelvinVoigt(K=2000.0, B=16.6)
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
    spheres = "nested-spheres"
    rows = [
        *force_rows(f"Drake, {spheres}, {{}}", "drake", spheres, ("n = 1.5", "PVC"), 1.0),
        *force_rows("Drake, SAP, {}: Kelvin–Voigt, as it is", "drake", "sap"),
        *force_rows("OpenSim, {}, as it is", "opensim"),
        *force_rows("MuJoCo, one contact, {}, as it is", "mujoco", "kelvin-voigt"),
        *force_rows("MuJoCo, two contacts, {}, as it is", "mujoco", "two-contacts"),
    ]
    return Section("Engines of other laws", rows)


def measure_prediction() -> Section:
    """Compare the predicted error with the replayed one, in percentage points."""
    rows = []
    for to in filter(there, ENGINES):
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


def measure_round_trip() -> Section:
    """Export, record in the engine with 0.05 N of noise, identify, and return the errors."""
    rows = []
    for to, form, laws in (
        ("mujoco", "pair", tuple(LAWS)),
        ("mujoco", "callback", tuple(LAWS)),
        ("drake", "auto", tuple(LAWS)),
        ("opensim", "auto", ("n = 1.5",)),
    ):
        for law in laws if there(to) else ():
            worst, literal, biases = round_trips(made(law, to, form), law)
            name = f"{to}, {form}, {law}"
            rows += [
                Row(f"{name}: K, B, n", worst, "s.e.", limit=Limit(3.0)),
                Row(f"{name}: K, B, n, taken literally", literal, "s.e."),
                Row(f"{name}: stiffness or damping at depth, the mean", biases, "%"),
            ]
    notes = (
        "The stated error ε is one of force. It changes a parameter by s.e. · ε ‖F‖/σ at most, "
        "which is subtracted; taken literally it is that fraction of the parameter.",
    )
    return Section(f"Round trip: beyond the stated error, worst of {SEEDS} seeds", rows, notes)


class SimulatedContact:
    """A material of the laboratory whose force an exported law has in the real engine."""

    name = "a law in an engine"

    def __init__(self, made: exports.Export) -> None:
        self._fragment, self._law = made.fragment, made.statement.nearest.law.simplest()

    def describe(self) -> dict[str, object]:
        """Return the exported law, SI."""
        return self._law.description()

    def touch(self) -> NoReturn:
        """Raise: the force depends on the acceleration of the probe."""
        raise NotImplementedError

    def force(
        self, time: Floats, lateral_position: Floats, penetration: Floats, velocity: Floats
    ) -> Floats:
        """Return the engine's force [N] along a whole motion; 0 out of contact."""
        force, below = np.zeros_like(time), np.flatnonzero(penetration > 0.0)
        acceleration = np.gradient(velocity, time)
        t, x, v, a = (each[below] for each in (time, penetration, velocity, acceleration))
        motion = exports.ProbeMotion(t, x, v, a, below >= 0)
        replayed = self._fragment.replay(motion)
        assert replayed is not None
        force[below] = replayed.force
        return force


def round_trips(export: exports.Export, law: str) -> tuple[float, float, float]:
    """Return the worst of K, B and n, both ways, in s.e.; bias of stiffness or damping, %."""
    bench = lab.Bench(SimulatedContact(export), lab.THREE_SINES, lab.IdealProbe(), lab.PERFECT)
    clean, truth = bench.run(seed=0).contact, LAWS[law]
    stated = 0.01 * export.statement.compared.percent
    worst, literal, biases = [], [], []
    for seed in range(SEEDS):
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(clean))
        result = palpate.identify(replace(clean, force=clean.force + noise), trace=False)
        off = np.abs(result.law.parameters - truth.parameters)
        errors = result.standard_errors
        size = float(np.linalg.norm(result.contact.force[result.trace.taken]))
        worst.append(float((off / errors).max()) - stated * size / NOISE)
        literal.append(float(((off - stated * truth.parameters) / errors).max()))
        there_ = result.working_depths[0]
        real = np.array([truth.stiffness_at(there_.depth), truth.damping_at(there_.depth)])
        biases.append(np.array([there_.stiffness.value, there_.damping.value]) / real - 1.0)
    return (
        max(0.0, *worst),
        max(0.0, *literal),
        100.0 * float(np.abs(np.mean(biases, axis=0)).max()),
    )


# Models around an exported contact; --check and a simulation of its own compare it with the law.

SLIDE = """<mujoco><option gravity="0 0 0"/><worldbody><body pos="0 0 {height}">
  <joint type="slide" axis="0 0 1"/><geom name="tip" size="0.03" mass="1"/>{more}
  </body></worldbody></mujoco>"""
# A carriage on a slide, and a tool that slides on it.
TWO_BODIES = """<mujoco><option gravity="0 0 0"/><worldbody><body pos="0 0 {height}">
  <joint type="slide" axis="0 0 1"/><geom size="0.02" mass="0.8" pos="0.1 0 0.1"/>
  <body><joint type="slide" axis="0 0 1" stiffness="1e5" damping="200"/>
  <geom name="tip" size="0.03" mass="0.4"/></body></body></worldbody></mujoco>"""
# A shoulder and an elbow with geared motors.
ARM = """<mujoco><option gravity="0 0 0"/><worldbody><body pos="0 0 {height}">
  <joint axis="0 1 0" armature="0.05"/><geom size="0.03" mass="1"/>
  <body pos="0.3 0 0"><joint axis="0 1 0" armature="0.05"/><geom size="0.03" mass="0.6"/>
  <geom name="tip" size="0.03" pos="0.25 0 0" mass="0.2"/></body></body></worldbody></mujoco>"""
# A model, and the text in it that somebody changes; the second material is another export.
EDITS: dict[str, tuple[str, str, str]] = {
    "as exported": (ARM, "", ""),
    "armature of an arm, .05 to .5": (ARM, 'armature="0.05"', 'armature="0.5"'),
    "mass of the tool, 1 to 1.3 kg": (SLIDE, 'mass="1"', 'mass="1.3"'),
    "a two-body slide, tool .4 to .6 kg": (TWO_BODIES, 'mass="0.4"', 'mass="0.6"'),
    "a two-body slide, as exported": (TWO_BODIES, "", ""),
}


def measure_check() -> Section:
    """Compare ``palpate export --check`` with a simulation that shares none of its code."""
    rows = []
    for name, (text, old, new) in EDITS.items() if there("mujoco") else ():
        for law in ("ball", "n = 1.5"):
            with TemporaryDirectory() as folder:
                path = finished_model(Path(folder), text.replace("{height}", "1"), (law,))
                path.write_text(path.read_text().replace(old, new) if old else path.read_text())
                [found] = exports.check_model(path)
                simulated = simulate_contact(path, LAWS[law], "palpate_pad")
            gap = abs(found.percent - simulated)
            text_of = f"--check, {name}, {law}: {found.percent:.2f} %, simulated {simulated:.2f} %"
            rows.append(Row(text_of, gap, "points", limit=Limit(0.5)))
    if there("mujoco"):
        with TemporaryDirectory() as folder:
            laws = ("ball", "PVC")
            path = finished_model(Path(folder), SLIDE.replace("{height}", "1"), laws)
            path.write_text(path.read_text().replace('mass="1"', 'mass="1.2"'))
            for law, found in zip(laws, exports.check_model(path), strict=True):
                simulated = simulate_contact(path, LAWS[law], f"palpate_{law}_pad")
                gap = abs(found.percent - simulated)
                text_of = f"--check, two materials, {law}: {found.percent:.2f} %, simulated"
                rows.append(Row(f"{text_of} {simulated:.2f} %", gap, "points", limit=Limit(0.5)))
    return Section("--check against an independent forward simulation", rows)


def finished_model(folder: Path, text: str, laws: Sequence[str]) -> Path:
    """Return one file with the model and an export of each law; several are told by name."""
    import mujoco

    path = folder / "model.xml"
    path.write_text(text.replace("{more}", ""))
    model = path
    for law in laws:
        name = law if len(laws) > 1 else ""
        made = exports.export(LAWS[law], "mujoco", model=model, geom="tip", name=name)
        out = folder / f"out_{len(name)}_{law[0]}"
        made.save(out)
        model = folder / f"with_{law[0]}.xml"
        spec = mujoco.MjSpec.from_file(str(out / "robot_scene.xml"))
        spec.compile()
        model.write_text(spec.to_xml())
    return model


def simulate_contact(path: Path, law: ForceLaw, pad: str) -> float:
    """Return the error of the contact's force in a simulation in time, %.

    A force on the tip, of a stiff spring and damper, moves it 1 to 14 mm into the pad at 1.5 Hz,
    by ``mj_step``; penetration and velocity are those of the tip, the force that of the contacts.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = 2e-4
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    tip = model.geom("tip").id
    body = model.geom_bodyid[tip]
    pads = {k for k in range(model.ngeom) if model.geom(k).name.startswith(pad)}
    radius = float(model.geom_size[tip, 0])
    first = float(data.geom_xpos[tip, 2])
    for k in pads:
        model.geom_pos[k, 2] = first - radius
    others = [k for k in range(model.npair) if model.pair_geom1[k] not in pads]
    for k in others:
        model.geom_pos[model.pair_geom1[k], 2] = -10.0
    across = np.zeros((3, model.nv))
    measured, expected, wrench = [], [], np.zeros(6)
    for step in range(10_000):
        time = step * model.opt.timestep
        depth = 7.5e-3 - 6.5e-3 * np.cos(2 * np.pi * 1.5 * time)
        speed = 6.5e-3 * 2 * np.pi * 1.5 * np.sin(2 * np.pi * 1.5 * time)
        mujoco.mj_jac(model, data, across, None, data.geom_xpos[tip], body)
        x = first - float(data.geom_xpos[tip, 2])
        v = -float(across[2] @ data.qvel)
        data.qfrc_applied[:] = across[2] * -(2e5 * (depth - x) + 600.0 * (speed - v))
        mujoco.mj_step1(model, data)
        x = first - float(data.geom_xpos[tip, 2])
        mujoco.mj_jac(model, data, across, None, data.geom_xpos[tip], body)
        v = -float(across[2] @ data.qvel)
        mujoco.mj_step2(model, data)
        force = 0.0
        for k in range(data.ncon):
            if pads & set(data.contact.geom[k].tolist()):
                mujoco.mj_contactForce(model, data, k, wrench)
                force += wrench[0]
        if time > 0.5 and x > 2e-3:
            measured.append(force)
            expected.append(float(law.force(x, v)))
    off = np.subtract(measured, expected)
    return 100.0 * float(np.linalg.norm(off) / np.linalg.norm(expected))


# Ten laws by their names in docs/reference/named-laws.md, at a restitution or time as in use.
NAMED: dict[str, ForceLaw] = {
    "Kelvin–Voigt": engines.kelvin_voigt(K=2000.0, B=16.6),
    "Drake, point contact": engines.drake_point(stiffness=2000.0, dissipation=1.0),
    "Drake, hydroelastic": engines.drake_hydroelastic(
        modulus=1e5, radius=0.03, thickness=0.02, dissipation=1.0
    ),
    "Simbody, OpenSim": engines.simbody(modulus=1e5, radius=0.03, dissipation=1.0),
    "Kuwabara–Kono half-space": literature.half_space(K=2e4, n=1.5, retardation_time=0.01),
    "Hunt & Crossley 1975": literature.hunt_crossley_1975(K=2e4, n=1.5, restitution=0.8, speed=0.1),
    "Lankarani & Nikravesh": literature.lankarani_nikravesh(
        K=2e4, n=1.5, restitution=0.8, speed=0.1
    ),
    "Flores": literature.flores(K=2e4, n=1.5, restitution=0.8, speed=0.1),
    "Zener, 1500 + 1500 N/m, τ .4 s": literature.standard_linear_solid(
        K=1500.0, branch_stiffness=1500.0, branch_damping=600.0
    ),
    "Fung, c .1": literature.fung(instantaneous=2e4, n=1.5, c=0.1, shortest=0.01, longest=10.0),
}


def measure_relaxing() -> Section:
    """A law that relaxes, and which of ten named laws are refused."""
    if not there("mujoco"):
        return Section("Laws that relax", [])
    rows = []
    motion = exports.ProbeMotion.of_paper()
    relaxing = NAMED["Zener, 1500 + 1500 N/m, τ .4 s"]
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(motion))
    contact = palpate.Contact(
        motion.time,
        penetration=motion.penetration,
        velocity=motion.velocity,
        force=motion.force_by(relaxing) + noise,
    )
    statement = exports.export(palpate.identify(contact), "mujoco", mass=1.0, allow=True).statement
    refused = "refused" if statement.refusals else "not refused"
    name = f"a law with τ .4 s, identified: error against palpate's answer ({refused})"
    limit = None if statement.refusals else Limit(5.0)
    rows.append(Row(name, statement.compared.percent, "%", limit=limit))
    count = 0
    for name, law in NAMED.items():
        statement = exports.export(law, "mujoco", mass=1.0, allow=True).statement
        count += bool(statement.refusals)
        refused = "refused" if statement.refusals else statement.fragment.form
        rows.append(Row(f"{name} ({refused})", statement.compared.percent, "%"))
    rows.append(Row("refused of the ten named laws", float(count), "", limit=Limit(3.0)))
    return Section("Laws that relax, and ten named laws", rows)


def measure_answer() -> Section:
    """Count the lines that ``palpate export`` prints for the examples."""
    rows = []
    for name in ("ball", "sponge", "phantom") if there("mujoco") else ():
        with TemporaryDirectory() as folder:
            result = Path(folder) / name
            run_palpate("identify", RECORDINGS / f"{name}.csv", "-o", result)
            out = run_palpate(
                "export", result, "--to", "mujoco", "--mass", "1", "-o", Path(folder) / "out"
            )
        lines = float(len(out.splitlines()))
        rows.append(Row(f"lines of the answer, {name}", lines, "", limit=Limit(12.0)))
    return Section("The answer on the terminal", rows)


def run_palpate(*words: str | Path) -> str:
    """Return what a command of palpate prints."""
    command = [sys.executable, "-m", "palpate", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def measure_time() -> Section:
    """Time one export of an identified recording with its replay, seconds."""
    rows = []
    for name in ("ball", "sponge", "phantom"):
        result = palpate.identify(RECORDINGS / f"{name}.csv")
        for to in TIMED:
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


def measure_training() -> Section:
    """Return the errors of the engines in which people train."""
    rows = []
    if there("newton"):
        for solver in ("SolverMuJoCo", "SolverSemiImplicit"):
            rows += newton_rows(solver)
    for law in LAWS if there("mjx") else ():
        bound = None if law == "sponge" else Limit(1.5)
        found = withdrawal_error(made(law, "mjx").fragment)
        rows.append(Row(f"MJX, two contacts, {law}: force on withdrawal", found, "%", limit=bound))
    if there("mjx"):
        compared = made("PVC", "mjx").statement.compared
        assert compared.replayed_restitution is not None
        off = abs(compared.replayed_restitution - compared.drop.restitution)
        rows.append(Row("MJX, two contacts, PVC: restitution", off, "", limit=Limit(0.02)))
    rows += force_rows("MuJoCo-Warp, pair, {}", "mujoco-warp", limit=0.6)
    for law in ("ball", "sponge", "PVC") if there("mujoco") else ():
        rows.append(Row(f"MuJoCo, pair, {law}: pull at -0.3 m/s, of the peak", pull(law), "%"))
    return Section("Engines in which people train", rows)


def newton_rows(solver: str) -> list[Row]:
    """Return the errors of a solver of Newton at 5 mm, and of the depth of 1 kg at rest."""
    law = GeneralisedHuntCrossley.of(KELVIN_VOIGT)
    fragment = exports.export(KELVIN_VOIGT, "newton", mass=1.0, replay=False).fragment
    scene = NewtonScene(fragment.files(()), solver)
    x, v = np.full(3, 5e-3), np.array([0.0, 0.05, -0.05])
    motion = exports.ProbeMotion(np.arange(3.0), x, v, 0.0 * x, x > 0.0)
    truth = motion.force_by(law)
    off = 100.0 * np.abs(scene.along(motion, truth) / truth - 1.0)
    places = ("at rest", "at 50 mm/s", "at -50 mm/s")
    # SolverSemiImplicit does not damp withdrawals, which the statement says.
    rows = [
        Row(
            f"Newton, {solver}: force {place}",
            float(error),
            "%",
            limit=None if solver == "SolverSemiImplicit" and place == places[2] else Limit(1.0),
        )
        for place, error in zip(places, off, strict=True)
    ]
    scene.put(0.0, 0.0)
    for _ in range(3000):
        scene.step(1e-3, (0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0))
    depth = 100.0 * abs(scene.penetration() * law.K / GRAVITY - 1.0)
    return [*rows, Row(f"Newton, {solver}: depth of 1 kg at rest", depth, "%", limit=Limit(1.0))]


def withdrawal_error(fragment: exports.Fragment) -> float:
    """Return the error of a replayed force where the probe withdraws, %."""
    motion = fragment.request.motion.firm()
    ran = fragment.replay(motion)
    assert ran is not None
    return force_error(ran.force, motion.force_by(fragment.request.law), motion.velocity < 0.0)


def pull(law: str) -> float:
    """Return the largest pull of MuJoCo's pair at -0.3 m/s, in % of the motion's largest force."""
    fragment = made(law, "mujoco", "pair").fragment
    motion = fragment.request.motion.firm(500)
    withdrawn = replace(motion, velocity=np.full(len(motion), -0.3), acceleration=0.0 * motion.time)
    ran = fragment.replay(withdrawn)
    assert ran is not None
    largest = float(motion.force_by(fragment.request.law).max())
    return 100.0 * max(0.0, -float(ran.force.min())) / largest


def measure_friction() -> Section:
    """Return how a body pressed with 20 N at a coefficient of 0.5 is held, and slides."""
    rows = []
    for to, law, form in (
        ("mujoco", "ball", "pair"),
        ("mujoco", "PVC", "pair"),
        ("mujoco", "n = 1.5", "two-contacts"),
        ("drake", "ball", "point"),
        ("drake", "PVC", "nested-spheres"),
        ("opensim", "n = 1.5", "auto"),
        ("newton", "ball", "auto"),
    ):
        if not there(to):
            continue
        fragment = exports.export(
            LAWS[law],
            to,
            form=form,
            mass=1.0,
            allow=True,
            replay=False,
            friction=FRICTION,
            tip_radius=tip(to),
        ).fragment
        speeds = {f"{to}, {fragment.form}, {law}": sliding.sliding(fragment)}
        if isinstance(fragment, UsdMaterial):
            other = "SolverSemiImplicit"
            speeds[f"{to}, {other}"] = sliding.in_newton(fragment, other)
        for name, speed in speeds.items():
            held = 1e3 * speed(PRESS, 0.95 * FRICTION * PRESS)
            more = 1.05 * FRICTION * PRESS
            force = more - speed(PRESS, more) / sliding.FALL
            off = 100.0 * abs(force / (FRICTION * PRESS) - 1.0)
            rows.append(Row(f"{name}: creeps under 95 % of the friction", held, "mm/s"))
            rows.append(Row(f"{name}: friction of a sliding body", off, "%", limit=Limit(5.0)))
    return Section("Friction 0.5 under 20 N, of 1 kg", rows)


def measure_logs() -> Section:
    """Return the errors of the law that palpate identifies from an engine's own log."""
    rows = []
    for to, law in (
        *(("mujoco", law) for law in ("K x + B v", *LAWS)),
        ("mjx", "K x + B v"),
        ("newton", "K x + B v"),
    ):
        if not there(to):
            continue
        exported = KELVIN_VOIGT if law == "K x + B v" else LAWS[law]
        fragment = exports.export(exported, to, mass=1.0, allow=True, replay=False).fragment
        log = engine_logs.LOGS[to](fragment)
        rows += log_rows(f"{to}, {fragment.form}, {law}", log, exported)
    if find_spec("pybullet"):
        # PyBullet adds K h to the damping.
        log = engine_logs.log_pybullet(2000.0, 16.6 - 2000.0 * 1e-3)
        rows += log_rows("pybullet, K x + B v", log, KELVIN_VOIGT)
    return Section("A law identified from the engine's own log", rows)


def log_rows(name: str, log: engine_logs.Log, law: ForceLaw) -> list[Row]:
    """Return the rows of one log."""
    return [
        Row(f"{name}: {quantity}", error, "%", limit=Limit(1.0))
        for quantity, error in zip(
            ("stiffness", "damping"), engine_logs.read_back(log, law), strict=True
        )
    ]


SECTIONS: tuple[Callable[[], Section], ...] = (
    measure_exact,
    measure_pair,
    measure_kelvin_voigt,
    measure_others,
    measure_prediction,
    measure_round_trip,
    measure_training,
    measure_friction,
    measure_logs,
    measure_check,
    measure_relaxing,
    measure_answer,
    measure_time,
)


def main(*, only: str = "", markdown: Path | None = None) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    only
        Only the sections with this in their name, such as pair.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    chosen = [measure for measure in SECTIONS if only in measure.__name__]
    sections = [measure() for measure in track(chosen, "engines", console=Console(stderr=True))]
    title = "Exported contacts, replayed in the engines"
    publish([each for each in sections if each.rows], describe_machine(), title, markdown)


if __name__ == "__main__":
    run_command(main)
