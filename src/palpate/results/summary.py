"""An identification in words: a line, and a page of text."""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.diagnosis import Quantity
from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.estimators import ViscoelasticContact
from palpate.quantities.oscillation import in_hertz
from palpate.results.following import following
from palpate.results.parameters import correlated, law_in_words, parameter_rows

if TYPE_CHECKING:
    from palpate.identification import Identified


def line(result: "Identified") -> str:
    """What was identified, in a line: verdict, stiffness and damping at the working depth."""
    there = result.diagnosis.working_depth
    name = Path(result.contact.source).name or "a contact"
    return (
        f"<Identification of {name} by {whose(result)}: {result.diagnosis.verdict.overall}; at "
        f"{depth_in_words(there.depth)} stiffness {number(there.stiffness)} N/m, damping "
        f"{number(there.damping)} N·s/m>"
    )


def summary(result: "Identified") -> str:
    """What was identified, how well, and how far to trust it, as text."""
    lines = [*_head(result), "", *_depths(result), "", *_law(result), ""]
    return "\n".join([*lines, *map(str, following(result)), *_findings(result)])


def whose(result: "Identified") -> str:
    """The method, and the law that it chose where it chooses one."""
    chosen = isinstance(result.estimator, ViscoelasticContact)
    return f"{result.method}, {law_in_words(result)}" if chosen else result.method


def number(quantity: Quantity) -> str:
    """A number with both error bars as one; where one is not known that is said."""
    return with_error(quantity.value, math.hypot(quantity.standard_error, quantity.systematic))


def both(quantity: Quantity) -> str:
    """A number with both error bars: what repeats, and what the findings would move."""
    return with_error(quantity.value, quantity.standard_error, quantity.systematic)


def felt(result: "Identified") -> tuple[Quantity, Quantity]:
    """Stiffness and damping at the working depth; K′ and B′ there of a law that remembers."""
    if result.law.remembers:
        with suppress(InvalidParameterError):  # of a probe that was held still
            told = result.dynamic_stiffness()
            return told.stiffness, told.damping
    there = result.working_depths[0]
    return there.stiffness, there.damping


def felt_at(results: "Sequence[Identified]") -> str:
    """At which frequency the numbers of laws that remember are; nothing where none does."""
    for result in results:
        if result.law.remembers:
            with suppress(InvalidParameterError):
                at = in_hertz(result.dynamic_stiffness().frequency)
                return f"{result.method}: K′ and B′ at {at}, as its law remembers"
    return ""


def whose_fit(result: "Identified") -> str:
    """Of which laws the fit's residual is: where there are stretches, not that of the whole."""
    return "the stretches' own laws fit" if result.stretches else "the law fits"


def depth_in_words(depth: float) -> str:
    """A depth, in mm; in µm or nm where it is small."""
    for unit, size, least in (("mm", 1e-3, 1e-4), ("µm", 1e-6, 1e-6)):
        if depth >= least:
            return f"{rounded(depth / size, 4)} {unit}"
    return f"{rounded(1e9 * depth, 4)} nm" if math.isfinite(depth) else "an unknown depth"


def _head(result: "Identified") -> list[str]:
    found, contact = result.diagnosis, result.contact
    marks = found.verdict
    lines = [
        f"{contact.source or 'contact'}, by {result.method}",
        f"{marks.overall} (stiffness: {marks.stiffness}, damping: {marks.damping}): {found.reason}",
    ]
    if found.remedy:
        lines.append(f"  → {found.remedy}")
    taken, rejected = result.trace.taken.sum(), result.trace.rejected.sum()
    lines.append(
        f"{len(contact)} samples, {taken} in contact, {rejected} left out as outliers; "
        f"{whose_fit(result)} to {rounded(result.fit_rmse_percent, 2)} %"
    )
    return lines


def _depths(result: "Identified") -> list[str]:
    rows = [("at depth", "force, N", "stiffness, N/m", "damping, N·s/m")]
    rows += [
        (depth_in_words(each.depth), both(each.force), both(each.stiffness), both(each.damping))
        for each in result.working_depths
    ]
    return [*_aligned(rows), "(± what repeats ± what the findings would move)"]


def _law(result: "Identified") -> list[str]:
    matrix, own = result.correlations, [k for k, _ in correlated(result)]
    header = (law_in_words(result), "estimate", "95 % interval", "unit")
    rows = [(*header, *(symbol for _, symbol in correlated(result)))]
    for row in parameter_rows(result):
        found = (matrix[row.index, k] if row.index in own else math.nan for k in own)
        correlations = (f"{each:+.3f}" if math.isfinite(each) else "–" for each in found)
        rows.append((row.symbol, row.words, row.interval, row.unit, *correlations))
    lines = [*_aligned(rows), "(the last columns are correlations)"]
    return [*lines, str(result.law_verdict)] if result.law_verdict is not None else lines


def _findings(result: "Identified") -> list[str]:
    lines = [""]
    for finding in result.diagnosis.findings:
        lines.append(f"{finding.severity}: {finding.check}: {finding.sentence}")
        lines += [f"  → {finding.remedy}"] if finding.remedy else []
    return [*lines, *(f"note: {flag}" for flag in result.flags)]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
