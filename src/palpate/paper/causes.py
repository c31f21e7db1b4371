"""What the paper gives as a reason, each by itself: all else is kept, and that alone changed."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import (
    DoubleStageRLS,
    KelvinVoigtRLS,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
)
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import (
    BALL,
    THREE_SINES,
    Bench,
    Homogeneous,
    IdealProbe,
    TimeVaryingMaterial,
)
from palpate.paper.experiment import by_symbol
from palpate.paper.sessions import SI, START, identified
from palpate.paper.starts import AGREED, convergence_times, from_starts, spread, starts_of
from palpate.preparation import prepare
from palpate.settings import ConstantForgetting, Scale
from palpate.validation import Floats

#: Initial covariances, the same for every method, by which speeds are compared.
SAME_COVARIANCES = (10.0, 1e3, 1e6)
#: Near the contact's own depth, speed and force, so that every regressor is near 1.
OWN = Scale(10e-3, 20e-3, 20.0)
LAW: HuntCrossley = BALL.law  # type: ignore[assignment]  # the ball is one

#: Every how many of the rig's samples, 1 kHz, a slower one would take.
STEPS = (1, 2, 4, 10, 20)
#: What |v| may be at most, of K/B: the paper's tenth, and more.
SHARES = (0.1, 0.5)

#: The ball, and one a fifth stiffer and more damped, in turn every two seconds.
CHANGES = (4.0, 6.0, 8.0, 10.0)
STIFFER = 1.2 * LAW.stiffness
OTHER = Homogeneous(HuntCrossley(STIFFER, 1.2 * LAW.damping, LAW.exponent))
VARYING = TimeVaryingMaterial((BALL, OTHER, BALL, OTHER, BALL), CHANGES)

#: "≪ 1" in (5), read as for condition 10; the paper's is in N, for x^n is in mⁿ.
MUCH_LESS = 0.1


def logarithm(contact: Contact) -> dict[str, float]:
    """Say how soon one model converges with a logarithm and without it, n known, with equal P₀.

    The single stage then is ln F − n ln x = ln K + (B/K) v, and stage 1 of the double stage
    F = K xⁿ + B xⁿ v: the same samples, starts and parameters. Beside them both models whole, with
    P₀ in units in which it means the same for both.
    """
    starts = starts_of(contact, SingleStageRLS)
    # Set II differs from set I in n alone.
    two = [starts["I"], starts["III"]]
    linear = starts_of(contact, KelvinVoigtRLS).values()
    numbers: dict[str, float] = {}
    for size in SAME_COVARIANCES:
        p0: dict[str, Any] = {"initial_covariance": size}
        alone = {**p0, "exponent": LAW.exponent}
        estimators: dict[str, list[RecursiveLeastSquaresEstimator]] = {
            "with ln": [SingleStageRLS(initial=law, **alone) for law in two],
            "without ln": [DoubleStageRLS(initial=law, **alone) for law in two],
            "single-stage": [SingleStageRLS(initial=law, **p0) for law in starts.values()],
            "kelvin-voigt": [KelvinVoigtRLS(initial=law, **p0) for law in linear],
        }
        for units, scale in {"": SI, ", own units": OWN}.items():
            for words, each in estimators.items():
                # Both models whole, in SI: the comparison has them.
                if "ln" in words or scale is OWN:
                    times = convergence_times([identified(contact, e, scale=scale) for e in each])
                    what = f"time {words}{units}, P₀ = {size:g}"
                    numbers |= by_symbol(what, times[:2], "s", "KB")
    known = contact.window(START + 1.0)
    power, one = known.penetration**LAW.exponent, np.ones_like(known.velocity)
    for words, regressors in {"with ln": one, "without ln": power}.items():
        columns = np.stack((regressors, regressors * known.velocity))
        numbers[f"condition number {words}"] = condition_number(columns)
    return numbers


def condition_number(columns: Floats) -> float:
    """Of regressors, one a row, each brought to unit length."""
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=1, keepdims=True)))


def threshold() -> dict[str, float]:
    """Say what ln(1 + δ) ≈ δ costs where condition 10 is used to the full; no noise at all."""
    time = np.arange(START + 0.5, START + 10.0, 1e-3)
    motion = THREE_SINES.at(time)
    x, v = motion.penetration, motion.velocity
    numbers = {"0.1 − ln 1.1": 0.1 - math.log1p(0.1), "−0.1 − ln 0.9": -0.1 - math.log1p(-0.1)}
    for share in SHARES:
        law = HuntCrossley(LAW.stiffness, share * LAW.stiffness / np.abs(v).max(), LAW.exponent)
        contact = Contact(time, penetration=x, velocity=v, force=law.force(x, v), source="exact")
        bias = 100.0 * (identified(contact, SingleStageRLS()).law.parameters / law.parameters - 1.0)
        numbers |= by_symbol(f"bias at {share:g} K/B", np.abs(bias), "%")
    return numbers


def sampled(whole: Contact) -> dict[str, float]:
    """Errors where the same contact, its pause included, is sampled more slowly than at 1 kHz."""
    numbers: dict[str, float] = {}
    for step in STEPS:
        kept = slice(None, None, step)
        slower = prepare(
            time=whole.time[kept], penetration=whole.penetration[kept], force=whole.force[kept]
        )
        result = identified(slower.window(START), SingleStageRLS())
        error = 100.0 * np.abs(result.law.parameters / LAW.parameters - 1.0)
        numbers |= by_symbol(f"error at {1000 // step} Hz", error, "%")
    return numbers


def varying(seed: int) -> dict[str, float]:
    """Errors by forgetting factor where the ball changes every two seconds."""
    run = Bench(VARYING, THREE_SINES, IdealProbe()).run(seed, seconds=12.0)
    contact = run.contact.window(START)
    stiffer = np.searchsorted(CHANGES, contact.time, side="right") % 2 == 1
    truth = np.where(stiffer, STIFFER, LAW.stiffness)
    numbers: dict[str, float] = {}
    for factor in (1.0, 0.99):
        result = identified(contact, SingleStageRLS(forgetting=ConstantForgetting(factor)))
        after = result.trace.taken & (contact.time > CHANGES[0])
        off = (result.trace.parameters[:, 0] / truth - 1.0)[after]
        numbers[f"varying rmse λ = {factor:g} [%]"] = result.prediction_rmse_percent
        numbers[f"varying error of K λ = {factor:g} [%]"] = 100.0 * np.sqrt(np.mean(off**2))
    return numbers


def conditions(contact: Contact, truth: Floats, near: Iterable[Identification]) -> dict[str, float]:
    """Say how conditions (5) and (6) fare where the double stage fails, and where it does not.

    Then they are made to hold: stage 2 is given the true K and B, stage 1 the true n.
    """
    starts = starts_of(contact, DoubleStageRLS)
    stiffness, damping, exponent = truth.tolist()
    right = {
        name: HuntCrossley(stiffness, damping, law.parameters[2]) for name, law in starts.items()
    }
    # So small a P₀ leaves K and B where they start.
    held = {"initial_covariance": (1e-12, 1e-12, 1e3)}
    ends = {
        "starts I to III": from_starts(contact, DoubleStageRLS, starts),
        "K and B given": from_starts(contact, DoubleStageRLS, right, **held),
        "n given": from_starts(contact, DoubleStageRLS, starts, exponent=exponent),
    }
    ending_right = [each for each in near if _off(each, truth) <= 100.0 * AGREED]
    seen = {"starts I to III": ends["starts I to III"].values(), "near, ending right": ending_right}
    numbers: dict[str, float] = {}
    for words, results in seen.items():
        met = np.array([_conditions(each, truth) for each in results] or [(math.nan, math.nan)])
        numbers[f"(5) broken, {words} [%]"], numbers[f"(6) one-sided, {words}"] = met.min(axis=0)
    for words, by_start in ends.items():
        every = list(by_start.values())
        numbers[f"ends apart, {words} [%]"] = 100.0 * spread(every)[-1].max()
        numbers[f"off the truth, {words} [%]"] = max(_off(each, truth) for each in every)
    return numbers


def _off(result: Identification, truth: Floats) -> float:
    return float(100.0 * np.abs(result.law.parameters / truth - 1.0).max())


def _conditions(result: Identification, truth: Floats) -> tuple[float, float]:
    """Samples that break (5), %, and |mean| over mean size of the product in (6): 0 if it holds."""
    taken, contact = result.trace.taken, result.contact
    x, v = contact.penetration[taken], contact.velocity[taken]
    stiffness, damping, exponent = (truth - result.trace.parameters[taken]).T
    rate = (stiffness + damping * v) * x ** truth[2]
    product = exponent * rate
    one_sided = abs(product.mean()) / np.abs(product).mean()
    return 100.0 * float(np.mean(np.abs(rate) > MUCH_LESS)), float(one_sided)


def wrong_exponent(contact: Contact, truth: Floats) -> dict[str, float]:
    """Say what stage 1 finds with n right, and with n too large by 0.2."""
    numbers = {"0.01^0.2": 0.01**0.2}
    for words, off in {"n right": 0.0, "n 0.2 too large": 0.2}.items():
        result = identified(contact, DoubleStageRLS(exponent=float(truth[2]) + off))
        numbers[f"stage 1 rmse, {words} [%]"] = result.prediction_rmse_percent
        numbers[f"stage 1 K, {words} [× the truth]"] = result.law.parameters[0] / truth[0]
    return numbers
