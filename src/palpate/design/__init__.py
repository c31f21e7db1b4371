"""What a planned motion would tell of a material, and a better motion."""

from palpate.design.motion import PAPER_MOTION, Motion
from palpate.design.outlook import Outlook
from palpate.design.planned import Design, design
from palpate.design.rounding import effective_noise

__all__ = ["PAPER_MOTION", "Design", "Motion", "Outlook", "design", "effective_noise"]
