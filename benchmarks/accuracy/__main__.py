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
)
from benchmarks.common.report import describe_machine, publish, run_command
from benchmarks.common.workers import Workers
from palpate.writing import make_folder

FOLDER = "docs/validation/accuracy"
PARTS = {
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
    markdown: Path | None = None,
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
    markdown
        Also write a page for each part into this folder.
    """
    chosen = only if only else list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown or seeds < 2:
        what = f"no part {unknown[0]!r}" if unknown else f"--seeds {seeds} is fewer than 2"
        sys.exit(f"{what}; parts are {', '.join(PARTS)}")
    if markdown is not None:
        make_folder(markdown)
    facts = describe_machine(seeds=f"{seeds}, more where a table says so")
    processes = Workers(workers, seeds)
    for name in chosen:
        groups = PARTS[name](processes)
        title, _, question = (inspect.getdoc(PARTS[name]) or "").partition(".\n\n")
        path = markdown and markdown / f"{name}.md"
        command = f"python -m benchmarks.accuracy --only {name} --markdown {FOLDER}"
        publish(groups, facts, title, path, " ".join(question.split()), command)


if __name__ == "__main__":
    run_command(main)
