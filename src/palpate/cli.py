"""The command line: parse, call, print.

Everything that takes time to import is imported by the command that needs it.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from palpate.cli_design import design
from palpate.cli_lab import lab
from palpate.cli_paper import paper

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.identification import Identification

app = App(
    name="palpate",
    help="Identify what a probe touches: contact models from penetration, velocity and force.",
    help_format="plaintext",
    version_flags=["--version"],
)
app.command(design)
app.command(lab)
app.command(paper)


@Parameter(name="*")
@dataclass(frozen=True)
class Reading:
    """How a file is read, and which of its samples are used."""

    time: str = "time_s"
    "Column of the time, s."
    penetration: str = "penetration_m"
    "Column of the penetration, m, positive inside the material."
    force: str = "force_N"
    "Column of the force, N, compression positive."
    velocity: str = "velocity_m_s"
    "Column of the velocity, m/s; where the file has none it is worked out from the penetration."
    start: float | None = None
    "Use samples from this time on, s."
    stop: float | None = None
    "Use samples up to this time, s."
    min_penetration: float | None = None
    "Contact is deeper than this, m; chosen from the data unless given."
    min_force: float | None = None
    "Contact is firmer than this, N; chosen from the data unless given."
    velocity_window: float | None = None
    "Length of the velocity filter, s; 15 samples but at most 15 ms unless given."

    def contact(self, file: Path) -> "Contact":
        """Read the file and cut the time window."""
        from palpate.errors import MissingChannelError, RecordingError
        from palpate.preparation import Columns, prepare

        columns = Columns(self.time, self.penetration, self.force, self.velocity)
        try:
            contact = prepare(file, columns=columns, velocity_window=self.velocity_window)
        except MissingChannelError as error:
            hint = "map other names with --time, --penetration, --force, --velocity"
            raise RecordingError(f"{error} ({hint})") from None
        if self.start is None and self.stop is None:
            return contact
        return contact.window(self.start, self.stop)

    def gate(self, contact: "Contact") -> Any:
        """Return the gate asked for; what is not asked for is chosen from the data."""
        from palpate.preparation import choose_gate

        return choose_gate(
            contact, minimum_penetration=self.min_penetration, minimum_force=self.min_force
        )


@app.command
def identify(
    file: Path,
    /,
    *,
    method: str = "variable-projection",
    figure: Path | None = None,
    dark: bool = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    reading: Reading | None = None,
) -> None:
    """Identify the contact model of a recording.

    Parameters
    ----------
    file
        CSV with a header and, unless named otherwise, columns time_s, penetration_m, force_N and
        optionally velocity_m_s and segment.
    method
        variable-projection, single-stage, double-stage, kelvin-voigt or extended-kelvin-voigt.
    figure
        Draw it to this file (.svg, .pdf or .png).
    dark
        Draw on a dark background.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.estimators import estimator_named
    from palpate.identification import identify as run

    reading = reading or Reading()
    kind = estimator_named(method)
    contact = reading.contact(file)
    result = run(contact, kind(**{"gate": reading.gate(contact)}))
    if figure is not None:
        from palpate import figures

        figures.save(figures.draw(result, dark=dark), figure)
    _print(file, [result], figure, as_json=as_json)


@app.command
def compare(
    file: Path,
    /,
    *,
    figure: Path | None = None,
    dark: bool = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    reading: Reading | None = None,
) -> None:
    """Identify a recording with every method, side by side.

    Parameters
    ----------
    file
        CSV with a header and, unless named otherwise, columns time_s, penetration_m, force_N and
        optionally velocity_m_s and segment.
    figure
        Draw it to this file (.svg, .pdf or .png).
    dark
        Draw on a dark background.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.identification import compare as run

    reading = reading or Reading()
    contact = reading.contact(file)
    results = run(contact, gate=reading.gate(contact))
    if figure is not None:
        from palpate import figures

        figures.save(figures.draw_comparison(results, dark=dark), figure)
    _print(file, list(results.values()), figure, as_json=as_json)


def _print(
    file: Path, results: "list[Identification]", figure: Path | None, *, as_json: bool
) -> None:
    if as_json:
        print(json.dumps(_as_dict(file, results), ensure_ascii=False, allow_nan=False))
        return
    from palpate.report import print_results

    print_results(results)
    if figure is not None:
        print(f"figure: {figure}")


def _as_dict(file: Path, results: "list[Identification]") -> dict[str, Any]:
    first = results[0]
    gate, scale, contact = first.gate, first.scale, first.contact
    return {
        "file": str(file),
        "samples": len(contact),
        "provenance": dict(contact.provenance),
        "gate": {
            "minimum_penetration": gate.minimum_penetration,
            "make_force": gate.make_force,
            "break_force": gate.break_force,
        },
        "scale": {
            "penetration": scale.penetration,
            "velocity": scale.velocity,
            "force": scale.force,
        },
        "results": [result.as_dict() for result in results],
    }


def main() -> None:
    """Run the command line; an error is one line on standard error and exit status 2."""
    from palpate.errors import PalpateError

    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False, result_action="return_value")
    except (PalpateError, CycloptsError) as error:
        print(f"palpate: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader of our output is gone; there is nobody left to tell.
        sys.stderr.close()
        sys.exit(141)
