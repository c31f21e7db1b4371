"""MuJoCo carries a law as predicted: in the engine, in a user's model, and to a file and back."""

import json
import runpy
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from export_cases import BALL_LAW, HALF_SPACE_LAW, HERTZ_LAW, PVC_LAW, SPONGE_LAW
from export_cases import KELVIN_VOIGT_LAW as KELVIN_VOIGT

import palpate
from benchmarks import exports as benchmark
from benchmarks.engine_logs import log_mujoco, read_back
from benchmarks.sliding import FALL, sliding
from palpate import GeneralisedHuntCrossley, InvalidParameterError, exports, lab
from palpate.errors import ExportRefusedError
from palpate.exports import ExportRequest, ProbeMotion, engine_called, export
from palpate.exports.mujoco.fitting import PairRow, PairRows
from palpate.exports.mujoco.robot import Scene
from palpate.exports.replay_errors import drop_to, force_error
from palpate.exports.statement import ExportedLaw

MOTION = ProbeMotion.of_paper()
FIRM = MOTION.firm()
SHORT = MOTION.firm(600)
ENGINE = engine_called("mujoco")
# A shoulder, an elbow and a wrist; what its tip weighs to a contact is no number of its own.
ARM = """
<mujoco model="arm"><option cone="pyramidal" timestep="0.002"/>
  <default><geom solref="0.02 1" solimp="0.9 0.95 0.001"/></default>
  <worldbody><body pos="0 0 0.6"><joint axis="0 1 0"/><geom size="0.03" mass="1"/>
    <body pos="0.3 0 0"><joint axis="0 1 0"/><geom size="0.03" mass="0.6"/>
      <body name="hand" pos="0.25 0 -0.1"><joint axis="0 1 0"/>
        <geom name="palm" type="cylinder" size="0.02 0.05" mass="0.3"/>
        <geom name="tip" size="0.02" pos="0 0 -0.1" mass="0.1"/>
        </body></body></body>
    <geom name="floor" type="plane" size="1 1 1"/></worldbody></mujoco>"""
BOX = """
<mujoco><worldbody><body pos="0 0 1"><freejoint/>
  <geom name="foot" type="box" size="0.03 0.04 0.05" mass="2"/></body></worldbody></mujoco>"""
SLIDE = """
<mujoco><worldbody><body pos="0 0 1"><joint type="slide" axis="0 0 1"/>
  <geom name="tip" size="0.03" mass="2" pos="0.01 0 0"/></body></worldbody></mujoco>"""
MESH = """
<mujoco><asset><mesh name="wedge" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>
  <worldbody><body pos="0 0 1"><freejoint/>
    <geom name="tip" type="mesh" mesh="wedge" mass="1"/></body></worldbody></mujoco>"""
pulling = pytest.mark.skipif(not ENGINE.pulls(), reason="needs MuJoCo 3.11: adhesion of a pair")


def fitted(law, **asked):
    mass = None if "model" in asked else 1.0
    return ENGINE.fit(ExportRequest(law, asked.pop("motion", MOTION), **{"mass": mass, **asked}))


def error(fragment, motion=FIRM):
    replayed = fragment.replay(motion)
    return force_error(replayed.force, motion.force_by(fragment.request.law), motion.judged)


def write(folder, files):
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def hertz():
    return fitted(HERTZ_LAW)


@pytest.fixture
def model(tmp_path):
    def written(text):
        (tmp_path / "robot.xml").write_text(text, encoding="utf-8")
        return tmp_path / "robot.xml"

    return written


def within(text, more):
    return text.replace("<worldbody>", f"{more}<worldbody>", 1)


