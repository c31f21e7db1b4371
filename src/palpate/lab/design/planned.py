"""The precision of a planned motion before any contact, and a better motion."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from textwrap import fill
from typing import Any

from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.lab.design.motion import PAPER_MOTION, Motion
from palpate.lab.design.precision import (
    HORIZON,
    Limits,
    PlannedMeasurement,
    PredictedPrecision,
    effective_noise,
    find_better,
    limits_around,
    predict_precision,
)
from palpate.stages import log_stage
from palpate.validation import Plain, frozen, instance, number_in, plain

#: Default durations for which the precision is predicted, s.
DURATIONS = (0.5, 1.0, 5.0, 20.0)


@frozen(eq=False)
class Design(PlannedMeasurement, Plain):
    """The predicted precision of a planned motion on a guessed material, and of a better one.

    Attributes
    ----------
    law, noise, resolution, sample_time, offset, surface
        The guess of the material, the sensor, and what else is estimated.
    limits : Limits
        Limits of the better motion.
    planned : PredictedPrecision
        Precision of the planned motion.
    better : PredictedPrecision or None
        Precision of the motion within the limits with the least worst expected error after the
        longest duration; None if the planned motion is as good.
    reason : str
        Why the better motion is better, or why there is no better motion.
    """

    limits: Limits
    planned: PredictedPrecision
    better: PredictedPrecision | None
    reason: str

    def __repr__(self) -> str:
        better = "" if self.better is None else f"\n better: {self.better}"
        return f"<Design for {self.law}\n planned: {self.planned}{better}\n {self.reason}>"

    def __str__(self) -> str:
        """Return the guess, the precision of each motion, and the reason, one line each."""
        parts = zip(self.law.symbols, self.law.parameters, self.law.units, strict=True)
        numbers = [f"{name} = {rounded(float(value), 4)} {unit}" for name, value, unit in parts]
        guess = "  ".join(map(str.rstrip, numbers))
        rows = [("guess", guess), ("planned", self.planned.describe(self.law.symbols))]
        if self.better is not None:
            rows.append(("better", self.better.describe(self.law.symbols)))
        rows.append(("why", self.reason))
        return "\n".join(
            fill(f"{name:<9}{words}", 100, subsequent_indent=" " * 9) for name, words in rows
        )

    @property
    def chosen(self) -> tuple[str, PredictedPrecision]:
        """The motion to play, as "better" or "planned", and its precision.

        It is the planned motion if there is no better one.

        Raises
        ------
        InvalidParameterError
            There is no better motion within the limits, and the planned one exceeds them.
        """
        if self.better is not None:
            return "better", self.better
        if not self.limits.allow(self.planned.motion):
            raise InvalidParameterError(
                "found no motion within the limits, and the planned one exceeds them: raise "
                "--max-depth or --max-speed"
            )
        return "planned", self.planned

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and text; infinite or undefined numbers are None."""
        own = {name: plain(getattr(self, name)) for name in ("effective_noise", "speed_limit")}
        own |= {"law": self.law.description(), "limits": asdict(self.limits)}
        return {**Plain.as_dict(self), **own}


