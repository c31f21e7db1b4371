"""A law exported to PyBullet, parsed and pressed there."""

import subprocess
import sys

import numpy as np
import pytest
from export_cases import BALL_LAW, KELVIN_VOIGT_LAW, PVC_LAW, fitted, replayed_percent

from palpate.exports.errors import drop_to
from palpate.exports.pybullet import OTHERS_DAMPING, running
from peers.installed import installed

pytestmark = pytest.mark.peers


@pytest.fixture(autouse=True, scope="module")
def pybullet():
    # Quietly: it says on standard output when it was built.
    installed("pybullet")
    return running.quiet_pybullet()


def _read_back(files, time_step, mass=running.HEAVY):
    """K and B of f = K x₀ + B v₁, by least squares over states at random."""
    random = np.random.default_rng(0)
    rows = []
    with running.scene(files, 0.03, time_step) as scene:
        scene.weigh(mass)
        for x, v in random.uniform([2e-3, -0.05], [14e-3, 0.05], (200, 2)):
            scene.put(x, v)
            force = scene.step()
            rows.append((x, scene.state()[1], force))
    x, v, force = np.array(rows).T
    pushing = force > 0.0
    columns = np.column_stack([x, v])[pushing]
    return np.linalg.lstsq(columns, force[pushing], rcond=None)[0]


def _files(law, **further):
    return dict(fitted("pybullet", law, tip_radius=0.03, **further).files([]))


@pytest.mark.parametrize("time_step", [5e-4, 1e-3, 2e-3])
@pytest.mark.parametrize("mass", [1.0, running.HEAVY])
def test_stiffness_and_damping_are_read_back_and_the_steps_own_damping(time_step, mass) -> None:
    files = _files(KELVIN_VOIGT_LAW, time_step=time_step)
    stiffness, damping = _read_back(files, time_step, mass)
    assert stiffness == pytest.approx(2000.0, rel=1e-4)
    # Written is less by K h and the other body's; the solver has it again.
    assert damping == pytest.approx(16.6, rel=1e-4)
    # At another step it is another damping: by K times the difference.
    _, other = _read_back(files, 2.0 * time_step, mass)
    assert other == pytest.approx(16.6 + 2000.0 * time_step, rel=1e-4)


@pytest.mark.parametrize(
    "law, further, most_percent",
    [
        (KELVIN_VOIGT_LAW, {}, 1e-6),
        (KELVIN_VOIGT_LAW, {"time_step": 1e-2}, 1.0),
        (BALL_LAW, {}, 0.6),
        # Wrong, and known beforehand.
        (PVC_LAW, {}, 18.0),
    ],
)
def test_the_force_is_the_laws_and_as_predicted(law, further, most_percent) -> None:
    replayed, predicted = replayed_percent(fitted("pybullet", law, **further))
    assert replayed < most_percent
    assert abs(replayed - predicted) < 1e-6


@pytest.mark.parametrize("law", [KELVIN_VOIGT_LAW, BALL_LAW])
def test_a_body_rebounds_as_predicted(law) -> None:
    fragment = fitted("pybullet", law)
    drop = drop_to(law, 1.0, 0.012)
    assert fragment.rebound(drop) == pytest.approx(fragment.predicted_rebound(drop), abs=1e-6)
    if law is KELVIN_VOIGT_LAW:
        # What the step adds has been taken off.
        assert fragment.rebound(drop) == pytest.approx(drop.restitution, rel=0.01)


def test_on_both_bodies_the_stiffness_is_halved_and_the_damping_doubled() -> None:
    files = _files(KELVIN_VOIGT_LAW)
    surface = files["surface.urdf"]
    contact = surface[surface.index("<contact>") : surface.index("</contact>")] + "</contact>"
    files["tip.urdf"] = files["tip.urdf"].replace("<inertial>", contact + "<inertial>", 1)
    stiffness, damping = _read_back(files, 1e-3)
    assert stiffness == pytest.approx(1000.0, rel=1e-3)
    written = 16.6 - 2.0 - OTHERS_DAMPING
    assert damping == pytest.approx(2.0 * written + 1.0, rel=1e-3)


def test_two_exports_of_one_file_name_are_two_contacts() -> None:
    # URDF files are cached by name, where that is not switched off.
    for law in (KELVIN_VOIGT_LAW, PVC_LAW):
        fragment = fitted("pybullet", law, tip_radius=0.03)
        stiffness, _ = _read_back(dict(fragment.files([])), 1e-3)
        assert stiffness == pytest.approx(fragment.numbers["contactStiffness"], rel=1e-4)


def test_with_the_slop_of_every_scene_the_contact_begins_a_hundredth_of_a_millimetre_deep(
    pybullet,
) -> None:
    with running.scene(_files(KELVIN_VOIGT_LAW), 0.03, 1e-3) as scene:
        scene.weigh(running.HEAVY)
        scene.put(5e-3, 0.0)
        without = scene.step()
        pybullet.setPhysicsEngineParameter(contactSlop=1e-5, physicsClientId=scene.client)
        scene.put(5e-3, 0.0)
        assert without - scene.step() == pytest.approx(2000.0 * 1e-5, rel=1e-6)
    assert without == pytest.approx(10.0, rel=1e-9)


def test_the_scene_runs(tmp_path) -> None:
    for name, text in _files(KELVIN_VOIGT_LAW).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, tmp_path / "scene.py"], capture_output=True, text=True, check=True
    )
    assert "of the speed" in ran.stdout
