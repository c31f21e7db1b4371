"""When each claim of ``claims.toml`` holds, by the numbers that its experiment measures."""

from collections.abc import Mapping

from palpate.paper.judges.changes import INTERMITTENT
from palpate.paper.judges.methods import (
    COMPARED_ON_BALL,
    COMPARED_ON_PHANTOM,
    COMPARED_ON_SPONGE,
    FORGETTING,
    NEAR_TRUTH,
)
from palpate.paper.judges.motions import (
    CONDITION_ON_PHANTOM,
    CONDITION_ON_SPONGE,
    FOLLOWED,
    NEAR_SURFACE,
    PHANTOM_REPEATED,
    RICHNESS,
    RICHNESS_FOR_KELVIN_VOIGT,
    holds_from,
    repetitions,
)
from palpate.paper.judging import Judge, at_most, judge

#: By experiment and key.
JUDGES: Mapping[str, Mapping[str, Judge]] = {
    "fig03": FOLLOWED,
    "fig05": repetitions("ball"),
    "fig06": {
        "holds": judge("broken after that ball", at_most(0.0)),
        "from": holds_from("ball", 90.0),
    },
    "fig07": FORGETTING,
    "fig08": COMPARED_ON_BALL,
    "fig09": NEAR_TRUTH,
    "fig10": NEAR_SURFACE,
    "fig11": repetitions("sponge"),
    "fig12": CONDITION_ON_SPONGE,
    "fig13": COMPARED_ON_SPONGE,
    "fig14": PHANTOM_REPEATED,
    "fig15": CONDITION_ON_PHANTOM,
    "fig16": COMPARED_ON_PHANTOM,
    "fig17": RICHNESS,
    "fig18": RICHNESS_FOR_KELVIN_VOIGT,
    "fig19": INTERMITTENT,
    "today": {},
}
