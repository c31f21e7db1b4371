"""All commands, and their common options: file of options, colour and logs."""

import logging
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from cyclopts import App, ArgumentCollection, CycloptsError, Group, Parameter
from cyclopts.config import Toml

from palpate._plugins import SWITCH
from palpate.cli.options import KEPT, WHAT, OutputFile
from palpate.cli.printing import Terminal, say, say_path
from palpate.errors import InvalidParameterError, printable
from palpate.writing import protect, write_text

#: Command to module. The function of this name in the module imports slow libraries itself.
COMMANDS = {
    "identify": "identify", "diagnose": "identify", "compare": "identify", "info": "info",
    "fleet": "fleet", "map": "fleet", "design": "design", "lab": "lab", "export": "export",
    "gains": "gains", "live": "live", "payload": "payload", "skew": "skew", "explain": "explain",
}  # fmt: skip
#: Arguments that name what a command writes. Any other path is one that it reads.
OUTPUTS = {"output", "figure", "picture", "record", "ros_parameters", "save_config"}
_NAMES_OF_FILES = ("source", "material", "trajectory")  # or of something in palpate
_RESULTS = ("result", "results")
_NOT_IN_A_FILE = ("config", "save-config", "no-color", "no-plugins", "verbose")
_Shell: TypeAlias = Literal["bash", "zsh", "fish", "powershell"]
_NARROWEST_HELP = 20  # rich folds frames forever if they have no room for a word
_ANY = Group("Any command", sort_key=10)
_VERBOSE = Parameter(name=["--verbose", "-v"], count=True, show_default=False, group=_ANY)


class _Application(App):
    """Keeps the options that it has assembled until they are bound.

    Cyclopts assembles those of a command and those of any command anew in each of its steps, six
    times in all, which is a tenth of the CPU of a short command.
    """

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self._assembled = dict[Any, ArgumentCollection]()

    def assemble_argument_collection(self, **settings: Any) -> ArgumentCollection:
        key = (self.app_stack.default_parameter, *settings.items())
        kept = self._assembled.get(key)
        if kept is None or any(argument.has_tokens for argument in kept):
            kept = self._assembled[key] = super().assemble_argument_collection(**settings)
        return kept


def application(words: Sequence[str] = ()) -> App:
    """Return the command line; if words name a command, no other command's module is imported."""
    app = _Application(
        name="palpate",
        help_format="markdown",
        console=Terminal(least=_NARROWEST_HELP),
        group_parameters=WHAT,
        group_commands=Group("Commands", sort_key=0),
        default_parameter=Parameter(negative_iterable=(), show_default=_default),
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
    )
    every = not set(COMMANDS) & set(words)
    for name, module in COMMANDS.items():
        place = f"palpate.cli.{module}"
        needed = every or name in words
        app.command(getattr(import_module(place), name) if needed else f"{place}:{name}", name=name)

    @app.command(name="--install-completion")
    def install_completion(
        *,
        shell: _Shell | None = None,
        output: OutputFile | None = None,
    ) -> None:
        """Complete commands, options and their values in the shell.

        For example:

            palpate --install-completion
            palpate --install-completion --shell zsh

        Parameters
        ----------
        shell
            Which shell (default: the one that runs this).
        output
            Write the completion to this file and nothing else (default: where the shell looks for
            it, with a line in its startup file if needed).
        """
        from cyclopts.completion.detect import ShellDetectionError, detect_shell

        try:
            shell = shell or detect_shell()
        except ShellDetectionError:
            raise InvalidParameterError("cannot detect the shell; name it with --shell") from None
        if output is not None:
            write_text(output, app.generate_completion(shell=shell))
        console = Terminal()
        say_path(console, f"completion: {output or app.install_completion(shell=shell)}")
        if output is None:
            say(console, "start a new shell to use it; after upgrading palpate, install it again")

    @app.meta.default
    def any_command(
        *rest: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
        config: Annotated[Path | None, Parameter(group=KEPT)] = None,
        no_color: Annotated[bool, Parameter(negative="", group=_ANY)] = False,
        no_plugins: Annotated[bool, Parameter(negative="", group=_ANY)] = False,
        verbose: Annotated[int, _VERBOSE] = 0,
    ) -> Any:
        """Identify what a probe touches: contact models from penetration, velocity and force.

        Parameters
        ----------
        config
            Take options from this TOML file; the command line overrides them.
        no_color
            Print without colour, like the environment variable NO_COLOR.
        no_plugins
            Load no laws and formats of other packages, like the variable PALPATE_NO_PLUGINS.
        verbose
            Print everything, and log each step with its time to standard error; -vv logs more.
        """
        if no_plugins:
            os.environ[SWITCH] = "1"
        if config is not None:
            app.config = OptionsFile(config, source=str(config), must_exist=True)
        command, bound, _ = app.parse_args(rest)
        inputs = inputs_of({"config": config, **bound.arguments})
        with _print_log(min(verbose, 2)), protect(inputs):
            return command(*bound.args, **bound.kwargs)

    return app


