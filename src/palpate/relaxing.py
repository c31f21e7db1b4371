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
# Of the cost of a number. Memory that explains nothing costs a whole one more; of a material that
# relaxes more slowly than the first place can tell, the first finds some.
_SOME = 0.75
_MOST = 3  # places beyond the first: up to 260 000 sample times


@timed("relaxation times")
def placed(contact: Contact, bank: ViscoelasticContact) -> ViscoelasticContact:
    """Return a bank that has learned a contact, with the place of its relaxation times.

    They go from the sample time that it is given: the contact's own, unless a bank that begins
    later and ends later fits better by more than one number of the law would have to: 2 ln N_eff.
    None is tried where memory explains nothing by the first, nor one that lasts four times as long
    as the contact.

    Parameters
    ----------
    contact : Contact
        All of it.
    bank : ViscoelasticContact
        With the settings that were chosen; it is left as it is.
    """
    own, duration = contact.sample_time, float(contact.time_steps.sum())
    best = bank.replace(sample_time=own)
    replayed(contact, best, trace=False)
    # By the samples that count with the first: of what fits better others do.
    effective = max(best.evidence().effective_samples, math.e)
    forgets, remembers = _costs(best, effective)
    least, some = min(forgets, remembers), remembers < forgets + _SOME * _penalty(effective)
    for place in range(1, 1 + _MOST):
        step = own * _FURTHER**place
        if not some or _LONGEST * step >= _FURTHER * duration:
            break
        trial = bank.replace(sample_time=step)
        replayed(contact, trial, trace=False)
        cost = min(_costs(trial, effective)) + _penalty(effective)
        if cost < least:
            best, least = trial, cost
    return best


def _penalty(effective: float) -> float:
    return 2.0 * math.log(effective)


def _costs(bank: ViscoelasticContact, effective: float) -> tuple[float, float]:
    """What the best law without memory leaves, and the best with, with what their numbers cost."""
    costs = [math.inf, math.inf]
    for index, _, mean_square in bank.evidence().rows:
        law = CANDIDATES[int(index)]
        cost = effective * math.log(max(mean_square, sys.float_info.min))
        cost += _penalty(effective) * law.parameters
        costs[law.memory != "none"] = min(cost, costs[law.memory != "none"])
    return costs[0], costs[1]
