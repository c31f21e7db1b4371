"""The sections of an identification's report: verdict, numbers, findings and the rest, as HTML."""

import math
from collections.abc import Iterator, Mapping
from html import escape

import numpy as np

from palpate.diagnosis import Quantity, WorkingDepth
from palpate.digits import rounded
from palpate.identification import Identified
from palpate.ranking import rank
from palpate.recordings.truth import truth_of
from palpate.reports import html
from palpate.results.following import following
from palpate.results.parameters import correlated, law_in_words, parameter_rows
from palpate.results.summary import both, depth_in_words, felt, felt_at, number, whose_fit


def verdict(result: Identified) -> Iterator[str]:
    """The verdict, its reason and the remedy, and what each number is worth."""
    found = result.diagnosis
    marks = found.verdict
    sentence = found.reason[:1].upper() + found.reason[1:]
    yield f'<div class="verdict {html.colour_of(marks.overall)}">'
    yield html.badge(marks.overall)
    yield f"<p>{escape(sentence)}.</p>"
    if found.remedy:
        yield f"<p><strong>What to do:</strong> {escape(found.remedy)}.</p>"
    yield "</div>"


def tiles(result: Identified) -> Iterator[str]:
    """Stiffness, damping and force at the working depth, large."""
    found, there = result.diagnosis, result.diagnosis.working_depth
    marks = {"stiffness": found.verdict.stiffness, "damping": found.verdict.damping}
    yield '<div class="tiles">'
    for name, unit in (("stiffness", "N/m"), ("damping", "N·s/m"), ("force", "N")):
        quantity: Quantity = getattr(there, name)
        words = f"{number(quantity)} {unit}"
        mark = f" · {html.badge(marks[name])}" if name in marks else ""
        name = f"relaxed {name}" if result.law.remembers else name
        yield (
            f'<div class="tile"><small>{name} at {depth_in_words(there.depth)}{mark}</small>'
            f"<b>{escape(words)}</b></div>"
        )
    if result.law.remembers and (at := felt_at([result])):
        stiffness, damping = felt(result)
        words = f"{number(stiffness)} N/m, {number(damping)} N·s/m"
        name = escape(at.partition(": ")[2])
        yield f'<div class="tile"><small>{name}</small><b>{escape(words)}</b></div>'
    yield "</div>"


def numbers(result: Identified) -> Iterator[str]:
    """Numbers at the working depths, then the law's parameters and their correlations."""
    header = ("depth", "force, N", "stiffness, N/m", "damping, N·s/m")
    rows = [_depth_row(there) for there in result.working_depths]
    yield from html.table("At working depth, and at the 90th percentile of depth", header, rows)
    yield (
        '<p class="soft">± what repeats ± what the findings would move. Stiffness is ∂F/∂x and '
        "damping ∂F/∂v, at rest: what a small motion there feels.</p>"
    )
    yield from _law(result)
    yield from _correlations(result)


def _depth_row(there: WorkingDepth) -> list[str]:
    quantities = (there.force, there.stiffness, there.damping)
    return [depth_in_words(there.depth), *(escape(both(each)) for each in quantities)]


def _law(result: Identified) -> Iterator[str]:
    law, errors = result.law, result.standard_errors
    truth = truth_of(result.contact.provenance)
    known = truth is not None and type(truth) is type(law)
    header = ["parameter", "estimate", "95 % interval", "unit"]
    header += ["truth, by the file", "off by"] if known else []
    rows = []
    values = law.as_dict()
    for each in parameter_rows(result):
        row = [f"{each.symbol}, {each.name.replace('_', ' ')}", each.words, each.interval]
        row += [each.unit]
        if known and truth is not None:
            true = truth.as_dict().get(each.name, math.nan)
            apart = values.get(each.name, math.nan) - true
            row += [rounded(true, 5), _apart(apart, float(errors[each.index]))]
        rows.append([escape(cell) for cell in row])
    yield from html.table(
        f"Contact model: {law_in_words(result)}, by {result.method}", header, rows
    )
    fits = whose_fit(result)
    measures = f"{fits[:1].upper()}{fits[1:]} the force to {rounded(result.fit_rmse_percent, 2)} %"
    predicted = result.prediction_rmse_percent
    if math.isfinite(predicted):
        measures += f"; predicted a priori, after 0.2 s of contact, to {rounded(predicted, 2)} %"
    yield f'<p class="soft">{escape(measures)} (RMS).</p>'
    for flag in result.flags if not result.diagnosis.episodes else ():
        yield f'<p class="note">{escape(flag)}</p>'


def _apart(difference: float, error: float) -> str:
    return f"{difference / error:+.1f} s.e." if error > 0.0 else "–"


