"""Every engine by its name: a module each, which is imported when it is asked for."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType

from palpate.errors import ExportRefusedError, InvalidParameterError
from palpate.exports.engine import Engine

#: A module, of which ``ENGINE`` is the engine; none of them imports the simulator itself.
MODULES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "palpate.exports.mujoco",
        "drake": "palpate.exports.drake",
        "opensim": "palpate.exports.opensim",
        "pybullet": "palpate.exports.pybullet",
        "gazebo-classic": "palpate.exports.gazebo_classic",
        "usd": "palpate.exports.usd",
    }
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines that a law can be exported to."""
    return tuple(MODULES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name.

    Raises
    ------
    InvalidParameterError
        There is none.
    ExportRefusedError
        It is one that ignores what it would be given.
    """
    if name in ("gazebo", "gz", "dart"):
        from palpate.exports.gazebo_classic import DART

        raise ExportRefusedError(DART)
    if name not in MODULES:
        raise InvalidParameterError(f"to must be one of {', '.join(MODULES)}, not {name!r}")
    engine: Engine = import_module(MODULES[name]).ENGINE
    return engine
