"""The everyday laws by samples that another method identified, to say whether one is better."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from palpate.contact import Contact
from palpate.diagnosis import Data, Laws
from palpate.estimators import ContactEstimator, ViscoelasticContact
from palpate.force_laws import HuntCrossley, KelvinVoigt
from palpate.relaxing import placed
from palpate.replaying import choices
from palpate.stages import timed


def laws_beside(data: Data, estimator: ContactEstimator, chosen: Sequence[str]) -> Laws | None:
    """Which law it is; None where the identified one is none of those that are compared.

    Methods of one contact that were given the same share the answer.

    Parameters
    ----------
    data : Data
        The contact.
    estimator : ContactEstimator
        As it stood at the end. What it was given of which samples are contact, and of the
        exponent, holds for the other laws too.
    chosen : sequence of str
        Its settings that were chosen from the data, for its own method.
    """
    if isinstance(estimator, ViscoelasticContact):
        return Laws.of(estimator, own=True)
    estimate = estimator.estimate()
    if not isinstance(estimate.law, HuntCrossley | KelvinVoigt):
        return None
    given = {name: value for name, value in estimator.settings.items() if name not in chosen}
    names = ("gate", "outlier_rejection", "exponent")
    key = repr([*(given.get(name) for name in names), estimate.surface])
    if key not in data.laws:
        data.laws[key] = Laws.of(_compared(data.contact, given, estimate.surface))
    return data.laws[key]


@timed("laws")
def _compared(contact: Contact, given: dict[str, Any], surface: float) -> ViscoelasticContact:
    kept = given.get("exponent")
    low, high = ViscoelasticContact.exponents
    bank = ViscoelasticContact(
        gate=given.get("gate"),
        outlier_rejection=given.get("outlier_rejection"),
        exponent=kept if kept is not None and low <= kept <= high else None,
    )
    below = replace(contact, penetration=contact.penetration - surface) if surface else contact
    return placed(below, bank.replace(**choices(below, bank)))
