"""A contact from a position and a force, along one axis or in space: tare, normal, places."""

import logging
from dataclasses import replace

import numpy as np

from palpate.digits import rounded, with_error
from palpate.errors import RecordingError
from palpate.findings import Finding
from palpate.input.channels.frames import rotate_to_base
from palpate.input.channels.roles import Roles
from palpate.input.channels.signals import Signals
from palpate.input.preparation.delay import remove_delay
from palpate.input.preparation.force_frame import find_stated_frame, read_force
from palpate.input.preparation.from_penetration import Prepared
from palpate.input.preparation.held import find_fresh_samples
from palpate.input.preparation.normal import AlongNormal, parse_normal, project_on_normal
from palpate.input.preparation.orientation import (
    find_upright,
    inertia_share,
    report_turn,
    report_turning_weight,
    report_unknown_tip,
    states_order,
)
from palpate.input.preparation.places import divide_at_places, join_places, report_travel
from palpate.input.preparation.resolution import deviation_of_mean
from palpate.input.preparation.settings import Preparation
from palpate.input.preparation.tare import Baseline, describe_free_air, tare_force
from palpate.input.preparation.velocity import subtract_inertia
from palpate.input.recordings import Recording
from palpate.input.wrench.compensation import Compensated
from palpate.input.wrench.marks import report_unknown_inertia
from palpate.method.contact import Contact, add_step, between
from palpate.stages import stage
from palpate.validation import Floats

_LOGGER = logging.getLogger(__name__)


