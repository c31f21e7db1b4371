"""From a law to a scene of MuJoCo, pressed as it is compiled from its file, and back to the law."""

import json

import numpy as np
import pytest

import palpate
from palpate import exports, lab
from palpate.exports.scenes import Scene

pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'palpate[exports]'")

LAW = palpate.HuntCrossley(2000.0, 2000.0, 1.3)


@pytest.fixture(scope="module")
def made():
    return exports.export(LAW, "mujoco", mass=1.0)


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    made.save(folder)
    return folder


def test_what_is_identified_from_the_scene_is_the_law_that_was_exported(
    run, folder, made, tmp_path
):
    file = tmp_path / "again.csv"
    pressed = ("lab", folder / "scene.xml", "--probe", "ideal", "--bias", "0", "--resolution", "0")
    status, out, err = run(*pressed, "--seconds", "6", "-o", file)
    assert (status, err) == (0, "")
    assert '"engine": "mujoco"' in out
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
    x, v = command.penetration, command.velocity
    forces = [
        m.force(time, 0.0 * x, x, v) for m in (Scene(folder / "scene.xml"), exports.Pressed(made))
    ]
    assert np.array_equal(*forces)
    assert (forces[0][x <= 0.0] == 0.0).all()
    assert forces[0].max() > 5.0


def test_a_robot_cannot_press_a_scene_and_what_is_no_scene_of_ours_is_refused(
    run, folder, tmp_path
):
    status, _, err = run("lab", folder / "scene.xml", "-o", tmp_path / "no.csv", "--seconds", "4")
    assert status == 2
    assert "--probe ideal" in err
    other = tmp_path / "other.xml"
    for text, words in (
        ("<mujoco><worldbody/></mujoco>", "no scene that palpate export wrote"),
        ("<mujoco>", "MuJoCo cannot read it"),
    ):
        other.write_text(text)
        status, _, err = run("lab", other, "--probe", "ideal", "-o", tmp_path / "no.csv")
        assert (status, err.count("\n")) == (2, 1)
        assert words in err
    own = (folder / "scene.xml").read_bytes()
    run("lab", folder / "scene.xml", "--probe", "ideal", "-o", folder / "scene.xml")
    assert (folder / "scene.xml").read_bytes() == own


def test_without_a_statement_beside_it_a_scene_says_what_it_is(folder, tmp_path):
    alone = tmp_path / "scene.xml"
    alone.write_bytes((folder / "scene.xml").read_bytes())
    assert Scene(alone).describe() == {"kind": "a scene of MuJoCo", "file": "scene.xml"}
    (tmp_path / "statement.json").write_text(json.dumps([]))
    assert Scene(alone).describe()["kind"] == "a scene of MuJoCo"
