"""The laws whose exports are measured, each exported once."""

from functools import lru_cache
from importlib.util import find_spec

from palpate import HuntCrossley, exports, lab
from palpate.force_laws import ForceLaw

LAWS: dict[str, ForceLaw] = {
    "ball": lab.BALL.law,
    "sponge": lab.SPONGE.law,
    "n = 1.5": HuntCrossley(2e4, 3e4, 1.5),
    "PVC": lab.PVC.law,
}
MODULES = {"drake": "pydrake", "opensim": "opensim", "mujoco": "mujoco"}
RADIUS = 30e-3  # m, of the tip, for engines whose law has it


@lru_cache(maxsize=64)
def made(law: str, to: str, form: str = "auto", mass: float = 1.0) -> exports.Export:
    """Return the export of one of the laws, whatever its error."""
    return exports.export(LAWS[law], to, form=form, mass=mass, allow=True, tip_radius=tip(to, form))


def tip(to: str, form: str = "auto") -> float | None:
    """Return the tip's radius, m, for the engines whose law has it."""
    return RADIUS if to == "opensim" else None


def there(engine: str) -> bool:
    """Whether an engine is installed."""
    return find_spec(MODULES[engine]) is not None
