"""One recording with one fault: whether the result was wrong, and whether palpate warned."""

import math
import re
from dataclasses import dataclass

from benchmarks.diagnosis.faults import Fault
from benchmarks.diagnosis.probing import Probing, measured, probing
from palpate import GeneralisedHuntCrossley, RecordingError, identify
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
        The checks of :func:`named_by`, the most severe first.
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
    printed_s, printed_c = found.working_depth.stiffness, found.working_depth.damping
    stiffness, damping = printed_s.value, printed_c.value
    wrong_s, wrong_c = stiffness / made.stiffness - 1.0, damping / made.damping - 1.0
    lie = _wrong(stiffness - made.stiffness, printed_s.whole_error, made.stiffness)
    lie |= _wrong(damping - made.damping, printed_c.whole_error, made.damping)
    # K, B and n of another law are other numbers.
    comparable = made.law_is_true and type(law) is type(made.law)
    parameters = comparable and any(
        _wrong(given - true, error, true)
        for given, true, error in zip(law.parameters, made.law.parameters, errors, strict=True)
    )
    return Outcome(
        found.verdict.overall,
        named_by(result),
        lie or fault.stops,
        parameters,
        bool(result.flags),
        wrong_s,
        wrong_c,
        _in_bars(stiffness - made.law.stiffness_at(depth), printed_s.whole_error),
        _in_bars(damping - made.law.damping_at(depth), printed_c.whole_error),
        _delay(found),
        tuple(episode.start for episode in found.episodes[1:]),
        found.reason,
    )


def named_by(result: Identification) -> tuple[str, ...]:
    """Return checks whose findings are significant or cost a mark, and what the law itself says."""
    law, found = result.law, result.diagnosis.findings
    said = [f.check for f in found if f.severity != "note" or math.isfinite(f.z)]
    if isinstance(law, GeneralisedHuntCrossley):
        if law.relaxation_stiffness > 0.0:
            said.append("memory")
        if law.damping_exponent != law.exponent:
            said.append("damping form")
    return tuple(name for name in dict.fromkeys(said) if name != "precision")


def _delay(found: Diagnosis) -> float:
    """Return the delay in the message ``the force is 5.0 ± 0.1 ms late …``, s."""
    messages = [f.message for f in found.findings if f.check == "delay"]
    number = re.search(r"is (\S+) ± \S+ ms (late|early)", messages[0] if messages else "")
    if number is None:
        return math.nan
    return float(number[1]) * (1e-3 if number[2] == "late" else -1e-3)


def _in_bars(error: float, bar: float) -> float:
    return error / bar if bar > 0.0 else math.nan


def _wrong(error: float, bar: float, size: float) -> bool:
    return not (abs(error) <= ERRORS * bar or abs(error) <= LEAST * abs(size))
