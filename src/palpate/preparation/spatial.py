"""From a position and a force in space to a depth and a compression along the contact normal."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.preparation.baselines import Baseline, baseline_of, free_samples
from palpate.preparation.doubts import misdirected
from palpate.preparation.normals import Normal, grows, normal_found, normal_given
from palpate.preparation.settings import Preparation
from palpate.preparation.signals import Signals
from palpate.preparation.wrenches import turned
from palpate.remarks import Remark
from palpate.validation import Floats

WEIGHT_DIRECTION = (0.0, 0.0, -1.0)  # in the frame of the position
INVERSE = (-1.0, -1.0, -1.0, 1.0)  # of a quaternion x, y, z, w
NOTHING = 1e-3  # of the largest force: no sensor is linear to better
SMALL, LARGE = 0.01, 0.10  # of the largest force, that a weight is off
ERRORS, BLOCKS = 5.0, 8  # standard errors, by the scatter of blocks


@dataclass(slots=True, eq=False)
class Pressed:
    """Depth and compression along one normal.

    Attributes
    ----------
    depth : numpy.ndarray, shape (k,)
        m, growing into the material, from anywhere.
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    normal : Normal or None
        None where both are along one axis already.
    remarks : list of Remark
        What was assumed.
    """

    depth: Floats
    force: Floats
    normal: Normal | None = None
    remarks: list[Remark] = field(default_factory=list)


def pressed(signals: Signals, settings: Preparation, source: str) -> Pressed:
    """Project position and force on the contact normal.

    Either may be along one axis already. What is not given is found: the normal by
    :func:`~palpate.preparation.normals.normal_found`, or for a force along one axis as the
    direction in which the probe moves when that grows; signs so that compression is positive, and
    grows with the depth.

    Parameters
    ----------
    signals : Signals
        On one clock, the force tared.
    settings : Preparation
        Of which ``normal`` and ``flip`` count.
    source : str
        For messages.
    """
    position, force = signals.depth, signals.force
    given = None if settings.normal is None else normal_given(settings.normal)
    signed = "force" in settings.flip
    if force.ndim == 2:
        if position.ndim == 2:
            return _in_space(position, force, given, signed=signed, source=source)
        normal = given or normal_found(force, np.column_stack([position] * 3) * 0.0, source)
        along = force @ normal.vector
        return _along_axis(position, along, normal, settings)
    if position.ndim == 2:
        normal = given or _by_motion(position, force, source)
        return _with_force(position, force, normal, settings, found=given is None)
    return _along_axis(position, force, None, settings)


def _in_space(
    position: Floats, force: Floats, given: Normal | None, *, signed: bool, source: str
) -> Pressed:
    found = given or normal_found(force, position, source)
    n, remarks = found.vector, []
    along = force @ n
    if given is None and found.turned and not signed:
        along = -along
        remarks.append(_turned("falls"))
    elif given is None and found.turned:
        n = -n  # what was asked for has the last word
        found = Normal(n, found.spread)
        along = force @ n
    if given is not None:
        remarks += _against(-(position @ n), along)
    remarks += misdirected(position, force, n, given=given is not None)
    return Pressed(-(position @ n), along, found, remarks)


def _against(depth: Floats, force: Floats) -> list[Remark]:
    """Say that a given normal does not fit: compression is negative, or falls with the depth."""
    known = np.isfinite(force)
    f = force[known]
    pulls = float(np.sum(f * np.abs(f))) < 0.0
    if not pulls and grows(depth[known], f):
        return []
    words = "is mostly negative" if pulls else "falls as the probe goes in"
    return [
        Remark(
            "direction",
            f"along the given normal the force {words}",
            "--normal with the other sign, or --flip-force",
            "do-not-trust",
        )
    ]


def _turned(how: str) -> Remark:
    return Remark(
        "direction",
        f"the force {how} as the probe goes along it: it is that of the probe on the material, and "
        "its sign was turned",
        "--flip-force says so beforehand",
    )


def _by_motion(position: Floats, force: Floats, source: str) -> Normal:
    """The direction against which the probe moves when the force grows: −Σ ΔF Δp."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(force)
    p, f = position[known], np.abs(force[known])
    stride = min(5, max(len(f) // 4, 1))
    moved, felt = p[stride:] - p[:-stride], f[stride:] - f[:-stride]
    total = -(felt[:, None] * moved).sum(axis=0)
    length = float(np.linalg.norm(total))
    if not length > 0.0:
        where = f"{source}: " if source else ""
        raise RecordingError(
            f"{where}the force does not change with the position, so that the contact normal "
            "cannot be found; give it with --normal, such as --normal z"
        )
    return Normal(total / length)


def _with_force(
    position: Floats, force: Floats, normal: Normal, settings: Preparation, *, found: bool
) -> Pressed:
    result = _along_axis(-(position @ normal.vector), force, normal, settings, turn_depth=False)
    words = "the contact normal was taken from the motion in which the force grows"
    if found:
        result.remarks.append(Remark("direction", words, "--normal, where it is known"))
    return result


def _along_axis(
    depth: Floats,
    force: Floats,
    normal: Normal | None,
    settings: Preparation,
    *,
    turn_depth: bool = True,
) -> Pressed:
    """Signs of a position and a force that are along one axis."""
    remarks = []
    known = np.isfinite(force)
    f = force[known]
    if "force" not in settings.flip and f.size and float(np.sum(f * np.abs(f))) < 0.0:
        force = -force
        words = "the force is mostly negative, and its sign was turned: compression is positive"
        remarks.append(Remark("direction", words, "--flip-force says so beforehand"))
    both = known & np.isfinite(depth)
    asked = "penetration" in settings.flip
    if turn_depth and not asked and not grows(depth[both], force[both]):
        depth = -depth
        words = "the force grows as the position falls, so that its sign was turned"
        remarks.append(Remark("direction", words, "--flip-penetration says so beforehand"))
    return Pressed(depth, force, normal, remarks)


def tared(
    signals: Signals, settings: Preparation, source: str
) -> tuple[Signals, Baseline | None, list[Remark]]:
    """Take off the tool's weight, and what the sensor shows out of contact; turn the force.

    Out of contact is between two times, or where that is found. A sensor with an orientation has
    its offset in its own axes, in which the weight turns: both are taken off there, before the
    force is turned into the position's frame.
    """
    force, weight, down = signals.force, settings.tool_weight, None
    if signals.orientation is not None:
        down = turned(np.array(WEIGHT_DIRECTION), signals.orientation * INVERSE, source)
    elif weight is not None and force.ndim == signals.depth.ndim == 2:
        down = np.broadcast_to(WEIGHT_DIRECTION, force.shape)
    if down is not None:
        force = force - (weight or 0.0) * down
    found = _zero(replace(signals, force=force), settings, source)
    words = "no time out of contact was found: the zero of the force is the sensor's own"
    remarks = [Remark("tare", words, "record a second in free air, or --tare 0:2")]
    if found is not None:
        signals, remarks = replace(signals, force=force - found.zero), []
        if down is not None:
            remarks = _weight_left(signals, down, found, weight, source)
        force = signals.force
    if signals.orientation is not None:
        force = turned(force, signals.orientation, source)
    return replace(signals, force=force), found, remarks


def _zero(signals: Signals, settings: Preparation, source: str) -> Baseline | None:
    """What the sensor shows out of contact, in its own axes; None where that is never seen."""
    tare, force = settings.tare, signals.force
    where = f"{source}: " if source else ""
    if isinstance(tare, tuple):
        free = (signals.time >= tare[0]) & (signals.time <= tare[1])
        free &= np.isfinite(force).reshape(len(free), -1).all(axis=1)
        if not free.any():
            raise RecordingError(
                f"{where}no sample between {tare[0]:g} s and {tare[1]:g} s to tare the force with"
            )
        zero = np.broadcast_to(force[free].mean(axis=0), force.shape)
        return Baseline(free, zero, 0.0)
    if signals.orientation is not None:
        # An offset that turns hides the axis of the contact: twice, the second time without it.
        along = force - np.nanmedian(force, axis=0)
        for _ in range(2):
            mask = _free(signals, turned(along, signals.orientation, source))
            if mask is not None:
                along = force - baseline_of(signals.time, force, mask).mean
    else:
        mask = _free(signals, force)
    if mask is not None:
        return baseline_of(signals.time, force, mask)
    if tare == "find":
        raise RecordingError(
            f"{where}the probe is never seen out of contact, so that no zero of the force can "
            "be found; give a time without contact, --tare 0:2"
        )
    return None


def _weight_left(
    signals: Signals, down: Floats, found: Baseline, weight: float | None, source: str
) -> list[Remark]:
    """Say by how much the weight is off, by the force in free air; refuse one without effect."""
    time, force = signals.time, signals.force
    free = found.free & np.isfinite(force).all(axis=1) & np.isfinite(down).all(axis=1)
    moved = down - down[free].mean(axis=0)
    peak = float(np.nanpercentile(np.linalg.norm(force, axis=1), 99.0))
    reach = float(np.nanmax(np.linalg.norm(moved, axis=1)))
    if weight and weight * reach <= NOTHING * peak:
        raise RecordingError(
            f"{source}: --tool-weight {weight:g} N changes nothing: in the frame of the force the "
            "weight is constant, and the tare removes it with the sensor's offset; leave it out, "
            "or give --force-frame tool where the sensor turns with the tool"
        )
    m, f = moved[free], force[free]
    if found.drift:  # what of the weight goes with time is in the drift
        t = time[free] - time[free].mean()
        m = m - np.outer(t, t @ m / (t @ t))
    energy = max(float((m**2).sum()), 1e-300)
    left = float((m * f).sum()) / energy
    # The scatter of blocks: neighbouring samples of a force correlate.
    rest = np.array_split((m * (f - left * m)).sum(axis=1), BLOCKS)
    error = float(np.linalg.norm([each.sum() for each in rest])) / energy
    off, whole = abs(left) * reach / peak, (weight or 0.0) + left
    if abs(left) <= ERRORS * error or off <= SMALL:
        return []
    words = f"in free air the force turns as a weight of {with_error(whole, error, unit='N')} does"
    remedy = f"--tool-weight {whole:.3g}N, if the tool can weigh that"
    if whole < 0.0:
        remedy = "--flip-force, if the sensor shows the force of the probe on the material"
    if weight is not None:
        words += f", not of {weight:g} N"
    if off > LARGE:
        return [Remark("tool weight", words, remedy, "do-not-trust", numbers=True)]
    return [Remark("tool weight", words, remedy, "with-care", numbers=True)]


def _free(signals: Signals, along: Floats) -> NDArray[np.bool_] | None:
    """Samples out of contact: at one end of the way along the normal, where the force is constant.

    At which end follows from nothing that is known yet: the sensor may feel either side's force.
    The normal is that of ``along``, the force in the frame of the position.
    """
    height = signals.depth
    if height.ndim == 2:
        axis = _axis(along) if along.ndim == 2 else _by_motion(height, along, "").vector
        height = height @ axis
    ends = [free_samples(side * height, signals.force) for side in (1.0, -1.0)]
    found = [end for end in ends if end is not None]
    return max(found, key=np.count_nonzero, default=None)


def _axis(force: Floats) -> Floats:
    """The direction in which a force varies most, whatever its zero is."""
    known = force[np.isfinite(force).all(axis=1)]
    _, _, rows = np.linalg.svd(known - known.mean(axis=0), full_matrices=False)
    axis: Floats = rows[0]
    return axis
