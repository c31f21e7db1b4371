"""Which law it is, as a person reads it: the verdict in a line, and how all laws stand."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from palpate.cli.layout import Cell, Column, print_table, say
from palpate.diagnosis.data import in_words
from palpate.digits import rounded
from palpate.estimators import LawVerdict, ViscoelasticContact
from palpate.identifying import Identification

LEGEND = (
    "score: N_eff ln(RSS/N) + 2 p ln N_eff over the best, p numbers; from 10 on strong evidence"
)


def verdict_on_laws(result: Identification) -> str:
    """Return the verdict in a line; nothing where there is none."""
    verdict = result.law_verdict
    if verdict is None or not verdict.known:
        return ""
    if isinstance(result.estimator, ViscoelasticContact):
        return str(verdict)
    return f"of the everyday laws, by the same samples: {str(verdict).removeprefix('law: ')}"


def print_standings(results: Sequence[Identification], console: Console) -> None:
    """Print how the laws stand that the samples were asked about, the best first."""
    verdict = _verdict_of(results)
    if verdict is None or not verdict.known:
        return
    columns = [
        Column("which law"),
        Column("score", right=True),
        Column("rms error", right=True),
        Column("numbers", right=True),
        Column("which means"),
    ]
    rows: list[list[Cell]] = [
        [
            Text(str(each.candidate), style="" if row else "bold"),
            rounded(each.score, 3),
            in_words(each.rms_error, "N"),
            str(each.candidate.parameters),
            each.words,
        ]
        for row, each in enumerate(verdict.standings)
    ]
    print_table(console, columns, rows)
    say(
        console,
        f"{LEGEND}; {rounded(verdict.effective_samples, 3)} independent samples of "
        f"{rounded(verdict.samples, 4)}",
        "dim",
    )
    for flag in verdict.flags:
        say(console, f"{verdict.candidate}: {flag}", "dim")


def _verdict_of(results: Sequence[Identification]) -> LawVerdict | None:
    """That of the method which chooses a law, else of any."""
    own = [each for each in results if isinstance(each.estimator, ViscoelasticContact)]
    verdicts = (each.law_verdict for each in (*own, *results))
    return next((each for each in verdicts if each is not None), None)
