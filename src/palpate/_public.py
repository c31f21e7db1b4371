"""The public names, gathered; ``import palpate`` offers them."""

from palpate._core import Estimate, Status
from palpate.contact import Contact
from palpate.errors import InvalidParameterError, MissingExtraError, PalpateError, RecordingError
from palpate.estimators import (
    ContactEstimator,
    DoubleStageRLS,
    DriftTracking,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
    VariableProjection,
)
from palpate.force_laws import ExtendedKelvinVoigt, HuntCrossley, KelvinVoigt
from palpate.identification import METHODS, Identification, compare, identify
from palpate.least_squares import LeastSquares
from palpate.recordings.csv import Columns, read_contact
from palpate.settings import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    Scale,
    SelfPerturbation,
)
from palpate.trace import Trace

__all__ = [
    "METHODS",
    "ChangeDetector",
    "Columns",
    "ConstantForgetting",
    "Contact",
    "ContactEstimator",
    "ContactGate",
    "DoubleStageRLS",
    "DriftTracking",
    "Estimate",
    "ExtendedKelvinVoigt",
    "ExtendedKelvinVoigtRLS",
    "FadingForgetting",
    "HuntCrossley",
    "Identification",
    "InvalidParameterError",
    "KelvinVoigt",
    "KelvinVoigtRLS",
    "LeastSquares",
    "MissingExtraError",
    "PalpateError",
    "RecordingError",
    "RecursiveLeastSquaresEstimator",
    "Scale",
    "SelfPerturbation",
    "SingleStageRLS",
    "Status",
    "Trace",
    "VariableProjection",
    "compare",
    "identify",
    "read_contact",
]
