"""Laws from the literature as generalised Hunt–Crossley laws.

Each function takes the parameters of its source, SI, and returns the equivalent law. The laws of
simulation engines are in :mod:`palpate.force_laws.engines`.
"""

import math

from palpate.force_laws.generalised import GeneralisedHuntCrossley
from palpate.force_laws.relaxation import FlatSpectrum, SingleRelaxation
from palpate.validation import above_zero, not_below_zero, number_in


def half_space(
    *, stiffness: float, exponent: float, retardation_time: float
) -> GeneralisedHuntCrossley:
    """Return F = K (xⁿ + A n xⁿ⁻¹ v) = K xⁿ + K A d(xⁿ)/dt: a Kelvin–Voigt half-space.

    B = n A K, p = n − 1. Kuwabara & Kono, *Jpn. J. Appl. Phys.* 26 (1987) 1230–1233, Brilliantov,
    Spahn, Hertzsch & Pöschel, *Phys. Rev. E* 53 (1996) 5382–5392, both for spheres, n = 1.5; for
    other tips Lee & Radok, *J. Applied Mechanics* 27 (1960) 438–444. Exact while the contact area
    grows; during withdrawal from a deep indentation it is the authors' approximation.

    Parameters
    ----------
    stiffness, exponent : float
        K, N/mⁿ, > 0; n, ≥ 1: 1 a punch, 1.5 a sphere, 2 a cone.
    retardation_time : float
        A, s, ≥ 0: viscosity over modulus.
    """
    k, n = above_zero("stiffness", stiffness), number_in("exponent", exponent, 1.0, 10.0)
    damping = n * k * not_below_zero("retardation_time", retardation_time)
    return GeneralisedHuntCrossley(k, n, damping, n - 1.0)


def hunt_crossley_1975(
    *, stiffness: float, exponent: float, restitution: float, speed: float
) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 3 (1 − e)/(2 v₀) v): the dissipation that Hunt & Crossley chose.

    *J. Applied Mechanics* 42 (1975) 440–445. For e near 1; ``palpate.dissipation_for`` is exact,
    and docs/quantities.md has the errors of this and the next two.

    Parameters
    ----------
    stiffness, exponent : float
        K, N/mⁿ, and n, > 0.
    restitution : float
        e, in [0, 1].
    speed : float
        Approach speed v₀, m/s, > 0; the law is for impacts at this speed.
    """
    e = number_in("restitution", restitution, 0.0, 1.0)
    return _law_from_dissipation(stiffness, exponent, 1.5 * (1.0 - e), speed)


def lankarani_nikravesh(
    *, stiffness: float, exponent: float, restitution: float, speed: float
) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 3 (1 − e²)/(4 v₀) v).

    Lankarani & Nikravesh, *J. Mechanical Design* 112 (1990) 369–376. For e near 1.

    Parameters
    ----------
    stiffness, exponent, restitution, speed : float
        As in :func:`hunt_crossley_1975`.
    """
    e = number_in("restitution", restitution, 0.0, 1.0)
    return _law_from_dissipation(stiffness, exponent, 0.75 * (1.0 - e * e), speed)


def flores(
    *, stiffness: float, exponent: float, restitution: float, speed: float
) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + 8 (1 − e)/(5 e v₀) v), which Chrono uses too.

    Flores, Machado, Silva & Martins, *Multibody System Dynamics* 25 (2011) 357–375. For every e.

    Parameters
    ----------
    stiffness, exponent, restitution, speed : float
        As in :func:`hunt_crossley_1975`, but e > 0.
    """
    e = number_in("restitution", restitution, 0.0, 1.0, open_low=True)
    return _law_from_dissipation(stiffness, exponent, 1.6 * (1.0 - e) / e, speed)


def standard_linear_solid(
    *, stiffness: float, branch_stiffness: float, branch_damping: float, exponent: float = 1.0
) -> GeneralisedHuntCrossley:
    """Return the standard linear solid in Maxwell's form: a spring parallel to a Maxwell branch.

    F = K xⁿ + s,  ds/dt = E d(xⁿ)/dt − s E/η: M = E and one relaxation time η/E. With K = 0 it is
    Maxwell's fluid. Zener's form, a spring E₁ in series with E₂ and η₂ in parallel, is equivalent
    with K = E₁E₂/(E₁ + E₂), E = E₁²/(E₁ + E₂), η = η₂ E₁²/(E₁ + E₂)².

    Parameters
    ----------
    stiffness : float
        K, N/mⁿ, ≥ 0.
    branch_stiffness, branch_damping : float
        E, N/mⁿ, and η, N·s/mⁿ, > 0.
    exponent : float
        n, > 0; 1 is the linear solid.
    """
    relaxing = above_zero("branch_stiffness", branch_stiffness)
    return GeneralisedHuntCrossley(
        not_below_zero("stiffness", stiffness),
        above_zero("exponent", exponent),
        0.0,
        exponent,
        relaxing,
        SingleRelaxation(above_zero("branch_damping", branch_damping) / relaxing),
    )


def fung(
    *, instantaneous: float, exponent: float, c: float, shortest: float, longest: float
) -> GeneralisedHuntCrossley:
    """Return quasi-linear viscoelasticity with Fung's box spectrum, common for soft tissue.

    G(t) = [1 + c ∫ e^(−t/τ) dτ/τ]/[1 + c ln(τ₂/τ₁)],  τ₁ ≤ τ ≤ τ₂

    K = K₀/(1 + c ln(τ₂/τ₁)), M = K₀ − K. Fung, *Biomechanics* (1981), section 7.6.

    Parameters
    ----------
    instantaneous, exponent : float
        K₀, N/mⁿ, and n of the elastic response, > 0.
    c : float
        Magnitude of the spectrum, > 0.
    shortest, longest : float
        τ₁ < τ₂, s, > 0.
    """
    spectrum, whole = FlatSpectrum(shortest, longest), above_zero("instantaneous", instantaneous)
    relaxed = whole / (1.0 + above_zero("c", c) * math.log(longest / shortest))
    n = above_zero("exponent", exponent)
    return GeneralisedHuntCrossley(relaxed, n, 0.0, n, whole - relaxed, spectrum)


def _law_from_dissipation(
    stiffness: float, exponent: float, wanted: float, speed: float
) -> GeneralisedHuntCrossley:
    """K xⁿ (1 + b v) with the requested b v₀."""
    k, n = above_zero("stiffness", stiffness), above_zero("exponent", exponent)
    return GeneralisedHuntCrossley(k, n, k * wanted / above_zero("speed", speed), n)
