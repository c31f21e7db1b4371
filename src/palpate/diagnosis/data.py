"""What the checks ask of a recording, worked out once."""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact, slices_of
from palpate.diagnosis.finding import Finding
from palpate.diagnosis.laws import Laws
from palpate.digits import rounded
from palpate.preparation.spikes import largest_of, step_of
from palpate.preparation.suggestions import noise_of
from palpate.preparation.velocity import window_samples


class Data:
    """A contact without the samples that are not finite, and what is known of its channels.

    Parameters
    ----------
    contact : Contact
        As it was prepared.
    """

    def __init__(self, contact: Contact) -> None:
        self.contact = contact
        channels = contact.penetration, contact.velocity, contact.force
        self.known: NDArray[np.bool_] = np.all(np.isfinite(channels), axis=0)
        self.time = contact.time[self.known]
        self.penetration = contact.penetration[self.known]
        self.velocity = contact.velocity[self.known]
        self.force = contact.force[self.known]
        self.segment = contact.segment[self.known]
        #: By how they were compared: methods of one contact share them.
        self.laws: dict[str, Laws] = {}

    def __len__(self) -> int:
        return len(self.time)

    def segments(self) -> Iterator[slice]:
        """Slices of the separate contacts, in order."""
        return slices_of(self.segment)

    @cached_property
    def sample_time(self) -> float:
        """Median time between samples, s."""
        return self.contact.sample_time

    @cached_property
    def force_step(self) -> float:
        """Median gap between the distinct values of the force, N."""
        return step_of(self.force)

    @cached_property
    def force_noise(self) -> float:
        """Standard deviation of the force's noise, N, its rounding included."""
        return max(noise_of(self.force), self.force_step / math.sqrt(12.0))

    @cached_property
    def penetration_noise(self) -> float:
        """Standard deviation of the penetration's noise, m, its rounding included."""
        return max(noise_of(self.penetration), step_of(self.penetration) / math.sqrt(12.0))

    @cached_property
    def velocity_noise(self) -> float:
        """Standard deviation of the velocity's noise, m/s.

        The slope of a parabola over W samples Δt apart has σ_v² = 12 σ_x²/(W (W² − 1) Δt²).
        """
        if not self.differentiated:
            return noise_of(self.velocity)
        width = window_samples(self.sample_time)
        spread = width * (width**2 - 1.0)
        return float(self.penetration_noise * np.sqrt(12.0 / spread) / self.sample_time)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What the checks of the data found."""
        from palpate.diagnosis.inputs import input_findings  # they are made of this

        with np.errstate(all="ignore"):  # absurd samples overflow, and are then found
            return tuple(input_findings(self))

    @property
    def differentiated(self) -> bool:
        """Whether the velocity was worked out from the penetration, and not recorded."""
        return self.contact.provenance.get("velocity", "").startswith("centred")

    @cached_property
    def peak_force(self) -> float:
        """99.9th percentile of the force's size, N, so that a spike sets nothing."""
        return largest_of(self.force)

    @cached_property
    def peak_penetration(self) -> float:
        """99.9th percentile of the penetration, m."""
        return float(np.percentile(self.penetration, 99.9)) if len(self) else 0.0


def in_words(value: float, unit: str, digits: int = 3) -> str:
    """A quantity with the prefix that a person reads best: 0.0008 m is 0.8 mm."""
    for prefix, size in (
        ("k", 1e3),
        ("", 1.0),
        ("m", 1e-3),
        ("µ", 1e-6),
        ("n", 1e-9),
        ("p", 1e-12),
    ):
        if abs(value) >= 0.1 * size:
            return f"{rounded(value / size, digits)} {prefix}{unit}"
    return f"{rounded(value, digits)} {unit}"
