"""A result on disk: report, numbers, trace and options, each file whole or not at all."""

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from palpate._core import __version__
from palpate.errors import MissingExtraError
from palpate.figures.style import LIGHT, style
from palpate.identification import Identified
from palpate.recordings.columns import has_parquet, write_columns
from palpate.reports.html import GENERATOR
from palpate.reports.identification import Circumstances, page
from palpate.results.columns import in_file, trace_columns
from palpate.results.description import described
from palpate.results.loading import RESULT, TRACES, digest_of
from palpate.results.toml import as_toml, how_made
from palpate.stages import timed
from palpate.writing import check_own, check_writable, make_folder, write_text

REPORT, OPTIONS = "report.html", "run.toml"
_PACKAGES = ("numpy", "matplotlib", "pyarrow")


@dataclass(frozen=True, slots=True)
class Destination:
    """A folder for a result, of which was checked that it can be written to.

    Parameters
    ----------
    folder : Path
        It is made, with those above it, where it is not there.
    inputs : sequence of Path
        Files that must not be written over.

    Raises
    ------
    RecordingError
        The folder cannot be made or written to, or one of the files would replace an input or a
        file that is none of palpate's.
    MissingExtraError
        matplotlib, which the report needs, is not installed.
    """

    folder: Path
    inputs: Sequence[Path] = ()
    trace: str = field(init=False, default_factory=lambda: TRACES[not has_parquet()])

    def __post_init__(self) -> None:
        try:
            style(LIGHT)
        except MissingExtraError:
            raise MissingExtraError(
                "a report needs matplotlib: pip install 'palpate[report]'"
            ) from None
        make_folder(self.folder)
        for name in self.names:
            check_writable(self.folder / name, self.inputs)
        check_own(self.folder, self.names, lambda _: _has_a_result(self.folder))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the files, in the order in which they are written: the result's own is the last."""
        return (REPORT, self.trace, OPTIONS, RESULT)

    @timed("report")
    def save(
        self,
        result: Identified,
        *,
        options: Mapping[str, Any] | None = None,
        compared: Mapping[str, Identified] | None = None,
    ) -> None:
        """Write a result.

        Parameters
        ----------
        result : Identification
            What was identified.
        options : mapping, optional
            Of the command line that repeats it; the method unless given.
        compared : mapping, optional
            Every method on the same contact, for the report.
        """
        files = list(self.inputs)
        given = {"method": result.method} if options is None else options
        run = as_toml(given, how_made(result.contact, files))
        columns = in_file(trace_columns(result))
        whole = {**described(files, [result]), "trace": self.trace}
        circumstances = Circumstances(
            made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            command=self._command(files if options is None else files or [Path("-")]),
            options=run,
            files=self.names[1:],
            versions=_versions(),
        )
        write_text(self.folder / REPORT, page(result, circumstances, compared), self.inputs)
        notes = {"made by": f"palpate {__version__}", "source": result.contact.source}
        write_columns(
            columns.columns,
            self.folder / self.trace,
            units=columns.units,
            notes=notes,
            inputs=self.inputs,
        )
        write_text(self.folder / OPTIONS, run, self.inputs)
        whole["trace_digest"] = digest_of(self.folder / self.trace)
        text = json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1)
        write_text(self.folder / RESULT, text + "\n", self.inputs)

    def _command(self, files: Sequence[Path]) -> str:
        if not files:
            return f"palpate.load_result({str(self.folder)!r})  # identified in Python"
        config = self.folder / OPTIONS
        words = ["palpate", "identify", *map(str, files), "--config", str(config)]
        return shlex.join([*words, "-o", str(self.folder)])


def _has_a_result(folder: Path) -> bool:
    """Whether palpate wrote a result there, or the page of one before it was interrupted."""
    marks = {RESULT: '"palpate_version"', REPORT: GENERATOR}
    there = {name: mark for name, mark in marks.items() if (folder / name).is_file()}
    return any(mark.encode() in (folder / name).read_bytes() for name, mark in there.items())


def _versions() -> dict[str, str]:
    found = {"Python": ".".join(map(str, sys.version_info[:3])), "palpate": __version__}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
