"""What every estimator promises, as checks that any of them can be put to.

    from palpate.estimators.conformance import check

    check(MyEstimator)

The tests put every registered estimator to them. A check that fails raises an AssertionError that
says what was promised.
"""

from collections.abc import Callable
from typing import Any

from palpate.estimators import promises
from palpate.estimators.promises import Kind, settings_of
from palpate.settings import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    OutlierRejection,
    Scale,
    SelfPerturbation,
)

# One value beside the default for each setting that several estimators have; others stay.
_OTHER: dict[str, Any] = {
    "gate": ContactGate(3e-4, 0.2, 0.1),
    "scale": Scale(5e-3, 50e-3, 10.0),
    "sample_time": 2e-3,
    "change_detector": ChangeDetector(warm_up=50),
    "outlier_rejection": OutlierRejection(threshold=20.0),
    "forgetting": ConstantForgetting(0.999),
    "perturbation": SelfPerturbation(),
    "noise": 0.05,
    "surface": "estimate",
    "exponent": 1.5,
}


#: Every promise by its name.
CHECKS: dict[str, Callable[[Kind, dict[str, Any]], None]] = {
    promise.__name__.replace("_", " "): promise
    for promise in (
        promises.replay_is_update,
        promises.thinned_replay_learns_the_same,
        promises.own_steps_are_the_sample_time,
        promises.refused_samples_change_nothing,
        promises.any_floats_leave_it_sound,
        promises.reset_is_a_fresh_start,
        promises.saved_and_restored_is_never_stopped,
        promises.out_of_contact_it_is_held,
        promises.units_do_not_matter,
        promises.settings_are_kept_and_documented,
        promises.nonsense_in_settings_is_refused_by_name,
        promises.an_estimate_is_of_its_law,
    )
}


def variants(kind: Kind) -> dict[str, dict[str, Any]]:
    """Return settings to check an estimator under: as it comes, each other one, and all at once."""
    others = {name: value for name, value in _OTHER.items() if name in settings_of(kind)}
    each = {f"another {name}": {name: value} for name, value in others.items()}
    return {"as it comes": {}, **each, "everything": others}


def check(kind: Kind) -> None:
    """Put an estimator to every check, under each of its :func:`variants`.

    Parameters
    ----------
    kind : type
        The estimator's class.

    Raises
    ------
    AssertionError
        It breaks a promise; the message names it.
    """
    for words, settings in variants(kind).items():
        for name, promise in CHECKS.items():
            try:
                promise(kind, settings)
            except Exception as error:  # whatever it raises, it breaks this promise
                raise AssertionError(f"{kind.__name__}, {words}: {name}: {error}") from error
