"""What a verdict on laws leaves open, in words."""

from collections.abc import Sequence

from palpate.digits import rounded
from palpate.estimate import Estimate
from palpate.estimators.law_verdicts import Candidate, Standing
from palpate.force_laws import GeneralisedHuntCrossley, SingleRelaxation

# Evidence of less is not worth more than a bare mention (Kass & Raftery 1995).
_BARE_MENTION = 2.0


def tie_flags(standings: tuple[Standing, ...]) -> tuple[str, ...]:
    """Say of laws that fit as well as the best, none where there are none.

    A motion at one speed, such as an approach alone, distinguishes damper and spring by the noise.
    """
    tied = [str(each.candidate) for each in standings[1:] if each.score < _BARE_MENTION]
    if not tied:
        return ()
    return (
        f"the samples do not tell it from {' or '.join(tied)}, and the error bars are of the one "
        "law alone: press and let go, at several speeds",
    )


def waiting_flags(standings: tuple[Standing, ...], offered: Sequence[Candidate]) -> tuple[str, ...]:
    """Say that laws with memory are on offer and none competes yet: what there is may be one."""
    stand = {each.candidate for each in standings}
    if not stand or all(law.memory == "none" or law in stand for law in offered):
        return ()
    return (
        "no law with memory competes yet: five numbers fit any hundred samples; stiffness and "
        "damping may be those of one",
    )


#: Mean velocity over its root mean square, from which on a motion goes one way: 1 at one speed,
#: 0.90 of a half sine, 0 of whatever comes back.
ONE_WAY = 0.8


def motion_flags(standings: tuple[Standing, ...], one_way: float) -> tuple[str, ...]:
    """Say of a motion that passes each depth once that damper, memory and spring are alike.

    At one speed v all three are functions of the depth alone, x = vt.
    """
    if not standings or not abs(one_way) > ONE_WAY:
        return ()
    return (
        "the motion goes one way at nearly one speed: damping, memory and stiffness are "
        "distinguished by the shape of the law alone, and may be far off; press and let go, at "
        "several speeds",
    )


# Of the force at the mean depth that a law leaves: of HC's K′ 1 % took 0.8 standard errors, 3 % 3
# and 10 % 7, 20 seeds of three sines from out of contact to 13 mm.
_NOISY = 0.02


def gate_flags(
    standings: tuple[Standing, ...], estimate: Estimate, depth: float, shallowest: float | None
) -> tuple[str, ...]:
    """Say that light samples are taken by their own force, where noise is as large.

    Those that noise makes negative count as out of contact, and what is left is too firm: E(F | F >
    0) > F, and the stiffness too low.
    """
    law: GeneralisedHuntCrossley = estimate.law
    if shallowest is None or not (standings and depth > 0.0 and law.stiffness > 0.0):
        return ()
    n, noise = law.exponent, standings[0].rms_error
    force = law.stiffness * depth**n
    # Two deviations above none, one sample in forty is left out.
    if not (noise > _NOISY * force and force * (shallowest / depth) ** n < 2.0 * noise):
        return ()
    needed = 1e3 * depth * (3.0 * noise / force) ** (1.0 / n)
    return (
        f"light samples are taken by a force within the noise, which makes K′ and K too low: "
        f"gate=ContactGate(minimum_penetration=…) of {rounded(needed, 2)} mm, where the force is "
        "three times that",
    )


# Of the half second that is given up where samples begin in contact a third: 5 % of it are left.
_FORGOTTEN = 0.5 / 3.0


def memory_flags(estimate: Estimate, duration: float, *, begun: bool) -> tuple[str, ...]:
    """What the samples of so many seconds leave open of the memory.

    Parameters
    ----------
    estimate : Estimate
        Of a generalised law.
    duration : float
        Of its samples, s.
    begun : bool
        Whether they began in contact.
    """
    law: GeneralisedHuntCrossley = estimate.law
    if not law.remembers:
        return ()
    errors, flags = estimate.standard_errors, []
    if not errors[4] < 0.25 * (law.stiffness + law.relaxation_stiffness):
        flags.append("relaxation stiffness not identifiable: press quickly, and hold")
    if law.stiffness < 0.0:
        flags.append(
            "negative relaxed stiffness: where the material ends up once all has relaxed, these "
            "samples do not say; K′ and B′ at their own frequency they do: press from out of "
            "contact, and hold"
        )
    # The longest of the law's times: the only one, or the end of its spectrum.
    if begun and law.parameters[7] > _FORGOTTEN:
        flags.append(
            "the samples begin in contact, and longer than half a second is remembered: K and M "
            "may be off by twice their error bars; record from before the touch"
        )
    if isinstance(law.relaxation, SingleRelaxation):
        time = law.relaxation.time
        # A factor of e either way at two deviations.
        if not errors[7] < 0.5 * time:
            flags.append("relaxation time not identifiable: move at several speeds, and hold")
        if time > 0.5 * duration:
            flags.append("slow drift or relaxation: the time is longer than half of the samples")
    return tuple(flags)
