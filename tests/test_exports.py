"""What every export has in common: the motion, the nearest law, the claim, and what is refused."""

import json
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from export_cases import BALL_LAW, HERTZ_LAW, PVC_LAW, SPONGE_LAW, apart_percent

import palpate
from palpate import ExtendedKelvinVoigt, GeneralisedHuntCrossley, HuntCrossley, KelvinVoigt, exports
from palpate.diagnosis import Verdict
from palpate.errors import ExportRefusedError, InvalidParameterError, RecordingError
from palpate.exports import Engine, Fragment, Motion, Replayed
from palpate.exports.engine import (
    drop_to,
    force_error,
    hash_comment,
    kelvin_voigt,
    rebound_by,
    stable_step,
    without_memory,
    xml_comment,
)
from palpate.findings import Finding
from palpate.lab import BALL, PVC, TISSUE
from palpate.results.saved import of_one

EXAMPLES = Path(__file__).parents[1] / "examples" / "recordings"


@pytest.fixture(scope="module")
def ball():
    return palpate.identify(EXAMPLES / "ball.csv")


@pytest.fixture(scope="module")
def saved(ball, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "ball"
    # The page and its drawings take seconds, and an export reads neither.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("palpate.reports.identification.drawing", lambda *_: iter(()))
        ball.save(folder)
    return folder


@dataclass(frozen=True, eq=False, kw_only=True)
class Scaled(Fragment):
    """An engine's contact that is too strong by a factor."""

    factor: float = 1.0
    runs: bool = True

    def files(self, notes):
        return {"fragment.txt": "\n".join(notes)}

    def predicted(self, motion):
        return motion.force_by(self.asked.law)

    def predicted_rebound(self, drop):
        return drop.restitution

    def replay(self, motion):
        force = self.factor * motion.force_by(self.asked.law)
        return Replayed(force, "state by state") if self.runs else None


class Toy(Engine):
    name: ClassVar[str] = "toy"
    title: ClassVar[str] = "Toy"
    distribution: ClassVar[str] = "toy"
    forms: ClassVar[dict] = {"only": "the only way"}
    settings: ClassVar[dict] = {}

    def fit(self, asked):
        return Scaled(form="only", asked=asked, numbers={"k": 1.0}, **self.settings)

    def version(self):
        return "1.0"


@pytest.fixture
def toy(monkeypatch):
    """Set what the engine called toy is like."""

    def become(**settings):
        monkeypatch.setattr(Toy, "settings", settings)

    def called(name):
        return Toy() if name == "toy" else exports.engine_called(name)

    monkeypatch.setattr("palpate.exports.exporting.engine_called", called)
    become()
    return become


def test_the_recorded_motion_is_below_the_surface_that_was_estimated_and_without_the_offset(
    ball, saved
):
    motion = Motion.recorded(ball)
    assert np.array_equal(motion.force, ball.contact.force - ball.estimate.offset)
    assert np.count_nonzero(motion.judged) == np.count_nonzero(ball.trace.taken)
    assert (motion.penetration[motion.judged] > 0.0).all()
    error = force_error(motion.force_by(ball.law), motion.force, motion.judged)
    assert error == pytest.approx(ball.fit_rmse_percent, rel=1e-3)
    firm = motion.firm()
    assert firm.judged.all()
    assert firm.deepest == motion.deepest
    there = Motion.recorded(palpate.load_result(saved))
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
    motion = Motion.recorded(
        SimpleNamespace(contact=contact, trace=trace, description={"results": [{}]})
    )
    assert motion.starts == (0, 100)
    assert not motion.acceleration.any()


@pytest.mark.parametrize("law", [BALL_LAW, SPONGE_LAW, HERTZ_LAW, PVC_LAW], ids=repr)
def test_a_drop_by_the_exact_relation_is_the_one_by_integration(law):
    drop = drop_to(law, 1.0, 12e-3)
    assert drop.restitution == palpate.restitution(law.damping / law.stiffness, drop.speed)
    # RK4 at a thousandth of half a period: seen 6e-7.
    assert rebound_by(law, drop) == pytest.approx(drop.restitution, rel=2e-6)
    # Without damping the body has the energy of the spring.
    drop = drop_to(replace(law, damping=0.0), 0.5, 10e-3)
    energy = law.stiffness * 10e-3 ** (law.exponent + 1.0) / (law.exponent + 1.0)
    assert 0.5 * 0.5 * drop.speed**2 == pytest.approx(energy, rel=1e-6)
    assert drop.restitution == 1.0


def test_the_nearest_kelvin_voigt_law_is_the_least_squares_and_the_law_itself_where_it_is_one():
    motion, linear = Motion.of_paper(), KelvinVoigt(2000.0, 15.0)
    assert kelvin_voigt(GeneralisedHuntCrossley.of(linear), motion).simplest() == linear
    found = kelvin_voigt(PVC.law, motion)
    least = apart_percent(motion, found, PVC.law)
    # Measured on this motion; what MuJoCo's linear contact was seen to leave.
    assert 17.0 < least < 18.0
    for change in ({"stiffness": 1.01 * found.stiffness}, {"damping": 1.1 * found.damping}):
        assert apart_percent(motion, replace(found, **change), PVC.law) > least


def test_the_nearest_law_never_makes_energy():
    memory = palpate.SingleRelaxation(0.1)
    remembering = GeneralisedHuntCrossley(8000.0, 1.5, -200.0, 1.5, 8000.0, memory)
    assert without_memory(remembering, Motion.of_paper()).law.damping >= 0.0


def test_of_a_law_that_remembers_the_nearest_member_is_exported_with_its_error():
    motion, law = Motion.of_paper(), TISSUE.law
    found = without_memory(law, motion)
    others = (law.relaxed(), law.instantaneous())
    assert found.error_percent < min(apart_percent(motion, each, law) for each in others)
    assert not found.law.remembers
    statement = exports.export(law, "usd", allow=True).statement
    stated = statement.as_dict()["error_percent"]["nearest"]
    assert stated == pytest.approx(found.error_percent)
    assert any("remembers" in warning for warning in statement.warnings)
    assert not statement.exact


def test_a_law_of_two_powers_of_depth_is_exported_as_one_power_with_its_error(toy):
    made = exports.export(ExtendedKelvinVoigt(500.0, 2e4, 3.0), "toy")
    assert 1.0 < made.statement.nearest.law.exponent < 2.0
    assert 0.1 < made.statement.compared.percent < 1.0
    softening = exports.export(ExtendedKelvinVoigt(2000.0, -1e4, 3.0), "toy")
    assert softening.statement.nearest.law.exponent < 1.0
    alone = exports.export(ExtendedKelvinVoigt(0.0, 2e4, 3.0), "toy").statement.nearest
    assert (alone.law.exponent, alone.error_percent) == (2.0, 0.0)


def test_a_claim_says_how_far_off_the_engine_was_and_how_that_is_known(toy, ball):
    toy(factor=1.0112)
    made = exports.export(ball, "toy", mass=1.0)
    found = made.statement.as_dict()["error_percent"]
    assert found["against_law"] == pytest.approx(1.12)
    assert found["predicted"] < 1e-12
    assert found["law_leaves"] == pytest.approx(ball.fit_rmse_percent, rel=1e-3)
    assert found["against_measured"] > 1.12
    assert "within 1.2 % of the law's force (replayed)" in made.statement.claim
    assert any("and predicted was" in warning for warning in made.statement.warnings)
    assert made.statement.claim in made.files["fragment.txt"]
    toy(runs=False)
    assert "predicted, not replayed here" in exports.export(ball, "toy").statement.claim
    # A law alone is judged on the paper's motion.
    alone = exports.export(BALL.law, "toy").statement
    assert "on the paper's motion" in alone.claim
    assert any("a law alone" in warning for warning in alone.warnings)
    found = alone.as_dict()
    assert found["verdict"] is found["error_percent"]["against_measured"] is None


def test_an_engine_that_does_not_load_is_said_unless_somebody_ends_it(toy, monkeypatch):
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


def test_more_than_five_percent_is_refused_and_what_is_allowed_says_so_in_the_fragment(toy):
    for factor in (1.06, math.nan):
        toy(factor=factor)
        with pytest.raises(ExportRefusedError, match="more than 5 %") as refused:
            exports.export(BALL.law, "toy")
        assert refused.value.statement.refused
        made = exports.export(BALL.law, "toy", allow=True)
        assert "allowed although the force of the engine is off" in made.files["fragment.txt"]


def test_a_result_that_is_not_to_be_trusted_is_refused_and_one_with_care_warns(toy, saved):
    result = palpate.load_result(saved)
    finding = Finding("delay", "the force is late", "--delay find", severity="do-not-trust")
    for overall in ("do-not-trust", "with-care"):
        verdict = Verdict(overall, overall, overall)
        judged = replace(result, verdict=verdict, findings=(finding,))
        if overall == "do-not-trust":
            with pytest.raises(ExportRefusedError, match="do not trust: the force is late"):
                exports.export(judged, "toy")
        else:
            [words] = [w for w in exports.export(judged, "toy").statement.warnings if "care" in w]
            assert "the force is late (--delay find)" in words


def test_a_damping_that_gives_energy_is_refused_and_exported_as_none(toy):
    with pytest.raises(ExportRefusedError, match="makes energy"):
        exports.export(HuntCrossley(2000.0, -5.0, 1.0), "toy")
    made = exports.export(HuntCrossley(2000.0, -5.0, 1.0), "toy", allow=True)
    assert made.statement.nearest.law.damping == 0.0
    with pytest.raises(ExportRefusedError, match="nothing pushes back"):
        exports.export(HuntCrossley(-2000.0, 5.0, 1.0), "toy", allow=True)


def test_an_unstable_time_step_is_refused_and_one_near_it_warned_of(toy):
    toy(largest_step=1.5e-3)
    assert any("unstable" in w for w in exports.export(BALL.law, "toy").statement.warnings)
    with pytest.raises(ExportRefusedError, match=r"below 1\.5 ms"):
        exports.export(BALL.law, "toy", time_step=2e-3)
    # It is that of a semi-implicit penalty.
    law = GeneralisedHuntCrossley(2000.0, 1.0, 20.0, 0.0)
    limit = stable_step(law, 1.0, 1e-2)
    for step, stable in ((0.999 * limit, True), (1.001 * limit, False)):
        x, v = 1e-3, 0.0
        for _ in range(20_000):
            v -= step * (law.stiffness * x + law.damping * v)
            x += step * v
        assert (abs(x) < 1.0) is stable


def test_what_has_no_engine_here_is_marked_and_its_impacts_are_warned_of(ball, tmp_path):
    made = exports.export(ball, "usd", mass=1.0)
    assert not made.statement.compared.replayed
    for name, text in made.files.items():
        assert "not replayed here" in text, name
        assert "impacts will be wrong" in text, name
    paths = made.save(tmp_path)
    assert {path.name for path in paths} == {*made.files, "statement.json", "statement.md"}
    whole = json.loads((tmp_path / "statement.json").read_text())
    assert whole["files"] == list(made.files)
    assert whole["law"]["stiffness"] == ball.law.stiffness


def test_a_time_step_is_counted_where_the_engine_takes_it_implicitly_and_said_where_explicitly():
    stiff, sap = KelvinVoigt(2e4, 20.0), {"form": "sap", "replay": False}
    rebounds = [
        exports.export(stiff, "drake", time_step=step, **sap).statement.compared.rebound
        for step in (1e-5, 1e-3, 3e-3)
    ]
    exact = exports.export(stiff, "usd").statement.compared.drop.restitution
    assert rebounds[0] == pytest.approx(exact, rel=1e-2)
    assert rebounds[0] > rebounds[1] > rebounds[2]
    said = exports.export(stiff, "usd", time_step=0.02).statement.warnings
    assert any("metersPerUnit" in each for each in said)
    assert any("an explicit solver" in words for words in said)


@pytest.mark.parametrize(
    "engine, given, words",
    [
        ("toy", {"geom": "tip"}, "geom means nothing to Toy"),
        ("toy", {"tip_radius": 5e-3}, "tip_radius means nothing to Toy"),
        ("toy", {"form": "pair"}, "form must be one of auto, only for toy"),
        ("toy", {"mass": -1.0}, "mass must be in"),
        ("toy", {"time_step": math.nan}, "time_step must be finite"),
        ("mujoco", {}, "the mass that it feels"),
        ("mujoco", {"mass": 1.0, "model": "robot.xml"}, "give mass or model"),
        ("mujoco", {"geom": "tip"}, "geom names one of a model"),
        ("unity", {}, "to must be one of mujoco"),
        ("pybullet", {}, "no longer exports to pybullet: .*kelvin-v"),
        ("gazebo-classic", {}, "no longer exports to gazebo-classic: .*kelvin-v"),
        ("gazebo", {}, "ignores the <kp> and <kd>"),  # with DART
    ],
)
def test_what_an_engine_can_do_nothing_with_is_refused_in_words(toy, engine, given, words):
    error = ExportRefusedError if engine == "gazebo" else InvalidParameterError
    with pytest.raises(error, match=words):
        exports.export(BALL.law, engine, **given)
    with pytest.raises(InvalidParameterError, match="result must be an Identification"):
        exports.export("ball.csv", "toy")


@pytest.mark.parametrize("name", ["scene.usda", "statement.md", "statement.json"])
def test_an_export_replaces_only_what_an_export_wrote(ball, saved, name, tmp_path):
    first = exports.export(ball, "usd", mass=1.0)
    second = exports.export(ball, "drake", allow=True, replay=False)
    with pytest.raises(RecordingError, match="this file is read"):
        first.save(saved, inputs=[saved / "material.usda"])
    (tmp_path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(RecordingError, match=rf"{name}: palpate did not write this .*-o FOLDER"):
        first.save(tmp_path)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, "mine")]
    (tmp_path / name).unlink()
    # Its own it replaces, those of another engine between them too, until somebody changes one.
    for made in (first, second, exports.export(ball, "usd", mass=2.0)):
        made.save(tmp_path)
    assert "float physics:mass = 2" in (tmp_path / "scene.usda").read_text()
    with (tmp_path / "scene.usda").open("a") as file:
        file.write("# my own light\n")
    with pytest.raises(RecordingError, match="or somebody changed it since"):
        first.save(tmp_path)
    # One that was interrupted has written no statement, and is repeated.
    *_, statement = first.save(tmp_path / "new")
    statement.unlink()
    assert first.save(tmp_path / "new")[-1] == statement


