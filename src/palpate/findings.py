"""Findings: messages, their severity and their effect; the ids of checks and of next steps."""

import math
from collections.abc import Mapping
from contextlib import suppress
from enum import Enum, Flag, StrEnum, auto
from functools import cache
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias

from palpate.spelling import spell_advice
from palpate.validation import Plain, frozen, or_nan


class NextStep(Enum):
    """A next step, with its sentence; ``{}`` stands for a number or a name.

    Whether a step applies is decided where it is made, and whether it is predicted to lower an
    error bar in :func:`palpate.identification.diagnosis.bars.best_remedy`.
    """

    # Other options for the same recording.
    SELECT_LAW = "let palpate select the law: run again without --law and --method"
    PLAIN_LAW = "run again with --law hunt-crossley"
    EXACT_METHOD = "run again with --method variable-projection"
    GROWING_DAMPING = "run again with --method variable-projection, whose damping grows with depth"
    DEEPER_HALF = "identify the deeper half alone: --min-penetration {}mm"
    TWO_HALVES = "identify the two halves separately: --stop {0}, then --start {0}"
    TWO_PARTS = "identify the two parts separately: --stop {0}, then --start {0}"
    SEGMENTS = "identify each segment separately: --changes"
    LATEST_PART = "to predict what comes next, identify the latest part alone: --start {}"
    BEFORE_JUMP = "use the samples before it: --stop {}, or zero the sensor in free air"
    RECORDED_DEPTH = "choose a recorded depth: --at {}mm"
    WIDER_WINDOW = "run again with --velocity-window {}"
    DIFFERENTIATE = "differentiate the penetration instead: --velocity none"
    DELAY = "run again with --delay {} if the sensors can be out of step by that much"
    FIND_DELAY = "run again with --delay find"
    SURFACE = "run again with --surface estimate"
    SURFACE_BY_METHOD = "run again with --method variable-projection --surface estimate"
    FLIP_PENETRATION = "run again with --flip-penetration"
    FLIP_FORCE = "run again with --flip-force"
    UNIT = "run again with --unit {0}={1}, or with --unit {0}={2} if it is right"
    BOTH_UNITS = (
        "run again with both units, of which the file states none, such as "
        "--unit penetration=mm,force=gf"
    )
    KEEP_OUTLIERS = "if they are real, run again with --no-reject-outliers"
    TARE = "tare in free air: --tare {}"
    WEIGH = "weigh what is beyond the sensor, and run again with --mass, such as --mass 20g"
    WORKING_DEPTH = "use the damping at the working depth only"
    # Another measurement at the rig.
    STEEL_SPRING = "touch a steel spring with this rig (palpate skew)"
    IN_STEP = (
        "touch a steel spring with this rig (palpate skew), or, if one clock stamps both, run "
        "again with --delay 0ms+-0.1ms"
    )
    ONE_CLOCK = "record position and force by one clock"
    SPRING_CHECK = "check the force sensor with a spring up to the same force"
    CONNECTION = "check the sensor's connection"
    CABLE = "check the {} sensor's cable"
    CHECK_SIGNS = "check the signs of penetration and force"
    LARGER_RANGE = "use a force sensor with a larger range"
    FINER_FORCE = "set the force sensor to a finer range"
    FINER_POSITION = "record the position in finer steps"
    NO_THRESHOLD = "switch the threshold off"
    FREE_AIR_FORCE = "subtract the force in free air; route the cable so it cannot pull"
    FREE_AIR_MOTION = "move in free air, and subtract the force there"
    INERTIA = "subtract the inertia of the parts beyond the sensor from the force"
    TARE_EACH_TOUCH = "tare the sensor before each touch"
    STIFFER_PROBE = "move more slowly, or support the probe more stiffly"
    # Another recording.
    MOVE_MORE = "move faster and over a wider range of depths"
    VARY_SPEED = "press and release several times, at different speeds"
    WITHOUT_PRIOR = f"{VARY_SPEED}; without the prior: --no-weak-prior"
    SEVERAL_PRESSES = "press several times"
    RELEASE = "press and release"
    APPROACH = "record the approach through free air"
    HOLD = "press, and hold for {} s"
    LONGER = "record longer"
    TASK_SPEED = "record at the speed of the task"
    TASK_MOTION = "record the motion of the task, and repeat it"
    ALONG_NORMAL = "press along the surface normal"
    STAY_IN_CONTACT = "record a motion that stays in contact"
    SAMPLE_TIMES = "record the time of each sample"
    SENSOR_TIMES = "record the time at which the sensor is sampled"
    # A step that the preparation of a recording states in its own words.
    STATED = "{}"


