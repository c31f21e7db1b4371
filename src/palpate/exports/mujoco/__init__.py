"""MuJoCo: a law as one contact, as two coincident contacts, or exactly as a callback."""

from palpate.exports.mujoco.accelerated import MJX as MJX
from palpate.exports.mujoco.accelerated import WARP as WARP
from palpate.exports.mujoco.engine import ENGINE as ENGINE
from palpate.exports.mujoco.engine import MuJoCo as MuJoCo
from palpate.exports.mujoco.fitting import PairRow as PairRow
from palpate.exports.mujoco.fitting import PairRows as PairRows
