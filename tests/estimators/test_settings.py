"""Settings refuse nonsense in words that name the argument, its value and its range."""

import copy
import dataclasses
import math
import pickle
import re
from functools import partial

import numpy as np
import pytest

import palpate
from palpate import (
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    HuntCrossley,
    InvalidParameterError,
    KelvinVoigt,
    KelvinVoigtRLS,
    LeastSquares,
    Scale,
    SelfPerturbation,
)

LINEAR, PROJECTION, DRIFT = KelvinVoigtRLS, palpate.VariableProjection, palpate.DriftTracking
DETECTOR, MEMORY = palpate.ChangeDetector, palpate.ViscoelasticContact
ONLINE, TIME = palpate.OnlinePreparation, np.arange(10.0)
OFFLINE = partial(palpate.prepare, time=TIME, penetration=TIME, force=TIME)
CURVES = partial(palpate.fit_curves, *[np.ones((2, 5))] * 3)
QUADRATIC = palpate.ExtendedKelvinVoigt(K1=1.0, K2=-1e101, B=0.0)
SEARCHING, NEEDLE = partial(PROJECTION, surface="estimate"), Scale(1e-6, 1.0, 1.0)

# What is called, the argument that is named, its value, and the range as the message gives it.
REFUSED = [
    (ContactGate, "minimum_penetration", -1e-9, "[0, 1e+100], not -1e-09"),
    (ContactGate, "break_force", -0.1, "[0, 1e+100], not -0.1"),
    (partial(ContactGate, make_force=1.0), "break_force", 1.5, "[0, make_force = 1], not 1.5"),
    (ConstantForgetting, "factor", 0.0, "(0, 1], not 0.0"),
    (ConstantForgetting, "factor", 1.001, "(0, 1], not 1.001"),
    (FadingForgetting, "initial_factor", 0.0, "(0, 1], not 0.0"),
    (FadingForgetting, "rate", 0.0, "(0, 1e+06], not 0.0"),
    (SelfPerturbation, "gain", -0.05, "[0, 1e+20], not -0.05"),
    (SelfPerturbation, "sensitivity", -2.5, "[0, 1e+40], not -2.5"),
    (Scale, "penetration", 0.0, "[1e-30, 1e+30], not 0.0"),
    (Scale, "velocity", -1.0, "[1e-30, 1e+30], not -1.0"),
    (Scale, "force", 1e31, "[1e-30, 1e+30], not 1e+31"),
    (LINEAR, "sample_time", 0.0, "(0, 1e+06], not 0.0"),
    (LINEAR, "initial_covariance", [1.0, -1.0], "[1e-20, 1e+20], not [1.0, -1.0]"),
    (LINEAR, "initial_covariance", 1e21, "[1e-20, 1e+20], not 1e+21"),
    (LINEAR, "initial_covariance", math.nan, "[1e-20, 1e+20], not nan"),
    *(
        (make, "initial_covariance", covariance, words)
        for make in (LINEAR, partial(LeastSquares, 2))
        for covariance, words in (
            (np.eye(3), "be …symmetric 2 × 2 matrix"),
            ([1.0, 1.0, 1.0], "be …2 variances"),
            ([[1.0, 0.5], [0.4, 1.0]], "be …symmetric"),
            ([[1.0, 2.0], [2.0, 1.0]], "be positive definite"),
            ([[1.0, 1.0], [1.0, 1.0]], "be positive definite"),
            ("large", "be …numbers"),
        )
    ),
    # Starts beyond the arithmetic, or without a logarithm.
    (LINEAR, "initial", KelvinVoigt(K=1e101, B=0.0), "be in …1e+101"),
    (palpate.ExtendedKelvinVoigtRLS, "initial", QUADRATIC, "be in …1e+101"),
    (palpate.SingleStageRLS, "initial", HuntCrossley(K=1.0, B=1e101, n=1.0), "be in …1e+101"),
    (palpate.DoubleStageRLS, "initial", HuntCrossley(K=1.0, B=1.0, n=1e101), "be in …1e+101"),
    (palpate.SingleStageRLS, "initial", HuntCrossley(K=0.0, B=0.0, n=1.0), "be above 0"),
    (palpate.SingleStageRLS, "initial", HuntCrossley(K=-1.0, B=0.0, n=1.0), "be above 0"),
    (LINEAR, "initial", 5.0, "a KelvinVoigt, not 5.0"),
    (LINEAR, "initial", HuntCrossley(K=1.0, B=1.0, n=1.0), "a KelvinVoigt, not HuntCrossley"),
    (LINEAR, "forgetting", 0.99, "a ConstantForgetting or FadingForgetting…, not 0.99"),
    (LINEAR, "perturbation", 0.05, "a SelfPerturbation…, not 0.05"),
    (LINEAR, "gate", 0.1, "a ContactGate…, not 0.1"),
    (LINEAR, "scale", (1.0, 1.0, 1.0), "a Scale…, not (1.0, 1.0, 1.0)"),
    (PROJECTION, "noise", 0.0, "in (0, 1e+30], not 0.0"),
    (PROJECTION, "offset", None, "a bool, not None"),
    (PROJECTION, "offset_deviation", 0.0, "in (0, 1e+30], not 0.0"),
    (PROJECTION, "exponent_range", (2.0, 1.0), "(lowest, highest), 0.2 to 5 apart, not (2.0, 1.0)"),
    (PROJECTION, "exponent_range", (1.0, 1.1), "0.2 to 5 apart, not (1.0, 1.1)"),
    (PROJECTION, "exponent_range", (0.0, 2.0), "in [0.1, 10], not 0.0"),
    (PROJECTION, "exponent_range", 1.5, "(lowest, highest) …, not 1.5"),
    (PROJECTION, "change_detector", True, "a ChangeDetector or …, not True"),
    (DETECTOR, "drift", 0.5, "in [1, 24], not 0.5"),
    (DETECTOR, "threshold", 0.0, "in (0, 1e+12], not 0.0"),
    (DETECTOR, "adaptation", 1.5, "in [0, 1], not 1.5"),
    (DETECTOR, "warm_up", 1, "in [10, 1e+06], not 1"),
    (DETECTOR, "transition", 101, "in [0, 100], not 101"),
    (DRIFT, "stiffness_drift", -1.0, "in [0, 100], not -1"),
    (DRIFT, "noise", 0.0, "in (0, 1e+30], not 0.0"),
    (DRIFT, "dissipation_drift", math.nan, "finite, not nan"),
    (MEMORY, "damping", "maxwell", "one of"),
    (MEMORY, "memory", 3, "one of"),
    (MEMORY, "exponent", 0.2, "in"),
    (MEMORY, "longest_time", 3e-3, "in [0.004, 1e+12], not 0.003"),
    (PROJECTION, "surface", "search", "'estimate' or None, not 'search'"),
    (PROJECTION, "surface", 0.0, "'estimate' or None, not 0.0"),
    (SEARCHING, "surface_range", (1e-3, -1e-3), "be (lowest, highest) in m"),
    (SEARCHING, "surface_range", (1e-3, 1e-3), "be (lowest, highest) in m"),
    (SEARCHING, "surface_range", (0.0, 0.06), "in …0.06"),
    (SEARCHING, "surface_range", 1e-3, "(lowest, highest"),
    (SEARCHING, "surface_range", (0.0, math.nan), "be finite"),
    (partial(SEARCHING, scale=NEEDLE), "surface_range", (0.0, 1e-3), "[-5e-06, 5e-06], not 0.001"),
    (palpate.OutlierRejection, "threshold", 2.9, "in"),  # noise exceeds it
    (ONLINE, "sample_time", 0.0, "be"),
    (ONLINE, "velocity_window", -1.0, "be"),
    (ONLINE, "velocity_window", 0.3, "be at most 255 samples, 0.255 s"),
    (ONLINE, "force_offset", "heavy", "be"),
    (ONLINE, "flip", ["velocity"], "name force or penetration"),
    (ONLINE, "direction", [0.0, 0.0, 0.0], "be 3 numbers"),
    (ONLINE, "direction", "down", "be"),
    (OFFLINE, "velocity_window", 0.0, "be …not 0.0"),
    (OFFLINE, "units", {"depth": "mm"}, "name time, penetration"),
    (OFFLINE, "flip", ["velocity"], "name force or penetration"),
    (OFFLINE, "tare", 3.0, "be"),
    (OFFLINE, "delay", 60.0, "be in [-10, 10]"),
    (OFFLINE, "surface", "x", "be a number"),
    (CURVES, "surface", "search", "be 'estimate'"),
    (partial(CURVES, surface="estimate"), "surface_range", (1e-3, 0.0), "(lowest, highest) in m"),
    (CURVES, "exponent", 0.0, "be in"),
    (CURVES, "exponent_range", (1.0, 1.1), "be …0.2 to 5 apart"),
    (CURVES, "threads", 0, "be in"),
    (CURVES, "noise", -1.0, "be in"),
    (CURVES, "offset_deviation", [1.0, 2.0, 3.0], "one for each of 2 curves"),
    (CURVES, "surface_deviation", -1.0, "be"),
    (CURVES, "scale", 1.0, "be a Scale"),
    *((LINEAR, "outlier_rejection", bad, "be") for bad in (True, 10.0, "on", DETECTOR())),
]

