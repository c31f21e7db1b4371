"""Every export: motion, nearest law, claim, refusals; Drake's and OpenSim's numbers and texts."""

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from cases import exciting
from export_cases import (
    BALL_LAW,
    HALF_SPACE_LAW,
    HERTZ_LAW,
    KELVIN_VOIGT_LAW,
    PVC_LAW,
    SPONGE_LAW,
    apart_percent,
    fitted,
    predicted_percent,
)

import palpate
from palpate import ExtendedKelvinVoigt, GeneralisedHuntCrossley, HuntCrossley, KelvinVoigt, exports
from palpate.digits import format_hertz
from palpate.errors import ExportRefusedError, InvalidParameterError, RecordingError
from palpate.exports import Engine, Fragment, ProbeMotion, Replayed
from palpate.exports.drake.running import restitution_by_steps
from palpate.exports.exporting import export
from palpate.exports.nearest_law import kelvin_voigt, nearest_without_memory, stable_step
from palpate.exports.replay_errors import Drop, drop_to, force_error, restitution_by
from palpate.exports.statement import ExportedLaw
from palpate.exports.texts import hash_comment, xml_comment
from palpate.findings import Finding
from palpate.force_laws import engines, law_from
from palpate.identification.diagnosis import Verdict
from palpate.lab import BALL, PVC, TISSUE
from palpate.output.results.saved import SCHEMA_VERSION, result_dict

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


@dataclass(frozen=True, eq=False, kw_only=True)
class Scaled(Fragment):
    """An engine's contact that is too strong by a factor."""

    factor: float = 1.0
    rebound: float | None = None
    runs: bool = True

    def files(self, notes):
        return {"fragment.txt": "\n".join(notes)}

    def predict_force(self, motion):
        return motion.force_by(self.request.law)

    def predict_restitution(self, drop):
        return drop.restitution if self.rebound is None else self.rebound

    def replay(self, motion):
        force = self.factor * motion.force_by(self.request.law)
        return Replayed(force, "state by state") if self.runs else None


class Toy(Engine):
    name: ClassVar[str] = "toy"
    title: ClassVar[str] = "Toy"
    distribution: ClassVar[str] = "toy"
    forms: ClassVar[dict] = {"only": "the only way"}
    settings: ClassVar[dict] = {}

    def fit(self, asked):
        return Scaled(form="only", request=asked, numbers={"k": 1.0}, **self.settings)

    def version(self):
        return "1.0"


@pytest.fixture
def toy(monkeypatch):
    def become(**settings):
        monkeypatch.setattr(Toy, "settings", settings)

    def called(name):
        return Toy() if name == "toy" else exports.engine_called(name)

    monkeypatch.setattr("palpate.exports.exporting.engine_called", called)
    become()
    return become


def test_the_export_moves_surface_and_offset_to_zero(ball, saved):
    motion = ProbeMotion.recorded(ball)
    assert np.array_equal(motion.force, ball.contact.force - ball.estimate.offset)
    assert np.count_nonzero(motion.judged) == np.count_nonzero(ball.trace.taken)
    assert (motion.penetration[motion.judged] > 0.0).all()
    error = force_error(motion.force_by(ball.law), motion.force, motion.judged)
    assert error == pytest.approx(ball.fit_rmse_percent, rel=1e-3)
    firm = motion.firm()
    assert firm.judged.all()
    assert firm.deepest == motion.deepest
    there = ProbeMotion.recorded(palpate.load_result(saved))
    for name in ("time", "penetration", "velocity", "acceleration", "force", "judged"):
        assert np.array_equal(getattr(there, name), getattr(motion, name)), name


def test_a_gap_in_the_recording_makes_no_acceleration():
    time = np.r_[np.arange(100), 5000 + np.arange(100)] * 1e-3
    contact = palpate.Contact(
        time,
        penetration=np.repeat([5e-3, 6e-3], 100),
        velocity=np.zeros(200),
        force=np.full(200, 10.0),
        segment=np.repeat([0, 1], 100),
    )
    trace = palpate.Trace.empty(200, 3)
    trace.status[:] = int(palpate.Status.UPDATED)
    motion = ProbeMotion.recorded(
        SimpleNamespace(contact=contact, trace=trace, description={"results": [{}]})
    )
    assert motion.starts == (0, 100)
    assert not motion.acceleration.any()