@pytest.mark.parametrize("pull", [0.0, pytest.param(1e4, marks=pulling)])
def test_the_force_of_a_row_is_that_of_the_engine_on_any_motion(pull):
    # Every parameter of solimp, a margin, and accelerations as large as those of an impact.
    random = np.random.default_rng(3)
    x = random.uniform(-1e-3, 0.02, 200)
    v, a = random.normal(0.0, 0.5, 200), random.normal(0, 50, 200)
    motion = ProbeMotion(np.arange(200.0), x, v, a, x > 0.0)
    rows = (
        PairRow(4e5, 0.0, (3e-3, 0.02, 0.025, 0.1, 4.0), 0.0, pull),
        PairRow(900.0, 3e3, (1e-4, 0.05, 0.015, 0.8, 2.5), 1e-3, pull),
    )
    fragment = replace(fitted(KELVIN_VOIGT), rows=PairRows(rows, 1.0))
    predicted = fragment.predict_force(motion)
    # Without a pull the damper of the second is clipped by itself as a body leaves.
    assert fragment.replay(motion).force == pytest.approx(predicted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("law", [BALL_LAW, SPONGE_LAW, HERTZ_LAW, PVC_LAW])
@pytest.mark.slow
@pulling
def test_a_pair_has_the_law_whatever_the_mass(law, mass):
    fragment = fitted(law, mass=mass)
    assert fragment.form == "pair"
    assert error(fragment) < 0.6
    drop = drop_to(law, mass, 0.012)
    assert fragment.drop_restitution(drop) == pytest.approx(drop.restitution, rel=0.01)


@pulling
def test_a_pair_has_the_force_and_the_rebound_that_were_predicted(hertz):
    assert hertz.form == "pair"
    assert fitted(HERTZ_LAW).rows == hertz.rows  # what is drawn at random is drawn anew
    law = MOTION.force_by(HERTZ_LAW)
    predicted = force_error(hertz.predict_force(MOTION), law, MOTION.judged)
    assert error(hertz, FIRM) == pytest.approx(predicted, abs=1e-6)
    assert predicted < 0.6
    drop = drop_to(HERTZ_LAW, 1.0, 0.012)
    found = hertz.drop_restitution(drop)
    assert found == pytest.approx(drop.restitution, rel=0.03)
    assert found == pytest.approx(hertz.predict_restitution(drop), rel=1e-3)
    # solref above 0 would be a time constant, which refsafe and the time step change.
    slow = replace(hertz, request=replace(hertz.request, time_step=5e-3))
    assert slow.replay(SHORT).force == pytest.approx(hertz.replay(SHORT).force, rel=1e-12)


@pytest.mark.parametrize(
    "law, form",
    [
        (KELVIN_VOIGT, "auto"),
        pytest.param(HERTZ_LAW, "auto", marks=pytest.mark.long),
        pytest.param(PVC_LAW, "two-contacts", marks=pytest.mark.long),
    ],
)
def test_friction_holds_a_pressed_body_up_to_its_limit(law, form):
    fragment = fitted(law, form=form, friction=0.5)
    assert fragment.describe_friction() == "friction 0.5"
    # The normal force is that of the law without friction.
    assert error(fragment, SHORT) == pytest.approx(error(fitted(law, form=form), SHORT), rel=1e-6)
    speed = sliding(fragment)
    assert speed(20.0, 9.5) < 5e-4
    assert speed(20.0, 10.5) == pytest.approx(0.5 * FALL, rel=0.02)  # (10.5 - 10) N on 1 kg


def test_friction_reaches_a_users_model_with_its_cone(model, tmp_path):
    made = export(palpate.KelvinVoigt(K=2000.0, B=16.6), "mujoco", model=model(SLIDE), geom="tip",
                  friction=0.4)  # fmt: skip
    assert ", friction 0.4: within 9.5·10⁻⁴ % of the law" in made.statement.describe()[0]
    made.save(tmp_path / "made")
    loaded = mujoco.MjModel.from_xml_path(str(tmp_path / "made" / "robot_scene.xml"))
    assert (loaded.opt.cone, loaded.opt.impratio) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 1e6)
    assert (loaded.pair_dim[0], loaded.pair_friction[0, 0]) == (3, 0.4)


def test_a_callback_has_no_friction():
    with pytest.raises(InvalidParameterError, match="the callback is frictionless"):
        fitted(BALL_LAW, form="callback", friction=0.5)
    assert fitted(BALL_LAW, form="callback").describe_friction() == "frictionless"


@pytest.mark.parametrize("to", ["mjx", "mujoco-warp"])
def test_accelerated_engines_have_no_callback(to):
    engine = engine_called(to)
    assert "callback" not in engine.forms
    law = GeneralisedHuntCrossley(K=2000.0, n=0.7, B=100.0, p=0.7)
    with pytest.raises(InvalidParameterError, match="--to mujoco --form callback"):
        engine.fit(ExportRequest(law, MOTION, mass=1.0))


@pytest.mark.long
def test_mjx_gets_two_contacts_that_rebound_as_the_law():
    fragment = engine_called("mjx").fit(ExportRequest(PVC_LAW, MOTION, mass=1.0))
    assert fragment.form == "two-contacts"
    drop = drop_to(PVC_LAW, 1.0, MOTION.deepest)
    assert fragment.predict_restitution(drop) == pytest.approx(drop.restitution, abs=0.02)
    predicted = fragment.predict_force(MOTION)
    withdrawn = MOTION.judged & (MOTION.velocity < 0.0)
    assert force_error(predicted, MOTION.force_by(PVC_LAW), withdrawn) < 1.5


@pytest.mark.long
@pytest.mark.parametrize(
    "law, contacts", [(KELVIN_VOIGT, True), (KELVIN_VOIGT, False), (BALL_LAW, False)]
)
def test_the_law_comes_back_from_the_contacts_that_mujoco_logs(law, contacts):
    log = log_mujoco(fitted(law), contacts=contacts)
    assert max(read_back(log, law)) < 1.0  # %


