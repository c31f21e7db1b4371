"""A law exported to OpenSim, read and pressed there."""

import subprocess
import sys

import pytest
from export_cases import BALL_LAW, HERTZ_LAW, PVC_LAW, fitted, replayed_percent

from palpate.exports.errors import drop_to
from palpate.exports.opensim.running import Scene
from peers.installed import installed

pytestmark = pytest.mark.peers

RADIUS = 0.0225


@pytest.fixture(autouse=True, scope="module")
def opensim():
    return installed("opensim")


@pytest.mark.parametrize(
    "law, radius, most_percent",
    [
        (HERTZ_LAW, RADIUS, 1e-5),
        # As deep as several radii the law is taken as it stands.
        (HERTZ_LAW, 0.003, 1e-5),
        (BALL_LAW, RADIUS, 10.0),
        (PVC_LAW, RADIUS, 10.0),
    ],
)
def test_the_force_is_the_laws_and_as_predicted(law, radius, most_percent) -> None:
    replayed, predicted = replayed_percent(fitted("opensim", law, tip_radius=radius))
    assert replayed < most_percent
    assert abs(replayed - predicted) < 1e-5


@pytest.mark.parametrize("law", [HERTZ_LAW, PVC_LAW])
def test_a_body_rebounds_as_the_law_says_whatever_the_exponent(law) -> None:
    fragment = fitted("opensim", law, tip_radius=RADIUS)
    drop = drop_to(law, 1.0, 0.012)
    assert fragment.rebound(drop) == pytest.approx(drop.restitution, rel=1e-5)


def test_another_radius_is_another_law() -> None:
    # What the warning says: the force goes with its root.
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    text = fragment.files([])["contact.osim"]
    other = text.replace(f"<radius>{RADIUS}</radius>", f"<radius>{4.0 * RADIUS}</radius>")
    other = other.replace(f"{-RADIUS} 0 0", f"{-4.0 * RADIUS} 0 0")
    motion = fragment.asked.motion.firm(10)
    assert Scene(other).forces(motion) == pytest.approx(2.0 * Scene(text).forces(motion), rel=1e-6)


def test_the_scene_runs(tmp_path) -> None:
    for name, text in fitted("opensim", HERTZ_LAW, tip_radius=RADIUS).files(["a note"]).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, tmp_path / "scene.py"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,  # where OpenSim leaves its log
    )
    assert "of the speed" in ran.stdout
