"""The experiments of all chapters."""

from paper import changes, methods, motions, trials
from paper.experiment import Experiment

_MODULES = (trials, methods, motions, changes)
_ALL: list[Experiment] = [each for module in _MODULES for each in module.EXPERIMENTS]
#: By name, in the order of the paper.
EXPERIMENTS: dict[str, Experiment] = {
    each.name: each for each in sorted(_ALL, key=lambda e: e.name)
}
