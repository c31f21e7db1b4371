"""The command line: a module per command, each of which parses, calls and prints.

Here is what surrounds every command: its streams, how it ends, and what it prints of an error. No
library is needed for that, and ``palpate --version`` imports none.
"""

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType, TracebackType


def _end_quietly(
    kind: type[BaseException], error: BaseException, trace: "TracebackType | None"
) -> None:
    if issubclass(kind, KeyboardInterrupt):
        os._exit(130)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _end_quietly  # before the imports: Ctrl-C may come at once

import codecs
import io
import re
import signal
from contextlib import suppress

from palpate.errors import PalpateError, printable

sys.excepthook = sys.__excepthook__  # from here on main() catches it

# A word of a person or a file that is no word is shown by its beginning and its end; a path of the
# usual length is shown whole.
_TOO_LONG = re.compile(r"(\S{60})\S{121,}(\S{20})")
_LONGEST_LINE = 2000

# What palpate prints beyond ASCII, for terminals that have no more than that.
_PLAIN = {
    "µ": "u", "°": " deg", "₁": "1", "₂": "2", "·": "*", "±": "+-", "Σ": "sum of",
    "–": "-", "−": "-", "×": "x", "√": "sqrt", "≥": ">=", "≤": "<=", "…": "...", "“": '"',
    "”": '"', "é": "e", "ó": "o", "σ": "sigma", "✓": "+", "✗": "-", "◐": "~",
    "≈": "~", "→": "->", "λ": "lambda", "₀": "0", "α": "alpha", "τ": "tau",
    "Δ": "delta ", "δ": "delta", "′": "'",
}  # fmt: skip
# Of several in a row only the first needs the sign that says what they are: 10⁻¹² is 10^-12.
_SUPERSCRIPTS = dict(zip("ⁿᵖ⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "np+-0123456789", strict=True))


def main() -> None:
    """Run the command line; an error is one line on standard error and exit status 2.

    Raises
    ------
    SystemExit
        What the command returns, if anything: 3 for a verdict that was to fail; 2 after an error;
        130 after an interrupt; 141 where the reader of the output is gone.
    """
    caught = _Interrupts()
    prepare_output()
    try:
        status = _run(sys.argv[1:])
        sys.stdout.flush()  # what cannot be written is known before the end
    except KeyboardInterrupt:
        status = 130
    except PalpateError as error:
        complain(str(error))
        status = 2
    except BrokenPipeError:
        _abandon_output()
        status = 141  # as of a program that SIGPIPE ended
    except OSError as error:
        _abandon_output()
        complain(f"{error.filename or 'standard output'}: {error.strerror or error}")
        status = 2
    caught.ended = True
    if caught.waiting:  # Python lets go of the handler at its exit, and the alarm would kill
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        status = 130
    if status:
        sys.exit(status)


class _Interrupts:
    """Handles Ctrl-C: a KeyboardInterrupt, after an import, and an exit once the command has ended.

    An import that is interrupted may print a traceback, hide the interrupt or leave half a module;
    so an interrupt waits for its end. When the command has ended, nothing is left that catches it.
    """

    interval, longest = 0.05, 5.0  # s; an import may be one of a user's module that never ends

    def __init__(self) -> None:
        self.ended, self.waiting, self._left = False, False, round(self.longest / self.interval)
        self._imports = vars(sys.modules["_frozen_importlib"])
        with suppress(ValueError):  # not in the main thread: the caller handles it
            if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
                signal.signal(signal.SIGINT, self._interrupt)

    def _interrupt(self, _: int, frame: "FrameType | None") -> None:
        if self.ended:
            os._exit(130)
        while frame is not None and frame.f_globals is not self._imports:
            frame = frame.f_back
        if frame is None or not self._left or sys.platform == "win32":
            raise KeyboardInterrupt
        self._left, self.waiting = self._left - 1, True
        signal.signal(signal.SIGALRM, self._interrupt)
        signal.setitimer(signal.ITIMER_REAL, self.interval)


def _abandon_output() -> None:
    from palpate.writing import abandon_output

    abandon_output()


def _run(words: list[str]) -> int:
    if "--version" in (words[: words.index("--")] if "--" in words else words):
        from palpate import __version__

        print(__version__)
        return 0
    # Here, so that an interrupt while importing ends as quietly as any other.
    from palpate.cli.application import run

    return run(words)


def prepare_output() -> None:
    """Let what the output's encoding lacks be printed in other signs, instead of failing.

    A stream that is closed leads nowhere: no file that is opened later takes its descriptor, into
    which libraries print.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(nowhere)
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", encoding="utf-8", errors="replace"))
    codecs.register_error("palpate.plain", _in_plain_signs)
    # In the C locale Python lets bytes of file names through, and other signs fail all the same.
    failing = ("strict", "surrogateescape")
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="palpate.plain")


def complain(words: str) -> None:
    """Print one line on standard error, whatever the words are made of."""
    line = _TOO_LONG.sub(r"\1…\2", printable(" ".join(words.split())))
    with suppress(OSError):  # there is nobody left to tell
        print(f"palpate: {line[:_LONGEST_LINE]}", file=sys.stderr)


def _in_plain_signs(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    signs = error.object[error.start : error.end]
    plain, raised = "", False
    for sign in signs:
        if sign in _SUPERSCRIPTS:
            plain += _SUPERSCRIPTS[sign] if raised else f"^{_SUPERSCRIPTS[sign]}"
        elif sign in _PLAIN:
            plain += _PLAIN[sign]
        else:
            return codecs.backslashreplace_errors(error)
        raised = sign in _SUPERSCRIPTS
    return plain, error.end