@pytest.mark.parametrize("law", [BALL_LAW, SPONGE_LAW, HERTZ_LAW, PVC_LAW], ids=repr)
def test_a_drop_by_the_exact_relation_is_the_one_by_integration(law):
    drop = drop_to(law, 1.0, 12e-3)
    assert drop.restitution == palpate.restitution(law.B / law.K, drop.speed)
    # RK4 at a thousandth of half a period: seen 6e-7.
    assert restitution_by(law, drop) == pytest.approx(drop.restitution, rel=2e-6)
    # Without damping the body has the energy of the spring.
    drop = drop_to(replace(law, B=0.0), 0.5, 10e-3)
    energy = law.K * 10e-3 ** (law.n + 1.0) / (law.n + 1.0)
    assert 0.5 * 0.5 * drop.speed**2 == pytest.approx(energy, rel=1e-6)
    assert drop.restitution == 1.0


def test_the_nearest_kelvin_voigt_law_is_the_least_squares():
    motion, linear = ProbeMotion.of_paper(), KelvinVoigt(K=2000.0, B=15.0)
    assert kelvin_voigt(GeneralisedHuntCrossley.of(linear), motion).simplest() == linear
    found = kelvin_voigt(PVC.law, motion)
    least = apart_percent(motion, found, PVC.law)
    # Measured on this motion; what MuJoCo's linear contact was seen to leave.
    assert 17.0 < least < 18.0
    for change in ({"K": 1.01 * found.K}, {"B": 1.1 * found.B}):
        assert apart_percent(motion, replace(found, **change), PVC.law) > least


def test_the_nearest_law_never_makes_energy():
    memory = palpate.SingleRelaxation(0.1)
    remembering = GeneralisedHuntCrossley(
        K=8000.0, n=1.5, B=-200.0, p=1.5, M=8000.0, relaxation=memory
    )
    assert nearest_without_memory(remembering, ProbeMotion.of_paper()).law.B >= 0.0


SPECTRUM = GeneralisedHuntCrossley(
    K=8000.0,
    n=1.5,
    B=2000.0,
    p=1.5,
    relaxation=palpate.RelaxationSpectrum((2e-3, 0.1, 2.0), (3e3, 2e3, 3e3)),
)


def relaxing_result(motion, *branches):
    """Identification of a law with these relaxation times and stiffnesses along a motion."""
    spectrum = palpate.RelaxationSpectrum(*branches)
    law = GeneralisedHuntCrossley(K=8000.0, n=1.4, B=0.0, p=1.4, relaxation=spectrum)
    force = law.force_along(motion.penetration, motion.velocity, np.full(len(motion.time), 1e-3))
    force += np.random.default_rng(4).normal(0.0, 0.02, force.size)
    contact = palpate.Contact(
        motion.time, penetration=motion.penetration, velocity=motion.velocity, force=force
    )
    return palpate.identify(contact, trace=False)


def apart_percent_of_force(source, law):
    """Error of a law's force against the identified law with its memory, %."""
    motion = source.motion
    return force_error(motion.force_by(law), source.answer, motion.judged)


def strokes():
    """5 s of presses from free air at 0.8 and 3 Hz."""
    time = 1e-3 * np.arange(5000)
    slow, fast = 1.6 * np.pi * time, 6.0 * np.pi * time
    depth = 6e-3 - 7e-3 * np.cos(slow) + 1.5e-3 * np.sin(fast)
    return SimpleNamespace(time=time, penetration=depth, velocity=np.gradient(depth, time))


def test_a_relaxing_recording_is_exported_as_the_nearest_law_without_memory():
    motion = exciting(PVC_LAW, seconds=6.0)
    result = relaxing_result(motion, (0.1, 0.5), (2000.0, 1000.0))
    assert result.law.remembers
    source = ExportedLaw.of(result)
    depth, frequency, stiffness, damping = source.response
    there = result.diagnosis.working_depth
    assert (depth, frequency) == (there.depth, result.frequency)
    assert (stiffness, damping) == pytest.approx((there.stiffness.value, there.damping.value))
    # Nearer to the identified law than the one that is nearest to the measured force.
    plain = palpate.identify(result.contact, "variable-projection", trace=False).law
    own = apart_percent_of_force(source, source.law)
    assert own <= apart_percent_of_force(source, plain)
    for change in ({"K": 1.01 * source.law.K}, {"B": 1.1 * source.law.B}):
        assert apart_percent_of_force(source, replace(source.law, **change)) > own
    statement = export(result, "physx", mass=1.0, allow=True, replay=False).statement
    [words] = [each for each in statement.warnings if "the material relaxes" in each]
    assert format_hertz(frequency) in words
    assert "K′ = " in words


