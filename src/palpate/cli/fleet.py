"""The commands ``palpate fleet`` and ``palpate map``."""

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from cyclopts import Group, Parameter
from rich.console import Console
from rich.text import Text

from palpate.cli import complain
from palpate.cli.options import (
    OUTPUT,
    Address,
    Depth,
    FigureOptions,
    Flag,
    Folder,
    MethodOptions,
    ResultFolder,
    Shape,
    mark_status,
    parse_material,
    quantity,
)
from palpate.cli.printing import (
    STYLES,
    AsJson,
    Terminal,
    bar,
    print_json,
    print_table,
    say,
    say_path,
)
from palpate.cli.reading import ReadingOptions
from palpate.digits import rounded
from palpate.errors import InvalidParameterError
from palpate.writing import protect

if TYPE_CHECKING:
    from palpate.fleet.maps import RowVerdict
    from palpate.fleet.running import Fleet
    from palpate.fleet.tasks import Settings, Table

Sources: TypeAlias = tuple[str, ...]


#: Above this number of rows only the counts of the verdicts are printed.
_MOST_ROWS = 30
_MOST_REASONS = 3
_FREE = "no contact"
_ROW_STYLES = STYLES | {"flagged": "yellow", "failed": "red", _FREE: "dim"}


@Parameter(name="*", group=Group("Workers", sort_key=1.6))
@dataclass(frozen=True)
class Running:
    """Options for the workers of a fleet."""

    workers: int | None = None
    "Number of processes on this machine (default: one per core)."
    scheduler: Address | None = None
    "Address of a Dask scheduler, such as tcp://10.0.0.7:8786 (default: processes on this machine)."
    dashboard: Flag = False
    "Serve the Dask dashboard at http://127.0.0.1:8787, on this machine only."


