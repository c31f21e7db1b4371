"""CSV files for tests, written by the tests themselves."""

from collections.abc import Iterable, Sequence
from pathlib import Path

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
