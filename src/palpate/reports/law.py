"""The section of a report that says which law it is: the verdict, all laws, and K′ and B′."""

import math
from collections.abc import Iterator, Mapping
from html import escape

from palpate import figures
from palpate.diagnosis.data import in_words
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.estimators import LawVerdict, ViscoelasticContact
from palpate.identification import Identified
from palpate.quantities.oscillation import band_of
from palpate.reports import html
from palpate.reports.drawings import drawing

_TITLE = "Laws by the same samples, the best first"
_HEADER = ("law", "", "score", "rms error", "numbers")


def which_law(
    result: Identified, compared: Mapping[str, Identified] | None = None
) -> Iterator[str]:
    """Which law it is, by what evidence, and what a small oscillation feels by it.

    Parameters
    ----------
    result : Identification
        What the report is about.
    compared : mapping, optional
        Every method on the same contact: the one that chooses a law is drawn beside the result.
    """
    verdict = result.law_verdict
    if verdict is None or not verdict.known:
        return
    yield f"<p>{escape(_sentence(result, verdict))}</p>"
    yield from _standings(verdict)
    yield from (f'<p class="note">{escape(flag)}</p>' for flag in verdict.flags)
    chosen = (compared or {}).get(ViscoelasticContact.method)
    both = [result]
    if chosen is not None and not isinstance(result.estimator, ViscoelasticContact):
        both.append(chosen)
    yield from _oscillations(both)


def _sentence(result: Identified, verdict: LawVerdict) -> str:
    own = isinstance(result.estimator, ViscoelasticContact)
    if len(verdict.standings) == 1:
        return f"{verdict.candidate}: the law that was asked for, so nothing was chosen."
    best, second = verdict.standings[0], verdict.standings[1]
    best_law = str(best.candidate)
    words = "is the law that was chosen" if own else "explains these samples best"
    return (
        f"{best_law[:1].upper()}{best_law[1:]} {words}, before {second.candidate} by a score of "
        f"{rounded(second.score, 3)}; from 10 on that is strong evidence. "
        f"{rounded(verdict.samples, 4)} samples say as much as "
        f"{rounded(verdict.effective_samples, 3)} independent ones."
    )


def _standings(verdict: LawVerdict) -> Iterator[str]:
    rows = [
        [
            escape(str(each.candidate)),
            escape(each.words),
            rounded(each.score, 3),
            in_words(each.rms_error, "N"),
            str(each.candidate.parameters),
        ]
        for each in verdict.standings
    ]
    yield from html.table(_TITLE, _HEADER, rows)
    yield (
        '<p class="soft">Score: N<sub>eff</sub> ln(RSS/N) + 2 p ln N<sub>eff</sub> over that of '
        "the best, by p numbers, the offset among them; the less the better.</p>"
    )


def _oscillations(results: list[Identified]) -> Iterator[str]:
    """K′ and B′ where one of them remembers; nothing of a probe that was held still."""
    if not any(result.law.remembers for result in results):
        return  # the same at any frequency
    try:
        results[0].dynamic_stiffness()
    except InvalidParameterError:
        return
    low, high = (f"{each / (2.0 * math.pi):.3g}" for each in band_of(results[0]))
    words = (
        "K′ and B′: the stiffness and the damping that a small oscillation feels at working depth, "
        f"from {low} to {high} Hz, which this motion contained. Laws of any kind have them in "
        "common."
    )
    yield from drawing(
        "oscillations", lambda **options: figures.draw_oscillations(results, **options), words
    )