@log_stage("design")
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
    """Predict the precision of a planned motion on a guessed material, and find a better motion.

    No unbiased estimator has a standard error below the Cramér–Rao bound,

        s(θᵢ) ≥ σ √[(JᵀJ)⁻¹]ᵢᵢ,   J = ∂F/∂(K, B, n[, F₀][, d]) at every sample in contact,

    with the offset F₀ and the surface position d if they are estimated too.
    :class:`VariableProjection` comes close to it. The prediction assumes exact penetration and
    velocity, white noise and a true law; a real rig takes longer.

    K is the force extrapolated to a depth of 1 m, so much of its error is due to the error of n.
    The force within the probed depths is known far better.

    Parameters
    ----------
    law : HuntCrossley
        Guess of the material: K and B in (0, 1e20], n in (0, 10].
    motion : Motion
        The planned motion. Default: the paper's three sines.
    noise, resolution : float
        σ and quantisation step Δ of the force, N: see :func:`effective_noise`.
    sample_time : float
        s, in [1e-5, 1], with at least six samples in a period: ω · sample_time ≤ 1.
    offset : bool
        Whether a force offset is estimated too, as in :class:`VariableProjection`.
    surface : bool
        Whether the surface position is estimated too. Only samples in contact count; the samples of
        the free approach, which would help, do not.
    durations : sequence of float
        s, each in [sample_time, 1000] and of at most 1e7 samples.
    max_depth, max_speed : float, optional
        Limits of the better motion: peak penetration, m, in (0, 10], and speed, m/s, in (0, 1000].
        Default: peak penetration and top speed of the planned motion. The better motion is always
        slower than K/B, above which the law becomes adhesive. It stays deeper than a tenth of the
        peak penetration, and deeper than the depth at which K xⁿ is ten times the noise but at most
        a tenth of its largest value (or than the planned motion, if that is shallower but stays in
        contact).

    Raises
    ------
    InvalidParameterError
        An argument is of the wrong type or out of its range.
    """
    instance("law", law, HuntCrossley)
    instance("motion", motion, Motion)
    for name, value, highest in (
        ("K", law.K, 1e20),
        ("B", law.B, 1e20),
        ("n", law.n, 10.0),
        ("max_depth", max_depth, 10.0),
        ("max_speed", max_speed, 1000.0),
    ):
        if value is not None:
            number_in(name, value, 0.0, highest, open_low=True)
    step = number_in("sample_time", sample_time, 1e-5, 1.0)
    for i, frequency in enumerate(motion.frequencies):
        number_in(f"frequencies[{i}]", frequency, 0.0, 1.0 / step, open_low=True)
    effective_noise(noise, resolution)  # checks the ranges
    spans = _check_durations(durations, step)
    measured = law, float(noise), float(resolution), step, bool(offset), bool(surface)
    measurement = PlannedMeasurement(*measured)
    limits = limits_around(motion, measurement, max_depth, max_speed)
    planned = predict_precision(motion, measurement, spans)
    found = find_better(motion, measurement, limits, spans[-1])
    better = None if found is None else predict_precision(found, measurement, spans)
    return Design(*measured, limits, planned, better, _why(planned, better, limits))


def _check_durations(durations: Sequence[float], step: float) -> tuple[float, ...]:
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
    """Explain why the better motion is better, or why palpate proposes no other motion."""
    if better is None:
        if limits.speed == 0.0:
            return "the planned motion holds the probe still: pass --max-speed to search for one"
        if math.isinf(planned.worst):
            return "no motion within the limits identifies all three parameters"
        return "no motion within the limits is better by 2 %"
    reasons = []
    if not limits.allow(planned.motion):
        price = ", though it is less precise" if better.worst > planned.worst else ""
        reasons.append(f"it keeps the limits, which the planned motion exceeds{price}")
    if better.motion.peak_penetration > 1.02 * planned.motion.peak_penetration:
        reasons.append("it goes deeper, where the force is larger compared with the noise")
    if _span(better) > 1.02 * _span(planned):
        reasons.append(
            "its stroke covers a wider range of depths, from "
            f"{rounded(1e3 * better.least_penetration, 3)} to "
            f"{rounded(1e3 * better.peak_penetration, 3)} mm, "
            "which identifies exponent and stiffness"
        )
    if better.rms_speed > 1.02 * planned.rms_speed:
        reasons.append(
            f"it is faster, {rounded(1e3 * better.rms_speed, 3)} instead of "
            f"{rounded(1e3 * planned.rms_speed, 3)} mm/s rms, which identifies the damping"
        )
    if len(better.motion.amplitudes) < len(planned.motion.amplitudes):
        reasons.append("it has fewer sines, with more stroke and speed each")
    return "; ".join(reasons) or "its depths and speeds suit the three parameters better"


def _span(predicted: PredictedPrecision) -> float:
    """Range of the logarithm of the depth, which determines the precision of the exponent."""
    if predicted.least_penetration <= 0.0:
        return math.inf
    return math.log(predicted.peak_penetration / predicted.least_penetration)
