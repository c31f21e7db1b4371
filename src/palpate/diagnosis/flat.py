"""Saturation and a stuck force: the sensor stands still while the material does not."""

import numpy as np

from palpate.diagnosis.finding import Finding, Mark, severity_of
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.inputs.held import beat_of
from palpate.digits import rounded

SHORTEST = 5  # samples
MOVES = 4.0  # of the noise or the step, that the law's force moves meanwhile
SOME, MANY = 0.01, 0.05  # of the samples in contact


def flat(fit: Fit) -> Finding | None:
    """Runs of 5 and more equal forces while the law's force moves by more than 4 max(σ, step).

    Of a force that is held, which has a check of its own, runs of more than two beats.
    """
    force, inside = fit.data.force, fit.inside | (fit.rejected & (fit.penetration > 0.0))
    shortest = max(SHORTEST, 2 * beat_of(force) + 1)
    borders = np.flatnonzero(np.diff(force, prepend=np.nan, append=np.nan) != 0.0)
    lengths = np.diff(borders)
    long = np.flatnonzero((lengths >= shortest) & inside[borders[:-1]])
    if not long.size:
        return None
    moving = MOVES * max(fit.data.force_noise, fit.data.force_step)
    top = float(force[inside].max())
    at_top = elsewhere = 0
    for start, length in zip(borders[long].tolist(), lengths[long].tolist(), strict=True):
        part = slice(start, start + length)
        x = np.maximum(fit.penetration[part], 0.0)
        if np.ptp(fit.law.force(x, fit.data.velocity[part])) > moving:
            at_top += length * (force[start] >= top)
            elsewhere += length * (force[start] < top)
    count = int(np.count_nonzero(inside))
    return _said(at_top / count, elsewhere / count, top)


def _said(at_top: float, elsewhere: float, top: float) -> Finding | None:
    part = max(at_top, elsewhere)
    if part <= SOME:
        return None
    mark: Mark = "do-not-trust" if part > MANY else "with-care"
    words = (
        f"the force stays at its largest, {rounded(top, 3)} N, for {part:.1%} of the contact: "
        "saturated?"
        if at_top >= elsewhere
        else f"the force stands still for {part:.1%} of the contact while the probe moves"
    )
    return Finding(
        "saturation" if at_top >= elsewhere else "stuck force",
        words,
        "press less deep, or take a sensor of a larger range"
        if at_top >= elsewhere
        else "look after the sensor's connection",
        stiffness=mark,
        damping=mark,
        severity=severity_of(mark),
    )
