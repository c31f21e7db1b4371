"""The places of a travelling probe: where it stays on the material, and its contact at each."""

import heapq
import math
from collections.abc import Iterator
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from palpate.digits import percent
from palpate.errors import RecordingError
from palpate.findings import Check, Finding
from palpate.input.channels.signals import Signals
from palpate.input.preparation.normal import AlongNormal, Normal, parse_normal, project_on_normal
from palpate.input.preparation.orientation import FIRM
from palpate.input.preparation.settings import Preparation
from palpate.input.preparation.surface import Surface, find_surface, report_assumed_surface
from palpate.input.preparation.touch import exclude_load_transfer
from palpate.input.preparation.velocity import describe_filter, estimate_velocities
from palpate.method.contact import Contact, VelocityFilter, add_step
from palpate.method.rows import count_true, median, norm, row_norms, run_slices, true_runs
from palpate.stages import log_stage
from palpate.validation import Floats, Mask, Values, frozen


@frozen(eq=False)
class Place:
    """One place on the material, and when the probe was there.

    Attributes
    ----------
    start, stop : float
        Time interval, s.
    position : numpy.ndarray, shape (3,)
        Median position of the probe, m, in the frame of the recording.
    normal : Normal or None
        Contact normal; None if the position is along one axis.
    surface : Surface
        Surface along that normal.
    """

    start: float
    stop: float
    position: Floats
    normal: Normal | None
    surface: Surface

    def as_dict(self) -> dict[str, Any]:
        """Return the place as JSON types."""
        return {
            "position": self.position.tolist(),
            "normal": None if self.normal is None else self.normal.vector.tolist(),
            "surface": self.surface.position,
            "surface_deviation": self.surface.deviation,
        }


# Episodes: intervals in which the probe stays at one place on the material.

SHORTEST = 1.0  # s
FEWEST_OF_AN_EPISODE = 60  # samples
# samples of an interval that may rule it out; squares of the radius
FEW = 12
FARTHER = 4.001
STRIDES = 4000  # most starts to try; in a longer recording, every k-th sample


@frozen(eq=False)
class Stay:
    """An interval in which the probe stays at one place.

    Attributes
    ----------
    start, stop : int
        Range of its samples.
    place : numpy.ndarray, shape (3,)
        Median position, m.
    """

    start: int
    stop: int
    place: Floats


def find_episodes(time: Floats, position: Floats, force: Floats, radius: float) -> list[Stay]:
    """Divide a recording into episodes, the longest first, and return them in order of time.

    In an episode the position stays within ``radius`` of its median, across the contact normal of
    the episode: the mean direction of its forces, weighted by their size.

    Parameters
    ----------
    time : numpy.ndarray, shape (k,)
        s, increasing.
    position, force : numpy.ndarray, shape (k, 3)
        m, and N in the same frame.
    radius : float
        m. An episode lasts at least a second and has at least 60 samples.
    """
    path = _Path(time, position, force, radius)
    waiting = [(start - stop, start, stop) for start, stop in path.longest()]
    heapq.heapify(waiting)
    taken = np.zeros(time.size, dtype=bool)
    episodes = list[Stay]()
    while waiting:
        _, start, stop = heapq.heappop(waiting)
        free = _longest_free(taken, start, stop)
        if free is None or not path.is_long_enough(*free):
            continue
        if free != (start, stop):
            heapq.heappush(waiting, (free[0] - free[1], *free))
            continue
        taken[start:stop] = True
        episodes.append(Stay(start, stop, path.extent(start, stop)[0]))
    return sorted(episodes, key=attrgetter("start"))


def _longest_free(taken: Mask, start: int, stop: int) -> tuple[int, int] | None:
    """The longest run of an interval without taken samples."""
    free = true_runs(~taken[start:stop])
    longest = max(free, key=lambda run: run.stop - run.start, default=None)
    return None if longest is None else (start + longest.start, start + longest.stop)


