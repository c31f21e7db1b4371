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


@dataclass(frozen=True, slots=True)
class Part:
    """Tables that are run together and written to one page."""

    title: str
    run: Callable[[Campaign], list[Group]]


PARTS = {
    "time": Part("What a sample costs", timing.timing),  # first, while the workers are idle
    "ideal": Part("Beside the bound: no force offset", efficiency.ideal),
    "offset": Part("Beside the bound: an unknown offset", efficiency.unknown_offset),
    "chain": Part("Beside the bound: the paper's sensors", efficiency.sensor_chain),
    "light-contact": Part("Light contact, lost contact and tares", light.light),
    "starts": Part("Starting values", starts.starts),
    "approaches": Part("A probe that only goes in", approaches.approaches),
    "convergence": Part("How soon: three sines", convergence.three_sines),
    "one-sine": Part("How soon: one sine", convergence.one_sine),
    "changes": Part("A material that changes", changes.changes),
    "alarms": Part("The change detector", alarms.alarms),
    "outliers": Part("Outliers", outliers.outliers),
    "contact-point": Part("A surface that is unknown", contact_point.contact_point),
    "coverage": Part("Whether the error bars are true", coverage.coverage),
    "bars": Part("Error bars where noise is correlated", bars.bars),
    "recordings": Part("Recordings, beside offline least squares", recordings.recordings),
    "holding": Part("A contact that is held", holding.holding),
    "drift": Part("A material that drifts", drift.drift),
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
        Names of parts to run. Default: all.
    workers
        Worker processes. Default: one a core.
    scheduler
        Address of a Dask scheduler, whose workers were started in a checkout.
    markdown
        Write a page for each part into this folder too.
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
                page = report.page(PARTS[name].title, f"--only {name}", found, facts)
                write_text(markdown / f"{name}.md", page)
    console.print(report.words(facts))
    if json is not None:
        write_text(json, report.as_json(groups, facts))


if __name__ == "__main__":
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
