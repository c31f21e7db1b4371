"""Export a law as the parameters of a simulation engine, and state the engine's error.

made = exports.export(palpate.load_result("ball"), to="mujoco", mass=1.0)
made.save("ball-in-mujoco")
"""

from palpate.exports.engine import Engine as Engine
from palpate.exports.engine import Fragment as Fragment
from palpate.exports.engine import Replayed as Replayed
from palpate.exports.engine import engine_called as engine_called
from palpate.exports.engine import engines as engines
from palpate.exports.exporting import Export as Export
from palpate.exports.exporting import export as export
from palpate.exports.motion import ExportRequest as ExportRequest
from palpate.exports.motion import ProbeMotion as ProbeMotion
from palpate.exports.mujoco.checking import CheckedContact as CheckedContact
from palpate.exports.mujoco.checking import check_model as check_model
from palpate.exports.replay_errors import Drop as Drop
from palpate.exports.statement import Compared as Compared
from palpate.exports.statement import Statement as Statement
