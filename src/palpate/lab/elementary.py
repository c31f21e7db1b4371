"""Elementary functions of the C library, over arrays.

NumPy's own differ in the last digit from one kind of processor to the next. A robot amplifies
that: between two counts of its encoders position control sees nothing, and the poking device,
pushed from behind, diverges from 1e-16 m to a micrometre within half a second. With these the
same seed gives the same file on them all.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from palpate.validation import Floats


def _over_arrays(function: Callable[..., float], arguments: int) -> Callable[..., Floats]:
    ufunc = np.frompyfunc(function, arguments, 1)

    def over_arrays(*values: ArrayLike) -> Floats:
        return np.asarray(ufunc(*values), dtype=np.float64)

    return over_arrays


sin = _over_arrays(math.sin, 1)
cos = _over_arrays(math.cos, 1)
arccos = _over_arrays(math.acos, 1)
arctan2 = _over_arrays(math.atan2, 2)
