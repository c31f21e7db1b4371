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
        "usd": "palpate.exports.usd",
    }
)

#: Kelvin–Voigt engines that an identified law can be typed into, but that have no export.
_BY_HAND: Mapping[str, str] = MappingProxyType(
    {
        "pybullet": "its contactStiffness and contactDamping are the K and B",
        "gazebo-classic": "ODE's <kp> and <kd> are the K and B",
    }
)
#: gz-physics issues 82 and 636, gz-sim issue 1961.
_DART = (
    "Gazebo with DART ignores the <kp> and <kd> of a surface: nothing of the law would arrive; "
    "export to mujoco or drake instead"
)


def engines() -> tuple[str, ...]:
    """Return the names of the engines that a law can be exported to."""
    return tuple(MODULES)


def engine_called(name: str) -> Engine:
    """Return the engine of a name.

    Raises
    ------
    InvalidParameterError
        There is none, or no longer one.
    ExportRefusedError
        It is one that ignores what it would be given.
    """
    if name in ("gazebo", "gz", "dart"):
        raise ExportRefusedError(_DART)
    if name in _BY_HAND:
        raise InvalidParameterError(
            f"palpate no longer exports to {name}: {_BY_HAND[name]} that "
            "palpate identify FILE --method kelvin-voigt prints"
        )
    if name not in MODULES:
        raise InvalidParameterError(f"to must be one of {', '.join(MODULES)}, not {name!r}")
    engine: Engine = import_module(MODULES[name]).ENGINE
    return engine