class PositionRoute:
    """The steps from a position and a force to a contact: tare, projection on the contact normal.

    ``recorded`` is the force of the signals before the tare, ``orientation`` that of the pose,
    ``made`` how each channel was obtained.
    """

    def __init__(
        self, recording: Recording, roles: Roles, settings: Preparation, signals: Signals
    ) -> None:
        self.recording = recording
        self.roles = roles
        self.settings = settings
        self.made = dict(signals.made)
        self.findings = list[Finding]()
        if settings.tip_offset is not None and signals.orientation is not None:
            signals = self._move_to_tip(signals, signals.orientation)
        if "force" in settings.flip:
            signals = replace(signals, force=-signals.force)
        if "penetration" in settings.flip:
            signals = replace(signals, depth=-signals.depth)
        inside = between(signals.time, *settings.ends, recording.source)
        self.signals = signals.taken(inside)
        self.recorded = self.signals.force
        self.orientation = self.signals.orientation
        self.compensated: Compensated | None = None
        self.baseline: Baseline | None = None

    def prepare(self) -> Contact:
        """Take the steps in order."""
        settings = self.settings
        source = self.recording.source
        self._read_force()
        normal = None if settings.normal is None else parse_normal(settings.normal)
        with stage(_LOGGER, "contact normal"):
            position = self.signals.depth
            force = self.signals.force
            along = project_on_normal(position, force, source, normal=normal, flip=settings.flip)
        tare_deviation = None
        if self.baseline is not None:
            tare_deviation = deviation_of_mean(along.force, self.baseline.free)
        along = self._keep_upright(along)
        held_delay: float | tuple[float, float] = 0.0
        if not settings.no_time:
            along, held_delay = self._drop_held(along)
        pieces = divide_at_places(self.signals, along, settings)
        divided = len(pieces) > 1 or pieces[0].episode is not None
        if divided:
            self.findings += report_travel(pieces, len(self.signals.time))
        self.findings += along.findings
        contact, places = join_places(pieces, settings, self.made, self.findings)
        prepared = Prepared(
            self.recording,
            settings,
            zero=None if self.baseline is None else self.baseline.mean,
            drift=0.0 if self.baseline is None else self.baseline.drift,
            payload=None if self.compensated is None else self.compensated.payload,
            normal=along.normal,
            surface=places[0].surface,
            places=tuple(places) if divided else (),
        )
        contact = replace(contact, tare_deviation=tare_deviation, prepared=prepared, source=source)
        delay = settings.delay
        if self.compensated is not None:
            contact = self._describe_tool(contact, self.compensated)
            if self.compensated.delay is not None:
                delay = 0.0
        return subtract_inertia(remove_delay(contact, delay or held_delay), settings.mass)

    def _move_to_tip(self, signals: Signals, orientation: Floats) -> Signals:
        """Add the offset of the tip, which turns with the pose."""
        names = self.roles.orientation
        if names and not states_order(names, self.settings.columns.orientation):
            problem = "the offset of the tip needs the order of the quaternion: pass --orientation "
            remedy = f"{','.join(names)} if that is x, y, z, w"
            raise RecordingError.of(self.recording.source, problem + remedy)
        offset = rotate_to_base(np.array(self.settings.tip_offset), orientation)
        add_step(self.made, "penetration", "of the tip, whose offset the orientation rotates")
        return replace(signals, depth=signals.depth + offset)

    def _read_force(self) -> None:
        """Read the force in its frame, and subtract payload or offset."""
        recording = self.recording
        frame = find_stated_frame(recording, self.roles, self.signals, self.settings, self.findings)
        with stage(_LOGGER, "payload"):
            reading = read_force(self.signals, self.settings, self.roles, frame)
        self.findings += reading.findings
        if reading.compensated is not None:
            self._take_compensated(reading.compensated)
            return
        if self.settings.payload is not None:
            problem = "--payload needs a pose and a force in space, on clocks that do not restart"
            raise RecordingError.of(recording.source, problem)
        self._tare(reading.signals)

    def _take_compensated(self, compensated: Compensated) -> None:
        """Take the force without payload, and record how it was obtained."""
        made = self.made
        payload = compensated.payload
        self.compensated = compensated
        self.recorded = self.recorded[compensated.kept]
        signals = self.signals.taken(compensated.kept)
        self.signals = replace(signals, force=compensated.force, orientation=None)
        if payload.mass > 0.0:
            mass = with_error(payload.mass, payload.mass_error, unit="kg")
            centre = ", ".join(rounded(1e3 * metres, 3) for metres in payload.centre.tolist())
            add_step(made, "force", f"minus weight and inertia of {mass} at ({centre}) mm")
        text = describe_free_air(compensated.free)
        self.baseline = Baseline(compensated.free, compensated.bias, 0.0, text)
        self.baseline.report(made, self.findings)
        add_step(made, "force", "rotated by mount and orientation")
        delay = compensated.delay
        if delay is not None and delay.seconds:
            size = with_error(abs(1e3 * delay.seconds), 1e3 * delay.standard_error, unit="ms")
            direction = "earlier" if delay.seconds > 0.0 else "later"
            add_step(made, "force", f"shifted {size} {direction}")
        self.findings += payload.findings

    def _tare(self, signals: Signals) -> None:
        """Subtract weight and offset, and record how the force was obtained."""
        settings = self.settings
        if signals.force.ndim == signals.depth.ndim == 2:
            if self.orientation is not None:
                self.findings += report_turning_weight(self.orientation, settings.tool_weight)
            if settings.tool_weight is not None:
                step = f"minus the tool's weight of {settings.tool_weight:g} N"
                add_step(self.made, "force", step)
        with stage(_LOGGER, "force offset"):
            self.signals, self.baseline, findings = tare_force(
                signals, settings, self.recording.source
            )
        self.findings += findings
        if self.baseline is not None:
            self.baseline.report(self.made, self.findings)
        if signals.orientation is not None:
            add_step(self.made, "force", "rotated by the orientation")

    def _keep_upright(self, along: AlongNormal) -> AlongNormal:
        """Exclude samples in which the tool has turned, if the pose is not that of the tip."""
        is_tip = self.settings.tip_offset is not None
        if self.compensated is None or self.orientation is None or is_tip:
            return along
        orientation = self.orientation[self.compensated.kept]
        frame = self.recording.frames.get(self.roles.force[0])
        if frame is not None and frame == self.roles.orientation_frame:
            problem = f"the transforms end at the sensor {frame!r}: palpate takes its origin for "
            self.findings.insert(0, report_unknown_tip(f"{problem}the tip"))
        upright = find_upright(along.force, orientation)
        self.findings += report_turn(along.force, orientation, upright)
        if upright.all():
            return along
        gaps = np.cumsum(np.diff(np.flatnonzero(upright), prepend=0) > 1)
        cut = self.signals.taken(upright)
        self.signals = replace(cut, part=cut.part + gaps)
        self.recorded = self.recorded[upright]
        step = "without samples turned by 2° or more from the nearest touch"
        add_step(self.made, "penetration", step)
        return replace(along, depth=along.depth[upright], force=along.force[upright])

    def _drop_held(self, along: AlongNormal) -> tuple[AlongNormal, float | tuple[float, float]]:
        """Drop repeated readings, and return the delay of what was held."""
        signals = self.signals
        held = find_fresh_samples(signals.time, signals.depth, self.recorded, along.force)
        if held is None:
            return along, 0.0
        force = held.taken(signals.force)
        self.signals = replace(signals.taken(held.before), force=force, fresh=held.after)
        self.findings.append(held.finding)
        depth = along.depth[held.before]
        return replace(along, depth=depth, force=held.taken(along.force)), held.late

    def _describe_tool(self, contact: Contact, compensated: Compensated) -> Contact:
        """Return the contact with the mass and clock of its tool."""
        payload = compensated.payload
        contact = replace(contact, delay=compensated.delay, moving_mass=payload.mass)
        if self.settings.mass is not None:
            return contact
        doubts = report_unknown_inertia(payload.mass_error, inertia_share(contact))
        return replace(contact, findings=(*contact.findings, *doubts))
