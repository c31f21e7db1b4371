"""The last seconds of the loop's rows and the present estimate, as the page shows them."""

import math
import struct
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status
from palpate.force_laws import FORCE_LAWS, ForceLaw, GeneralisedHuntCrossley
from palpate.live.console import ShownDepth, read_numbers
from palpate.live.ring import COLUMNS, MOST_PARAMETERS
from palpate.live.schema import estimates, read_run
from palpate.live.sinks import PLACE, Watching, unpack_parameters, why_undiagnosed
from palpate.live.view import LiveVerdict, Numbers, describe_change, fact_texts, view_texts
from palpate.validation import Floats, or_nan, plain

#: Channels of a frame, after the time, in this order.
CHANNELS = (
    "penetration", "velocity", "force", "predicted_force",
    "stiffness", "stiffness_error", "damping", "damping_error",
    *(f"parameter_{k}" for k in range(MOST_PARAMETERS)),
    *(f"error_{k}" for k in range(MOST_PARAMETERS)),
    "margin", "state", "lateness",
)  # fmt: skip

_NUMBERS = slice(8, 8 + MOST_PARAMETERS)
_ERRORS = slice(8 + MOST_PARAMETERS, 8 + 2 * MOST_PARAMETERS)
_AS_THEY_ARE = [PLACE[name] for name in ("penetration", "velocity", "force", "predicted_force")]
_LAST = [PLACE[name] for name in ("margin", "state", "lateness")]
_RESPONSE = slice(len(COLUMNS), len(COLUMNS) + 4)  # in the rows of a history, after the ring's
_UNKNOWN = math.nan, math.nan
_LARGEST = 3.4e38  # limit of a float32; larger values are not drawn


def column(rows: Floats, name: str) -> Floats:
    """Return one column of the ring's rows."""
    return rows[:, PLACE[name]]


def compute_channels(rows: Floats, law: type[ForceLaw] | None) -> NDArray[np.float32]:
    """Return rows of a :class:`History` as :data:`CHANNELS`, shape (channels, k).

    ``law`` is the estimator's force law, if it is known.
    """
    found = np.full((len(CHANNELS), len(rows)), np.nan)
    found[0:4] = rows[:, _AS_THEY_ARE].T
    found[4:8] = rows[:, _RESPONSE].T
    parameters, errors, _ = unpack_parameters(rows, MOST_PARAMETERS)
    found[_NUMBERS] = parameters.T
    found[_ERRORS] = errors.T
    if law is GeneralisedHuntCrossley:  # parameters that its law lacks are not drawn
        found[_NUMBERS][found[_ERRORS] == 0.0] = np.nan
    found[-3:] = rows[:, _LAST].T
    found[~(np.abs(found) < _LARGEST)] = np.nan
    return found.astype("<f4")


# The last seconds of a run, as sent to every browser.

SHOWN = 10.0  # s
#: Most rows in a frame, 180 kB; at most one frame waits for a client.
MOST_ROWS = 2000
#: Thinning, rows, number of the first row, rows skipped for this client, 1 if it must discard the
#: rows before.
HEADER = struct.Struct("<IIdII")
# Rows kept, as in the browser: 10 s at 6.5 kHz, less from a faster source.
_LEAST_KEPT = 1000
_MOST_KEPT = 1 << 16
_MOST_GENERATIONS = 50  # more than anybody resets in ten seconds
_BACKWARD = 1.0  # s: a larger step back means that the clock was set; a smaller one is jitter


