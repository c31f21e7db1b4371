"""Steps of the force or of the penetration that are coarse against what they measure."""

import numpy as np

from palpate.diagnosis.data import Data, in_words
from palpate.diagnosis.finding import Finding
from palpate.preparation.spikes import step_of
from palpate.validation import Floats

FORCE_STEP = 0.04  # of the largest force
# Of the largest penetration: with 0.8 % the velocity's noise makes the damping 3 % too small, with
# 1.5 % 16 % (three draws each).
PENETRATION_STEP = 0.01
# Of the samples that repeat the one before; noise dithers the lab's steps of 1/8 N: 55 % repeat.
REPEATED = 0.85


def coarse(data: Data) -> Finding | None:
    """Steps above 4 % of the force or 1 % of the penetration, and over 85 % of samples repeat."""
    if _coarse(data.force, data.force_step, FORCE_STEP * data.peak_force):
        part = data.force_step / data.peak_force
        return _finding(
            f"the force comes in steps of {in_words(data.force_step, 'N')}, {part:.1%} of its "
            "largest",
            "a finer range of the sensor, or press harder",
        )
    step = step_of(data.penetration)
    if _coarse(data.penetration, step, PENETRATION_STEP * data.peak_penetration):
        return _finding(
            f"the penetration comes in steps of {in_words(step, 'm')}, "
            f"{step / data.peak_penetration:.1%} of its largest: the velocity is made of them, and "
            "the damping too small",
            "a finer encoder, deeper or faster strokes, or a longer --velocity-window",
        )
    return None


def _coarse(values: Floats, step: float, largest: float) -> bool:
    return 0.0 < largest < step and float(np.mean(np.diff(values) == 0.0)) > REPEATED


def _finding(sentence: str, remedy: str) -> Finding:
    return Finding("coarse steps", sentence, remedy, stiffness="with-care", damping="with-care")
