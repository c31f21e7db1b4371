"""The gains for a result: what an identification knows of the contact, and the answer."""

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from palpate.control_loops.answer import Gains
from palpate.control_loops.laws import ContactKnowledge, KnownLaw
from palpate.control_loops.loop import ControlLoop
from palpate.control_loops.margins import gains_for
from palpate.errors import InvalidParameterError, RecordingError
from palpate.identifying import Identification, identify
from palpate.method.contact import Contact
from palpate.method.estimators import (
    ContactEstimator,
    KelvinVoigtRLS,
    VariableProjection,
    ViscoelasticContact,
)
from palpate.output.results.saved import SavedResult
from palpate.validation import Floats, instance

Known: TypeAlias = Identification | SavedResult

#: A law is excluded if its score is this much worse: e⁵ to 1, strong evidence.
_EXCLUDED = 10.0
# Share of the velocity's power up to the highest frequency of a motion. Of 10 000 frequencies the
# power of white noise exceeds 20 times its median at none.
_MOTION_SHARE = 0.9
_ABOVE_NOISE = 20.0
# A sine counts if it has a hundredth of the largest one's amplitude, as the steps of an encoder are
# not white. The first frequencies are those of the window.
_VISIBLE_SHARE = 1e-4
_WINDOW = 3
# A damping without an error bar may be anything between none and twice the identified one.
_LARGEST_ERROR = 1.0


def gains(result: Known, loop: ControlLoop) -> Gains:
    """Return whether the gains of a control loop are safe on an identified contact.

    The margin is that of the exactly sampled and delayed loop at the depth where the contact has
    the wanted force; the first touch is simulated. The bound is the least over 64 draws of each law
    that the recording does not exclude, with the damping beyond the recorded frequencies as
    identified, falling as 1/ω, and zero.

    Parameters
    ----------
    result : Identification or SavedResult
        The contact.
    loop : ControlLoop
        :class:`palpate.control_loops.AdmittanceControl`, ``ImpedanceControl`` or ``ForceControl``.

    Returns
    -------
    Gains
        Verdict, gain margin with its bound, and recommended gains.

    Raises
    ------
    InvalidParameterError
        ``result`` or ``loop`` has another type, or the contact has no time.

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> loop = control_loops.ImpedanceControl(
    ...     stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
    ...     wanted_force=10.0, approach_speed=0.02,
    ... )
    >>> palpate.gains(palpate.identify("examples/recordings/ball.csv"), loop).verdict
    'safe'
    """
    instance("loop", loop, ControlLoop)
    return gains_for(contact_knowledge(result), loop)


def contact_knowledge(result: Known) -> ContactKnowledge:
    """Return what an identification knows of a contact.

    The laws are the identified one, Hunt and Crossley's, and each that the evidence does not
    exclude, identified from the same samples.

    Parameters
    ----------
    result : Identification or SavedResult
        The contact.

    Returns
    -------
    ContactKnowledge
        For :func:`gains_for`.

    Raises
    ------
    InvalidParameterError
        ``result`` has another type, or its contact has no time.

    Examples
    --------
    >>> import palpate
    >>> from palpate import control_loops
    >>> result = palpate.identify("examples/recordings/ball.csv")
    >>> [known.law.kind for known in control_loops.contact_knowledge(result).laws]
    ['hunt-crossley']
    """
    instance("result", result, (Identification, SavedResult))
    contact = result.contact
    if contact.timeless:
        raise InvalidParameterError("result has no time, and so no damping: record time as well")
    at = result.working_depths[0]
    mark = at.stiffness.mark or "do-not-trust"
    if mark == "do-not-trust":  # no number of it is used
        return ContactKnowledge((), result.frequency, math.nan, mark)
    highest = _highest_frequency(contact)
    if not (highest > 0.0 and result.frequency > 0.0):
        raise InvalidParameterError("result is of a probe held still: record a motion in contact")
    identified = [(result.law, _covariance(result))] if result.law.powers is not None else []
    for estimator in _other_estimators(result):
        try:
            other = identify(contact, estimator, trace=False)
        except RecordingError:  # too few samples for this law
            continue
        identified.append((other.law, other.covariance))
    stiffness_error = _relative(at.stiffness.systematic, at.stiffness.value)
    damping_error = _relative(at.damping.systematic, at.damping.value)
    laws = tuple(KnownLaw(*each, at.depth, stiffness_error, damping_error) for each in identified)
    pressed = contact.force[contact.penetration > 0.0]
    largest = float(np.quantile(pressed[np.isfinite(pressed)], 0.99))
    return ContactKnowledge(laws, result.frequency, largest, mark, highest)


def _highest_frequency(contact: Contact) -> float:
    """Return the frequency below which 90 % of the power of the velocity in contact lies, rad/s.

    Frequencies at which the penetration is not above its noise do not count.
    """
    order = np.argsort(contact.time, kind="stable")
    time = contact.time[order]
    depth = contact.penetration[order]
    known = np.isfinite(depth)
    even = np.arange(time[0], time[-1], contact.sample_time)
    inside = np.interp(even, time[known], np.maximum(depth[known], 0.0)) * np.hanning(len(even))
    power = np.abs(np.fft.rfft(inside)) ** 2
    frequency = 2.0 * np.pi * np.fft.rfftfreq(len(even), contact.sample_time)
    noise = np.median(power[len(power) // 2 :])
    visible = max(_ABOVE_NOISE * noise, _VISIBLE_SHARE * power[_WINDOW:].max(initial=0.0))
    moved = np.where(power > visible, frequency**2 * power, 0.0)
    below = np.searchsorted(np.cumsum(moved), _MOTION_SHARE * moved.sum())
    return float(frequency[min(int(below), len(frequency) - 1)])


def _relative(error: float, value: float) -> float:
    ratio = abs(error / value) if value else math.inf
    return min(ratio, _LARGEST_ERROR) if math.isfinite(ratio) else _LARGEST_ERROR


def _covariance(result: Known) -> Floats:
    if isinstance(result, Identification):
        return result.covariance
    errors = result.standard_errors
    return np.nan_to_num(result.correlations) * np.outer(errors, errors)


def _other_estimators(result: Known) -> Iterator[ContactEstimator]:
    """Yield the estimators of the laws without memory that are not excluded, besides its own."""
    known = {"exponent": result.law.n} if "n" in result.fixed else {}
    verdict = result.law_verdict
    if result.law.kind != "hunt-crossley":
        yield VariableProjection(**known)
    if verdict is None or not verdict.known:
        yield ViscoelasticContact(damping="half-space", memory="none", **known)
        return
    for ranked in verdict.model_ranking:
        law = ranked.candidate
        excluded = ranked.score >= _EXCLUDED or law.memory != "none"
        if excluded or law.damping != "half-space" or law == verdict.candidate:
            continue
        if law.linear:
            yield KelvinVoigtRLS()
        else:
            yield ViscoelasticContact(damping="half-space", memory="none", **known)
