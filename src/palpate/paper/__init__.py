"""The experiments of Haddadi & Hashtrudi-Zaad (2012), on the laboratory's rig.

A module ``fig*.py`` holds one, or several that differ in the material alone, and ``today.py`` what
its authors would see today; ``causes.py`` tries the reasons that the paper gives, each by itself.
``claims.toml`` has what the paper says of each, and ``judges`` when that holds.
"""

import pkgutil
from importlib import import_module

from palpate.paper.experiment import Claim, Experiment, Outcome, Table
from palpate.paper.judging import Finding

__all__ = ["EXPERIMENTS", "Claim", "Experiment", "Finding", "Outcome", "Table"]

_NAMES = [each.name for each in pkgutil.iter_modules(__path__)]
_MODULES = [name for name in _NAMES if name.startswith("fig") or name == "today"]
_ALL: list[Experiment] = [
    experiment
    for name in _MODULES
    for experiment in import_module(f"{__name__}.{name}").EXPERIMENTS
]

#: By name, in the order of the paper.
EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment for experiment in sorted(_ALL, key=lambda each: each.name)
}
