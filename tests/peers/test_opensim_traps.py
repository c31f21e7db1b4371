"""What is easily got wrong about OpenSim's ``HuntCrossleyForce``."""

import pytest

from palpate import HuntCrossley, identify
from peers.carriage import probed
from peers.opensim_probe import DISSIPATION, MODULUS, STIFFNESS, OpenSimProbe

pytestmark = pytest.mark.peers


def test_a_tip_of_the_same_material_softens_the_contact_by_the_root_of_eight() -> None:
    # This is what OpenSim's Python setters, which give both bodies the same material, amount to:
    # s = 1/2 and E = 2^(-3/2) E₁, with the dissipation of either.
    same = OpenSimProbe(tip_modulus=MODULUS, tip_dissipation=DISSIPATION)
    stiffness = STIFFNESS / 8.0**0.5
    expected = HuntCrossley(stiffness, stiffness * 1.5 * DISSIPATION, 1.5)
    assert identify(probed(same)).law.parameters == pytest.approx(expected.parameters, rel=1e-3)


def test_a_tip_that_dissipates_nothing_halves_the_dissipation_of_its_own_material() -> None:
    stiffness = STIFFNESS / 8.0**0.5
    expected = HuntCrossley(stiffness, stiffness * 1.5 * DISSIPATION / 2.0, 1.5)
    found = identify(probed(OpenSimProbe(tip_modulus=MODULUS, tip_dissipation=0.0))).law
    assert found.parameters == pytest.approx(expected.parameters, rel=1e-3)
