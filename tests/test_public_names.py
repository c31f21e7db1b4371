"""``import palpate`` offers its names without importing NumPy before one is asked for."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import palpate


def python(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_name_is_there_when_it_is_asked_for_and_not_before():
    python("""
import sys, palpate
assert "numpy" not in sys.modules
assert "identify" in dir(palpate)
assert palpate.settings.Scale is palpate.Scale
from palpate import *
assert identify is palpate.identifying.identify
""")


def test_what_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'palpate' has no attribute 'identity'"):
        palpate.identity  # noqa: B018 - asking is the test
    assert not hasattr(palpate, "__wrapped__")


@pytest.mark.slow
def test_every_module_can_be_the_first_to_be_imported():
    root = Path(palpate.__file__).parent
    names = [
        ".".join(path.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted(root.rglob("*.py"))
        if path.name != "__main__.py"
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        assert len(list(pool.map(lambda name: python(f"import {name}"), names))) == len(names)