class History:
    """The last seconds of the ring's rows, contiguous in memory, and the frames made from them.

    Attributes
    ----------
    total : int
        Rows taken so far.
    begins : int
        Number of the first row since the clock was last set; earlier rows are discarded.
    """

    def __init__(self, sample_time: float) -> None:
        # With room for a source that is a fifth faster than its nominal rate.
        wanted = math.ceil(1.2 * SHOWN / max(sample_time, 1e-6))
        self._most = min(max(wanted, _LEAST_KEPT), _MOST_KEPT)
        self._rows = np.empty((2 * self._most, _RESPONSE.stop))
        #: K′, its error, B′ and its error for the next rows.
        self.response: Floats = np.full(4, np.nan)
        self._end = self.total = self.begins = 0
        self._law: type[ForceLaw] | None = None
        self._generations: list[float] = []
        self._depth = math.nan

    @property
    def oldest(self) -> int:
        """Number of the oldest row kept."""
        return max(self.total - min(self._end, self._most), self.begins)

    def rows(self) -> Floats:
        """Return the rows kept, with times made non-decreasing, each followed by its response."""
        return self._rows[self._end - (self.total - self.oldest) : self._end]

    def show(self, law: type[ForceLaw] | None, depth: float, generation: float) -> bool:
        """Set the law and depth of the stiffness and damping; return whether they have changed.

        Parameters
        ----------
        law : type, optional
            Force law of the running estimator.
        depth : float
            m; NaN if not known yet.
        generation : float
            Number of the running estimator. Rows of earlier estimators of the same law are shown.
        """
        same_depth = depth == self._depth or (math.isnan(depth) and math.isnan(self._depth))
        if same_depth and law is self._law and generation in self._generations:
            return False
        if law is not self._law:
            self._generations.clear()
        self._generations = [*self._generations[-_MOST_GENERATIONS:], generation]
        if not same_depth:  # rows for another depth are not shown
            self._rows[:, _RESPONSE] = np.nan
        self._law = law
        self._depth = depth
        return True

    def add(self, rows: Floats, delay: float) -> None:
        """Add rows; discard the earlier ones if the time goes back by more than a second.

        Parameters
        ----------
        rows : numpy.ndarray, shape (k, columns)
            The next rows.
        delay : float
            Delay of the preparation, s, from a measurement to the row that contains it.
        """
        if not len(rows):
            return
        self.total += max(len(rows) - self._most, 0)
        rows = rows[-self._most :]
        times = column(rows, "time").copy()
        missing = ~np.isfinite(times)
        times[missing] = column(rows, "arrived")[missing] - delay
        before = self._rows[self._end - 1, PLACE["time"]] if self._end else -math.inf
        times[~np.isfinite(times)] = -math.inf  # replaced by the row before
        steps = np.diff(times, prepend=before)
        back = np.flatnonzero((steps < -_BACKWARD) & np.isfinite(times))
        self.total += len(rows)
        if len(back):
            rows = rows[back[-1] :]
            times = times[back[-1] :]
            before = -math.inf
            self._end, self.begins = 0, self.total - len(rows)
        times = np.maximum.accumulate(np.concatenate([[before], times]))[1:]
        if not np.isfinite(times[0]):  # no row has a time yet
            times[~np.isfinite(times)] = 0.0
        if self._end + len(rows) > len(self._rows):
            self._rows[: self._most] = self._rows[self._end - self._most : self._end]
            self._end = self._most
        new = self._rows[self._end : self._end + len(rows)]
        new[:, : len(COLUMNS)] = rows
        new[:, _RESPONSE] = self.response
        new[:, PLACE["time"]] = times
        self._end += len(rows)

    def frame(self, first: int, until: int, *, every: int, dropped: int, void: bool) -> bytes:
        """Return rows ``first`` to ``until - 1`` as one binary message.

        Little-endian: :data:`HEADER`; the times [s], float64; then each of :data:`CHANNELS`,
        float32. With ``every`` > 1 it contains only rows whose number is a multiple of it.
        """
        offset = self._end - self.total
        first = first + (-first) % every
        rows = self._rows[offset + first : offset + until : every]
        channels = compute_channels(rows, self._law)
        wrote = column(rows, "method")
        # Rows of an estimator of another law show only the channels that need no law.
        void_rows = ~np.isin(wrote, self._generations)
        void_rows[1:] |= wrote[1:] != wrote[:-1]  # no line between two estimators
        channels[4:-3, void_rows] = np.nan
        head = HEADER.pack(every, len(rows), first, dropped, void)
        return head + column(rows, "time").tobytes() + channels.tobytes()


# A run as the page shows it: the ring's rows, the statuses, and what follows from them.

ALIVE = 2.0  # s: the loop writes its status four times a second
MOST_CHANGES = 20
_CURVE = 33  # points of the quasi-static curve
_RECOMPUTED = 300  # responses: 30 a second, some 0.1 ms each
_NOTICED = 0.1  # s: a change is noticed within some tens of samples


