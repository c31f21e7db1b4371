"""What a browser may ask for: messages of a fixed form, and everything else is refused."""

import json
import time
from collections.abc import Mapping
from typing import Any

from palpate.errors import InvalidParameterError
from palpate.estimators import estimator_named
from palpate.live.choices import CHOICES, NUMBERS, SWITCHES, chosen
from palpate.live.commands import Command
from palpate.validation import number_in, shown

MOST_BYTES = 4096  # of a message
THINNINGS = (1, 2, 4, 8)
MOST_COMMANDS = 20  # in a burst; then one in each COMMAND_TIME
COMMAND_TIME = 0.1  # s

#: Of the page itself rather than of the loop.
VIEWS = ("depth", "every")
_SIMPLE = ("hold", "resume", "reset")
_SETTINGS = frozenset({*SWITCHES, *NUMBERS, *CHOICES, "forgetting_factor"})


def request_of(text: str | bytes) -> tuple[str, dict[str, Any]]:
    """Return what a message asks for, and with which options.

    Raises
    ------
    InvalidParameterError
        It is no message of the page's.
    """
    if not isinstance(text, str):
        raise InvalidParameterError("a request must be text")
    try:
        given = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise InvalidParameterError("a request must be JSON") from None
    if not isinstance(given, dict) or not isinstance(given.get("ask"), str):
        raise InvalidParameterError('a request must have an "ask"')
    name = given.pop("ask")
    return name, given


def _refuse(name: str) -> None:
    raise ValueError(name)


def command_of(name: str, options: dict[str, Any], loop: Mapping[str, Any]) -> Command:
    """Return the loop's command.

    Parameters
    ----------
    name, options : str, dict
        Of :func:`request_of`.
    loop : mapping
        What its board says: which method runs, and what the source offers.

    Raises
    ------
    InvalidParameterError
        There is no such command, or its options are out of range.
    """
    if name in _SIMPLE:
        _only(options)
        return Command(name)  # type: ignore[arg-type]  # one of them
    if name == "tare":
        _only(options, "seconds")
        return Command("tare", {"seconds": number_in("seconds", options["seconds"], 0.01, 60.0)})
    if name == "record":
        _only(options, "on")
        # Where a recording goes is said where it runs, never from a browser.
        return Command("record", {"on": bool(options["on"])})
    if name == "estimator":
        return _estimator(options)
    if name == "source":
        return _source(options, loop.get("offers") or {})
    raise InvalidParameterError(f"nothing is called {shown(name)}")


def _only(options: dict[str, Any], *names: str) -> None:
    if set(options) != set(names):
        raise InvalidParameterError(f"options must be {', '.join(names) or 'none'}")


def _estimator(options: dict[str, Any]) -> Command:
    unknown = set(options) - _SETTINGS - {"method"}
    if unknown or "method" not in options:
        raise InvalidParameterError("an estimator needs a method, and its main settings only")
    # Made here once, so that the loop is asked for nothing that cannot be made.
    method = options["method"]
    chosen(estimator_named(method)(), options)
    return Command("estimator", options)


def _source(options: dict[str, Any], offers: Mapping[str, Any]) -> Command:
    """One of what the source offers: ``{"material": …}``, ``{"motion": …}``, ``{"change": …}``."""
    if len(options) != 1:
        raise InvalidParameterError("a source is asked for one thing at a time")
    ((name, value),) = options.items()
    listed = offers.get(name) or ()
    if not isinstance(value, str) or value not in listed:
        raise InvalidParameterError(f"the source offers no such {shown(name)}")
    return Command("source", options)


def depth_of(options: dict[str, Any]) -> float:
    """Return the depth that a person chose, m; NaN for the median."""
    _only(options, "value")
    if options["value"] is None:
        return float("nan")
    return number_in("value", options["value"], 0.0, 10.0, open_low=True)


def thinning_of(options: dict[str, Any]) -> int:
    """Return how many-th row a client wants."""
    _only(options, "value")
    if options["value"] not in THINNINGS or isinstance(options["value"], bool):
        raise InvalidParameterError(f"value must be one of {THINNINGS}")
    return int(options["value"])


class Allowance:
    """Commands are a person's: some at once, then ten a second."""

    def __init__(self) -> None:
        self._left, self._filled = float(MOST_COMMANDS), time.monotonic()

    def spend(self) -> None:
        """Take one.

        Raises
        ------
        InvalidParameterError
            None is left.
        """
        now = time.monotonic()
        self._left = min(self._left + (now - self._filled) / COMMAND_TIME, MOST_COMMANDS)
        self._filled = now
        if self._left < 1.0:
            raise InvalidParameterError("too many requests: wait a moment")
        self._left -= 1.0