def test_the_command_prints_the_claim_and_writes_the_files(run, printed, saved, tmp_path):
    folder = tmp_path / "new" / "ball"
    out = printed("export", saved, "--to", "usd", "--mass", "1", "-o", folder)
    words = " ".join(out.split())
    assert "within 0.53 % of the law's force (predicted, not replayed here)" in words
    assert "the law itself leaves 0.41 %" in words
    assert f"wrote {folder / 'material.usda'}" in out
    first = (folder / "statement.json").read_bytes()
    assert run("export", saved / "result.json", "--to", "usd", "--mass", "1", "-o", folder)[0] == 0
    assert (folder / "statement.json").read_bytes() == first
    whole = json.loads(run("export", saved, "--to", "usd", "--mass", "1", "--json")[1])
    assert whole["claim"] == json.loads(first)["claim"]


def test_the_command_ends_with_3_where_it_refuses_and_writes_only_why(run, saved, tmp_path, toy):
    toy(factor=1.1)
    status, out, _ = run("export", saved, "--to", "toy", "-o", tmp_path)
    assert status == 3
    assert "refused, because" in out
    assert "--allow" in out
    assert {path.name for path in tmp_path.iterdir()} == {"statement.json", "statement.md"}
    assert json.loads((tmp_path / "statement.json").read_text())["files"] == []
    assert run("export", saved, "--to", "toy", "--allow", "-o", tmp_path)[0] == 0
    # What it then refuses again leaves the earlier fragment there, and says whose that is.
    for _ in range(2):
        assert run("export", saved, "--to", "toy", "-o", tmp_path)[0] == 3
        assert "earlier export, and not of this one: fragment.txt" in (
            (tmp_path / "statement.md").read_text()
        )


