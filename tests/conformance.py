"""The conformance tests that every estimator must pass.

``test_conformance.py`` runs them on every registered estimator. Each is a function of the class of
an estimator and its settings, and raises an AssertionError on failure.
"""

import copy
import inspect
import math
import pickle
from collections.abc import Callable, Iterator
from functools import cache
from operator import methodcaller
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.errors import InvalidParameterError
from palpate.force_laws import HuntCrossley
from palpate.method.estimators.contact_estimator import ContactEstimator
from palpate.method.estimators.estimate import Trace
from palpate.method.settings import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    OutlierRejection,
    Scale,
    SelfPerturbation,
)
from palpate.validation import Floats

Kind = type[ContactEstimator]
Signals = tuple[Floats, Floats, Floats]


def _hold(test: bool | np.bool_, words: str) -> None:
    """Raise an AssertionError, even if Python runs with assertions disabled."""
    if not test:
        raise AssertionError(words)


class _Odd:
    """An object whose every use raises an error."""

    def __float__(self) -> float:
        raise RuntimeError

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError

    def __repr__(self) -> str:
        raise RuntimeError


# Invalid values for any setting; None is valid for an optional one.
_NONSENSE: tuple[Any, ...] = (
    None, math.nan, -math.inf, -1.0, 10**400, 1e308, "soon", b"\xff", 1j, [], [[1.0], [2.0, 3.0]],
    {}, object(), _Odd(), np.ma.masked, np.ma.masked_equal([1.0, 2.0, 3.0], 2.0), int, (3, 1),
)  # fmt: skip


def setting_names(kind: Kind) -> list[str]:
    """Return the names of an estimator's settings."""
    return list(inspect.signature(kind.__init__).parameters)[1:]


@cache  # all tests share it, and none changes it
def _tapping(seconds: float = 0.7) -> Signals:
    """A ball tapped several times, sampled at 1 kHz, with 0.02 N of noise."""
    time = 1e-3 * np.arange(round(1e3 * seconds))
    x = 1.5e-3 + 1.8e-3 * np.sin(11.0 * time) + 1.8e-3 * np.sin(15.0 * time)
    v = 19.8e-3 * np.cos(11.0 * time) + 27e-3 * np.cos(15.0 * time)
    noise = np.random.default_rng(11).standard_normal(time.size)
    return x, v, HuntCrossley(K=2000.0, B=2000.0, n=1.0).force(x, v) + 0.02 * noise


def _knowledge(estimator: ContactEstimator) -> tuple[Any, ...]:
    """The complete result of an estimator, for comparison bit for bit."""
    now = estimator.estimate()
    return (
        now.parameters.tobytes(),
        now.joint_covariance.tobytes(),
        now.validity_margin.hex(),
        (now.offset, now.surface, now.flags, now.status, now.samples, now.guarded),
        (now.restarts, now.rejected),
        [estimator.predict(x, v).hex() for x, v in ((1e-3, 0.0), (3e-3, 0.02), (-1e-3, 0.0))],
    )


def _bits(trace: Trace) -> list[bytes]:
    columns = (getattr(trace, name) for name in trace.__dataclass_fields__)
    return [b"" if column is None else column.tobytes() for column in columns]


def _halfway(kind: Kind, settings: dict[str, Any]) -> ContactEstimator:
    estimator = kind(**settings)
    estimator.replay(*(channel[:350] for channel in _tapping()))
    return estimator


