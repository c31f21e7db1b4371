"""What a planned motion would tell of a material, and a better motion."""

from palpate.design.command import MotionCommand, write_motion
from palpate.design.motion import PAPER_MOTION, Motion
from palpate.design.planned import Design, design
from palpate.design.predicted_precision import PredictedPrecision
from palpate.design.rounding import effective_noise

__all__ = [
    "PAPER_MOTION",
    "Design",
    "Motion",
    "MotionCommand",
    "PredictedPrecision",
    "design",
    "effective_noise",
    "write_motion",
]
