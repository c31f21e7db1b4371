"""The estimators: each method is a class, registered in a table here."""

from palpate.force_laws import FORCE_LAWS as _FORCE_LAWS
from palpate.force_laws.laws import WATCHERS as _WATCHERS
from palpate.method.estimators.by_law import watch as _watch
from palpate.method.estimators.contact_estimator import ESTIMATORS as ESTIMATORS
from palpate.method.estimators.contact_estimator import CompiledEstimator as CompiledEstimator
from palpate.method.estimators.contact_estimator import ContactEstimator as ContactEstimator
from palpate.method.estimators.contact_estimator import PythonEstimator as PythonEstimator
from palpate.method.estimators.contact_estimator import estimator_named as estimator_named
from palpate.method.estimators.contact_estimator import register as register
from palpate.method.estimators.law_verdicts import DynamicStiffness as DynamicStiffness
from palpate.method.estimators.law_verdicts import LawVerdict as LawVerdict
from palpate.method.estimators.recursive_least_squares import DoubleStageRLS as DoubleStageRLS
from palpate.method.estimators.recursive_least_squares import (
    ExtendedKelvinVoigtRLS as ExtendedKelvinVoigtRLS,
)
from palpate.method.estimators.recursive_least_squares import KelvinVoigtRLS as KelvinVoigtRLS
from palpate.method.estimators.recursive_least_squares import (
    RecursiveLeastSquaresEstimator as RecursiveLeastSquaresEstimator,
)
from palpate.method.estimators.recursive_least_squares import SingleStageRLS as SingleStageRLS
from palpate.method.estimators.variable_projection import DriftTracking as DriftTracking
from palpate.method.estimators.variable_projection import VariableProjection as VariableProjection
from palpate.method.estimators.viscoelastic import ViscoelasticContact as ViscoelasticContact

# The order of tables and of comparisons; the default comes first.
for _kind in (
    VariableProjection, SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS, ExtendedKelvinVoigtRLS,
    DriftTracking, ViscoelasticContact,
):  # fmt: skip
    register(_kind)
_WATCHERS.append(_watch)
for _law in _FORCE_LAWS.values():
    _watch(_law)
