"""Contact force laws, for identification and for the simulated laboratory."""

from palpate.force_laws.generalised import GeneralisedHuntCrossley as GeneralisedHuntCrossley
from palpate.force_laws.laws import FORCE_LAWS as FORCE_LAWS
from palpate.force_laws.laws import ExtendedKelvinVoigt as ExtendedKelvinVoigt
from palpate.force_laws.laws import Floats as Floats
from palpate.force_laws.laws import ForceLaw as ForceLaw
from palpate.force_laws.laws import HuntCrossley as HuntCrossley
from palpate.force_laws.laws import KelvinVoigt as KelvinVoigt
from palpate.force_laws.laws import law_from as law_from
from palpate.force_laws.laws import register as register
from palpate.force_laws.relaxation import FlatSpectrum as FlatSpectrum
from palpate.force_laws.relaxation import PowerLawRelaxation as PowerLawRelaxation
from palpate.force_laws.relaxation import Relaxation as Relaxation
from palpate.force_laws.relaxation import RelaxationSpectrum as RelaxationSpectrum
from palpate.force_laws.relaxation import RelaxationState as RelaxationState
from palpate.force_laws.relaxation import SingleRelaxation as SingleRelaxation
from palpate.force_laws.relaxation import steps_over_breaks as steps_over_breaks
