"""What the paper leaves open: our values, and the ranges that ``--settings`` draws from.

The paper gives neither P₀ of any method, nor the forgetting factor of the double stage and of the
linear laws, nor the smallest force and penetration of a sample, nor how velocity is computed, nor
how long it recorded. The ranges were written before the first draw was judged, and stay. What the
paper states is never varied: its motions, initial values, 1 kHz, λ of the single stage, β and γ.
"""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import palpate

Floats = NDArray[np.float64]
Method = type[palpate.ContactEstimator]

#: End of every recording that draws share, s; each draw uses a part of it.
LONGEST = 60.0
#: The paper records one sine for more than the 500 s after which it converges (Fig. 17).
LONGEST_ONE_SINE = 600.0
#: Lowest and highest value of each setting; all are drawn evenly over their logarithm.
RANGES: Mapping[str, tuple[float, float]] = {
    # Both contain our defaults and the squares of the parameters: ln K, B/K and n are 1 to 10,
    # K and B 300 to 1e5.
    "P₀ of the single stage": (1e-2, 1e6),
    "P₀ of K and B, linear laws and stage 1": (1.0, 1e10),
    "P₀ of n, stage 2": (1e-2, 1e6),
    # Half of the draws; in the others λ fades as the paper states for the single stage.
    "1 − λ, double stage and linear laws": (1e-3, 2e-2),
    # Fig. 3 shows 10 s, Fig. 17 120 s; Fig. 15 needs 8.7 s.
    "duration [s]": (10.0, LONGEST),
    # From the sensor's step of 1/8 N.
    "smallest force [N]": (0.125, 1.0),
    "smallest penetration [mm]": (0.01, 1.0),
    # Half of the draws each: a centred filter's length, or a causal difference and low-pass.
    "centred velocity filter [ms]": (5.0, 61.0),
    "delay of a causal velocity filter [ms]": (1.6, 16.0),  # 100 to 10 Hz
}
#: Settings that only half of the draws have; those without one are at 0.
_HALVES = {
    "1 − λ, double stage and linear laws": False,
    "centred velocity filter [ms]": True,
    "delay of a causal velocity filter [ms]": False,
}
DRAWS, SEED = 40, 2012
#: Share of the draws from which a claim holds for other values of what the paper leaves open.
ENOUGH = 0.2
#: Difference of the shares of draws within a bound, of those that hold and of the others: chance
#: alone gives more in few claims (Kolmogorov and Smirnov's test at 1 %, 20 of 40 draws).
CLEARLY = 0.5
_FILE = Path(__file__).with_name("settings.json")


@dataclass(frozen=True, slots=True)
class Choice:
    """Values of what the paper leaves open, by their names in ``RANGES``; none: our own."""

    drawn: Mapping[str, float] | None = None

    @property
    def gate(self) -> palpate.ContactGate:
        """The samples that are used. Ours: ten times the noise of the force, whose bias of the
        logarithm is below 0.5 %.
        """
        if self.drawn is None:
            return palpate.ContactGate(minimum_penetration=0.1e-3, make_force=0.5)
        penetration = 1e-3 * self.drawn["smallest penetration [mm]"]
        force = self.drawn["smallest force [N]"]
        return palpate.ContactGate(minimum_penetration=penetration, make_force=force)

    def covariance_of(self, kind: Method, size: float) -> float | tuple[float, ...]:
        """Return P₀ of a method; ``size`` if ours."""
        if self.drawn is None or not issubclass(kind, palpate.RecursiveLeastSquaresEstimator):
            return size
        linear = self.drawn["P₀ of K and B, linear laws and stage 1"]
        if kind is palpate.SingleStageRLS:
            return self.drawn["P₀ of the single stage"]
        if kind is palpate.DoubleStageRLS:
            return (linear, linear, self.drawn["P₀ of n, stage 2"])
        return linear

    def settings_of(self, kind: Method) -> dict[str, Any]:
        """Return the settings of a method of the paper that differ from its defaults."""
        if self.drawn is None or not issubclass(kind, palpate.RecursiveLeastSquaresEstimator):
            return {}
        settings: dict[str, Any] = {"initial_covariance": self.covariance_of(kind, math.nan)}
        forgotten = self.drawn["1 − λ, double stage and linear laws"]
        if forgotten and kind is not palpate.SingleStageRLS:
            settings["forgetting"] = palpate.ConstantForgetting(1.0 - forgotten)
        return settings

    def recorded(self, seconds: float | None, one_sine: bool) -> tuple[float, float]:
        """Return how long to simulate, and how much of it to use, s; None: as long as open."""
        if self.drawn is None:
            return seconds or 12.0, seconds or 12.0
        if one_sine:
            return LONGEST_ONE_SINE, LONGEST_ONE_SINE
        return (seconds, seconds) if seconds else (LONGEST, self.drawn["duration [s]"] + 2.0)

    def velocity(self, contact: palpate.Contact) -> Floats:
        """Return the velocity of a simulated recording. Ours: :func:`palpate.prepare`'s."""
        if self.drawn is None:
            return contact.velocity
        from scipy.signal import lfilter, savgol_filter

        step, length = contact.sample_time, self.drawn["centred velocity filter [ms]"]
        if length:
            samples = 2 * round(0.5e-3 * length / step) + 1
            return np.asarray(savgol_filter(contact.penetration, samples, 2, 1, step))
        delay = 1e-3 * self.drawn["delay of a causal velocity filter [ms]"]
        passed = 1.0 - math.exp(-step / delay)
        difference = np.diff(contact.penetration, prepend=contact.penetration[0]) / step
        return np.asarray(lfilter([passed], [1.0, passed - 1.0], difference))


