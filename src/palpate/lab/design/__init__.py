"""How precisely a planned motion identifies a material, and a better motion."""

from palpate.lab.design.motion import PAPER_MOTION as PAPER_MOTION
from palpate.lab.design.motion import Motion as Motion
from palpate.lab.design.motion import MotionCommand as MotionCommand
from palpate.lab.design.motion import write_motion as write_motion
from palpate.lab.design.planned import Design as Design
from palpate.lab.design.planned import design as design
from palpate.lab.design.precision import PredictedPrecision as PredictedPrecision
from palpate.lab.design.precision import effective_noise as effective_noise