@pulling
def test_a_contact_pair_states_when_it_pulls():
    law = SPONGE_LAW
    fragment = fitted(law)
    said = " ".join(map(str, fragment.findings))
    assert "withdrawn faster than 0.1 m/s (K/B), the pair pulls with up to 4.7 N" in said
    assert "for MJX export --to mjx" in said
    assert "twice the recorded speed" not in said
    faster = replace(MOTION, velocity=1.5 * MOTION.velocity)
    assert "twice the recorded speed is faster" in str(fitted(law, motion=faster).findings)
    assert [row.adhesion for row in fragment.rows.rows] == [0.0, 4.7]
    # Below that speed it is the law; above it, it pulled with 6 N, and the callback does not pull.
    fast = np.array([[0.0, 1.0], [0.01, 0.01], [-0.08, -0.3], [0.0, 0.0]])
    motion = ProbeMotion(*fast, np.ones(2, bool))
    slower, faster = fragment.replay(motion).force
    assert slower == pytest.approx(float(law.force(0.01, -0.08)), abs=0.01)
    assert faster == pytest.approx(float(law.force(0.01, 0.0)) - 4.7, abs=0.01)
    assert fitted(law, form="callback").replay(motion).force[1] == 0.0
    # With p < n by K x^(n − p)/B at the median depth.
    said = " ".join(map(str, fitted(KELVIN_VOIGT, form="pair").findings))
    assert "withdrawn faster than 1.2 m/s from a depth of 10 mm" in said


def test_the_callback_leaves_other_models_alone(tmp_path):
    files = fitted(BALL_LAW, form="callback").files(["a note"])
    write(tmp_path, files)
    module = runpy.run_path(str(tmp_path / "palpate_contact.py"))
    models = [mujoco.MjModel.from_xml_string(text) for text in (files["scene.xml"], BOX)]
    data, other = map(mujoco.MjData, models)
    calls = []

    def earlier(model, data):
        calls.append(model.nv)

    mujoco.set_mjcb_passive(earlier)
    try:
        with module["ExactContact"](models[0]) as contact:
            data.qpos[0] = -5e-3
            mujoco.mj_forward(models[0], data)
            # Other geoms and joints.
            mujoco.mj_forward(models[1], other)
            assert contact.force == pytest.approx(10.0)
            assert not other.qfrc_passive.any()
            assert calls == [1, 6]
            # MuJoCo calls it while a model compiles, and cannot: the module says so.
            with pytest.raises(ValueError, match="Python exception"):
                mujoco.MjModel.from_xml_string(BOX)
            assert "compile them before" in files["palpate_contact.py"]
        assert mujoco.get_mjcb_passive() is earlier
    finally:
        mujoco.set_mjcb_passive(None)


def test_the_callback_runs_as_a_program_and_in_the_users_own_model(model, capsys):
    path = model(ARM.replace('"tip"', '"finger"'))
    fragment = fitted(BALL_LAW, model=path, geom="finger", form="callback")
    assert fragment.exact
    assert error(fragment, SHORT) < 1e-10
    folder = path.parent / "out"
    folder.mkdir()
    write(folder, fragment.files([]))
    own = mujoco.MjModel.from_xml_path(str(folder / "robot_scene.xml"))
    module = runpy.run_path(str(folder / "palpate_contact.py"))
    assert module["ExactContact"](own).tip == own.geom("finger").id
    runpy.run_path(str(folder / "palpate_contact.py"), run_name="__main__")
    peak, leaves = (float(word) for word in capsys.readouterr().out.split() if word[0].isdigit())
    drop = drop_to(BALL_LAW, 1.0 / fragment.mobility, MOTION.deepest)
    assert leaves / drop.speed == pytest.approx(drop.restitution, rel=5e-3)
    assert fragment.drop_restitution(drop) == pytest.approx(drop.restitution, rel=5e-3)
    assert peak > 2000.0 * MOTION.deepest


HOSTILE = (
    '"""+str(open("owned", "w"))+"""',
    "'+str(open('owned', 'w'))+'",
    '"""\nopen("owned", "w")\n"""',
    'a"--><body/><!-- & \u2028 coding:utf-7 {tip}',
)


@pytest.mark.parametrize("form", ["callback", "kelvin-voigt"])
@pytest.mark.parametrize("name", HOSTILE, ids=["docstring", "quotes", "lines", "markup"])
def test_the_name_of_a_model_is_never_code_or_markup(name, form, model, monkeypatch):
    spec = mujoco.MjSpec.from_string(SLIDE)
    spec.geoms[0].name = name
    spec.compile()
    path = model(spec.to_xml())
    monkeypatch.chdir(path.parent)
    made = export(KELVIN_VOIGT, "mujoco", model=path, geom=name, form=form, replay=False)
    assert made.statement.compared.percent < 0.1
    folder = path.parent / "out"
    made.save(folder)
    own = mujoco.MjModel.from_xml_path(str(folder / "robot_scene.xml"))
    assert own.nbody == 2
    if form == "callback":
        module = runpy.run_path(str(folder / "palpate_contact.py"))
        assert own.geom(module["ExactContact"](own).tip).name == name
        # The same bytes whatever the model: nothing of it can be source.
        plain = fitted(PVC_LAW, form="callback").files([])
        assert made.files["palpate_contact.py"] == plain["palpate_contact.py"]
    assert not list(path.parent.rglob("owned"))


