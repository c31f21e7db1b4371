"""``python -m benchmarks.accuracy``: run the parts, print the tables."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cyclopts import App

from benchmarks.accuracy import (
    alarms,
    approaches,
    bars,
    changes,
    contact_point,
    convergence,
    coverage,
    drift,
    efficiency,
    holding,
    light,
    outliers,
    recordings,
    report,
    starts,
    timing,
)
from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.table import Group
from palpate.writing import check_writable, make_folder, write_text

FOLDER = "docs/validation/accuracy"


@dataclass(frozen=True, slots=True)
class Part:
    """Tables that are run together and written to one page."""

    title: str
    question: str
    run: Callable[[Campaign], list[Group]]


PARTS = {
    "time": Part(  # first, while the workers are idle
        "What a sample costs",
        "What does a sample cost? Every ratio is relative to the paper's single-stage update in "
        "the same run.",
        timing.timing,
    ),
    "ideal": Part(
        "Errors over the Cramér–Rao bound: no force offset",
        "How close are the errors to the smallest possible? The Cramér–Rao bound is 1: no unbiased "
        "method is below it, except by chance.",
        efficiency.ideal,
    ),
    "offset": Part(
        "Errors over the Cramér–Rao bound: unknown offset",
        "How close are the errors to the smallest possible when the force offset is unknown?",
        efficiency.unknown_offset,
    ),
    "chain": Part(
        "Errors over the Cramér–Rao bound: the paper's sensors",
        "How close are the errors to the smallest possible with the paper's sensors: rounded "
        "force, encoder steps, filtered velocity?",
        efficiency.sensor_chain,
    ),
    "light-contact": Part(
        "Light contact, lost contact and tares",
        "Is the result right where the probe leaves the material, where contact is lost above the "
        "surface, and where the tare is wrong?",
        light.light,
    ),
    "starts": Part(
        "Starting values",
        "Can bad starting values spoil the result?",
        starts.starts,
    ),
    "approaches": Part(
        "A one-way approach",
        "Does the search find the global minimum where a probe only goes in?",
        approaches.approaches,
    ),
    "convergence": Part(
        "Convergence time: three sines",
        "How long until K, B and n are within 5 % and stay there?",
        convergence.three_sines,
    ),
    "one-sine": Part(
        "Convergence time: one sine",
        "How long until K, B and n are within 5 % and stay there, with a single sine?",
        convergence.one_sine,
    ),
    "changes": Part(
        "A changing material",
        "How fast does the estimate follow a sudden change of the material?",
        changes.changes,
    ),
    "alarms": Part(
        "The change detector",
        "How often does the change detector raise a false alarm, and how late does it find small "
        "changes?",
        alarms.alarms,
    ),
    "outliers": Part(
        "Outliers",
        "What do outliers cost with and without rejection, and does the rejection exclude good "
        "samples?",
        outliers.outliers,
    ),
    "contact-point": Part(
        "An unknown surface",
        "How accurate are K and the surface when the surface is known to ±2 mm only?",
        contact_point.contact_point,
    ),
    "coverage": Part(
        "Coverage of the 95 % intervals",
        "How often do the 95 % intervals contain the truth, in white noise and with the paper's "
        "sensors?",
        coverage.coverage,
    ),
    "bars": Part(
        "Coverage with correlated noise",
        "How often do the 95 % intervals contain the truth where noise is correlated and contacts "
        "are short?",
        bars.bars,
    ),
    "recordings": Part(
        "Recordings, compared with offline least squares",
        "Does `identify` find the least-squares solution on real recordings?",
        recordings.recordings,
    ),
    "holding": Part(
        "A held contact",
        "Does the estimate drift while the probe holds still for 100 s?",
        holding.holding,
    ),
    "drift": Part(
        "A drifting material",
        "How well does `DriftTracking` follow a stiffness that drifts slowly?",
        drift.drift,
    ),
}

app = App(name="python -m benchmarks.accuracy", help_format="plaintext")


@app.default
def accuracy(
    *,
    seeds: int = 200,
    only: list[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    markdown: Path | None = None,
    json: Path | None = None,
) -> None:
    """Measure how accurate identification is, compared with its bounds.

    Parameters
    ----------
    seeds
        Seeds of the noise, 2 or more.
    only
        Parts to run, by name. Default: all.
    workers
        Worker processes. Default: one per core.
    scheduler
        Address of a Dask scheduler whose workers run in a checkout.
    markdown
        Also write a page for each part into this folder.
    json
        Write the numbers to this file.
    """
    chosen = only if only else list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown or seeds < 2:
        what = f"no part {unknown[0]!r}" if unknown else f"--seeds {seeds} is fewer than 2"
        sys.exit(f"{what}; parts are {', '.join(PARTS)}")
    if markdown is not None:
        make_folder(markdown)
    if json is not None:
        check_writable(json)
    console, groups, facts = report.console(), list[Group](), report.circumstances(seeds)
    with Campaign(seeds, workers, scheduler) as campaign:
        for name in chosen:
            found = PARTS[name].run(campaign)
            for group in found:
                report.print_group(group, console)
            groups += found
            if markdown is not None:
                part, options = PARTS[name], f"--only {name} --markdown {FOLDER}"
                command = f"python -m benchmarks.accuracy {options}"
                page = report.page(part.title, part.question, command, found, facts)
                write_text(markdown / f"{name}.md", page)
    console.print(report.words(facts))
    if json is not None:
        write_text(json, report.as_json(groups, facts))


if __name__ == "__main__":
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