@pytest.mark.long
@pytest.mark.parametrize("relaxing, large", [(8000.0, True), (500.0, False)])
def test_a_relaxing_law_is_refused_if_its_export_is_far_off(relaxing, large, toy, tmp_path):
    """Whether the engine has the exported law exactly makes no difference."""
    toy(factor=1.0)
    result = relaxing_result(strokes(), (0.4,), (relaxing,))
    assert result.law.remembers
    statement = exports.export(result, "toy", mass=1.0, allow=True).statement
    source = statement.source
    apart = apart_percent_of_force(source, statement.nearest.law)
    found = statement.as_dict()["error_percent"]
    assert found["against_law"] == pytest.approx(apart, rel=1e-9)
    measured = source.motion.force
    leaves = force_error(source.answer, measured, source.motion.judged)
    assert found["law_leaves"] == pytest.approx(leaves, rel=1e-9)
    assert found["against_measured"] > found["law_leaves"]
    assert (apart > 5.0) == large
    shares = [each for each in statement.refusals if "no engine has its memory" in each]
    assert len(shares) == large
    assert all("of the recorded force" in each and "palpate lab" in each for each in shares)
    assert "the identified law with its memory" in statement.claim
    result.save(tmp_path)
    saved = ExportedLaw.of(palpate.load_result(tmp_path))
    np.testing.assert_allclose(saved.answer, statement.source.answer, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("law", [TISSUE.law, SPECTRUM])
def test_a_law_with_memory_is_exported_as_its_nearest_plain_law(law):
    motion = ProbeMotion.of_paper()
    found = nearest_without_memory(law, motion)
    others = (law.relaxed(), law.instantaneous())
    assert found.error_percent < min(apart_percent(motion, each, law) for each in others)
    assert not found.law.remembers
    statement = exports.export(law, "physx", allow=True).statement
    stated = statement.as_dict()["error_percent"]["nearest"]
    assert stated == pytest.approx(found.error_percent)
    assert any("no stress relaxation" in warning for warning in statement.warnings)
    assert not statement.exact
    saved = json.loads(json.dumps(statement.as_dict()))
    assert law_from(saved["law"]) == law
    assert law_from({k: v for k, v in saved["exported_law"].items() if k != "which"}) == (
        found.law.simplest()
    )
    assert "τ = " in statement.law_lines()[0]


def test_two_powers_of_depth_are_exported_as_one_with_its_error(toy):
    made = exports.export(ExtendedKelvinVoigt(K1=500.0, K2=2e4, B=3.0), "toy")
    assert 1.0 < made.statement.nearest.law.n < 2.0
    assert 0.1 < made.statement.compared.percent < 1.0
    softening = exports.export(ExtendedKelvinVoigt(K1=2000.0, K2=-1e4, B=3.0), "toy")
    assert softening.statement.nearest.law.n < 1.0
    alone = exports.export(ExtendedKelvinVoigt(K1=0.0, K2=2e4, B=3.0), "toy").statement.nearest
    assert (alone.law.n, alone.error_percent) == (2.0, 0.0)


def test_a_claim_states_the_engine_error_and_its_source(toy, ball):
    toy(factor=1.0112)
    made = exports.export(ball, "toy", mass=1.0)
    found = made.statement.as_dict()["error_percent"]
    assert found["against_law"] == pytest.approx(1.12)
    assert found["predicted"] < 1e-12
    assert found["law_leaves"] == pytest.approx(ball.fit_rmse_percent, rel=1e-3)
    assert found["against_measured"] > 1.12
    assert "within 1.2 % of the law's force (replayed)" in made.statement.claim
    assert any("but the predicted one" in warning for warning in made.statement.warnings)
    assert made.statement.claim in made.files["fragment.txt"]
    toy(runs=False)
    assert "(predicted, not replayed)" in exports.export(ball, "toy").statement.claim
    # A law alone is judged on the paper's motion.
    alone = exports.export(BALL.law, "toy").statement
    assert "on the paper's motion" in alone.claim
    assert any("a law without a recording" in warning for warning in alone.warnings)
    found = alone.as_dict()
    assert found["verdict"] is found["error_percent"]["against_measured"] is None


def test_an_engine_that_fails_to_load_is_reported(toy, monkeypatch):
    def broken(self, motion):
        raise ImportError("numpy.core is gone") from causes.pop()

    monkeypatch.setattr(Scaled, "replay", broken)
    causes = [KeyboardInterrupt(), None]
    made = exports.export(BALL.law, "toy")
    assert "it does not load: numpy.core is gone" in str(made)
    assert not made.statement.compared.replayed
    with pytest.raises(KeyboardInterrupt):
        exports.export(BALL.law, "toy")


def test_an_exact_engine_is_called_exact_and_one_that_is_off_is_not(toy):
    for factor, exact in ((1.0, True), (1.0 + 1e-7, True), (1.001, False)):
        toy(exact=True, factor=factor)
        assert exports.export(BALL.law, "toy").statement.exact is exact


def test_an_export_more_than_5_percent_off_is_refused(toy):
    for factor in (1.06, math.nan):
        toy(factor=factor)
        with pytest.raises(ExportRefusedError, match="more than 5 %") as refused:
            exports.export(BALL.law, "toy")
        assert refused.value.statement.refused
        made = exports.export(BALL.law, "toy", allow=True)
        assert "although the force error of the engine is" in made.files["fragment.txt"]


def test_an_impact_that_gains_energy_or_is_far_off_is_refused(toy):
    for rebound, words in ((1.02, "impacts gain energy"), (0.3, "more than 50 % off")):
        toy(rebound=rebound)
        with pytest.raises(ExportRefusedError, match=words):
            exports.export(BALL.law, "toy")
    toy(rebound=0.5)  # of 0.67
    assert any(
        "impacts will be wrong" in w for w in exports.export(BALL.law, "toy").statement.warnings
    )


def test_the_answer_has_rest_rebound_and_twice_the_speed_of_the_engine(toy, ball):
    toy(factor=1.04)
    statement = exports.export(ball, "toy", mass=1.0).statement
    whole = statement.as_dict()
    assert whole["rest"]["load"] == pytest.approx(9.80665)
    law = ball.law
    depth = (9.80665 / law.K) ** (1.0 / law.n)
    assert whole["rest"]["depth_of_law"] == pytest.approx(depth, rel=1e-6)
    # The body rests where 1.04 of the law carries it.
    assert whole["rest"]["depth"] == pytest.approx(depth * 1.04 ** (-1.0 / law.n), rel=1e-3)
    assert whole["error_percent"]["at_twice_the_speed"] == pytest.approx(4.0, rel=1e-3)
    labels = [label for label, _ in statement.short_answer()[1:]]
    assert labels == ["force", "motion", "rest", "rebound", "warning"]
    # The warning that is shown is that of the largest effect.
    toy(rebound=0.5, factor=1.0)
    assert "impacts will be wrong" in exports.export(ball, "toy", mass=1.0).statement.main_warning


@pytest.mark.parametrize("K, mass, deepest", [(2000.0, 1.0, 14.0e-3), (1e9, 1.0, 1.0e-5)])
def test_a_law_alone_is_judged_at_depths_that_a_body_reaches(K, mass, deepest):
    motion = ExportedLaw.of(HuntCrossley(K=K, B=K, n=1.5 if K > 1e6 else 1.0), mass).motion
    assert motion.deepest == pytest.approx(deepest, rel=0.1)
    assert ("scaled" in motion.source) == (K > 1e6)


def test_an_untrusted_result_is_refused_and_one_with_care_warns(toy, saved):
    result = palpate.load_result(saved)
    finding = Finding("delay", "the force is late", "--delay find", severity="do-not-trust")
    for overall in ("do-not-trust", "with-care"):
        verdict = Verdict(overall, overall, overall)
        judged = replace(result, verdict=verdict, findings=(finding,))
        if overall == "do-not-trust":
            with pytest.raises(ExportRefusedError, match="do-not-trust: the force is late"):
                exports.export(judged, "toy")
        else:
            [words] = [w for w in exports.export(judged, "toy").statement.warnings if "care" in w]
            assert "the force is late (--delay find)" in words


def test_a_negative_damping_is_refused_or_exported_as_zero(toy):
    with pytest.raises(ExportRefusedError, match="generates energy"):
        exports.export(HuntCrossley(K=2000.0, B=-5.0, n=1.0), "toy")
    made = exports.export(HuntCrossley(K=2000.0, B=-5.0, n=1.0), "toy", allow=True)
    assert made.statement.nearest.law.B == 0.0
    with pytest.raises(ExportRefusedError, match="not above 0; run palpate diagnose"):
        exports.export(HuntCrossley(K=-2000.0, B=5.0, n=1.0), "toy", allow=True)


def test_an_unstable_time_step_is_refused(toy):
    toy(largest_step=1.5e-3)
    assert any("stability limit" in w for w in exports.export(BALL.law, "toy").statement.warnings)
    with pytest.raises(ExportRefusedError, match=r"below 1\.5 ms"):
        exports.export(BALL.law, "toy", time_step=2e-3)
    # It is that of a semi-implicit penalty.
    law = GeneralisedHuntCrossley(K=2000.0, n=1.0, B=20.0, p=0.0)
    limit = stable_step(law, 1.0, 1e-2)
    for step, stable in ((0.999 * limit, True), (1.001 * limit, False)):
        x, v = 1e-3, 0.0
        for _ in range(20_000):
            v -= step * (law.K * x + law.B * v)
            x += step * v
        assert (abs(x) < 1.0) is stable


@pytest.mark.parametrize(
    "typed, engine",
    [
        ("MJX", "mjx"),
        ("mujoco_mjx", "mjx"),
        ("warp", "mujoco-warp"),
        ("usd", "newton"),
        ("isaac", "isaaclab"),
        ("Isaac Lab", "isaaclab"),
        ("isaacsim", "physx"),
        ("genesis", "export to mjx"),
        ("pybullet", "contactDamping = B - K dt"),
        ("gazebo-classic", "<kp> and <kd>"),
        ("gz-sim", "export to mujoco or drake"),
        ("unity", "must be one of mujoco, mjx"),
    ],
)
def test_the_names_that_people_type_are_answered(typed, engine):
    if engine in exports.engines():
        assert exports.engine_called(typed).name == engine
    else:
        with pytest.raises(palpate.PalpateError, match=re.escape(engine)):
            exports.engine_called(typed)


def test_the_configuration_of_isaac_lab_is_python_and_in_the_statement():
    law = KelvinVoigt(K=2000.0, B=16.6)
    made = exports.export(law, "isaaclab", mass=2.0, replay=False)
    text = made.files["isaaclab_material.py"]
    pasted = dict(made.statement.short_answer())["paste"]
    compile(text, "isaaclab_material.py", "exec")
    for line in (
        "NewtonMaterialCfg(contact_stiffness=2000, contact_damping=16.6)",
        # Of 2 kg: the numbers of SolverMuJoCo are divided by the mass.
        "MujocoCollisionCfg(condim=1, solref=(-999.9, -8.29917), solimp=(0.0001, 0.0001, ",
    ):
        assert line in text
        assert line in pasted
    assert "not in Isaac Lab" in pasted


@pytest.mark.parametrize("to", ["newton", "physx", "drake"])
def test_friction_is_in_the_first_line_and_in_the_files(to):
    law = KelvinVoigt(K=2000.0, B=16.6)
    for friction, words in ((0.0, "frictionless"), (0.35, "friction 0.35")):
        made = exports.export(law, to, mass=1.0, replay=False, friction=friction)
        assert f", {words}: " in str(made).splitlines()[0]
        assert ("0.35" in made.files[next(iter(made.files))].split(words)[-1]) == (friction > 0.0)
    with pytest.raises(InvalidParameterError, match="friction"):
        exports.export(law, to, mass=1.0, friction=-0.1)


def test_friction_in_newton_needs_a_damper():
    with pytest.raises(InvalidParameterError, match="only with damping"):
        exports.export(KelvinVoigt(K=2000.0, B=0.0), "newton", friction=0.5, replay=False)


def test_an_export_without_its_engine_is_marked(ball, tmp_path):
    made = exports.export(ball, "physx", mass=1.0)
    assert not made.statement.compared.replayed
    for name, text in made.files.items():
        assert "not replayed" in text, name
        assert "impacts will be wrong" in text, name
    paths = made.save(tmp_path)
    assert {path.name for path in paths} == {*made.files, "statement.json", "statement.md"}
    whole = json.loads((tmp_path / "statement.json").read_text())
    assert whole["files"] == list(made.files)
    assert whole["law"]["K"] == ball.law.K


def test_the_time_step_counts_in_implicit_engines_only():
    stiff, sap = KelvinVoigt(K=2e4, B=20.0), {"form": "sap", "replay": False}
    rebounds = [
        exports.export(stiff, "drake", time_step=step, **sap).statement.compared.drop_restitution
        for step in (1e-5, 1e-3, 3e-3)
    ]
    exact = exports.export(stiff, "physx").statement.compared.drop.restitution
    assert rebounds[0] == pytest.approx(exact, rel=1e-2)
    assert rebounds[0] > rebounds[1] > rebounds[2]
    coarse = {"time_step": 0.02, "allow": True, "replay": False}
    said = exports.export(stiff, "newton", **coarse).statement.warnings
    assert any("metersPerUnit" in each for each in said)
    assert any("an explicit solver" in words for words in said)


@pytest.mark.parametrize(
    "engine, given, words",
    [
        ("toy", {"geom": "tip"}, "Toy does not use geom"),
        ("toy", {"tip_radius": 5e-3}, "Toy does not use tip_radius"),
        ("toy", {"form": "pair"}, "form must be one of auto, only for toy"),
        ("toy", {"mass": -1.0}, "mass must be in"),
        ("toy", {"time_step": math.nan}, "time_step must be finite"),
        ("mujoco", {}, "add --mass, such as"),
        ("mujoco", {"mass": 1.0, "model": "robot.xml"}, "pass either mass or model"),
        ("mujoco", {"geom": "tip"}, "add --model FILE"),
        ("unity", {}, "to must be one of mujoco"),
        ("gazebo", {}, "ignores the <kp> and <kd>"),  # with DART
    ],
)
def test_what_an_engine_cannot_use_is_refused(toy, engine, given, words):
    error = ExportRefusedError if engine == "gazebo" else InvalidParameterError
    with pytest.raises(error, match=words):
        exports.export(BALL.law, engine, **given)
    with pytest.raises(InvalidParameterError, match="result must be an Identification"):
        exports.export("ball.csv", "toy")


@pytest.mark.parametrize("name", ["scene.usda", "statement.md", "statement.json"])
def test_an_export_replaces_only_what_an_export_wrote(ball, saved, name, tmp_path):
    first = exports.export(ball, "physx", mass=1.0)
    second = exports.export(ball, "drake", allow=True, replay=False)
    with pytest.raises(RecordingError, match="this is an input file"):
        first.save(saved, inputs=[saved / "material.usda"])
    (tmp_path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(RecordingError, match=rf"{name}: palpate did not write this file.*\(-o\)"):
        first.save(tmp_path)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, "mine")]
    (tmp_path / name).unlink()
    # Its own it replaces, those of another engine between them too, until somebody changes one.
    for made in (first, second, exports.export(ball, "physx", mass=2.0)):
        made.save(tmp_path)
    assert "float physics:mass = 2" in (tmp_path / "scene.usda").read_text()
    with (tmp_path / "scene.usda").open("a") as file:
        file.write("# my own light\n")
    with pytest.raises(RecordingError, match="or it was changed since"):
        first.save(tmp_path)
    # One that was interrupted has written no statement, and is repeated.
    *_, statement = first.save(tmp_path / "new")
    statement.unlink()
    assert first.save(tmp_path / "new")[-1] == statement


