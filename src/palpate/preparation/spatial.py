"""A contact of positions and forces in space: tared, projected on the normal, counted, cut."""

import logging
import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact, between, slices_of
from palpate.digits import with_error
from palpate.errors import RecordingError
from palpate.findings import Finding, Mark
from palpate.preparation.along_penetration import (
    Place,
    Prepared,
    describe_filter,
    in_step,
    velocities_of,
    velocity_filter,
)
from palpate.preparation.clocks import Signals
from palpate.preparation.gates import noise_of
from palpate.preparation.roles import Roles
from palpate.preparation.settings import (
    Normal,
    Preparation,
    frame_of,
    grows,
    no_normal,
    normal_found,
    normal_given,
    turn_findings,
    turned,
)
from palpate.preparation.surfaces import (
    ASSUMPTION,
    Baseline,
    Stay,
    Surface,
    SurfaceRule,
    add,
    baseline_between,
    baseline_of,
    deviation_left,
    episodes_of,
    free_samples,
    never_free,
    surface_of,
    travel,
)
from palpate.preparation.velocity import step_of
from palpate.recordings import Recording
from palpate.stages import stage, timed
from palpate.validation import Floats

_LOGGER = logging.getLogger(__name__)

FIRM = 0.1  # of the largest force: an episode without as much is free air


@dataclass(slots=True, eq=False)
class AlongNormal:
    """Depth and compression along one normal.

    Attributes
    ----------
    depth : numpy.ndarray, shape (k,)
        m, growing into the material, from anywhere.
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    normal : Normal or None
        None where both are along one axis already.
    findings : list of Finding
        What was assumed.
    """

    depth: Floats
    force: Floats
    normal: Normal | None = None
    findings: list[Finding] = field(default_factory=list)


#: A time at one place, what of the probe it is, and what that is along its normal.
Piece = tuple[Signals, Stay | None, AlongNormal]


