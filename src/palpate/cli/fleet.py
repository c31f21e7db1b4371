"""The commands ``palpate fleet`` and ``palpate map``."""

from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from cyclopts import Group, Parameter

from palpate.cli import complain
from palpate.cli.options import (
    OUTPUT,
    Address,
    Depth,
    FigureOptions,
    Folder,
    MethodOptions,
    ResultFolder,
    quantity,
)
from palpate.cli.printing import AsJson, Terminal, bar, print_json, say, say_path
from palpate.cli.reading import ReadingOptions
from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.fleet.running import Fleet
    from palpate.fleet.tasks import Settings


Sources: TypeAlias = tuple[str, ...]


@Parameter(name="*", group=Group("Where it runs", sort_key=1.6))
@dataclass(frozen=True)
class Running:
    """Where a fleet runs."""

    workers: int | None = None
    "Processes on this machine; one a core unless given."
    scheduler: Address | None = None
    "A scheduler of Dask, such as tcp://10.0.0.7:8786, in place of processes here."
    dashboard: Annotated[bool, Parameter(negative="")] = False
    "Show Dask's page at http://127.0.0.1:8787, on this machine alone."


def fleet(
    sources: Sources,
    /,
    *,
    output: ResultFolder,
    choosing: MethodOptions = MethodOptions(),
    diagnosis: Literal["none", "input", "full"] = "input",
    report: Annotated[bool, Parameter(negative="", group=OUTPUT)] = False,
    as_json: AsJson = False,
    running: Running = Running(),
    reading: ReadingOptions = ReadingOptions(),
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
    diagnosis
        Check the data (input), everything, with a verdict for each (full), or nothing (none).
    report
        Write report.html beside the results: distributions, repeats, flags, outliers, failures.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.fleet.running import run_fleet

    settings = _settings(choosing, diagnosis, reading)
    if report:
        require_figures()
    try:
        with bar("identifying") as progress:
            found = run_fleet(sources, output, settings, **vars(running), progress=progress)
    except KeyboardInterrupt:
        complain(f"interrupted; what is done is in {output}, and the same command goes on")
        raise
    page = None
    if report:
        from palpate.fleet.report import save_report

        with bar("writing the report"):
            page = save_report(output)
    _print(found, page, as_json=as_json)
    if not found.identified:
        complain(f"nothing was identified: none of the {found.failures} rows has numbers")
        return 2
    return 0


def _settings(
    choosing: MethodOptions, diagnosis: Literal["none", "input", "full"], reading: ReadingOptions
) -> "Settings":
    """What was asked for, without what is so anyhow."""
    from palpate.fleet.tasks import Settings

    for option in ("save_config", "curve"):
        if getattr(reading, option) is not None:
            name = option.replace("_", "-")
            raise InvalidParameterError(f"--{name} is of one recording; leave it out for a fleet")
    usual = ReadingOptions().preparation
    own = {name: value for name, value in reading.preparation.items() if value != usual[name]}
    return Settings(
        method=choosing.kind.method,
        estimator={**choosing.settings, **reading.chosen(choosing.kind)},
        preparation=own,
        diagnosis=diagnosis,
        minimum_penetration=reading.min_penetration,
        minimum_force=reading.min_force,
    )


def require_figures() -> None:
    """Say before the work that what draws is not installed."""
    import_module("palpate.figures")


def _print(found: "Fleet", page: Path | None, *, as_json: bool) -> None:
    if as_json:
        paths = {"folder": str(found.folder), "report": None if page is None else str(page)}
        print_json({**asdict(found), **paths})
        return
    console = Terminal()
    new = found.contacts - found.reused
    if found.reused:
        words = f"{found.reused} of {_counted(found.contacts)} reused from an earlier run"
        say(console, words)
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


# The command ``palpate map``.


def map(
    results: Folder,
    /,
    *,
    by: str = "x,y",
    of: Literal["stiffness", "damping", "force", "exponent"] = "stiffness",
    at: Depth | None = None,
    drawing: FigureOptions = FigureOptions(),
) -> None:
    """Draw what a fleet found over where it was found, with its error beside it.

    For example:

        palpate map results/ --by x,y --figure stiffness.svg
        palpate map results/ --by x,y --at 2mm --figure map.pdf --width 180mm

    Parameters
    ----------
    results
        Folder that ``palpate fleet`` wrote.
    by
        Two columns to draw over, such as x,y; or one, such as x or index.
    of
        What is drawn, at the working depth of each contact.
    at
        One depth for all, such as 2mm: only so are places compared that were pressed differently.
    """
    from palpate.fleet.files import read_results
    from palpate.fleet.maps import map_of

    drawing = replace(drawing, figure=drawing.figure or Path("map.svg"))
    drawing.check()
    depth = None if at is None else quantity("--at", at, "penetration")
    found = map_of(read_results(results), by.split(","), of=of, depth=depth)
    drawing.save("palpate.fleet.figures.draw_map", found)
    console = Terminal()
    say(console, found.summary)
    say_path(console, f"figure: {drawing.figure}")
