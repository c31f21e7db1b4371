"""A law in Drake's and OpenSim's numbers: the mathematics and the text, without the engines."""

import math
import re
import xml.etree.ElementTree as ElementTree

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
    predicted_percent,
)

from palpate.errors import InvalidParameterError
from palpate.exports.drake.running import rebound_by_steps
from palpate.exports.drake.shapes import shapes
from palpate.exports.engine import Drop, drop_to
from palpate.force_laws import GeneralisedHuntCrossley, engines

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
        (GeneralisedHuntCrossley(2000.0, 1.003, 2000.0, 1.003), "point", 0.1),
        (GeneralisedHuntCrossley(2000.0, 0.98, 2000.0, 0.98), "point", 0.5),
        # A damper that hardly grows is nearer to SAP's.
        (GeneralisedHuntCrossley(2000.0, 1.01, 30.0, 0.01), "sap", 0.5),
    ],
)
def test_the_form_is_that_of_the_law(law, form, most_percent) -> None:
    fragment = fitted("drake", law)
    assert fragment.form == form
    assert fragment.exact == (most_percent == 1e-10)
    assert predicted_percent(fragment) < most_percent


@pytest.mark.parametrize("exponent", [1.1, 1.3, 1.5, 2.0, 2.5])
def test_spheres_in_one_another_are_a_power_law_of_the_same_dissipation(exponent) -> None:
    spheres = fitted("drake", GeneralisedHuntCrossley(3e4, exponent, 6e4, exponent)).contact
    assert spheres.gaps[0] == 0.0
    assert (np.diff(spheres.gaps) > 0.0).all()
    assert (spheres.stiffness > 0.0).all()
    assert spheres.dissipation == pytest.approx(2.0)
    # So few are enough.
    assert len(spheres.gaps) <= 8
    # A damper of another power is carried by each with its own dissipation.
    fragment = fitted("drake", GeneralisedHuntCrossley(1e5, 2.0, 3000.0, 1.0))
    assert predicted_percent(fragment) < 0.5
    assert np.ptp(fragment.contact.dissipation) > 0.0


def test_the_volume_and_the_damper_of_the_slab_are_integrals_over_the_cap() -> None:
    radius, depth = 0.03, 0.011
    angle = np.linspace(0.0, math.acos(1.0 - depth / radius), 200_001)
    below = depth - radius * (1.0 - np.cos(angle))
    # dA, seen from above.
    ring = 2.0 * math.pi * radius**2 * np.sin(angle) * np.cos(angle)
    # So fine a mesh loses 10⁻¹⁰ of it.
    volume, damper = (float(each[0]) for each in shapes(np.array([depth]), radius, 16))
    assert volume == pytest.approx(np.trapezoid(below * ring, angle), rel=1e-8)
    assert damper == pytest.approx(np.trapezoid(below * np.cos(angle) * ring, angle), rel=1e-8)


@pytest.mark.parametrize("radius, most_percent", [(0.03, 2.3), (0.1, 0.7)])
def test_a_slab_carries_a_square_law(radius, most_percent) -> None:
    fragment = fitted("drake", PVC_LAW, form="hydroelastic", tip_radius=radius)
    assert predicted_percent(fragment) < most_percent
    # E = K H/(πR), and more for the sphere's curvature.
    slab = fragment.contact
    flat = PVC_LAW.stiffness * slab.thickness / (math.pi * radius)
    assert 1.0 < slab.modulus / flat < 1.2


@pytest.mark.parametrize(
    "law, further, words",
    [
        (PVC_LAW, {"form": "hydroelastic"}, "--tip-radius"),
        (PVC_LAW, {"form": "hydroelastic", "tip_radius": 0.005}, "too small"),
        (PVC_LAW, {"form": "hydroelastic", "tip_radius": 50.0}, "too large"),
        (KELVIN_VOIGT_LAW, {"form": "sap", "time_step": 0.0}, "time_step must be above 0"),
        (GeneralisedHuntCrossley(-5.0, 1.0, 1.0, 1.0), {}, "stiffness"),
    ],
)
def test_what_cannot_be_a_contact_is_refused_in_words(law, further, words) -> None:
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
        (PVC_LAW, {"form": "hydroelastic", "tip_radius": 0.03}),
    ],
)
def test_both_texts_say_the_same_of_both_bodies_and_what_the_plant_must_be(law, further) -> None:
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


def test_a_tip_smaller_than_it_is_pressed_in_has_its_inner_spheres_raised_and_says_so() -> None:
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
    found = rebound_by_steps(lambda x, _v: stiffness * max(x, 0.0), drop, step)
    # Every step loses (1 + ω²h²)^½ of the amplitude, over the half period π/ω.
    omega = (stiffness / mass) ** 0.5
    expected = (1.0 + (omega * step) ** 2) ** (-0.5 * math.pi / (omega * step))
    assert found == pytest.approx(expected, abs=0.01)
    # Steps so fine that they do not matter are not taken.
    drop = drop_to(BALL_LAW, 1.0, 0.012)
    assert rebound_by_steps(BALL_LAW.force, drop, 1e-9) == pytest.approx(drop.restitution, abs=1e-4)


def test_a_step_that_damps_more_than_the_law_is_warned_of_and_sap_needs_one() -> None:
    coarse = fitted("drake", BALL_LAW, time_step=1e-3)
    assert any("damps a body by 2 N·s/m" in words for words in map(str, coarse.findings))
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
    assert fragment.predicted_rebound(drop) == pytest.approx(drop.restitution, rel=1e-6)


def test_it_asks_for_the_radius_and_says_that_it_holds_for_that_one_only() -> None:
    with pytest.raises(InvalidParameterError, match="--tip-radius"):
        fitted("opensim", HERTZ_LAW)
    with pytest.raises(InvalidParameterError, match="stiffness"):
        fitted("opensim", GeneralisedHuntCrossley(-1.0, 1.5, 0.0, 1.5), tip_radius=RADIUS)
    small, large = (fitted("opensim", HERTZ_LAW, tip_radius=each) for each in (0.01, 0.04))
    assert small.numbers["stiffness"] == pytest.approx(2.0 * large.numbers["stiffness"])
    assert any("10 mm only" in words for words in map(str, small.findings))
    assert any("deeper than its radius" in words for words in map(str, small.findings))
    assert len(large.findings) == 1


def test_each_geometry_has_parameters_of_its_own_and_the_tip_is_rigid() -> None:
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    text = fragment.files(["a note"])["contact.osim"]
    assert "a note" in text
    written = dict(re.findall(r"<geometry>(\w+)</geometry>\s*<stiffness>(.+)</stiffness>", text))
    assert float(written["surface"]) == fragment.numbers["stiffness"]
    assert float(written["sphere"]) > 1e12 * fragment.numbers["stiffness"]
    compile(fragment.files([])["scene.py"], "scene.py", "exec")
