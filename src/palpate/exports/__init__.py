"""A law in the numbers of a simulation engine, with its error stated, and replayed.

made = exports.export(palpate.load_result("ball"), to="mujoco", mass=1.0)
made.save("ball-in-mujoco")
"""

from palpate.exports.engine import Asked as Asked
from palpate.exports.engine import Drop as Drop
from palpate.exports.engine import Engine as Engine
from palpate.exports.engine import Fragment as Fragment
from palpate.exports.engine import ProbeMotion as Motion  # noqa: F401 - its old name, for one release
from palpate.exports.engine import ProbeMotion as ProbeMotion
from palpate.exports.engine import Replayed as Replayed
from palpate.exports.engine import engine_called as engine_called
from palpate.exports.engine import engines as engines
from palpate.exports.exporting import Export as Export
from palpate.exports.exporting import Pressed as Pressed
from palpate.exports.exporting import export as export
from palpate.exports.statement import Compared as Compared
from palpate.exports.statement import Statement as Statement