_OURS = Choice()
_chosen: ContextVar[Choice] = ContextVar("choice", default=_OURS)


def chosen() -> Choice:
    """Return the values in use."""
    return _chosen.get()


@contextmanager
def choosing(choice: Choice) -> Iterator[None]:
    """Use other values inside."""
    token = _chosen.set(choice)
    try:
        yield
    finally:
        _chosen.reset(token)


@cache
def draws(count: int = DRAWS) -> tuple[Choice, ...]:
    """Return a Latin hypercube over ``RANGES``: each setting once in each of ``count`` parts."""
    random = np.random.default_rng(SEED)
    columns: dict[str, Floats] = {}
    halves = random.permutation(count) % 2 == 0, random.permutation(count) % 2 == 0
    for name, (low, high) in RANGES.items():
        share = (random.permutation(count) + random.random(count)) / count
        columns[name] = low * (high / low) ** share
        if name in _HALVES:
            which = halves["velocity" in name]
            columns[name] = np.where(which == _HALVES[name], columns[name], 0.0)
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return tuple(Choice(dict(zip(RANGES, row, strict=True))) for row in rows)


@dataclass(frozen=True, slots=True)
class Share:
    """In which draws a claim holds; unknown counts as not."""

    held: tuple[bool, ...]

    @property
    def enough(self) -> bool:
        """Whether it holds in enough of them to depend on what is open."""
        return sum(self.held) >= ENOUGH * len(self.held)

    @property
    def text(self) -> str:
        """The count, for example "25 of 60"."""
        return f"{sum(self.held)} of {len(self.held)}"

    @property
    def where(self) -> str:
        """The setting that best separates the draws in which it holds, if one does clearly."""
        held = np.array(self.held)
        if held.all() or not held.any():
            return ""
        best = CLEARLY, ""
        for name in RANGES:
            values = np.array([(each.drawn or {})[name] for each in draws(held.size)])
            for edge in np.unique(values)[1:]:
                for words, side in (("≥", values >= edge), ("<", values < edge)):
                    gained = float(side[held].mean() - side[~held].mean())
                    inside = f"{held[side].sum()} of {side.sum()} with {name} {words} {edge:.2g}"
                    best = max(best, (gained, inside))
        return best[1]


@cache
def shares() -> Mapping[str, Share]:
    """Return the result of ``--settings`` by claim, for example "fig06.from"."""
    if not _FILE.is_file():
        return {}
    text = json.loads(_FILE.read_text(encoding="utf-8"))
    return {name: Share(tuple(sign == "1" for sign in signs)) for name, signs in text.items()}
