"""``python -m benchmarks.accuracy``: run the rows, print the tables."""

import sys
from collections.abc import Callable
from pathlib import Path

from cyclopts import App

from benchmarks.accuracy import (
    changes,
    contact_point,
    convergence,
    coverage,
    drift,
    efficiency,
    holding,
    recordings,
    report,
    starts,
    timing,
)
from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.table import Group
from palpate.writing import check_outputs, write_text

ROWS: dict[str, Callable[[Campaign], list[Group]]] = {
    "time": timing.timing,  # first, while the workers are idle
    "ideal": efficiency.ideal,
    "offset": efficiency.unknown_offset,
    "chain": efficiency.sensor_chain,
    "starts": starts.starts,
    "convergence": convergence.three_sines,
    "one-sine": convergence.one_sine,
    "changes": changes.changes,
    "contact-point": contact_point.contact_point,
    "coverage": coverage.coverage,
    "recordings": recordings.recordings,
    "holding": holding.holding,
    "drift": drift.drift,
}

app = App(name="python -m benchmarks.accuracy", help_format="plaintext")


@app.default
def accuracy(
    *,
    seeds: int = 200,
    only: list[str] | None = None,
    workers: int | None = None,
    markdown: Path | None = None,
    json: Path | None = None,
) -> None:
    """Measure how accurate identification is, against bounds and targets.

    Parameters
    ----------
    seeds
        Seeds of the noise, 2 or more.
    only
        Rows to run, by name; all unless given.
    workers
        Worker processes; one a core unless given.
    markdown
        Write the tables to this file too.
    json
        Write the numbers to this file.
    """
    chosen = only if only else list(ROWS)
    unknown = [name for name in chosen if name not in ROWS]
    if unknown or seeds < 2:
        what = f"no row {unknown[0]!r}" if unknown else f"--seeds {seeds} is fewer than 2"
        sys.exit(f"{what}; rows are {', '.join(ROWS)}")
    check_outputs([path for path in (markdown, json) if path is not None])
    console, groups = report.console(), list[Group]()
    with Campaign(seeds, workers) as campaign:
        for name in chosen:
            found = ROWS[name](campaign)
            for group in found:
                report.print_group(group, console)
            groups += found
    groups.sort(key=lambda group: int("".join(filter(str.isdigit, group.title.split(".")[0]))))
    facts = report.circumstances(seeds)
    console.print(report.words(facts))
    if markdown is not None:
        write_text(markdown, report.markdown(groups, facts))
    if json is not None:
        write_text(json, report.as_json(groups, facts))


if __name__ == "__main__":
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
