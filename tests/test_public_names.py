"""``import palpate`` offers its names when one is asked for, and each says what it is."""

import doctest
import enum
import functools
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest
import stable_names

import palpate
from palpate.input.preparation import velocity
from palpate.output import figures


def test_a_name_is_there_when_it_is_asked_for_and_not_before():
    code = """
import sys, palpate
assert "numpy" not in sys.modules
assert "identify" in dir(palpate)
assert palpate.method.settings.Scale is palpate.Scale
from palpate import *
assert identify is palpate.identifying.identify
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'palpate' has no attribute 'identity'"):
        palpate.identity  # noqa: B018 - asking is the test
    assert not hasattr(palpate, "__wrapped__")


# --- every public name says what it is, and names each of its parameters

NAMES = palpate.__all__
OWN = [getattr(palpate, name) for name in NAMES]
CLASSES = [thing for thing in OWN if inspect.isclass(thing)]
DRAWING = [figures.draw, figures.draw_comparison]
FUNCTIONS = [thing for thing in OWN if inspect.isfunction(thing)]
FUNCTIONS += [*DRAWING, velocity.velocity_of]


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


def test_public_names_have_docstrings():
    assert len(MEMBERS) > 200
    things = dict(zip(NAMES, OWN, strict=True)) | MEMBERS
    assert [name for name, thing in things.items() if not described(thing)] == []
    # A dataclass without one is given its signature.
    assert [name for name in NAMES if things[name].__doc__.startswith(f"{name}(")] == []
    assert [status for status in palpate.Status if not status.__doc__.endswith(".")] == []


def test_a_functions_docstring_names_its_parameters():
    for function in FUNCTIONS:
        words = inspect.getdoc(function)
        if inspect.signature(function).parameters:
            assert "Parameters\n-----" in words, function
        assert [n for n in inspect.signature(function).parameters if n not in words] == [], function


def test_a_functions_docstring_says_what_it_returns():
    silent = [each for each in FUNCTIONS if "Returns\n-------" not in inspect.getdoc(each)]
    assert silent == [palpate.write_contact]


@pytest.mark.parametrize(
    "things",
    [[*OWN, velocity.velocity_of], pytest.param(DRAWING, marks=pytest.mark.long)],
    ids=["names", "drawing"],
)
def test_every_public_name_has_an_example_that_runs(things, tmp_path, monkeypatch, undrawn):
    (tmp_path / "examples").symlink_to(Path(__file__).parents[1] / "examples")
    monkeypatch.chdir(tmp_path)
    # A third of the examples begin with the same recording, which one identification serves.
    monkeypatch.setattr(palpate, "identify", functools.cache(palpate.identify))
    runner, parser = doctest.DocTestRunner(verbose=False), doctest.DocTestParser()
    without, failures = [], []
    for thing in things:
        docstring, name = inspect.getdoc(thing), getattr(thing, "__name__", type(thing).__name__)
        if "Examples\n--------" not in docstring:
            without.append(name)
        runner.run(parser.get_doctest(docstring, {}, name, None, None), out=failures.append)
    assert (without, "".join(failures)) == ([], "")


CONSTRUCTED = [kind for kind in CLASSES if not issubclass(kind, enum.Enum | Exception | tuple)]


# Faces without settings of their own.
FACES = (palpate.ContactEstimator, palpate.PythonEstimator, palpate.ForceLaw, palpate.Tip)


@pytest.mark.parametrize("kind", CONSTRUCTED, ids=lambda k: k.__name__)
def test_a_classs_docstring_names_what_it_is_made_from(kind):
    if kind in FACES:
        return
    sections = re.split(r"^(\w+)\n-+$", inspect.getdoc(kind), flags=re.MULTILINE)
    parameters = sections[sections.index("Parameters") + 1]
    listed = ", ".join(re.findall(r"^(\S.*) : ", parameters, re.MULTILINE)).split(", ")
    assert [name for name in inspect.signature(kind).parameters if name not in listed] == []


def test_the_stable_names_and_their_arguments_are_those_on_record():
    """After a change that is meant, and that CHANGELOG names: ``python tests/stable_names.py``."""
    recorded = stable_names.PLACE.read_text("utf-8").splitlines()
    today = stable_names.lines()
    assert sorted(set(today) - set(recorded)) == []  # new, or with other arguments
    assert sorted(set(recorded) - set(today)) == []  # gone, or with other arguments
