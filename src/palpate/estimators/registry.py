"""Every estimator by the name that the command line knows it by.

The command line, ``compare``, the reports and the conformance tests all ask here.
"""

from typing import Any, Literal, TypeVar

from palpate.errors import InvalidParameterError
from palpate.estimators.contact_estimator import ContactEstimator
from palpate.settings import ChangeDetector, ContactGate, OutlierRejection, Scale
from palpate.validation import instance, number_in, shown

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


# What every compiled estimator's loop is set by, as the compiled constructors take it.

#: None is off, but in ``identify`` on; False is off there too.
Rejection = OutlierRejection | Literal[False] | None


def loop_settings(
    change_detector: ChangeDetector | None,
    outlier_rejection: Rejection,
    gate: ContactGate | None,
    scale: Scale | None,
    sample_time: float,
    default_scale: Scale,
) -> tuple[Any, ...]:
    """Check them; an absent detector or rejection costs no memory and no time."""
    instance("change_detector", change_detector, (ChangeDetector, type(None)))
    absent = outlier_rejection is None or outlier_rejection is False
    if not absent and not isinstance(outlier_rejection, OutlierRejection):
        raise InvalidParameterError(
            "outlier_rejection must be an OutlierRejection, None or False, not "
            f"{shown(outlier_rejection)}"
        )
    instance("gate", gate, (ContactGate, type(None)))
    instance("scale", scale, (Scale, type(None)))
    return (
        None if change_detector is None else change_detector._plain(),
        outlier_rejection._plain() if outlier_rejection else None,
        (gate or ContactGate())._plain(),
        (scale or default_scale)._plain(),
        number_in("sample_time", sample_time, 0.0, 1e6, open_low=True),
    )


def known_exponent(exponent: float | None) -> float | None:
    """Check an exponent that is not to be identified; None where it is."""
    return None if exponent is None else number_in("exponent", exponent, 0.1, 10.0)
