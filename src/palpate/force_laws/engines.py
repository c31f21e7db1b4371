"""Contact laws of simulation engines as generalised Hunt–Crossley laws.

Each function takes an engine's own parameters, SI, and returns the equivalent law
F = K xⁿ + B xᵖ v; :func:`exact_in` is the inverse. Engines clip negative forces to 0, as a real
contact does; a law does not. Laws from the literature are in :mod:`palpate.force_laws.literature`.
"""

import math

from palpate.errors import InvalidParameterError
from palpate.force_laws.generalised import GeneralisedHuntCrossley
from palpate.validation import above_zero, frozen, not_below_zero, number, number_in


@frozen
class EngineLaw:
    """The exponents of an engine's contact law.

    Attributes
    ----------
    name : str
        The engine, and the name of its law.
    exponent, damping_exponent : float
        n and p.
    condition : str
        Further condition of the engine; empty if it takes K and B directly.
    """

    name: str
    exponent: float
    damping_exponent: float
    condition: str = ""


#: None of them has memory.
ENGINES = (
    EngineLaw("Drake, point contact", 1.0, 1.0),
    EngineLaw("Drake, SAP", 1.0, 0.0),
    EngineLaw("MuJoCo, solref in the direct format", 1.0, 0.0, "except for a mass that it adds"),
    EngineLaw("PyBullet", 1.0, 0.0),
    EngineLaw("PhysX and Isaac, compliant contact", 1.0, 0.0),
    EngineLaw("Newton", 1.0, 0.0),
    EngineLaw("Gazebo Classic, ODE", 1.0, 0.0),
    EngineLaw("Simbody and OpenSim, HuntCrossleyForce", 1.5, 1.5, "of a sphere of one radius"),
    EngineLaw("Chrono SMC, Hertz by its material", 1.5, 0.25, "of one mass and radius"),
    EngineLaw("LIGGGHTS, hertz", 1.5, 0.25, "of one mass and radius"),
    EngineLaw("Chrono SMC, Hertz by coefficients", 1.5, 0.5, "of one mass and radius"),
    EngineLaw("LAMMPS, gran/hertz", 1.5, 0.5, "of one mass and radius"),
)


def exact_in(law: GeneralisedHuntCrossley) -> tuple[EngineLaw, ...]:
    """Return the engines that have exactly this law.

    They are matched by exponents: an identified exponent is never exactly 1.5, a known one may be
    (``exponent=1.5``). No engine here has memory; for a law with memory, pass its
    :meth:`~GeneralisedHuntCrossley.relaxed` or :meth:`~GeneralisedHuntCrossley.instantaneous` law.
    """
    if law.remembers:
        return ()
    return tuple(
        engine
        for engine in ENGINES
        if engine.exponent == law.n and (law.B == 0.0 or engine.damping_exponent == law.p)
    )


def _from_dissipation(K: float, n: float, dissipation: float) -> GeneralisedHuntCrossley:
    """Return F = K xⁿ (1 + d v), for a dissipation d ≥ 0, s/m."""
    damping = K * not_below_zero("dissipation", dissipation)
    return GeneralisedHuntCrossley(K=K, n=n, B=damping, p=n)


def kelvin_voigt(*, K: float, B: float) -> GeneralisedHuntCrossley:
    """Return F = K x + B v.

    The law of PyBullet (contactStiffness, contactDamping), PhysX and Isaac (compliant contact,
    compliantContactAccelerationSpring off), Newton and Gazebo Classic's ODE (kp, kd).

    Parameters
    ----------
    K, B : float
        N/m, > 0; N·s/m, ≥ 0.
    """
    return GeneralisedHuntCrossley(K=above_zero("K", K), n=1.0, B=not_below_zero("B", B), p=0.0)


def drake_point(*, stiffness: float, dissipation: float) -> GeneralisedHuntCrossley:
    """Return F = k x (1 + d v): Drake's point contact, continuous, TAMSI, Lagged or Similar.

    K = k, B = k d and n = p = 1 for v > −1/d; on faster withdrawals the engine's force is 0. For
    two bodies k = k₁k₂/(k₁ + k₂) and d = (k₂d₁ + k₁d₂)/(k₁ + k₂) (Drake, *Compliant contact*).

    Parameters
    ----------
    stiffness : float
        point_contact_stiffness of the pair, N/m, > 0.
    dissipation : float
        hunt_crossley_dissipation of the pair, s/m, ≥ 0.
    """
    return _from_dissipation(above_zero("stiffness", stiffness), 1.0, dissipation)


