"""Every reference simulator: which engine, what was set in it, and what it then showed."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from palpate import Contact, ForceLaw, HuntCrossley, KelvinVoigt
from peers import drake_probe, opensim_probe
from peers.carriage import Probe, probed
from peers.drake_probe import DrakeProbe
from peers.opensim_probe import OpenSimProbe

NOISE = 0.05  # N, the noise band of the paper's sensor


@dataclass(frozen=True)
class ReferenceSimulator:
    """An engine, and the law that its documentation says was set in it."""

    make: Callable[[], Probe]
    law: HuntCrossley | KelvinVoigt


HUNT_CROSSLEY = {
    **{
        f"drake-{stepping}": ReferenceSimulator(
            partial(DrakeProbe, stepping), drake_probe.HUNT_CROSSLEY
        )
        for stepping in ("continuous", "tamsi", "lagged", "similar")
    },
    "opensim": ReferenceSimulator(OpenSimProbe, opensim_probe.HUNT_CROSSLEY),
}
KELVIN_VOIGT = {
    "drake-sap": ReferenceSimulator(partial(DrakeProbe, "sap"), drake_probe.KELVIN_VOIGT)
}
REFERENCE_SIMULATORS = {**HUNT_CROSSLEY, **KELVIN_VOIGT}


@cache
def shown_by(name: str) -> Contact:
    """What this simulator showed; simulated once."""
    return probed(REFERENCE_SIMULATORS[name].make())


def sensed(contact: Contact, seed: int) -> Contact:
    """The same through a force sensor with white noise."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(contact))
    return dataclasses.replace(contact, force=contact.force + noise)


def beside(contact: Contact, law: ForceLaw) -> float:
    """How far a law's force is from the engine's in contact at most, of the largest."""
    touching = contact.force > 0.0
    assert touching.sum() > 5000
    error = law.force(contact.penetration, contact.velocity) - contact.force
    return float(np.abs(error)[touching].max() / contact.force.max())