def test_the_command_prints_the_claim_and_writes_the_files(run, printed, saved, tmp_path):
    folder = tmp_path / "new" / "ball"
    out = printed("export", saved, "--to", "physx", "--mass", "1", "-o", folder)
    words = " ".join(out.split())
    assert "within 0.53 % of the law's force (predicted, not replayed)" in words
    assert "(the law itself: 0.41 %)" in words
    assert f"{folder}: material.usda, scene.usda, statement.md, statement.json" in out
    assert len(out.splitlines()) <= 12
    first = (folder / "statement.json").read_bytes()
    assert (
        run("export", saved / "result.json", "--to", "physx", "--mass", "1", "-o", folder)[0] == 0
    )
    assert (folder / "statement.json").read_bytes() == first
    whole = json.loads(run("export", saved, "--to", "physx", "--mass", "1", "--json")[1])
    assert whole["claim"] == json.loads(first)["claim"]


def test_a_refused_export_ends_with_status_3(run, saved, tmp_path, toy):
    toy(factor=1.1)
    status, out, _ = run("export", saved, "--to", "toy", "-o", tmp_path)
    assert status == 3
    assert "refused  the force error" in out
    assert "--allow" in out
    assert {path.name for path in tmp_path.iterdir()} == {"statement.json", "statement.md"}
    assert json.loads((tmp_path / "statement.json").read_text())["files"] == []
    assert run("export", saved, "--to", "toy", "--allow", "-o", tmp_path)[0] == 0
    # What it then refuses again leaves the earlier fragment there, and says whose that is.
    for _ in range(2):
        assert run("export", saved, "--to", "toy", "-o", tmp_path)[0] == 3
        assert "earlier export, not of this one: fragment.txt" in (
            (tmp_path / "statement.md").read_text()
        )


