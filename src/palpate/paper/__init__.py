"""The experiments of Haddadi & Hashtrudi-Zaad (2012), on the laboratory's rig."""

from palpate.paper.comparison.materials import COMPARISONS
from palpate.paper.condition.experiment import Condition
from palpate.paper.experiment import Claim, Experiment, Finding, Outcome, Table
from palpate.paper.forgetting.experiment import FORGETTING
from palpate.paper.hysteresis.experiment import HYSTERESIS
from palpate.paper.intermittent.experiment import INTERMITTENT
from palpate.paper.near_truth.experiment import NEAR_TRUTH
from palpate.paper.repetitions.experiment import Repetitions
from palpate.paper.richness.experiment import RICHNESS
from palpate.paper.trajectory import TrajectoryFollowed

__all__ = ["EXPERIMENTS", "Claim", "Experiment", "Finding", "Outcome", "Table"]

_ALL: tuple[Experiment, ...] = (
    TrajectoryFollowed(),
    *(Repetitions(name) for name in ("fig05", "fig11", "fig14")),
    *(Condition(name) for name in ("fig06", "fig12", "fig15")),
    *FORGETTING,
    *COMPARISONS,
    *NEAR_TRUTH,
    *HYSTERESIS,
    *RICHNESS,
    *INTERMITTENT,
)

#: By name, in the order of the paper.
EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment for experiment in sorted(_ALL, key=lambda each: each.name)
}
