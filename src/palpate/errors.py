"""What palpate raises. Every message says what is wrong, where, and what to do."""


class PalpateError(Exception):
    """Any error of palpate's own."""


class InvalidParameterError(PalpateError, ValueError):
    """An argument is outside its range: the message names it, its value and the range."""


class RecordingError(PalpateError, ValueError):
    """A recording cannot be used: the message names the file, the column and the row."""


class MissingExtraError(PalpateError, ImportError):
    """An optional dependency is absent: the message names the extra that brings it."""
