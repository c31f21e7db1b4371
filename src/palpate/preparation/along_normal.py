"""A recording of positions and forces, in space or along an axis: tared, projected, counted."""

import logging
import math
from dataclasses import replace

import numpy as np

from palpate.contact import Contact
from palpate.digits import rounded
from palpate.errors import RecordingError
from palpate.preparation.along_penetration import (
    assumption,
    filter_words,
    velocities_of,
    velocity_filter,
)
from palpate.preparation.baselines import Baseline
from palpate.preparation.corrections import add
from palpate.preparation.doubts import saturated
from palpate.preparation.episodes import Episode, episodes_of, travel
from palpate.preparation.prepared import Place, Prepared
from palpate.preparation.roles import Roles
from palpate.preparation.rows import runs_of
from palpate.preparation.settings import Preparation
from palpate.preparation.signals import Signals
from palpate.preparation.spatial import Pressed, pressed, tared
from palpate.preparation.surfaces import Surface, SurfaceRule, surface_of
from palpate.preparation.tare import deviation_left
from palpate.preparation.wrenches import frame_of, turn_remark
from palpate.recordings import Recording
from palpate.remarks import Remark
from palpate.stages import stage, timed
from palpate.validation import Floats

_LOGGER = logging.getLogger(__name__)

FIRM = 0.1  # of the largest force: an episode without as much is free air


def along_normal(
    recording: Recording, roles: Roles, signals: Signals, settings: Preparation
) -> Contact:
    """Make a contact of a position and a force, tared and projected on the contact normal."""
    made, remarks = dict(signals.made), list[Remark]()
    signals = _windowed(_flipped(signals, settings), settings, recording.source)
    signals = _framed(recording, roles, signals, settings, remarks)
    if settings.tool_weight is not None and signals.force.ndim == signals.depth.ndim == 2:
        add(made, "force", f"less the tool's weight of {settings.tool_weight:g} N")
    with stage(_LOGGER, "zero of the force"):
        signals, zero, said = tared(signals, settings, recording.source)
    remarks += said
    if zero is not None:
        _say_tare(zero, made, remarks)
    if signals.orientation is not None:
        add(made, "force", "turned by the orientation")
    with stage(_LOGGER, "contact normal"):
        whole = pressed(signals, settings, recording.source)
    pieces = _pieces(signals, whole, settings)
    if len(pieces) > 1 or pieces[0][1] is not None:
        remarks += _travelled(pieces, signals)
    remarks += whole.remarks
    contact, places = _joined(pieces, settings, made, remarks)
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
    return settings.corrections().in_step(contact)


Piece = tuple[Signals, Episode | None, Pressed]


def _flipped(signals: Signals, settings: Preparation) -> Signals:
    if "force" in settings.flip:
        signals = replace(signals, force=-signals.force)
    if "penetration" in settings.flip:
        signals = replace(signals, depth=-signals.depth)
    return signals


def _windowed(signals: Signals, settings: Preparation, source: str) -> Signals:
    low, high = settings.window or (None, None)
    keep = (signals.time >= (-math.inf if low is None else low)) & (
        signals.time <= (math.inf if high is None else high)
    )
    if not keep.any():
        where = f"{source}: " if source else ""
        raise RecordingError(
            f"{where}no sample between {low} s and {high} s; time runs from "
            f"{signals.time.min():g} s to {signals.time.max():g} s"
        )
    return signals.taken(keep)


@timed("frame of the force")
def _framed(
    recording: Recording,
    roles: Roles,
    signals: Signals,
    settings: Preparation,
    remarks: list[Remark],
) -> Signals:
    """With an orientation only where it turns the force, which is then in the tool's frame."""
    if signals.force.ndim == 1 or signals.depth.ndim == 1:
        return replace(signals, orientation=None)
    remarks += saturated(signals.force)
    frame = frame_of(recording, roles, settings.force_frame, remarks)
    orientation = signals.orientation
    if orientation is not None:
        remarks += turn_remark(orientation, settings.tool_weight)
    if frame == "tool" and orientation is None:
        raise RecordingError(
            f"{recording.source}: a force in the tool's frame needs the orientation to turn "
            "it; name its channels with --orientation x,y,z,w"
        )
    return signals if frame == "tool" else replace(signals, orientation=None)


def _say_tare(zero: Baseline, made: dict[str, str], remarks: list[Remark]) -> None:
    count = int(np.count_nonzero(zero.free))
    listed = ", ".join(f"{rounded(value, 3)}" for value in zero.mean)
    add(made, "force", f"less {listed} N, its mean over {count} samples out of contact")
    if zero.drift:
        words = f"the zero of the force drifts by {rounded(zero.drift, 3)} N, which was taken off"
        remarks.append(Remark("tare", words, "let the sensor warm up"))
        add(made, "force", f"and its drift of {rounded(zero.drift, 3)} N")


