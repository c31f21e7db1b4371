"""Every public name says what it is, and names each of its parameters."""

import dataclasses
import enum
import inspect
import re

import pytest

import palpate
from palpate import figures, metrics
from palpate.preparation import preparing, suggestions, velocity
from palpate.recordings import columns, opening, recording

# The registries are data: a comment says what they are.
NAMES = [name for name in palpate.__all__ if name not in ("ESTIMATORS", "FORCE_LAWS")]
OWN = [getattr(palpate, name) for name in NAMES]
CLASSES = [thing for thing in OWN if inspect.isclass(thing)]
FUNCTIONS = [thing for thing in OWN if not inspect.isclass(thing)]
FUNCTIONS += [figures.draw, figures.draw_comparison, velocity.velocity_of]
MODULES = [palpate, figures, metrics, preparing, suggestions, velocity, columns, opening, recording]


def members(kind: type) -> dict[str, object]:
    """Public methods and properties that the project wrote, inherited ones too."""
    found = {}
    for ancestor in kind.__mro__:
        if not ancestor.__module__.startswith("palpate"):
            continue
        for name, value in vars(ancestor).items():
            described = callable(value) or isinstance(value, property | classmethod)
            if not name.startswith("_") and described and not inspect.isclass(value):
                found.setdefault(name, value)
    return found


MEMBERS = {
    f"{kind.__name__}.{name}": value
    for kind in CLASSES
    for name, value in members(kind).items()
    if not issubclass(kind, enum.Enum)
}


SIGNATURE = re.compile(r"^\w*\(self.*\) -> .*$", re.MULTILINE)  # the binding library's own


def described(thing) -> bool:
    return bool(SIGNATURE.sub("", inspect.getdoc(thing) or "").strip())


def test_a_public_name_has_a_docstring():
    for name, thing in zip(NAMES, OWN, strict=True):
        assert described(thing), name
        # A dataclass without one is given its signature.
        assert not thing.__doc__.startswith(f"{name}("), name


def test_a_public_method_or_property_has_a_docstring():
    assert len(MEMBERS) > 200
    assert [name for name, member in MEMBERS.items() if not described(member)] == []


def test_a_module_has_a_docstring():
    assert [module.__name__ for module in MODULES if not described(module)] == []


def test_every_status_says_what_it_means():
    assert [status for status in palpate.Status if not status.__doc__.endswith(".")] == []


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_a_functions_docstring_names_its_parameters(function):
    words = inspect.getdoc(function)
    assert "Parameters\n-----" in words
    for name in inspect.signature(function).parameters:
        assert name in words


CONSTRUCTED = [
    kind
    for kind in CLASSES
    if not issubclass(kind, enum.Enum | Exception | tuple) and kind is not palpate.Estimate
]


@pytest.mark.parametrize("kind", CONSTRUCTED, ids=lambda k: k.__name__)
def test_a_classs_docstring_names_what_it_is_made_from(kind):
    words = inspect.getdoc(kind)
    shared = palpate.RecursiveLeastSquaresEstimator
    if issubclass(kind, shared) and kind is not shared:
        assert ":class:`RecursiveLeastSquaresEstimator`" in words  # which describes the settings
        return
    if kind in (palpate.ContactEstimator, palpate.PythonEstimator, palpate.ForceLaw, palpate.Tip):
        return  # a face without settings of its own
    for name in list(inspect.signature(kind.__init__).parameters)[1:]:
        assert name in words


def test_a_dataclass_describes_its_fields():
    for kind in filter(dataclasses.is_dataclass, CONSTRUCTED):
        for field in dataclasses.fields(kind):
            assert field.name in kind.__doc__, kind


@pytest.mark.parametrize("law", ["KelvinVoigt", "ExtendedKelvinVoigt", "HuntCrossley"])
def test_a_force_law_gives_its_equation_and_its_number(law):
    words = getattr(palpate, law).__doc__
    assert "F = K" in words
    assert "(eq. " in words


def test_all_lists_what_the_package_offers():
    assert len(set(palpate.__all__)) == len(palpate.__all__)
    for name in palpate.__all__:
        assert hasattr(palpate, name)