def test_the_scene_of_a_robot_loads_from_anywhere(tmp_path, monkeypatch):
    # A model of parts and a mesh, as robots are; MuJoCo looks for those from the outer file on.
    robot = tmp_path / "a robot & more"
    (robot / "parts").mkdir(parents=True)
    (robot / "assets").mkdir()
    wedge = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (robot / "assets" / "wedge.obj").write_text(wedge)
    (robot / "parts" / "arm.xml").write_text(
        SLIDE.replace("</body>", '<geom type="mesh" mesh="wedge" mass="0.1"/></body>')
    )
    (robot / "robot.xml").write_text(
        '<mujoco><compiler meshdir="assets"/><asset><mesh name="wedge" file="wedge.obj"/></asset>'
        '<include file="parts/arm.xml"/></mujoco>'
    )
    monkeypatch.chdir(robot)
    made = export(KELVIN_VOIGT, "mujoco", model=Path("robot.xml"), geom="tip")
    out = tmp_path / "out"
    made.save(out)
    for folder, path in ((out, "robot_scene.xml"), (tmp_path, "out/robot_scene.xml")):
        monkeypatch.chdir(folder)
        found = mujoco.MjModel.from_xml_path(path)
        assert (found.nmesh, found.npair) == (1, 1)
        assert found.geom("palpate_pad").id != found.geom("tip").id


def test_a_replay_leaves_no_callback_behind_when_it_fails(monkeypatch):
    fragment = fitted(BALL_LAW, form="callback")
    drop = drop_to(BALL_LAW, 1.0, 0.01)
    for run in (lambda: fragment.replay(SHORT), lambda: fragment.drop_restitution(drop)):
        with monkeypatch.context() as patch:
            for name in ("mj_inverse", "mj_step"):
                patch.setattr(mujoco, name, None)
            with pytest.raises(TypeError):
                run()
        assert mujoco.get_mjcb_passive() is None


def test_an_exponent_below_one_is_the_callbacks():
    law = GeneralisedHuntCrossley(K=30.0, n=0.8, B=20.0, p=0.8)
    assert fitted(law).form == "callback"
    with pytest.raises(
        InvalidParameterError, match=r"an exponent of at least 1, not 0.*--form callback"
    ):
        fitted(law, form="pair")
    with pytest.raises(InvalidParameterError, match="cannot have negative damping"):
        fitted(GeneralisedHuntCrossley(K=2000.0, n=1.0, B=-20.0, p=1.0), form="pair")
    # Its nearest K x + B v has no damper: a negative one would make solref positive.
    law = GeneralisedHuntCrossley(K=2000.0, n=1.0, B=-20.0, p=0.0)
    assert fitted(law, form="kelvin-voigt").rows.rows[0].damper == 0.0


@pytest.mark.slow
@pulling
def test_a_pulling_law_is_exported_by_contacts_that_only_push():
    drop = drop_to(HALF_SPACE_LAW, 1.0, 0.012)
    auto, pair = (fitted(HALF_SPACE_LAW, form=form) for form in ("auto", "pair"))
    assert auto.form == "two-contacts"
    assert error(auto) < 0.6
    # By 7 % too low of the pair.
    assert auto.drop_restitution(drop) == pytest.approx(drop.restitution, rel=0.03)
    assert pair.drop_restitution(drop) < 0.95 * drop.restitution
    assert any("the pair pulls" in each for each in map(str, pair.findings))


@pytest.mark.long
def test_an_older_mujoco_gets_contacts_that_only_push(
    monkeypatch,
):
    monkeypatch.setattr(type(ENGINE), "version", lambda self: "3.8.1")
    pushing = fitted(KELVIN_VOIGT, form="two-contacts")
    assert fitted(HERTZ_LAW, motion=SHORT).form == "two-contacts"
    assert "adhesion" not in pushing.files([])["contact.xml"]
    assert error(pushing, SHORT) < 1.0
    fragment = fitted(KELVIN_VOIGT, form="pair")
    assert 'adhesion="' in fragment.files([])["contact.xml"]
    assert fragment.replay(SHORT) is None
    assert "3.8.1 is too old" in fragment.findings[-1].message


