"""MuJoCo: a law as one contact, as two coincident contacts, or exactly as a callback."""

from palpate.exports.mujoco.engine import ENGINE as ENGINE
from palpate.exports.mujoco.engine import MuJoCo as MuJoCo
from palpate.exports.mujoco.fitting import PairRow as PairRow
from palpate.exports.mujoco.fitting import PairRows as PairRows
