"""Misfit, offset, excitation and the method's own error: checks of the fit as a whole."""

import math

import numpy as np

from palpate.diagnosis.band import FEWEST_ROWS
from palpate.diagnosis.data import in_words
from palpate.diagnosis.finding import Finding, Mark, severity_of, worst
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.law import better_law
from palpate.diagnosis.laws import REMEDY
from palpate.diagnosis.marking import STOP_DAMPING, STOP_STIFFNESS
from palpate.diagnosis.surface import offset_against_free
from palpate.digits import rounded

UNEXPLAINED, MOST_UNEXPLAINED = 0.05, 0.30  # of the force
RATIO = 3.0  # times the noise; clean recordings have 0.67 to 1.13
OFFSET_Z, OFFSET_PART = 5.0, 0.01
FEWEST_SAMPLES = 60
# Standard errors, relative, that are too wide to build on.
WIDE_STIFFNESS, WIDEST_STIFFNESS, WIDE_DAMPING = 0.10, 0.25, 0.20
METHOD_Z = 5.0
FAILS = 0.05  # of stiffness or damping, that a method is off; less is a note


def ratio(fit: Fit) -> float:
    """Residual of the band over its noise floor; 1 where the law holds to the noise."""
    rms = math.sqrt(fit.solution.energy / max(len(fit.band), 1))
    return rms / fit.floor if fit.floor > 0.0 else math.inf


def unexplained(fit: Fit) -> float:
    """Fraction of the force that neither law nor noise explains."""
    spread = float(np.std(fit.force))
    square = fit.solution.energy / max(len(fit.band), 1) - 2.0 * fit.floor**2
    return math.sqrt(max(square, 0.0)) / spread if spread > 0.0 else 0.0


def misfit(fit: Fit) -> Finding | None:
    """The law leaves more than 5 % of the force, or three times the noise."""
    left, times = unexplained(fit), ratio(fit)
    if left <= UNEXPLAINED and times <= RATIO:
        return None
    mark: Mark = "do-not-trust" if left > MOST_UNEXPLAINED else "with-care"
    part = rounded(left, 2) if left < 0.01 else f"{left:.0%}"
    remedy = "palpate compare shows whether another law fits better"
    if better_law(fit) is not None:
        remedy = REMEDY
    elif fit.laws is not None and fit.laws.own:
        remedy = "--law any tries more laws, and palpate compare other methods"
    elif fit.laws is not None:
        remedy = f"no everyday law is clearly better, by {REMEDY}; palpate compare has all methods"
    return Finding(
        "misfit",
        f"the law leaves {part} of the force unexplained, {rounded(times, 2)} times the noise",
        remedy,
        z=times,
        stiffness=mark if mark == "do-not-trust" else "trust",
        damping=mark if mark == "do-not-trust" else "trust",
        severity=severity_of(mark),
    )


def offset(fit: Fit) -> Finding | None:
    """The offset that the fit wants is not the force in free air."""
    found = offset_against_free(fit)
    if found is None:
        return None
    z, difference = found
    if z <= OFFSET_Z or abs(difference) <= OFFSET_PART * fit.data.peak_force:
        return None
    return Finding(
        "offset",
        f"the law wants a zero of the force {in_words(abs(difference), 'N')} "
        f"{'above' if difference > 0 else 'below'} that in free air: it is another law at light "
        "touch, or the tare is wrong",
        "--tare START:STOP over a time without contact",
        z=z,
    )


def excitation(fit: Fit) -> Finding | None:
    """The motion says too little of stiffness or damping at working depth."""
    count = int(np.count_nonzero(fit.inside))
    if count < FEWEST_SAMPLES or len(fit.band) < FEWEST_ROWS // 2:
        return Finding(
            "excitation",
            f"only {count} samples in contact",
            "record longer",
            stiffness="do-not-trust",
            damping="do-not-trust",
            severity="do-not-trust",
        )
    _, stiffness, damping = standard_errors(fit)
    of_stiffness, of_damping = stiffness / fit.sizes[0], damping / fit.sizes[1]
    mark: Mark = "trust"
    if of_stiffness > WIDE_STIFFNESS:
        mark = "do-not-trust" if of_stiffness > WIDEST_STIFFNESS else "with-care"
    if mark == "trust" and of_damping <= WIDE_DAMPING:
        return None
    return Finding(
        "excitation",
        f"the motion identifies the stiffness to {of_stiffness:.0%} and the damping to "
        f"{of_damping:.0%}",
        "palpate design finds a better motion: more speed, or a wider range of depths",
        stiffness=mark,
        damping="with-care" if of_damping > WIDE_DAMPING else "trust",
        severity=severity_of(worst(mark, "with-care")),
    )


def extrapolation(fit: Fit) -> Finding | None:
    """The working depth that is asked for is not among the depths of the recording."""
    least, peak = fit.range
    if least <= fit.depth <= peak:
        return None
    return Finding(
        "depth",
        f"the working depth, {in_words(fit.depth, 'm')}, lies outside the depths in contact, "
        f"{in_words(least, 'm')} to {in_words(peak, 'm')}: the law is extrapolated",
        "choose another with --at, or press as deep",
        stiffness="with-care",
        damping="with-care",
    )


def standard_errors(fit: Fit) -> tuple[float, float, float]:
    """Of force, stiffness and damping at the working depth, SI."""
    names = len(fit.solution.law.symbols)
    spread = fit.gradients @ fit.covariance[:names, :names] @ fit.gradients.T
    force, stiffness, damping = np.sqrt(np.maximum(np.diag(spread), 0.0)).tolist()
    return force, stiffness, damping


def off_least_squares(fit: Fit) -> tuple[float, float, float]:
    """How far the method's stiffness and damping are off the least squares of its law, and z.

    Relative to their sizes; 0 where z is no more than 5.
    """
    own, best = fit.units.local(fit.estimate.law), fit.solution.law
    _, stiffness, damping = standard_errors(fit)
    apart = fit.stiffness(own) - fit.stiffness(best), fit.damping(own) - fit.damping(best)
    z = max(abs(apart[0]) / max(stiffness, 1e-300), abs(apart[1]) / max(damping, 1e-300))
    if z <= METHOD_Z:
        return 0.0, 0.0, z
    return apart[0] / fit.sizes[0], apart[1] / fit.sizes[1], z


def method(fit: Fit) -> Finding | None:
    """The method's own answer is not the least squares of its law on these samples."""
    off_s, off_c, z = off_least_squares(fit)
    if z <= METHOD_Z:
        return None
    large = max(abs(off_s), abs(off_c)) > FAILS
    mark_s, mark_c = _grade(abs(off_s), STOP_STIFFNESS), _grade(abs(off_c), STOP_DAMPING)
    words = "the method fails here: its" if large else "the method's"
    return Finding(
        "method",
        f"{words} stiffness is {off_s:+.2g} and its damping {off_c:+.2g} of their size off the "
        f"least squares of its own law, {rounded(z, 2)} standard errors",
        "--method variable-projection",
        z=z,
        stiffness=mark_s,
        damping=mark_c,
        severity=severity_of(worst(mark_s, "with-care") if large else "trust"),
        moves_stiffness_percent=-100.0 * off_s,
        moves_damping_percent=-100.0 * off_c,
    )


def _grade(moved: float, stop: float) -> Mark:
    if moved > stop:
        return "do-not-trust"
    return "with-care" if moved > FAILS else "trust"