def drake_sap(*, stiffness: float, relaxation_time: float) -> GeneralisedHuntCrossley:
    """Return F = k (x + τ v): Drake's SAP, which ignores the dissipation.

    Castro, Permenter & Han, *An unconstrained convex formulation of compliant contact*, IEEE T-RO
    39 (2023) 1301–1320. K = k, B = k τ, n = 1, p = 0. τ is not a relaxation of the material.

    Parameters
    ----------
    stiffness : float
        Stiffness of both bodies in series, N/m, > 0.
    relaxation_time : float
        Sum of both bodies' τ, s, ≥ 0; Drake's default is 0.1 for each.
    """
    k = above_zero("stiffness", stiffness)
    damping = k * not_below_zero("relaxation_time", relaxation_time)
    return kelvin_voigt(K=k, B=damping)


def drake_hydroelastic(
    *,
    modulus: float,
    thickness: float,
    radius: float,
    dissipation: float,
) -> GeneralisedHuntCrossley:
    """Return F = (π E R/H) x² (1 + d v): a rigid sphere on Drake's hydroelastic half-space.

    The engine has (E/H) π x² (3R − x)/3, lower by x/3R, 17 % at half the radius. K = π E R/H,
    n = p = 2. Elandt et al., *A pressure field model for fast, robust approximation of net contact
    force and moment between nominally rigid objects*, IROS 2019.

    Parameters
    ----------
    modulus : float
        hydroelastic_modulus E, Pa, > 0.
    thickness : float
        Thickness H of the half-space's slab, m, > 0.
    radius : float
        Radius R of the sphere, m, > 0.
    dissipation : float
        hunt_crossley_dissipation, s/m, ≥ 0.
    """
    pressure = above_zero("modulus", modulus) / above_zero("thickness", thickness)
    k = math.pi * pressure * above_zero("radius", radius)
    return _from_dissipation(k, 2.0, dissipation)


def mujoco(
    *,
    solref: tuple[float, float],
    solimp: tuple[float, float, float, float, float],
    inverse_mass: float,
) -> GeneralisedHuntCrossley:
    """Return the law of one MuJoCo contact whose solref is in the direct format, (−S, −D).

    F = [d²/(d_w² (1 − d) Â)] S x + [d/(d_w (1 − d) Â)] D v + [d/((1 − d) Â)] ẍ,  d = d(x)

    from R F = a_ref − a, R = (1 − d)/d · Â (MuJoCo, *Computation*, constraint model). The law omits
    the last term, a mass d/((1 − d) Â) that the contact adds: keep d_w small. With d constant
    K = S/((1 − d) Â), B = D/((1 − d) Â), n = 1, p = 0. With d = d_w (x/width)^q, n = 1 + 2q and
    p = q, for 1 − d near 1 and d well above the engine's initial 1e-4: for d_w = 0.01, q = 1 the
    spring is 2.5 % too stiff at half the width. Valid up to x = midpoint · width.

    Parameters
    ----------
    solref : tuple of float
        −S and −D: 1/s² and 1/s, < 0 and ≤ 0.
    solimp : tuple of float
        (d₀, d_w, width, midpoint, q): d₀ = d_w; or d₀ ≤ 1e-4, q ≥ 1 and a midpoint ≥ 0.99.
    inverse_mass : float
        Â, 1/kg, > 0: the sum of both bodies' translational body_invweight0.
    """
    spring = above_zero("-solref[0]", -number("solref", solref[0]))
    damper = not_below_zero("-solref[1]", -number("solref", solref[1]))
    low, high, width, midpoint, power = (number_in("solimp", each, 0.0, 1e30) for each in solimp)
    mobility = above_zero("inverse_mass", inverse_mass)
    number_in("solimp", high, 1e-4, 0.9999)
    if low == high:
        mass = 1.0 / ((1.0 - high) * mobility)
        return kelvin_voigt(K=spring * mass, B=damper * mass)
    if not (low <= 1e-4 and power >= 1.0 and 0.99 <= midpoint <= 1.0 and width > 0.0):
        raise InvalidParameterError(
            "solimp must be constant (d0 = dwidth) or a power of depth (d0 <= 1e-4, "
            f"midpoint >= 0.99, power >= 1), not {solimp!r}"
        )
    # Up to the midpoint the engine uses (x/width)^q/midpoint^(q − 1).
    rise = midpoint ** (1.0 - power) * width**-power
    return GeneralisedHuntCrossley(
        K=spring * rise**2 / mobility,
        n=1.0 + 2.0 * power,
        B=damper * rise / mobility,
        p=power,
    )


