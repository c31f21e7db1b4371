"""Write what is generated: pages of the reference, and the message of an estimate.

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
from palpate.findings import LOOP_CHECKS
from palpate.fleet.rows import table_schema
from palpate.fleet.tasks import Settings
from palpate.input.recordings.opening import FORMATS
from palpate.input.recordings.units import TORQUE_UNITS, UNITS, WEIGHTS
from palpate.live.choices import State
from palpate.live.schema import (
    ESTIMATE_FIELDS,
    FIXED,
    MARK_LEVELS,
    SCHEMA,
    STATUS_FIELDS,
    PublishedField,
    message_definition,
)
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
            "bytes, or as JSON: [wires](wires.md). What goes out: "
            "[what is published](wires.md#what-is-published).",
            "",
        ),
        "A recorded run": (
            "`palpate live --record` writes MCAP with these ROS messages.",
            _messages(),
        ),
    }
    parts = ["# Units and formats", WRITTEN]
    for title, (introduction, content) in sections.items():
        parts += [f"## {title}", introduction, *([content] if content else [])]
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


_BEGIN, _END = f"{WRITTEN}\n\n", "\n\n<!-- end of what is written -->"


def wires() -> str:
    """Return the page of the wires with the tables of the published fields."""
    before, _, rest = (REFERENCE / "wires.md").read_text(encoding="utf-8").partition(_BEGIN)
    introduction = (
        f"Schema {SCHEMA}. An `estimate` goes out for every sample. The binary one, little-endian "
        f"and without gaps, has {FIXED.size} bytes and the texts: each a length (uint32), UTF-8, a "
        "zero, which the length counts, and zeros to a multiple of four."
    )
    status = (
        "A `status` goes out five times a second. It has the fields of the last estimate, except "
        "that `state` is a word and each parameter has its own name, and:"
    )
    tables = [introduction, _published(ESTIMATE_FIELDS), status, _published(STATUS_FIELDS)]
    return before + _BEGIN + "\n\n".join(tables) + _END + rest.partition(_END)[2]


def _published(fields: Iterable[PublishedField]) -> str:
    rows = ((f"`{field.name}`", field.kind, field.meaning) for field in fields)
    return _table(("field", "type", ""), rows)


def packet() -> str:
    """Return the C++ header of an estimate's packet."""
    kinds = {"float64": "double", "bool": "std::uint8_t"}

    def declare(field: PublishedField) -> str:
        kind, bracket, size = field.kind.partition("[")
        return f"  {kinds.get(kind, f'std::{kind}_t')} {field.name}{bracket}{size};"

    def listing(pairs: Iterable[tuple[str, int]]) -> str:
        return ", ".join(f"{re.sub('[ -]', '_', name)} = {value}" for name, value in pairs)

    checks = listing((str(check), bit) for bit, check in LOOP_CHECKS.items())
    states = listing((state.name.lower(), state.value) for state in State)
    marks = listing([("not_diagnosed", -1), *MARK_LEVELS.items()])
    return "\n".join(
        [
            "// An estimate of palpate on the wire. What each field is: docs/reference/wires.md",
            "// Written by python docs/write_reference.py.",
            "// clang-format off",
            "#pragma once",
            "",
            "#include <cstdint>",
            "",
            "namespace palpate_wire {",
            "",
            f"constexpr std::uint32_t schema = {SCHEMA};",
            f"enum Check : std::uint32_t {{ {checks} }};",
            f"enum State : std::uint8_t {{ {states} }};",
            f"enum Mark : std::int8_t {{ {marks} }};",
            "",
            "#pragma pack(push, 1)",
            "struct Estimate {  // texts follow",
            *(declare(field) for field in ESTIMATE_FIELDS if field.kind != "string"),
            "};",
            "#pragma pack(pop)",
            f"static_assert(sizeof(Estimate) == {FIXED.size - 3});",
            "",
            "}  // namespace palpate_wire",
            "// clang-format on",
            "",
        ]
    )


def _messages() -> str:
    folder = files("palpate.live") / "messages"
    blocks = []
    recorded = ("Estimate.msg", "Measurement.msg", "MeasurementInSpace.msg")
    for message in map(folder.joinpath, recorded):
        own = message.read_text(encoding="utf-8").partition("=====")[0].strip()
        blocks.append(f"`{message.name}`:\n\n```text\n{own}\n```")
    return "\n\n".join(blocks)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


ROOT = Path(__file__).parents[1]
#: What is written, by its path.
WRITERS = {
    "docs/reference/commands.md": commands,
    "docs/reference/formats.md": formats,
    "docs/reference/wires.md": wires,
    "ros/palpate_msgs/msg/ContactEstimate.msg": message_definition,
    "examples/cpp/estimate_packet.hpp": packet,
}


def main() -> None:
    """Write them."""
    for name, text in WRITERS.items():
        (ROOT / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
