"""Numbers of a run, as a line of text has them."""

import math
from collections import deque
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.digits import rounded, with_error
from palpate.estimate import Estimate
from palpate.force_laws import FORCE_LAWS
from palpate.live.law_numbers import in_words, numbers_of
from palpate.live.ring import MOST_PARAMETERS
from palpate.live.sinks.watching import PLACE
from palpate.live.states import State
from palpate.live.verdict_on_laws import verdict_on
from palpate.validation import Floats

_FIRST, _COVARIANCE = PLACE["parameter_0"], PLACE["covariance_0"]
_KEPT = 200  # penetrations in contact, a few a look: of the last minute or so
_AT_ONCE = 5
_IN_CONTACT = (State.CONTACT, State.CHANGED)


class WorkingDepth:
    """The median penetration of late, in contact."""

    def __init__(self) -> None:
        self._seen: deque[float] = deque(maxlen=_KEPT)

    def see(self, rows: Floats) -> None:
        """Take rows of the ring, of which a few are enough."""
        touching = np.isin(rows[:, PLACE["state"]], _IN_CONTACT)
        depths = rows[touching, PLACE["penetration"]]
        depths = depths[depths > 0.0]
        self._seen.extend(depths[:: max(len(depths) // _AT_ONCE, 1)].tolist())

    @property
    def value(self) -> float:
        """In m, to two digits; NaN before a contact."""
        return float(f"{np.median(self._seen):.1e}") if self._seen else math.nan


def at_depth(status: dict[str, Any], row: Floats, depth: float) -> str:
    """Stiffness and damping at a depth [m], with error bars, of a row of the ring.

    Of an estimator that compares laws which it is, and what a small oscillation feels.
    """
    kind = FORCE_LAWS.get(status.get("law", {}).get("kind", ""))
    if kind is None or not depth > 0.0:
        return "no contact yet"
    if row[PLACE["method"]] != status.get("generation"):
        return "another estimator begins"  # of which the board has not said yet what it identifies
    size = len(kind.symbols)
    parameters = row[_FIRST : _FIRST + size]
    covariance = row[_COVARIANCE:].reshape(-1)[: MOST_PARAMETERS**2]
    square = covariance.reshape(MOST_PARAMETERS, MOST_PARAMETERS)[:size, :size]
    if not np.isfinite(parameters).all():
        return "nothing known yet"
    if verdict := verdict_on(status):
        return in_words(verdict, numbers_of(verdict))
    law = kind.from_parameters(parameters)
    estimate = Estimate.from_law(law, square, status=Status(int(row[PLACE["status"]])), samples=1)
    stiffness = with_error(*estimate.stiffness_at(depth), unit="N/m")
    damping = with_error(*estimate.damping_at(depth), unit="N·s/m")
    return f"{stiffness}, {damping} at {rounded(1e3 * depth, 2)} mm"


def seconds(value: float | None) -> str:
    """A short time as a person reads it: 6.3 µs, 0.4 ms, 2 s."""
    if value is None or not math.isfinite(value):
        return "–"
    units = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
    unit, size = next((each for each in units if value >= each[1]), units[-1])
    return f"{value / size:.3g} {unit}"


def percent(fraction: float | None) -> str:
    """Of 1, with as many digits as its distance from all needs: 99.993 %."""
    if fraction is None or not math.isfinite(fraction):
        return "–"
    rest = round(100.0 * (1.0 - fraction), 9)
    digits = 0 if rest <= 0.0 else min(max(1 - math.floor(math.log10(rest)), 0), 4)
    # Rounded down, but for the error of doubles: what is not all is never written as all.
    shown = math.floor(100.0 * fraction * 10**digits + 1e-6) / 10**digits
    return f"{shown:.{digits}f} %"
