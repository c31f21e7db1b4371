"""What is published of every sample, whatever the wire: names, and numbers in their order."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.live.ring import COLUMNS, MOST_PARAMETERS
from palpate.validation import Floats

#: Before the law's parameters and their standard errors: name as published, and column of the ring.
BEFORE = (
    ("time", "arrived"),  # of the newest measurement, s, by the robot's clock
    ("prepared_time", "time"),  # to which penetration, velocity and force belong
    ("penetration", "penetration"),
    ("velocity", "velocity"),
    ("force", "force"),
    ("predicted_force", "predicted_force"),  # before the sample was learned
    ("state", "state"),  # a number of palpate.live.states.State
    ("offset", "offset"),  # N
    ("surface", "surface"),  # m
    ("margin", "margin"),  # of condition 10
)
#: Behind all of them: the verdict as a number, and s since a sample was learned.
AFTER = ("verdict", "age")
#: Of these names and those of the status; a field that goes, or means another thing, makes it the
#: next.
SCHEMA = 2
_TIMES = (0, 1)
_COLUMNS = [COLUMNS.index(column) for _, column in BEFORE]
_PARAMETER = COLUMNS.index("parameter_0")
_COVARIANCE = COLUMNS.index("covariance_0")
GENERATION = COLUMNS.index("method")


@dataclass(frozen=True, slots=True)
class Fields:
    """What the estimates of one estimator consist of.

    Attributes
    ----------
    generation : int
        Number of the estimator; a change of estimator makes another one.
    parameters : tuple of str
        Names of the law's parameters.
    origin : int
        What the source's times are counted from, ns.
    """

    generation: int
    parameters: tuple[str, ...]
    origin: int

    @classmethod
    def of(cls, page: dict[str, Any]) -> "Fields":
        """Read them from the loop's board."""
        return cls(page["generation"], tuple(page["law"]["names"]), page["origin"])

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in the order of the numbers."""
        errors = (f"{name}_standard_error" for name in self.parameters)
        return (*(name for name, _ in BEFORE), *self.parameters, *errors, *AFTER)

    def values(self, rows: Floats, after: Floats) -> Floats:
        """Return the numbers of rows of the ring, shape (k, len(names)); those after are given."""
        size = len(self.parameters)
        fixed = rows[:, _COLUMNS]
        fixed[:, _TIMES] += 1e-9 * self.origin
        variances = rows[:, _COVARIANCE : _COVARIANCE + MOST_PARAMETERS**2 : MOST_PARAMETERS + 1]
        with np.errstate(invalid="ignore"):
            errors = np.sqrt(variances[:, :size])
        return np.hstack([fixed, rows[:, _PARAMETER : _PARAMETER + size], errors, after])
