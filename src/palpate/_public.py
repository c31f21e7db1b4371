"""The public names, gathered; ``import palpate`` offers them."""

import typing as _typing

from palpate._core import PreparedSample as PreparedSample
from palpate._core import Status as Status
from palpate._core import __version__ as __version__
from palpate._headers import get_include as get_include
from palpate.errors import FleetError as FleetError
from palpate.errors import InvalidParameterError as InvalidParameterError
from palpate.errors import MissingChannelError as MissingChannelError
from palpate.errors import MissingExtraError as MissingExtraError
from palpate.errors import PalpateError as PalpateError
from palpate.errors import RecordingError as RecordingError
from palpate.findings import Finding as Finding
from palpate.fleet.arrays import identify_many as identify_many
from palpate.force_laws import FORCE_LAWS as FORCE_LAWS
from palpate.force_laws import ExtendedKelvinVoigt as ExtendedKelvinVoigt
from palpate.force_laws import FlatSpectrum as FlatSpectrum
from palpate.force_laws import ForceLaw as ForceLaw
from palpate.force_laws import GeneralisedHuntCrossley as GeneralisedHuntCrossley
from palpate.force_laws import HuntCrossley as HuntCrossley
from palpate.force_laws import KelvinVoigt as KelvinVoigt
from palpate.force_laws import PowerLawRelaxation as PowerLawRelaxation
from palpate.force_laws import RelaxationSpectrum as RelaxationSpectrum
from palpate.force_laws import SingleRelaxation as SingleRelaxation
from palpate.identification.diagnosis import Diagnosis as Diagnosis
from palpate.identification.diagnosis import Quantity as Quantity
from palpate.identification.diagnosis import Verdict as Verdict
from palpate.identification.diagnosis import WorkingDepth as WorkingDepth
from palpate.identification.quantities.derived import QueryOptions as QueryOptions
from palpate.identification.quantities.elastic_modulus import Cone as Cone
from palpate.identification.quantities.elastic_modulus import ElasticModulus as ElasticModulus
from palpate.identification.quantities.elastic_modulus import FlatPunch as FlatPunch
from palpate.identification.quantities.elastic_modulus import Pyramid as Pyramid
from palpate.identification.quantities.elastic_modulus import Sphere as Sphere
from palpate.identification.quantities.elastic_modulus import Tip as Tip
from palpate.identification.quantities.energy import EnergyLoss as EnergyLoss
from palpate.identification.quantities.energy import Passivity as Passivity
from palpate.identification.quantities.restitution import Restitution as Restitution
from palpate.identification.quantities.restitution import dissipation_for as dissipation_for
from palpate.identification.quantities.restitution import restitution as restitution
from palpate.identification.quantities.skew import Skew as Skew
from palpate.identification.quantities.skew import skew as skew
from palpate.identification.quantities.specimen import CompressionModulus as CompressionModulus
from palpate.identification.quantities.specimen import Specimen as Specimen
from palpate.identifying import Identification as Identification
from palpate.identifying import compare as compare
from palpate.identifying import diagnose as diagnose
from palpate.identifying import identify as identify
from palpate.input.channels import Columns as Columns
from palpate.input.preparation import choose_gate as choose_gate
from palpate.input.preparation import prepare as prepare
from palpate.input.preparation.online import OnlinePreparation as OnlinePreparation
from palpate.input.preparation.resolution import deviation_of_mean as deviation_of_mean
from palpate.input.recordings import Recording as Recording
from palpate.input.recordings import open_recording as open_recording
from palpate.input.recordings.table_files import write_contact as write_contact
from palpate.input.wrench import Payload as Payload
from palpate.input.wrench import PayloadCompensation as PayloadCompensation
from palpate.method.contact import Contact as Contact
from palpate.method.contact import Delay as Delay
from palpate.method.contact import VelocityFilter as VelocityFilter
from palpate.method.estimators import ESTIMATORS as ESTIMATORS
from palpate.method.estimators import ContactEstimator as ContactEstimator
from palpate.method.estimators import DoubleStageRLS as DoubleStageRLS
from palpate.method.estimators import DriftTracking as DriftTracking
from palpate.method.estimators import ExtendedKelvinVoigtRLS as ExtendedKelvinVoigtRLS
from palpate.method.estimators import KelvinVoigtRLS as KelvinVoigtRLS
from palpate.method.estimators import PythonEstimator as PythonEstimator
from palpate.method.estimators import (
    RecursiveLeastSquaresEstimator as RecursiveLeastSquaresEstimator,
)
from palpate.method.estimators import SingleStageRLS as SingleStageRLS
from palpate.method.estimators import VariableProjection as VariableProjection
from palpate.method.estimators import ViscoelasticContact as ViscoelasticContact
from palpate.method.estimators.batch_fit import CurveFits as CurveFits
from palpate.method.estimators.batch_fit import fit_curves as fit_curves
from palpate.method.estimators.estimate import Estimate as Estimate
from palpate.method.estimators.estimate import Trace as Trace
from palpate.method.estimators.law_verdicts import LawVerdict as LawVerdict
from palpate.method.estimators.least_squares import LeastSquares as LeastSquares
from palpate.method.estimators.least_squares import least_squares as least_squares
from palpate.method.estimators.least_squares import nonnegative as nonnegative
from palpate.method.settings import ChangeDetector as ChangeDetector
from palpate.method.settings import ConstantForgetting as ConstantForgetting
from palpate.method.settings import ContactGate as ContactGate
from palpate.method.settings import FadingForgetting as FadingForgetting
from palpate.method.settings import OutlierRejection as OutlierRejection
from palpate.method.settings import Scale as Scale
from palpate.method.settings import SelfPerturbation as SelfPerturbation
from palpate.output.results.saved import SavedResult as SavedResult
from palpate.output.results.saved import load_result as load_result

if _typing.TYPE_CHECKING:  # public modules, imported when they are used: they need extras or time
    from palpate import lab as lab
    from palpate.output import figures as figures
