"""MuJoCo: a law as one contact, a pair of coincident ones, or exactly as a callback."""

from palpate.exports.mujoco.engine import ENGINE, MuJoCo
from palpate.exports.mujoco.rows import Row, Rows

__all__ = ["ENGINE", "MuJoCo", "Row", "Rows"]
