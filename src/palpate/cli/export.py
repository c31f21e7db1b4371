"""The command ``palpate export``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Group, Parameter

from palpate.cli import complain
from palpate.cli.options import UNTRUSTED, Depth, Duration, Flag, ResultFolder, quantities
from palpate.cli.printing import AsJson, Terminal, print_json, say, say_path
from palpate.errors import ExportRefusedError

if TYPE_CHECKING:
    from palpate.exports import Statement


@Parameter(name="*", group=Group("Engine", sort_key=1.4))
@dataclass(frozen=True)
class ExportOptions:
    """Options for the pressing body and its simulation."""

    mass: float | None = None
    "Effective mass of the pressing body at the contact, kg; MuJoCo needs it, or --model."
    model: Path | None = None
    "Your own MuJoCo model (XML), from which the effective mass is computed; needs --geom."
    geom: str | None = None
    "Name of the touching geom in --model."
    form: str = "auto"
    "Form of the contact in the engine (auto: the most accurate one for the law)."
    tip_radius: Depth | None = None
    "Radius of a spherical tip, such as 5mm, for engines whose law contains it."
    friction: float = 0.0
    "Coefficient of friction of the contact (default: 0, frictionless)."
    time_step: Duration | None = None
    "Time step of the simulation (default: that of --model, else 1ms)."

    def options(self) -> dict[str, Any]:
        """Return the options as arguments of :func:`palpate.exports.export`, SI."""
        return vars(self) | quantities(self, tip_radius="penetration", time_step="time")


def export(
    result: Path,
    /,
    *,
    to: str,
    output: ResultFolder | None = None,
    allow: Flag = False,
    replay: bool = True,
    as_json: AsJson = False,
    into: ExportOptions = ExportOptions(),
) -> int:
    """Export an identified law to a simulation engine, and state the engine's error.

    palpate replays the recorded motion in the engine if it is installed. It refuses, with exit
    status 3, to export a result with the verdict do-not-trust or with a force error above 5 %.

    For example:

        palpate identify ball.csv -o ball
        palpate export ball --to mujoco --mass 1.0 -o ball-in-mujoco
        palpate export ball --to mujoco --model robot.xml --geom tip -o ball-in-mujoco
        palpate export ball --to drake --json

    Parameters
    ----------
    result
        Folder written by palpate identify FILE -o FOLDER, or its result.json.
    to
        Engine: mujoco, mjx, mujoco-warp, drake, opensim, newton, isaaclab or physx.
    output
        Write fragment, minimal scene and statement to this folder.
    allow
        Export even if refused; the fragment then names the refusals.
    replay
        Replay the motion in the engine if it is installed; else predict its error.
    as_json
        Print the statement as one JSON object.
    """
    from palpate.exports.exporting import export as run
    from palpate.exports.exporting import save_statement
    from palpate.output.results.saved import RESULT, TRACES, load_result

    saved = load_result(result)
    inputs = [saved.folder / name for name in (RESULT, *TRACES)]
    try:
        made = run(saved, to, allow=allow, replay=replay, **into.options())
    except ExportRefusedError as refused:
        if refused.statement is None:  # refused before the law was fitted
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
    claim, *lines = statement.describe()
    say(console, claim, "bold")
    warned = len(lines) - len(statement.warnings)
    for k, line in enumerate(lines):
        say(console, line, "yellow" if k >= warned else "")
    if statement.refused:
        say(console, "palpate exported nothing; add --allow to export despite the refusals.")
    for path in paths:
        say_path(console, f"wrote {path}", "dim")
