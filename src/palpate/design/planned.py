"""What a planned motion would identify, before anything is touched, and a better motion."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from palpate.design.motion import PAPER_MOTION, Motion
from palpate.design.precision import (
    HORIZON,
    Limits,
    PlannedMeasurement,
    PredictedPrecision,
    effective_noise,
    find_better,
    limits_around,
    predict_precision,
)
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.stages import timed
from palpate.validation import Plain, instance, number_in, plain

#: When the precision is predicted, s.
DURATIONS = (0.5, 1.0, 5.0, 20.0)


@dataclass(frozen=True, slots=True, eq=False)
class Design(PlannedMeasurement, Plain):
    """What a planned motion would identify of a guessed material, and what a better one would.

    Attributes
    ----------
    law, noise, resolution, sample_time, offset, surface
        What the motions are measured with.
    limits : Limits
        What the better motion has to keep to.
    planned : PredictedPrecision
        What the planned motion would tell.
    better : PredictedPrecision or None
        The same of the motion within the limits whose worst expected error after the longest
        duration is the least found; None where the planned motion is as good.
    reason : str
        Why it is better, or why there is none.
    """

    limits: Limits
    planned: PredictedPrecision
    better: PredictedPrecision | None
    reason: str

    @property
    def chosen(self) -> tuple[str, PredictedPrecision]:
        """The motion to play: the better one, or the planned one where none was found.

        Raises
        ------
        InvalidParameterError
            No motion within the limits was found, and the planned one does not keep to them.
        """
        if self.better is not None:
            return "better", self.better
        if not self.limits.allow(self.planned.motion):
            raise InvalidParameterError(
                "no motion within the limits was found, and the planned one exceeds them: there "
                "is none to write"
            )
        return "planned", self.planned

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and words; what is infinite or undefined is None."""
        law = {"kind": self.law.kind, **self.law.as_dict()}
        own = {name: plain(getattr(self, name)) for name in ("effective_noise", "speed_limit")}
        return {**Plain.as_dict(self), **own, "law": law, "limits": asdict(self.limits)}


@timed("design")
def design(
    law: HuntCrossley,
    motion: Motion = PAPER_MOTION,
    *,
    noise: float,
    resolution: float = 0.0,
    sample_time: float = 1e-3,
    offset: bool = True,
    surface: bool = False,
    durations: Sequence[float] = DURATIONS,
    max_depth: float | None = None,
    max_speed: float | None = None,
) -> Design:
    """Tell what a planned motion would identify of a guessed material, and find a better one.

    No unbiased estimator has a standard error below the Cramér–Rao bound,

        s(θᵢ) ≥ σ √[(JᵀJ)⁻¹]ᵢᵢ,   J = ∂F/∂(K, B, n[, F₀][, d]) at every sample in contact,

    with F₀ an offset and d the position of the surface, where they are unknown too.
    :class:`VariableProjection` comes close to it. Penetration and velocity are taken as exact,
    noise as white, the law as true: on a real rig it takes longer.

    K is the force at a depth of 1 m, which no probe reaches: much of its error is that of n,
    carried from the depths probed to 1 m. A force within those depths is known far better.

    Parameters
    ----------
    law : HuntCrossley
        The material as guessed: K and B in (0, 1e20], n in (0, 10].
    motion : Motion
        The motion as planned; the paper's three sines unless given.
    noise, resolution : float
        σ and step Δ of the force, N: see :func:`effective_noise`.
    sample_time : float
        s, in [1e-5, 1], and at least six samples in a period: ω · sample_time ≤ 1.
    offset : bool
        A force offset is unknown too, as in :class:`VariableProjection`.
    surface : bool
        The position of the surface is unknown too. Only samples in contact count: those of the free
        approach, which would help, do not.
    durations : sequence of float
        s, each in [sample_time, 1000] and of at most 1e7 samples.
    max_depth, max_speed : float, optional
        Limits of the better motion: peak penetration, m, in (0, 10], and speed, m/s, in (0, 1000].
        What the planned motion itself reaches, unless given. It also stays below K/B, where the law
        begins to pull, and deeper than a tenth of the peak penetration and than where K xⁿ is ten
        times the noise, but for at most a tenth of the largest (or than the planned motion does,
        where that comes higher and stays in contact).

    Raises
    ------
    InvalidParameterError
        An argument is of the wrong kind or out of its range.
    """
    instance("law", law, HuntCrossley)
    instance("motion", motion, Motion)
    for name, value, highest in (
        ("stiffness", law.stiffness, 1e20),
        ("damping", law.damping, 1e20),
        ("exponent", law.exponent, 10.0),
        ("max_depth", max_depth, 10.0),
        ("max_speed", max_speed, 1000.0),
    ):
        if value is not None:
            number_in(name, value, 0.0, highest, open_low=True)
    step = number_in("sample_time", sample_time, 1e-5, 1.0)
    for i, frequency in enumerate(motion.frequencies):
        number_in(f"frequencies[{i}]", frequency, 0.0, 1.0 / step, open_low=True)
    effective_noise(noise, resolution)  # which refuses what is out of range
    spans = _checked_durations(durations, step)
    measured = law, float(noise), float(resolution), step, bool(offset), bool(surface)
    measurement = PlannedMeasurement(*measured)
    limits = limits_around(motion, measurement, max_depth, max_speed)
    planned = predict_precision(motion, measurement, spans)
    found = find_better(motion, measurement, limits, spans[-1])
    better = None if found is None else predict_precision(found, measurement, spans)
    return Design(*measured, limits, planned, better, _why(planned, better, limits))


