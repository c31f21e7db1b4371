"""Sessions at the laboratory's rig, and identification as the paper sets it."""

from functools import lru_cache

from palpate import identifying
from palpate.contact import Contact
from palpate.estimators import ContactEstimator, RecursiveLeastSquaresEstimator
from palpate.identification import Identification
from palpate.lab import MATERIALS, TRAJECTORIES, Bench, Measurement
from palpate.settings import ContactGate, Scale

#: When the command leaves its pause, s; the paper's clock, in which contact is made at 2 s.
START = 2.0
#: Force of ten times its noise, which keeps the bias of the logarithm under 0.5 %.
GATE = ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
#: The paper computes in SI.
SI = Scale()


def session(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Measurement:
    """Press a material of the lab with the twin pantograph; kept, for experiments share it."""
    # A default that is left out would be another entry of the cache.
    return _pressed(material, trajectory, seed, seconds)


# As many as the experiments of a group press in one seed, and no more: each is megabytes.
@lru_cache(maxsize=16)
def _pressed(material: str, trajectory: str, seed: int, seconds: float) -> Measurement:
    return Bench(MATERIALS[material], TRAJECTORIES[trajectory]).run(seed, seconds=seconds)


def pressed(material: str, trajectory: str, seed: int, seconds: float = 12.0) -> Contact:
    """Return the part of a session after the pause, as recorded."""
    return session(material, trajectory, seed, seconds).contact.window(START)


def identified(contact: Contact, estimator: ContactEstimator, **settings: object) -> Identification:
    """Identify on the samples above the noise, outliers too; the paper's methods in SI.

    Parameters
    ----------
    contact : Contact
        What was pressed.
    estimator : ContactEstimator
        Method and settings, of a compiled one.
    **settings
        Other ones than that.
    """
    paper = {"scale": SI} if isinstance(estimator, RecursiveLeastSquaresEstimator) else {}
    ours = {"gate": GATE, "outlier_rejection": False, **paper, **settings}
    return identifying.identify(contact, estimator.replace(**ours))
