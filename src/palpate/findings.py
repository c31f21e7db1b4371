"""Findings: messages with a severity, a remedy and their effect on the result, and their ids."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Flag, StrEnum, auto
from typing import Any, Literal, TypeAlias

from palpate.remedies import Remedy, stated
from palpate.spelling import spell_advice
from palpate.validation import Plain, or_nan

Mark: TypeAlias = Literal["trust", "with-care", "do-not-trust"]
Severity: TypeAlias = Literal["note", "with-care", "do-not-trust"]
#: From the best to the worst.
MARKS: tuple[Mark, ...] = ("trust", "with-care", "do-not-trust")
#: Overall verdicts for the marks in MARKS, in the same order.
SEVERITIES: tuple[Severity, ...] = ("note", "with-care", "do-not-trust")


class Holds(Flag):
    """Limits that a finding is not subject to: the error bars, or a recording without time."""

    # It may lower a mark below the one that the error bars give, because no error bar covers it.
    CAPS = auto()
    TIMELESS = auto()  # it concerns neither time nor damping


CAPS, TIMELESS = Holds


class Check(StrEnum):
    """The id of every check, with its subject: a heading of ``docs/diagnosis.md``.

    The sentence of a finding is written in the file that makes the finding. A finding that may not
    cap a mark only changes error bars.
    """

    subject: str
    holds: Holds

    CHANNELS = "channels", "recording", CAPS | TIMELESS
    CLOCK = "clock", "recording", TIMELESS
    CLOCK_OFFSET = "clock offset", "recording", CAPS
    EPISODES = "episodes", "recording", TIMELESS
    FILE = "file", "recording", CAPS
    OPTIONS = "options", "recording", TIMELESS
    ROWS = "rows", "recording", CAPS | TIMELESS
    REJECTED_SAMPLES = "rejected samples", "recording", TIMELESS
    TRANSFORMS = "transforms", "recording", TIMELESS
    VECTORS = "vectors", "recording", CAPS | TIMELESS
    IGNORED = "ignored channels", "recording", TIMELESS
    UNITS = "units", "recording", CAPS | TIMELESS
    PENETRATION_UNIT = "penetration unit", "recording", CAPS | TIMELESS
    FORCE_UNIT = "force unit", "recording", CAPS | TIMELESS
    TIME_UNIT = "time unit", "recording", CAPS
    SIGNS = "signs", "recording", CAPS | TIMELESS
    VELOCITY_COLUMN = "velocity column", "recording", CAPS
    TIME_STAMPS = "time stamps", "recording", CAPS
    HELD_CHANNEL = "held channel", "recording", CAPS
    FORCE_JUMP = "force jump", "recording", CAPS | TIMELESS
    SPIKES = "spikes", "recording", CAPS | TIMELESS
    COARSE_STEPS = "coarse steps", "recording", TIMELESS
    NO_TIME = "no time", "recording", CAPS | TIMELESS
    OUTLIERS = "outliers", "recording", CAPS | TIMELESS
    PEAK_FORCE = "peak force", "recording", TIMELESS
    SATURATION = "saturation", "sensor", CAPS | TIMELESS
    SATURATED_AXIS = "saturated axis", "sensor", CAPS | TIMELESS
    STUCK_FORCE = "stuck force", "sensor", CAPS | TIMELESS
    DEAD_BAND = "dead band", "sensor", TIMELESS
    OFFSET = "offset", "sensor", TIMELESS
    BASELINE = "baseline", "sensor", TIMELESS
    OFFSET_PRIOR = "offset prior", "sensor", TIMELESS
    OFFSET_DRIFT = "offset drift", "sensor"
    SENSOR_GAIN = "sensor gain", "sensor"
    INERTIA = "inertia", "sensor"
    MOVING_MASS = "moving mass", "sensor", CAPS
    FREE_AIR = "free air", "sensor"
    TARE = "tare", "sensor", TIMELESS
    NO_TARE = "no tare", "sensor", TIMELESS
    PAYLOAD = "payload", "sensor", CAPS | TIMELESS
    ZEROED = "zeroed sensor", "sensor", TIMELESS
    FORCE_AXES = "force axes", "sensor", TIMELESS
    FORCE_FRAME = "force frame", "sensor", CAPS | TIMELESS
    VELOCITY_NOISE = "velocity noise", "sensor"
    DELAY = "delay", "sensor"
    SKEW_JUMP = "skew jump", "sensor"
    SKEW = "skew", "sensor"
    LATE_FORCE = "late force", "sensor", CAPS
    ADHESION = "adhesion", "material", CAPS
    PULL_OFF = "pull-off", "material", TIMELESS
    CHANGE = "change", "material", CAPS
    SLOW_CHANGE = "slow change", "material"
    MEMORY = "memory", "material"
    RELAXED_STIFFNESS = "relaxed stiffness", "material"
    UNKNOWN_LAW = "unknown law", "material", CAPS | TIMELESS
    FRICTION = "friction", "material"
    GUIDE_FRICTION = "guide friction", "sensor"
    DAMPING_FORM = "damping form", "material"
    DAMPING_WITH_DEPTH = "damping with depth", "material"
    SHAPE = "shape", "material"
    SQUARE_SPEED = "square speed", "material"
    NEGATIVE_STIFFNESS = "negative stiffness", "material", TIMELESS
    NEGATIVE_DAMPING = "negative damping", "material"
    SURFACE = "surface", "geometry"
    SURFACE_RANGE = "surface range", "geometry", TIMELESS
    LOAD_TRANSFER = "load transfer", "geometry", CAPS | TIMELESS
    DIRECTION = "direction", "geometry", CAPS | TIMELESS
    ORIENTATION = "orientation", "geometry", CAPS | TIMELESS
    LOST_CONTACT = "lost contact", "geometry", TIMELESS
    UNSEEN = "unseen", "geometry"
    CONTACT_POINT = "contact point", "geometry", CAPS | TIMELESS
    TIP_SHAPE = "tip shape", "geometry", CAPS | TIMELESS
    INDENTATION = "indentation", "geometry", CAPS | TIMELESS
    EXCITATION = "excitation", "motion", CAPS | TIMELESS
    ONE_WAY = "one way", "motion", CAPS | TIMELESS
    LOADING_ALONE = "loading alone", "motion", CAPS | TIMELESS
    DEPTH = "depth", "motion", CAPS | TIMELESS
    WEAK_PRIOR = "weak prior", "motion", CAPS
    LIGHT_CONTACT = "light contact", "motion", TIMELESS
    EXPONENT = "exponent", "motion", TIMELESS
    EXPONENT_RANGE = "exponent range", "motion", TIMELESS
    DAMPING = "damping", "motion"
    TRACKING = "tracking", "motion"
    FORECAST = "forecast", "fit", CAPS
    HOLD_OUT = "hold-out", "fit", CAPS
    MISFIT = "misfit", "fit", CAPS
    METHOD = "method", "fit"
    PRECISION = "precision", "fit", CAPS
    PREDICTION = "prediction", "fit"
    STANDARD_ERRORS = "standard errors", "fit"
    CONDITION_10 = "condition 10", "fit"
    GUARD = "guard", "fit", TIMELESS
    REQUESTED_LAW = "requested law", "fit"
    WHICH_LAW = "which law", "fit"
    UNSETTLED_LAW = "unsettled law", "fit"
    CORRELATED_RESIDUALS = "correlated residuals", "fit"
    NO_DAMPER = "no damper", "fit"
    CONVERGENCE = "convergence", "fit"
    MODULUS = "modulus", "fit", CAPS | TIMELESS
    ENGINE = "engine", "export"

    def __new__(cls, title: str, subject: str, holds: Holds | None = None) -> "Check":
        """Return the id, which is its title, with its subject."""
        check = str.__new__(cls, title)
        check._value_ = title
        check.subject = subject
        check.holds = holds or Holds(0)
        return check

    @property
    def may_cap(self) -> bool:
        """Whether it may lower a mark below the one that the error bars give."""
        return CAPS in self.holds

    @property
    def holds_without_time(self) -> bool:
        """Whether it concerns neither time nor damping."""
        return TIMELESS in self.holds

    def finding(
        self,
        message: str,
        remedy: Remedy | str | None = None,
        z: float = math.nan,
        *,
        severity: Severity = "note",
        mark: Mark = "trust",
        stiffness: Mark | None = None,
        damping: Mark | None = None,
        moves_percent: tuple[float, float] = (math.nan, math.nan),
        brief: str = "",
    ) -> "Finding":
        """Return the finding of the check; the arguments are fields of :class:`Finding`.

        Parameters
        ----------
        mark : str
            Mark of stiffness and damping, unless they are passed separately.
        moves_percent : tuple of float
            Change of stiffness and damping, in per cent of their size.
        """
        marks: tuple[Mark, Mark] = stiffness or mark, damping or mark
        step = remedy if remedy is None or isinstance(remedy, Remedy) else stated(remedy)
        return Finding(self, message, step, severity, z, *marks, *moves_percent, brief)

    def __repr__(self) -> str:
        return repr(self.value)


CHECKS_BY_ID: Mapping[str, Check] = {check.value: check for check in Check}
#: Checks whose findings may lower a mark below the one that the error bars give.
MAY_CAP = frozenset(check for check in Check if check.may_cap)
#: Checks that concern neither time nor damping.
HOLD_WITHOUT_TIME = frozenset(check for check in Check if check.holds_without_time)


def worst(*marks: Mark) -> Mark:
    """Return the worst of some marks; *trust* without any."""
    return MARKS[max(map(MARKS.index, marks), default=0)]


def spoken(mark: str) -> str:
    """Return a mark as text: *with care*."""
    return mark.replace("-", " ")


@dataclass(frozen=True, slots=True)
class Finding(Plain):
    """One message about a recording, its preparation or its identification.

    Attributes
    ----------
    check : str
        The id of the :class:`Check`, such as ``"delay"``, or of a check of your own.
    message : str
        One sentence about what happened.
    remedy : Remedy or None
        The next step: one sentence, perhaps with arguments, or on the command line options.
    severity : str
        ``"note"``, ``"with-care"`` or ``"do-not-trust"``: the overall verdict is at least this. It
        follows the marks: the mark of the stiffness counts in full, an untrusted damping calls for
        care.
    z : float
        Significance, in standard errors; NaN if the check has none.
    stiffness, damping : str
        The marks at working depth due to this finding alone: ``"trust"``, ``"with-care"`` or
        ``"do-not-trust"``.
    moves_stiffness_percent, moves_damping_percent : float
        Change of stiffness and damping, in per cent of their size; NaN if unknown.
    brief : str
        A shorter message for the line of a number; empty if the message is short enough.
    """

    check: str
    message: str
    remedy: Remedy | None = None
    severity: Severity = "note"
    z: float = math.nan
    stiffness: Mark = "trust"
    damping: Mark = "trust"
    moves_stiffness_percent: float = math.nan
    moves_damping_percent: float = math.nan
    brief: str = ""

    def __post_init__(self) -> None:
        if self.remedy is not None and not isinstance(self.remedy, Remedy):
            object.__setattr__(self, "remedy", stated(self.remedy))
        for name in ("message", "brief"):
            object.__setattr__(self, name, spell_advice(getattr(self, name)))
        least = worst(self.stiffness, "with-care" if self.damping != "trust" else "trust")
        k = max(MARKS.index(least), SEVERITIES.index(self.severity))
        object.__setattr__(self, "severity", SEVERITIES[k])

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "Finding":
        """Return the finding from the output of :meth:`as_dict`."""
        given = {**words, "check": CHECKS_BY_ID.get(words["check"], words["check"])}
        for name in ("z", "moves_stiffness_percent", "moves_damping_percent"):
            given[name] = or_nan(given.get(name))  # JSON's null is NaN
        return cls(**given)

    def __str__(self) -> str:
        return f"{self.message} ({self.remedy})" if self.remedy else self.message
