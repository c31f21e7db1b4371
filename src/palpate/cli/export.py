"""The command ``palpate export``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from palpate.cli import complain
from palpate.cli.options import UNTRUSTED, Depth, Duration, ResultFolder, quantities
from palpate.cli.printing import AsJson, Terminal, print_json, say, say_path
from palpate.errors import ExportRefusedError

if TYPE_CHECKING:
    from palpate.exports import Statement


@Parameter(name="*", group=Group("The engine", sort_key=1.4))
@dataclass(frozen=True)
class ExportOptions:
    """What presses, and how the engine simulates it."""

    mass: float | None = None
    "Of the body that presses, as the contact feels it, kg; MuJoCo needs it, or --model."
    model: Path | None = None
    "A model of your own (MuJoCo's XML), from which is taken what the contact feels; with --geom."
    geom: str | None = None
    "The geom of --model that touches."
    form: str = "auto"
    "Which of the engine's ways; the best for the law unless given."
    tip_radius: Depth | None = None
    "Of a round tip, such as 5mm, where the engine's law has it."
    time_step: Duration | None = None
    "Of the simulation; 1ms unless given, or that of --model."

    def options(self) -> dict[str, Any]:
        """What is asked for, SI."""
        return vars(self) | quantities(self, tip_radius="penetration", time_step="time")


def export(
    result: Path,
    /,
    *,
    to: str,
    output: ResultFolder | None = None,
    allow: Annotated[bool, Parameter(negative="")] = False,
    replay: bool = True,
    as_json: AsJson = False,
    into: ExportOptions = ExportOptions(),
) -> int:
    """Write an identified law in the numbers of a simulation engine, with its error.

    The recorded motion is replayed in the engine, where it is installed. What should not be used is
    refused, with exit status 3: a result not to be trusted, or an engine that is off by more
    than 5 % of force.

    For example:

        palpate identify ball.csv -o ball
        palpate export ball --to mujoco --mass 1.0 -o ball-in-mujoco
        palpate export ball --to mujoco --model robot.xml --geom tip -o ball-in-mujoco
        palpate export ball --to drake --json

    Parameters
    ----------
    result
        What palpate identify FILE -o FOLDER wrote: the folder, or its result.json.
    to
        mujoco, drake, opensim or usd.
    output
        Write fragment, smallest scene and statement to this folder.
    allow
        Export what would be refused; the fragment says so.
    replay
        Ask the real engine where it is installed; else its error is predicted.
    as_json
        Print the statement as one JSON object.
    """
    from palpate.exports.exporting import export as run
    from palpate.exports.exporting import save_statement
    from palpate.results.saved import RESULT, TRACES, load_result

    saved = load_result(result)
    inputs = [*(saved.folder / name for name in (RESULT, *TRACES)), *filter(None, [into.model])]
    try:
        made = run(saved, to, allow=allow, replay=replay, **into.options())
    except ExportRefusedError as refused:
        if refused.statement is None:  # nothing was made that a statement could be about
            complain(str(refused))
            return UNTRUSTED
        paths = [] if output is None else save_statement(refused.statement, output, inputs, {})
        _print(refused.statement, paths, as_json=as_json)
        return UNTRUSTED
    paths = [] if output is None else made.save(output, inputs=inputs)
    _print(made.statement, paths, as_json=as_json)
    return 0


def _print(statement: "Statement", paths: list[Path], *, as_json: bool) -> None:
    if as_json:
        print_json({**statement.as_dict(), "files": [str(path) for path in paths]})
        return
    console = Terminal()
    first, *others = statement.describe()
    say(console, first, "bold")
    for line in others:
        say(console, line, "yellow" if line.startswith("Warning") else "")
    if statement.refused:
        say(console, "Nothing was exported; --allow exports it all the same, and says so in it.")
    for path in paths:
        say_path(console, f"wrote {path}", "dim")