def fleet(
    sources: Sources,
    /,
    *,
    output: ResultFolder,
    choosing: MethodOptions = MethodOptions(),
    diagnosis: Literal["none", "input", "full"] | None = None,
    tip: Shape = None,
    thickness: Depth | None = None,
    poisson: float | None = None,
    fail_on: Literal["do-not-trust", "with-care"] | None = None,
    report: Annotated[bool, Parameter(negative="", group=OUTPUT)] = False,
    as_json: AsJson = False,
    running: Running = Running(),
    reading: ReadingOptions = ReadingOptions(),
) -> int:
    """Identify many contacts and write one row for each to a Parquet dataset.

    Repeat the command to continue after an interrupt. A recording that fails is a row with its
    error; if all fail, the exit status is 2.

    For example:

        palpate fleet recordings/ -o results/ --report
        palpate fleet demonstrations.hdf5 -o results/
        palpate fleet map.jpk-force-map -o results/ --tip sphere:radius=5um
        palpate fleet curves.zarr -o results/ --surface estimate

    Parameters
    ----------
    sources
        Files, patterns, folders, data sets of robot learning, force maps, or Zarr groups.
    output
        Folder for the results.
    diagnosis
        Check nothing (none), the data (input), or data and fits with a verdict for each (full).
        Default: full for up to 10 000 recordings or episodes, else input.
    tip
        Give Young's modulus for this tip, as for palpate identify. Force curves are then identified
        from their approach: baseline, contact point and modulus, with a verdict for each.
    thickness
        Thickness of a sample that is bonded to stiff ground, such as 5um, for --tip sphere.
    poisson
        Poisson's ratio of the material, for --tip (default: 0.5, incompressible).
    fail_on
        Exit with status 3 if a stiffness, or with --tip a modulus, has this mark or a worse one.
    report
        Write report.html to the same folder: distributions, repeats, flags, outliers, failures.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.fleet.files import disk_name, list_sources
    from palpate.fleet.running import run_fleet
    from palpate.fleet.tasks import default_diagnosis
    from palpate.input.recordings.opening import whole_recording

    shape, ratio = parse_material(tip, poisson, thickness)
    listed = list_sources(sources, leave_out=output)
    if diagnosis is None:
        diagnosis = default_diagnosis(listed)
    settings = _settings(choosing, diagnosis, reading)
    settings = replace(settings, tip=shape, poisson_ratio=ratio)
    if report:
        import_module("palpate.output.figures")  # raises without matplotlib
    try:
        inputs = (whole_recording(Path(disk_name(source.name))) for source in listed)
        with bar("identifying") as progress, protect(inputs):
            found = run_fleet(sources, output, settings, **vars(running), progress=progress)
    except KeyboardInterrupt:
        complain(f"interrupted; finished rows are in {output}; repeat the command to continue")
        os._exit(130)  # immediately: 1 of 140 interrupted starts hung after this line
    page = None
    if report:
        from palpate.fleet.report import save_report

        with bar("writing the report"):
            page = save_report(output)
    cards = []
    if any(source.kind == "episodes" for source in listed):
        from palpate.fleet.card import save_card

        with bar("writing the card"):
            cards = save_card(output)
    _print(found, page, cards, as_json=as_json)
    if not found.identified:
        complain("no contact was identified; the column error of the results has the reasons")
        return 2
    return _status(output, fail_on)


def _status(folder: Path, fail_on: Literal["do-not-trust", "with-care"] | None) -> int:
    """Return 3 if the mark of a stiffness, or with --tip of a modulus, is a failure."""
    from palpate.fleet import maps
    from palpate.fleet.files import read_results

    table = read_results(folder)
    asked = maps.list_quantities(table)[0]
    return mark_status(fail_on, table.column(f"verdict_{asked}").to_pylist())


def _settings(
    choosing: MethodOptions,
    diagnosis: Literal["none", "input", "full"],
    reading: ReadingOptions,
) -> "Settings":
    """Return the settings of a run; preparation options with their default values are omitted."""
    from palpate.fleet.tasks import AUTO, Settings

    for option in ("save_config", "curve", "episode", "sheet", "companion"):
        if getattr(reading, option) is not None:
            name = "with" if option == "companion" else option.replace("_", "-")
            raise InvalidParameterError(f"--{name} applies to one recording; omit it for a fleet")
    chosen = reading.choose_default_law(choosing)
    estimator = {**chosen.settings, **reading.chosen(chosen.kind)}
    return Settings(
        method=chosen.kind.method if chosen is choosing else AUTO,
        estimator=estimator,
        preparation=reading.changed_preparation,
        diagnosis=diagnosis,
        minimum_penetration=reading.min_penetration,
        minimum_force=reading.min_force,
        max_size=reading.max_size,
    )


def _print(found: "Fleet", page: Path | None, cards: list[Path], *, as_json: bool) -> None:
    if as_json:
        paths = {
            "folder": str(found.folder),
            "report": None if page is None else str(page),
            "card": [str(card) for card in cards],
        }
        print_json({**asdict(found), **paths})
        return
    console = Terminal()
    new = found.contacts - found.reused
    if found.reused:
        say(
            console,
            f"{found.reused} of {_describe_count(found.contacts)} reused from an earlier run",
        )
    if new:
        rate = new / found.seconds if found.seconds > 0.0 else 0.0
        places = "" if found.rows == new else f": {found.rows} rows, one per place"
        say(
            console,
            f"{_describe_count(new)} in {found.seconds:.3g} s ({rate:.3g} per second){places}",
        )
    complete = _print_rows(console, found)
    say_path(console, f"results: {found.folder}")
    if page is not None:
        say_path(console, f"report: {page}")
    elif not complete:
        say(console, "for all reasons, repeat the command with --report; it reuses the results")
    for card in cards:
        say_path(console, f"card: {card}")


def _describe_count(contacts: int) -> str:
    return "1 contact" if contacts == 1 else f"{contacts} contacts"


def _print_rows(console: Terminal, found: "Fleet") -> bool:
    """Print rows, or counts of verdicts, and the worst reasons; return whether these are all."""
    from palpate.fleet import maps
    from palpate.fleet.files import read_results
    from palpate.fleet.rows import touches_nothing
    from palpate.input.recordings.opening import MAPS

    table = read_results(found.folder)
    shown = maps.list_quantities(table)
    verdicts = {of: maps.verdicts_of(table, of) for of in shown}
    free = touches_nothing(table)
    names = maps.names_of(table)
    common = len(os.path.commonprefix(names).rpartition("/")[0])  # noqa: RUF071 - cut at a slash
    names = [name[common:].lstrip("/") for name in names]
    marks = {of: _marks_of(verdicts[of], free) for of in shown}
    if few := len(names) <= _MOST_ROWS:
        _print_contacts(console, table, names, marks)
    else:
        _print_counts(console, len(names), marks)
    if (lag := maps.rig_lag_of(table)) is not None:
        say(console, str(lag), "yellow")
    touching = [k for k, none in enumerate(free) if not none]
    reasons = maps.reasons_of_verdicts(
        [names[k] for k in touching],
        {of: [marks[k] for k in touching] for of, marks in verdicts.items()},
    )
    for verdict, line in reasons[:_MOST_REASONS]:
        say(console, line, _ROW_STYLES[verdict])
    sources = {source or "" for source in table.column("source").to_pylist()}
    if "modulus" not in shown and any(each.lower().endswith(MAPS) for each in sources):
        say(console, "for Young's modulus of force curves pass --tip, such as sphere:radius=5um")
    if found.identified and not any(table.column("verdict_stiffness").to_pylist()):
        say(console, maps.NO_VERDICT.get(table.column("checked")[0].as_py(), ""), "dim")
    return few and len(reasons) <= _MOST_REASONS


def _print_contacts(
    console: Console,
    table: "Table",
    names: Sequence[str],
    marks: Mapping[str, Sequence[Text]],
) -> None:
    """Print each contact with its numbers and their marks."""
    from palpate.fleet import maps

    turns = maps.numbers(table, "frequency") / math.tau
    columns: list[Sequence[str | Text]] = [names]
    header = ["contact"]
    for of, cells in marks.items():
        columns += [maps.format_values(table, of), cells]
        header += [maps.quantity_name(of), "mark"]
    columns.append(
        [f"{rounded(turn, 3)} Hz" if math.isfinite(turn) else "–" for turn in turns.tolist()]
    )
    print_table(console, [*header, "frequency"], [*zip(*columns, strict=True)])


def _print_counts(console: Console, rows: int, marks: Mapping[str, Sequence[Text]]) -> None:
    """Print how many contacts have each mark."""
    from palpate.findings import spoken
    from palpate.fleet import maps

    say(console, f"{rows} rows")
    kinds = [spoken(mark) for mark in (*maps.VERDICTS, _FREE)]
    for of, cells in marks.items():
        counts = Counter(cell.plain for cell in cells)
        listed = [f"{counts[kind]} {kind}" for kind in kinds if kind in counts]
        say(console, f"{maps.quantity_name(of)}: {', '.join(listed)}")


def _marks_of(verdicts: "Sequence[RowVerdict]", free: Sequence[bool]) -> list[Text]:
    """Return the marks of a quantity as cells."""
    from palpate.findings import spoken

    marks = (_FREE if none else mark for none, (mark, _, _) in zip(free, verdicts, strict=True))
    return [Text(spoken(mark), _ROW_STYLES.get(mark, "")) for mark in marks]


# The command ``palpate map``.


def map(
    results: Folder,
    /,
    *,
    by: str = "x,y",
    of: Literal["modulus", "stiffness", "damping", "force", "exponent"] | None = None,
    at: Depth | None = None,
    drawing: FigureOptions = FigureOptions(),
) -> None:
    """Draw results of palpate fleet over position, next to their standard errors.

    For example:

        palpate map results/ --by x,y --figure stiffness.svg
        palpate map results/ --by x,y --at 2mm --figure map.pdf --width 180mm

    Parameters
    ----------
    results
        Folder that ``palpate fleet`` wrote.
    by
        Two columns for the axes, such as x,y; or one, such as x or index.
    of
        Quantity to draw: modulus, for results with --tip their default; else, at the working depth
        of each contact, the stiffness (default), damping or force; or the exponent.
    at
        Common depth, such as 2mm, to compare places pressed to different depths (default: the
        working depth of each contact).
    """
    from palpate.fleet.files import read_results
    from palpate.fleet.maps import map_of

    drawing = replace(drawing, figure=drawing.figure or Path("map.svg"))
    drawing.check()
    depth = None if at is None else quantity("--at", at, "penetration")
    found = map_of(read_results(results), by.split(","), of=of, depth=depth)
    drawing.save("palpate.fleet.figures.draw_map", found)
    console = Terminal()
    for line in found.lines:
        say(console, line)
    say_path(console, f"figure: {drawing.figure}")