# What may be several numbers.
SEVERAL = {"initial_covariance", "exponent_range", "surface_range", "surface_deviation", "tare"}


@pytest.mark.parametrize("make, name, value, words", REFUSED)
def test_a_value_out_of_range_is_refused_by_name_value_and_range(make, name, value, words):
    pattern = re.escape(words).replace("…", ".*")
    with pytest.raises(InvalidParameterError, match=f"^{name}.* must .*{pattern}"):
        make(**{name: value})


@pytest.mark.parametrize(
    "make, name",
    dict.fromkeys(
        (make, name)
        for make, name, value, _ in REFUSED
        if isinstance(value, float) and name not in SEVERAL
    ),
)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, "much", [1.0, 2.0], 1j])
def test_a_setting_that_is_not_a_finite_number_is_refused_by_name(make, name, bad):
    with pytest.raises(InvalidParameterError, match=f"^{name} must be") as caught:
        make(**{name: bad})
    assert repr(bad) in str(caught.value)


def test_equal_initial_covariances_in_any_form_give_one_estimate():
    for covariance in (3.0, [3.0, 3.0], [[3.0, 0.0], [0.0, 3.0]]):
        estimator = KelvinVoigtRLS(initial_covariance=covariance)
        # Formed from a square root, whose rounding is that of 3.
        expected = 3.0 * np.eye(2)
        assert estimator.estimate().covariance == pytest.approx(expected, rel=1e-15, abs=0.0)
    matrix = np.eye(3)
    matrix[0, 2] = matrix[2, 0] = 0.1
    with pytest.raises(InvalidParameterError, match="initial_covariance must be zero"):
        palpate.DoubleStageRLS(initial_covariance=matrix)
    matrix[0, 2] = matrix[2, 0] = 0.0
    matrix[0, 1] = matrix[1, 0] = 0.1
    palpate.DoubleStageRLS(initial_covariance=matrix)


