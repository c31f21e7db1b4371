"""What an experiment of the paper is, and what it says."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Claim:
    """A sentence of the paper, to be held against what is seen here.

    Parameters
    ----------
    key : str
        Its name within the experiment.
    where : str
        Section and figure.
    words : str
        The paper's own.
    number : str
        The number that the paper gives, with its unit; empty where it gives none.
    unit : str
        Unit of what is measured here; empty for a pure number.
    assumption : str
        What the paper leaves open and the answer depends on.
    measured : str
        What our number is, where the paper's words do not tell.
    """

    key: str
    where: str
    words: str
    number: str = ""
    unit: str = ""
    assumption: str = ""
    measured: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """What one seed says of a claim.

    Parameters
    ----------
    holds : bool or None
        None: it cannot be checked; ``words`` says why.
    ours : float or None
        The number measured, in the claim's unit.
    words : str
        What was seen, where a number alone does not tell.
    """

    holds: bool | None
    ours: float | None = None
    words: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one seed gave: plain numbers, so that it can be written down and drawn later.

    Parameters
    ----------
    seed : int
        The seed.
    numbers : mapping
        Figures for the tables.
    curves : mapping
        What is drawn: a list of floats each, thinned out; NaN where there is nothing.
    findings : mapping
        A :class:`Finding` for each of the experiment's claims, by key.
    """

    seed: int
    numbers: Mapping[str, Any] = field(default_factory=dict)
    curves: Mapping[str, list[float]] = field(default_factory=dict)
    findings: Mapping[str, Finding] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text under a heading."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


class Experiment(ABC):
    """A figure of the paper, with the tables that belong to it.

    Attributes
    ----------
    name : str
        As the command line and the files know it, such as "fig03".
    title : str
        What a person calls it.
    caption : str
        What the figure shows, for those too who cannot see it.
    claims : tuple of Claim
        What the paper says of it.
    """

    name: str
    title: str
    caption: str = ""
    claims: tuple[Claim, ...]

    @abstractmethod
    def run(self, seed: int) -> Outcome:
        """Do the experiment once; the same seed gives the same outcome."""

    @abstractmethod
    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the first outcome, beside what the other seeds gave where that can be shown."""

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return the tables that belong to the figure; none unless it has some."""
        return ()
