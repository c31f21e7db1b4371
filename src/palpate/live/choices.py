"""Settings, commands, states and counts of a running loop."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal, get_args

from palpate.errors import InvalidParameterError
from palpate.method.estimators import ESTIMATORS, ContactEstimator, estimator_named
from palpate.method.estimators.viscoelastic import Damping, Memory
from palpate.method.settings import ChangeDetector, ConstantForgetting, OutlierRejection
from palpate.validation import frozen, number_in, shown

#: Settings that are either off or at the library's default.
SWITCHES = {"outlier_rejection": OutlierRejection, "change_detector": ChangeDetector}
#: Numbers that only some methods have.
NUMBERS = ("stiffness_drift", "dissipation_drift", "exponent_drift")
#: Settings for the choice of laws; only an estimator that compares laws has them.
CHOICES = {"damping": get_args(Damping), "memory": get_args(Memory)}
#: Settings of the recording or the tip rather than the method: another method keeps them.
_KEPT = ("gate", "sample_time", "scale", "exponent", "outlier_rejection", "change_detector")


def main_settings(estimator: ContactEstimator) -> dict[str, Any]:
    """Return the settings that the user may change, as plain values.

    ``forgetting_factor`` is None if the method has another kind of forgetting or does not forget.
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


def default_settings() -> dict[str, dict[str, Any]]:
    """Return the default main settings of every method."""
    return {name: main_settings(kind()) for name, kind in ESTIMATORS.items()}


def chosen(estimator: ContactEstimator, options: dict[str, Any]) -> ContactEstimator:
    """Return a new estimator with the requested method and settings.

    Parameters
    ----------
    estimator : ContactEstimator
        The present one. A new method keeps the settings that concern the samples, such as the gate.
    options : dict
        ``method``, the settings of :func:`main_settings`, or settings of the method as objects.

    Raises
    ------
    InvalidParameterError
        There is no such method or setting, or a value is out of range.
    """
    wanted = dict(options)
    kind = estimator_named(wanted.pop("method", estimator.method))
    settings = kind().settings
    kept = estimator.settings
    if kind is not type(estimator):
        kept = {
            name: kept[name] for name in _KEPT if name in settings and kept.get(name) is not None
        }
    given = {}
    for name, value in wanted.items():
        if name != "forgetting_factor" and name not in settings:
            raise InvalidParameterError(f"{kind.method} has no setting {shown(name)}")
        given.update(_setting(name, value, settings))
    return kind(**{**kept, **given})


def _setting(name: str, value: Any, known: dict[str, Any]) -> dict[str, Any]:
    """Return a setting in the form that the constructor takes."""
    if name in SWITCHES and isinstance(value, bool):
        return {name: SWITCHES[name]() if value else None}
    if name in NUMBERS:
        return {name: number_in(name, value, 0.0, 1e6)}
    if name != "forgetting_factor":
        return {name: value}
    if "forgetting" not in known:
        raise InvalidParameterError("this method has no forgetting factor")
    return {"forgetting": known["forgetting"] if value is None else ConstantForgetting(value)}


# The user's commands to a running loop.

Name = Literal["tare", "hold", "resume", "reset", "estimator", "source", "depth", "record", "stop"]


@frozen
class LiveCommand:
    """One command.

    Attributes
    ----------
    name : str
        ``"tare"``, ``"hold"``, ``"resume"``, ``"reset"``, ``"estimator"`` (``method`` and its
        settings), ``"source"`` (an option that the source offers, such as the laboratory's
        material), ``"depth"`` (``value``: the working depth, m; None for the median), ``"record"``
        (``on``: whether to record, to a file that the recorder names) or ``"stop"``.
    options : dict
        Options of the command.
    """

    name: Name
    options: dict[str, Any] = field(default_factory=dict)


# The loop's state.


class State(IntEnum):
    """State of the loop; if several hold, the most severe."""

    FREE = 0
    """The probe is out of contact; the estimate is held."""
    CONTACT = 1
    """The probe is in contact; every sample updates the estimate."""
    HELD = 2
    """On hold at the user's request: samples do not update the estimate."""
    CHANGED = 3
    """The material has changed within the last second; the estimate was restarted."""
    INVALID = 4
    """The loop rejects samples: NaN, repeated, or with a jump in time."""
    LOST = 5
    """No samples arrive; the estimate is held."""
    TARING = 6
    """The force offset is being measured: keep the probe out of contact."""


# The loop's counts.


@dataclass(slots=True)
class LoopCounts:
    """Counts of the loop.

    Attributes
    ----------
    taken : int
        Samples from the source.
    learned : int
        Samples that updated the estimate.
    refused : int
        Rejected samples: not finite, out of range, or with an invalid time.
    silences : int
        Times that the source stopped sending.
    changes : int
        Detected changes of material.
    repeated : int
        Samples with the same time as the one before; rejected.
    disordered : int
        Samples earlier than the one before by less than a filter window; rejected.
    jumps : int
        Jumps of the source's clock, backwards or ahead of the elapsed time.
    gaps : int
        Gaps between samples that are longer than a filter window.
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
