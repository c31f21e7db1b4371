"""``import palpate`` offers its names without importing NumPy before one is asked for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import palpate


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


@pytest.mark.parametrize(
    "code",
    [
        "import palpate.lanes",
        "from palpate import lanes",
        "from palpate.lanes import replay_lanes",
        "import palpate; palpate.lanes.replay_lanes",
    ],
)
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
    assert len(names) > 200
    places = [str(tmp_path / name) for name in ("others", "compiled")]
    command = [sys.executable, "-c", FIRST, " ".join(names), *places]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
