"""Position and force on one clock, in SI: what a contact is made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from palpate.preparation.rows import gaps
from palpate.remarks import Remark
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """What a contact is made of, on one clock and in SI.

    Attributes
    ----------
    time : numpy.ndarray, shape (k,)
        s, increasing within a part.
    depth : numpy.ndarray, shape (k,) or (k, 3)
        Penetration or position, m.
    force : numpy.ndarray, shape (k,) or (k, 3)
        N.
    part : numpy.ndarray of int, shape (k,)
        A number that changes where the recording has a gap, or starts again.
    velocity : numpy.ndarray, shape (k,), optional
        m/s.
    orientation : numpy.ndarray, shape (k, 4), optional
        Quaternion x, y, z, w.
    segment : numpy.ndarray, shape (k,), optional
        The label of the column.
    made : mapping
        How each channel was made, in words.
    remarks : tuple of Remark
        What was skipped, or assumed.
    """

    time: Floats
    depth: Floats
    force: Floats
    part: NDArray[np.int64]
    velocity: Floats | None = None
    orientation: Floats | None = None
    segment: NDArray[np.generic] | None = None
    made: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()

    def taken(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> "Signals":
        """Return some of the samples."""
        cut = {
            name: getattr(self, name)[keep]
            for name in ("time", "depth", "force", "part", "velocity", "orientation", "segment")
            if getattr(self, name) is not None
        }
        return replace(self, **cut)


def made_signals(
    time: Floats,
    values: dict[str, NDArray[np.generic]],
    part: NDArray[np.int64],
    remarks: list[Remark],
) -> Signals:
    """Signals of values on one clock; gaps part them, and are said."""
    breaks = gaps(time, part)
    if breaks.any():
        longest = float(np.diff(time)[breaks[1:]].max())
        count = int(np.count_nonzero(breaks))
        many = f"{count} gaps in time, the longest" if count > 1 else "a gap in time,"
        remarks.append(Remark("rows", f"{many} {longest:.3g} s: contacts are kept apart there"))
    label = part + np.cumsum(breaks)
    known = {role: values.get(role) for role in ("velocity", "orientation", "segment")}
    depth, force = values["depth"], values["force"]
    return Signals(time, depth, force, label, **known)  # type: ignore[arg-type]
