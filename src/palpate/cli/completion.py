"""``palpate --install-completion``: commands, options and their values, completed by the shell."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from palpate.cli.printing import Terminal
from palpate.cli.session import Hints

OPTION = "--install-completion"


def install_completion(
    *,
    shell: Literal["bash", "zsh", "fish"] | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Complete commands, options and their values in the shell.

    For example:

        palpate --install-completion
        palpate --install-completion --shell zsh

    Parameters
    ----------
    shell
        Which shell; the one that runs this unless given.
    output
        File to write the completion to, and nothing else; unless given, where the shell looks for
        it, with a line in its startup file where it needs one.
    """
    from cyclopts.completion.detect import ShellDetectionError, detect_shell

    from palpate.cli.application import application
    from palpate.cli.layout import say, say_path
    from palpate.errors import InvalidParameterError
    from palpate.writing import write_text

    app = application(_hints())
    try:
        chosen = shell or detect_shell()
    except ShellDetectionError:
        raise InvalidParameterError(
            "which shell this is cannot be seen; say --shell bash, zsh or fish"
        ) from None
    console = Terminal()
    if output is not None:
        write_text(output, app.generate_completion(shell=chosen))
        say_path(console, f"completion: {output}")
    else:
        say_path(console, f"completion: {app.install_completion(shell=chosen)}")
        say(console, "begin a new shell to use it; after an upgrade of palpate, install it again")


def _hints() -> Hints:
    """Types of which the values are some of the words, as the registries list them.

    A script of completion is written once; help, which is asked for often, is spared what takes
    time to import.
    """
    hints: Hints = {}
    for command, parameter, values in _values():
        choice: Any = Literal[tuple(values)]
        hints.setdefault(command, {})[parameter] = choice | str
    several = hints["paper"]["only"]
    many = Parameter(consume_multiple=True, negative="")
    hints["paper"]["only"] = Annotated[tuple[several, ...], many]  # type: ignore[valid-type]
    return hints


def _values() -> Iterable[tuple[str, str, Iterable[str]]]:
    from palpate.estimators import ESTIMATORS
    from palpate.estimators.by_law import law_names
    from palpate.force_laws import FORCE_LAWS
    from palpate.lab import MATERIALS, TRAJECTORIES
    from palpate.paper import EXPERIMENTS

    for command in ("identify", "fleet", "diagnose", "live"):
        yield command, "law", law_names()
        yield command, "method", ESTIMATORS
    yield "live", "source", [f"lab:{name}" for name in MATERIALS]
    yield "lab", "material", (*MATERIALS, *FORCE_LAWS)
    yield "lab", "trajectory", TRAJECTORIES
    yield "paper", "only", EXPERIMENTS
