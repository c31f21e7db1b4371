"""What is easily got wrong about Drake's point contact."""

import numpy as np
import pytest

from palpate import Contact, HuntCrossley, KelvinVoigtRLS, identify
from peers.carriage import SAMPLE_TIME, probed
from peers.drake_probe import DISSIPATION, KELVIN_VOIGT, RELAXATION, STIFFNESS, DrakeProbe
from peers.reference_simulators import shown_by

pytestmark = pytest.mark.peers


@pytest.mark.parametrize("stepping", ["continuous", "tamsi", "lagged"])
def test_a_tip_of_the_same_material_is_a_spring_in_series(stepping) -> None:
    # Each takes half of the penetration and of its speed; the tip dissipates nothing.
    half = HuntCrossley(STIFFNESS / 2.0, STIFFNESS / 2.0 * DISSIPATION / 2.0, 1.0)
    found = identify(probed(DrakeProbe(stepping, tip_stiffness=STIFFNESS))).law
    assert found.parameters == pytest.approx(half.parameters, rel=1e-3)


def test_sap_ignores_the_dissipation_and_takes_the_relaxation_time() -> None:
    otherwise = probed(DrakeProbe("sap", dissipation=5.0 * DISSIPATION))
    assert (otherwise.force == shown_by("drake-sap").force).all()
    doubled = probed(DrakeProbe("sap", relaxation=2.0 * RELAXATION))
    found = identify(doubled, KelvinVoigtRLS()).law
    assert found.stiffness == pytest.approx(STIFFNESS, rel=1e-6)
    assert found.damping == pytest.approx(STIFFNESS * 2.0 * RELAXATION, rel=1e-6)


@pytest.mark.parametrize("stepping", ["continuous", "tamsi", "lagged"])
def test_hunt_crossley_contact_ignores_the_relaxation_time(stepping) -> None:
    otherwise = probed(DrakeProbe(stepping, relaxation=2.0 * RELAXATION))
    assert (otherwise.force == shown_by(f"drake-{stepping}").force).all()


def test_the_force_belongs_to_the_state_after_the_step_and_not_before() -> None:
    contact = shown_by("drake-sap")
    late = Contact(
        contact.time[1:],
        penetration=contact.penetration[:-1],
        velocity=contact.velocity[:-1],
        force=contact.force[1:],
    )
    found = identify(late, KelvinVoigtRLS()).law
    # F = K (x + T v) + B v of the state before the step: K T = 1 N·s/m is counted as damping. The
    # velocity's gain in a step goes with −x, and so into the stiffness.
    wrong = KELVIN_VOIGT.damping + KELVIN_VOIGT.stiffness * SAMPLE_TIME
    assert found.damping == pytest.approx(wrong, rel=1e-3)


@pytest.mark.parametrize("stepping", ["tamsi", "lagged", "similar", "sap"])
def test_the_depth_beside_a_force_of_a_discrete_plant_is_that_before_the_step(stepping) -> None:
    probe = DrakeProbe(stepping)
    before, depth = [], []
    for k in range(1, 301):
        before.append(probe.penetration())
        probe.advance(k * SAMPLE_TIME, 1e3)  # 1 m/s²: it touches after 63 ms
        contact = probe.contact()
        depth.append(contact.point_pair().depth if contact else np.nan)
    seen = ~np.isnan(depth)
    assert seen.sum() > 200
    assert (np.array(depth)[seen] == np.array(before)[seen]).all()
