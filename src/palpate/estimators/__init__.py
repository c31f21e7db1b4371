"""The estimators: a method is a file, and a line here, in the order of a table."""

from palpate.estimators.contact_estimator import (
    CompiledEstimator,
    ContactEstimator,
    PythonEstimator,
)
from palpate.estimators.law_verdicts import DynamicStiffness, LawVerdict
from palpate.estimators.registry import ESTIMATORS, estimator_named, register

from palpate.estimators.variable_projection import VariableProjection  # isort: skip
from palpate.estimators.recursive_least_squares import (  # isort: skip
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
)
from palpate.estimators.variable_projection import DriftTracking  # isort: skip
from palpate.estimators.viscoelastic import ViscoelasticContact  # isort: skip

__all__ = [
    "ESTIMATORS",
    "CompiledEstimator",
    "ContactEstimator",
    "DoubleStageRLS",
    "DriftTracking",
    "DynamicStiffness",
    "ExtendedKelvinVoigtRLS",
    "KelvinVoigtRLS",
    "LawVerdict",
    "PythonEstimator",
    "RecursiveLeastSquaresEstimator",
    "SingleStageRLS",
    "VariableProjection",
    "ViscoelasticContact",
    "estimator_named",
    "register",
]
