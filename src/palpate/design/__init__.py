"""How precisely a planned motion identifies a material, and a better motion."""

from palpate.design.motion import PAPER_MOTION as PAPER_MOTION
from palpate.design.motion import Motion as Motion
from palpate.design.motion import MotionCommand as MotionCommand
from palpate.design.motion import write_motion as write_motion
from palpate.design.planned import Design as Design
from palpate.design.planned import design as design
from palpate.design.precision import PredictedPrecision as PredictedPrecision
from palpate.design.precision import effective_noise as effective_noise