@pulling
def test_a_mass_that_the_contact_adds_is_told_where_it_counts():
    # A tonne on a material of 3 N: two rows of d = 1e-4 add 0.2 kg.
    soft = GeneralisedHuntCrossley(K=300.0, n=1.0, B=4.0, p=0.0)
    words = "the mass that the contacts add changes the force by"
    heavy = fitted(soft, mass=1000.0, form="pair")
    assert sum(each.startswith(words) for each in map(str, heavy.findings)) == 1
    assert error(heavy, SHORT) > 1.0
    assert not any(str(each).startswith(words) for each in fitted(soft, form="pair").findings)


@pytest.mark.parametrize("part, stays", [(0.9, True), (1.15, False)])
def test_the_largest_time_step_is_that_of_the_engine(part, stays):
    # A light probe on a spring that resists: it swings as h²k/m + 2hc/m < 4 allows.
    first = fitted(KELVIN_VOIGT, mass=0.1)
    step = part * first.largest_step
    fragment = replace(first, request=replace(first.request, time_step=step))
    model = mujoco.MjModel.from_xml_string(fragment.scene(0.0))
    data = mujoco.MjData(model)
    data.qfrc_applied[0], data.qpos[0] = -20.0, -0.0101  # it rests at 10 mm
    for _ in range(400):
        mujoco.mj_step(model, data)
    assert (abs(data.qpos[0] + 0.01) < 1e-4) == stays


def test_a_pair_beats_the_default_geom_and_the_pyramid(model):
    # Without a pair: the element-wise minimum with the other geom's solref, and a pyramid's force.
    fragment = fitted(KELVIN_VOIGT, model=model(ARM), geom="tip")
    # The arm in its pose is another mass than 1/Â, by which MuJoCo scales.
    assert fragment.robot.mobility != pytest.approx(1.0 / fragment.request.mass, rel=0.1)
    assert fragment.form == "kelvin-voigt"
    assert any("the effective mass in impacts is" in each for each in map(str, fragment.findings))
    assert error(fragment, SHORT) < 0.01
    data = fragment.pressable().model
    assert {int(dim) for dim in data.pair_dim} == {1}


@pulling
def test_the_fragment_runs_beside_the_users_own_model(model):
    path = model(ARM)
    fragment = fitted(KELVIN_VOIGT, model=path, geom="tip", form="pair")
    assert error(fragment, SHORT) < 0.01
    write(path.parent, fragment.files(["of a recording -- and more"]))
    both = mujoco.MjModel.from_xml_path(str(path.parent / "robot_scene.xml"))
    ours = fragment.pressable().model
    for name in ("pair_solref", "pair_solimp", "pair_margin", "pair_adhesion", "body_invweight0"):
        there, here = getattr(both, name), getattr(ours, name)
        assert there == pytest.approx(here[: len(there)], rel=1e-14)
    # As text has it, the surface just touches the tip of the model's first pose.
    data = mujoco.MjData(both)
    mujoco.mj_forward(both, data)
    line = np.zeros(6)
    pad, tip = both.geom("palpate_pad").id, both.geom("tip").id
    assert abs(mujoco.mj_geomDistance(both, data, pad, tip, 1.0, line)) < 1e-9


LYING = BOX.replace('type="box"', 'type="capsule" euler="0 90 0"')


@pytest.mark.parametrize(
    "text, contacts, words",
    [
        (BOX, 4, "4 contacts when it lies flat"),
        (LYING, 1, "twice the force"),
        (LYING.replace("<freejoint/>", '<joint type="slide" axis="0 0 1"/>'), 2, "lies flat"),
    ],
    ids=["box", "capsule", "capsule on a slide"],
)
def test_the_contacts_of_a_geom_share_the_force(model, text, contacts, words):
    fragment = fitted(KELVIN_VOIGT, model=model(text), geom="foot")
    assert fragment.rows.contacts == contacts
    assert error(fragment, SHORT) < 0.01
    assert any(words in each for each in map(str, fragment.findings))
    if contacts == 4:
        assert fragment.robot.mobility == pytest.approx(0.5)
        drop = drop_to(KELVIN_VOIGT, 2.0, 0.012)
        assert fragment.drop_restitution(drop) == pytest.approx(drop.restitution, rel=0.02)


@pytest.mark.parametrize(
    "text, geom, words",
    [
        (ARM, None, "add --geom NAME"),
        (ARM, "finger", "no geom 'finger'; it has floor, palm, tip"),
        (ARM, "floor", "floor is a plane"),
        (ARM.replace("</worldbody>", ""), "tip", "MuJoCo cannot read it"),
        (BOX.replace("foot", "palpate_pad"), "palpate_pad", "remove the earlier export"),
        (BOX.replace("<freejoint/>", ""), "foot", "fixed to the world"),
        (BOX.replace('mass="2"', 'mass="0"'), "foot", "MuJoCo cannot compile it"),
        pytest.param(
            within(SLIDE, "<default><pair adhesion='3'/></default>"),
            "tip",
            "move it to the model's own pairs",
            marks=pulling,
        ),
    ],
)
def test_a_model_that_cannot_be_used_is_told_in_words(model, text, geom, words):
    path = model(text)
    with pytest.raises(InvalidParameterError, match=words):
        fitted(KELVIN_VOIGT, model=path, geom=geom)
    path.unlink()
    with pytest.raises(InvalidParameterError, match="does not exist"):
        fitted(KELVIN_VOIGT, model=path, geom=geom)


