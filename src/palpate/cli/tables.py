"""Identifications as a table that a person reads, or as one JSON object."""

import math
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table
from rich.text import Text

from palpate.cli.derived import print_derived
from palpate.cli.places import print_places
from palpate.cli.printing import Terminal, print_json
from palpate.cli.verdicts import print_ranking, print_verdict
from palpate.contact import Contact
from palpate.identification import Identification
from palpate.preparation.touches import touches_of
from palpate.recordings.truth import truth_of
from palpate.results.description import described


def new_table() -> Table:
    """Return a table without lines, as all of palpate's are."""
    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")


def print_identifications(
    files: Sequence[Path],
    results: Sequence[Identification],
    figure: Path | None,
    *,
    as_json: bool,
) -> None:
    """Print what a file gave: its identifications side by side, and what to know about them."""
    if as_json:
        print_json(described(files, results))
        return
    console = Terminal()
    _print_contact(results[0], console)
    _print_remarks(results[0], console)
    if len(results) > 1:
        results = print_ranking(results, console)
    else:
        print_verdict(results[0], console)
        for part in _stretches(results[0]):
            print_verdict(part, console, name=_when(part).replace("\n", " "))
        _print_surface(results[0], console)
    console.print(_table(results))
    console.print(
        Text(
            "predicted, fit: RMSE% of force, a priori after 0.2 s and of the final law; "
            "cond. 10: contact in which |v| < 0.1 K/B does not hold",
            style="dim",
        ),
        soft_wrap=True,
    )
    if len(results) == 1:
        print_derived(results[0], console)
    if any(part.place for part in results[0].stretches):
        print_places(results[0], console)
    if results[0].noticed is not None:
        console.print(Text(_noticed(results[0])), soft_wrap=True)
    for result in results:
        # One law for two materials is not identifiable by any motion: its flags would mislead.
        for flag in () if result.diagnosis.episodes else result.flags:
            console.print(Text(f"{result.method}: {flag}", style="yellow"), soft_wrap=True)
    if figure is not None:
        print(f"figure: {figure}")


def _noticed(result: Identification) -> str:
    """When a control loop would have known of the changes."""
    times = ", ".join(f"{time:.4g} s" for time in result.changes)
    return f"the change detector, in a control loop, alarms at {times or 'no time'}"


def _print_contact(first: Identification, console: Terminal) -> None:
    contact, gate, scale = first.contact, first.gate, first.scale
    chosen = first.estimator.chooses_samples and not gate.make_force
    force = "chosen by the force around each" if chosen else f"force > {gate.make_force:.3g} N"
    console.print(Text(f"{contact.source or 'contact'}", style="bold"))
    console.print(
        Text(
            f"{len(contact)} samples, {_touches(contact)}, {first.estimate.samples} in contact "
            f"(penetration > "
            f"{gate.minimum_penetration:.3g} m, {force}); computed in "
            f"units of {scale.penetration:.3g} m, {scale.velocity:.3g} m/s, {scale.force:.3g} N"
        ),
        soft_wrap=True,
    )


def _touches(contact: Contact) -> str:
    count = len(touches_of(contact))
    return "1 touch" if count == 1 else f"{count} touches"


def _stretches(result: Identification) -> list[Identification]:
    """Those between changes of the material; places have a table of their own."""
    return [part for part in result.stretches if part.place is None]


def _print_remarks(first: Identification, console: Terminal) -> None:
    """What was assumed on the way from the recording, but for what the verdict says again."""
    for remark in first.contact.remarks:
        if remark.severity != "note" and remark.sentence in first.diagnosis.reason:
            continue
        words = Text(f"{remark.step}: {remark.sentence}")
        if remark.remedy:
            words.append(f" ({remark.remedy})", "dim")
        console.print(words, soft_wrap=True)


def _print_surface(result: Identification, console: Terminal) -> None:
    """That the surface is an assumption, which is no fault of the stiffness at working depth."""
    for finding in result.diagnosis.findings:
        if finding.check == "surface" and finding.severity == "note":
            console.print(Text(f"note: {finding.sentence}"), soft_wrap=True)


def _table(results: Sequence[Identification]) -> Table:
    table = new_table()
    table.add_column("method", no_wrap=True)
    table.add_column("contact model (± standard error)", no_wrap=True)
    for heading in ("predicted", "fit", "cond. 10"):
        table.add_column(heading, justify="right", no_wrap=True)
    shown = [(result, _in_two_lines(result.method)) for result in results]
    shown += [(part, _when(part)) for result in results for part in _stretches(result)]
    for result, label in shown:
        table.add_row(
            label,
            "\n".join(_parameters(result)),
            _percent(result.prediction_rmse_percent),
            _percent(result.fit_rmse_percent),
            _share(result.violated_fraction),
        )
    if truth := truth_of(results[0].contact.provenance):
        named = zip(truth.symbols, truth.parameters, truth.units, strict=True)
        words = "\n".join(
            f"{symbol} = {value:.4g} {unit}".rstrip() for symbol, value, unit in named
        )
        table.add_row("truth, by\nthe file", words, style="dim")
    return table


def _when(part: Identification) -> str:
    """The times of a stretch, in two lines."""
    time = part.contact.time
    return f"{time[0]:.4g} s to\n{time[-1]:.4g} s"


def _in_two_lines(method: str) -> str:
    """Break long names at the first hyphen: a row has room for as many lines as parameters."""
    return method.replace("-", "-\n", 1) if len(method) > 12 else method


def _parameters(result: Identification) -> list[str]:
    law, errors = result.law, result.standard_errors
    return [
        f"{symbol} = {value:.4g} ± {error:.2g} {unit}".rstrip()
        for symbol, value, error, unit in zip(
            law.symbols, law.parameters, errors, law.units, strict=True
        )
    ]


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.2f} %"


def _share(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1%}"