@pytest.mark.parametrize(
    "name, value",
    [("surface", None), ("flags", 3), ("elastic_modulus", {"tip": {"kind": "sphere"}})],
)
def test_an_export_reports_a_damaged_result_in_one_line(saved, name, value):
    result = palpate.load_result(saved)
    result.description["results"][0][name] = value
    with pytest.raises(RecordingError, match="the result is damaged"):
        exports.export(result, "physx")


def test_a_comment_is_one_whatever_the_recording_is_called():
    notes = ["of a---b-.csv", "of c\x1b\x00d.csv"]
    assert ElementTree.fromstring(f"<a>{xml_comment(notes)}</a>").tag == "a"
    assert hash_comment(notes) == "# of a---b-.csv\n# of c  d.csv"


def test_a_folder_without_a_result_is_refused_in_one_line(run, refused, saved, tmp_path):
    broken, printed = tmp_path / "result.json", tmp_path / "printed.json"
    broken.write_bytes((saved / "result.json").read_bytes()[:1000])
    printed.write_text(json.dumps({"schema_version": SCHEMA_VERSION, "results": []}))
    recording = EXAMPLES / "ball.csv"
    for file, words in (
        (broken, "cut off"),
        (tmp_path / "none", "palpate identify FILE -o FOLDER"),
        (recording, f"a recording, not a result; run palpate identify {recording} -o FOLDER"),
        (printed, "printed by --json"),
    ):
        assert words in refused("export", file, "--to", "physx")
    assert run("export", saved, "--to", "gazebo")[0] == 3


