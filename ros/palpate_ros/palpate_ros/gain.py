"""What a force controller does with an estimate from the wire. This module needs no ROS."""

import math
from dataclasses import dataclass
from typing import Any

SCHEMA = 4  # of palpate_msgs/ContactEstimate
LOST_CONTACT = 16  # its bits of `checks`
FAULTY = 1 | 2 | 8  # stuck force, saturation, late force
DO_NOT_TRUST = 0  # its mark


@dataclass
class GainController:
    """Scales the gain of a force control by the stiffness: a velocity per force, m/(s·N).

    Parameters
    ----------
    bandwidth : float
        Of the force control on any material, 1/s.
    oldest : float
        s: with an older estimate, or without a message for so long, the robot stops.
    """

    bandwidth: float = 10.0
    oldest: float = 0.5
    gain: float = 0.0
    #: What it does, and why.
    action: str = "stop: no estimate yet"
    _stiffness: float = 0.0
    _heard: float = -math.inf

    def take(self, estimate: Any, now: float) -> None:
        """React to an estimate that arrived at ``now``, s by any clock."""
        self._heard = now
        if estimate.schema != SCHEMA:
            self.gain = 0.0
            self.action = (
                f"stop: the message has schema {estimate.schema}, this controller reads {SCHEMA}"
            )
        elif estimate.checks & LOST_CONTACT:
            self.action = "hold: lost contact"  # in air any gain is safe; it is needed again
        elif estimate.stiffness_mark == DO_NOT_TRUST or estimate.checks & FAULTY:
            self.gain = 0.0
            self.action = f"stop: do not trust ({estimate.flags or 'diagnosis'})"
        elif not estimate.age <= self.oldest:  # or NaN
            self.gain = 0.0
            self.action = f"stop: the estimate is {estimate.age:.1f} s old"
        elif estimate.stiffness_usable and estimate.stiffness > 0.0:
            self._stiffness = estimate.stiffness
            self.gain = self.bandwidth / self._stiffness
            self.action = "follow"
        else:
            # Too stiff is safe, too soft may oscillate: the gain only falls.
            stiffness = estimate.stiffness if math.isfinite(estimate.stiffness) else 0.0
            self._stiffness = max(self._stiffness, stiffness)
            self.gain = self.bandwidth / self._stiffness if self._stiffness > 0.0 else 0.0
            self.action = "hold: not usable"

    def watch(self, now: float) -> None:
        """Stop if no message has come for too long, at a time ``now``, s."""
        silence = now - self._heard
        if silence > self.oldest and math.isfinite(silence):
            self.gain = 0.0
            self.action = f"stop: no estimate for {silence:.1f} s"
