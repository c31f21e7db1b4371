"""The skew between the clocks of force and position, and what shows it.

A skew δ is a force that is δ late. For a law that relaxes, and for the damper of a half-space,
B′ = B − K′ δ exactly: no recording of the material shows it. A touch of a spring shows it, or
a payload that turns in free air, or a clock that both share; the contact's delay holds it.
"""

from typing import NamedTuple

from palpate.diagnosis.fit import Fit
from palpate.digits import rounded
from palpate.findings import Check
from palpate.force_laws import ForceLaw
from palpate.remedies import NextStep

#: Skew between force and position that is assumed possible if nothing is known of their clocks, s.
#: Half a sample at 66 Hz would instead give 140 % to a damping that repeats to 8 %.
USUAL_SKEW = 1e-3


class Clock(NamedTuple):
    """The skew that may be left between force and position.

    Attributes
    ----------
    error : float
        Its standard deviation, s; 0 if nothing but the fit of the law shows it.
    is_known : bool
        Whether something other than the contact's law shows it. No skew that is assumed makes the
        damping of a law that hides it safe to trust (``benchmarks.known_clock``).
    reason : str
        End of the sentence *the damping is known to ± 20 %, …*.
    remedy : NextStep
        What shows it better.
    """

    error: float
    is_known: bool
    reason: str
    remedy: NextStep


def clock_of(fit: Fit) -> Clock:
    """Return what is known of the clocks of a fit's recording."""
    applied = fit.data.contact.delay
    if applied is not None:
        two = applied.from_contact and has_two_clocks(fit)
        what = "clocks' offset" if two else "delay"
        remedy = NextStep.ONE_CLOCK if two and applied.found else NextStep.IN_STEP
        reason = f"by the standard error of the {what}"
        # Two clocks may be one: then a law that shows the skew knows it better than the offset.
        left_alone = applied.from_contact and not applied.found
        error = 0.0 if left_alone and shows_skew(fit) else applied.standard_error
        return Clock(error, not applied.from_contact, reason, remedy)
    least_delay = 0.0 if fit.response is None else fit.response.delay
    error = 0.0 if shows_skew(fit) else max(USUAL_SKEW, least_delay)
    reason = f"since {rounded(1e3 * error, 2)} ms of skew between force and position is possible"
    return Clock(error, False, reason, NextStep.IN_STEP)


def shows_skew(fit: Fit) -> bool:
    """Whether the law distinguishes a skew from damping.

    A skew τ adds K n xⁿ⁻¹ v τ, which differs from the damping force B xⁿ v of Hunt–Crossley but not
    from the force of half-space damping, of a linear damper or of a relaxation branch.
    """
    law: ForceLaw = fit.given.estimate.law
    return law.power_law


def has_two_clocks(fit: Fit) -> bool:
    """Whether palpate found the offset between the clocks of position and force."""
    return any(each.check == Check.CLOCK_OFFSET for each in fit.data.contact.findings)
