"""A law in PyBullet's numbers: the mathematics and the text, without PyBullet."""

import xml.etree.ElementTree as ElementTree

import pytest
from export_cases import BALL_LAW, KELVIN_VOIGT_LAW, fitted, predicted_percent

from palpate.errors import InvalidParameterError
from palpate.exports.nearest import kelvin_voigt
from palpate.force_laws import GeneralisedHuntCrossley


@pytest.mark.parametrize("time_step", [5e-4, 1e-3, 2e-3])
def test_the_steps_own_damping_and_the_other_bodys_are_taken_off(time_step) -> None:
    fragment = fitted("pybullet", KELVIN_VOIGT_LAW, time_step=time_step)
    assert fragment.exact
    assert fragment.numbers["contactStiffness"] == 2000.0
    expected = 16.6 - 2000.0 * time_step - 0.1
    assert fragment.numbers["contactDamping"] == pytest.approx(expected)
    assert predicted_percent(fragment) < 1e-10


def test_a_step_that_damps_more_than_the_law_is_said_and_counted() -> None:
    fragment = fitted("pybullet", KELVIN_VOIGT_LAW, time_step=1e-2)
    assert not fragment.exact
    assert fragment.numbers["contactDamping"] == 0.0
    assert any("smaller time step" in words for words in fragment.warnings)
    # It has K h + 0.1 where the law has B.
    actual = GeneralisedHuntCrossley(2000.0, 1.0, 20.1, 0.0)
    assert predicted_percent(fragment, actual) < 1e-10
    assert predicted_percent(fragment) > 0.3


def test_another_law_is_the_nearest_of_kelvin_and_voigt() -> None:
    fragment = fitted("pybullet", GeneralisedHuntCrossley(2e4, 1.5, 3e4, 1.5))
    assert not fragment.exact
    assert predicted_percent(fragment) > 5.0
    nearest = kelvin_voigt(fragment.asked.law, fragment.asked.motion)
    assert fragment.engine_law.parameters == pytest.approx(nearest.parameters)


def test_a_law_that_does_not_push_is_no_contact() -> None:
    with pytest.raises(InvalidParameterError, match="stiffness"):
        fitted("pybullet", GeneralisedHuntCrossley(-5.0, 1.0, 0.0, 0.0))


def test_one_body_has_the_contact_and_the_script_what_else_is_needed() -> None:
    files = fitted("pybullet", BALL_LAW, mass=0.7).files(["a note"])
    surface, tip = (ElementTree.fromstring(files[name]) for name in ("surface.urdf", "tip.urdf"))
    assert surface.find("link/contact/stiffness") is not None
    assert tip.find("link/contact") is None
    assert float(tip.find("link/inertial/mass").get("value")) == 0.7
    for wanted in ("contactSlop=0.0", "enableFileCaching=0", "numSubSteps=0"):
        assert wanted in files["scene.py"]
    assert all("a note" in text for text in files.values())
    compile(files["scene.py"], "scene.py", "exec")
