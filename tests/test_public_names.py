"""``import palpate`` offers its names when one is asked for, and each says what it is."""

import dataclasses
import enum
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import palpate
from palpate import figures
from palpate.estimators import estimate
from palpate.preparation import gates, preparing, velocity
from palpate.recordings import opening, recording


def test_a_name_is_there_when_it_is_asked_for_and_not_before():
    code = """
import sys, palpate
assert "numpy" not in sys.modules
assert "identify" in dir(palpate)
assert palpate.settings.Scale is palpate.Scale
from palpate import *
assert identify is palpate.identifying.identify
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_what_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'palpate' has no attribute 'identity'"):
        palpate.identity  # noqa: B018 - asking is the test
    assert not hasattr(palpate, "__wrapped__")


@pytest.mark.parametrize("code", ["from palpate import lanes", "import palpate; palpate.lanes"])
def test_the_module_of_lanes_is_refused_in_a_line_that_names_what_replaces_it(code):
    with pytest.raises(ImportError) as refused:
        exec(code, {})
    assert str(refused.value) == (
        "palpate.lanes was removed: use palpate.identify_many or palpate.fit_curves"
    )


# What the package imports of others is there before, and is imported once; then a fork a module.
FIRST = """
import gc, importlib, os, sys, tempfile
names = sys.argv[1].split()

def forked(work):
    child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr)
            os._exit(1)
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0

def others():
    for name in names:
        importlib.import_module(name)
    with open(sys.argv[2], "w") as file:
        file.write(" ".join(name for name in sys.modules if name.partition(".")[0] != "palpate"))

assert forked(others)
with open(sys.argv[2]) as file:
    for name in file.read().split():
        try:
            importlib.import_module(name)
        except ImportError:
            pass  # a part that somebody makes while it runs
# Each module of the package is compiled once; what is here is not looked through for garbage.
sys.dont_write_bytecode, sys.pycache_prefix = False, sys.argv[3]
gc.freeze()
assert not any(name.partition(".")[0] == "palpate" for name in sys.modules)
failed = [name for name in names if not forked(lambda: importlib.import_module(name))]
sys.exit(f"cannot be the first to be imported: {failed}" if failed else 0)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process can be forked there")
def test_every_module_can_be_the_first_of_the_package_to_be_imported(tmp_path):
    """No circle of imports within the package, wherever one enters it.

    Other packages are imported beforehand: whether a module says all that it needs of those, its
    users' tests see.
    """
    root = Path(palpate.__file__).parent
    names = [
        ".".join(path.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted(root.rglob("*.py"))
        if path.name not in ("__main__.py", "lanes.py")
    ]
    assert len(names) > 150
    places = [str(tmp_path / name) for name in ("others", "compiled")]
    command = [sys.executable, "-c", FIRST, " ".join(names), *places]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# --- every public name says what it is, and names each of its parameters

# The registries are data: a comment says what they are.
NAMES = [name for name in palpate.__all__ if name not in ("ESTIMATORS", "FORCE_LAWS")]
OWN = [getattr(palpate, name) for name in NAMES]
CLASSES = [thing for thing in OWN if inspect.isclass(thing)]
FUNCTIONS = [thing for thing in OWN if not inspect.isclass(thing)]
FUNCTIONS += [figures.draw, figures.draw_comparison, velocity.velocity_of]
MODULES = [palpate, figures, estimate, preparing, gates, velocity, opening, opening, recording]


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


def test_what_is_public_has_a_docstring():
    assert len(MEMBERS) > 200
    things = (
        dict(zip(NAMES, OWN, strict=True)) | MEMBERS | {each.__name__: each for each in MODULES}
    )
    assert [name for name, thing in things.items() if not described(thing)] == []
    # A dataclass without one is given its signature.
    assert [name for name in NAMES if things[name].__doc__.startswith(f"{name}(")] == []
    assert [status for status in palpate.Status if not status.__doc__.endswith(".")] == []


def test_a_functions_docstring_names_its_parameters():
    for function in FUNCTIONS:
        words = inspect.getdoc(function)
        assert "Parameters\n-----" in words, function
        assert [n for n in inspect.signature(function).parameters if n not in words] == [], function


CONSTRUCTED = [
    kind
    for kind in CLASSES
    if not issubclass(kind, enum.Enum | Exception | tuple) and kind is not palpate.Estimate
]


# Faces without settings of their own.
FACES = (palpate.ContactEstimator, palpate.PythonEstimator, palpate.ForceLaw, palpate.Tip)


@pytest.mark.parametrize("kind", CONSTRUCTED, ids=lambda k: k.__name__)
def test_a_classs_docstring_names_what_it_is_made_from(kind):
    words = inspect.getdoc(kind)
    shared = palpate.RecursiveLeastSquaresEstimator
    if issubclass(kind, shared) and kind is not shared:
        assert ":class:`RecursiveLeastSquaresEstimator`" in words  # which describes the settings
    elif kind not in FACES:
        names = list(inspect.signature(kind.__init__).parameters)[1:]
        assert [name for name in names if name not in words] == []
    if dataclasses.is_dataclass(kind):
        assert [each.name for each in dataclasses.fields(kind) if each.name not in words] == []
