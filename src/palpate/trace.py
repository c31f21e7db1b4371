"""What a replay wrote down, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from palpate._core import Status


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Every sample of a replay: what was predicted, what was done with it, what was known after.

    Attributes
    ----------
    parameters : numpy.ndarray, shape (k, p)
        The law's parameters after each sample, SI, in the law's order.
    standard_errors : numpy.ndarray, shape (k, p)
        Their standard errors.
    predicted_force : numpy.ndarray, shape (k,)
        N, a priori: from the estimate before the sample. NaN where a sample is not finite.
    validity_margin : numpy.ndarray, shape (k,)
        Condition 10 as 1 − |v B/K| / 0.1, with the estimates in place of the truth.
    status : numpy.ndarray of uint8, shape (k,)
        A :class:`Status` each.
    time : numpy.ndarray, shape (k,)
        s, of :func:`palpate.identify`; empty where a replay was given no clock.
    """

    parameters: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    predicted_force: NDArray[np.float64]
    validity_margin: NDArray[np.float64]
    status: NDArray[np.uint8]
    time: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @classmethod
    def empty(cls, samples: int, size: int) -> "Trace":
        """Room for ``samples`` samples of a law with ``size`` parameters."""
        # One block: the fewer new pages, the faster a replay.
        block = np.empty(samples * (2 * size + 2))
        parameters, errors, predicted, margin = np.split(
            block, np.cumsum([samples * size, samples * size, samples])
        )
        return cls(
            parameters.reshape(samples, size),
            errors.reshape(samples, size),
            predicted,
            margin,
            np.empty(samples, dtype=np.uint8),
        )

    @classmethod
    def joined(cls, traces: "Sequence[Trace]", size: int) -> "Trace":
        """Return traces one behind the other, as one."""
        if not traces:
            return cls.empty(0, size)
        return cls(
            *(
                np.concatenate([getattr(trace, name) for trace in traces])
                for name in cls.__dataclass_fields__
            )
        )

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, window: slice) -> "Trace":
        """Part of the trace, sharing its memory."""
        return Trace(
            self.parameters[window],
            self.standard_errors[window],
            self.predicted_force[window],
            self.validity_margin[window],
            self.status[window],
            self.time[window],
        )

    @property
    def validity(self) -> NDArray[np.bool_]:
        """Where condition 10, |v| < 0.1 K/B, holds; shape (k,)."""
        return self.validity_margin > 0.0

    @property
    def taken(self) -> NDArray[np.bool_]:
        """Which samples entered the estimate; shape (k,)."""
        taken: NDArray[np.bool_] = np.isin(
            self.status, (Status.UPDATED, Status.GUARDED, Status.RESTARTED)
        )
        return taken

    @property
    def rejected(self) -> NDArray[np.bool_]:
        """Which samples were left out as outliers; shape (k,)."""
        rejected: NDArray[np.bool_] = self.status == Status.REJECTED
        return rejected
