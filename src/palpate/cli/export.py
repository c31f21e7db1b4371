"""The command ``palpate export``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Group, Parameter
from rich.text import Text

from palpate.cli import complain
from palpate.cli.options import UNTRUSTED, Depth, Duration, Flag, ResultFolder, quantities
from palpate.cli.printing import AsJson, Terminal, as_text, is_verbose, print_json, say, say_path
from palpate.errors import ExportRefusedError, InvalidParameterError

if TYPE_CHECKING:
    from palpate.exports import Statement

# Columns before the text of a line: the label and its spaces.
_INDENT = 11


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
    name: str = ""
    "Part of the names in the fragment, so that one model can have several exports."

    def options(self) -> dict[str, Any]:
        """Return the options as arguments of :func:`palpate.exports.export`, SI."""
        return vars(self) | quantities(self, tip_radius="penetration", time_step="time")


def export(
    result: Path | None = None,
    /,
    *,
    to: str | None = None,
    check: Path | None = None,
    output: ResultFolder | None = None,
    allow: Flag = False,
    replay: bool = True,
    as_json: AsJson = False,
    into: ExportOptions = ExportOptions(),
) -> int:
    """Export an identified law to a simulation engine, and state the engine's error.

    palpate replays the recorded motion in the engine if it is installed. It refuses, with exit
    status 3, to export a result with the verdict do-not-trust or with a force error above 5 %.
    With --check it replays the exported contacts of your finished MuJoCo model instead.

    For example:

        palpate identify ball.csv -o ball
        palpate export ball --to mujoco --mass 1.0 -o ball-in-mujoco
        palpate export ball --to mujoco --model robot.xml --geom tip -o ball-in-mujoco
        palpate export ball --to drake --json
        palpate export --check robot.xml

    Parameters
    ----------
    result
        Folder written by palpate identify FILE -o FOLDER, or its result.json.
    to
        Engine: mujoco, mjx, mujoco-warp, drake, opensim, newton, isaaclab or physx.
    check
        Your MuJoCo model with contacts of palpate export: compare their force with the law, with
        the masses, armatures and options that the model has now. Exit status 3 beyond 5 %.
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

    if check is not None:
        if not (result is None and to is None and output is None and into == ExportOptions()):
            raise InvalidParameterError("--check takes a model and --json only: omit the rest")
        return _check(check, as_json=as_json)
    if result is None or to is None:
        missing = "RESULT" if result is None else "--to ENGINE"
        raise InvalidParameterError(
            f"palpate export needs {missing}, such as palpate export ball --to mujoco --mass 1.0; "
            "or --check MODEL.xml"
        )
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
    (title, _), *lines = statement.short_answer()
    say(console, title, "bold")
    for label, text in lines:
        _say_line(console, label, text, "yellow" if label == "warning" else "")
    if paths:
        names = ", ".join(path.name for path in paths)
        say_path(console, f"  {'wrote':<8} {paths[0].parent}: {names}", "dim")
    if not statement.refused:
        _say_line(
            console, "next", statement.fragment.paste if paths else "add -o FOLDER to write it"
        )
    if is_verbose():
        for line in statement.describe():
            say(console, line)


def _say_line(console: Terminal, label: str, text: str, style: str = "") -> None:
    """Print text behind its label, wrapped beside it."""
    for part in as_text(text).wrap(console, max(console.width - _INDENT, 1)):
        part.rstrip()
        line = Text(f"  {label}".ljust(_INDENT), style).append_text(part)
        console.print(line, soft_wrap=True)
        label = ""


def _check(model: Path, *, as_json: bool) -> int:
    """Print the check of a finished model; return the exit status."""
    from palpate.exports import check_model

    contacts = check_model(model)
    passes = all(contact.passes for contact in contacts)
    if as_json:
        print_json({"passes": passes, "contacts": [each.as_dict() for each in contacts]})
        return 0 if passes else UNTRUSTED
    console = Terminal()
    for contact in contacts:
        (title, _), *lines = contact.short_answer()
        say(console, title, "bold" if contact.passes else "bold yellow")
        for label, text in lines:
            _say_line(console, label, text)
    return 0 if passes else UNTRUSTED
