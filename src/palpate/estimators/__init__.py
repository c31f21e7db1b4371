"""The estimators: a method is a file, and a line here, in the order of a table."""

from palpate.estimators.contact_estimator import CompiledEstimator as CompiledEstimator
from palpate.estimators.contact_estimator import ContactEstimator as ContactEstimator
from palpate.estimators.contact_estimator import PythonEstimator as PythonEstimator
from palpate.estimators.drift_tracking import DriftTracking as DriftTracking
from palpate.estimators.law_verdicts import DynamicStiffness as DynamicStiffness
from palpate.estimators.law_verdicts import LawVerdict as LawVerdict
from palpate.estimators.recursive_least_squares import DoubleStageRLS as DoubleStageRLS
from palpate.estimators.recursive_least_squares import (
    ExtendedKelvinVoigtRLS as ExtendedKelvinVoigtRLS,
)
from palpate.estimators.recursive_least_squares import KelvinVoigtRLS as KelvinVoigtRLS
from palpate.estimators.recursive_least_squares import (
    RecursiveLeastSquaresEstimator as RecursiveLeastSquaresEstimator,
)
from palpate.estimators.recursive_least_squares import SingleStageRLS as SingleStageRLS
from palpate.estimators.registry import ESTIMATORS as ESTIMATORS
from palpate.estimators.registry import estimator_named as estimator_named
from palpate.estimators.registry import register as register
from palpate.estimators.variable_projection import VariableProjection as VariableProjection
from palpate.estimators.viscoelastic import ViscoelasticContact as ViscoelasticContact
