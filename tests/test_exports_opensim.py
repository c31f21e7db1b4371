"""A law in OpenSim's numbers: the mathematics and the text, without OpenSim."""

import re

import pytest
from export_cases import (
    BALL_LAW,
    HALF_SPACE_LAW,
    HERTZ_LAW,
    PVC_LAW,
    fitted,
    predicted_percent,
)

from palpate.errors import InvalidParameterError
from palpate.exports.errors import drop_to
from palpate.force_laws import GeneralisedHuntCrossley, engines

RADIUS = 0.0225


def test_a_hertzian_law_is_simbodys_of_the_numbers_written() -> None:
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    assert fragment.exact
    numbers = fragment.numbers
    law = engines.simbody(
        modulus=numbers["stiffness"], radius=RADIUS, dissipation=numbers["dissipation"]
    )
    assert law.parameters == pytest.approx(HERTZ_LAW.parameters, rel=1e-12)


@pytest.mark.parametrize("law", [BALL_LAW, PVC_LAW])
def test_another_exponent_keeps_the_restitution_and_says_its_error(law) -> None:
    fragment = fitted("opensim", law, tip_radius=RADIUS)
    assert not fragment.exact
    # More than is exported without being allowed.
    assert 5.0 < predicted_percent(fragment) < 10.0
    drop = drop_to(law, 1.0, 0.012)
    assert fragment.predicted_rebound(drop) == pytest.approx(drop.restitution, rel=1e-6)


def test_a_damper_of_another_power_is_the_nearest_of_this_one() -> None:
    fragment = fitted("opensim", HALF_SPACE_LAW, tip_radius=RADIUS)
    assert not fragment.exact
    assert predicted_percent(fragment) < 1.0


def test_it_asks_for_the_radius_and_says_that_it_holds_for_that_one_only() -> None:
    with pytest.raises(InvalidParameterError, match="--tip-radius"):
        fitted("opensim", HERTZ_LAW)
    with pytest.raises(InvalidParameterError, match="stiffness"):
        fitted("opensim", GeneralisedHuntCrossley(-1.0, 1.5, 0.0, 1.5), tip_radius=RADIUS)
    small, large = (fitted("opensim", HERTZ_LAW, tip_radius=each) for each in (0.01, 0.04))
    assert small.numbers["stiffness"] == pytest.approx(2.0 * large.numbers["stiffness"])
    assert any("10 mm only" in words for words in small.warnings)
    assert any("deeper than its radius" in words for words in small.warnings)
    assert len(large.warnings) == 1


def test_each_geometry_has_parameters_of_its_own_and_the_tip_is_rigid() -> None:
    fragment = fitted("opensim", HERTZ_LAW, tip_radius=RADIUS)
    text = fragment.files(["a note"])["contact.osim"]
    assert "a note" in text
    written = dict(re.findall(r"<geometry>(\w+)</geometry>\s*<stiffness>(.+)</stiffness>", text))
    assert float(written["surface"]) == fragment.numbers["stiffness"]
    assert float(written["sphere"]) > 1e12 * fragment.numbers["stiffness"]
    compile(fragment.files([])["scene.py"], "scene.py", "exec")
