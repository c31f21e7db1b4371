"""The experiments of Haddadi & Hashtrudi-Zaad (2012), repeated in simulation.

``trials``, ``methods``, ``motions`` and ``changes`` contain the experiments, ``claims.toml`` the
paper's claims about them, and ``judging.py`` the conditions under which a claim holds.
"""

from palpate.paper import changes, methods, motions, trials
from palpate.paper.experiment import Claim as Claim
from palpate.paper.experiment import Experiment as Experiment
from palpate.paper.experiment import Outcome as Outcome
from palpate.paper.experiment import Table as Table
from palpate.paper.judging import SeedAnswer as SeedAnswer

_MODULES = (trials, methods, motions, changes)
_ALL: list[Experiment] = [each for module in _MODULES for each in module.EXPERIMENTS]
#: By name, in the order of the paper.
EXPERIMENTS: dict[str, Experiment] = {
    each.name: each for each in sorted(_ALL, key=lambda e: e.name)
}
