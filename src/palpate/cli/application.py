"""All commands together, and how each ends: its exit status, and what is said of an error."""

import sys
from collections.abc import Sequence
from importlib import import_module

from cyclopts import App, CycloptsError

from palpate.cli.completion import OPTION, install_completion
from palpate.cli.groups import COMMANDS as COMMANDS_SHOWN
from palpate.cli.groups import WHAT
from palpate.cli.help import Help
from palpate.cli.printing import (
    Terminal,
    abandon_output,
    complain,
    finish_output,
    prepare_output,
)
from palpate.cli.session import ANY_COMMANDS, Hints, in_a_session, session_of, speaking
from palpate.errors import PalpateError

#: Each is a function in a module of its name. Whatever takes time to import, it imports itself.
COMMANDS = (
    "identify", "diagnose", "compare", "info", "fleet", "map", "design", "lab", "export",
    "live", "paper",
)  # fmt: skip


def application(hints: Hints | None = None) -> App:
    """Return the command line with every command.

    Parameters
    ----------
    hints : mapping, optional
        Types of parameters by command, in place of those of its signature.
    """
    app = App(
        name="palpate",
        help="Identify what a probe touches: contact models from penetration, velocity and force.",
        help_format="plaintext",
        version=_version,
        version_flags=["--version"],
        console=Terminal(),
        help_formatter=Help(),
        group_parameters=WHAT,
        group_commands=COMMANDS_SHOWN,
    )
    for name in COMMANDS:
        command = getattr(import_module(f"palpate.cli.{name}"), name)
        app.command(in_a_session(command, (hints or {}).get(name, {})))
    app.command(install_completion, name=OPTION)
    return app


def run(arguments: Sequence[str]) -> None:
    """Run a command.

    Raises
    ------
    SystemExit
        What the command returns, if anything: 3 for a verdict that was to fail; 2 after an error,
        which is one line on standard error; 141 where the reader of the output is gone.
    """
    prepare_output()
    # Standard input: cyclopts takes a lone hyphen for an option, and Path makes it of this again.
    words = ["./-" if word == "-" else word for word in arguments]
    plain, loudness, words = session_of(words)
    try:
        with speaking(plain, loudness):
            app = application()
            status = app(
                _with_config(app, words),
                exit_on_error=False,
                print_error=False,
                result_action="return_value",
            )
        finish_output()
    except (PalpateError, CycloptsError) as error:
        complain(str(error))
        sys.exit(2)
    except BrokenPipeError:
        abandon_output()
        sys.exit(141)  # as of a program that SIGPIPE ended
    except OSError as error:
        abandon_output()
        complain(f"{error.filename or 'standard output'}: {error.strerror or error}")
        sys.exit(2)
    if isinstance(status, int) and status:
        sys.exit(status)


def _with_config(app: App, arguments: Sequence[str]) -> Sequence[str]:
    """The arguments, with the options of a file that they name."""
    from palpate.cli.config import READ, expanded

    if not any(argument.partition("=")[0] == READ for argument in arguments):
        return arguments
    name = arguments[0] if arguments else ""
    if name not in COMMANDS:
        return arguments
    known = [option for each in app[name].assemble_argument_collection() for option in each.names]
    own = [option for option in known if option not in ANY_COMMANDS]
    return [name, *expanded(arguments[1:], own)]


def _version() -> str:
    import palpate

    return palpate.__version__
