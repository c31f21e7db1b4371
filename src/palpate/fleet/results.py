"""The folder of a fleet's results: one file of Parquet a batch, each whole or not there."""

import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.errors import FleetError, RecordingError
from palpate.fleet.extras import needed
from palpate.fleet.settings import Settings
from palpate.fleet.tasks import Batch, Source, digest_of
from palpate.validation import Floats
from palpate.writing import make_folder, write_bytes, write_text

if TYPE_CHECKING:
    import pyarrow as pa

MANIFEST = "_fleet.json"
#: Beside the results, and not among them: two runs differ in nothing else.
TIMES = "_seconds"
REPORT = "report.html"
_PART = re.compile(r"part-(\d{6,})\.parquet")


@dataclass(frozen=True, slots=True)
class Results:
    """A folder for the results of one fleet.

    Attributes
    ----------
    folder : Path
        Where they are.
    settings : Settings
        They are made by.
    batches : tuple of Batch
        That they are of.
    """

    folder: Path
    settings: Settings
    batches: tuple[Batch, ...]

    @classmethod
    def begin(
        cls,
        folder: Path,
        settings: Settings,
        sources: Sequence[Source],
        batches: Sequence[Batch],
    ) -> "Results":
        """Make the folder, or go on with what a run of the same settings and sources left there.

        Raises
        ------
        FleetError
            It holds what another run left, or something else.
        RecordingError
            It cannot be made or written to.
        """
        make_folder(folder)
        wanted = {
            "palpate": settings.version,
            "settings": settings.plain(),
            "sources": digest_of(sources),
            "contacts": sum(batch.contacts for batch in batches),
            "batches": len(batches),
        }
        path = folder / MANIFEST
        if path.exists():
            _check_same(folder, _manifest(folder), wanted)
        else:
            _check_empty(folder)
            write_text(path, json.dumps(wanted, ensure_ascii=False, indent=1) + "\n")
        make_folder(folder / TIMES)
        return cls(folder, settings, tuple(batches))

    def waiting(self) -> list[Batch]:
        """The batches that are not there yet."""
        there = {int(found[1]) for each in _names(self.folder) if (found := _PART.fullmatch(each))}
        return [batch for batch in self.batches if batch.number not in there]

    def error_kinds(self) -> list[str | None]:
        """Why rows that are there have no numbers; None of one that has.

        Raises
        ------
        FleetError
            They cannot be read.
        """
        kinds: list[str | None] = []
        if _parts(self.folder):
            kinds = _joined(self.folder, self.folder, ["error_kind"])["error_kind"].to_pylist()
        return kinds

    def write(self, batch: Batch, table: "pa.Table", seconds: Floats) -> None:
        """Write the rows of a batch, whole or not at all; its times first.

        Raises
        ------
        RecordingError
            They cannot be written.
        """
        pa = needed("pyarrow", "a table of contacts")
        times = pa.table({"source": table["source"], "index": table["index"], "seconds": seconds})
        write_bytes(self.folder / TIMES / _name(batch), as_parquet(times))
        write_bytes(self.folder / _name(batch), as_parquet(table))


def as_parquet(table: "pa.Table") -> bytes:
    """Return a table as a file of Parquet: the same table, the same bytes."""
    parquet = needed("pyarrow.parquet", "a table of contacts")
    written = io.BytesIO()
    parquet.write_table(table, written, compression="zstd")
    return written.getvalue()


def read_results(folder: Path) -> "pa.Table":
    """Read the rows of a fleet, in the order of its sources.

    Raises
    ------
    FleetError
        The folder holds no results, or not all.
    """
    about = _manifest(folder)
    table = _joined(folder, folder)
    missing = about["batches"] - len(_parts(folder))
    if missing:
        raise FleetError(
            f"{folder}: {missing} of {about['batches']} batches are missing; the command that made "
            "the others goes on with them"
        )
    return table


def read_seconds(folder: Path) -> "pa.Table":
    """Read how long each row took: ``source``, ``index`` and ``seconds``."""
    return _joined(folder, folder / TIMES)


def manifest_of(folder: Path) -> dict[str, Any]:
    """Return what a fleet's folder says of the run that made it.

    Raises
    ------
    FleetError
        It holds no results of a fleet.
    """
    return _manifest(folder)


def _joined(folder: Path, place: Path, columns: list[str] | None = None) -> "pa.Table":
    pa = needed("pyarrow", "a table of contacts")
    parquet = needed("pyarrow.parquet", "a table of contacts")
    parts = _parts(place)
    if not parts:
        raise FleetError(f"{folder}: holds no results yet")
    try:
        return pa.concat_tables([parquet.read_table(part, columns=columns) for part in parts])
    except (OSError, pa.ArrowException) as error:
        words = " ".join(str(error).split())
        raise FleetError(f"{folder}: cannot be read: {words}") from None


def _parts(folder: Path) -> list[Path]:
    return [folder / name for name in sorted(_names(folder)) if _PART.fullmatch(name)]


def _name(batch: Batch) -> str:
    return f"part-{batch.number:06d}.parquet"


def _names(folder: Path) -> list[str]:
    try:
        return [path.name for path in folder.iterdir()]
    except OSError as error:
        raise RecordingError(f"{folder}: {error.strerror or error}") from None


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not {"palpate", "settings", "sources", "batches", "contacts"} <= set(found):
            raise ValueError("it lacks what palpate writes")
    except FileNotFoundError:
        raise FleetError(
            f"{folder}: holds no results of palpate fleet; name the folder that it wrote"
        ) from None
    except (OSError, ValueError, TypeError) as error:
        raise FleetError(f"{path}: cannot be read: {error}; choose another folder") from None
    return dict(found)


def _check_same(folder: Path, there: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse a folder of another run, by what differs first."""
    differs = _difference(there, wanted)
    if differs:
        raise FleetError(
            f"{folder}: holds the results of a run with {differs}; choose another folder, or "
            "remove this one"
        )


def _difference(there: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    if there["palpate"] != wanted["palpate"]:
        return f"palpate {there['palpate']}, and this is {wanted['palpate']}"
    before, now = there["settings"], wanted["settings"]
    for name in sorted({*before, *now}):
        if before.get(name) != now.get(name):
            return f"{name} {_shown(before.get(name))}, and this asks {_shown(now.get(name))}"
    if (there["sources"], there["batches"]) != (wanted["sources"], wanted["batches"]):
        return (
            f"{there['contacts']} contacts in {there['batches']} batches of other sources, or of "
            "these before they were changed"
        )
    return ""


def _shown(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _check_empty(folder: Path) -> None:
    for name in sorted(_names(folder)):
        if not name.startswith("."):
            raise FleetError(
                f"{folder}: holds {name}, which is of no run of palpate fleet; choose another "
                "folder"
            )
