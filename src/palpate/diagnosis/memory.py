"""Memory: a branch that relaxes, as viscoelastic materials have."""

import math
from dataclasses import replace

import numpy as np

from palpate.diagnosis.alike import Alike
from palpate.diagnosis.cause import Cause, beside
from palpate.diagnosis.columns import cause_of
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.laws import remedy_of_memory
from palpate.digits import rounded
from palpate.validation import Floats

TIMES = 7  # relaxation times tried, from P/30 to 0.7 of the recording
BLOCK = 64  # samples that are relaxed at once


def memory(fit: Fit) -> list[Cause]:
    """Fit dh/dt = d(ξⁿ)/dt − h/τ beside the law, with the best of seven τ.

    At the motion's frequency ω the branch adds q²/(1 + q²) of its force to the stiffness and
    τ/(1 + q²) to the damping, q = ωτ: without that a dynamic stiffness is called 50 % wrong.
    """
    data = fit.data
    steps = np.diff(data.time, prepend=data.time[0])
    duration = float(steps.sum())
    shortest = max(8.0 * data.sample_time, fit.period / 30.0)
    if not 0.0 < shortest < 0.7 * duration:
        return []
    law, x = fit.solution.law, np.maximum(fit.penetration / fit.units.depth, 0.0)
    at_depth = fit.force_at_depth(law) or 1.0
    spring = law.force(x, np.zeros_like(x)) / at_depth
    best, time = None, shortest
    for tau in np.geomspace(shortest, 0.7 * duration, TIMES):
        state = relaxed(spring, steps, float(tau), data.sample_time)
        found = beside(fit, fit.band.mean(state[fit.band.samples]))
        if found is not None and (best is None or found.gain > best.gain):
            best, time = found, float(tau)
    if best is None:
        return []
    cause = cause_of(fit, "memory", best, "", "")
    turn = 2.0 * math.pi * time / fit.period
    part, change = best.amount / (1.0 + turn**2) / at_depth, best.change

    def moves(other: Fit) -> tuple[float, float]:
        stiffness, damping = other.moves(change)
        slope = part * other.stiffness(law)
        by_branch = turn**2 * slope / other.sizes[0], time * slope / other.sizes[1]
        return stiffness + by_branch[0], damping + by_branch[1]

    sentence, remedy = _words(fit, time)
    return [replace(cause.moving(fit, moves), parameter=0.0, sentence=sentence, remedy=remedy)]


def _words(fit: Fit, time: float) -> tuple[str, str]:
    """What was found, and what to do; where the law may remember, it is beside its memory."""
    over = f"about {rounded(time, 2)} s"
    if not isinstance(fit.estimate, Alike):
        return (
            f"the material remembers for {over}: its stiffness is that at "
            f"{rounded(1.0 / fit.period, 2)} Hz",
            remedy_of_memory(fit.laws, time),
        )
    parts = "identify parts of the recording, with --start and --stop"
    if fit.estimate.longest == 0.0:
        return (
            f"beside the law the force relaxes over {over}, and no law with memory that was "
            "offered explains it better: a sensor may drift, or the material change",
            parts,
        )
    if time > fit.estimate.longest:
        return (
            f"beside what the law remembers the force relaxes over {over}, as where a sensor "
            "drifts or a material softens",
            parts,
        )
    return (
        f"the force relaxes over {over} otherwise than by the law's spectrum",
        remedy_of_memory(fit.laws, time),
    )


def relaxed(drive: Floats, steps: Floats, tau: float, sample_time: float) -> Floats:
    """State h of dh = d(drive) − h dt/τ, from h = 0; on the median step within a block of samples.

    Exact on an even time base. On an uneven one the decay over a block of 64 is that of its own
    time, and within it that of the median step.
    """
    decay = math.exp(-sample_time / tau)
    power = decay ** np.arange(BLOCK + 1)
    lower = np.tril(power[np.abs(np.subtract.outer(np.arange(BLOCK), np.arange(BLOCK)))])
    blocks = -(-len(drive) // BLOCK)
    rise = np.zeros(blocks * BLOCK)
    rise[1 : len(drive)] = np.diff(drive)
    local = rise.reshape(blocks, BLOCK) @ lower.T
    elapsed = np.zeros(blocks * BLOCK)
    elapsed[: len(drive)] = steps
    over = np.exp(-elapsed.reshape(blocks, BLOCK).sum(axis=1) / tau).tolist()
    carried, state = np.empty(blocks), 0.0
    for block, (end, fade) in enumerate(zip(local[:, -1].tolist(), over, strict=True)):
        carried[block] = state
        state = end + fade * state
    return (local + carried[:, None] * power[1:]).reshape(-1)[: len(drive)]
