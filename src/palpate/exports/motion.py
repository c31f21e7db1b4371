"""The motion that an export is made for, and replayed on."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.errors import RecordingError
from palpate.force_laws import ForceLaw, force_over_breaks
from palpate.validation import Floats

if TYPE_CHECKING:
    from palpate.identifying import Identification
    from palpate.results.loading import SavedResult

#: An engine is asked for the force at so many states at most, unless it is slow.
MOST_SAMPLES = 20_000
#: Where the paper's motion is judged: deeper, m, than where the probe enters.
FIRM = 2e-3


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Where a probe was, sample by sample, below the surface that the law was identified with.

    Attributes
    ----------
    time, penetration, velocity, acceleration : numpy.ndarray, shape (k,)
        s, m, m/s and m/s².
    judged : numpy.ndarray of bool, shape (k,)
        The samples that errors are taken over: in firm contact.
    starts : tuple of int
        Places of the samples that do not follow upon the one before, the first among them.
    force : numpy.ndarray, shape (k,), optional
        As measured, without its offset, N.
    source : str
        What it is, in words.
    """

    time: Floats
    penetration: Floats
    velocity: Floats
    acceleration: Floats
    judged: NDArray[np.bool_]
    starts: tuple[int, ...] = (0,)
    force: Floats | None = None
    source: str = "a motion"

    @classmethod
    def of_paper(cls) -> "Motion":
        """Return the paper's: a smooth approach, then 10 + 1 sin 4t + 1.8 sin 11t + 1.8 sin 15t mm.

        Judged where it is deeper than 2 mm.
        """
        from palpate.lab.trajectories import Probing

        time: Floats = 1e-3 * np.arange(6000, dtype=np.float64)
        command = Probing(pause=0.0).at(time)
        return cls(
            time,
            command.penetration,
            command.velocity,
            np.gradient(command.velocity, time),
            command.penetration > FIRM,
            source="the paper's motion",
        )

    @classmethod
    def recorded(cls, result: "Identification | SavedResult") -> "Motion":
        """Return the motion that a law was identified from; judged where samples were taken.

        Raises
        ------
        RecordingError
            No sample was taken.
        """
        contact = result.contact
        surface, offset = surface_and_offset(result)
        good = np.isfinite(contact.penetration) & np.isfinite(contact.velocity)
        good &= np.isfinite(contact.force)
        parts = [np.flatnonzero(good[part]) + part.start for part in contact.segments()]
        kept = [part for part in parts if part.size > 1]
        whole = np.concatenate(kept) if kept else np.empty(0, dtype=np.int64)
        acceleration = [np.gradient(contact.velocity[part], contact.time[part]) for part in kept]
        penetration = contact.penetration[whole] - surface
        judged = result.trace.taken[whole] & (penetration > 0.0)
        if not judged.any():
            raise RecordingError(f"{contact.source}: no sample of it was taken; identify it again")
        lengths = np.cumsum([0, *(part.size for part in kept[:-1])])
        return cls(
            contact.time[whole],
            penetration,
            contact.velocity[whole],
            np.concatenate(acceleration),
            judged,
            tuple(int(k) for k in lengths),
            contact.force[whole] - offset,
            "the recorded motion",
        )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def deepest(self) -> float:
        """Of the judged samples, m."""
        return float(self.penetration[self.judged].max())

    @property
    def shallowest(self) -> float:
        """Of the judged samples, m."""
        return float(self.penetration[self.judged].min())

    @property
    def fastest(self) -> float:
        """The highest speed of the judged samples, either way, m/s."""
        return float(np.abs(self.velocity[self.judged]).max())

    def force_by(self, law: ForceLaw) -> Floats:
        """Force by a law at every sample, N; of one with memory, from rest where samples begin."""
        if not law.remembers:
            # Then the times do not matter, which of several recordings together need not rise.
            return law.force(self.penetration, self.velocity)
        steps = np.diff(self.time, prepend=0.0)
        inside = np.delete(steps, list(self.starts))
        steps[list(self.starts)] = float(np.median(inside)) if inside.size else 1e-3
        return force_over_breaks(law, self.penetration, self.velocity, steps, list(self.starts))

    def firm(self, most: int = MOST_SAMPLES) -> "Motion":
        """Return the judged samples alone, at most so many, evenly chosen.

        For an engine that is asked for its force at one state after another: they are no motion any
        more that could be followed in time.
        """
        places = self.firm_places(most)
        force = None if self.force is None else self.force[places]
        return Motion(
            self.time[places],
            self.penetration[places],
            self.velocity[places],
            self.acceleration[places],
            np.ones(places.size, dtype=np.bool_),
            (0,),
            force,
            self.source,
        )

    def firm_places(self, most: int = MOST_SAMPLES) -> NDArray[np.int64]:
        """Which samples :meth:`firm` takes."""
        places = np.flatnonzero(self.judged)
        return places[:: -(-places.size // most)]


def surface_and_offset(result: "Identification | SavedResult") -> tuple[float, float]:
    """Return where an estimator found the surface, m, and the offset of the force, N; else 0."""
    if hasattr(result, "description"):
        [found] = result.description["results"]
        return float(found.get("surface", 0.0)), float(found.get("offset", 0.0))
    return result.estimate.surface, result.estimate.offset
