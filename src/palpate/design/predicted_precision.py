"""What one planned motion would tell of a guessed material."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.design.motion import Motion
from palpate.design.precision import Measurement
from palpate.design.search import FASTEST_PHASE
from palpate.digits import rounded
from palpate.validation import Floats, defined

TARGETS = (0.05, 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class PredictedPrecision:
    """What one motion would tell of a guessed material.

    Attributes
    ----------
    motion : Motion
        The motion.
    durations : tuple of float
        s, increasing.
    relative_errors : numpy.ndarray, shape (durations, 3)
        Least standard error of (K, B, n) over its value, after each duration (Cramér–Rao); infinite
        where the motion does not tell.
    expected_errors : numpy.ndarray, shape (durations, 3)
        RMS error of least squares, with what a sensor's rounding repeats; the same where it repeats
        nothing.
    targets : tuple of float
        5 % and 1 %.
    times : numpy.ndarray, shape (targets, 3)
        Seconds after which (K, B, n) can be known to each target; infinite where that takes more
        than 1000 s.
    least_penetration, peak_penetration : float
        Least and largest penetration within the longest duration, m.
    peak_speed, rms_speed : float
        m/s, in contact, within the longest duration.
    violated_fraction : float
        Fraction of the contact at or above the speed limit of eq. 10; NaN without contact.
    peak_force : float
        N.
    notes : tuple of str
        What a reader should know before running it.
    """

    motion: Motion
    durations: tuple[float, ...]
    relative_errors: Floats
    expected_errors: Floats
    targets: tuple[float, ...]
    times: Floats
    least_penetration: float
    peak_penetration: float
    peak_speed: float
    rms_speed: float
    violated_fraction: float
    peak_force: float
    notes: tuple[str, ...]

    @property
    def leaves_contact(self) -> bool:
        """Whether the probe comes up to the surface or above it within the longest duration."""
        return self.least_penetration <= 0.0

    @property
    def worst(self) -> float:
        """Largest of the expected errors after the longest duration."""
        return float(self.expected_errors[-1].max())

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and words; what is infinite or undefined is None."""
        return {
            "motion": {
                "depth": self.motion.depth,
                "amplitudes": list(self.motion.amplitudes),
                "frequencies": list(self.motion.frequencies),
            },
            "relative_errors": [
                {"duration": duration, **_named(row)}
                for duration, row in zip(self.durations, self.relative_errors, strict=True)
            ],
            "expected_errors": [
                {"duration": duration, **_named(row)}
                for duration, row in zip(self.durations, self.expected_errors, strict=True)
            ],
            "times": [
                {"relative_error": target, **_named(row)}
                for target, row in zip(self.targets, self.times, strict=True)
            ],
            "least_penetration": self.least_penetration,
            "peak_penetration": self.peak_penetration,
            "leaves_contact": self.leaves_contact,
            "peak_speed": self.peak_speed,
            "rms_speed": self.rms_speed,
            "violated_fraction": defined(self.violated_fraction),
            "peak_force": self.peak_force,
            "notes": list(self.notes),
        }


def predict_precision(
    motion: Motion, measurement: Measurement, durations: tuple[float, ...]
) -> PredictedPrecision:
    """Say what a motion would identify after each of the durations, which increase."""
    law, step = measurement.law, measurement.sample_time
    _, x, v = motion.sampled(durations[-1], step)
    touching = x > 0.0
    speed = np.abs(v[touching])
    met = bool(speed.size)
    errors = np.array([measurement.relative_errors(motion, d) for d in durations])
    expected = np.array([measurement.expected_errors(motion, d) for d in durations])
    outward = float(v[touching].min(initial=0.0))
    notes = _notes(motion, measurement, float(x.min()), outward)
    return PredictedPrecision(
        motion=motion,
        durations=durations,
        relative_errors=errors,
        expected_errors=expected,
        targets=TARGETS,
        times=measurement.times_to(motion, TARGETS),
        least_penetration=float(x.min()),
        peak_penetration=float(x.max()),
        peak_speed=float(speed.max()) if met else 0.0,
        rms_speed=float(np.sqrt(np.mean(speed**2))) if met else 0.0,
        violated_fraction=float(np.mean(speed >= measurement.speed_limit)) if met else math.nan,
        peak_force=float(law.force(x, v).max()),
        notes=(*notes, *_rounding_notes(errors[-1], expected[-1], durations[-1])),
    )


def _notes(
    motion: Motion, measurement: Measurement, least_penetration: float, outward: float
) -> list[str]:
    notes = []
    law = measurement.law
    if motion.top_speed == 0.0:
        notes.append("the probe is held: nothing of the law is identifiable")
    if least_penetration <= 0.0:
        notes.append(
            f"the probe leaves contact: it comes up to {rounded(1e3 * least_penetration, 3)} mm; a "
            "larger depth or smaller amplitudes keep it in"
        )
    if outward < -law.stiffness / law.damping:
        notes.append(
            "on its way out the probe is faster than K/B = "
            f"{rounded(law.stiffness / law.damping, 3)} m/s: there the law pulls, "
            "which no contact can"
        )
    fastest = max(motion.frequencies, default=0.0)
    if fastest * measurement.sample_time > FASTEST_PHASE:
        loss = 5.57 * (fastest * measurement.sample_time) ** 2
        notes.append(
            f"a velocity filter of 15 samples takes {loss:.1%} off the speed of the sine of "
            f"{rounded(fastest, 4)} rad/s, and with it biases the damping"
        )
    return notes


def _rounding_notes(errors: Floats, expected: Floats, duration: float) -> list[str]:
    if np.isinf(errors).any() or not (expected > 1.2 * errors).any():
        return []
    return [
        "the noise does not blur the sensor's steps, and the motion repeats them: after "
        f"{duration:g} s errors are about {(expected / errors).max():.1f} times the bound"
    ]


def _named(row: Floats) -> dict[str, float | None]:
    names = ("stiffness", "damping", "exponent")
    return {name: defined(float(value)) for name, value in zip(names, row, strict=True)}
