"""Identify your own force law, if it is linear in its parameters.

    python examples/own_law.py

This example is a Kelvin–Voigt contact with Coulomb friction: F = K x + B v + C sign(v). Each sample
is a row of regressors φ = [x, v, sign v]; palpate.LeastSquares estimates θ = [K, B, C].
"""

import math

import numpy as np

from palpate import LeastSquares

# The truth, unknown with a real probe.
STIFFNESS, DAMPING, FRICTION = 800.0, 12.0, 0.4  # N/m, N·s/m, N
NOISE = 0.05  # N


def main() -> None:
    """Press in and out, learn sample by sample, and compare with the truth."""
    t = np.arange(0.0, 2.0, 1e-3)
    x = 0.010 + 0.004 * np.sin(7.0 * t)
    v = 0.028 * np.cos(7.0 * t)
    force = STIFFNESS * x + DAMPING * v + FRICTION * np.sign(v)
    force += NOISE * np.random.default_rng(1).standard_normal(t.size)

    law = LeastSquares(3, initial_covariance=1e8)
    for x_k, v_k, force_k in zip(x.tolist(), v.tolist(), force.tolist(), strict=True):
        law.update([x_k, v_k, math.copysign(1.0, v_k)], force_k)

    errors = np.sqrt(law.noise_variance * np.diag(law.covariance))
    names = ("stiffness [N/m]", "damping [N·s/m]", "friction [N]")
    truths = (STIFFNESS, DAMPING, FRICTION)
    for name, found, error, truth in zip(names, law.parameters, errors, truths, strict=True):
        print(f"{name:16} {found:8.3f} ± {error:.3f}   (truth {truth:g})")
    print(f"{'noise [N]':16} {math.sqrt(law.noise_variance):8.3f}           (truth {NOISE:g})")


if __name__ == "__main__":
    main()
