"""Write the pages of the reference that are generated: the command line, and the formats.

python docs/write_reference.py
"""

import json
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any
from unittest.mock import patch

import palpate
from palpate import control_loops
from palpate.cli.application import application
from palpate.fleet.rows import table_schema
from palpate.fleet.tasks import Settings
from palpate.input.recordings.opening import FORMATS
from palpate.input.recordings.units import TORQUE_UNITS, UNITS, WEIGHTS
from palpate.live.wires import SCHEMA, Fields
from palpate.live.zeromq import LENGTHS
from palpate.output.results.saved import SCHEMA_VERSION, describe_contact

REFERENCE = Path(__file__).parent / "reference"
BALL = Path(__file__).parents[1] / "examples" / "recordings" / "ball.csv"
WRITTEN = "<!-- written by python docs/write_reference.py -->"


def commands() -> str:
    """Return the page of the command line: what its help prints, as cyclopts writes it."""
    with patch.object(sys, "argv", ["palpate"]):  # from which cyclopts takes the program's name
        text = application().generate_docs(output_format="markdown")
    start = text.index("Identify what a probe touches")
    without_contents = re.sub(
        r"## Table of Contents\n.*?(?=\*\*Commands)", "", text[start:], flags=re.S
    )
    # An anchor is the heading in lower case, with a hyphen for each blank and its own hyphens.
    linked = without_contents.replace("(#palpate-install", "(#palpate---install")
    lines = [line.rstrip() for line in linked.splitlines()]
    question = "Which options does a command take? `palpate identify --help` prints the same."
    return "\n".join(["# Command line", "", WRITTEN, "", question, "", *lines]).rstrip() + "\n"


def formats() -> str:
    """Return the page of units and formats."""
    sections = {
        "Units": (
            "Which units may a channel have, by its name, its file or `--unit`? Results are in SI.",
            _units(),
        ),
        "Files": (
            "palpate recognises a file by its first bytes, then by its ending. How each is read: "
            "[recordings](files.md).",
            _files(),
        ),
        "A result as JSON": (
            f"`result.json` and `--json`, `schema_version` {SCHEMA_VERSION}, for a simulated ball. "
            "What the fields mean: [results](results.md#the-json-object).",
            _table(("field", "type there"), _fields(_result())),
        ),
        "Gains as JSON": (
            "`palpate gains --json`, for admittance control on this ball, SI; frequencies in "
            "rad/s. Numbers that are not known are null, and so is `recommended` where `refusal` "
            "is not. What they mean: [which gains](../how-to/gains.md).",
            _table(("field", "type there"), _fields(_gains())),
        ),
        "A row of a fleet": (
            "The columns of [`palpate fleet`](../how-to/many-contacts.md), with `--tip`. Unknown "
            "values are NaN, or null where the column is no number.",
            _table(("column", "type", "unit", ""), _columns()),
        ),
        "On the wire": (
            f"A sample comes as a packet of {', '.join(map(str, LENGTHS[:-1]))} or {LENGTHS[-1]} "
            f"bytes, or as JSON: [wires](wires.md). An estimate goes out with these numbers, in "
            f"this order, all of them float64; the status has `schema` {SCHEMA}. The parameters "
            "are those of the default law.",
            _wire(),
        ),
        "A recorded run": (
            "`palpate live --record` writes MCAP with these ROS messages.",
            _messages(),
        ),
    }
    parts = ["# Units and formats", WRITTEN]
    for title, (introduction, content) in sections.items():
        parts += [f"## {title}", introduction, content]
    return "\n\n".join(parts) + "\n"


def _units() -> str:
    kinds = {**UNITS, "force, as a mass": WEIGHTS, "torque": TORQUE_UNITS}
    rows = ((kind, " ".join(f"`{unit}`" for unit in units)) for kind, units in kinds.items())
    return _table(("quantity", "units"), rows)


def _files() -> str:
    rows = []
    for form in FORMATS:
        endings = " ".join(f"`{suffix}`" for suffix in form.suffixes)
        what = f"needs the extra `{form.extra}`" if form.extra else form.remedy and "not read"
        rows.append((form.name, endings, what))
    return _table(("format", "endings", ""), rows)


def _result() -> dict[str, Any]:
    return json.loads(json.dumps(describe_contact([BALL], [palpate.identify(BALL)])))


def _gains() -> dict[str, Any]:
    loop = control_loops.AdmittanceControl(
        virtual_mass=2.0,
        virtual_damping=30.0,
        mass=10.0,
        sample_rate=500.0,
        delay=4e-3,
        bandwidth=60.0,
        force_filter=100.0,
        wanted_force=10.0,
        approach_speed=0.02,
    )
    return json.loads(json.dumps(palpate.gains(palpate.identify(BALL), loop).as_dict()))


def _fields(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the fields of an object with their types; of a list, those of its first element."""
    if isinstance(value, dict) and value and path != _OF_THE_RECORDING:
        for name, each in value.items():
            yield from _fields(each, f"{path}.{name}" if path else name)
    elif isinstance(value, list) and value:
        yield from _fields(value[0], f"{path}[]")
    else:
        yield f"`{path}`", _TYPES[type(value)]


_OF_THE_RECORDING = "provenance"  # its fields are the recording's own notes
_TYPES = {
    dict: "object", list: "array", str: "string", bool: "boolean", int: "number",
    float: "number", type(None): "null",
}  # fmt: skip


def _columns() -> Iterator[Sequence[str]]:
    schema = table_schema(Settings(tip=palpate.Sphere(radius=5e-3)))
    for field in schema:
        notes = {key.decode(): text.decode() for key, text in field.metadata.items()}
        kind = re.sub(r"<.*", "", str(field.type))
        yield f"`{field.name}`", kind, notes.get("unit", ""), notes["description"]


def _wire() -> str:
    names = Fields(0, palpate.GeneralisedHuntCrossley.names(), 0).names
    return _table(("", "number"), ((str(k), f"`{name}`") for k, name in enumerate(names)))


def _messages() -> str:
    folder = files("palpate.live") / "messages"
    blocks = []
    for message in sorted(folder.iterdir(), key=lambda path: path.name):
        own = message.read_text(encoding="utf-8").partition("=====")[0].strip()
        blocks.append(f"`{message.name}`:\n\n```text\n{own}\n```")
    return "\n\n".join(blocks)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


PAGES = {"commands.md": commands, "formats.md": formats}


def main() -> None:
    """Write them."""
    for name, text in PAGES.items():
        (REFERENCE / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
