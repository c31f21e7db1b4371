"""Options from a TOML file."""

import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from palpate.errors import InvalidParameterError, RecordingError

READ, WRITTEN = "--config", "--save-config"


def expanded(arguments: Sequence[str], known: Iterable[str]) -> list[str]:
    """Return the arguments of a command, with the options of its ``--config`` file among them.

    What stands on the command line has the last word over the file.

    Parameters
    ----------
    arguments : sequence of str
        As given.
    known : iterable of str
        Every option that the command has, such as ``--force``.

    Raises
    ------
    RecordingError
        The file cannot be read, or is no TOML.
    InvalidParameterError
        A key of it is none of the options, or its value is none of an option.
    """
    given, path = _without_config(list(arguments))
    if path is None:
        return given
    there = {argument.partition("=")[0] for argument in given if argument.startswith("--")}
    options = set(known) - {READ, WRITTEN}
    added: list[str] = []
    for key, value in _table(Path(path)).items():
        option = f"--{key.replace('_', '-')}"
        if option not in options:
            raise InvalidParameterError(
                f"{path}: {key!r} is no option; there are {', '.join(sorted(_keys(options)))}"
            )
        if not {option, f"--no-{option[2:]}"} & there:
            off = f"--no-{option[2:]}" if f"--no-{option[2:]}" in options else None
            added += _as_arguments(f"{path}: {key!r}", option, off, value)
    return [*given, *added]


def _keys(options: Iterable[str]) -> list[str]:
    """The options' names without dashes; ``--no-dark`` is ``dark = false``."""
    return [name[2:] for name in options if name.startswith("--") and name[2:5] != "no-"]


def _without_config(arguments: list[str]) -> tuple[list[str], str | None]:
    path = None
    kept = []
    waiting = iter(arguments)
    for argument in waiting:
        name, equals, value = argument.partition("=")
        if name != READ:
            kept.append(argument)
            continue
        path = value if equals else next(waiting, None)
        if not path:
            raise InvalidParameterError(f"{READ} must be followed by a file, such as run.toml")
    return kept, path


def _table(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_bytes().decode())
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or 'cannot be read'}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, ValueError) as error:
        raise RecordingError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise RecordingError(f"{path}: not TOML of options: it nests too deeply") from None


def _as_arguments(where: str, option: str, off: str | None, value: Any) -> list[str]:
    if isinstance(value, bool):
        return [option] if value else [off] if off else []
    if isinstance(value, list):
        return [part for each in value for part in _as_arguments(where, option, off, each)]
    if isinstance(value, str | int | float):
        return [f"{option}={value}"]
    raise InvalidParameterError(f"{where} must be text, a number, true, false or a list of these")