def replay_is_update(kind: Kind, settings: dict[str, Any]) -> None:
    """A replay equals updates bit for bit, in one part or in several."""
    whole, pieces, looped = kind(**settings), kind(**settings), kind(**settings)
    signals = _tapping()
    trace = whole.replay(*signals)
    parts = [
        pieces.replay(*(channel[cut] for channel in signals))
        for cut in (slice(0, 7), slice(7, 7), slice(7, None))
    ]
    joined = Trace.joined(parts, trace.parameters.shape[1])
    _hold(_bits(joined) == _bits(trace), "the parts differ")
    largest = float(np.abs(signals[2]).max())
    for k, row in enumerate(np.transpose(signals).tolist()):
        before = looped.predict(*row[:2])
        _hold(looped.update(*row) == trace.status[k], f"status of sample {k}")
        # Once a law is known, a prediction from a few samples ago is close to the present one.
        off = abs(trace.predicted_force[k] - before)
        _hold(k < 100 or off <= 0.02 * largest, f"prediction of sample {k}")
        if k % 50 == 0:
            _hold(np.array_equal(looped.estimate().parameters, trace.parameters[k]), f"sample {k}")
    _hold(_knowledge(looped) == _knowledge(whole) == _knowledge(pieces), "the estimates differ")


def thinned_replay_learns_the_same(kind: Kind, settings: dict[str, Any]) -> None:
    """A thinned trace contains the requested estimates, and nothing else changes."""
    signals = _tapping()
    at = [0, 7, 8, 350, signals[0].size - 1]
    whole, thinned, unwritten = kind(**settings), kind(**settings), kind(**settings)
    full = whole.replay(*signals)
    traces = thinned.replay(*signals, at=at), unwritten.replay(*signals, at=())
    for trace, rows in zip(traces, (at, []), strict=True):
        _hold(trace.after.tolist() == rows, "the trace has other samples")
        for name in ("parameters", "standard_errors"):
            written, every = getattr(trace, name), getattr(full, name)
            _hold(np.array_equal(written, every[rows]), f"{name} of a thinned trace")
        for name in ("predicted_force", "validity_margin", "status"):
            _hold(getattr(trace, name).tobytes() == getattr(full, name).tobytes(), name)
    same = _knowledge(whole) == _knowledge(thinned) == _knowledge(unwritten)
    _hold(same, "the estimates differ")


def own_steps_are_the_sample_time(kind: Kind, settings: dict[str, Any]) -> None:
    """An explicit time step has the same effect as the same sample time."""
    nominal, given, spread = kind(**settings), kind(**settings), kind(**settings)
    signals, step = _tapping(), nominal.settings.get("sample_time") or 1e-3
    nominal.replay(*signals)
    given.replay(*signals, step)
    spread.replay(*signals, np.full(signals[0].size, step))
    _hold(_knowledge(nominal) == _knowledge(given) == _knowledge(spread), "the estimates differ")


def refused_samples_change_nothing(kind: Kind, settings: dict[str, Any]) -> None:
    """Invalid samples return a status that refuses them, and change nothing."""
    for estimator in (kind(**settings), _halfway(kind, settings)):
        before = _knowledge(estimator)
        for bad in (math.nan, math.inf, -math.inf):
            for row in ((bad, 0.01, 1.0), (0.01, bad, 1.0), (0.01, 0.01, bad)):
                _hold(estimator.update(*row) == Status.NOT_FINITE, f"{row}")
        for dt in (0.0, -1e-3, math.nan, math.inf):
            _hold(estimator.update(0.01, 0.01, 1.0, dt) == Status.INVALID_STEP, f"dt = {dt}")
        _hold(estimator.update(1e300, 1e300, 1e300) == Status.OUT_OF_RANGE, "1e300")
        _hold(_knowledge(estimator) == before, "the estimate has changed")


