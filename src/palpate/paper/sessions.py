"""Sessions at the laboratory's rig, and identification as the paper sets it."""

from functools import lru_cache

import numpy as np

from palpate import identifying
from palpate.contact import Contact
from palpate.estimators import ContactEstimator, RecursiveLeastSquaresEstimator
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import MATERIALS, TRAJECTORIES, Bench, Measurement, Trajectory
from palpate.settings import ContactGate, Scale
from palpate.validation import Floats

#: When the command leaves its pause, s; the paper's clock, in which contact is made at 2 s.
START = 2.0
#: Force of ten times its noise, which keeps the bias of the logarithm under 0.5 %.
GATE = ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
#: The paper computes in SI.
SI = Scale()


def session(
    material: str, trajectory: str | Trajectory, seed: int, seconds: float = 12.0
) -> Measurement:
    """Press a material of the lab with the twin pantograph; kept, for experiments share it."""
    motion = TRAJECTORIES[trajectory] if isinstance(trajectory, str) else trajectory
    return _pressed(material, motion, seed, seconds)  # type: ignore[arg-type]  # it is hashable


# As many as the experiments of a group press in one seed, and no more: each is megabytes.
@lru_cache(maxsize=16)
def _pressed(material: str, motion: Trajectory, seed: int, seconds: float) -> Measurement:
    return Bench(MATERIALS[material], motion).run(seed, seconds=seconds)


def pressed(
    material: str, trajectory: str | Trajectory, seed: int, seconds: float = 12.0
) -> Contact:
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
    return identifying.identify(contact, estimator.replace(**ours), trace="full")


def truth_of(material: str) -> Floats:
    """Return K, B and n of a material of the lab that follows Hunt and Crossley."""
    truth = MATERIALS[material].describe()
    return np.array([truth[name] for name in HuntCrossley.names()])
