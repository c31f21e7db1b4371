"""What goes to standard output: one JSON object, or a table."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from palpate.identification import Identification

AsJson = Annotated[bool, Parameter(name="--json", negative="")]


def print_json(whole: dict[str, Any]) -> None:
    """Print one JSON object on a line of its own."""
    print(json.dumps(whole, ensure_ascii=False, allow_nan=False))


def print_identifications(
    file: Path, results: "list[Identification]", figure: Path | None, *, as_json: bool
) -> None:
    """Print what a file gave, as a table or as one JSON object."""
    if as_json:
        print_json(_as_dict(file, results))
        return
    from palpate.cli.tables import print_results

    print_results(results)
    if figure is not None:
        print(f"figure: {figure}")


def _as_dict(file: Path, results: "list[Identification]") -> dict[str, Any]:
    first = results[0]
    gate, scale, contact = first.gate, first.scale, first.contact
    return {
        "file": str(file),
        "samples": len(contact),
        "made": dict(contact.made),
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
