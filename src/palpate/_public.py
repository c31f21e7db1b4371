"""The public names, gathered; ``import palpate`` offers them."""

from palpate._core import PreparedSample, Status
from palpate.contact import Contact
from palpate.curves import CurveFits, fit_curves
from palpate.diagnosis import Diagnosis, Finding, Verdict, WorkingDepth
from palpate.errors import (
    FleetError,
    InvalidParameterError,
    MissingChannelError,
    MissingExtraError,
    PalpateError,
    RecordingError,
)
from palpate.estimate import Estimate
from palpate.estimators import (
    ESTIMATORS,
    ContactEstimator,
    DoubleStageRLS,
    DriftTracking,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    PythonEstimator,
    RecursiveLeastSquaresEstimator,
    SingleStageRLS,
    VariableProjection,
    ViscoelasticContact,
)
from palpate.fleet.many import identify_many
from palpate.force_laws import (
    FORCE_LAWS,
    ExtendedKelvinVoigt,
    FlatSpectrum,
    ForceLaw,
    GeneralisedHuntCrossley,
    HuntCrossley,
    KelvinVoigt,
    PowerLawRelaxation,
    SingleRelaxation,
)
from palpate.identifying import Identification, compare, diagnose, identify
from palpate.least_squares import LeastSquares
from palpate.preparation import Columns, OnlinePreparation, choose_gate, prepare
from palpate.quantities.elastic_modulus import ElasticModulus
from palpate.quantities.energy import EnergyLoss
from palpate.quantities.impact import dissipation_for, restitution
from palpate.quantities.passivity import Passivity
from palpate.quantities.restitution import Restitution
from palpate.quantities.wanted import Wanted
from palpate.recordings import Recording, open_recording, write_contact
from palpate.results.loading import SavedResult, load_result
from palpate.settings import (
    ChangeDetector,
    ConstantForgetting,
    ContactGate,
    FadingForgetting,
    OutlierRejection,
    Scale,
    SelfPerturbation,
)
from palpate.tips import Cone, FlatPunch, Sphere, Tip
from palpate.trace import Trace

__all__ = [
    "ESTIMATORS",
    "FORCE_LAWS",
    "ChangeDetector",
    "Columns",
    "Cone",
    "ConstantForgetting",
    "Contact",
    "ContactEstimator",
    "ContactGate",
    "CurveFits",
    "Diagnosis",
    "DoubleStageRLS",
    "DriftTracking",
    "ElasticModulus",
    "EnergyLoss",
    "Estimate",
    "ExtendedKelvinVoigt",
    "ExtendedKelvinVoigtRLS",
    "FadingForgetting",
    "Finding",
    "FlatPunch",
    "FlatSpectrum",
    "FleetError",
    "ForceLaw",
    "GeneralisedHuntCrossley",
    "HuntCrossley",
    "Identification",
    "InvalidParameterError",
    "KelvinVoigt",
    "KelvinVoigtRLS",
    "LeastSquares",
    "MissingChannelError",
    "MissingExtraError",
    "OnlinePreparation",
    "OutlierRejection",
    "PalpateError",
    "Passivity",
    "PowerLawRelaxation",
    "PreparedSample",
    "PythonEstimator",
    "Recording",
    "RecordingError",
    "RecursiveLeastSquaresEstimator",
    "Restitution",
    "SavedResult",
    "Scale",
    "SelfPerturbation",
    "SingleRelaxation",
    "SingleStageRLS",
    "Sphere",
    "Status",
    "Tip",
    "Trace",
    "VariableProjection",
    "Verdict",
    "ViscoelasticContact",
    "Wanted",
    "WorkingDepth",
    "choose_gate",
    "compare",
    "diagnose",
    "dissipation_for",
    "fit_curves",
    "identify",
    "identify_many",
    "load_result",
    "open_recording",
    "prepare",
    "restitution",
    "write_contact",
]
