"""The data card of a data set of robot learning: what it touches, and what cannot be trusted."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from html import escape
from pathlib import Path, PurePosixPath

import numpy as np

from palpate.digits import rounded, with_error
from palpate.errors import MissingExtraError
from palpate.findings import spoken
from palpate.fleet import maps
from palpate.fleet.files import CARD, CARD_PAGE, read_manifest, read_results
from palpate.fleet.rows import AT_DEPTH, touches_nothing
from palpate.fleet.tasks import Table
from palpate.validation import Floats, Indices, Mask, frozen
from palpate.writing import escape_markdown, write_text

#: Most episodes that the card names.
MOST_NAMED = 8
# A sine has its velocity within some per cent with this many samples per period.
_SAMPLES_PER_PERIOD = 10.0
# Error of the damping from one sample of delay, as a fraction, above which the card warns.
_LARGE = 0.1
_MARKS = ("trust", "with-care", "do-not-trust")


@frozen
class Card:
    """The text of a data card.

    Attributes
    ----------
    title : str
        Name of the data set.
    numbers : tuple of (str, str)
        Quantity and its description.
    cautions : tuple of str
        Sentences on what cannot be trusted.
    worst : tuple of (str, str, str)
        Episodes with the most severe reasons against trust: name, verdict and reason.
    made : str
        How the card was made.
    """

    title: str
    numbers: tuple[tuple[str, str], ...]
    cautions: tuple[str, ...]
    worst: tuple[tuple[str, ...], ...]
    made: str

    @property
    def markdown(self) -> str:
        """The card as Markdown, of at most 60 lines."""
        lines = [f"# Data card: {escape_markdown(self.title)}", "", "| | |", "|---|---|"]
        lines += [f"| {name} | {escape_markdown(words)} |" for name, words in self.numbers]
        lines += ["", "## What cannot be trusted", ""]
        lines += [f"- {escape_markdown(caution)}" for caution in self.cautions] or [
            "Nothing was found."
        ]
        lines += ["", "## Worst episodes", ""]
        if self.worst:
            lines += ["| episode | stiffness | damping | why |", "|---|---|---|---|"]
            lines += [f"| {' | '.join(map(escape_markdown, row))} |" for row in self.worst]
        else:
            lines += ["Every episode that touches is to be trusted."]
        return "\n".join([*lines, "", escape_markdown(self.made), ""])


def save_card(folder: Path) -> list[Path]:
    """Write the data card of a fleet into its folder, and a page with pictures if possible.

    Parameters
    ----------
    folder : Path
        Folder of the results.

    Returns
    -------
    list of Path
        ``card.md``, and ``card.html`` if matplotlib is installed.

    Raises
    ------
    FleetError
        The folder holds no results, or some are missing.
    RecordingError
        A file cannot be written.
    """
    table = read_results(folder)
    card = card_of(table, read_manifest(folder)["palpate"])
    written = [folder / CARD]
    write_text(written[0], card.markdown)
    try:
        page = _page(card, table)
    except MissingExtraError:
        return written
    write_text(folder / CARD_PAGE, page)
    return [*written, folder / CARD_PAGE]


def card_of(table: Table, version: str = "") -> Card:
    """Return the card of a table of results, with a row for each episode."""
    sources = sorted({source or "" for source in table.column("source").to_pylist()})
    title = Path(sources[0]).name if len(sources) == 1 else f"{len(sources)} data sets"
    checked = ", ".join(sorted({*table.column("checked").to_pylist()}))
    made = f"Made by palpate fleet, palpate {version}, diagnosis {checked}; one standard error."
    return Card(title, tuple(_numbers(table)), tuple(_cautions(table)), _worst(table), made)


def _numbers(table: Table) -> Iterator[tuple[str, str]]:
    whose = [*zip(*(table.column(name).to_pylist() for name in ("source", "index")), strict=True)]
    errors = table.column("error").to_pylist()
    touched = {each for each, error in zip(whose, errors, strict=True) if error is None}
    in_air = {each for each, none in zip(whose, touches_nothing(table), strict=True) if none}
    count = len({*whose})
    touching = len(touched)
    free = len(in_air)
    failed = count - touching - free
    places = errors.count(None)
    share = f"{100.0 * touching / max(count, 1):.3g} %"
    others = f"{free} in free air" + f", {failed} that could not be identified" * (failed > 0)
    others += f"; {places} places, since the probe travels" * (places > touching)
    yield "episodes that touch", f"{touching} of {count} ({share}); {others}"
    yield "sample rate", _span(maps.numbers(table, "rate"), "Hz")
    share_of_samples = 100.0 * maps.numbers(table, "contact_fraction")
    seen = int(np.isfinite(share_of_samples).sum())
    words = f", in the {seen} with free air" * (0 < seen < places)
    yield "samples in contact", _span(share_of_samples, "% of an episode") + words
    yield "peak force", _span(maps.numbers(table, "largest_force"), "N", table)
    yield "largest depth", _span(1e3 * maps.numbers(table, "largest_depth"), "mm", table)
    for quantity in maps.JUDGED:
        value, error = _at_depth(table, quantity)
        words = _span(value, AT_DEPTH[quantity])
        if np.isfinite(value).any():
            with np.errstate(all="ignore"):
                relative = np.abs(error / value)[np.isfinite(value)]
            words += f"; standard error {_middle(relative, _percent)} of each (median)"
        yield f"{quantity} at depth", words
        marks = Counter(table.column(f"verdict_{quantity}").to_pylist())
        words = ", ".join(f"{spoken(mark)} {marks[mark]}" for mark in _MARKS)
        yield f"verdicts on {quantity}", words if any(marks[m] for m in _MARKS) else "not checked"
    yield "force against position", _lateness(table)


def _at_depth(table: Table, quantity: str) -> tuple[Floats, Floats]:
    """Values at working depth and their whole standard errors."""
    return maps.numbers(table, quantity), maps.whole_errors(table, quantity)


def _span(values: Floats, unit: str, named: Table | None = None) -> str:
    """Median and percentiles as text, and the row with the largest value if a table is given."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "unknown"
    low, high = (rounded(each, 3) for each in np.percentile(known, (5, 95)).tolist())
    words = _middle(known, lambda middle: f"{rounded(middle, 3)} {unit}")
    if low != high:
        words = f"median {words}, 5–95 %: {low} to {high}"
    if named is not None and known.size > 1:
        largest = int(np.nanargmax(values))
        words += f"; largest {rounded(float(values[largest]), 3)} in {_names(named)[largest]}"
    return words


