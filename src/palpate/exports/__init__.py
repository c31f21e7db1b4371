"""A law in the numbers of a simulation engine, with its error stated, and replayed."""

from palpate.exports.asked import Asked
from palpate.exports.engine import Engine, Fragment, Replayed
from palpate.exports.motion import Motion
from palpate.exports.registry import engine_called, engines

__all__ = ["Asked", "Engine", "Fragment", "Motion", "Replayed", "engine_called", "engines"]
