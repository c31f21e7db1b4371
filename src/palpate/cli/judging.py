"""The options about the verdict, and the exit status that it can end with."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from palpate.cli.groups import JUDGED
from palpate.cli.values import Depth

if TYPE_CHECKING:
    from palpate.diagnosis import Verdict

UNTRUSTED = 3  # exit status


@Parameter(name="*", group=JUDGED)
@dataclass(frozen=True)
class Judging:
    """Where the numbers are wanted, and which verdict is a failure."""

    at: Depth | None = None
    "Working depth, such as 3mm; the median penetration unless given."
    fail_on: Literal["do-not-trust", "with-care"] | None = None
    "End with exit status 3 on this verdict or a worse one."

    @property
    def depth(self) -> float | None:
        """The working depth, m, where one is asked for."""
        from palpate.cli.quantities import quantity
        from palpate.validation import number_in

        if self.at is None:
            return None
        return number_in("--at", quantity("--at", self.at, "penetration"), 0, 1e100, open_low=True)

    @property
    def options(self) -> dict[str, str]:
        """What was asked for of the numbers, by option."""
        return {} if self.at is None else {"at": self.at}

    def status(self, verdicts: "Iterable[Verdict]") -> int:
        """Return 3 where a verdict is to fail, else 0."""
        from palpate.diagnosis import MARKS

        if self.fail_on is None:
            return 0
        limit = MARKS.index(self.fail_on)
        failed = any(MARKS.index(verdict.overall) >= limit for verdict in verdicts)
        return UNTRUSTED if failed else 0
