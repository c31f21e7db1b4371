"""The command ``palpate fleet``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from palpate.cli.choosing import Choosing
from palpate.cli.groups import OUTPUT, RUN
from palpate.cli.printing import AsJson, complain
from palpate.cli.reading import Reading
from palpate.cli.values import Address, Folder, SourceName

if TYPE_CHECKING:
    from palpate.fleet.running import Fleet
    from palpate.fleet.settings import Settings

Sources = Annotated[tuple[SourceName, ...], Parameter(allow_leading_hyphen=True, negative="")]
Output = Annotated[Folder, Parameter(name=["--output", "-o"], group=OUTPUT)]


@Parameter(name="*")
@dataclass(frozen=True)
class Running:
    """Where a fleet runs."""

    workers: Annotated[int | None, Parameter(group=RUN)] = None
    "Processes on this machine; one a core unless given."
    scheduler: Annotated[Address | None, Parameter(group=RUN)] = None
    "A scheduler of Dask, such as tcp://10.0.0.7:8786, in place of processes here."
    dashboard: Annotated[bool, Parameter(group=RUN, negative="")] = False
    "Show Dask's page at http://127.0.0.1:8787, on this machine alone."


def fleet(
    sources: Sources,
    /,
    *,
    output: Output,
    law: str | None = None,
    method: str | None = None,
    diagnosis: Literal["none", "input", "full"] = "input",
    report: Annotated[bool, Parameter(negative="", group=OUTPUT)] = False,
    as_json: AsJson = False,
    running: Running | None = None,
    reading: Reading | None = None,
) -> int:
    """Identify many contacts: a row for each, in a dataset of Parquet.

    What is done stays: after an interrupt the same command goes on. A recording that fails is a row
    with its reason; the exit status is 2 where all of them do.

    For example:

        palpate fleet recordings/ -o results/ --report
        palpate fleet map.jpk-force-map -o results/
        palpate fleet s3://archive/curves.zarr -o results/ --surface estimate

    Parameters
    ----------
    sources
        Files, patterns, folders, force maps, Zarr arrays, or addresses such as s3://bucket/folder.
    output
        Folder for the results.
    law
        The law: auto, the everyday one that explains the samples best; any, the best of all; or
        one, such as half-space, flat or half-space+single; Hunt-Crossley's unless given.
    method
        The estimator, such as single-stage; the usual one of the law unless given.
    diagnosis
        Check the data (input), everything, with a verdict for each (full), or nothing (none).
    report
        Write report.html beside the results: distributions, repeats, flags, outliers, failures.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.cli.progress import rated
    from palpate.fleet.running import run_fleet

    settings = _settings(Choosing(law, method), diagnosis, reading or Reading())
    where = running or Running()
    if report:
        _require_figures()
    try:
        with rated("identifying") as progress:
            found = run_fleet(
                sources,
                output,
                settings,
                workers=where.workers,
                scheduler=where.scheduler,
                dashboard=where.dashboard,
                progress=progress,
            )
    except KeyboardInterrupt:
        complain(f"interrupted; what is done is in {output}, and the same command goes on")
        raise
    page = _report(output) if report else None
    _print(found, page, as_json=as_json)
    if not found.identified:
        complain(f"nothing was identified: none of the {found.failures} rows has numbers")
        return 2
    return 0


def _settings(
    choosing: Choosing, diagnosis: Literal["none", "input", "full"], reading: Reading
) -> "Settings":
    """What was asked for, without what is so anyhow."""
    from palpate.errors import InvalidParameterError
    from palpate.fleet.settings import Settings

    for option in ("save_config", "curve"):
        if getattr(reading, option) is not None:
            name = option.replace("_", "-")
            raise InvalidParameterError(f"--{name} is of one recording; leave it out for a fleet")
    usual = Reading().preparation
    own = {name: value for name, value in reading.preparation.items() if value != usual[name]}
    estimator: dict[str, Any] = dict(choosing.settings)
    if not reading.reject_outliers:
        estimator["outlier_rejection"] = False
    if reading.surface == "estimate":
        estimator["surface"] = "estimate"
    if reading.exponent is not None:
        estimator["exponent"] = reading.exponent
    return Settings(
        method=choosing.kind.method,
        estimator=estimator,
        preparation=own,
        diagnosis=diagnosis,
        minimum_penetration=reading.min_penetration,
        minimum_force=reading.min_force,
    )


def _require_figures() -> None:
    from palpate.figures.style import LIGHT, style

    style(LIGHT)


def _report(folder: Path) -> Path:
    from palpate.cli.progress import bar
    from palpate.reports.fleet import save_report

    with bar("writing the report"):
        return save_report(folder)


def _print(found: "Fleet", page: Path | None, *, as_json: bool) -> None:
    from palpate.cli.layout import say, say_path
    from palpate.cli.printing import Terminal, print_json

    if as_json:
        print_json(
            {
                "folder": str(found.folder),
                "contacts": found.contacts,
                "reused": found.reused,
                "rows": found.rows,
                "identified": found.identified,
                "failures": found.failures,
                "reasons": found.reasons,
                "seconds": found.seconds,
                "report": None if page is None else str(page),
            }
        )
        return
    console = Terminal()
    new = found.contacts - found.reused
    if found.reused:
        of_all = f"{found.reused} of {_counted(found.contacts)}"
        say(console, f"{of_all} reused from an earlier run")
    if new:
        rate = new / found.seconds if found.seconds > 0.0 else 0.0
        words = f"{_counted(new)} in {found.seconds:.3g} s, {rate:.3g} a second"
        if found.rows != new:
            words += f": {found.rows} rows, one a place where the probe travels"
        say(console, words)
    for kind, count in sorted(found.reasons.items()):
        rows = found.identified + found.failures
        say(console, f"{count} of {rows} rows failed: {kind}; the column error says why")
    say_path(console, f"results: {found.folder}")
    if page is not None:
        say_path(console, f"report: {page}")


def _counted(contacts: int) -> str:
    return "1 contact" if contacts == 1 else f"{contacts} contacts"