def any_floats_leave_it_sound(kind: Kind, settings: dict[str, Any]) -> None:
    """Any samples lead to finite numbers and a valid covariance, updated or replayed."""
    random = np.random.default_rng(5)
    estimator = kind(**settings)
    ordinary = random.uniform([-1e-3, -0.1, -1.0], [0.02, 0.1, 20.0], (400, 3))
    absurd = 10.0 ** random.uniform(-320.0, 300.0, (400, 3)) * random.choice([-1.0, 1.0], (400, 3))
    samples, statuses = np.where(random.random((400, 3)) < 0.8, ordinary, absurd), []
    for k, row in enumerate(samples.tolist()):
        statuses.append(estimator.update(*row))
        if k % 20:
            continue
        now = estimator.estimate()
        joint = now.joint_covariance
        for name, numbers in (("parameters", now.parameters), ("covariance", joint)):
            _hold(np.isfinite(numbers).all(), f"{name} after sample {k}: {numbers}")
        errors = now.standard_errors
        _hold(
            np.isfinite(errors).all() and (errors >= 0.0).all(), "the status or a number is invalid"
        )
        _hold(np.array_equal(joint, joint.T) and (np.diag(joint) >= 0.0).all(), f"{joint}")
        _hold(math.isfinite(now.validity_margin), "the status or a number is invalid")
    replayed = kind(**settings)
    trace = replayed.replay(*samples.T)
    same = trace.status.tolist() == statuses and _knowledge(replayed) == _knowledge(estimator)
    _hold(same, "a replay differs")
    _hold(not np.isnan(trace.predicted_force[trace.taken]).any(), "a prediction is NaN")


def reset_is_a_fresh_start(kind: Kind, settings: dict[str, Any]) -> None:
    """A reset forgets everything but the settings."""
    used, fresh = _halfway(kind, settings), kind(**settings)
    used.reset()
    _hold(_knowledge(used) == _knowledge(fresh), "the estimates differ")
    _hold(_bits(used.replay(*_tapping())) == _bits(fresh.replay(*_tapping())), "the trace differs")


def saved_and_restored_is_never_stopped(kind: Kind, settings: dict[str, Any]) -> None:
    """A copy, a deep copy and a pickle continue exactly, independent of the original."""
    pickled: Callable[[ContactEstimator], Any] = lambda one: pickle.loads(pickle.dumps(one))  # noqa: E731
    estimator, rest = _halfway(kind, settings), [channel[350:] for channel in _tapping()]
    before = _knowledge(estimator)
    others = [copied(estimator) for copied in (methodcaller("copy"), copy.deepcopy, pickled)]
    traces = [_bits(other.replay(*rest)) for other in others]
    _hold(_knowledge(estimator) == before, "the original changed with its copy")
    expected = _bits(estimator.replay(*rest))
    _hold(all(trace == expected for trace in traces), "the copy continues differently")
    for other in others:
        _hold(type(other) is kind and repr(other) == repr(estimator), "another class or settings")


def _lift(estimator: ContactEstimator) -> None:
    """Update with samples out of contact; a single one might count as a dropout."""
    for _ in range(25):
        estimator.update(-1.0, 0.0, 0.0)


def out_of_contact_it_is_held(kind: Kind, settings: dict[str, Any]) -> None:
    """Out of contact, and after leave_contact, the estimate is held."""
    for end in (_lift, methodcaller("leave_contact")):
        fresh, estimator = kind(**settings), _halfway(kind, settings)
        end(fresh)
        _hold(fresh.estimate().status == Status.WAITING, "a new estimator is not waiting")
        law, samples = estimator.estimate().parameters, estimator.estimate().samples
        end(estimator)
        now = estimator.estimate()
        _hold(now.status == Status.HELD and now.samples == samples, "the estimate is not held")
        _hold(np.array_equal(now.parameters, law), "the law has changed")
        _hold(samples > 0, "no sample was taken before")


