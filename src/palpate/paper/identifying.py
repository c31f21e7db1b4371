"""Identification as the paper did it: every sample in contact is taken, outliers too."""

from palpate import identifying
from palpate.contact import Contact
from palpate.estimators import ContactEstimator
from palpate.identification import Identification


def identify(contact: Contact, estimator: ContactEstimator) -> Identification:
    """Identify a contact without leaving any of its samples out.

    Parameters
    ----------
    contact : Contact
        What was pressed.
    estimator : ContactEstimator
        Method and settings, of a compiled one.
    """
    return identifying.identify(contact, estimator.replace(outlier_rejection=False))
