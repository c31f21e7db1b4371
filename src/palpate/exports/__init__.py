"""A law in the numbers of a simulation engine, with its error stated, and replayed.

made = exports.export(palpate.load_result("ball"), to="mujoco", mass=1.0)
made.save("ball-in-mujoco")
"""

from palpate.exports.asked import Asked
from palpate.exports.comparing import Compared
from palpate.exports.engine import Engine, Fragment, Replayed
from palpate.exports.errors import Drop
from palpate.exports.exporting import Export, export
from palpate.exports.motion import Motion
from palpate.exports.pressed import Pressed
from palpate.exports.registry import engine_called, engines
from palpate.exports.statement import Statement

__all__ = [
    "Asked",
    "Compared",
    "Drop",
    "Engine",
    "Export",
    "Fragment",
    "Motion",
    "Pressed",
    "Replayed",
    "Statement",
    "engine_called",
    "engines",
    "export",
]