@timed("episodes")
def _pieces(signals: Signals, whole: Pressed, settings: Preparation) -> list[Piece]:
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
    for start, stop in runs_of(signals.part):
        part = slice(start, stop)
        for each in episodes_of(
            signals.time[part], position[part], force[part], radius=settings.spot
        ):
            own = signals.taken(np.arange(start + each.start, start + each.stop))
            if (
                float(np.nanpercentile(whole.force[part][each.start : each.stop], 99.0))
                > FIRM * peak
            ):
                found.append((own, each, _pressed_there(own, whole, settings)))
    if not found:
        return [(signals, None, whole)]
    return found


def _pressed_there(own: Signals, whole: Pressed, settings: Preparation) -> Pressed:
    """Depth and compression at one place, with the signs that the whole recording told."""
    if own.force.ndim == 1:  # its sign is that of the largest of it, there as everywhere
        return pressed(own, settings, "")
    if whole.normal is not None and whole.normal.turned and "force" not in settings.flip:
        own = replace(own, force=-own.force)
    return pressed(own, replace(settings, flip=(*settings.flip, "force")), "")


def _travelled(pieces: list[Piece], signals: Signals) -> list[Remark]:
    kept = sum(len(piece[0].time) for piece in pieces)
    left = 1.0 - kept / len(signals.time)
    if len(pieces) == 1:
        words = "the probe travels over the material, and stays at one place of it for a second"
        if left > 0.0:
            words += f"; {left:.0%} of the samples were elsewhere, and are left out"
    else:
        words = f"the probe travels over the material: {len(pieces)} places, each by itself"
        if left > 0.0:
            words += f"; {left:.0%} of the samples were between them, or at none for a second"
        words += "; one law of all of them is an average"
    return [Remark("episodes", words, "--spot inf, where all of it is one material", "with-care")]


@timed("surface and velocity of each place")
def _joined(
    pieces: list[Piece], settings: Preparation, made: dict[str, str], remarks: list[Remark]
) -> tuple[Contact, list[Place]]:
    """The pieces one after another, each from its own surface."""
    rule: SurfaceRule = settings.surface if isinstance(settings.surface, str) else "fit"
    depths, velocities, labels, places = [], [], [], []
    lost = 0
    for number, (signals, episode, own) in enumerate(pieces):
        runs = [slice(*run) for run in runs_of(signals.part)]
        # A depth from anywhere has the velocity of one from the surface.
        velocity, left_out = velocities_of(signals.time, own.depth, runs, settings.velocity_window)
        surface = _surface(own, velocity, settings, rule)
        depths.append(own.depth - surface.position)
        velocities.append(velocity)
        labels.append(signals.part if episode is None else np.full(len(signals.time), number))
        places.append(_place(signals, episode, own, surface))
        lost += left_out
    _say_surface(places, made, remarks)
    normal = pieces[0][2].normal
    if normal is not None and len(pieces) == 1:
        add(made, "penetration", f"against the contact normal {normal}")
        add(made, "force", f"along the contact normal {normal}")
    made["velocity"] = filter_words(lost)
    contact = Contact(
        np.concatenate([signals.time for signals, _, _ in pieces]),
        penetration=np.concatenate(depths),
        velocity=np.concatenate(velocities),
        force=np.concatenate([own.force for _, _, own in pieces]),
        segment=np.concatenate(labels),
        provenance=made,
        surface_deviation=_common_deviation(places, rule),
        remarks=remarks,
    )
    return contact, places


def _surface(own: Pressed, velocity: Floats, settings: Preparation, rule: SurfaceRule) -> Surface:
    if isinstance(settings.surface, float | int):
        return Surface(float(settings.surface), 0.0, "as it was given")
    return surface_of(own.depth, velocity, own.force, rule)


def _place(signals: Signals, episode: Episode | None, own: Pressed, surface: Surface) -> Place:
    position: Floats = np.atleast_1d(np.nanmedian(signals.depth, axis=0))
    if episode is not None:
        position = episode.place
    start, stop = float(signals.time[0]), float(signals.time[-1])
    return Place(start, stop, position, own.normal, surface)


def _say_surface(places: list[Place], made: dict[str, str], remarks: list[Remark]) -> None:
    if len(places) == 1:
        surface = places[0].surface
        words = f"counted from {rounded(surface.position, 6)} m, {surface.words}"
        if surface.deviation:
            words += f" (± {rounded(surface.deviation, 2)} m)"
        add(made, "penetration", words)
        remarks += assumption(surface)
        return
    add(made, "penetration", "at each place along its own normal, from its own surface")
    assumed = sum(place.surface.assumed for place in places)
    if assumed:
        remarks.append(
            Remark(
                "surface",
                f"at {assumed} of {len(places)} places the probe is never seen out of contact: "
                "where the surface lies is an assumption, the shallowest sample; K, B and n are "
                "for it, stiffness and damping at working depth hold all the same",
                "lift the probe between places",
                "with-care",
            )
        )


def _common_deviation(places: list[Place], rule: SurfaceRule) -> float | None:
    """How well the surfaces are known, as the one number that an estimator takes."""
    known = [place.surface.deviation for place in places if place.surface.deviation]
    if rule == "estimate" or len(known) < len(places):
        return None
    return float(np.median(known))
