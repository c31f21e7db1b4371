"""The time until K, B and n are within 5 % and stay there."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import (
    MATERIALS,
    NOISE,
    ONE_SINE,
    SAMPLE_TIME,
    SYMBOLS,
    THREE_SINES,
    Floats,
    noise,
    sines,
)
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import VariableProjection
from palpate.design import Motion
from palpate.design.precision import jacobian

DURATION = 20.0  # s
KNOWN_TO = 3e-3  # N, an offset after a tare in a pause
UNKNOWN = 0.1  # N, drawn for the default
WITHIN = 0.05


@dataclass(frozen=True, slots=True)
class Variant:
    """What is known of the offset: its standard deviation; 0 if there is none, None if unknown."""

    words: str
    offset: float | None

    @property
    def settings(self) -> dict[str, Any]:
        """Return the arguments of VariableProjection."""
        if self.offset is None:
            return {}
        return {"offset": False} if self.offset == 0.0 else {"offset_deviation": self.offset}


VARIANTS = (
    Variant("no offset", 0.0),
    Variant("offset known to 3 mN", KNOWN_TO),
    Variant("offset unknown", None),
)
METHOD = (
    "Worst over the seeds, s; true x and v, 0.05 N of noise, {duration:g} s. No offset: "
    "`offset=False`. Known to 3 mN: `offset_deviation=3e-3`, with an offset drawn from it. "
    "Unknown: `VariableProjection()`, with an offset drawn from N(0, (0.1 N)²). Last columns: the "
    "median, and the time from which twice the Cramér–Rao bound is below 5 %. The worst of 200 "
    "normal errors is near 2.8 bounds, so no unbiased method has its worst there. The default "
    "prior on the offset, twenty times the noise, is not in the bound: early on it contributes "
    "more than the samples."
)
BESIDE = (
    *(f"median {symbol}" for symbol in SYMBOLS),
    *(f"2 × bound {symbol}" for symbol in SYMBOLS),
)


def three_sines(campaign: Campaign) -> list[Group]:
    lines = [
        _line(campaign, "ball", THREE_SINES, variant, (Limit(0.1), Limit(0.3), Limit(0.1)))
        for variant in VARIANTS
    ]
    return [
        Group(
            "Time into ±5 %, three sines",
            METHOD.format(duration=DURATION),
            SYMBOLS,
            lines,
            BESIDE,
            precision=".3f",
            notes=[f"{campaign.seeds} seeds."],
        )
    ]


def one_sine(campaign: Campaign) -> list[Group]:
    lines = [
        _line(campaign, material, ONE_SINE, variant, (Limit(0.5),))
        for material in MATERIALS
        for variant in VARIANTS
    ]
    return [
        Group(
            "Time into ±5 %, one sine",
            f"x₀ + 1.8 sin 11t mm. {METHOD.format(duration=DURATION)}",
            SYMBOLS,
            lines,
            BESIDE,
            precision=".3f",
            notes=[f"{campaign.seeds} seeds. The paper's single stage: 500 s."],
        )
    ]


def _line(
    campaign: Campaign,
    material: str,
    motion: Motion,
    variant: Variant,
    limits: tuple[Limit, ...],
) -> Line:
    label = f"{material}, {variant.words}"
    function = partial(_times, material, motion, variant)
    times = np.array(campaign.map(label, function, range(campaign.seeds)))
    bound = _bound(material, motion, variant)
    beside = (*np.median(times, axis=0).tolist(), *bound)
    return Line(label, tuple(times.max(axis=0).tolist()), limits, beside)


def _times(material: str, motion: Motion, variant: Variant, seed: int) -> Floats:
    """Return the seconds until K, B and n stay within 5 %; the duration if they do not."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    probe = sines(DURATION, motion)
    x, v = probe.penetration, probe.velocity
    offset = rng.normal(0.0, UNKNOWN if variant.offset is None else variant.offset)
    f = law.force(x, v) + offset + noise(rng, len(x))
    trace = VariableProjection(**variant.settings).replay(x, v, f)
    return last_outside(np.abs(trace.parameters / law.parameters - 1.0) > WITHIN)


def last_outside(outside: NDArray[np.bool_]) -> Floats:
    """Return the seconds until no sample of a column is outside any more."""
    reversed_first = np.argmax(outside[::-1], axis=0)
    samples = np.where(outside.any(axis=0), len(outside) - reversed_first, 0)
    return np.asarray(samples * SAMPLE_TIME, dtype=np.float64)


def _bound(material: str, motion: Motion, variant: Variant) -> tuple[float, ...]:
    """Return the seconds until twice the bound stays below 5 %."""
    law, probe = MATERIALS[material], sines(DURATION, motion)
    columns = jacobian(law, probe.penetration, probe.velocity) * law.parameters
    if variant.offset != 0.0:
        columns = np.hstack([columns, np.ones((len(columns), 1))])
    information = np.cumsum(columns[:, :, None] * columns[:, None, :], axis=0) / NOISE**2
    if variant.offset:
        information[:, -1, -1] += variant.offset**-2
    first = 10  # fewest samples for a valid inverse
    covariance = np.linalg.inv(information[first:])
    errors = np.sqrt(np.abs(np.diagonal(covariance, axis1=1, axis2=2)[:, :3]))
    late = last_outside(2.0 * errors > WITHIN) + first * SAMPLE_TIME
    return tuple(late.tolist())
