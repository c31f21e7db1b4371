"""Identifications as tables that a person reads, or as one JSON object."""

from collections.abc import Sequence
from pathlib import Path

from rich.text import Text

from palpate.cli.comparison import print_comparison
from palpate.cli.laws import print_law
from palpate.cli.layout import say, say_path
from palpate.cli.printing import Terminal, print_json
from palpate.cli.standings import verdict_on_laws
from palpate.cli.stretches import print_places, print_stretches, stretches_of, when
from palpate.cli.verdicts import percent, print_verdict, share
from palpate.cli.working_depths import print_working_depths
from palpate.contact import Contact
from palpate.digits import rounded
from palpate.identifying import Identification
from palpate.preparation.touches import touches_of
from palpate.results.description import described
from palpate.results.following import following


def print_identifications(
    files: Sequence[Path],
    results: Sequence[Identification],
    figure: Path | None,
    *,
    as_json: bool,
    folder: Path | None = None,
) -> None:
    """Print what a file gave: its identifications side by side, and what to know about them."""
    if as_json:
        print_json(described(files, results))
        return
    console = Terminal()
    say_path(console, results[0].contact.source or "contact", "bold")
    if len(results) > 1:
        print_comparison(results, console)
    else:
        _print_result(results[0], console)
    console.print()
    say(console, _samples(results[0]))
    _print_remarks(results[0], console)
    for result in results:
        # One law for two materials is not identifiable by any motion: its flags would mislead.
        for flag in () if result.diagnosis.episodes else result.flags:
            say(console, f"{result.method}: {flag}", "yellow")
    if figure is not None:
        say_path(console, f"figure: {figure}")
    if folder is not None:
        say_path(console, f"report: {folder / 'report.html'}")


def _print_result(result: Identification, console: Terminal) -> None:
    """One method: the verdict and what is at working depth, the law, and then all else."""
    print_verdict(result, console)
    for part in stretches_of(result):
        print_verdict(part, console, name=when(part))
    console.print()
    print_working_depths(result, console)
    if stretches_of(result):
        console.print()
        print_stretches(result, console)
    console.print()
    print_law(result, console)
    if words := verdict_on_laws(result):
        say(console, words)
    say(console, _quality(result))
    print_places(result, console)
    _print_surface(result, console)
    for line in following(result):
        say(console, str(line))
    if result.noticed is not None:
        say(console, _noticed(result))


def _quality(result: Identification) -> str:
    fit = "fit by the laws of each part" if result.stretches else "fit"
    words = (
        f"by {result.method}; RMSE of force: {fit} {percent(result.fit_rmse_percent)}, "
        f"predicted a priori {percent(result.prediction_rmse_percent)}"
    )
    if result.law.has_condition_10:
        words += f"; |v| < 0.1 K/B (eq. 10) fails in {share(result.violated_fraction)} of contact"
    return words


def _noticed(result: Identification) -> str:
    """When a control loop would have known of the changes."""
    times = ", ".join(f"{rounded(time, 4)} s" for time in result.changes.tolist())
    return f"the change detector, in a control loop, alarms at {times or 'no time'}"


def _samples(first: Identification) -> str:
    contact, gate, scale = first.contact, first.gate, first.scale
    chosen = first.estimator.chooses_samples and not gate.make_force
    force = "chosen by the force around each"
    if not chosen:
        force = f"force > {rounded(gate.make_force, 3)} N"
    units = ((scale.penetration, "m"), (scale.velocity, "m/s"), (scale.force, "N"))
    return (
        f"{len(contact)} samples, {_touches(contact)}, {first.estimate.samples} in contact "
        f"(penetration > {rounded(gate.minimum_penetration, 3)} m, {force}); computed in units of "
        f"{', '.join(f'{rounded(size, 3)} {unit}' for size, unit in units)}"
    )


def _touches(contact: Contact) -> str:
    count = len(touches_of(contact))
    return "1 touch" if count == 1 else f"{count} touches"


def _print_remarks(first: Identification, console: Terminal) -> None:
    """What was assumed on the way from the recording, but for what the verdict says again."""
    for remark in first.contact.remarks:
        if remark.severity != "note" and remark.sentence in first.diagnosis.reason:
            continue
        words = Text(f"{remark.step}: {remark.sentence}")
        if remark.remedy:
            words.append(f" ({remark.remedy})", "dim")
        say(console, words)


def _print_surface(result: Identification, console: Terminal) -> None:
    """That the surface is an assumption, which is no fault of the stiffness at working depth."""
    for finding in result.diagnosis.findings:
        if finding.check == "surface" and finding.severity == "note":
            say(console, f"note: {finding.sentence}")
