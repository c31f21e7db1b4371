"""A law exported to Drake, parsed and pressed there."""

import subprocess
import sys

import numpy as np
import pytest
from export_cases import (
    BALL_LAW,
    HALF_SPACE_LAW,
    HERTZ_LAW,
    KELVIN_VOIGT_LAW,
    PVC_LAW,
    SPONGE_LAW,
    fitted,
    replayed_percent,
)

from palpate.exports.drake.running import Plant, Setting, forces
from palpate.exports.errors import drop_to
from peers.installed import installed

pytestmark = pytest.mark.peers


@pytest.fixture(autouse=True, scope="module")
def drake():
    return installed("pydrake.all")


SLAB = {"form": "hydroelastic", "tip_radius": 0.03}


@pytest.mark.parametrize(
    "law, further, most_percent",
    [
        (BALL_LAW, {}, 1e-6),
        (SPONGE_LAW, {}, 1e-6),
        (KELVIN_VOIGT_LAW, {}, 1e-6),
        (HERTZ_LAW, {}, 1.0),
        (PVC_LAW, {}, 1.0),
        (HALF_SPACE_LAW, {}, 1.0),
        # The inner spheres are raised.
        (PVC_LAW, {"tip_radius": 0.003}, 1.0),
        (PVC_LAW, {"time_step": 1e-2}, 1.0),
        (PVC_LAW, SLAB, 4.0),
        (PVC_LAW, {"form": "hydroelastic", "tip_radius": 0.1}, 4.0),
        # Wrong on purpose, and known beforehand.
        (PVC_LAW, {"form": "point"}, 18.0),
        (BALL_LAW, {"form": "sap"}, 0.6),
    ],
)
def test_the_force_is_the_laws_and_as_predicted(law, further, most_percent) -> None:
    fragment = fitted("drake", law, **further)
    replayed, predicted = replayed_percent(fragment, 200)
    assert replayed < most_percent
    # Percentage points; the slab's closed form leaves out a seventh of what its mesh does.
    assert abs(replayed - predicted) < (0.1 if fragment.form == "hydroelastic" else 1e-6)


@pytest.mark.parametrize(
    "law, further, tolerance",
    [
        (BALL_LAW, {}, 1e-6),
        (KELVIN_VOIGT_LAW, {}, 1e-6),
        (PVC_LAW, {"time_step": 2e-3}, 1e-6),
        # Of a slab a step takes the pressure of its beginning, and a line from there.
        (PVC_LAW, SLAB, 0.02),
    ],
)
def test_a_body_rebounds_as_predicted_and_by_a_fine_step_as_the_law_says(
    law, further, tolerance
) -> None:
    fragment = fitted("drake", law, **further)
    drop = drop_to(law, 1.0, 0.012)
    assert fragment.rebound(drop) == pytest.approx(fragment.predicted_rebound(drop), abs=tolerance)
    if tolerance < 1e-3:
        fine = fitted("drake", law, time_step=2e-5)
        assert fine.rebound(drop) == pytest.approx(drop.restitution, rel=2e-3)


def test_a_drop_of_too_many_steps_is_not_made() -> None:
    fragment = fitted("drake", BALL_LAW, time_step=1e-7)
    assert fragment.rebound(drop_to(BALL_LAW, 1.0, 0.012)) is None


@pytest.mark.parametrize("law, further", [(HERTZ_LAW, {}), (KELVIN_VOIGT_LAW, {}), (PVC_LAW, SLAB)])
def test_the_urdf_is_the_same_contact(law, further) -> None:
    fragment = fitted("drake", law, **further)
    text = fragment.files([])["contact.urdf"]
    motion = fragment.asked.motion.firm(20)
    by_urdf = forces(Plant(text, fragment.setting, "urdf"), motion)
    by_sdf = forces(Plant(fragment.files([])["contact.sdf"], fragment.setting), motion)
    assert by_urdf == pytest.approx(by_sdf, rel=1e-9)


def test_friction_would_push_back_on_the_flanks_of_a_tip_in_a_slab() -> None:
    fragment = fitted("drake", PVC_LAW, **SLAB)
    text = fragment.files([])["contact.sdf"]
    rough = text.replace(">0</drake:mu_", ">1</drake:mu_")
    assert rough != text
    motion = fragment.asked.motion.firm(20)
    entering = motion.velocity > 0.02
    continuous = Setting("hydroelastic", "lagged", 0.0)
    by_friction = forces(Plant(rough, continuous), motion)[entering]
    assert (by_friction > 1.15 * forces(Plant(text, continuous), motion)[entering]).all()


def test_under_sap_the_dissipation_counts_for_nothing_and_0_1_s_are_taken_for_each_body() -> None:
    # What every file says: not for SAP.
    fragment = fitted("drake", BALL_LAW)
    sap = Setting("point", "sap", 1e-3)
    motion = fragment.asked.motion.firm(50)
    found = forces(Plant(fragment.files([])["contact.sdf"], sap), motion)
    expected = 2000.0 * np.maximum(motion.penetration + 0.2 * motion.velocity, 0.0)
    # Far from the regime in which SAP makes a contact stiffer than asked.
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert "Not for SAP" in fragment.files([])["contact.sdf"]


@pytest.mark.parametrize("law, further", [(HERTZ_LAW, {}), (KELVIN_VOIGT_LAW, {})])
def test_the_scene_runs(law, further, tmp_path) -> None:
    for name, text in fitted("drake", law, **further).files(["a note"]).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, tmp_path / "scene.py"], capture_output=True, text=True, check=True
    )
    assert "of the speed" in ran.stdout


@pytest.mark.parametrize("law", [BALL_LAW, PVC_LAW], ids=["ball", "pvc"])
def test_without_time_steps_impacts_are_the_laws(law, tmp_path) -> None:
    fragment = fitted("drake", law, time_step=0.0)
    drop = drop_to(law, 1.0, 12e-3)
    assert fragment.rebound(drop) == pytest.approx(drop.restitution, rel=1e-3)
    assert fragment.predicted_rebound(drop) == pytest.approx(drop.restitution, rel=1e-3)
    replayed, predicted = replayed_percent(fragment, 50)
    assert abs(replayed - predicted) < 1e-6
    for name, text in fragment.files(()).items():
        (tmp_path / name).write_text(text)
    ran = subprocess.run(
        [sys.executable, "scene.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert "of the speed" in ran.stdout
