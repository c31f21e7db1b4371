"""A finding that ends all trust: the numbers are not what they are taken for."""

from palpate.diagnosis.finding import Finding


def stop(check: str, sentence: str, remedy: str | None) -> Finding:
    """A finding after which nothing is to be trusted."""
    return Finding(
        check,
        sentence,
        remedy,
        stiffness="do-not-trust",
        damping="do-not-trust",
        severity="do-not-trust",
    )