def units_do_not_matter(kind: Kind, settings: dict[str, Any]) -> None:
    """A force and settings in other units give the same law in those units."""
    if "scale" not in setting_names(kind):
        return
    unit = 1024.0
    x, v, force = _tapping()
    plain = kind(**{**settings, "scale": Scale(5e-3, 50e-3, 10.0)})
    given: dict[str, Any] = {**plain.settings, "scale": Scale(5e-3, 50e-3, unit * 10.0)}
    gate, noise, start = given.get("gate"), given.get("noise"), given.get("initial")
    if gate is not None:
        forces = unit * gate.make_force, unit * gate.break_force
        given["gate"] = ContactGate(gate.minimum_penetration, *forces)
    if noise is not None:
        given["noise"] = unit * noise
    if given.get("perturbation"):
        shaken = given["perturbation"]
        given["perturbation"] = SelfPerturbation(shaken.gain, shaken.sensitivity / unit**2)
    if start is not None:
        names = zip(start.parameters.tolist(), start.units, strict=True)
        given["initial"] = type(start).from_parameters(
            [unit * p if "N" in u else p for p, u in names]
        )
    other = kind(**given)
    plain.replay(x, v, force)
    other.replay(x, v, unit * force)
    law, units = plain.estimate().law, plain.law_type.units
    expected = [unit * p if "N" in u else p for p, u in zip(law.parameters, units, strict=True)]
    # Logarithms of the units differ by rounding, which the conditioning of a short tap amplifies.
    _hold(np.allclose(other.estimate().parameters, expected, rtol=1e-6), "the laws differ")


def settings_are_kept_and_documented(kind: Kind, settings: dict[str, Any]) -> None:
    """Settings are the constructor's arguments, documented, and reproduce the estimator."""
    estimator = kind(**settings)
    names = setting_names(kind)
    _hold(list(estimator.settings) == names, f"settings are {list(estimator.settings)}")
    words = " ".join(inspect.getdoc(each) or "" for each in kind.__mro__)
    missing = [name for name in names if name not in words]
    _hold(not missing, f"no docstring names {missing}")
    again = kind(**estimator.settings)
    _hold(repr(again) == repr(estimator), "they do not reproduce the estimator")
    _hold(all(f"{name}=" in repr(estimator) for name in names), "repr omits some")
    for name, value in settings.items():
        changed = kind().replace(**{name: value})
        _hold(changed.settings[name] == value and changed.estimate().samples == 0, name)


def nonsense_in_settings_is_refused_by_name(kind: Kind, settings: dict[str, Any]) -> None:
    """A setting accepts a value, or raises an InvalidParameterError of one line."""
    for name in setting_names(kind):
        for value in _NONSENSE:
            try:
                kind(**{**settings, name: value})
            except InvalidParameterError as error:
                words = str(error)
                _hold("\n" not in words and len(words) < 400, f"{name}: {words[:400]}")


def an_estimate_is_of_its_law(kind: Kind, settings: dict[str, Any]) -> None:
    """The estimate has the law's type and size, and standard errors from the covariance."""
    now = _halfway(kind, settings).estimate()
    _hold(type(now.law) is kind.law_type, f"{now.law}")
    size = len(kind.law_type.symbols)
    _hold(
        now.parameters.shape == (size,) and now.covariance.shape == (size, size), "the size differs"
    )
    _hold(
        np.array_equal(now.standard_errors, np.sqrt(np.diag(now.covariance))),
        "the standard errors differ",
    )


# A non-default value for each setting that several estimators share.
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


#: The conformance tests by name.
CHECKS: dict[str, Callable[[Kind, dict[str, Any]], None]] = {
    test.__name__.replace("_", " "): test
    for test in (
        replay_is_update,
        thinned_replay_learns_the_same,
        own_steps_are_the_sample_time,
        refused_samples_change_nothing,
        any_floats_leave_it_sound,
        reset_is_a_fresh_start,
        saved_and_restored_is_never_stopped,
        out_of_contact_it_is_held,
        units_do_not_matter,
        settings_are_kept_and_documented,
        nonsense_in_settings_is_refused_by_name,
        an_estimate_is_of_its_law,
    )
}


def variants(kind: Kind) -> dict[str, dict[str, Any]]:
    """Return settings for the tests: the defaults, each other value alone, and all together."""
    others = {name: value for name, value in _OTHER.items() if name in setting_names(kind)}
    each = {f"another {name}": {name: value} for name, value in others.items()}
    return {"as it comes": {}, **each, "everything": others}
