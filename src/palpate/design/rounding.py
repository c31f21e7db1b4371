"""What a force sensor that rounds adds to its noise."""

import math

import numpy as np

from palpate.validation import Floats, number_in

# Harmonics of the rounding error that are distinct from white noise: at least 87 % of its power.
_MOST = 4
# Smaller ones than this fraction of the noise are left in it.
_LEAST = 1e-3


def effective_noise(noise: float, resolution: float) -> float:
    """Noise of a sensor that also rounds: √(σ² + Δ²/12), N.

    Rounding to steps of Δ adds an error that is uniform over a step, of variance Δ²/12, and new at
    every sample as long as noise carries the force across steps: σ ≥ Δ/2. Below that a part of it,
    of amplitude (Δ/π) e^(−2π²σ²/Δ²), comes back whenever the force does. A motion that crosses
    many steps and does not soon repeat still averages it out; one that repeats does not, and a
    held force keeps it for ever: see ``expected_errors``.

    Parameters
    ----------
    noise : float
        σ before rounding, N, in [1e-15, 1e15].
    resolution : float
        Δ, N, in [0, 1e15]; 0 for a sensor that does not round.
    """
    sigma = number_in("noise", noise, 1e-15, 1e15)
    step = number_in("resolution", resolution, 0.0, 1e15)
    return math.hypot(sigma, step / math.sqrt(12.0))


def mean_rounding_error(noise: float, resolution: float) -> Floats:
    """Amplitudes βₖ [N] of the mean rounding error, Σ βₖ sin 2πk F/Δ, k = 1, 2, … up to four.

    βₖ = Δ/(πk) e^(−2π²k²σ²/Δ²): Gaussian noise of σ, blurring the sawtooth of a sensor of step Δ.
    Those that are small beside the noise are left out; without rounding there is none.
    """
    if resolution == 0.0:
        return np.empty(0)
    order = np.arange(1, _MOST + 1)
    # Beyond this the exponential is nothing, and its argument might overflow.
    ratio = min(noise / resolution, 10.0)
    betas: Floats = resolution / (np.pi * order) * np.exp(-2.0 * (np.pi * order * ratio) ** 2)
    count = int(np.count_nonzero(betas > _LEAST * effective_noise(noise, resolution)))
    return betas[:count]
