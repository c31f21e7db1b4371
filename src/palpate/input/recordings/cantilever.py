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
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_HEIGHTS = ("height (measured)", "capacitiveSensorHeight", "height (piezo)")
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
    recording = _join_halves(recording)
    channels = dict(recording.channels)
    unit = recording.unit_of("deflection")
    if unit is None or "deflection" not in channels or "force" in channels:
        return recording
    noted = _NUMBER.match(recording.notes.get("springConstant", "nan"))
    stiffness = spring_constant or (float(noted[0]) if noted else np.nan)
    metres = unit_size("penetration", unit) or VOLTS.get(unit, 0.0) * (sensitivity or np.nan)
    newtons = unit_size("force", unit) or metres * stiffness
    if not newtons > 0.0:
        return recording
    channels["force"] = force = newtons * recording.numbers("deflection")
    del channels["deflection"]
    units = {**recording.units, "force": "N"}
    height = next((name for name in _HEIGHTS if name in channels), None)
    if height is not None and "tip position" not in channels and stiffness > 0.0:
        base = unit_size("penetration", recording.unit_of(height) or "m")
        channels["tip position"] = base * recording.numbers(height) + force / stiffness
        units["tip position"] = "m"
    faults = dict(recording.faults)
    if "deflection" in faults:
        faults["force"] = faults.pop("deflection")
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
    # A length or a force before a voltage.
    deflections = [stem for stem in pairs if "defl" in stem.lower()]
    deflections.sort(key=lambda stem: find_unit(stem) in VOLTS)
    if ramp is None or not deflections:
        return recording
    names = {ramp: "height (piezo)", deflections[0]: "deflection"}
    bending = [recording.numbers(name) for name in pairs[deflections[0]]]
    rising = [values[-1:].sum() > values[:1].sum() for values in bending]
    orders = (1 if rising[0] else -1, -1 if rising[1] else 1)
    channels = {"segment": np.repeat([0.0, 1.0], len(bending[0]))}
    for stem, pair in pairs.items():
        halves = map(recording.numbers, pair)
        ordered = [half[::order] for half, order in zip(halves, orders, strict=True)]
        channels[names.get(stem, stem)] = np.concatenate(ordered)
    height = channels["height (piezo)"]
    if height[:1].sum() < height[len(bending[0]) - 1 :][:1].sum():
        height *= -1.0  # the ramp grows towards the sample
    units = {names.get(stem, stem): unit for stem in pairs if (unit := find_unit(stem))}
    faults = {
        names.get(stem, stem): recording.faults[name]
        for stem, pair in pairs.items()
        for name in pair
        if name in recording.faults
    }
    return replace(recording, channels=channels, units=units, rows=None, faults=faults)
