"""The channels that are used, as numbers in SI."""

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.preparation.roles import Roles
from palpate.preparation.rows import MOST_SKIPPED
from palpate.recordings import Recording
from palpate.recordings.units import GRAVITY, UNITS, WEIGHTS, plain_unit, size_of, stated_unit
from palpate.remarks import Remark
from palpate.validation import Floats

#: In SI, beyond which a value is no measurement; units of the arithmetic end there too. Sums of
#: eighth powers are finite below it: of an infinity LAPACK prints words on standard output.
LARGEST = 1e30


def measurable(values: Floats) -> Floats:
    """Values of which those beyond what anyone can measure are NaN."""
    beyond = np.abs(values) > LARGEST
    return np.where(beyond, np.nan, values) if beyond.any() else values


def values_of(
    recording: Recording,
    roles: Roles,
    units: dict[str, str],
    made: dict[str, str],
    remarks: list[Remark],
    *,
    strict: bool,
) -> dict[str, NDArray[np.generic]]:
    """Each role's channels as one array, in SI."""
    channels = {"depth": roles.depth, "force": roles.force, "orientation": roles.orientation}
    channels["velocity"] = () if roles.velocity is None else (roles.velocity,)
    kinds = {"depth": "penetration"}
    values: dict[str, NDArray[np.generic]] = {}
    for role, names in channels.items():
        if not names:
            continue
        read = [recording.numbers(name, strict=strict) for name in names]
        columns = [measurable(column) for column in read]
        for name, column, before in zip(names, columns, read, strict=True):
            if strict and column is not before:
                sample = int(np.nanargmax(np.abs(before)))
                raise RecordingError(
                    f"{recording.place(name, sample)}: {before[sample]:g} is no measurement: it is "
                    f"beyond {LARGEST:g}"
                )
            remarks += _unknown(recording, name, column)
        kind = kinds.get(role, role)
        if kind in UNITS:
            given = units.get(kind)
            first = given or unit_of(recording, names[0], kind)
            own = [given or unit_of(recording, name, kind, first) for name in names]
            columns = [c * size_of(kind, unit) for c, unit in zip(columns, own, strict=True)]
            made[kind] = _made(names, own[0], kind)
            if not given and own[0] in WEIGHTS:
                words = f"{', '.join(map(repr, names))} is in {own[0]}, a mass: palpate takes its"
                words += f" weight at {GRAVITY} m/s²"
                remarks.append(Remark("units", words, "--unit force=N, where it is a force in N"))
        values[role] = columns[0] if len(columns) == 1 else np.column_stack(columns)
        known = np.isfinite(np.column_stack(columns)).all(axis=1)
        if role in ("depth", "force") and known.size and not known.any():
            raise RecordingError(
                f"{recording.place(names[0])}: no sample holds a number in [-{LARGEST:g}, "
                f"{LARGEST:g}]; check its unit, or name another column"
            )
    if roles.segment is not None:
        values["segment"] = recording.channel(roles.segment)
    return values


def _unknown(recording: Recording, name: str, column: Floats) -> list[Remark]:
    """Say how many samples of a channel hold no number: no estimator takes them."""
    count = int(np.count_nonzero(~np.isfinite(column)))
    if not count:
        return []
    first = recording.channels[name][int(np.argmin(np.isfinite(column)))]
    text = recording.faults[name].text if name in recording.faults else str(first)
    samples = "1 sample" if count == 1 else f"{count} samples"
    return [
        Remark(
            "rows",
            f"{name!r} holds no number in {samples}, first {text.strip()[:40]!r}: left out",
            "look at the recorder; --strict refuses them",
            "with-care" if count > MOST_SKIPPED * column.size else "note",
        )
    ]


def _made(names: tuple[str, ...], unit: str, kind: str) -> str:
    listed = ", ".join(repr(name) for name in names)
    words = f"column {listed}" if len(names) == 1 else f"columns {listed}"
    return words if unit == next(iter(UNITS[kind])) else f"{words}, in {unit}"


def unit_of(recording: Recording, name: str, kind: str, usual: str | None = None) -> str:
    """The unit of a channel as the recording or its name states it; else the usual one, or SI."""
    own = recording.units.get(name)
    stated = plain_unit(own) if own else stated_unit(name)
    si = next(iter(UNITS[kind]))
    if stated is None or (kind == "time" and not own and not size_of(kind, stated)):
        return usual or si  # ``time (UTC)`` names a zone
    if not size_of(kind, stated):
        raise RecordingError(
            f"{recording.place(name)}: the {kind} is in {stated}, and palpate converts "
            f"{', '.join(UNITS[kind])} only; --unit {kind}={si} states its unit, --unit "
            f"{kind}=0.0098{si} the size of one count"
        )
    return stated
