"""The estimators: a method is a file."""

from palpate.estimators.contact_estimator import ContactEstimator
from palpate.estimators.drift_tracking import DriftTracking
from palpate.estimators.recursive_least_squares import (
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
)
from palpate.estimators.variable_projection import VariableProjection

__all__ = [
    "ContactEstimator",
    "DoubleStageRLS",
    "DriftTracking",
    "ExtendedKelvinVoigtRLS",
    "KelvinVoigtRLS",
    "RecursiveLeastSquaresEstimator",
    "SingleStageRLS",
    "VariableProjection",
]
