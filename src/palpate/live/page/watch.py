"""What the page knows of a run: the rows of the ring, the boards, and what follows from them."""

import math
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.force_laws import FORCE_LAWS, ForceLaw, GeneralisedHuntCrossley
from palpate.live.law_numbers import told
from palpate.live.page.channels import at_depth, column, parameters_of
from palpate.live.page.history import SHOWN, History
from palpate.live.sinks.sink import Session
from palpate.live.sinks.watching import Watching
from palpate.live.states import State
from palpate.live.verdict_on_laws import verdict_on
from palpate.validation import Floats, plain

ALIVE = 2.0  # s: the loop writes its board four times a second
MOST_CHANGES = 20
_IN_CONTACT = (float(State.CONTACT), float(State.CHANGED))
_MOVED = 0.15  # of the working depth: by so much the median moves before another is taken
_CURVE = 33  # points of the law at rest
_NOTICED = 0.1  # s: a change is noticed within some tens of samples
_SETTLED = 50  # rows in contact before a median is one


class Watch:
    """One run as a person watches it.

    Parameters
    ----------
    session : Session
        Where ring and boards are.

    Attributes
    ----------
    run : Watching
        Ring and boards.
    history : History
        The last seconds.
    recast : int
        How often all of the history was worked out again: then every client gets it anew.
    """

    def __init__(self, session: Session) -> None:
        self.run = Watching(session)
        self.loop = self.run.status()
        self.history = History(1e-3)
        self._begun = False
        self.recast = 0
        self.depth, self.chosen_depth = math.nan, math.nan
        self.changes: deque[dict[str, Any]] = deque(maxlen=MOST_CHANGES)
        self._law: type[ForceLaw] | None = None
        self._last: Floats | None = None
        # Number of the estimator that noticed the last change, and what it identified.
        self._changed_in = math.nan
        self._changed_law: type[ForceLaw] | None = None
        self._sign, self._moved = (-1, -1), time.monotonic()

    def take(self) -> None:
        """Take what the loop wrote since the last time."""
        if not self._begun and not self._begin():
            return
        rows = self.run.take().rows
        if len(rows):
            first = self.history.total
            self.history.add(rows, float(self.loop.get("delay") or 0.0))
            self._note_changes(rows, first)
            self._last = rows[-1:]

    def _begin(self) -> bool:
        """Make room for the source's rate, as soon as the loop has said it; the rows wait."""
        self._read()
        sample_time = self.loop.get("sample_time")
        if sample_time:
            self.history, self._begun = History(float(sample_time)), True
            self._moved = time.monotonic()
        return self._begun

    def look(self) -> None:
        """Read the boards, and choose the depth: a few times a second."""
        self._read()
        if (sign := self.run.sign) != self._sign:
            self._sign, self._moved = sign, time.monotonic()
        self._choose_depth()
        generation = float(self.loop.get("generation", math.nan))
        if self.history.show(self._law, self.depth, generation):
            self.recast += 1

    def _read(self) -> None:
        self.loop = self.run.status() or self.loop
        law = self.loop.get("law") or {}
        self._law = FORCE_LAWS.get(law.get("kind", ""))

    @property
    def alive(self) -> bool:
        """Whether the loop has written anything lately, or its source is still being opened."""
        return not self._begun or time.monotonic() - self._moved < ALIVE

    def _choose_depth(self) -> None:
        """The median penetration in contact, or what a person chose, to two digits."""
        if math.isfinite(self.chosen_depth):
            self.depth = self.chosen_depth
            return
        rows = self.history.rows()
        inside = np.isin(column(rows, "state"), _IN_CONTACT) & (column(rows, "penetration") > 0.0)
        if np.count_nonzero(inside) >= _SETTLED:
            median = float(np.median(column(rows, "penetration")[inside]))
            # So that the curve is of one depth as long as it can be, and says of which.
            if not abs(median / self.depth - 1.0) < _MOVED:
                self.depth = float(f"{median:.1e}")

    def _note_changes(self, rows: Floats, first: int) -> None:
        """Remember where the material changed, and the laws before and after."""
        if self.history.begins > first:  # another clock: the old marks are nowhere
            self.changes.clear()
        for place in np.flatnonzero(column(rows, "status") == float(Status.RESTARTED)).tolist():
            moment = float(column(rows, "time")[place])
            self._changed_in = float(column(rows, "method")[place])
            self._changed_law = self._law if self._knows(self._changed_in) else None
            kept = self.history.rows()
            kept = kept[column(kept, "method") == self._changed_in]  # not what another found
            # The samples between a change and its alarm have moved the estimate already.
            settled = kept[column(kept, "time") <= moment - _NOTICED][-1:]
            before = self._of(settled if len(settled) else kept[:1], self._changed_law)
            self.changes.append({"time": moment, "law": self._described(), "before": before})
        same = rows[column(rows, "method") == self._changed_in]
        if self.changes and len(same):
            self.changes[-1]["after"] = self._of(same[-1:], self._changed_law)

    def _knows(self, generation: float) -> bool:
        """Whether the law is that of an estimator, which the board says a little later."""
        return generation == self.loop.get("generation")

    def _described(self) -> dict[str, Any]:
        return dict(self.loop.get("law") or {})

    def _of(self, row: Floats, law: type[ForceLaw] | None) -> dict[str, Any]:
        """Parameters of one row, their standard errors, and what follows at the depth."""
        if law is None or not len(row):
            return {}
        parameters, covariance = parameters_of(row, len(law.symbols))
        stiffness = at_depth(law, parameters, covariance, self.depth)[:, 0].tolist()
        with np.errstate(invalid="ignore"):
            errors = np.sqrt(np.diagonal(covariance[0]))
        values = parameters[0].copy()
        if law is GeneralisedHuntCrossley:  # what one of its laws has not is no number
            values[errors == 0.0] = np.nan
        return {
            "parameters": values.tolist(),
            "errors": errors.tolist(),
            "stiffness": stiffness[:2],
            "damping": stiffness[2:],
        }

    def _curve(self, row: Floats) -> dict[str, Any]:
        """The law at rest, over the penetrations that are shown."""
        reached = column(self.history.rows(), "penetration")
        deepest = float(np.nanmax(reached, initial=0.0))
        if self._law is None or not deepest > 0.0:
            return {}
        parameters, _ = parameters_of(row, len(self._law.symbols))
        if not np.isfinite(parameters).all():
            return {}
        depth = np.linspace(0.0, deepest, _CURVE)
        law = self._law.from_parameters(parameters[0])
        with np.errstate(all="ignore"):  # a start may have a negative exponent
            force = law.force(depth, np.zeros(_CURVE)) + float(
                np.nan_to_num(column(row, "offset")[0])
            )
        return {"penetration": depth.tolist(), "force": force.tolist()}

    def _verdict(self) -> dict[str, Any] | None:
        """Which law it is, with what follows from it."""
        verdict = verdict_on(self.loop)
        return told(verdict) if verdict else None

    def page(self, served: Mapping[str, Any]) -> dict[str, Any]:
        """All that is said in words, as JSON takes it.

        Parameters
        ----------
        served : mapping
            What the server counted.
        """
        now: dict[str, Any] = {}
        if self._last is not None:
            row = self._last
            if self._knows(float(column(row, "method")[0])):
                now = {**self._of(row, self._law), "curve": self._curve(row)}
            for name in ("offset", "surface", "force", "penetration", "velocity"):
                now[name] = float(column(row, name)[0])
        said: dict[str, Any] = plain(
            {
                "loop": {**self.loop, "verdict": self._verdict()},
                "others": self.run.others(),
                "alive": self.alive,
                "shown": SHOWN,
                "depth": {"value": self.depth, "chosen": math.isfinite(self.chosen_depth)},
                "now": now,
                "changes": list(self.changes),
                "page": {**served, "dropped": self.run.dropped},
            }
        )
        return said

    def close(self) -> None:
        """Let go of the memory."""
        self.run.close()
