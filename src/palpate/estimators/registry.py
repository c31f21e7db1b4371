"""Every estimator by the name that the command line knows it by.

The command line, ``compare``, the reports and the conformance tests all ask here.
"""

from typing import TypeVar

from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import ContactEstimator
from palpate.validation import shown

Kind = TypeVar("Kind", bound=type[ContactEstimator])

#: In the order of a table: the default first.
ESTIMATORS: dict[str, type[ContactEstimator]] = {}

# What the face of an estimator has beside what ContactEstimator gives.
_FACE = ("update", "replay", "predict", "estimate", "reset", "leave_contact", "_state", "_restore")


def register(kind: Kind) -> Kind:
    """Make an estimator known by its ``method``; a decorator.

    It has to pass the conformance tests, which find it here (``CONTRIBUTING.md``).

    Raises
    ------
    InvalidParameterError
        It is no estimator, lacks a part of the face, or another has its name.
    """
    if not (isinstance(kind, type) and issubclass(kind, ContactEstimator)):
        raise InvalidParameterError(f"estimator must be a ContactEstimator, not {shown(kind)}")
    missing = [name for name in ("method", "law_type", *_FACE) if not hasattr(kind, name)]
    if missing:
        raise InvalidParameterError(f"{kind.__name__} lacks {', '.join(missing)}")
    if ESTIMATORS.setdefault(kind.method, kind) is not kind:
        raise InvalidParameterError(
            f"method must be new: {kind.method!r} is {ESTIMATORS[kind.method].__name__}"
        )
    return kind


def estimator_named(name: str) -> type[ContactEstimator]:
    """Return the estimator of this name.

    Raises
    ------
    InvalidParameterError
        There is none; the message lists them.
    """
    if not isinstance(name, str) or name not in ESTIMATORS:
        raise InvalidParameterError(
            f"method must be one of {', '.join(ESTIMATORS)}, not {shown(name)}"
        )
    return ESTIMATORS[name]