def test_a_surface_without_an_error_bar_is_saved_too(ball, monkeypatch):
    # Else the saved law would be pressed from another surface than the one that was found.
    for name, value in (("surface", 1e-3), ("surface_standard_error", math.nan)):
        monkeypatch.setattr(type(ball.estimate), name, value)
    assert result_dict(ball)["surface"] == 1e-3


NAMESPACE = "{http://drake.mit.edu}"


@pytest.mark.parametrize(
    "law, form, most_percent",
    [
        (BALL_LAW, "point", 1e-10),
        (SPONGE_LAW, "point", 1e-10),
        (KELVIN_VOIGT_LAW, "sap", 1e-10),
        (HERTZ_LAW, "nested-spheres", 0.25),
        (PVC_LAW, "nested-spheres", 0.25),
        # Its damper is not Hunt and Crossley's, and small.
        (HALF_SPACE_LAW, "nested-spheres", 1.0),
        # An identified exponent is never exactly 1.
        (GeneralisedHuntCrossley(K=2000.0, n=1.003, B=2000.0, p=1.003), "point", 0.1),
        (GeneralisedHuntCrossley(K=2000.0, n=0.98, B=2000.0, p=0.98), "point", 0.5),
        # A damper that hardly grows is nearer to SAP's.
        (GeneralisedHuntCrossley(K=2000.0, n=1.01, B=30.0, p=0.01), "sap", 0.5),
    ],
)
def test_the_form_is_that_of_the_law(law, form, most_percent) -> None:
    fragment = fitted("drake", law)
    assert fragment.form == form
    assert fragment.exact == (most_percent == 1e-10)
    assert predicted_percent(fragment) < most_percent


