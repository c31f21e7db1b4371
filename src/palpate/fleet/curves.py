"""Contacts of equal length, as arrays."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.fleet.settings import Settings
from palpate.preparation import prepare
from palpate.preparation.velocity import velocity_of
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Contacts of equal length, one row each; NaN marks a sample that is not there.

    Attributes
    ----------
    time : numpy.ndarray, shape (samples,) or (k, samples)
        s.
    penetration, force : numpy.ndarray, shape (k, samples)
        m and N.
    velocity : numpy.ndarray, shape (k, samples), optional
        m/s; worked out from the penetration where it is not given.
    source : str
        Where they are from.
    index : numpy.ndarray of int64, shape (k,)
        Which contact of the source each is.
    places : dict
        ``x``, ``y`` and ``z`` of each, m, where they are known.
    """

    time: Floats
    penetration: Floats
    force: Floats
    velocity: Floats | None = None
    source: str = ""
    index: NDArray[np.int64] | None = None
    places: dict[str, Floats] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.penetration)

    def clock(self, row: int) -> Floats:
        """The times of a row, s."""
        clock: Floats = self.time[row] if self.time.ndim == 2 else self.time
        return clock

    def known(self) -> "Curves":
        """The same, with a velocity for each row."""
        if self.velocity is not None:
            return self
        with np.errstate(divide="ignore", invalid="ignore"):  # of times that stand still
            rows = [velocity_of(self.clock(k), x) for k, x in enumerate(self.penetration)]
        velocity = np.array(rows).reshape(self.penetration.shape)
        return Curves(
            self.time, self.penetration, self.force, velocity, self.source, self.index, self.places
        )

    def wrong_clocks(self) -> dict[int, str]:
        """Which rows have times that do not increase from sample to sample, and where."""
        there = np.isfinite(self.penetration) & np.isfinite(self.force)
        clocks = np.atleast_2d(self.time)
        with np.errstate(invalid="ignore"):
            even = (np.diff(clocks, axis=1) > 0.0).all(axis=1)
        found = {}
        for row in np.flatnonzero(~np.broadcast_to(even, len(self))).tolist():
            time = self.clock(row)[there[row]]
            wrong = np.flatnonzero(~(np.diff(time) > 0.0))
            if wrong.size:
                k = int(wrong[0])
                sample = int(np.flatnonzero(there[row])[k + 1])
                found[row] = (
                    "time must be finite and increase from sample to sample; sample "
                    f"{sample} is at {time[k + 1]:.6g} s, after {time[k]:.6g} s"
                )
        return found

    def contact(self, row: int, settings: Settings) -> Contact:
        """One of them as a contact, prepared as the settings say.

        Raises
        ------
        PalpateError
            It cannot be.
        """
        x, f, t = self.penetration[row], self.force[row], self.clock(row)
        there = np.isfinite(x) & np.isfinite(f) & np.isfinite(t)
        velocity = None if self.velocity is None else self.velocity[row][there]
        return prepare(
            time=t[there],
            penetration=x[there],
            force=f[there],
            velocity=velocity,
            source=self.source,
            **settings.preparation,
        )
