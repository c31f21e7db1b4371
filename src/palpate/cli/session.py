"""What every command takes beside its own options: ``--no-color`` and ``-v``."""

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from cyclopts import Parameter

from palpate.cli.groups import ANY
from palpate.cli.printing import colourless

_COLOURLESS = "--no-color"
#: What no file of options holds.
ANY_COMMANDS = ("--no-color", "--verbose", "-v")
_LOUD = {"--verbose": 1, "-v": 1, "-vv": 2}

#: Types of parameters, by command and name.
Hints: TypeAlias = dict[str, dict[str, Any]]


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Session:
    """How a command speaks, whichever it is; as help and completion show it."""

    no_color: Annotated[bool, Parameter(negative="", group=ANY)] = False
    "Print without colour, as NO_COLOR in the environment does."
    verbose: Annotated[bool, Parameter(name=["--verbose", "-v"], negative="", group=ANY)] = False
    "Say on standard error what is read, taken and done, with seconds; -vv says more."


def session_of(words: Sequence[str]) -> tuple[bool, int, list[str]]:
    """Part what every command takes from the rest, wherever before ``--`` it stands.

    Returns
    -------
    tuple
        Whether there is to be no colour, how much is to be said (0 to 2), and the other words.
    """
    end = list(words).index("--") if "--" in words else len(words)
    before, rest = words[:end], words[end:]
    loudness = sum(_LOUD.get(word, 0) for word in before)
    kept = [word for word in before if word != _COLOURLESS and word not in _LOUD]
    return _COLOURLESS in before, min(loudness, 2), [*kept, *rest]


@contextmanager
def speaking(plain: bool, loudness: int) -> Iterator[None]:
    """Let what happens inside be said and coloured so."""
    with colourless(plain), ExitStack() as stack:
        if loudness:
            from palpate.cli.logs import logged

            stack.enter_context(logged(loudness))
        yield


def in_a_session(command: Callable[..., Any], hints: Mapping[str, Any]) -> Callable[..., Any]:
    """Return the command with the session among its options, for help and completion.

    Its words are taken out before a command is looked for; so there is none to be handed on.

    Parameters
    ----------
    command : callable
        As its module has it.
    hints : mapping
        Types of some of its parameters, in place of those of its signature.
    """

    @functools.wraps(command)
    def wrapped(*args: Any, session: Session | None = None, **kwargs: Any) -> Any:
        return command(*args, **kwargs)

    session = inspect.Parameter(
        "session", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Session | None
    )
    own = inspect.signature(command)
    parameters = [
        each.replace(annotation=hints.get(name, each.annotation))
        for name, each in own.parameters.items()
    ]
    last = len(parameters) - (parameters[-1].kind is inspect.Parameter.VAR_KEYWORD)
    parameters.insert(last, session)
    wrapped.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {**command.__annotations__, **hints, "session": Session | None}
    return wrapped