@pytest.mark.parametrize("exponent", [1.1, 1.3, 1.5, 2.0, 2.5])
def test_spheres_in_one_another_are_a_power_law_of_the_same_dissipation(exponent) -> None:
    spheres = fitted("drake", GeneralisedHuntCrossley(K=3e4, n=exponent, B=6e4, p=exponent)).contact
    assert spheres.gaps[0] == 0.0
    assert (np.diff(spheres.gaps) > 0.0).all()
    assert (spheres.stiffness > 0.0).all()
    assert spheres.dissipation == pytest.approx(2.0)
    # So few are enough.
    assert len(spheres.gaps) <= 8


def test_each_sphere_has_its_own_dissipation() -> None:
    fragment = fitted("drake", GeneralisedHuntCrossley(K=1e5, n=2.0, B=3000.0, p=1.0))
    assert predicted_percent(fragment) < 0.5
    assert np.ptp(fragment.contact.dissipation) > 0.0


@pytest.mark.parametrize(
    "law, further, words",
    [
        (KELVIN_VOIGT_LAW, {"form": "sap", "time_step": 0.0}, "time_step must be above 0"),
        (GeneralisedHuntCrossley(K=-5.0, n=1.0, B=1.0, p=1.0), {}, "stiffness"),
    ],
)
def test_impossible_contacts_are_refused(law, further, words) -> None:
    with pytest.raises(InvalidParameterError, match=words):
        fitted("drake", law, **further)


def _properties(text: str, kind: str) -> list[dict[str, str]]:
    """The surface's and each sphere's, by their names."""
    found = []
    for each in ElementTree.fromstring(text).iter(f"{NAMESPACE}proximity_properties"):
        names = [line.tag.removeprefix(NAMESPACE) for line in each]
        values = [line.text if kind == "sdf" else line.get("value") for line in each]
        found.append(dict(zip(names, values, strict=True)))
    return found


@pytest.mark.parametrize(
    "law, further",
    [
        (BALL_LAW, {}),
        (HERTZ_LAW, {}),
        (KELVIN_VOIGT_LAW, {}),
    ],
)
def test_both_files_for_drake_describe_the_same_bodies(law, further) -> None:
    files = fitted("drake", law, **further).files(["a note -- of two hyphens"])
    sdf, urdf = _properties(files["contact.sdf"], "sdf"), _properties(files["contact.urdf"], "urdf")
    assert sdf == urdf
    assert len(sdf) >= 2
    assert all(len(each) >= 2 for each in sdf)
    for text in files.values():
        assert "a note - - of two" in text or "a note -- of two" in text
        assert "discrete_contact_approximation=" in text
    compile(files["scene.py"], "scene.py", "exec")