def _correlations(result: Identified) -> Iterator[str]:
    own = [index for index, _ in correlated(result)]
    symbols = [symbol for _, symbol in correlated(result)]
    matrix = result.correlations[np.ix_(own, own)]
    if not (own and np.isfinite(matrix).all()):
        return
    rows = [
        [escape(symbol), *(f"{value:+.4g}" for value in matrix[k])]
        for k, symbol in enumerate(symbols)
    ]
    yield from html.table("Correlations", ["", *symbols], rows)


def follows(result: Identified) -> Iterator[str]:
    """Rebound, energy lost, pulling and elastic modulus."""
    rows = []
    for line in following(result, whole=True):
        remarks = "".join(f'<p class="soft">{escape(remark)}</p>' for remark in line.remarks)
        rows.append([escape(line.name), f"<p>{escape(line.words)}</p>{remarks}"])
    yield from html.table("Of a free impact, of the loops, and of the tip", ("", ""), rows)


def findings(result: Identified) -> Iterator[str]:
    """Every finding with its remedy, and how far it moves the numbers."""
    rows = []
    for finding in result.diagnosis.findings:
        words = f"<p>{escape(finding.sentence)}</p>"
        if finding.remedy:
            words += f'<p class="soft">→ {escape(finding.remedy)}</p>'
        moves = (finding.moves_stiffness_percent, finding.moves_damping_percent)
        rows.append(
            [
                html.badge(finding.severity, finding.check),
                words,
                "–" if math.isnan(finding.z) else rounded(finding.z, 3),
                *("–" if math.isnan(each) else f"{each:+.1f} %" for each in moves),
            ]
        )
    header = ("check", "what was found", "z", "moves stiffness", "moves damping")
    yield from html.table("What was found, the gravest first", header, rows)


def parts(result: Identified) -> Iterator[str]:
    """Each stretch between changes, or each place, by itself."""
    header = ("time, s", "depth", "stiffness, N/m", "damping, N·s/m", "verdict")
    rows = []
    for part in result.stretches:
        there, time = part.diagnosis.working_depth, part.contact.time
        when = f"{time[0]:.4g} – {time[-1]:.4g}"
        if part.place is not None:
            x, y, z = (1e3 * part.place.position).tolist()
            when += f'<br><small class="soft">at {x:.1f}, {y:.1f}, {z:.1f} mm</small>'
        rows.append(
            [
                when,
                depth_in_words(there.depth),
                *(escape(number(q)) for q in (there.stiffness, there.damping)),
                html.badge(part.diagnosis.verdict.overall),
            ]
        )
    if not rows:
        for episode in result.diagnosis.episodes:
            there = episode.working_depth
            rows.append(
                [
                    f"{episode.start:.4g} – {episode.stop:.4g}",
                    depth_in_words(there.depth),
                    *(rounded(q.value, 4) for q in (there.stiffness, there.damping)),
                    "not identified by itself: --changes",
                ]
            )
    if rows:
        yield from html.table("Each by itself", header, rows)
    if result.changes.size:
        times = ", ".join(f"{time:.4g} s" for time in result.changes)
        yield f"<p>A change detector, in a control loop, alarms at {times}.</p>"


def comparison(compared: Mapping[str, Identified]) -> Iterator[str]:
    """Every method on the same contact, the best first."""
    if not compared:
        return
    ranking = rank(compared)
    header = ("method", "law", "verdict", "stiffness, N/m", "damping, N·s/m", "fit", "parameters")
    rows = []
    for name in ranking.order:
        other = compared[name]
        words = "<br>".join(escape(str(row)) for row in parameter_rows(other))
        rows.append(
            [
                escape(name),
                escape(law_in_words(other)),
                html.badge(other.diagnosis.verdict.overall),
                *(escape(number(q)) for q in felt(other)),
                f"{rounded(other.fit_rmse_percent, 2)} %",
                words,
            ]
        )
    yield from html.table("Every method on this contact, the best first", header, rows)
    if words := felt_at(list(compared.values())):
        yield f'<p class="soft">{escape(words)}.</p>'
    yield f"<p>Recommended: {escape(ranking.recommended or 'none of them')}.</p>"
    for sentence in ranking.exclusions:
        yield f'<p class="soft">{escape(sentence)}.</p>'


def preparation(result: Identified) -> Iterator[str]:
    """What was done on the way from the recording."""
    contact = result.contact
    taken, left = int(result.trace.taken.sum()), int(result.trace.rejected.sum())
    yield (
        f"<p>{len(contact)} samples, {taken} of them in contact; {left} left out as outliers.</p>"
    )
    rows = [
        [
            escape(remark.step),
            f"<p>{escape(remark.sentence)}</p>"
            + (f'<p class="soft">→ {escape(remark.remedy)}</p>' if remark.remedy else ""),
        ]
        for remark in contact.remarks
    ]
    if rows:
        yield from html.table("What was found, assumed or left out", ("step", ""), rows)
    made = [[escape(name), escape(words)] for name, words in contact.provenance.items()]
    if made:
        yield from html.table("How each channel was made", ("channel", ""), made)