class _Path:
    """Positions of a probe, and its intervals within a radius across their normal."""

    def __init__(self, time: Floats, position: Floats, force: Floats, radius: float) -> None:
        self.time = time
        self.radius = radius
        self.columns = np.ascontiguousarray(position.T)
        self.gaps = bool(np.isnan(self.columns).any())
        finite = np.nan_to_num(force)
        weighted = finite * row_norms(finite)[:, None]
        self.weighted = np.concatenate([np.zeros((1, 3)), np.cumsum(weighted, axis=0)])

    def is_long_enough(self, start: int, stop: int) -> bool:
        """Whether an interval is long enough for an episode."""
        duration = float(self.time[stop - 1] - self.time[start])
        return stop - start >= FEWEST_OF_AN_EPISODE and duration >= SHORTEST

    def extent(self, start: int, stop: int) -> tuple[Floats, float]:
        """The median position of an interval, and the largest distance from it across n."""
        inside = self.columns[:, start:stop]
        if self.gaps:
            place: Floats = np.nanmedian(inside, axis=1)
        else:  # as np.median, which takes three times as long for a short interval
            middle = (stop - start - 1) // 2, (stop - start) // 2
            ordered = np.partition(inside, middle, axis=1)
            place = 0.5 * (ordered[:, middle[0]] + ordered[:, middle[1]])
        squares = self._across(inside - place[:, None], start, stop)
        largest = np.nanmax(squares, initial=0.0) if self.gaps else squares.max(initial=0.0)
        return place, float(np.sqrt(largest))

    def _across(self, offsets: Floats, start: int, stop: int) -> Floats:
        """The squares of vectors, shape (3, k), across the normal of an interval."""
        squares: Floats = (offsets * offsets).sum(axis=0)
        total = self.weighted[stop] - self.weighted[start]
        length = norm(total)
        if length > 0.0:
            squares -= (total / length @ offsets) ** 2
        return squares

    def longest(self) -> list[tuple[int, int]]:
        """The longest interval from each start that stays within the radius."""
        size = self.time.size
        stride = max(size // STRIDES, 1)
        in_a_second = int(np.searchsorted(self.time, self.time[0] + SHORTEST))
        shortest = max(FEWEST_OF_AN_EPISODE, in_a_second)
        intervals = list[tuple[int, int]]()
        stop = 0
        for start in range(0, size, stride):
            stop = max(stop, min(start + shortest, size))
            if not self._is_within(start, stop):
                stop = start
                continue
            stop = self._extend(start, stop, stride)
            if self.is_long_enough(start, stop):
                intervals.append((start, stop))
        return intervals

    def _extend(self, start: int, stop: int, stride: int) -> int:
        """Extend an interval while it stays within the radius, in steps that double, then halve."""
        size = self.time.size
        step = stride
        while stop < size and self._is_within(start, min(stop + step, size)):
            stop = min(stop + step, size)
            step *= 2
        while step > stride:
            step //= 2
            if stop + step <= size and self._is_within(start, stop + step):
                stop += step
        return stop

    def _is_within(self, start: int, stop: int) -> bool:
        # Two samples that are farther apart than twice the radius decide without a median.
        sample = self.columns[:, start : stop : max((stop - start) // FEW, 1)]
        squares = self._across(sample - sample[:, :1], start, stop)
        if squares.max() > FARTHER * self.radius**2:
            return False
        return self.extent(start, stop)[1] <= self.radius


def measure_travel(position: Floats, force: Floats) -> float:
    """Return the travel of a probe across the contact normal while in contact, m.

    It is the radius around the median position; contact means a force above a tenth of the largest.
    """
    size = row_norms(np.nan_to_num(force))
    touching = size > 0.1 * float(np.percentile(size, 99.0)) if size.size else size > 0.0
    count = count_true(touching)
    if count < 2:
        return 0.0
    path = _Path(np.zeros(count), position[touching], force[touching], math.inf)
    return path.extent(0, count)[1]


# The contact at each place: its own normal, surface and velocity.


class Piece(NamedTuple):
    """The signals at one place, the episode, and depth and compression along its normal."""

    signals: Signals
    episode: Stay | None
    along: AlongNormal


@log_stage("episodes")
def divide_at_places(signals: Signals, along: AlongNormal, settings: Preparation) -> list[Piece]:
    """Return the whole recording, or its episodes if the probe travels over the material."""
    undivided = [Piece(signals, None, along)]
    position = signals.depth
    force = signals.force
    if position.ndim == 1 or not math.isfinite(settings.spot):
        return undivided
    if force.ndim == 1 and along.normal is not None:
        force = force[:, None] * along.normal.vector
    if measure_travel(position, force) <= settings.spot:
        return undivided
    firm = FIRM * float(np.nanpercentile(along.force, 99.0))
    pieces = list[Piece]()
    for run in run_slices(signals.part):
        for stay in find_episodes(signals.time[run], position[run], force[run], settings.spot):
            samples = np.arange(run.start + stay.start, run.start + stay.stop)
            if float(np.nanpercentile(along.force[samples], 99.0)) > firm:
                inside = signals.taken(samples)
                pieces.append(Piece(inside, stay, _project_at_place(inside, along, settings)))
    return pieces or undivided


def _project_at_place(signals: Signals, along: AlongNormal, settings: Preparation) -> AlongNormal:
    """Depth and compression at one place, with the signs found from the whole recording."""
    normal = None if settings.normal is None else parse_normal(settings.normal)
    position = signals.depth
    force = signals.force
    if force.ndim == 1:  # its own largest values give its sign
        return project_on_normal(position, force, "", normal=normal, flip=settings.flip)
    if along.normal is not None and along.normal.turned and "force" not in settings.flip:
        force = -force
    flip = (*settings.flip, "force")
    try:
        return project_on_normal(position, force, "", normal=normal, flip=flip)
    except RecordingError:  # no force exceeds the noise at this place
        if along.normal is None:
            raise
        normal = parse_normal(along.normal.vector.tolist())
        return project_on_normal(position, force, "", normal=normal, flip=flip)


def report_travel(pieces: list[Piece], count: int) -> list[Finding]:
    """Report a probe that travels over the material, in a recording of so many samples."""
    excluded = 1.0 - sum(len(piece.signals.time) for piece in pieces) / count
    if len(pieces) == 1:
        problem = "the probe travels over the material and stays for a second at one place only"
        where = "elsewhere, and are excluded"
        end = ""
    else:
        problem = f"the probe travels over the material: {len(pieces)} places, each prepared "
        problem += "separately"
        where = "between them, or less than a second at one"
        end = "; one law for all of them is an average"
    if excluded > 0.0:
        problem += f"; {percent(excluded)} of the samples were {where}"
    remedy = "pass --spot inf if it is all one material"
    return [Check.EPISODES.finding(problem + end, remedy, severity="with-care")]


@log_stage("surface and velocity of each place")
def join_places(
    pieces: list[Piece], settings: Preparation, made: dict[str, str], findings: list[Finding]
) -> tuple[Contact, list[Place]]:
    """Join the pieces, each with its own surface."""
    channels = list[tuple[Values, ...]]()
    places = list[Place]()
    filters = list[VelocityFilter]()
    dropouts = 0
    for number, (signals, episode, along) in enumerate(pieces):
        # The velocity does not depend on the origin of the depth.
        velocity, velocity_filter, count = estimate_velocities(
            signals.time, along.depth, list(run_slices(signals.part)), settings.velocity_window
        )
        if (fresh := signals.fresh) is not None:
            signals = signals.taken(fresh)
            velocity = velocity[fresh]
            along = replace(along, depth=along.depth[fresh], force=along.force[fresh])
        surface = _find_surface(along, velocity, settings)
        label = signals.part
        position = np.atleast_1d(np.nanmedian(signals.depth, axis=0))
        if episode is not None:
            label = np.full(len(signals.time), number)
            position = episode.place
        depth = along.depth - surface.position
        channels.append((signals.time, depth, velocity, along.force, label))
        start, stop = (float(signals.time[end]) for end in (0, -1))
        places.append(Place(start, stop, position, along.normal, surface))
        filters.append(velocity_filter)
        dropouts += count
    _report_surfaces(places, made, findings)
    normal = pieces[0].along.normal
    if normal is not None and len(pieces) == 1:
        add_step(made, "penetration", f"against the contact normal {normal}")
        add_step(made, "force", f"along the contact normal {normal}")
    velocity_filter = max(filters, key=attrgetter("samples"))
    made["velocity"] = describe_filter(velocity_filter, dropouts)
    time, depth, velocity, force, segment = map(np.concatenate, zip(*channels, strict=True))
    contact = Contact(
        time,
        penetration=depth,
        velocity=velocity,
        force=force,
        segment=segment,
        provenance=made,
        surface_deviation=_common_deviation(places, settings),
        findings=findings,
        velocity_filter=velocity_filter,
    )
    return contact, places


def _find_surface(along: AlongNormal, velocity: Floats, settings: Preparation) -> Surface:
    if settings.surface is None or isinstance(settings.surface, str):
        return find_surface(along.depth, velocity, along.force, settings.surface or "fit")
    return Surface(float(settings.surface), 0.0, "as given")


def _common_deviation(places: list[Place], settings: Preparation) -> float | None:
    """An estimator takes one number for the uncertainty of all surfaces."""
    deviations = [place.surface.deviation for place in places if place.surface.deviation]
    if settings.surface == "estimate" or len(deviations) < len(places):
        return None
    return median(deviations)


def _report_surfaces(places: list[Place], made: dict[str, str], findings: list[Finding]) -> None:
    if len(places) == 1:
        places[0].surface.report(made, findings)
        return
    step = "at each place along its own normal, relative to its own surface"
    add_step(made, "penetration", step)
    assumed = sum(place.surface.assumed for place in places)
    if assumed:
        reason = f"at {assumed} of {len(places)} places the probe is always in contact"
        findings.append(report_assumed_surface(reason, "lift the probe between places"))


# A contact divided by its places.

OF_ALL_PLACES = (Check.EPISODES, Check.SURFACE, Check.ORIENTATION)


def divide_by_place(contact: Contact, *, rejecting: bool) -> Iterator[tuple[Place, Contact]]:
    """Yield each place and the contact there, with its own surface; nothing for a single place.

    ``rejecting``: exclude load transfer first, because all touches together show it more clearly
    than the touches at one place.
    Findings on the whole recording are dropped: within one place the orientation hardly changes.
    """
    places = () if contact.prepared is None else contact.prepared.places
    if rejecting and places:
        contact = exclude_load_transfer(contact)
    segments = list(contact.segments())
    common = [finding for finding in contact.findings if finding.check not in OF_ALL_PLACES]
    for place in places:
        inside = np.zeros(len(contact), dtype=bool)
        for segment in segments:
            inside[segment] = place.start <= contact.time[segment.start] <= place.stop
        if inside.any():  # it may be outside the time window
            yield (
                place,
                replace(
                    contact.taken(inside),
                    surface_deviation=place.surface.deviation or None,
                    findings=(*common, *place.surface.assumption()),
                ),
            )
