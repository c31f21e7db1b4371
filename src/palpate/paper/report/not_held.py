"""What the paper says that is held against nothing, and why."""

from dataclasses import dataclass

from palpate.paper.experiment import claims_file


@dataclass(frozen=True, slots=True)
class NotHeld:
    """Sentences that are not judged, for one reason.

    Attributes
    ----------
    why : str
        The reason.
    sentences : tuple of (str, str)
        Section and words of each.
    """

    why: str
    sentences: tuple[tuple[str, str], ...]


def not_held() -> tuple[NotHeld, ...]:
    """Return what ``claims.toml`` holds of them."""
    found = []
    for each in claims_file()["not-held"]:
        lines = (line.partition(" ") for line in each["words"].strip().splitlines())
        sentences = tuple((where, words) for where, _, words in lines)
        found.append(NotHeld(each["why"], sentences))
    return tuple(found)