def test_sap_has_the_relaxation_time_of_one_body_only() -> None:
    files = fitted("drake", KELVIN_VOIGT_LAW).files([])
    surface, tip = _properties(files["contact.sdf"], "sdf")
    assert float(surface["relaxation_time"]) == 16.6 / 2000.0
    assert float(tip["relaxation_time"]) == 0.0
    assert "hunt_crossley_dissipation" not in surface
    assert 'discrete_contact_approximation="sap"' in files["contact.sdf"]


def test_a_tip_smaller_than_the_depth_raises_its_inner_spheres() -> None:
    fragment = fitted("drake", PVC_LAW, tip_radius=0.003)
    gaps = fragment.contact.gaps
    lowest = [tip.lift - tip.radius for tip in fragment.parts.tips]
    assert lowest == pytest.approx(gaps - 0.003)
    assert any("raised" in words for words in map(str, fragment.findings))
    large = fitted("drake", PVC_LAW, tip_radius=0.05)
    assert [tip.lift for tip in large.parts.tips] == pytest.approx(np.zeros(len(gaps)), abs=1e-15)
    assert not any("raised" in words for words in map(str, large.findings))


def test_a_step_damps_a_spring_as_backward_euler_does() -> None:
    mass, stiffness, step = 1.0, 2000.0, 1e-3
    drop = Drop(mass, 0.5, 0.5 * (mass / stiffness) ** 0.5, 1.0)
    found = restitution_by_steps(lambda x, _v: stiffness * max(x, 0.0), drop, step)
    # Every step loses (1 + ω²h²)^½ of the amplitude, over the half period π/ω.
    omega = (stiffness / mass) ** 0.5
    expected = (1.0 + (omega * step) ** 2) ** (-0.5 * math.pi / (omega * step))
    assert found == pytest.approx(expected, abs=0.01)
    # Steps so fine that they do not matter are not taken.
    drop = drop_to(BALL_LAW, 1.0, 0.012)
    assert restitution_by_steps(BALL_LAW.force, drop, 1e-9) == pytest.approx(
        drop.restitution, abs=1e-4
    )


def test_a_time_step_that_damps_more_than_the_law_is_warned_of() -> None:
    coarse = fitted("drake", BALL_LAW, time_step=1e-3)
    assert any("adds a damping of 2 N·s/m" in words for words in map(str, coarse.findings))
    assert not fitted("drake", BALL_LAW, time_step=1e-4).findings
    assert fitted("drake", KELVIN_VOIGT_LAW, time_step=0.0).form == "point"


RADIUS = 0.0225


def test_a_hertzian_law_is_simbodys_of_the_numbers_written() -> None:
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    assert fragment.exact
    numbers = fragment.numbers
    law = engines.simbody(
        modulus=numbers["stiffness"], radius=RADIUS, dissipation=numbers["dissipation"]
    )
    assert law.parameters == pytest.approx(HERTZ_LAW.parameters, rel=1e-12)


@pytest.mark.parametrize("law", [BALL_LAW, PVC_LAW, HALF_SPACE_LAW])
def test_another_exponent_keeps_the_restitution_and_says_its_error(law) -> None:
    fragment = fitted("opensim", law, tip_radius=RADIUS)
    assert not fragment.exact
    if law is HALF_SPACE_LAW:  # a damper of another power is the nearest of this one
        assert predicted_percent(fragment) < 1.0
        return
    # More than is exported without being allowed.
    assert 5.0 < predicted_percent(fragment) < 10.0
    drop = drop_to(law, 1.0, 0.012)
    assert fragment.predict_restitution(drop) == pytest.approx(drop.restitution, rel=1e-6)


def test_the_modulus_holds_for_the_given_radius_only() -> None:
    with pytest.raises(InvalidParameterError, match="--tip-radius"):
        fitted("opensim", HERTZ_LAW)
    with pytest.raises(InvalidParameterError, match="stiffness"):
        fitted("opensim", GeneralisedHuntCrossley(K=-1.0, n=1.5, B=0.0, p=1.5), tip_radius=RADIUS)
    small, large = (fitted("opensim", HERTZ_LAW, tip_radius=each) for each in (0.01, 0.04))
    assert small.numbers["stiffness"] == pytest.approx(2.0 * large.numbers["stiffness"])
    assert any("10 mm only" in words for words in map(str, small.findings))
    assert any("deeper than its radius" in words for words in map(str, small.findings))
    assert len(large.findings) == 1


def test_each_geometry_has_its_own_parameters() -> None:
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    text = fragment.files(["a note"])["contact.osim"]
    assert "a note" in text
    written = dict(re.findall(r"<geometry>(\w+)</geometry>\s*<stiffness>(.+)</stiffness>", text))
    assert float(written["surface"]) == fragment.numbers["stiffness"]
    assert float(written["sphere"]) > 1e12 * fragment.numbers["stiffness"]
    compile(fragment.files([])["scene.py"], "scene.py", "exec")
