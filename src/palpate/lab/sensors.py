"""What stands between a contact and its recording."""

from dataclasses import dataclass

import numpy as np

from palpate.validation import Floats, number_in


@dataclass(frozen=True, slots=True)
class Sensors:
    """The force sensor and the clock; the paper's section IV unless refined.

    recorded = step · round((F + bias + ε) / step) − mean of the same over the pause,  ε ~ N(0, σ²)

    Parameters
    ----------
    force_noise : float
        σ, N, in [0, 1e6]; 0 switches it off.
    force_resolution : float
        Step that the force is rounded to, N, in [0, 1e6]; 0 for none.
    force_bias : float
        Standard deviation of the bias, drawn by each seed, N, in [0, 1e6]; 0 for none.
    penetration_resolution : float
        Step that an ideal probe's penetration is rounded to, m, in [0, 1]; 0 for none. A robot's
        comes from its encoders.
    sample_time : float
        s, in [1e-5, 1].
    """

    force_noise: float = 0.05
    force_resolution: float = 0.125
    force_bias: float = 0.5
    penetration_resolution: float = 0.0
    sample_time: float = 1e-3

    def __post_init__(self) -> None:
        number_in("force_noise", self.force_noise, 0.0, 1e6)
        number_in("force_resolution", self.force_resolution, 0.0, 1e6)
        number_in("force_bias", self.force_bias, 0.0, 1e6)
        number_in("penetration_resolution", self.penetration_resolution, 0.0, 1.0)
        number_in("sample_time", self.sample_time, 1e-5, 1.0)

    def force(self, force: Floats, random: np.random.Generator) -> Floats:
        """Force as the sensor shows it, bias included, N."""
        return self.biased_force(force, self.bias(random), random)

    def bias(self, random: np.random.Generator) -> float:
        """A sensor's bias, N, which stays as it is."""
        return float(self.force_bias * random.standard_normal())

    def biased_force(self, force: Floats, bias: float, random: np.random.Generator) -> Floats:
        """Force as a sensor of this bias [N] shows it."""
        noise = self.force_noise * random.standard_normal(force.size)
        return rounded(force + bias + noise, self.force_resolution)

    def describe(self) -> str:
        """Say it in words."""
        return (
            f"force noise {self.force_noise:g} N rms, in steps of {self.force_resolution:g} N, "
            f"unknown bias of {self.force_bias:g} N rms; a sample every {self.sample_time:g} s"
        )


#: Nothing between the contact and its recording.
PERFECT = Sensors(force_noise=0.0, force_resolution=0.0, force_bias=0.0)


def rounded(values: Floats, step: float) -> Floats:
    """To the nearest step, where floats have room for it; adding zero turns −0 into 0."""
    if step <= np.spacing(np.abs(values).max(initial=0.0)):
        return values
    return step * np.round(values / step) + 0.0
