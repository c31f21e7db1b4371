"""Checks that the motion is informative enough: samples, directions, depths."""

import numpy as np

from palpate.digits import format_quantity, rounded
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.identification.diagnosis.fit import Fit
from palpate.method.estimators.law_verdicts import ONE_WAY, one_speed, one_way
from palpate.method.rows import count_true, rms

FEWEST_SAMPLES = 60
# A probe is held below the first fraction of its rms speed and beyond the second of its depth, for
# at least the third of the contact; it withdraws over at least the fourth of its way in.
HELD_SPEED = 0.3
DEEP = 0.5
HELD = 0.2
WITHDRAWN = 0.1


def check_excitation(fit: Fit) -> Finding | None:
    """Too few samples in contact to check the law."""
    count = count_true(fit.inside)
    return few_samples(count, "do-not-trust") if count < FEWEST_SAMPLES else None


def explain_no_check(fit: Fit) -> Finding:
    """Report why the law cannot be checked: too few samples, or too little motion."""
    return check_excitation(fit) or Check.EXCITATION.finding(
        "the motion varies too little to check the law",
        Remedy(NextStep.VARY_SPEED),
        mark="do-not-trust",
    )


def few_samples(count: int, mark: Mark = "trust") -> Finding:
    """Report the number of samples in contact as too small."""
    sentence = f"only {count} sample{'s' * (count != 1)} in contact"
    return Check.EXCITATION.finding(sentence, Remedy(NextStep.LONGER), mark=mark)


def check_extrapolation(fit: Fit) -> Finding | None:
    """The requested working depth is outside the depths of the recording."""
    least, peak = fit.range
    if least <= fit.depth <= peak:
        return None
    return Check.DEPTH.finding(
        f"the working depth, {format_quantity(fit.depth, 'm')}, is outside the recorded depths, "
        f"{format_quantity(least, 'm')} to {format_quantity(peak, 'm')}: the law is extrapolated",
        Remedy(NextStep.RECORDED_DEPTH, f"{1e3 * fit.reference:.2g}"),
        mark="with-care",
    )


def check_one_way(fit: Fit) -> Finding | None:
    """The probe moves one way: at nearly one speed, or at any if the law relaxes.

    From the loading alone a relaxing law predicts the unloading of two muscles up to 4 times worse
    than Hunt–Crossley (``benchmarks.diagnosis.forecasts``), which is therefore selected.
    """
    v = fit.data.velocity[fit.inside]
    if not abs(float(v.mean())) > ONE_WAY * fit.speed:
        deep = fit.penetration[fit.inside] > DEEP * fit.range[1]
        held = np.mean(deep & (np.abs(v) < HELD_SPEED * fit.speed)) > HELD
        if fit.equivalent is None or held or -v[v < 0.0].sum() > WITHDRAWN * v[v > 0.0].sum():
            return None
        return Check.LOADING_ALONE.finding(
            "the probe never withdraws: the law that relaxes is only known while it presses",
            Remedy(NextStep.RELEASE),
            damping="do-not-trust",
            brief="the probe never withdraws",
        )
    if fit.steady_speed:
        return one_speed(format_quantity(fit.steady_speed, "m/s", digits=2))
    exponent_known = "n" in fit.estimate.fixed
    return one_way("trust" if exponent_known else "do-not-trust", "do-not-trust")


def presses_once(fit: Fit) -> bool:
    """Whether the probe turns at most once while it moves at more than 0.3 of its rms speed."""
    speed = fit.windows.mean(fit.v)
    fast = np.sign(speed[np.abs(speed) > 0.3 * rms(speed)])
    return count_true(np.diff(fast)) <= 1


def check_peaks(fit: Fit) -> Finding:
    """Report the largest force and penetration, which show a wrong unit."""
    return Check.PEAK_FORCE.finding(
        f"the largest force is {rounded(fit.data.peak_force, 3)} N, the largest penetration "
        f"{rounded(1e3 * fit.data.peak_penetration, 3)} mm"
    )
