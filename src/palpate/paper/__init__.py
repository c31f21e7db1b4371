"""The experiments of Haddadi & Hashtrudi-Zaad (2012), on the laboratory's rig."""

from palpate.paper.condition import Condition
from palpate.paper.experiment import Claim, Experiment, Finding, Outcome, Table
from palpate.paper.repetitions import Repetitions
from palpate.paper.trajectory import TrajectoryFollowed

__all__ = ["EXPERIMENTS", "Claim", "Experiment", "Finding", "Outcome", "Table"]

#: By name, in the order of the paper.
EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        TrajectoryFollowed(),
        Repetitions("fig05"),
        Condition("fig06"),
        Repetitions("fig11"),
        Condition("fig12"),
        Repetitions("fig14"),
        Condition("fig15"),
    )
}
