"""From what a robot measures to what an estimator takes, in a control loop."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.contact import Contact
from palpate.errors import InvalidParameterError
from palpate.preparation.settings import flipped
from palpate.preparation.velocity import window_samples
from palpate.settings import Configured
from palpate.validation import (
    Floats,
    above_zero,
    arguments,
    number_in,
    same_length,
    shown,
    signal,
    unmasked,
)

_DEFAULTS = _core.defaults["OnlinePreparation"]
LONGEST_WINDOW: int = _DEFAULTS["longest_window"]  # samples
WORDS = "quadratic filter of {samples} samples, given {delay:g} ms late with position and force"


class OnlinePreparation(Configured, _core.OnlinePreparation):
    """Prepares samples for an estimator as they come: the online twin of :func:`palpate.prepare`.

    The velocity is the slope of the parabola, by least squares, through the positions of a window,
    at the window's middle: that of the centred filter which ``prepare`` uses, half a window late.
    Penetration and force are given as late as the velocity is, as they were measured; so what is
    given belongs together, and costs an estimate nothing (``docs/online.md``).

    Like ``prepare`` it leaves lost positions out of every window; their samples are not given. To
    know one takes the two samples after it, which delays everything by those two.

    Every call of :meth:`update` gives a sample or, where :attr:`status` is another than
    ``UPDATED``, None: ``WAITING`` (none is ready yet, or samples come less than half as often as
    ``sample_time`` says), ``RESTARTED`` (after a gap, the first of a
    new window), ``REJECTED`` (the position of two samples ago is lost), ``NOT_FINITE``,
    ``INVALID_STEP`` or ``OUT_OF_RANGE`` (refused: only its time has passed).

    Parameters
    ----------
    sample_time : float
        Time between samples, s, in [1e-100, 1e6]; nominally, where ``update`` is given times.
    velocity_window : float, optional
        Length of the filter, s, at most 255 samples; 15 samples but at most 15 ms, and at least 5
        samples, unless given.
    surface : float
        Where the material begins, m, in the position as corrected.
    force_offset : float
        A known offset of the force, N, that is taken off.
    tare_time : float
        So long after the first sample, s, nothing is given and nothing may be touched: the mean
        force of that time is taken off from then on; see :attr:`tare`.
    flip : sequence of str
        Channels whose sign is turned: ``"force"``, ``"penetration"``, or both.
    direction : array_like, shape (3,), optional
        Into the material, of any length but 0. Position and force are vectors then, of which this
        direction counts: turn a force that is the sensor's on the material, or the material's on
        the probe, by ``flip``.
    lost_positions : bool
        Whether lost positions are looked for. Without, everything is given two samples sooner.
    longest_gap : float, optional
        A time between samples, s, beyond which a new window begins; the window's length unless
        given.

    Raises
    ------
    InvalidParameterError
        A setting out of its range.
    """

    __slots__ = ("_settings",)

    def __init__(
        self,
        *,
        sample_time: float = _DEFAULTS["sample_time"],
        velocity_window: float | None = None,
        surface: float = 0.0,
        force_offset: float = 0.0,
        tare_time: float = 0.0,
        flip: Sequence[str] = (),
        direction: "ArrayLike | None" = None,
        lost_positions: bool = _DEFAULTS["lost_positions"],
        longest_gap: float | None = None,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        step = number_in("sample_time", sample_time, 1e-100, 1e6)
        samples = window_samples(step, velocity_window)
        if samples > LONGEST_WINDOW:
            longest = f"{LONGEST_WINDOW} samples, {LONGEST_WINDOW * step:g} s"
            raise InvalidParameterError(
                f"velocity_window must be at most {longest}, not {shown(velocity_window)}"
            )
        turned = flipped(flip)
        super().__init__(
            step,
            samples,
            0.0 if longest_gap is None else above_zero("longest_gap", longest_gap),
            bool(lost_positions),
            number_in("surface", surface, -1e6, 1e6),
            number_in("force_offset", force_offset, -1e30, 1e30),
            number_in("tare_time", tare_time, 0.0, 1e6),
            "penetration" in turned,
            "force" in turned,
            [0.0, 0.0, 0.0] if direction is None else _unit_vector(direction),
        )

    def replay(
        self, position: "ArrayLike", force: "ArrayLike", time: "ArrayLike | None" = None
    ) -> Contact:
        """Take arrays sample by sample, as :meth:`update` would, and return what is given.

        Parameters
        ----------
        position, force : array_like, shape (k,) or, with a ``direction``, (k, 3)
            m and N.
        time : array_like, shape (k,), optional
            s; ``sample_time`` apart unless given.

        Returns
        -------
        Contact
            Its segments end where the window starts anew.

        Raises
        ------
        InvalidParameterError
            Arrays of different length, of the wrong type or shape.
        """
        columns = 1 if self._settings["direction"] is None else 3
        p, f = _rows("position", position, columns), _rows("force", force, columns)
        t = None if time is None else signal("time", time)
        samples = p.size // columns
        timed = {} if t is None else {"time": t.size}
        same_length(position=samples, force=f.size // columns, **timed)
        found, segment = np.empty((4, samples)), np.empty(samples, dtype=np.int64)
        times, depths, speeds, pushes = found
        count = self._replay(p, f, t, times, depths, speeds, pushes, segment)
        times, depths, speeds, pushes = found[:, :count]
        width = window_samples(self._settings["sample_time"], self._settings["velocity_window"])
        return Contact(
            times,
            penetration=depths,
            velocity=speeds,
            force=pushes,
            segment=segment[:count],
            provenance={"velocity": WORDS.format(samples=width, delay=1e3 * self.delay)},
        )


def _unit_vector(direction: "ArrayLike") -> list[float]:
    vector = signal("direction", direction)
    length = float(np.linalg.norm(vector))
    if vector.size != 3 or not 1e-100 < length < 1e100:
        raise InvalidParameterError(
            f"direction must be a vector of 3 numbers, not all zero, not {shown(direction)}"
        )
    unit: list[float] = (vector / length).tolist()
    return unit


def _rows(name: str, values: "ArrayLike", columns: int) -> Floats:
    """``values`` one row after the other, in one dimension."""
    if columns == 1:
        return signal(name, values)
    unmasked(name, values)
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != columns:
        raise InvalidParameterError(
            f"{name} must have shape (k, 3), as there is a direction, not {array.shape}"
        )
    return signal(name, array.reshape(-1))
