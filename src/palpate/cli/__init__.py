"""The command line: one module per command, which parses, calls and prints.

This module contains the parts common to all commands: streams, exit status and error messages. They
need no library, and ``palpate --version`` imports none.
"""

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType, TracebackType


def _end_quietly(
    kind: type[BaseException],
    error: BaseException,
    trace: "TracebackType | None",
) -> None:
    if issubclass(kind, KeyboardInterrupt):
        os._exit(130)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _end_quietly  # before the imports, so that they cannot miss Ctrl-C

import codecs
import io
import re
import signal
import warnings
from contextlib import suppress

from palpate.errors import PalpateError, printable
from palpate.spelling import options_in_advice

sys.excepthook = sys.__excepthook__  # from here on main() catches it

# A very long word from the user or a file is shortened to its beginning and its end; a path of the
# usual length is shown completely.
_TOO_LONG = re.compile(r"(\S{60})\S{121,}(\S{20})")
_LONGEST_LINE = 2000

# ASCII replacements of the characters that palpate prints, for terminals limited to ASCII.
_PLAIN = {
    "µ": "u", "°": " deg", "₁": "1", "₂": "2", "·": "*", "±": "+-", "Σ": "sum of",
    "–": "-", "−": "-", "×": "x", "√": "sqrt", "≥": ">=", "≤": "<=", "…": "...", "“": '"',
    "”": '"', "é": "e", "ó": "o", "σ": "sigma", "✓": "+", "✗": "-", "◐": "~",
    "≈": "~", "→": "->", "λ": "lambda", "₀": "0", "α": "alpha", "τ": "tau",
    "Δ": "delta ", "δ": "delta", "′": "'",
}  # fmt: skip
# In a row of superscripts only the first gets a ^: 10⁻¹² becomes 10^-12.
_SUPERSCRIPTS = dict(zip("ⁿᵖ⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "np+-0123456789", strict=True))


@options_in_advice()
def main() -> None:
    """Run the command line; an error is one line on standard error and exit status 2.

    Raises
    ------
    SystemExit
        If the status is not 0: the status of the command, such as 3 for a verdict that counts as a
        failure; 2 after an error; 130 after an interrupt; 141 if the reader of the output is gone.
    """
    caught = _Interrupts()
    prepare_output()
    # numpy and others warn of damaged numbers; whoever asks for warnings gets them all the same.
    warnings.simplefilter("ignore", append=True)
    try:
        status = _run(sys.argv[1:])
        sys.stdout.flush()  # so that a write error is known before the end
    except KeyboardInterrupt:
        status = 130
    except PalpateError as error:
        complain(str(error))
        status = 2
    except BrokenPipeError:
        _abandon_output()
        status = 141  # as for a program that SIGPIPE ended
    except OSError as error:
        _abandon_output()
        complain(f"{error.filename or 'standard output'}: {error.strerror or error}")
        status = 2
    caught.ended = True
    if caught.waiting:  # Python drops the handler at its exit; the alarm would then kill it
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        status = 130
    if status:
        sys.exit(status)


class _Interrupts:
    """Handles Ctrl-C: a KeyboardInterrupt, after an import, and an exit once the command has ended.

    An import that is interrupted may print a traceback, hide the interrupt or leave half a module.
    So an interrupt waits for the end of the import. When the command has ended, no code is left to
    catch a KeyboardInterrupt.
    """

    interval = 0.05
    longest = 5.0  # s; the import of a user's module may never end

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
        self._left = self._left - 1
        self.waiting = True
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
    # Imported here, so that an interrupt during the import ends as quietly as any other.
    from palpate.cli.application import run

    return run(words)


def prepare_output() -> None:
    """Replace characters that the output's encoding lacks, instead of failing.

    Redirect closed streams to the null device, so that no file that is opened later gets their
    descriptors, to which libraries print.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(nowhere)
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", encoding="utf-8", errors="replace"))
    codecs.register_error("palpate.plain", _replace_with_plain_signs)
    # In the C locale Python passes the bytes of file names, but fails on other characters.
    failing = ("strict", "surrogateescape")
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in failing:
        sys.stdout.reconfigure(errors="palpate.plain")


def complain(words: str) -> None:
    """Print any text as one line on standard error."""
    line = _TOO_LONG.sub(r"\1…\2", printable(" ".join(words.split())))
    with suppress(OSError):  # there is nobody left to tell
        print(f"palpate: {line[:_LONGEST_LINE]}", file=sys.stderr)


def _replace_with_plain_signs(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    signs = error.object[error.start : error.end]
    plain = ""
    raised = False
    for sign in signs:
        if sign in _SUPERSCRIPTS:
            plain += _SUPERSCRIPTS[sign] if raised else f"^{_SUPERSCRIPTS[sign]}"
        elif sign in _PLAIN:
            plain += _PLAIN[sign]
        else:
            return codecs.backslashreplace_errors(error)
        raised = sign in _SUPERSCRIPTS
    return plain, error.end