def test_every_setting_of_an_estimator_is_given_by_name(kind):
    with pytest.raises(InvalidParameterError, match="_range needs surface='estimate'"):
        PROJECTION(surface_range=(-1e-3, 1e-3))
    with pytest.raises(TypeError):
        kind(kind.default_initial)
    with pytest.raises(TypeError):
        kind(K=5.0)


def test_an_invalid_parameter_is_a_value_error_and_one_of_ours():
    assert issubclass(InvalidParameterError, ValueError)
    assert issubclass(InvalidParameterError, palpate.PalpateError)
    assert issubclass(palpate.RecordingError, ValueError)
    assert issubclass(palpate.MissingExtraError, ImportError)


VALUES = [
    ContactGate(1e-4, 0.5, 0.3),
    ConstantForgetting(0.99),
    FadingForgetting(0.98, 6.0),
    SelfPerturbation(0.1, 3.0),
    Scale(1e-3, 1e-2, 1.0),
    palpate.Columns(time="t"),
]


@pytest.mark.parametrize("value", VALUES, ids=lambda v: type(v).__name__)
def test_a_setting_is_a_frozen_value(value):
    field = dataclasses.fields(value)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(value, field, 1.0)
    again = pickle.loads(pickle.dumps(value))
    assert again == value == copy.deepcopy(value)
    assert hash(again) == hash(value)
    assert value != type(value)()


def test_initial_values_of_the_estimators_are_the_papers(kind):
    settings = kind().settings
    assert settings["forgetting"] == FadingForgetting(0.99, 5.0)
    assert settings["perturbation"] is None
    assert settings["sample_time"] == 1e-3
    assert settings["initial"].parameters[0] == 0.1  # Kc₀ (methods, section 4)
    assert SelfPerturbation() == SelfPerturbation(gain=0.05, sensitivity=2.5)
    # A gate breaks at four fifths of its make force, unless it is told.
    assert ContactGate(make_force=5.0).break_force == 4.0
    assert ContactGate(make_force=5.0, break_force=0.0).break_force == 0.0
