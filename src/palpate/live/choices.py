"""What a person may choose of an estimator while it runs."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal

from palpate.errors import InvalidParameterError
from palpate.estimators import ESTIMATORS, ContactEstimator, estimator_named
from palpate.estimators.law_verdicts import DAMPINGS, MEMORIES
from palpate.settings import ChangeDetector, ConstantForgetting, OutlierRejection
from palpate.validation import number_in, shown

#: Settings that are either off or as the library has them.
SWITCHES = {"outlier_rejection": OutlierRejection, "change_detector": ChangeDetector}
#: Numbers that only some methods have.
NUMBERS = ("stiffness_drift", "dissipation_drift", "exponent_drift")
#: Which laws an estimator that compares them offers.
CHOICES = {"damping": ("auto", *DAMPINGS), "memory": ("auto", "any", *MEMORIES)}
#: Of the recording or the tip rather than the method: another method has them too.
_KEPT = ("gate", "sample_time", "scale", "exponent", "outlier_rejection", "change_detector")


def main_settings(estimator: ContactEstimator) -> dict[str, Any]:
    """Return the settings that a person may change, as plain values.

    ``forgetting_factor`` is NaN-free: None where the method forgets in its own way, or not at all.
    """
    settings = estimator.settings
    found: dict[str, Any] = {
        name: settings[name] is not None for name in SWITCHES if name in settings
    }
    found |= {name: settings[name] for name in (*NUMBERS, *CHOICES) if name in settings}
    if "forgetting" in settings:
        forgetting = settings["forgetting"]
        constant = isinstance(forgetting, ConstantForgetting)
        found["forgetting_factor"] = forgetting.factor if constant else None
    return found


def offered() -> dict[str, dict[str, Any]]:
    """Return every method with the main settings that it begins with."""
    return {name: main_settings(kind()) for name, kind in ESTIMATORS.items()}


def chosen(estimator: ContactEstimator, options: dict[str, Any]) -> ContactEstimator:
    """Return an estimator that has learned nothing, as a person asked for it.

    Parameters
    ----------
    estimator : ContactEstimator
        The one until now; of another method what concerns the samples is kept, such as the gate.
    options : dict
        ``method``; what :func:`main_settings` names; or settings of the method, as objects.

    Raises
    ------
    InvalidParameterError
        There is no such method or setting, or a value is out of range.
    """
    wanted = dict(options)
    kind = estimator_named(wanted.pop("method", estimator.method))
    known = kind().settings
    kept = estimator.settings
    if kind is not type(estimator):
        there = (name for name in _KEPT if name in known and kept.get(name) is not None)
        kept = {name: kept[name] for name in there}
    given = {}
    for name, value in wanted.items():
        if name != "forgetting_factor" and name not in known:
            raise InvalidParameterError(f"{kind.method} has no setting {shown(name)}")
        given.update(_setting(name, value, known))
    return kind(**{**kept, **given})


def _setting(name: str, value: Any, known: dict[str, Any]) -> dict[str, Any]:
    """One setting as the constructor takes it."""
    if name in SWITCHES and isinstance(value, bool):
        return {name: SWITCHES[name]() if value else None}
    if name in NUMBERS:
        return {name: number_in(name, value, 0.0, 1e6)}
    if name != "forgetting_factor":
        return {name: value}
    if "forgetting" not in known:
        raise InvalidParameterError("this method has no forgetting factor")
    return {"forgetting": known["forgetting"] if value is None else ConstantForgetting(value)}


# What a person asks of a running loop.

Name = Literal["tare", "hold", "resume", "reset", "estimator", "source", "record", "stop"]


@dataclass(frozen=True, slots=True)
class LiveCommand:
    """One request.

    Attributes
    ----------
    name : str
        ``"tare"``, ``"hold"``, ``"resume"``, ``"reset"``, ``"estimator"`` (``method`` and its
        settings), ``"source"`` (what the source itself offers, such as the laboratory's material),
        ``"record"`` (``path``; or ``on``: whether to record, to a path of the recorder's own
        choice) or ``"stop"``.
    options : dict
        What goes with it.
    """

    name: Name
    options: dict[str, Any] = field(default_factory=dict)


# What a person sees of the loop at a glance.


class State(IntEnum):
    """One at a time, the gravest that holds."""

    FREE = 0
    """The probe touches nothing."""
    CONTACT = 1
    """It touches, and the estimate is refreshed."""
    HELD = 2
    """On request: nothing is learned until it is resumed."""
    CHANGED = 3
    """The material has changed within the last second; the estimate was reinitialised."""
    INVALID = 4
    """Samples come that cannot be taken: NaN, repeated, or with a jump in time."""
    LOST = 5
    """No sample has come for a while; the estimate is held."""
    TARING = 6
    """The force without contact is measured: touch nothing."""


# What the loop counts.


@dataclass(slots=True)
class LoopCounts:
    """What the loop itself counted.

    Attributes
    ----------
    taken : int
        Samples that came from the source.
    learned : int
        Of them, those that the estimator took.
    refused : int
        Those that were not finite, out of range, or had an impossible time.
    silences : int
        How often the source went silent.
    changes : int
        How often the material changed.
    repeated : int
        Samples of the same time as the one before; refused.
    disordered : int
        Samples that are earlier than the one before, by less than a window; refused.
    jumps : int
        How often the source's clock was set: back, or further ahead than time went.
    gaps : int
        How often samples were missing for longer than a window.
    """

    taken: int = 0
    learned: int = 0
    refused: int = 0
    silences: int = 0
    changes: int = 0
    repeated: int = 0
    disordered: int = 0
    jumps: int = 0
    gaps: int = 0
