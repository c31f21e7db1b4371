"""What the options ``--law`` and ``--method`` come to."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from palpate.estimators import ContactEstimator


@dataclass(frozen=True)
class Choosing:
    """Which law is identified, and by which method."""

    law: str | None = None
    method: str | None = None

    @property
    def kind(self) -> "type[ContactEstimator]":
        """The estimator's class."""
        return self._found[0]

    @property
    def settings(self) -> dict[str, Any]:
        """Its settings by which it finds the law that is asked for."""
        return self._found[1]

    @cached_property
    def _found(self) -> "tuple[type[ContactEstimator], dict[str, Any]]":
        from palpate.estimators.by_law import estimator_by_law

        return estimator_by_law(self.law, self.method)

    @property
    def options(self) -> dict[str, str]:
        """What repeats the choice, by option."""
        law = {} if self.law is None else {"law": self.law}
        return {**law, "method": self.kind.method}