def refusals_of(fragment):
    return [each.message for each in fragment.findings if each.severity == "do-not-trust"]


@pytest.mark.parametrize(
    "text, geom, words",
    [
        (MESH, "tip", "is a mesh"),
        (within(BOX, "<option><flag override='enable'/></option>"), "foot", "overrides solref"),
        (within(BOX, "<option><flag contact='disable'/></option>"), "foot", "disables contacts"),
    ],
)
def test_a_model_that_undoes_the_contact_is_refused(model, text, geom, words):
    assert words in refusals_of(fitted(KELVIN_VOIGT, model=model(text), geom=geom))[-1]


@pytest.mark.parametrize("form, refused", [("pair", 1), ("callback", 1), ("kelvin-voigt", 0)])
@pulling
def test_a_model_without_passive_forces_has_no_pair_that_pulls(model, form, refused):
    # Of these the pair's adhesion is one, and without it the contact pushes by as much more.
    text = within(SLIDE, "<option><flag spring='disable' damper='disable'/></option>")
    fragment = fitted(KELVIN_VOIGT, model=model(text), geom="tip", form=form)
    assert len(refusals_of(fragment)) == refused
    assert all("every passive force" in each for each in refusals_of(fragment))


def test_defaults_for_pairs_do_not_move_the_surface(model):
    # A margin of them made the contact 6 mm deep, and the force three times too large.
    path = model(within(SLIDE, "<default><pair margin='0.006' gap='0.005' condim='3'/></default>"))
    write(path.parent, fitted(KELVIN_VOIGT, model=path, geom="tip").files(()))
    found = mujoco.MjModel.from_xml_path(str(path.parent / "robot_scene.xml"))
    assert (found.pair_margin[0], found.pair_gap[0], found.pair_dim[0]) == (0.0, 0.0, 1)


def test_a_models_own_time_step_and_mass_are_those_that_count(model):
    path = model(within(SLIDE, "<option timestep='0.07'/>"))
    made = export(KELVIN_VOIGT, "mujoco", model=path, geom="tip", allow=True)
    assert "unstable at a time step of 70 ms" in made.statement.claim
    # Off its body's centre: MuJoCo then takes the mean over three axes, of which two do not move.
    assert made.fragment.mobility == pytest.approx(1.0 / 6.0)
    assert made.fragment.request.mass == pytest.approx(2.0)
    assert 'timestep="0.07"' in made.files["scene.xml"]
    with pytest.raises(InvalidParameterError, match="pass either time_step or model"):
        export(KELVIN_VOIGT, "mujoco", model=path, geom="tip", time_step=1e-3)


def test_an_undamped_law_is_one_row_of_contact_parameters():
    fragment = fitted(GeneralisedHuntCrossley(K=2e4, n=1.5, B=0.0, p=1.5), motion=SHORT)
    assert len(fragment.rows.rows) == 1
    assert fragment.rows.rows[0].damper == fragment.rows.rows[0].adhesion == 0.0
    assert error(fragment, SHORT) < 0.6
    assert any("the force at rest is off" in each for each in map(str, fragment.findings))


@pulling
def test_an_exponent_just_below_one_is_written_as_one():
    law = GeneralisedHuntCrossley(K=300.0, n=0.9987, B=3000.0, p=0.9987)
    pair = fitted(law)
    assert pair.form == "pair"
    assert any("0.9987 is exported as 1" in words for words in map(str, pair.findings))
    assert force_error(pair.predict_force(SHORT), SHORT.force_by(law), SHORT.judged) < 0.1


@pytest.fixture
def finished(model):
    """Return a function that writes a model with exports of a law, edited as text."""

    def written(text, *names, edit=("", "")):
        path = model(text)
        spec = mujoco.MjSpec.from_file(str(path))
        for name in names or ("",):
            folder = path.parent / f"out{name}"
            export(KELVIN_VOIGT, "mujoco", model=path, geom="tip", name=name).save(folder)
            spec = mujoco.MjSpec.from_file(str(folder / "robot_scene.xml"))
            spec.compile()
            path.write_text(spec.to_xml(), encoding="utf-8")
        assert edit[0] in path.read_text()
        path.write_text(path.read_text().replace(*edit, 1), encoding="utf-8")
        return path

    return written


