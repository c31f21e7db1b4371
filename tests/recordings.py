"""CSV files for tests, written by the tests themselves."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest
from cases import MATERIALS, Signals, exciting

HEADER = ("time_s", "penetration_m", "force_N")
SIGNALS = exciting(MATERIALS["ball"], seconds=0.6, noise=0.02, seed=1)


def rows_of(signals: Signals = SIGNALS) -> list[list[str]]:
    """Time, penetration and force, whole: every float comes back as it was."""
    columns = (each.tolist() for each in (signals.time, signals.penetration, signals.force))
    return [[repr(value) for value in row] for row in zip(*columns, strict=True)]


def text_of(
    rows: Iterable[Sequence[str]], header: Sequence[str] = HEADER, delimiter: str = ","
) -> str:
    return "".join(delimiter.join(row) + "\n" for row in [header, *rows])


def written(path: Path, content: str | bytes) -> Path:
    if isinstance(content, str):
        content = content.encode()
    path.write_bytes(content)
    return path


def recording(folder: Path, name: str = "probe.csv") -> Path:
    """A good recording of 600 samples."""
    return written(folder / name, text_of(rows_of()))


def changed(row: int, column: int, value: str) -> str:
    """The good file with one cell changed; row 0 is the first sample, on line 2."""
    rows = rows_of()
    rows[row][column] = value
    return text_of(rows)


# Recordings made by others, beside the checkout or in PALPATE_DATA.

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
FOLDER = Path(os.environ.get("PALPATE_DATA", BESIDE))
ABSENT = pytest.param(
    None,
    marks=pytest.mark.skip(reason="no recordings beside the checkout, and PALPATE_DATA is not set"),
    id="absent",
)


def files(*patterns: str) -> list:
    found = sorted(path for pattern in patterns for path in FOLDER.glob(pattern))
    return [pytest.param(path, id=path.stem) for path in found] or [ABSENT]


def has_penetration(path: Path) -> bool:
    """Not that of a robot, which travels."""
    with path.open() as lines:
        return "penetration_m" in next(lines).strip().split(",")
