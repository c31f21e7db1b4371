"""Contact force laws: what the lab is built from, and what identification gives back."""

from palpate.force_laws.laws import (
    FORCE_LAWS,
    ExtendedKelvinVoigt,
    Floats,
    ForceLaw,
    HuntCrossley,
    KelvinVoigt,
    law_from,
    register,
)

from palpate.force_laws.along import force_over_breaks  # isort: skip
from palpate.force_laws.generalised import GeneralisedHuntCrossley  # isort: skip
from palpate.force_laws.relaxation import (  # isort: skip
    FlatSpectrum,
    PowerLawRelaxation,
    Relaxation,
    RelaxationState,
    SingleRelaxation,
)

__all__ = [
    "FORCE_LAWS",
    "ExtendedKelvinVoigt",
    "FlatSpectrum",
    "Floats",
    "ForceLaw",
    "GeneralisedHuntCrossley",
    "HuntCrossley",
    "KelvinVoigt",
    "PowerLawRelaxation",
    "Relaxation",
    "RelaxationState",
    "SingleRelaxation",
    "force_over_breaks",
    "law_from",
    "register",
]