TOOL = SLIDE.replace(
    'name="tip" size="0.03" mass="2" pos="0.01 0 0"', 'name="tip" size="0.03" mass="2"'
)
CARRIAGE = """
<mujoco><worldbody><body pos="0 0 1"><joint type="slide" axis="0 0 1" armature="0.125"/>
  <geom size="0.02" mass="0.8" pos="0.1 0 0.1"/><body><geom name="tip" size="0.03" mass="0.4"/>
  </body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    "text, edit, percent, cause",
    [
        (TOOL, ("", ""), 0.0, ""),
        (TOOL, ('mass="2"', 'mass="3"'), 50.0, "mass 2 kg when exported, 3 kg now"),
        # One body on one slide: MuJoCo leaves its armature out of body_invweight0.
        (TOOL, ("<joint", '<joint armature="1"'), 0.0, ""),
        (CARRIAGE, ('mass="0.4"', 'mass="1.0"'), 45.3, "mass 0.8 0.4 kg when exported"),
        (CARRIAGE, ("0.125", "0.787"), 50.0, "armature 0.125 when exported, 0.787 now"),
        (TOOL, ("</worldbody>", '</worldbody><option><flag override="enable"/></option>'), None,
         'override="enable"'),
        (TOOL, ("<worldbody>", '<option timestep="0.1"/><worldbody>'), 0.0, ""),
        (TOOL, ('condim="1"', 'condim="3" friction="0.5 0.5"'), None, "condim of palpate_contact"),
    ],
)  # fmt: skip
def test_the_check_of_a_finished_model_names_what_moves_its_force(
    finished, text, edit, percent, cause
):
    [contact] = exports.check_model(finished(text, edit=edit))
    if percent is not None:  # K is proportional to 1/Â
        assert contact.percent == pytest.approx(percent, abs=0.2)
    assert contact.passes == (percent == 0.0 and "timestep" not in edit[1])
    assert [cause in what and left < 0.1 for what, left in contact.causes] == [True] * bool(cause)
    assert any("time step of 100 ms" in each for each in contact.refusals) == (
        "timestep" in edit[1]
    )


@pytest.mark.long
@pytest.mark.parametrize("edit", list(benchmark.EDITS))
def test_the_check_agrees_with_a_simulation_in_time(edit, tmp_path):
    text, old, new = benchmark.EDITS[edit]
    path = benchmark.finished_model(tmp_path, text.replace("{height}", "1"), ("ball",))
    path.write_text(path.read_text().replace(old, new) if old else path.read_text())
    [contact] = exports.check_model(path)
    simulated = benchmark.simulate_contact(path, benchmark.LAWS["ball"], "palpate_pad")
    assert contact.percent == pytest.approx(simulated, abs=0.5)  # percentage points
    assert (contact.percent > 5.0) == bool(old)


def test_several_exports_in_one_model_have_names_of_their_own(finished, model):
    path = finished(TOOL, "foam", "pvc.2")
    contacts = exports.check_model(path)
    assert [each.material for each in contacts] == ["a law (palpate_foam)", "a law (palpate_pvc.2)"]
    assert all(each.passes for each in contacts)
    assert contacts[0].overlaps == ("palpate_pvc.2_pad",)  # both are where the tip is
    # MuJoCo adds a prefix where it attaches a model.
    outer = mujoco.MjSpec()
    frame = outer.worldbody.add_frame()
    outer.attach(mujoco.MjSpec.from_file(str(path)), frame=frame, prefix="left_")
    outer.compile()
    path.write_text(outer.to_xml(), encoding="utf-8")
    assert exports.check_model(path)[0].material == "a law (left_palpate_foam)"
    for name, words in (("foam", "another --name"), ('a"b', "name must consist of letters")):
        with pytest.raises(InvalidParameterError, match=words):
            export(KELVIN_VOIGT, "mujoco", model=finished(TOOL, "foam"), geom="tip", name=name)
    with pytest.raises(InvalidParameterError, match="does not use name"):
        export(KELVIN_VOIGT, "usd", name="foam")


def test_the_check_finds_a_surface_that_pushes_too_and_a_missing_pair(finished):
    floor = '<worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 0.97"/>'
    path = finished(TOOL, edit=("<worldbody>", floor))
    [contact] = exports.check_model(path)
    assert "geom floor collides with tip" in contact.refusals[0]
    path.write_text(path.read_text().replace('name="floor"', 'contype="0" conaffinity="0"'))
    assert exports.check_model(path)[0].passes
    path.write_text(path.read_text().replace('name="palpate_contact"', 'name="mine"'))
    assert exports.check_model(path)[0].refusals == ("its pair palpate_contact is missing",)


def test_the_command_checks_a_model(run, refused, finished, tmp_path):
    path = finished(TOOL, edit=('mass="2"', 'mass="3"'))
    status, out, _ = run("export", "--check", path)
    assert status == 3
    assert "the force is 50 % off" in out
    assert "moved by mass 2 kg when exported, 3 kg now; put back" in out
    status, out, _ = run("export", "--check", path, "--json")
    assert (status, json.loads(out)["contacts"][0]["passes"]) == (3, False)
    path.write_text(path.read_text().replace('mass="3"', 'mass="2"'))
    assert run("export", "--check", path)[0] == 0
    other = tmp_path / "other.xml"
    laws = '<mujoco><custom><text name="palpate_law" data="%s"/></custom></mujoco>'
    for text, words in (
        ("<mujoco", "MuJoCo cannot read it"),
        (path.read_text().replace('geom2="tip"', 'geom2="top"'), "MuJoCo cannot compile it"),
        ("<mujoco/>", "no contact that palpate export wrote"),
        *((laws % data, "is damaged") for data in ("{}", "[" * 100_000)),
    ):
        other.write_text(text)
        assert words in refused("export", "--check", other)
    assert "does not exist" in refused("export", "--check", tmp_path / "none.xml")
    assert "omit the rest" in refused("export", tmp_path, "--check", path)
    assert "needs RESULT" in refused("export")
    assert "needs --to ENGINE" in refused("export", tmp_path)


@pulling
def test_auto_takes_the_callback_where_a_contact_is_refused():
    # A micrometre of 20 nN, pressed by 1 kg: the mass that a contact adds is all of its force.
    law = GeneralisedHuntCrossley(K=2e-2, n=1.0, B=1e-4, p=0.0)
    small = ProbeMotion.of_paper(1e-4).firm(600)
    source = ExportedLaw(law, small)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ExportedLaw, "of", lambda *_: source)
        statement = export(law, "mujoco", mass=1.0).statement
        with pytest.raises(ExportRefusedError, match="force error of the engine"):
            export(law, "mujoco", mass=1.0, form="kelvin-voigt")
    assert statement.fragment.form == "callback"
    assert any("exported as a callback: as kelvin-voigt" in each for each in statement.warnings)


LAW = palpate.HuntCrossley(K=2000.0, B=2000.0, n=1.3)


@pytest.fixture(scope="module")
def made():
    return exports.export(LAW, "mujoco", mass=1.0)


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    made.save(folder)
    return folder


def test_identifying_the_scene_gives_the_exported_law(printed, folder, made, tmp_path):
    file = tmp_path / "again.csv"
    pressed = (
        "lab",
        folder / "scene.xml",
        "--probe",
        "ideal",
        "--bias",
        "0",
        "--resolution",
        "0",
    )
    assert '"engine": "mujoco"' in printed(*pressed, "--seconds", "6", "-o", file)
    found = palpate.identify(file, trace=False)
    # The stated error is one of force: what that moves a parameter by, at most, is s.e. · ε ‖F‖/σ.
    force = np.linalg.norm(found.contact.force[found.trace.taken])
    stated = 0.01 * made.statement.compared.percent * force / 0.05
    errors = np.abs(found.law.parameters - LAW.parameters) / found.standard_errors
    assert errors.max() < 3.0 + stated
    depth = found.working_depths[0]
    # What is felt is off by the stated error, and by the noise of one recording.
    assert depth.stiffness.value == pytest.approx(LAW.stiffness_at(depth.depth), rel=0.01)
    assert depth.damping.value == pytest.approx(LAW.damping_at(depth.depth), rel=0.02)


def test_the_file_has_the_force_of_the_fragment_in_memory(folder, made):
    time = 1e-3 * np.arange(3000)
    command = lab.Probing(pause=0.5).at(time)
    motion = time, 0.0 * time, command.penetration, command.velocity
    force = Scene(folder / "scene.xml").force(*motion)
    inside = np.flatnonzero(command.penetration > 0.0)
    acceleration = np.gradient(command.velocity, time)
    states = (time, command.penetration, command.velocity, acceleration)
    path = exports.ProbeMotion(*(each[inside] for each in states), judged=inside >= 0)
    assert np.array_equal(force[inside], made.fragment.replay(path).force)
    assert (force[command.penetration <= 0.0] == 0.0).all()
    assert force.max() > 5.0


def test_foreign_scenes_are_refused(run, refused, folder, tmp_path):
    no = tmp_path / "no.csv"
    assert "--probe ideal" in refused("lab", folder / "scene.xml", "-o", no, "--seconds", "4")
    other = tmp_path / "other.xml"
    for text, words in (
        ("<mujoco><worldbody/></mujoco>", "not a scene of palpate export"),
        ("<mujoco>", "MuJoCo cannot read it"),
    ):
        other.write_text(text)
        assert words in refused("lab", other, "--probe", "ideal", "-o", no)
    own = (folder / "scene.xml").read_bytes()
    run("lab", folder / "scene.xml", "--probe", "ideal", "-o", folder / "scene.xml")
    assert (folder / "scene.xml").read_bytes() == own
