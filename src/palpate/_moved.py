"""Modules that have moved: their former names, which documents and scripts use, stay."""

import sys
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec

TYPE_CHECKING = False  # as in palpate/__init__.py
if TYPE_CHECKING:
    from types import ModuleType

MOVED = {"palpate.design": "palpate.lab.design"}


class MovedModules(Loader):
    """Finds a module by its former name: the same object as by its present name."""

    @classmethod
    def find_spec(cls, name: str, *_: object) -> ModuleSpec | None:
        """Return a specification for the former name of a module, or of a module in it."""
        for former, present in MOVED.items():
            if name == former or name.startswith(f"{former}."):
                return ModuleSpec(name, cls(), origin=present + name.removeprefix(former))
        return None

    def create_module(self, spec: ModuleSpec) -> "ModuleType":
        """Import the module by its present name."""
        module = import_module(spec.origin or "")
        self._present = module.__spec__
        return module

    def exec_module(self, module: "ModuleType") -> None:
        """Keep the module, which has run already, as it is."""
        module.__spec__ = self._present


def install() -> None:
    """Let Python look here first."""
    if MovedModules not in sys.meta_path:
        sys.meta_path.insert(0, MovedModules)
