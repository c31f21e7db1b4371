"""Engines that may not be there."""

import importlib
import warnings
from types import ModuleType

import pytest


def installed(name: str) -> ModuleType:
    """The engine's module, or a skip that says how to get it."""
    try:
        with warnings.catch_warnings():
            # Python 3.12 says it of every extension made by an older SWIG, as it is imported.
            warnings.filterwarnings(
                "ignore", "builtin type .* has no __module__ attribute", DeprecationWarning
            )
            return importlib.import_module(name)
    except ImportError as reason:
        pytest.skip(f"no {name} here ({reason}): pip install '.[peers,engines]'")