def _checked_durations(durations: Sequence[float], step: float) -> tuple[float, ...]:
    given = tuple(durations) if isinstance(durations, Sequence) else ()
    if not given:
        raise InvalidParameterError(
            f"durations must be a sequence of at least one number, not {durations!r}"
        )
    most = min(HORIZON, 1e7 * step)
    return tuple(
        sorted(number_in(f"durations[{i}]", value, step, most) for i, value in enumerate(given))
    )


def _why(planned: PredictedPrecision, better: PredictedPrecision | None, limits: Limits) -> str:
    """In words, what makes the difference."""
    if better is None:
        if limits.speed == 0.0:
            return "the planned probe is held; a highest speed is needed to look for a motion"
        if math.isinf(planned.worst):
            return "no motion within the limits was found that identifies the three parameters"
        return "no motion within the limits was found that is better by 2 %"
    reasons = []
    if not limits.allow(planned.motion):
        price = ", and is less precise for it" if better.worst > planned.worst else ""
        reasons.append(f"it keeps to the limits, which the planned motion does not{price}")
    if better.motion.peak_penetration > 1.02 * planned.motion.peak_penetration:
        reasons.append("it goes deeper, where the force stands further out of the noise")
    if _span(better) > 1.02 * _span(planned):
        reasons.append(
            "its stroke covers a wider range of depths, from "
            f"{rounded(1e3 * better.least_penetration, 3)} to "
            f"{rounded(1e3 * better.peak_penetration, 3)} mm, "
            "which identifies the exponent, and with it the stiffness"
        )
    if better.rms_speed > 1.02 * planned.rms_speed:
        reasons.append(
            f"it is faster, {rounded(1e3 * better.rms_speed, 3)} mm/s rms for "
            f"{rounded(1e3 * planned.rms_speed, 3)}, which identifies the damping"
        )
    if len(better.motion.amplitudes) < len(planned.motion.amplitudes):
        reasons.append("the stroke and the speed are divided among fewer sines")
    return "; ".join(reasons) or "it divides depth and speed better between the three"


def _span(predicted: PredictedPrecision) -> float:
    """Range of the logarithm of the depth, from which the exponent is identified."""
    if predicted.least_penetration <= 0.0:
        return math.inf
    return math.log(predicted.peak_penetration / predicted.least_penetration)