class Watch:
    """State of a run, and the page's text about it.

    Attributes
    ----------
    run : Watching
        Reads the rows and statuses.
    history : History
        The last seconds.
    recast : int
        How often the history was recomputed; every client then receives it again.
    """

    def __init__(self, run: Watching) -> None:
        self.run = run
        self.loop = run.status()
        self.history = History(self.loop["sample_time"])
        self.recast = 0
        self.depth = math.nan
        self.changes: deque[dict[str, Any]] = deque(maxlen=MOST_CHANGES)
        self._law: type[ForceLaw] | None = None
        self._shown = ShownDepth()
        # Number of the estimator that detected the last change, and its law.
        self._changed_in = math.nan
        self._changed_law: type[ForceLaw] | None = None
        self._sign = (-1, -1)
        self._moved = time.monotonic()
        self._verdict: LiveVerdict | None = None
        self._by_verdict: Numbers = {}
        self._noticed = 0  # changes of the material

    def take(self) -> None:
        """Read the rows that the loop wrote since the last call."""
        rows = self.run.take()
        if len(rows):
            total = self.history.total
            self.history.response = self._response(rows[-1:])
            self.history.add(rows, float(self.loop.get("delay") or 0.0))
            self._shown.see(rows)
            self._note_changes(rows, total)

    def look(self) -> None:
        """Read the statuses and choose the depth, a few times a second."""
        self.loop = self.run.status()
        self._law = FORCE_LAWS.get(self.loop["law"]["kind"])
        # Differs as soon as the loop has written anything.
        sign = self.run.shared_json.version, self.run.reader.samples.count
        if sign != self._sign:
            self._sign = sign
            self._moved = time.monotonic()
        self.depth = or_nan(self.loop.get("depth") or self._shown.value)
        if self.history.show(self._law, self.depth, float(self.loop["generation"])):
            self.recast += 1
            self._recompute()
        row = self.run.reader.now()
        arrived = float(column(row, "arrived")[0]) if len(row) else math.nan
        self._verdict = self._shown.verdict(self.loop, arrived, self.depth)
        self._by_verdict = self._verdict.numbers() if self._verdict else {}

    def _note_changes(self, rows: Floats, first: int) -> None:
        """Remember when the material changed, and the estimates before and after."""
        if self.history.begins > first:  # the clock was set: old marks have no place
            self.changes.clear()
        for place in np.flatnonzero(column(rows, "status") == float(Status.RESTARTED)).tolist():
            moment = float(column(rows, "time")[place])
            self._changed_in = float(column(rows, "method")[place])
            self._changed_law = self._law if self._knows(self._changed_in) else None
            self._noticed += 1
            kept = self.history.rows()
            kept = kept[column(kept, "method") == self._changed_in]  # of the same estimator
            # The samples between a change and its detection have biased the estimate already.
            settled = kept[column(kept, "time") <= moment - _NOTICED][-1:]
            before = self._row_numbers(settled if len(settled) else kept[:1], self._changed_law)
            self.history.response = np.full(4, np.nan)
            self.changes.append(
                {"time": moment, "law": dict(self.loop.get("law") or {}), "before": before}
            )
        same = rows[column(rows, "method") == self._changed_in]
        if self.changes and len(same):
            self.changes[-1]["after"] = self._row_numbers(same[-1:], self._changed_law)

    def _response(self, row: Floats) -> Floats:
        """Return stiffness and damping at the depth, each with its error, from the newest row."""
        # The status reports a change of material only a little later.
        late = self.loop.get("counts", {}).get("changes", 0) < self._noticed
        law = self._law
        found = {}
        if law is not None and self._knows(float(column(row, "method")[0])) and not late:
            found = self._by_verdict if law.relaxes else read_numbers(row, law, self.depth)
        return np.ravel([found.get(name, _UNKNOWN) for name in ("stiffness", "damping")])

    def _recompute(self) -> None:
        """Compute the response in the rows kept again; that of a law that relaxes is not known."""
        if self._law is not None and not self._law.relaxes:
            for part in np.array_split(self.history.rows(), _RECOMPUTED):
                part[:, _RESPONSE] = self._response(part[-1:]) if len(part) else math.nan

    def _knows(self, generation: float) -> bool:
        """Whether the status already describes this estimator."""
        return generation == self.loop.get("generation")

    def _row_numbers(self, row: Floats, law: type[ForceLaw] | None) -> dict[str, Any]:
        """Return a row's parameters, stiffness and damping at depth, with standard errors."""
        if law is None or not len(row):
            return {}
        parameters, errors, _ = unpack_parameters(row, len(law.symbols))
        # A row of the ring is the present one.
        stiffness = [*row[0, _RESPONSE].tolist(), *self.history.response.tolist()][:4]
        # Parameters that the preferred law lacks.
        void = (errors == 0.0) & (law is GeneralisedHuntCrossley)
        return {
            "parameters": np.where(void, np.nan, parameters)[0].tolist(),
            "errors": errors[0].tolist(),
            "stiffness": stiffness[:2],
            "damping": stiffness[2:],
        }

    def _where_diagnosed(self, row: Floats, diagnosis: Mapping[str, Any]) -> dict[str, Any]:
        """Return the present stiffness and damping at the depth and frequency of the diagnosis."""
        depth = diagnosis["working_depths"][0]["depth"]
        law = self._law
        if self._verdict:
            return self._verdict.at(depth, or_nan(diagnosis["frequency"])).numbers()
        return {} if law is None or law.relaxes else read_numbers(row, law, depth)

    def _curve(self, row: Floats) -> dict[str, Any]:
        """Return the quasi-static force over the penetrations that are shown."""
        reached = column(self.history.rows(), "penetration")
        deepest = float(np.nanmax(reached, initial=0.0))
        if self._law is None or not deepest > 0.0:
            return {}
        parameters, _, _ = unpack_parameters(row, len(self._law.symbols))
        if not np.isfinite(parameters).all():
            return {}
        depth = np.linspace(0.0, deepest, _CURVE)
        if self._law.relaxes:
            parameters[0, 4:] = 0.0  # at rest only K, n, B and p count
        law = self._law.from_parameters(parameters[0])
        with np.errstate(all="ignore"):  # an initial exponent may be negative
            force = law.force(depth, np.zeros(_CURVE)) + np.nan_to_num(column(row, "offset"))
        return {"penetration": depth.tolist(), "force": force.tolist()}

    def _published(self, row: Floats, diagnosis: dict[str, Any] | None) -> dict[str, Any] | None:
        """Return the newest estimate as the wires publish it; None before the first."""
        if not len(row) or not self._knows(float(column(row, "method")[0])):
            return None
        return next(estimates(row, read_run(self.loop, diagnosis), self.run.reader.samples.count))

    def page(self, served: Mapping[str, Any], *, ended: bool = False) -> dict[str, Any]:
        """Return the page's text, with the server's counts, and the estimate, ready for JSON."""
        now = {}
        row = self.run.reader.now()
        force = math.nan
        if len(row):
            force = float(column(row, "force")[0])
            if self._knows(float(column(row, "method")[0])):
                now = {**self._row_numbers(row, self._law), "curve": self._curve(row)}
        verdict = self._verdict
        kept = self.history.rows()
        others = self.run.others()
        diagnosis = others.get("diagnosis") or {}
        if now and diagnosis.get("numbers") and not why_undiagnosed(diagnosis, self.loop):
            now |= self._where_diagnosed(row, diagnosis)
        # The motion's frequency, from the loop's law or the last diagnosis.
        frequency = verdict.law.frequency if verdict else diagnosis.get("frequency")
        chosen = self.loop.get("depth") is not None
        sure = {"certainty": verdict.certainty} if verdict else None
        # Alive if it has written anything lately, or still opens its source.
        alive = self.loop["state"] == "none" or time.monotonic() - self._moved < ALIVE
        state = self.loop["state"] if alive and not ended else "dead"
        if ended and self.loop.get("stopped"):
            state = "ended"
        page: dict[str, Any] = {
            "loop": self.loop,
            "others": others,
            "state": state,
            "ended": ended,
            "depth": {"value": self.depth, "chosen": chosen, "frequency": frequency},
            "now": now,
            "estimate": self._published(row, others.get("diagnosis")),
            "changes": [{**change, "words": describe_change(change)} for change in self.changes],
            "page": {**served, "dropped": self.run.dropped},
        }
        last = float(column(kept, "time")[-1]) if len(kept) else math.nan
        # A loop on hold does not judge contact: there the penetration decides.
        deep = state == "held" and bool((column(row, "penetration") > 0.0).any())
        touching = deep or state in ("contact", "changed")
        facts = fact_texts(page, state, force if touching and math.isfinite(force) else None)
        page |= {"view": view_texts(page, verdict, last), "facts": facts}
        said: dict[str, Any] = plain({**page, "loop": {**self.loop, "verdict": sure}})
        return said
