"""For how long a material relaxes: the place of the relaxation times, by a whole contact."""

import math
import sys

from palpate.contact import Contact
from palpate.estimators import ViscoelasticContact
from palpate.estimators.law_verdicts import CANDIDATES
from palpate.replaying import replayed
from palpate.stages import timed

# In sample times: where the last relaxation time's part of a spectrum ends.
_LONGEST = 4096.0
# From one place to the next: the everyday bank's times are as far apart.
_FURTHER = 4.0
_MOST = 3  # places beyond the first: up to 260 000 sample times


@timed("relaxation times")
def suggest_sample_time(contact: Contact, bank: ViscoelasticContact) -> float:
    """Choose the sample time that a bank is to have, s, from which its relaxation times go.

    That of the contact, unless a bank that begins later and ends later fits better by more than
    one number of the law would have to: 2 ln N_eff. None is tried that lasts four times as long as
    the contact.

    Parameters
    ----------
    contact : Contact
        All of it.
    bank : ViscoelasticContact
        With the settings that were chosen; it is left as it is.
    """
    own, duration = contact.sample_time, float(contact.time_steps.sum())
    if all(law.memory == "none" for law in bank.offered):
        return own
    best, least, effective = own, math.inf, math.nan
    for place in range(1 + _MOST):
        step = own * _FURTHER**place
        if place and _LONGEST * step >= _FURTHER * duration:
            break
        trial = bank.replace(sample_time=step)
        replayed(contact, trial, trace=False)
        evidence = trial.evidence()
        if not evidence.rows:
            break
        if not place:
            # By the samples that count with the first: of what fits better others do.
            effective = max(evidence.effective_samples, math.e)
        penalty = 2.0 * math.log(effective)
        cost = min(
            effective * math.log(max(mean_square, sys.float_info.min))
            + penalty * CANDIDATES[int(index)].parameters
            for index, _, mean_square in evidence.rows
        )
        if place == 0 or cost + penalty < least:
            best, least = step, cost + (penalty if place else 0.0)
    return best
