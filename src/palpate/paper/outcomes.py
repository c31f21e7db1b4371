"""Outcomes and figures on disk, and whether they can be reused."""

import hashlib
import json
import math
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import palpate
from palpate import _core
from palpate.paper.experiment import Experiment, Outcome
from palpate.writing import write_text

# What judges and reports measures nothing: a claim is reworded and judged anew without a run.
_NOT_MEASURING = (
    "cli",
    "paper/judges",
    "paper/judging.py",
    "paper/quantities.py",
    "paper/report",
    "reports",
)


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of what the numbers depend on."""
    names = ("palpate", "numpy", "scipy", "mujoco", "matplotlib")
    return {"Python": platform.python_version()} | {name: version(name) for name in names}


@cache
def code() -> str:
    """Return a hash of the code that measures, for a checkout changes without its version."""
    root = Path(str(palpate.__file__)).parent
    files = {path.relative_to(root).as_posix(): path for path in root.rglob("*.py")}
    found = hashlib.sha256(Path(str(_core.__file__)).read_bytes())
    for name in sorted(files):
        if not name.startswith(_NOT_MEASURING):
            found.update(files[name].read_bytes())
    return found.hexdigest()[:16]


def provenance(experiment: Experiment) -> dict[str, Any]:
    """Return what has to match for an outcome to be reused: versions, machine and settings."""
    versions_and_code = {**versions(), "code": code(), "machine": platform.machine()}
    return {"versions": versions_and_code, "settings": repr(experiment)}


def path_of(folder: Path, name: str, seed: int) -> Path:
    """Where the outcome of an experiment and a seed lies."""
    return folder / "outcomes" / f"{name}-seed{seed}.json"


def write(folder: Path, experiment: Experiment, outcome: Outcome) -> None:
    """Write an outcome, whole or not at all; what is not finite is null."""
    whole = {
        "experiment": experiment.name,
        "provenance": provenance(experiment),
        "seed": outcome.seed,
        "numbers": {name: _or_null(value) for name, value in outcome.numbers.items()},
        "curves": {name: [_or_null(v) for v in curve] for name, curve in outcome.curves.items()},
    }
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False)
    write_text(path_of(folder, experiment.name, outcome.seed), text + "\n")


def read(folder: Path, experiment: Experiment, seed: int) -> Outcome | None:
    """Return an outcome written earlier by the same versions and settings; None else."""
    try:
        path = path_of(folder, experiment.name, seed)
        whole = json.loads(path.read_text(encoding="utf-8"))
        if (whole["provenance"], whole["seed"]) == (provenance(experiment), seed):
            numbers = {name: _or_nan(value) for name, value in whole["numbers"].items()}
            curves = {name: [_or_nan(v) for v in curve] for name, curve in whole["curves"].items()}
            return Outcome(seed, numbers, curves)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass  # absent or damaged: it is made anew
    return None


def figures_of(folder: Path, name: str) -> tuple[Path, Path]:
    """Where an experiment's figure lies, for a light and for a dark background."""
    return folder / f"{name}.svg", folder / f"{name}-dark.svg"


def write_figures(
    folder: Path, experiment: Experiment, seeds: int, drawings: tuple[str, str]
) -> None:
    """Write an experiment's figure for both backgrounds, with a remark what it is of."""
    for path, drawing in zip(figures_of(folder, experiment.name), drawings, strict=True):
        write_text(path, drawing + _remark(experiment, seeds))


def figures_are_current(folder: Path, experiment: Experiment, seeds: int) -> bool:
    """Whether both figures are there, of as many seeds by the same versions and settings."""
    remark = _remark(experiment, seeds)
    try:
        paths = figures_of(folder, experiment.name)
        return all(path.read_text(encoding="utf-8").endswith(remark) for path in paths)
    except (OSError, ValueError):
        return False


def _remark(experiment: Experiment, seeds: int) -> str:
    made = hashlib.sha256(repr(provenance(experiment)).encode()).hexdigest()[:16]
    return f"<!-- {seeds} seeds, {made} -->\n"


def _or_null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