def _middle(values: Floats, describe: Callable[[float], str]) -> str:
    """The median of values as text; of two groups, that of each and its share."""
    groups = find_groups(values)
    medians = [describe(middle) for middle in _medians(values)]
    if len(groups) == 1:
        return medians[0]
    known = sum(map(np.count_nonzero, groups))
    shares = [f"in {_percent(np.count_nonzero(group) / known)}" for group in groups]
    return " and ".join(map(" ".join, zip(medians, shares, strict=True)))


def _medians(values: Floats) -> list[float]:
    """The median of values, or of each of two groups; NaN without values."""
    if not np.isfinite(values).any():
        return [math.nan]
    return [float(np.median(values[group])) for group in find_groups(values)]


def find_groups(values: Floats) -> list[Mask]:
    """Return the masks of two groups of values that are clearly apart, else one of all, finite.

    Two groups, with the distance d between their medians, are apart if the third of d in the middle
    holds at most a tenth of what a third of d about either median holds. In a density with a single
    peak the middle holds no less than one of them, however skewed or heavy its tails. Each group
    has 5 % of the values, seven about its median, and 90 % of itself within d/2 of it.
    """
    finite = np.isfinite(values)
    ordered = np.sort(values[finite])
    count = ordered.size
    below = np.arange(1, count)  # number of values in the lower group
    low = 0.5 * (ordered[(below - 1) // 2] + ordered[below // 2])
    high = 0.5 * (ordered[(below + count - 1) // 2] + ordered[(below + count) // 2])
    distance = high - low

    def near(centre: Floats, reach: Floats) -> Indices:
        first = np.searchsorted(ordered, centre - reach, side="left")
        return np.searchsorted(ordered, centre + reach, side="right") - first

    heaps = np.minimum(near(low, distance / 6.0), near(high, distance / 6.0))
    valley = near(0.5 * (low + high), distance / 6.0)
    apart = (heaps >= 7) & (10 * valley <= heaps)
    apart &= np.minimum(below, count - below) >= 0.05 * count
    apart &= near(low, 0.5 * distance) >= 0.9 * below
    apart &= near(high, 0.5 * distance) >= 0.9 * (count - below)
    if not apart.any():
        return [finite]
    border = ordered[1 + int(np.argmax(np.where(apart, np.diff(ordered), -1.0)))]
    return [finite & (values < border), finite & (values >= border)]


def _names(table: Table) -> list[str]:
    """The names of the rows without their folders: ``demos.hdf5 [7]``."""
    return [PurePosixPath(name).name for name in maps.names_of(table)]


def _lateness(table: Table) -> str:
    """How late the force is, as text."""
    delays, errors = (maps.numbers(table, f"force_delay{end}") for end in ("", "_standard_error"))
    known = np.isfinite(delays) & (errors > 0.0)
    touching = int(np.isfinite(maps.numbers(table, "stiffness")).sum())
    if not known.any():
        return f"unknown: the delay was found in none of {touching} contacts"
    ms = 1e3 * delays[known]
    error_ms = 1e3 * errors[known]
    groups = find_groups(ms)
    phrases = []
    for group in groups:
        middle = float(np.median(ms[group]))
        spread = 1.4826 * float(np.median(np.abs(ms[group] - middle)))
        count = int(np.count_nonzero(group))
        error = max(spread, float(np.median(error_ms[group]))) * 1.2533 / math.sqrt(count)
        size = with_error(abs(middle), error, unit="ms")
        share = f" in {_percent(count / ms.size)}" * (len(groups) > 1)
        of = f"median of {count} of {touching} contacts, scatter {rounded(spread, 2)} ms"
        phrases.append(f"{size} {_late_or_early(middle)}{share} ({of})")
    return f"{' and '.join(phrases)}, if the materials follow Hunt–Crossley"


def _late_or_early(delay: float) -> str:
    return "late" if delay > 0.0 else "early"


def _percent(share: float) -> str:
    return f"{rounded(100.0 * share, 2)} %"


def _cautions(table: Table) -> Iterator[str]:
    rate = maps.numbers(table, "rate")
    stiffness, damping = (maps.numbers(table, name) for name in maps.JUDGED)
    turns = maps.numbers(table, "frequency") / math.tau
    known = np.isfinite(stiffness) & np.isfinite(damping) & np.isfinite(rate)
    if not known.any():
        yield "No episode gave a stiffness: nothing can be said about what was touched."
        return
    step = 1.0 / float(np.min(rate[known]))
    with np.errstate(all="ignore"):
        shares = np.abs(stiffness / damping / rate)[known]
        samples = (rate / turns)[known]
    rated = f"{rounded(1.0 / step, 3)} Hz"
    if _LARGE < max(_medians(shares)) < math.inf:
        change = _middle(
            shares,
            lambda share: "more than itself" if share > 1.0 else _percent(share),
        )
        yield (
            f"Damping at {rated}: a force that is one sample ({rounded(1e3 * step, 3)} ms) late or "
            f"early changes it by {change} (median). Its standard errors hold where force and "
            "position were read within 1 ms."
        )
    yield (
        f"Touches shorter than {rounded(4e3 * step, 3)} ms have fewer than four samples: their "
        "peak forces are too low, and impacts are not resolved."
    )
    if min(_medians(samples)) < _SAMPLES_PER_PERIOD:
        per_period = _middle(samples, lambda middle: f"{rounded(middle, 2)} samples per period")
        yield (
            f"The motion in contact has {per_period} (median): below "
            "ten the motion is smoothed, and stiffness and damping come out too small."
        )
    delays = maps.numbers(table, "force_delay")
    late = _medians(1e3 * delays)
    if max(map(abs, late)) > 250.0 * step:
        when = _middle(1e3 * delays, lambda ms: f"{rounded(abs(ms), 2)} ms {_late_or_early(ms)}")
        again = f"repeat with --delay {rounded(late[0], 2)}ms after you have measured it"
        if len(late) > 1:
            again = "the episodes need a --delay for each group, after you have measured it"
        yield f"The force is {when}: {again}."
    for quantity in maps.JUDGED:
        marks = Counter(table.column(f"verdict_{quantity}").to_pylist())
        if doubted := marks["do-not-trust"]:
            judged = sum(marks[mark] for mark in _MARKS)
            yield f"{doubted} of {judged} contacts have a {quantity} marked do not trust."


def _worst(table: Table) -> tuple[tuple[str, ...], ...]:
    """Failures and doubtful episodes, the most severe and the least exact first."""
    value, error = _at_depth(table, "stiffness")
    with np.errstate(all="ignore"):
        inexact = np.nan_to_num(np.abs(error / value), nan=math.inf)
    rows = []
    both = [maps.verdicts_of(table, of) for of in maps.JUDGED]
    for k, (name, free) in enumerate(zip(_names(table), touches_nothing(table), strict=True)):
        (stiffness, why, _), (damping, why_damping, _) = (marks[k] for marks in both)
        worst = min(map(maps.VERDICTS.index, (stiffness, damping)))
        if worst < maps.VERDICTS.index("flagged") and not free:
            reason = why or why_damping or "see its findings"
            rows.append((worst, -float(inexact[k]), name, stiffness, damping, reason))
    rows.sort()
    phrases = [
        (name, spoken(stiffness), spoken(damping), reason)
        for _, _, name, stiffness, damping, reason in rows
    ]
    return tuple(phrases[:MOST_NAMED])


# The card as a page.


def _page(card: Card, table: Table) -> str:
    from palpate.fleet.figures import draw_card, draw_distributions
    from palpate.output.reports import html

    numbers = [(escape(name), escape(words)) for name, words in card.numbers]
    worst = [tuple(map(escape, row)) for row in card.worst]
    over = "Contact, peak force, stiffness with its standard error, and the delay of the force."
    spread = "Stiffness and damping at working depth, and below each its relative standard error."
    doubtful = (
        html.table("Worst", ("episode", "stiffness", "damping", "why"), worst) if worst else ()
    )
    sections = (
        ("numbers", "What it touches", html.table("Numbers", ("quantity", "value"), numbers)),
        ("cautions", "What cannot be trusted", _bullets(card.cautions)),
        ("episodes", "Episodes", html.drawing("episodes", partial(draw_card, table), over)),
        ("values", "Values", html.drawing("values", partial(draw_distributions, table), spread)),
        ("worst", "Worst episodes", doubtful),
    )
    body = [line for section in sections for line in html.section(*section)]
    header = [
        f"<h1>Data card: {escape(card.title)}</h1>",
        f'<p class="soft">{escape(card.made)}</p>',
    ]
    parts = ["<header>", *header, "</header>", "<main>", *body, "</main>"]
    return html.document(f"{card.title}: data card", html.REPORT_STYLE, parts)


def _bullets(sentences: Sequence[str]) -> Iterator[str]:
    if sentences:
        yield "<ul>"
        yield from (f"<li>{escape(sentence)}</li>" for sentence in sentences)
        yield "</ul>"
