"""Preparation of a contact from a recording: channels, units, velocity, surface and gate."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from palpate.input.preparation.gate import choose_gate as choose_gate
    from palpate.input.preparation.preparing import prepare as prepare
    from palpate.input.preparation.settings import Preparation as Preparation

# Imported at the first use, because --help shows the options and answers without NumPy.
_HOMES = {"choose_gate": "gate", "prepare": "preparing", "Preparation": "settings"}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
