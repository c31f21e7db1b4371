"""Force curves in tables: the deflection of the cantilever becomes the force and the tip's place.

For the deflection d in metres, the spring constant k and the height z of the cantilever's base:

    F = k d,    position of the tip = z + d
"""

import re
from dataclasses import replace

import numpy as np

from palpate.input.recordings.recording import Recording
from palpate.input.recordings.units import find_unit, unit_size

#: Units of a deflection that is a voltage, with their size in V.
VOLTS = {"V": 1.0, "mV": 1e-3}
_NUMBER = re.compile(r"\d+\.?\d*(?:[eE][+-]?\d+)?")
#: Channels in texts of JPK, with the names in its other files.
_JPK = {
    "verticalTipPosition": "tip position",
    "vDeflection": "deflection",
    "measuredHeight": "height (measured)",
    "capacitiveSensorHeight": "height (measured)",
    "height": "height (piezo)",
    "time": "time of the segment",
    "seriesTime": "time",
}
_HEIGHTS = ("height (measured)", "height (piezo)")
# NanoScope writes the extension and the retraction of a curve as separate columns.
_HALF = re.compile(r"_Ex(?=_|$)")


def complete_force_curve(
    recording: Recording, sensitivity: float | None = None, spring_constant: float | None = None
) -> Recording:
    """Return a force curve of JPK or NanoScope with ``force`` and ``tip position``.

    Other recordings are unchanged. Without the calibration that the unit of the deflection needs,
    the curve keeps its deflection and has no force.

    Parameters
    ----------
    recording : Recording
        A table.
    sensitivity : float, optional
        Deflection per volt, m/V.
    spring_constant : float, optional
        That of the cantilever, N/m. Default: from the file.
    """
    recording = _name_channels_of_jpk(_join_halves(recording))
    channels = dict(recording.channels)
    unit = recording.unit_of("deflection")
    if unit is None or "deflection" not in channels or "force" in channels:
        return recording
    deflection = recording.numbers("deflection")
    noted = _NUMBER.match(recording.notes.get("springConstant", ""))
    stiffness = spring_constant or (float(noted[0]) if noted else np.nan)
    newtons = unit_size("force", unit)
    metres = unit_size("penetration", unit) or VOLTS.get(unit, 0.0) * (sensitivity or np.nan)
    made = {"force": deflection * (newtons or metres * stiffness)}
    height = next((name for name in _HEIGHTS if name in channels), None)
    if height is not None and "tip position" not in channels:
        base = unit_size("penetration", recording.unit_of(height) or "m")
        made["tip position"] = base * recording.numbers(height) + made["force"] / stiffness
    units = dict(recording.units)
    for name, values in made.items():
        if np.isfinite(values).any():
            channels[name] = values
            units[name] = "N" if name == "force" else "m"
    faults = dict(recording.faults)
    if "force" in channels:
        del channels["deflection"]
        faults.pop("deflection", None)
    return replace(recording, channels=channels, units=units, faults=faults)


def _name_channels_of_jpk(recording: Recording) -> Recording:
    """Name the channels as in JPK's other files, with a time that increases over the segments."""
    if "vDeflection" not in recording.channels:
        return recording
    channels = {_JPK.get(name, name): values for name, values in recording.channels.items()}
    units = {_JPK.get(name, name): unit for name, unit in recording.units.items()}
    faults = {_JPK.get(name, name): fault for name, fault in recording.faults.items()}
    if "time" not in channels and "time of the segment" in channels:
        steps = np.diff(channels["time of the segment"], prepend=0.0)
        channels["time"] = np.cumsum(np.where(steps < 0.0, np.median(steps), steps))
        units["time"] = "s"
    return replace(recording, channels=channels, units=units, faults=faults)


def _join_halves(recording: Recording) -> Recording:
    """Join extension and retraction of NanoScope in the order of time; the ramp is the height."""
    columns = recording.channels
    pairs = {
        _HALF.sub("", name): (name, _HALF.sub("_Rt", name))
        for name in columns
        if _HALF.search(name) and _HALF.sub("_Rt", name) in columns
    }
    ramp = next((stem for stem in pairs if "defl" not in stem.lower()), None)
    deflections = [stem for stem in pairs if "defl" in stem.lower()]
    if ramp is None or not deflections:
        return recording
    # A force before a length, and a length before a voltage.
    deflection = min(deflections, key=lambda stem: (find_unit(stem) or "V") in VOLTS)
    names = {ramp: "height (piezo)", deflection: "deflection"}
    extension, retraction, bending = (
        np.subtract(*recording.numbers(name)[[-1, 0]])
        for name in (*pairs[ramp], pairs[deflection][0])
    )
    inward = -1.0 if extension * bending < 0.0 else 1.0  # the ramp may grow towards the sample
    backward = inward * extension < 0.0, inward * retraction > 0.0
    channels = {}
    for stem, pair in pairs.items():
        halves = [recording.numbers(pair[k])[:: -1 if backward[k] else 1] for k in (0, 1)]
        channels[names.get(stem, stem)] = np.concatenate(halves)
    channels["height (piezo)"] *= -inward
    channels["segment"] = np.repeat([0.0, 1.0], len(next(iter(columns.values()))))
    units = {names.get(stem, stem): unit for stem in pairs if (unit := find_unit(stem))}
    return replace(recording, channels=channels, units=units, rows=None, faults={})
