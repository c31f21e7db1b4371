"""An array that grows in place, so that what is read is never held twice."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

GROWTH = 1.25  # new pages are touched, so that a fifth of the memory at most is of no use
FIRST = 1024


class Growing:
    """A one-dimensional array of numbers, to which others are added.

    Parameters
    ----------
    dtype : dtype
        Of its elements.
    """

    def __init__(self, dtype: Any) -> None:
        self._buffer = np.empty(0, dtype=dtype)
        self._size = 0

    def extend(self, values: NDArray[Any]) -> None:
        """Add some, row by row."""
        stop = self._size + values.size
        if stop > self._buffer.size:
            # The system moves the pages of a large array; no one else has a view of it.
            self._buffer.resize(max(int(GROWTH * stop), FIRST), refcheck=False)
        self._buffer[self._size : stop] = values.reshape(-1)
        self._size = stop

    def taken(self) -> NDArray[Any]:
        """Return all of it; this is empty then."""
        whole = self._buffer
        whole.resize(self._size, refcheck=False)
        self._buffer, self._size = np.empty(0, dtype=whole.dtype), 0
        return whole