def inputs_of(command: Mapping[str, Any]) -> Iterator[Path]:
    """Return what a command reads: each path in its arguments that is not an output.

    A folder counts with all that lies in it, except a folder of palpate's results, to which figures
    and exports are added. The command ``fleet`` protects what it finds behind its ``sources``.
    """
    for name, value in command.items():
        if is_dataclass(value):
            yield from inputs_of(vars(value))
            continue
        for each in value if isinstance(value, tuple) else (value,):
            if name in OUTPUTS or not (isinstance(each, Path) or name in _NAMES_OF_FILES):
                continue
            from palpate.input.recordings.opening import whole_recording

            path = Path(each)
            if not (name in _RESULTS and path.is_dir()):
                yield whole_recording(path)


def run(arguments: Sequence[str]) -> int:
    """Run a command and return its exit status.

    Raises
    ------
    InvalidParameterError
        The arguments do not fit the command, or the file of ``--config`` contains no options.
    """
    # Standard input: cyclopts treats a lone hyphen as an option, and Path converts ./- to - again.
    typed = ["./-" if word == "-" else word for word in arguments]
    if typed and typed[0] not in COMMANDS and Path(typed[0]).is_file():
        raise InvalidParameterError(
            f"{typed[0]} is a file, not a command: run palpate identify {' '.join(typed)}"
        )
    # --help after a misspelt command would print the help of palpate; the shell calls __complete.
    if typed and typed[0] not in COMMANDS and not typed[0].startswith(("-", "__")):
        typed = typed[:1]
    if "--no-color" in typed:  # before help is printed
        os.environ["NO_COLOR"] = "1"
    try:
        status = application(typed).meta(move_common_options_first(typed))
    except CycloptsError as error:
        raise InvalidParameterError(str(error)) from None
    return status if isinstance(status, int) else 0


def move_common_options_first(words: Sequence[str]) -> list[str]:
    """Return the words with the options of any command before the command.

    A command that takes any keyword, such as ``lab`` with the parameters of a law, would claim
    those that stand behind it.
    """
    end = words.index("--") if "--" in words else len(words)
    common = list[str]()
    rest = list[str]()
    k = 0
    while k < end:
        takes_next = words[k] == "--config" and k + 1 < end
        one_word = words[k] in ("--no-color", "--no-plugins", "--verbose") or words[k].startswith(
            "--config="
        )
        size = 2 if takes_next else 1
        (common if takes_next or one_word else rest).extend(words[k : k + size])
        k += size
    return [*common, *rest, *words[end:]]


class OptionsFile(Toml):
    """The file of ``--config``; errors name the file and the invalid option."""

    def _load_config(self, path: Path) -> dict[str, Any]:
        try:
            options = super()._load_config(path)
        except (OSError, ValueError, RecursionError) as error:
            why = "it nests too deeply" if isinstance(error, RecursionError) else error
            raise CycloptsError(msg=f"{self.path}: not TOML of options: {why}") from None
        for key in options:  # cyclopts ignores keys that may be for another command
            # palpate payload is a command, and --payload an option of others.
            if key in {*COMMANDS, *_NOT_IN_A_FILE} - {"payload"}:
                raise CycloptsError(msg=f"{self.path}: {key!r} is no option of a file")
        # The same for each command: cyclopts skips a key of the root that names a command, payload.
        return dict.fromkeys(COMMANDS, options)


def _default(value: Any) -> str | None:
    """A default as help shows it; None for an option that is off."""
    if value is None or value is False or value == ():
        return None
    return "on" if value is True else f"{value:g}" if isinstance(value, float) else str(value)


class _Lines(logging.Handler):
    """Prints a line for each record: seconds, module and message."""

    begun = time.perf_counter()

    def emit(self, record: logging.LogRecord) -> None:
        text = " ".join(record.getMessage().split())
        where = record.name.removeprefix("palpate.")
        line = printable(f"{time.perf_counter() - self.begun:7.3f} s  {where}: {text}")
        with suppress(OSError):  # there is nobody left to tell
            print(line, file=sys.stderr)


@contextmanager
def _print_log(loudness: int) -> Iterator[None]:
    """Print palpate's log: level INFO at loudness 1, level DEBUG at 2."""
    logger = logging.getLogger("palpate")
    handler = _Lines()
    level = logger.level
    if loudness:
        logger.addHandler(handler)
        logger.setLevel((logging.INFO, logging.DEBUG)[loudness - 1])
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
