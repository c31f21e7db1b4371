"""Preparation of measured samples for an estimator in a control loop."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.input.preparation.settings import check_delay, check_flip
from palpate.input.preparation.velocity import window_samples
from palpate.method.contact import Contact, Delay, VelocityFilter
from palpate.method.rows import norm
from palpate.method.settings import Configured
from palpate.validation import (
    Floats,
    above_zero,
    arguments,
    number_in,
    reject_masks,
    same_length,
    shown,
    signal,
)

_DEFAULTS = _core.defaults["OnlinePreparation"]
LONGEST_WINDOW: int = _DEFAULTS["longest_window"]  # samples
WORDS = "quadratic filter of {samples} samples; all outputs are {delay:g} ms late"


class OnlinePreparation(Configured, _core.OnlinePreparation):
    """Prepares samples one by one: the online counterpart of :func:`palpate.prepare`.

    The velocity is the slope at the middle of a window of the least-squares parabola through its
    positions: the centred filter of ``prepare``, half a window late. Penetration and force are
    delayed as much, unfiltered, so that the three match; the delay does not affect the estimate
    (``docs/how-to/controller.md``).

    Like ``prepare`` it excludes dropouts of the position and returns no sample for them. Detecting
    one takes the two following samples, which delays all outputs by these two.

    Each call of :meth:`update` returns a sample if :attr:`status` is ``UPDATED``, else None:
    ``WAITING`` (no sample is ready yet, or samples arrive at less than half the rate of
    ``sample_time``), ``RESTARTED`` (the first sample of a new window, after a gap), ``REJECTED``
    (the position two samples ago is a dropout), ``NOT_FINITE``, ``INVALID_STEP`` or
    ``OUT_OF_RANGE`` (the sample is discarded; only its time counts).

    Parameters
    ----------
    sample_time : float
        Time between samples, s, in [1e-100, 1e6]; nominal if ``update`` receives times.
    velocity_window : float, optional
        Length of the filter, s, at most 255 samples. Default: 15 samples, at most 15 ms, at least 5
        samples.
    surface : float
        Position of the surface, m, after the corrections of sign and direction.
    force_offset : float
        Known offset of the force, N, to subtract.
    tare_time : float
        Length of the tare after the first sample, s: the probe must not touch anything, and no
        sample is returned. Its mean force is subtracted afterwards; see :attr:`tare`.
    flip : sequence of str
        Channels whose sign is reversed: ``"force"``, ``"penetration"``, or both.
    direction : array_like, shape (3,), optional
        Direction into the material, of any length but 0. Position and force are then vectors, and
        palpate projects them on it. Use ``flip`` if compression becomes negative.
    lost_positions : bool
        Whether to detect dropouts of the position. Without, outputs are two samples earlier.
    longest_gap : float, optional
        Time between samples, s, above which a new window begins. Default: length of the window.
    force_delay : float or tuple of float
        Delay of the force behind the position, s, as measured by :func:`palpate.skew`, or
        (delay, standard error); negative if the force is early. It may not exceed half of
        ``velocity_window``. Default: 0.

    Raises
    ------
    InvalidParameterError
        A setting is out of its range.

    Examples
    --------
    >>> import palpate
    >>> online = palpate.OnlinePreparation(sample_time=0.001)
    >>> estimator = palpate.VariableProjection()
    >>> for k in range(100):  # a controller's loop
    ...     sample = online.update(1e-5 * k, 0.02 * k)  # m and N
    ...     if sample is not None:
    ...         status = estimator.update(*sample)
    >>> estimator.estimate().samples
    84
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
        force_delay: float | tuple[float, float] = 0.0,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        step = number_in("sample_time", sample_time, 1e-100, 1e6)
        samples = window_samples(step, velocity_window)
        if samples > LONGEST_WINDOW:
            longest = f"{LONGEST_WINDOW} samples, {LONGEST_WINDOW * step:g} s"
            raise InvalidParameterError(
                f"velocity_window must be at most {longest}, not {shown(velocity_window)}"
            )
        turned = check_flip(flip)
        late = check_delay("force_delay", force_delay, step)
        reach = step * (samples // 2)
        if abs(late.seconds) > reach:
            raise InvalidParameterError(
                f"force_delay must be within ± {reach:g} s, half of the velocity_window, not "
                f"{late.seconds:g}: pass a longer velocity_window"
            )
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
            late.seconds,
        )

    @property
    def removed_delay(self) -> Delay | None:
        """The delay of the force that is taken out, or None."""
        given = self._settings["force_delay"]
        return (
            None
            if given == 0.0
            else check_delay("force_delay", given, self._settings["sample_time"])
        )

    @property
    def velocity_filter(self) -> VelocityFilter:
        """How the velocity is computed."""
        settings = self._settings
        samples = window_samples(settings["sample_time"], settings["velocity_window"])
        return VelocityFilter(samples, 2)

    def replay(
        self, position: "ArrayLike", force: "ArrayLike", time: "ArrayLike | None" = None
    ) -> Contact:
        """Process arrays sample by sample, as :meth:`update` does, and return the outputs.

        Parameters
        ----------
        position, force : array_like, shape (k,) or, with a ``direction``, (k, 3)
            m and N.
        time : array_like, shape (k,), optional
            s. Default: steps of ``sample_time``.

        Returns
        -------
        Contact
            A new segment begins with each restart of the window.

        Raises
        ------
        InvalidParameterError
            The arrays differ in length or have the wrong type or shape.
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
        filtered = self.velocity_filter
        return Contact(
            times,
            penetration=depths,
            velocity=speeds,
            force=pushes,
            segment=segment[:count],
            provenance={"velocity": WORDS.format(samples=filtered.samples, delay=1e3 * self.delay)},
            velocity_filter=filtered,
            delay=self.removed_delay,
        )


def _unit_vector(direction: "ArrayLike") -> list[float]:
    vector = signal("direction", direction)
    length = norm(vector)
    if vector.size != 3 or not 1e-100 < length < 1e100:
        raise InvalidParameterError(
            f"direction must be 3 numbers, not all zero, not {shown(direction)}"
        )
    unit: list[float] = (vector / length).tolist()
    return unit


def _rows(name: str, values: "ArrayLike", columns: int) -> Floats:
    """``values`` as one dimension, row by row."""
    if columns == 1:
        return signal(name, values)
    reject_masks(name, values)
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != columns:
        raise InvalidParameterError(
            f"{name} must have shape (k, 3), because direction is set, not {array.shape}"
        )
    return signal(name, array.reshape(-1))