class Remedy(str):
    """The sentence of a next step, with its id.

    Attributes
    ----------
    step : NextStep
        The id.
    otherwise : Remedy or None
        A second step, after *or*.
    """

    step: NextStep
    otherwise: "Remedy | None"
    _given: tuple[Any, ...]

    def __new__(cls, step: NextStep, *values: object, otherwise: "Remedy | None" = None) -> Self:
        """Return the step's sentence with its values, and with the second step's."""
        words = spell_advice(step.value.format(*values))
        remedy = super().__new__(cls, words if otherwise is None else f"{words}, or {otherwise}")
        remedy.step = step
        remedy.otherwise = otherwise
        remedy._given = (step, *values)
        return remedy

    def without(self, step: NextStep) -> "Remedy | None":
        """Return what is left without a step; None if nothing is."""
        if self.step is step:
            return self.otherwise
        return Remedy(*self._given) if self.has(step) else self

    def has(self, step: NextStep) -> bool:
        """Whether it is, or has as its second step, this one."""
        return step in (self.step, None if self.otherwise is None else self.otherwise.step)

    def __reduce__(self) -> Any:
        return _restore, (self._given, self.otherwise)


def _restore(given: tuple[Any, ...], otherwise: Remedy | None) -> Remedy:
    return Remedy(*given, otherwise=otherwise)


def stated(text: str) -> Remedy:
    """Return a next step in the words of who states it."""
    return Remedy(NextStep.STATED, text)


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
    """The id of every check, with its subject: a heading of ``docs/reference/findings.md``.

    The sentence of a finding is written in the file that makes the finding; what it means stands in
    ``findings.md``. A finding that may not cap a mark only changes error bars.
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
    GUIDE_FRICTION = "guide friction", "sensor"
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

    @property
    def meaning(self) -> str:
        """Explanation: what happened (first line), what it means for the numbers, what to do."""
        return _meanings()[self.value]

    @property
    def anchor(self) -> str:
        """The id in one word, as of a heading of the page of findings."""
        return self.value.replace(" ", "-")

    @property
    def link(self) -> str:
        """The address of its item in the documentation; empty where the build was given none."""
        return f"{_documentation()}/reference/findings.html#{self.anchor}" * bool(_documentation())

    def __repr__(self) -> str:
        return repr(self.value)


# Keys: the bits of LoopCheck in include/palpate/contact_response.hpp.
LOOP_CHECKS = {
    1: Check.STUCK_FORCE,
    2: Check.SATURATION,
    4: Check.SPIKES,
    8: Check.LATE_FORCE,
    16: Check.LOST_CONTACT,
    32: Check.BASELINE,
    64: Check.CHANGE,
}


def loop_checks(bits: int) -> list[Check]:
    """Return the checks of a loop's estimate from their bits."""
    return [check for bit, check in LOOP_CHECKS.items() if bits & bit]


@cache
def _meanings() -> Mapping[str, str]:
    text = Path(__file__).with_suffix(".md").read_text(encoding="utf-8")
    sections = (part.partition("\n") for part in text.split("\n## ")[1:])
    return {title: meaning.strip() for title, _, meaning in sections}


@cache
def _documentation() -> str:
    """Return the address that ``distribution/addresses.py`` wrote; empty without one."""
    from importlib.metadata import PackageNotFoundError, metadata  # slow, and rarely needed

    with suppress(PackageNotFoundError):
        for entry in metadata("palpate").get_all("Project-URL", []):
            name, _, address = entry.partition(", ")
            if name == "Documentation":
                return str(address).rstrip("/")
    return ""


CHECKS_BY_ID: Mapping[str, Check] = {check.value: check for check in Check}
#: Checks whose findings may lower a mark below the one that the error bars give.
MAY_CAP = frozenset(check for check in Check if CAPS in check.holds)
#: Checks that concern neither time nor damping.
HOLD_WITHOUT_TIME = frozenset(check for check in Check if TIMELESS in check.holds)


def worst(*marks: Mark) -> Mark:
    """Return the worst of some marks; *trust* without any."""
    return MARKS[max(map(MARKS.index, marks), default=0)]


def spoken(mark: str) -> str:
    """Return a mark as text: *with care*."""
    return mark.replace("-", " ")


@frozen
class Finding(Plain):
    """One message about a recording, its preparation or its identification.

    Parameters
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

    Examples
    --------
    >>> import palpate
    >>> findings = palpate.identify("examples/recordings/tapping.csv").diagnosis.findings
    >>> findings[0].check, findings[0].severity
    ('moving mass', 'with-care')
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

    @property
    def link(self) -> str:
        """The address of the check's item; empty without one, as for a check of your own."""
        return self.check.link if isinstance(self.check, Check) else ""

    @property
    def titled(self) -> str:
        """The sentence and its next step, after the id of the check."""
        return f"{self.check}: {self}"

    def __str__(self) -> str:
        return f"{self.message} ({self.remedy})" if self.remedy else self.message