def simbody(*, modulus: float, radius: float, dissipation: float) -> GeneralisedHuntCrossley:
    """Return F = 4/3 √R E x^1.5 (1 + 3/2 c v): Simbody's and OpenSim's HuntCrossleyForce.

    K = 4/3 √R E, B = 3/2 c K, n = p = 1.5. For two bodies E^(2/3) = s E₁^(2/3),
    s = E₂^(2/3)/(E₁^(2/3) + E₂^(2/3)), c = s c₁ + (1 − s) c₂ (Simbody, HuntCrossleyForce).

    Parameters
    ----------
    modulus : float
        Plane-strain modulus of the pair, Pa, > 0, which OpenSim calls stiffness.
    radius : float
        Radius of the sphere, or R₁R₂/(R₁ + R₂) of two, m, > 0.
    dissipation : float
        c, s/m, ≥ 0.
    """
    k = _hertz(modulus, radius)
    damping = 1.5 * k * not_below_zero("dissipation", dissipation)
    return GeneralisedHuntCrossley(K=k, n=1.5, B=damping, p=1.5)


def hertz_tsuji(
    *,
    modulus: float,
    radius: float,
    mass: float,
    restitution: float,
) -> GeneralisedHuntCrossley:
    """Return F = 4/3 E √R x^1.5 + 2 √(5/6) β √(2 E √R m) x^¼ v, β = −ln e/√(π² + ln² e).

    With this damper restitution does not depend on speed (Tsuji, Tanaka & Ishida, *Powder
    Technology* 71 (1992) 239–250). Used by Chrono's SMC with material properties, and by LIGGGHTS
    in ``model hertz``. n = 1.5, p = 0.25.

    Parameters
    ----------
    modulus : float
        Effective modulus, 1/E = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, Pa, > 0.
    radius : float
        Effective radius, R₁R₂/(R₁ + R₂), m, > 0.
    mass : float
        Effective mass, m₁m₂/(m₁ + m₂), kg, > 0.
    restitution : float
        e, in (0, 1].
    """
    k = _hertz(modulus, radius)
    loss = -math.log(number_in("restitution", restitution, 0.0, 1.0, open_low=True))
    beta = loss / math.hypot(math.pi, loss)
    # 2 √(5/6) √(2 E √R m) = √(20/3 · 3/4 K m)
    damping = beta * math.sqrt(5.0 * k * above_zero("mass", mass))
    return GeneralisedHuntCrossley(K=k, n=1.5, B=damping, p=0.25)


def chrono_hertz(
    *,
    stiffness: float,
    damping: float,
    radius: float,
    mass: float,
) -> GeneralisedHuntCrossley:
    """Return F = R √x (kₙ x + m gₙ v): Chrono's SMC Hertz with user-defined coefficients.

    K = R kₙ, B = R m gₙ, n = 1.5, p = 0.5: Kelvin–Voigt half-space damping. LAMMPS gran/hertz has
    √R in place of R: pass √R.

    Parameters
    ----------
    stiffness, damping : float
        kₙ, N/m^2.5, > 0, and gₙ, 1/(s·m^1.5), ≥ 0.
    radius, mass : float
        Effective radius and mass, m and kg, > 0.
    """
    scale = above_zero("radius", radius)
    damper = above_zero("mass", mass) * not_below_zero("damping", damping)
    return GeneralisedHuntCrossley(
        K=scale * above_zero("stiffness", stiffness),
        n=1.5,
        B=scale * damper,
        p=0.5,
    )


def _hertz(modulus: float, radius: float) -> float:
    return 4.0 / 3.0 * math.sqrt(above_zero("radius", radius)) * above_zero("modulus", modulus)
