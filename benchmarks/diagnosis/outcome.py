"""One recording with one fault: whether the result was wrong, and whether palpate warned."""

import math
import re
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.faults import Fault
from benchmarks.diagnosis.probing import Probing, measured, probing
from palpate import RecordingError, identify
from palpate.diagnosis import Diagnosis
from palpate.identifying import Identification

ERRORS, LEAST = 3.0, 0.05  # a lie is off by more than so many standard errors, and by this fraction


@dataclass(frozen=True)
class Outcome:
    """The outcome of one recording.

    Attributes
    ----------
    overall : str
        The verdict; ``"refused"`` if it was not identified.
    named : tuple of str
        The checks of the findings that are more than a note, the most severe first.
    lie, parameters_lie : bool
        Whether stiffness or damping at working depth was wrong, and K, B or n.
    flagged : bool
        Whether a flag without a diagnosis would have warned.
    stiffness_error, damping_error : float
        Relative, at working depth.
    stiffness_deviation, damping_deviation : float
        The same in standard errors of the diagnosis.
    delay : float
        The delay in the message, s; NaN if none was found.
    changes : tuple of float
        Times of the reported changes of the material, s.
    sentence : str
        The reason of the verdict.
    """

    overall: str
    named: tuple[str, ...]
    lie: bool
    parameters_lie: bool
    flagged: bool
    stiffness_error: float = math.nan
    damping_error: float = math.nan
    stiffness_deviation: float = math.nan
    damping_deviation: float = math.nan
    delay: float = math.nan
    changes: tuple[float, ...] = ()
    sentence: str = ""


def outcome(fault: Fault, seed: int) -> Outcome:
    """Probe, damage, identify and diagnose."""
    made = probing(seed)
    if fault.before is not None:
        fault.before(made)
    measured(made)
    if fault.after is not None:
        fault.after(made)
    try:
        result = identify(made.contact)
    except RecordingError as error:
        return refused(error)
    return judged(made, result, fault)


def refused(error: RecordingError) -> Outcome:
    """Return the outcome of a recording that cannot be identified: no number, no lie."""
    words = str(error)
    return Outcome("refused", (), lie=False, parameters_lie=False, flagged=True, sentence=words)


def judged(made: Probing, result: Identification, fault: Fault) -> Outcome:
    """Compare an identification with the truth."""
    found, law, errors = result.diagnosis, result.law, result.estimate.standard_errors
    depth = found.working_depth.depth
    stiffness, damping = law.stiffness_at(depth), law.damping_at(depth)
    wrong_s, wrong_c = stiffness / made.stiffness - 1.0, damping / made.damping - 1.0
    bars = printed_errors(result, depth)
    lie = _wrong(stiffness - made.stiffness, bars[0], made.stiffness)
    lie |= _wrong(damping - made.damping, bars[1], made.damping)
    parameters = made.law_is_true and any(
        _wrong(given - true, error, true)
        for given, true, error in zip(law.parameters, made.law.parameters, errors, strict=True)
    )
    grave = tuple(f.check for f in found.findings if f.severity != "note")
    return Outcome(
        found.verdict.overall,
        grave,
        lie or fault.stops,
        parameters,
        bool(result.flags),
        wrong_s,
        wrong_c,
        (stiffness - made.law.stiffness_at(depth)) / found.working_depth.stiffness.standard_error,
        (damping - made.law.damping_at(depth)) / found.working_depth.damping.standard_error,
        _delay(found),
        tuple(episode.start for episode in found.episodes[1:]),
        found.reason,
    )


def _delay(found: Diagnosis) -> float:
    """Return the delay in the message ``the force is 5.0 ± 0.1 ms late …``, s."""
    grave = [f for f in found.findings if f.check == "delay" and f.severity != "note"]
    number = re.search(r"is (\S+) ± \S+ ms (late|early)", grave[0].message if grave else "")
    if number is None:
        return math.nan
    return float(number[1]) * (1e-3 if number[2] == "late" else -1e-3)


def printed_errors(result: Identification, depth: float) -> tuple[float, float]:
    """Return standard errors of stiffness and damping at a depth by the estimate's covariance."""
    law, covariance = result.law, result.estimate.covariance
    rows = []
    for k, value in enumerate(law.parameters):
        step = 1e-6 * abs(value) or 1e-9
        high, low = law.parameters, law.parameters
        high[k], low[k] = value + step, value - step
        pair = type(law)(*high), type(law)(*low)
        rows.append(
            [
                (pair[0].stiffness_at(depth) - pair[1].stiffness_at(depth)) / (2.0 * step),
                (pair[0].damping_at(depth) - pair[1].damping_at(depth)) / (2.0 * step),
            ]
        )
    gradient = np.array(rows).T
    errors = np.sqrt(np.maximum(np.diag(gradient @ covariance @ gradient.T), 0.0))
    return float(errors[0]), float(errors[1])


def _wrong(error: float, bar: float, size: float) -> bool:
    return not (abs(error) <= ERRORS * bar or abs(error) <= LEAST * abs(size))
