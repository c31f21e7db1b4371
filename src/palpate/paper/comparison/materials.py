"""The comparison on each of the paper's three materials."""

from palpate.estimators import (
    DoubleStageRLS,
    ExtendedKelvinVoigtRLS,
    KelvinVoigtRLS,
    SingleStageRLS,
)
from palpate.paper.comparison.claims import BALL_CLAIMS, SPONGE_CLAIMS
from palpate.paper.comparison.experiment import Comparison
from palpate.paper.comparison.phantom_claims import PHANTOM_CLAIMS

COMPARISONS = (
    Comparison(
        "fig08",
        "Rubber ball: three starts, four methods, one recording (Tables I and II)",
        "ball",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS),
        BALL_CLAIMS,
    ),
    Comparison(
        "fig13",
        "Sponge: three starts, four methods, one recording (Tables III and IV)",
        "sponge",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS),
        SPONGE_CLAIMS,
        beside="relaxing-sponge",
    ),
    Comparison(
        "fig16",
        "PVC phantom: three starts, five methods, one recording (Tables V and VI)",
        "pvc",
        (SingleStageRLS, DoubleStageRLS, KelvinVoigtRLS, ExtendedKelvinVoigtRLS),
        PHANTOM_CLAIMS,
    ),
)
