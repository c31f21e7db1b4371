"""From an identification to the numbers that follow from its law and its motion."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.diagnosis import Data
from palpate.errors import InvalidParameterError
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.quantities.elastic_modulus import ElasticModulus, elastic_modulus_of
from palpate.quantities.energy import EnergyLoss, energy_of
from palpate.quantities.passivity import Passivity, fastest_of, passivity_of
from palpate.quantities.restitution import Restitution, dissipation_of, restitution_of
from palpate.quantities.wanted import Derivable, Wanted
from palpate.quantities.work import Path, loops_of
from palpate.tips import Tip
from palpate.validation import number_in

# Usual times between samples: the way of a probe over a longer gap is not known.
LONGEST_GAP = 20.0


def path_of(result: Derivable) -> Path:
    """Return the samples that are finite and were not left out as outliers.

    Where the time goes on from one segment to the next, as from the approach of a force curve to
    its retract, the work does too.
    """
    contact, trace, estimate = result.contact, result.trace, result.estimate
    channels = contact.penetration, contact.velocity, contact.force
    kept = np.all(np.isfinite(channels), axis=0) & ~trace.rejected
    return Path(
        contact.time[kept],
        contact.penetration[kept] - estimate.surface,
        contact.velocity[kept],
        contact.force[kept] - estimate.offset,
        _going_on(contact)[kept],
        trace.taken[kept],
    )


def _going_on(contact: Contact) -> NDArray[np.int64]:
    """Numbers of the stretches between which the time jumps, or begins again."""
    usual = np.empty(len(contact))  # time between samples, which each segment may have its own of
    for part in contact.segments():
        steps = np.diff(contact.time[part])
        usual[part] = np.median(steps) if steps.size else contact.sample_time
    steps = np.diff(contact.time)
    known = (steps > 0.0) & (steps <= LONGEST_GAP * np.maximum(usual[1:], usual[:-1]))
    return np.concatenate([[0], np.cumsum(~known)])


def restitution_from(result: Derivable, speed: float | None) -> Restitution:
    """Return the restitution at a speed, m/s, or at the one that is wanted."""
    if speed is not None:
        number_in("speed", speed, 0.0, 1e6, open_low=True)
    fastest = fastest_of(result.contact.velocity[result.trace.taken])
    found, v0 = result.diagnosis, speed or result.wanted.impact_speed
    with _absurd_numbers():
        law = result.law
        if isinstance(law, GeneralisedHuntCrossley):
            law = law.simplest()
        own = [result.law.names().index(name) for name in law.names()]
        b = dissipation_of(law, result.covariance[np.ix_(own, own)], found.working_depth)
        trusted = found.verdict.damping != "do-not-trust"
        return restitution_of(law, b, fastest, v0, trusted=trusted)


def energy_from(result: Derivable) -> EnergyLoss:
    """Return the energy lost in the touches, or cycles, of a recording."""
    data, path = result.data or Data(result.contact), path_of(result)
    going_on = replace(result.contact, segment=_going_on(result.contact))
    checks = {each.check for each in result.diagnosis.findings}
    with _absurd_numbers():
        return energy_of(
            path,
            loops_of(going_on, path),
            result.law,
            result.diagnosis.working_depth.damping,
            force_noise=data.force_noise,
            depth_noise=data.penetration_noise,
            skewed="delay" in checks,
            drifting="offset drift" in checks,
        )


def passivity_from(result: Derivable) -> Passivity:
    """Return where the law pulls in the recorded motion."""
    data, there = result.data or Data(result.contact), result.diagnosis.working_depth
    with _absurd_numbers():
        return passivity_of(path_of(result), result.law, there, data.force_noise)


def elastic_modulus_from(
    result: Derivable, tip: Tip | None, poisson_ratio: float | None
) -> ElasticModulus:
    """Return Young's modulus for a tip, or for the one that is wanted."""
    tip = tip or result.wanted.tip
    ratio = result.wanted.poisson_ratio if poisson_ratio is None else poisson_ratio
    if tip is None:
        raise InvalidParameterError(
            "tip must be given, such as Sphere(radius=5e-3), here or by wanting(Wanted(tip=…))"
        )
    Wanted(tip=tip, poisson_ratio=ratio)  # which checks them
    depth = result.contact.penetration[result.trace.taken] - result.estimate.surface
    inside = depth[depth > 0.0]
    low, high = np.percentile(inside, (10.0, 90.0)).tolist() if inside.size else (math.nan,) * 2
    with _absurd_numbers():
        found = elastic_modulus_of(result.law, result.diagnosis, (low, high), tip, ratio)
    if found.refused or not result.fixed:
        return found
    given = "the exponent was given: that the tip is of this shape is not checked by it"
    return replace(found, remarks=(*found.remarks, given))


def _absurd_numbers() -> np.errstate:
    """Let what overflows, such as the square of 1e200 N, be not defined."""
    return np.errstate(all="ignore")
