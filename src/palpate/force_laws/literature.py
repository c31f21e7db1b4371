"""Laws from the literature as generalised Hunt–Crossley laws.

Each function takes the parameters of its source, SI, and returns the equivalent law. The laws of
simulation engines are in :mod:`palpate.force_laws.engines`.
"""

import math

from palpate.force_laws.generalised import GeneralisedHuntCrossley
from palpate.force_laws.relaxation import FlatSpectrum, SingleRelaxation
from palpate.validation import above_zero, not_below_zero, number_in


def half_space(*, K: float, n: float, retardation_time: float) -> GeneralisedHuntCrossley:
    """Return F = K (xⁿ + A n xⁿ⁻¹ v) = K xⁿ + K A d(xⁿ)/dt: a Kelvin–Voigt half-space.

    B = n A K, p = n − 1. Kuwabara & Kono, *Jpn. J. Appl. Phys.* 26 (1987) 1230–1233, Brilliantov,
    Spahn, Hertzsch & Pöschel, *Phys. Rev. E* 53 (1996) 5382–5392, both for spheres, n = 1.5; for
    other tips Lee & Radok, *J. Applied Mechanics* 27 (1960) 438–444. Exact while the contact area
    grows; during withdrawal from a deep indentation it is the authors' approximation.

    Parameters
    ----------
    K, n : float
        N/mⁿ, > 0; ≥ 1: 1 a punch, 1.5 a sphere, 2 a cone.
    retardation_time : float
        A, s, ≥ 0: viscosity over modulus.
    """
    k = above_zero("K", K)
    power = number_in("n", n, 1.0, 10.0)
    damping = power * k * not_below_zero("retardation_time", retardation_time)
    return GeneralisedHuntCrossley(K=k, n=power, B=damping, p=power - 1.0)


def hunt_crossley_1975(
    *,
    K: float,
    n: float,
    restitution: float,
    speed: float,
) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 3 (1 − e)/(2 v₀) v): the dissipation that Hunt & Crossley chose.

    *J. Applied Mechanics* 42 (1975) 440–445. For e near 1; ``palpate.dissipation_for`` is exact,
    and docs/explain/numbers.md has the errors of this and the next two.

    Parameters
    ----------
    K, n : float
        N/mⁿ and 1, > 0.
    restitution : float
        e, in [0, 1].
    speed : float
        Approach speed v₀, m/s, > 0; the law is for impacts at this speed.
    """
    e = number_in("restitution", restitution, 0.0, 1.0)
    return _law_from_dissipation(K, n, 1.5 * (1.0 - e), speed)


def lankarani_nikravesh(
    *,
    K: float,
    n: float,
    restitution: float,
    speed: float,
) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 3 (1 − e²)/(4 v₀) v).

    Lankarani & Nikravesh, *J. Mechanical Design* 112 (1990) 369–376. For e near 1.

    Parameters
    ----------
    K, n, restitution, speed : float
        As in :func:`hunt_crossley_1975`.
    """
    e = number_in("restitution", restitution, 0.0, 1.0)
    return _law_from_dissipation(K, n, 0.75 * (1.0 - e * e), speed)


def flores(*, K: float, n: float, restitution: float, speed: float) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 8 (1 − e)/(5 e v₀) v), which Chrono uses too.

    Flores, Machado, Silva & Martins, *Multibody System Dynamics* 25 (2011) 357–375. For every e.

    Parameters
    ----------
    K, n, restitution, speed : float
        As in :func:`hunt_crossley_1975`, but e > 0.
    """
    e = number_in("restitution", restitution, 0.0, 1.0, open_low=True)
    return _law_from_dissipation(K, n, 1.6 * (1.0 - e) / e, speed)


def standard_linear_solid(
    *,
    K: float,
    branch_stiffness: float,
    branch_damping: float,
    n: float = 1.0,
) -> GeneralisedHuntCrossley:
    """Return the standard linear solid in Maxwell's form: a spring parallel to a Maxwell branch.

    F = K xⁿ + s,  ds/dt = E d(xⁿ)/dt − s E/η: M = E and one relaxation time η/E. With K = 0 it is
    Maxwell's fluid. Zener's form, a spring E₁ in series with E₂ and η₂ in parallel, is equivalent
    with K = E₁E₂/(E₁ + E₂), E = E₁²/(E₁ + E₂), η = η₂ E₁²/(E₁ + E₂)².

    Parameters
    ----------
    K : float
        N/mⁿ, ≥ 0.
    branch_stiffness, branch_damping : float
        E, N/mⁿ, and η, N·s/mⁿ, > 0.
    n : float
        > 0; 1 is the linear solid.
    """
    relaxing = above_zero("branch_stiffness", branch_stiffness)
    return GeneralisedHuntCrossley(
        K=not_below_zero("K", K),
        n=above_zero("n", n),
        B=0.0,
        p=n,
        M=relaxing,
        relaxation=SingleRelaxation(above_zero("branch_damping", branch_damping) / relaxing),
    )


def fung(
    *,
    instantaneous: float,
    n: float,
    c: float,
    shortest: float,
    longest: float,
) -> GeneralisedHuntCrossley:
    """Return quasi-linear viscoelasticity with Fung's box spectrum, common for soft tissue.

    G(t) = [1 + c ∫ e^(−t/τ) dτ/τ]/[1 + c ln(τ₂/τ₁)],  τ₁ ≤ τ ≤ τ₂

    K = K₀/(1 + c ln(τ₂/τ₁)), M = K₀ − K. Fung, *Biomechanics* (1981), section 7.6.

    Parameters
    ----------
    instantaneous, n : float
        K₀, N/mⁿ, and n of the elastic response, > 0.
    c : float
        Magnitude of the spectrum, > 0.
    shortest, longest : float
        τ₁ < τ₂, s, > 0.
    """
    spectrum = FlatSpectrum(shortest, longest)
    whole = above_zero("instantaneous", instantaneous)
    relaxed = whole / (1.0 + above_zero("c", c) * math.log(longest / shortest))
    power = above_zero("n", n)
    return GeneralisedHuntCrossley(
        K=relaxed,
        n=power,
        B=0.0,
        p=power,
        M=whole - relaxed,
        relaxation=spectrum,
    )


def _law_from_dissipation(
    K: float,
    n: float,
    wanted: float,
    speed: float,
) -> GeneralisedHuntCrossley:
    """K xⁿ (1 + b v) with the requested b v₀."""
    k = above_zero("K", K)
    power = above_zero("n", n)
    damping = k * wanted / above_zero("speed", speed)
    return GeneralisedHuntCrossley(K=k, n=power, B=damping, p=power)
