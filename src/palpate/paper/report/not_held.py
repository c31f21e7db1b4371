"""What the paper says that is held against nothing, and why."""

from palpate.paper.experiment import claims_file


def not_held() -> dict[str, tuple[tuple[str, str], ...]]:
    """Return section and words of each sentence, by the reason why it is not judged."""
    return {
        group["why"]: tuple(
            (where, words)
            for where, _, words in (line.partition(" ") for line in group["words"].splitlines())
        )
        for group in claims_file()["not-held"]
    }
