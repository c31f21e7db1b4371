"""The next steps that palpate advises: their ids, and the one place that writes their sentences."""

from enum import Enum
from typing import Any, Self

from palpate.spelling import spell_advice


class NextStep(Enum):
    """A next step, with its sentence; ``{}`` stands for a number or a name.

    Whether a step applies is decided where it is made, and whether it is predicted to lower an
    error bar in :func:`palpate.diagnosis.bars.best_remedy`.
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


def stated(words: str) -> Remedy:
    """Return a next step in the words of who states it."""
    return Remedy(NextStep.STATED, words)
