"""palpate's exceptions. Every message names the fault, its place and the next step."""

from importlib import import_module

from palpate.spelling import spell_advice

TYPE_CHECKING = False  # as in palpate/__init__.py
if TYPE_CHECKING:
    from typing import Any


def printable(text: str) -> str:
    """``text`` with control characters escaped, because a terminal would obey them."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)


class PalpateError(Exception):
    """Base class of palpate's errors.

    Examples
    --------
    >>> import palpate
    >>> try:
    ...     palpate.identify("examples/recordings/ball.csv", method="kalman")
    ... except palpate.PalpateError as error:
    ...     print(type(error).__name__)
    InvalidParameterError
    """

    def __str__(self) -> str:
        return spell_advice(super().__str__())


class InvalidParameterError(PalpateError, ValueError):
    """An argument is outside its range: the message names it, its value and the range.

    Examples
    --------
    >>> import palpate
    >>> try:
    ...     palpate.Sphere(radius=-1.0)
    ... except palpate.InvalidParameterError as error:
    ...     print(error)
    radius must be in (0, 1], not -1.0
    """


class RecordingError(PalpateError, ValueError):
    """A recording cannot be used: the message names the file, the channel and the row.

    Examples
    --------
    >>> import palpate
    >>> try:
    ...     palpate.open_recording("no_such.csv")
    ... except palpate.RecordingError as error:
    ...     print(error)
    no_such.csv: No such file or directory; check the path
    """

    _reason = ""

    @classmethod
    def of(cls, source: str, reason: str) -> "RecordingError":
        """Return the error, with the name of the file if that is known."""
        error = cls(f"{source}: {reason}" if source else reason)
        error._reason = reason
        return error

    @property
    def reason(self) -> str:
        """The message without the name of the file."""
        return spell_advice(self._reason) or str(self)


class NoContactError(RecordingError):
    """The probe touches nothing: no force exceeds the noise, or no sample is in contact."""


class ExportRefusedError(PalpateError, ValueError):
    """palpate refuses to export a law: the message says why, and what would allow it.

    Attributes
    ----------
    statement : Statement
        The statement on which the refusal rests.
    """

    def __init__(self, text: str, statement: "Any" = None) -> None:
        super().__init__(text)
        self.statement = statement


class FleetError(PalpateError, RuntimeError):
    """A fleet cannot run, because of its scheduler, its workers or its results folder.

    Examples
    --------
    >>> import palpate
    >>> from pathlib import Path
    >>> from palpate.fleet.files import read_results
    >>> try:
    ...     read_results(Path("."))
    ... except palpate.FleetError as error:
    ...     print(error)
    .: holds no results of palpate fleet; pass the folder of its option -o
    """


class MissingChannelError(RecordingError):
    """A recording has no channel of the requested name, or none that could have a role.

    Parameters
    ----------
    channel : str
        The requested name, or the role: ``"position"`` or ``"force"``.
    available : list of str
        The channels of the recording.
    source : str
        The name of the file.
    missing : str
        Recorded and missing quantities, as text, if no channel could have the role.

    Examples
    --------
    >>> import palpate
    >>> try:
    ...     palpate.prepare("examples/recordings/ball.csv", columns=palpate.Columns(force="Fz"))
    ... except palpate.MissingChannelError as error:
    ...     print(error.channel, error.available)
    Fz ['time_s', 'penetration_m', 'force_N']
    """

    def __init__(
        self, channel: str, available: list[str], source: str = "", missing: str = ""
    ) -> None:
        super().__init__(channel, available, source, missing)
        self.channel = channel
        self.available = available
        self.source = source
        self.missing = missing

    def __str__(self) -> str:
        return f"{self.source}: {self.reason}" if self.source else self.reason

    @property
    def reason(self) -> str:
        """The message without the name of the file."""
        missing = self.missing or f"no column {self.channel!r}"
        return f"{spell_advice(missing)}; available: {list_names(self.available)}"


def list_names(names: list[str]) -> str:
    """Up to 20 names, each cut after 80 characters."""
    shown = [name[:80] if name.isprintable() else repr(name[:80]) for name in names[:20]]
    more = [f"{len(names) - 20} more"] if len(names) > 20 else []
    return ", ".join(shown + more) or "none"


class MissingExtraError(PalpateError, ImportError):
    """An optional package is not installed: the message names the extra that installs it.

    Examples
    --------
    >>> import palpate
    >>> error = palpate.MissingExtraError.named("a figure", "matplotlib", "figures")
    >>> print(error)
    a figure needs matplotlib: pip install '.[figures]' in a checkout of palpate
    >>> isinstance(error, ImportError)
    True
    """

    @staticmethod
    def remedy(extra: str) -> str:
        """Return how to install an extra: palpate is in no registry."""
        return f"pip install '.[{extra}]' in a checkout of palpate"

    @classmethod
    def named(cls, what: str, package: str, extra: str) -> "MissingExtraError":
        """Return the error for a package that ``what`` needs and that an extra installs."""
        return cls(f"{what} needs {package}: {cls.remedy(extra)}")

    @classmethod
    def of(cls, error: ImportError, what: str, extra: str) -> "MissingExtraError":
        """Return the error for a failed import of a package that ``what`` needs."""
        return cls.named(what, (error.name or "a package").partition(".")[0], extra)


def import_extra(module: str, what: str, extra: str) -> "Any":
    """Import a module that an extra installs.

    Raises
    ------
    MissingExtraError
        The module is not installed; the message says what needs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError.of(error, what, extra) from None


def require_mujoco(what: str = "the twin pantograph", extra: str = "lab") -> "Any":
    """Return MuJoCo, or raise an error with what needs it and how to install it."""
    try:
        return import_module("mujoco")
    except ImportError:
        raise MissingExtraError.named(what, "MuJoCo", extra) from None
    except Exception as error:  # MUJOCO_GL may name a graphics library that is missing
        raise MissingExtraError(
            f"MuJoCo is installed but does not load: {error}; check the variable MUJOCO_GL"
        ) from None
