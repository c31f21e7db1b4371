"""Outcomes on disk: one small JSON file each, and which code it was made by."""

import dataclasses
import hashlib
import json
import math
import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import palpate
from palpate import _core
from palpate.paper.experiment import Experiment, Finding, Outcome, Table
from palpate.writing import write_text

# A pixel of a figure is a thousandth of its width; more digits make a heavy file that looks alike.
DIGITS_DRAWN = 6
DIGITS_KEPT = 9


def path_of(folder: Path, name: str, seed: int) -> Path:
    """Where the outcome of an experiment and a seed lies."""
    return folder / "outcomes" / f"{name}-seed{seed}.json"


def as_text(experiment: Experiment, outcome: Outcome) -> str:
    """Return an outcome as JSON; what is not finite is null."""
    whole = {
        "experiment": experiment.name,
        "made_by": fingerprint(experiment),
        "seed": outcome.seed,
        "numbers": plain(outcome.numbers),
        "curves": plain(outcome.curves, DIGITS_DRAWN),
        "findings": {
            key: plain(dataclasses.asdict(finding)) for key, finding in outcome.findings.items()
        },
    }
    return json.dumps(whole, ensure_ascii=False, allow_nan=False) + "\n"


def from_text(text: str) -> Outcome:
    """Return the outcome that :func:`as_text` wrote; null is NaN, but for what nobody measured."""
    whole = json.loads(text)
    return Outcome(
        whole["seed"],
        _known(whole["numbers"]),
        _known(whole["curves"]),
        {key: Finding(**finding) for key, finding in whole["findings"].items()},
    )


def write(folder: Path, name: str, seed: int, text: str) -> None:
    """Write an outcome's text, whole or not at all."""
    write_text(path_of(folder, name, seed), text)


def read(folder: Path, experiment: Experiment, seed: int) -> Outcome | None:
    """Return an outcome written earlier by the same code; None where there is none."""
    try:
        text = path_of(folder, experiment.name, seed).read_text(encoding="utf-8")
        if json.loads(text)["made_by"] == fingerprint(experiment):
            return from_text(text)
    except (OSError, ValueError, KeyError, TypeError):
        pass  # absent or damaged: it is made anew
    return None


def figures_of(folder: Path, name: str) -> tuple[Path, Path]:
    """Where an experiment's figure lies, for a light and for a dark background."""
    return folder / f"{name}.svg", folder / f"{name}-dark.svg"


def write_tables(
    folder: Path, experiment: Experiment, seeds: int, tables: tuple[Table, ...]
) -> None:
    """Write down an experiment's tables, once its figure is drawn."""
    whole = {
        "experiment": experiment.name,
        "made_by": fingerprint(experiment),
        "seeds": seeds,
        "tables": [dataclasses.asdict(table) for table in tables],
    }
    text = json.dumps(whole, ensure_ascii=False)
    write_text(_tables_of(folder, experiment.name), text + "\n")


def read_tables(folder: Path, experiment: Experiment, seeds: int) -> tuple[Table, ...] | None:
    """Return the tables written earlier, where the figure is there too; None else."""
    try:
        whole = json.loads(_tables_of(folder, experiment.name).read_text(encoding="utf-8"))
        drawn = all(path.is_file() for path in figures_of(folder, experiment.name))
        if drawn and (whole["made_by"], whole["seeds"]) == (fingerprint(experiment), seeds):
            return tuple(
                Table(
                    table["title"],
                    tuple(table["header"]),
                    tuple(tuple(row) for row in table["rows"]),
                    table["note"],
                )
                for table in whole["tables"]
            )
    except (OSError, ValueError, KeyError, TypeError):
        pass  # absent or damaged: it is drawn anew
    return None


def _tables_of(folder: Path, name: str) -> Path:
    return folder / "outcomes" / f"{name}-tables.json"


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of what the numbers depend on."""
    names = ("palpate", "numpy", "scipy", "mujoco", "matplotlib")
    return {"Python": platform.python_version()} | {name: version(name) for name in names}


def fingerprint(experiment: Experiment) -> str:
    """Return a hash of palpate's code, the experiment's module, the versions and the machine."""
    module = sys.modules[type(experiment).__module__].__file__
    return _fingerprint(module)


@cache
def _fingerprint(module: str | None) -> str:
    root = Path(str(palpate.__file__)).parent
    sources = sorted(root.rglob("*.py"), key=lambda path: path.relative_to(root).as_posix())
    code = [*sources, Path(str(_core.__file__)), *([Path(module)] if module else [])]
    found = hashlib.sha256()
    for path in code:
        found.update(path.read_bytes())
    found.update(repr((sorted(versions().items()), platform.machine())).encode())
    return found.hexdigest()[:16]


def plain(value: Any, digits: int = DIGITS_KEPT) -> Any:
    """Return a value as JSON takes it: floats rounded, None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(key): plain(each, digits) for key, each in value.items()}
    if hasattr(value, "tolist"):  # NumPy's arrays and scalars
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(each, digits) for each in value]
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    return value


def _known(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _known(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_known(each) for each in value]
    return math.nan if value is None else value
