"""Channels of a recording on one clock, in SI."""

from collections.abc import Mapping
from dataclasses import replace

from palpate.preparation.channels import values_of
from palpate.preparation.interpolation import interpolated
from palpate.preparation.roles import Roles
from palpate.preparation.signals import Signals, made_signals
from palpate.preparation.streams import Stream, origin_of, running, seconds_of, streams_of
from palpate.recordings import Recording
from palpate.remarks import Remark


def signals_of(
    recording: Recording,
    roles: Roles,
    units: Mapping[str, str] | None = None,
    *,
    rate: float | None = None,
    strict: bool = False,
) -> Signals:
    """Bring the channels that are used to one clock, and to SI.

    Where position and force have clocks of their own, the faster one is interpolated, by straight
    lines, at the times of the slower one; not over a gap.

    Parameters
    ----------
    recording : Recording
        What was recorded.
    roles : Roles
        Which channels are used.
    units : mapping, optional
        The units of ``time``, ``penetration``, ``force`` and ``velocity``, where they are given;
        else they are those that the recording says, or the names of the channels, or SI.
    rate : float, optional
        Samples a second, where the recording has no time.
    strict : bool
        Refuse what is not a number, and time that does not increase.

    Raises
    ------
    RecordingError
        There is no time, or it runs backward; a channel holds no numbers; or the clocks of position
        and force have no time in common.
    """
    made: dict[str, str] = {}
    remarks: list[Remark] = []
    values = values_of(recording, roles, dict(units or {}), made, remarks, strict=strict)
    streams = streams_of(recording, roles, values, dict(units or {}), rate)
    if len(streams) == 1:
        signals = _together(recording, streams[0], remarks, strict=strict)
    else:
        signals = interpolated(recording, streams, made, remarks, strict=strict)
    return replace(signals, made=made, remarks=(*signals.remarks, *remarks))


def _together(
    recording: Recording, stream: Stream, remarks: list[Remark], *, strict: bool
) -> Signals:
    """All channels on one clock: samples with a bad time are left out, gaps kept apart."""
    time, values, part = running(recording, stream, "samples", remarks, strict=strict)
    return made_signals(seconds_of(time, stream.unit, origin_of(stream)), values, part, remarks)
