"""``python -m benchmarks.accuracy``: run the parts, print the tables."""

import inspect
import sys
from pathlib import Path

from benchmarks.accuracy import (
    bounds,
    changes,
    light,
    outliers,
    recordings,
    special_contacts,
    timing,
)
from benchmarks.common.campaign import Campaign
from benchmarks.common.report import (
    Table,
    describe_machine,
    print_table,
    run_command,
    write_json,
    write_page,
)
from palpate.writing import check_writable, make_folder

FOLDER = "docs/validation/accuracy"
PARTS = {
    "time": timing.timing,  # first, while the workers are idle
    "ideal": bounds.ideal,
    "offset": bounds.unknown_offset,
    "chain": bounds.sensor_chain,
    "light-contact": light.light,
    "starts": special_contacts.starts,
    "approaches": special_contacts.approaches,
    "convergence": bounds.three_sines,
    "one-sine": bounds.one_sine,
    "changes": changes.changes,
    "alarms": changes.alarms,
    "outliers": outliers.outliers,
    "contact-point": special_contacts.contact_point,
    "coverage": bounds.coverage,
    "bars": bounds.bars,
    "recordings": recordings.recordings,
    "holding": special_contacts.holding,
    "drift": changes.drift,
}


def main(
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
    facts = describe_machine(seeds=f"{seeds}, more where a table says so")
    tables: list[Table] = []
    with Campaign(seeds, workers, scheduler) as campaign:
        for name in chosen:
            groups = PARTS[name](campaign)
            for group in groups:
                print_table(group)
            tables += groups
            title, _, question = (inspect.getdoc(PARTS[name]) or "").partition(".\n\n")
            path = markdown and markdown / f"{name}.md"
            command = f"python -m benchmarks.accuracy --only {name} --markdown {FOLDER}"
            write_page(title, groups, facts, path, " ".join(question.split()), command)
    write_json(json, tables, facts)


if __name__ == "__main__":
    run_command(main)
