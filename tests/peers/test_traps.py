"""What is easily got wrong about the contacts of Drake and of OpenSim."""

import numpy as np
import pytest
from export_cases import PVC_LAW, fitted

from palpate import Contact, HuntCrossley, KelvinVoigtRLS, identify
from palpate.exports.drake.running import Plant, Setting
from palpate.force_laws import engines
from peers import opensim_probe
from peers.carriage import SAMPLE_TIME, probed
from peers.drake_probe import DISSIPATION, KELVIN_VOIGT, RELAXATION, STIFFNESS, DrakeProbe
from peers.installed import installed
from peers.opensim_probe import OpenSimProbe
from peers.reference_simulators import beside, shown_by

pytestmark = pytest.mark.peers


@pytest.mark.parametrize(
    "stepping, firmer", [("continuous", 1.0), ("tamsi", 1.0), ("lagged", 1.0), ("continuous", 3.0)]
)
def test_a_tip_of_drakes_is_a_spring_in_series(stepping, firmer) -> None:
    # Of the penetration and its speed the surface takes so much; the tip dissipates nothing.
    share = firmer / (1.0 + firmer)
    law = engines.drake_point(stiffness=share * STIFFNESS, dissipation=share * DISSIPATION)
    assert beside(probed(DrakeProbe(stepping, tip_stiffness=firmer * STIFFNESS)), law) < 1e-7


# The same material is what OpenSim's Python setters, which give it to both bodies, amount to:
# s = 1/2 and E = 2^(-3/2) E₁, with the dissipation of either.
@pytest.mark.parametrize("tip, share", [(opensim_probe.DISSIPATION, 1.0), (0.0, 0.5)])
def test_a_tip_of_the_same_material_softens_opensims_contact_by_the_root_of_eight(
    tip, share
) -> None:
    stiffness = opensim_probe.STIFFNESS / 8.0**0.5
    law = HuntCrossley(stiffness, stiffness * 1.5 * opensim_probe.DISSIPATION * share, 1.5)
    same = OpenSimProbe(tip_modulus=opensim_probe.MODULUS, tip_dissipation=tip)
    assert beside(probed(same), law) < 1e-7


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


def test_a_sphere_on_a_hydroelastic_half_space_is_the_power_law_but_for_its_curvature() -> None:
    installed("pydrake.all")
    fragment = fitted("drake", PVC_LAW, form="hydroelastic", tip_radius=0.1)
    slab = fragment.slab
    law = engines.drake_hydroelastic(
        modulus=slab.modulus,
        thickness=slab.thickness,
        radius=slab.radius,
        dissipation=slab.dissipation,
    )
    plant = Plant(fragment.files([])["contact.sdf"], Setting("hydroelastic", "lagged", 0.0))
    for x, v in ((5e-3, 0.0), (1e-2, 0.05)):
        plant.put(x, v)
        # The mesh takes some of it; x/3R of curvature is taken out.
        expected = law.force(x, v) * (1.0 - x / (3.0 * slab.radius))
        assert plant.force() == pytest.approx(expected, rel=0.01)