def along_normal(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact of a position and a force, tared and projected on the contact normal."""
    made, findings = dict(signals.made), list[Finding]()
    if "force" in settings.flip:
        signals = replace(signals, force=-signals.force)
    if "penetration" in settings.flip:
        signals = replace(signals, depth=-signals.depth)
    low, high = settings.window or (None, None)
    ends = -math.inf if low is None else low, math.inf if high is None else high
    signals = signals.taken(between(signals.time, *ends, recording.source))
    signals = _framed(recording, roles, signals, settings, findings)
    if settings.tool_weight is not None and signals.force.ndim == signals.depth.ndim == 2:
        add(made, "force", f"less the tool's weight of {settings.tool_weight:g} N")
    with stage(_LOGGER, "zero of the force"):
        signals, zero, said = tared(signals, settings, recording.source)
    findings += said
    if zero is not None:
        zero.say(made, findings)
    if signals.orientation is not None:
        add(made, "force", "turned by the orientation")
    with stage(_LOGGER, "contact normal"):
        whole = on_normal(signals, settings, recording.source)
    pieces = _pieces(signals, whole, settings)
    if len(pieces) > 1 or pieces[0][1] is not None:
        findings += _travelled(pieces, signals)
    findings += whole.findings
    contact, places = _joined(pieces, settings, made, findings)
    done = Prepared(
        recording,
        settings,
        zero=None if zero is None else zero.mean,
        drift=0.0 if zero is None else zero.drift,
        normal=whole.normal,
        surface=places[0].surface if places else None,
        window=velocity_filter(contact, settings.velocity_window),
        places=tuple(places) if pieces[0][1] is not None else (),
    )
    left = None if zero is None else deviation_left(whole.force, zero.free)
    contact = replace(contact, tare_deviation=left, prepared=done, source=recording.source)
    return in_step(contact, settings.delay)


@timed("frame of the force")
def _framed(
    recording: Recording,
    roles: Roles,
    signals: Signals,
    settings: Preparation,
    findings: list[Finding],
) -> Signals:
    """With an orientation only where it turns the force, which is then in the tool's frame."""
    if signals.force.ndim == 1 or signals.depth.ndim == 1:
        return replace(signals, orientation=None)
    findings += saturated(signals.force)
    frame = frame_of(recording, roles, settings.force_frame, findings)
    orientation = signals.orientation
    if orientation is not None:
        findings += turn_findings(orientation, settings.tool_weight)
    if frame == "tool" and orientation is None:
        raise RecordingError(
            f"{recording.source}: a force in the tool's frame needs the orientation to turn "
            "it; name its channels with --orientation x,y,z,w"
        )
    return signals if frame == "tool" else replace(signals, orientation=None)


@timed("episodes")
def _pieces(signals: Signals, whole: AlongNormal, settings: Preparation) -> list[Piece]:
    """The whole; or its episodes, where the probe travels over the material."""
    position, force = signals.depth, signals.force
    if position.ndim == 1 or not math.isfinite(settings.spot):
        return [(signals, None, whole)]
    if force.ndim == 1 and whole.normal is not None:
        force = force[:, None] * whole.normal.vector
    if travel(position, force) <= settings.spot:
        return [(signals, None, whole)]
    peak = float(np.nanpercentile(whole.force, 99.0))
    found: list[Piece] = []
    for part in slices_of(signals.part):
        for each in episodes_of(signals.time[part], position[part], force[part], settings.spot):
            there = np.arange(part.start + each.start, part.start + each.stop)
            if float(np.nanpercentile(whole.force[there], 99.0)) > FIRM * peak:
                own = signals.taken(there)
                found.append((own, each, _pressed_there(own, whole, settings)))
    return found or [(signals, None, whole)]


def _pressed_there(own: Signals, whole: AlongNormal, settings: Preparation) -> AlongNormal:
    """Depth and compression at one place, with the signs that the whole recording told."""
    if own.force.ndim == 1:  # its sign is that of the largest of it, there as everywhere
        return on_normal(own, settings, "")
    if whole.normal is not None and whole.normal.turned and "force" not in settings.flip:
        own = replace(own, force=-own.force)
    return on_normal(own, replace(settings, flip=(*settings.flip, "force")), "")


def _travelled(pieces: list[Piece], signals: Signals) -> list[Finding]:
    left = 1.0 - sum(len(piece[0].time) for piece in pieces) / len(signals.time)
    words, elsewhere, end = (
        f"the probe travels over the material: {len(pieces)} places, each by itself",
        "between them, or at none for a second",
        "; one law of all of them is an average",
    )
    if len(pieces) == 1:
        words = "the probe travels over the material, and stays at one place of it for a second"
        elsewhere, end = "elsewhere, and are left out", ""
    words += f"; {left:.0%} of the samples were {elsewhere}{end}" if left > 0.0 else end
    return [Finding("episodes", words, "--spot inf, where all of it is one material", "with-care")]


@timed("surface and velocity of each place")
def _joined(
    pieces: list[Piece], settings: Preparation, made: dict[str, str], findings: list[Finding]
) -> tuple[Contact, list[Place]]:
    """The pieces one after another, each from its own surface."""
    rule: SurfaceRule = settings.surface if isinstance(settings.surface, str) else "fit"
    depths, velocities, labels, places = [], [], [], []
    lost = 0
    for number, (signals, episode, own) in enumerate(pieces):
        runs = list(slices_of(signals.part))
        # A depth from anywhere has the velocity of one from the surface.
        velocity, left_out = velocities_of(signals.time, own.depth, runs, settings.velocity_window)
        if isinstance(settings.surface, float | int):
            surface = Surface(float(settings.surface), 0.0, "as it was given")
        else:
            surface = surface_of(own.depth, velocity, own.force, rule)
        depths.append(own.depth - surface.position)
        velocities.append(velocity)
        labels.append(signals.part if episode is None else np.full(len(signals.time), number))
        position = np.atleast_1d(np.nanmedian(signals.depth, axis=0))
        position = position if episode is None else episode.place
        times = float(signals.time[0]), float(signals.time[-1])
        places.append(Place(*times, position, own.normal, surface))
        lost += left_out
    _say_surface(places, made, findings)
    normal = pieces[0][2].normal
    if normal is not None and len(pieces) == 1:
        add(made, "penetration", f"against the contact normal {normal}")
        add(made, "force", f"along the contact normal {normal}")
    made["velocity"] = describe_filter(lost)
    # How well the surfaces are known, as the one number that an estimator takes.
    known = [place.surface.deviation for place in places if place.surface.deviation]
    one = rule != "estimate" and len(known) == len(places)
    contact = Contact(
        np.concatenate([signals.time for signals, _, _ in pieces]),
        penetration=np.concatenate(depths),
        velocity=np.concatenate(velocities),
        force=np.concatenate([own.force for _, _, own in pieces]),
        segment=np.concatenate(labels),
        provenance=made,
        surface_deviation=float(np.median(known)) if one else None,
        findings=findings,
    )
    return contact, places


def _say_surface(places: list[Place], made: dict[str, str], findings: list[Finding]) -> None:
    if len(places) == 1:
        places[0].surface.say(made, findings)
        return
    add(made, "penetration", "at each place along its own normal, from its own surface")
    assumed = sum(place.surface.assumed for place in places)
    if assumed:
        words = f"at {assumed} of {len(places)} places the probe is never seen out of contact: "
        remedy = "lift the probe between places"
        findings.append(Finding("surface", words + ASSUMPTION, remedy, "with-care"))


# From a position and a force in space to a depth and a compression along the contact normal.

WEIGHT_DIRECTION = (0.0, 0.0, -1.0)  # in the frame of the position
INVERSE = (-1.0, -1.0, -1.0, 1.0)  # of a quaternion x, y, z, w
NOTHING = 1e-3  # of the largest force: no sensor is linear to better
SMALL_WEIGHT, LARGE_WEIGHT = 0.01, 0.10  # of the largest force, that a weight is off
ERRORS_OF_WEIGHT, BLOCKS_OF_WEIGHT = 5.0, 8  # standard errors, by the scatter of blocks


def on_normal(signals: Signals, settings: Preparation, source: str) -> AlongNormal:
    """Project position and force on the contact normal.

    Either may be along one axis already. What is not given is found: the normal by
    :func:`~palpate.preparation.settings.normal_found`, or for a force along one axis as the
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
    if force.ndim == position.ndim == 2:
        return _in_space(position, force, given, settings, source)
    if force.ndim == 2:
        normal = given or normal_found(force, np.column_stack([position] * 3) * 0.0, source)
        return _along_axis(position, force @ normal.vector, normal, settings)
    if position.ndim == 1:
        return _along_axis(position, force, None, settings)
    normal = given or _by_motion(position, force, source)
    depth = -(position @ normal.vector)
    result = _along_axis(depth, force, normal, settings, turn_depth=False)
    if given is None:
        words = "the contact normal was taken from the motion in which the force grows"
        result.findings.append(Finding("direction", words, "--normal, where it is known"))
    return result


def _in_space(
    position: Floats, force: Floats, given: Normal | None, settings: Preparation, source: str
) -> AlongNormal:
    found, findings = given or normal_found(force, position, source), list[Finding]()
    along = force @ found.vector
    if given is None and found.turned:
        along = -along
        if "force" in settings.flip:  # what was asked for has the last word
            found = Normal(-found.vector, found.spread)
        else:
            words = "the force falls as the probe goes along it: it is that of the probe on the "
            words += "material, and its sign was turned"
            findings.append(Finding("direction", words, "--flip-force says so beforehand"))
    depth = -(position @ found.vector)
    known = np.isfinite(along)
    pulls = _is_negative(along)
    if given is not None and (pulls or not grows(depth[known], along[known])):
        how = "is mostly negative" if pulls else "falls as the probe goes in"
        words, remedy = f"along the given normal the force {how}", "--normal with the other sign"
        remedy += ", or --flip-force"
        findings.append(Finding.of_both("do-not-trust", "direction", words, remedy))
    findings += misdirected(position, force, found.vector, given=given is not None)
    return AlongNormal(depth, along, found, findings)


def _is_negative(force: Floats) -> bool:
    """Whether a force is mostly negative, weighted by its size."""
    return float(np.nansum(force * np.abs(force))) < 0.0


def _by_motion(position: Floats, force: Floats, source: str) -> Normal:
    """The direction against which the probe moves when the force grows: −Σ ΔF Δp."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(force)
    p, f = position[known], np.abs(force[known])
    total = -_products(p, f, min(STRIDE, max(len(f) // 4, 1))).sum(axis=0)
    length = float(np.linalg.norm(total))
    if not length > 0.0:
        raise no_normal(source, "the force does not change with the position")
    return Normal(total / length)


def _along_axis(
    depth: Floats,
    force: Floats,
    normal: Normal | None,
    settings: Preparation,
    *,
    turn_depth: bool = True,
) -> AlongNormal:
    """Signs of a position and a force that are along one axis."""
    findings = []
    if "force" not in settings.flip and _is_negative(force):
        force = -force
        words = "the force is mostly negative, and its sign was turned: compression is positive"
        findings.append(Finding("direction", words, "--flip-force says so beforehand"))
    both = np.isfinite(force) & np.isfinite(depth)
    asked = "penetration" in settings.flip
    if turn_depth and not asked and not grows(depth[both], force[both]):
        depth = -depth
        words = "the force grows as the position falls, so that its sign was turned"
        findings.append(Finding("direction", words, "--flip-penetration says so beforehand"))
    return AlongNormal(depth, force, normal, findings)


def tared(
    signals: Signals, settings: Preparation, source: str
) -> tuple[Signals, Baseline | None, list[Finding]]:
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
    findings = [Finding("tare", words, "record a second in free air, or --tare 0:2")]
    if found is not None:
        signals, findings = replace(signals, force=force - found.zero), []
        if down is not None:
            findings = _weight_left(signals, down, found, weight, source)
        force = signals.force
    if signals.orientation is not None:
        force = turned(force, signals.orientation, source)
    return replace(signals, force=force), found, findings


def _zero(signals: Signals, settings: Preparation, source: str) -> Baseline | None:
    """What the sensor shows out of contact, in its own axes; None where that is never seen."""
    tare, force = settings.tare, signals.force
    if isinstance(tare, tuple):
        return baseline_between(signals.time, force, tare, source)
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
        raise never_free(source)
    return None


def _weight_left(
    signals: Signals, down: Floats, found: Baseline, weight: float | None, source: str
) -> list[Finding]:
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
    rest = np.array_split((m * (f - left * m)).sum(axis=1), BLOCKS_OF_WEIGHT)
    error = float(np.linalg.norm([each.sum() for each in rest])) / energy
    off, whole = abs(left) * reach / peak, (weight or 0.0) + left
    if abs(left) <= ERRORS_OF_WEIGHT * error or off <= SMALL_WEIGHT:
        return []
    words = f"in free air the force turns as a weight of {with_error(whole, error, unit='N')} does"
    remedy = f"--tool-weight {whole:.3g}N, if the tool can weigh that"
    if whole < 0.0:
        remedy = "--flip-force, if the sensor shows the force of the probe on the material"
    if weight is not None:
        words += f", not of {weight:g} N"
    mark: Mark = "do-not-trust" if off > LARGE_WEIGHT else "with-care"
    return [Finding.of_both(mark, "tool weight", words, remedy)]


def _free(signals: Signals, along: Floats) -> NDArray[np.bool_] | None:
    """Samples out of contact: at one end of the way along the normal, where the force is constant.

    At which end follows from nothing that is known yet: the sensor may feel either side's force.
    The normal is that of ``along``, the force in the frame of the position.
    """
    height = signals.depth
    if height.ndim == 2 and along.ndim == 1:
        height = height @ _by_motion(height, along, "").vector
    elif height.ndim == 2:  # in which a force varies most, whatever its zero is
        known = along[np.isfinite(along).all(axis=1)]
        height = height @ np.linalg.svd(known - known.mean(axis=0), full_matrices=False)[2][0]
    ends = [free_samples(side * height, signals.force) for side in (1.0, -1.0)]
    found = [end for end in ends if end is not None]
    return max(found, key=np.count_nonzero, default=None)


# Doubts about forces in space: one that misses the probe's motion, and an axis that is full.

# Turned by 5° a depth is 0.4 % short, and the stiffness of a law with an exponent of 2 is 1 % off;
# by 30° it is 14 % and 30 %. A tool is aligned with its sensor to better than 3°.
LARGE_ANGLE, TOO_LARGE_ANGLE = math.radians(5.0), math.radians(30.0)
BLOCKS_OF_DIRECTION = 8  # of a recording, whose scatter says how well the direction is known
ERRORS_OF_DIRECTION = 3.0  # standard errors of it
STRIDE = 5  # samples over which changes are taken: over fewer they are noise

SHORTEST = 5  # samples in a row
MOVES, STEPS = 8.0, 3.0  # σ and steps that the other axes move meanwhile
SOME, MANY = 0.002, 0.02  # of the recording


def misdirected(position: Floats, force: Floats, normal: Floats, *, given: bool) -> list[Finding]:
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
    if angle <= LARGE_ANGLE + ERRORS_OF_DIRECTION * error:
        return []
    return [
        Finding.of_both(
            "do-not-trust" if angle > TOO_LARGE_ANGLE else "with-care",
            "direction",
            f"{of} {math.degrees(angle):.0f}° away from the {other}: axes of another frame, turned "
            "or swapped, a zero that is off, friction, or a slope that the probe slides down",
            "compare the axes of force and position; --force-frame tool, --tare or --normal",
        )
    ]


def _direction(position: Floats, along: Floats) -> tuple[Floats | None, float]:
    """The direction in which the probe moves as the force grows, and its standard error, rad."""
    known = np.isfinite(position).all(axis=1) & np.isfinite(along)
    p, f = position[known], along[known]
    if len(f) < 2 * BLOCKS_OF_DIRECTION * STRIDE:
        return None, math.inf
    products = _products(p, f, STRIDE)
    sums = np.array([part.sum(axis=0) for part in np.array_split(products, BLOCKS_OF_DIRECTION)])
    total = sums.sum(axis=0)
    length = float(np.linalg.norm(total))
    if not 0.0 < length < math.inf:
        return None, math.inf
    direction: Floats = total / length
    across = sums - np.outer(sums @ direction, direction)
    # The blocks' sums vary about a share of the total; what is across of it adds to nothing.
    scatter = float((across**2).sum()) * BLOCKS_OF_DIRECTION / (BLOCKS_OF_DIRECTION - 1)
    return direction, math.sqrt(scatter) / length


def _products(position: Floats, force: Floats, stride: int) -> Floats:
    """ΔF Δp over a stride, which point along the motion in which a force grows."""
    return (force[stride:] - force[:-stride])[:, None] * (position[stride:] - position[:-stride])


def _angle(one: Floats, other: Floats) -> float:
    """Between two axes, whichever way they point."""
    across = float(np.linalg.norm(np.cross(one, other)))
    return math.atan2(across, abs(float(one @ other)))


def saturated(force: Floats) -> list[Finding]:
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
    found = [Finding("force axes", words)] if axes else []
    beyond = [MOVES * noise_of(column) + STEPS * step_of(column) for column in force.T]
    for k, column in enumerate(force.T):
        others = [each for each in range(force.shape[1]) if each != k]
        for edge in (np.nanmax(column), np.nanmin(column)) if moves[k] else ():
            held = (run for run in slices_of(column == edge) if column[run.start] == edge)
            count = sum(
                run.stop - run.start
                for run in held
                if run.stop - run.start >= SHORTEST
                and any(np.ptp(force[run, each]) > beyond[each] for each in others)
            )
            part = count / len(column)
            if part > SOME:
                words = f"the force along {'xyz'[k]} stays at {edge:.3g} N for {part:.1%} of the "
                words += "recording while the others change: saturated?"
                remedy = "press less deep, or take a sensor of a larger range"
                mark: Mark = "do-not-trust" if part > MANY else "with-care"
                found.append(Finding.of_both(mark, "saturation", words, remedy))
    return found