@pytest.mark.parametrize(
    "name, value",
    [("surface", None), ("flags", 3), ("elastic_modulus", {"tip": {"kind": "sphere"}})],
)
def test_a_saved_result_that_is_damaged_where_only_an_export_looks_is_a_line(saved, name, value):
    result = palpate.load_result(saved)
    result.description["results"][0][name] = value
    with pytest.raises(RecordingError, match="the result is damaged"):
        exports.export(result, "usd")


def test_a_comment_is_one_whatever_the_recording_is_called():
    notes = ["of a---b-.csv", "of c\x1b\x00d.csv"]
    assert ElementTree.fromstring(f"<a>{xml_comment(notes)}</a>").tag == "a"
    assert hash_comment(notes) == "# of a---b-.csv\n# of c  d.csv"


def test_what_is_no_result_is_said_in_a_line(run, saved, tmp_path):
    broken, printed = tmp_path / "result.json", tmp_path / "printed.json"
    broken.write_bytes((saved / "result.json").read_bytes()[:1000])
    printed.write_text(json.dumps({"schema_version": 1, "results": []}))
    recording = EXAMPLES / "ball.csv"
    for file, words in (
        (broken, "cut off"),
        (tmp_path / "none", "palpate identify FILE -o FOLDER"),
        (recording, f"a recording, not a result; run palpate identify {recording} -o FOLDER"),
        (printed, "printed by --json"),
    ):
        status, out, err = run("export", file, "--to", "usd")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert words in err
    assert run("export", saved, "--to", "gazebo")[0] == 3


def test_a_surface_without_an_error_bar_is_saved_too(ball, monkeypatch):
    # Else the saved law would be pressed from another surface than the one that was found.
    for name, value in (("surface", 1e-3), ("surface_standard_error", math.nan)):
        monkeypatch.setattr(type(ball.estimate), name, value)
    assert of_one(ball)["surface"] == 1e-3
