"""Doubts about forces in space: one that misses the probe's motion, and an axis that is full."""

import math

import numpy as np

from palpate.errors import RecordingError
from palpate.preparation.normals import normal_found
from palpate.preparation.spikes import step_of
from palpate.preparation.suggestions import noise_of
from palpate.remarks import Remark
from palpate.validation import Floats

# Turned by 5° a depth is 0.4 % short, and the stiffness of a law with an exponent of 2 is 1 % off;
# by 30° it is 14 % and 30 %. A tool is aligned with its sensor to better than 3°.
LARGE, TOO_LARGE = math.radians(5.0), math.radians(30.0)
BLOCKS = 8  # of a recording, whose scatter says how well the direction is known
ERRORS = 3.0  # standard errors of it
STRIDE = 5  # samples over which changes are taken: over fewer they are noise

SHORTEST = 5  # samples in a row
MOVES, STEPS = 8.0, 3.0  # σ and steps that the other axes move meanwhile
SOME, MANY = 0.002, 0.02  # of the recording


def misdirected(position: Floats, force: Floats, normal: Floats, *, given: bool) -> list[Remark]:
    """Say that forces do not point along the motion in which they grow.

    The motion, −Σ ΔF Δp, owes nothing to the axes of the force: one of them turned or swapped, the
    tool's taken for the base's, a zero that is off, or friction set the two apart; so does a probe
    that slides down a slope without friction, of which the normal is right.

    Parameters
    ----------
    position, force : numpy.ndarray, shape (k, 3)
        m and N, in one frame as far as is known.
    normal : numpy.ndarray, shape (3,)
        What both are projected on.
    given : bool
        It was: then it is enough that the motion or the forces agree with it.
    """
    motion, error = _direction(position, force @ normal)
    if motion is None:
        return []
    angle, other = _angle(motion, normal), "motion in which it grows"
    of = "the force points"
    if given:
        of, other = "the given normal points", "force and from the motion in which it grows"
        try:
            angle = min(angle, _angle(normal_found(force, 0.0 * position).vector, normal))
        except RecordingError:
            return []
    if angle <= LARGE + ERRORS * error:
        return []
    return [
        Remark(
            "direction",
            f"{of} {math.degrees(angle):.0f}° away from the {other}: axes of another frame, turned "
            "or swapped, a zero that is off, friction, or a slope that the probe slides down",
            "compare the axes of force and position; --force-frame tool, --tare or --normal",
            "do-not-trust" if angle > TOO_LARGE else "with-care",
            numbers=True,
        )
    ]


def _direction(position: Floats, along: Floats) -> tuple[Floats | None, float]:
    """The direction in which the probe moves as the force grows, and its standard error, rad."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(along)
    p, f = position[known], along[known]
    if len(f) < 2 * BLOCKS * STRIDE:
        return None, math.inf
    products = (f[STRIDE:] - f[:-STRIDE])[:, None] * (p[STRIDE:] - p[:-STRIDE])
    sums = np.array([part.sum(axis=0) for part in np.array_split(products, BLOCKS)])
    total = sums.sum(axis=0)
    length = float(np.linalg.norm(total))
    if not 0.0 < length < math.inf:
        return None, math.inf
    direction: Floats = total / length
    across = sums - np.outer(sums @ direction, direction)
    # The blocks' sums vary about a share of the total; what is across of it adds to nothing.
    return direction, math.sqrt(float((across**2).sum()) * BLOCKS / (BLOCKS - 1)) / length


def _angle(one: Floats, other: Floats) -> float:
    """Between two axes, whichever way they point."""
    across = float(np.linalg.norm(np.cross(one, other)))
    return math.atan2(across, abs(float(one @ other)))


def saturated(force: Floats) -> list[Remark]:
    """Say that an axis of the sensor stands at its largest value while the others go on.

    One that never changes is not saturated but not measured, as those of a load cell of one axis.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        N, as the sensor shows it: once turned or tared nothing stands still.
    """
    moves = [bool(np.isfinite(c).any() and np.nanmin(c) < np.nanmax(c)) for c in force.T]
    axes = " and ".join(axis for axis, moving in zip("xyz", moves, strict=True) if not moving)
    words = f"the force along {axes} is constant from first to last: it is not measured"
    found = [Remark("force axes", words)] if axes else []
    noise = [noise_of(column) for column in force.T]
    for k, column in enumerate(force.T):
        others = [each for each in range(force.shape[1]) if each != k]
        for edge in (np.nanmax(column), np.nanmin(column)) if moves[k] else ():
            held = np.flatnonzero(np.diff(np.concatenate([[0], column == edge, [0]])))
            runs = [
                slice(start, stop)
                for start, stop in zip(held[0::2], held[1::2], strict=True)
                if stop - start >= SHORTEST
            ]
            count = sum(
                part.stop - part.start
                for part in runs
                if any(
                    np.ptp(force[part, each])
                    > MOVES * noise[each] + STEPS * step_of(force[:, each])
                    for each in others
                )
            )
            if count > SOME * len(column):
                found.append(_saturation("xyz"[k], float(edge), count / len(column)))
    return found


def _saturation(axis: str, edge: float, part: float) -> Remark:
    return Remark(
        "saturation",
        f"the force along {axis} stays at {edge:.3g} N for {part:.1%} of the recording while the "
        "others change: saturated?",
        "press less deep, or take a sensor of a larger range",
        "do-not-trust" if part > MANY else "with-care",
        numbers=True,
    )
