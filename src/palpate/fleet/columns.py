"""The columns of a table of contacts: what each holds, and in which unit."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.fleet.at_depth import AT_DEPTH
from palpate.fleet.extras import needed
from palpate.fleet.settings import Settings

if TYPE_CHECKING:
    import pyarrow as pa

WHOLE, TEXT, TEXTS, NUMBER, NUMBERS = "int64", "string", "texts", "float64", "numbers"


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the table.

    Attributes
    ----------
    name, kind : str
        Its name, and what it holds.
    unit : str
        SI; empty where it has none.
    words : str
        What it is.
    """

    name: str
    kind: str
    unit: str
    words: str


def columns_of(settings: Settings) -> list[Column]:
    """Return the columns of a table that is made by these settings, in their order."""
    return [
        Column("source", TEXT, "", "the file, folder or array that the contact is from"),
        Column("index", WHOLE, "", "which contact of the source, from 0; null where it is one"),
        Column("part", WHOLE, "", "which place of a probe that travels, from 0; null of one place"),
        *(Column(axis, NUMBER, "m", f"where on the material, along {axis}") for axis in "xyz"),
        Column("method", TEXT, "", "the estimator"),
        Column("fit", TEXT, "", "recursion or whole-curve; null of a failure"),
        *_law(settings),
        Column("covariance", NUMBERS, "", "of the law's parameters, a row after another, SI"),
        Column("offset", NUMBER, "N", "force out of contact; NaN where it is not estimated"),
        Column("offset_standard_error", NUMBER, "N", "of the offset"),
        Column("surface", NUMBER, "m", "of the penetration; NaN where it is not estimated"),
        Column("surface_standard_error", NUMBER, "m", "of the surface"),
        Column("depth", NUMBER, "m", "working depth: median penetration below the surface"),
        Column("largest_depth", NUMBER, "m", "largest penetration below the surface, in contact"),
        *_at_depth(),
        Column("residual", NUMBER, "N", "standard deviation of what the law leaves of the force"),
        Column("samples", WHOLE, "", "of the contact"),
        Column("taken", WHOLE, "", "samples that the estimate is made of"),
        Column("flags", TEXTS, "", "what to know before trusting the numbers"),
        Column("checked", TEXT, "", "which checks were asked for: none, input or full"),
        Column("findings", TEXTS, "", "severity, check and sentence; null where none was made"),
        *(
            Column(f"verdict{name}", TEXT, "", f"{words}; null without a full diagnosis")
            for name, words in (
                ("", "trust, with-care or do-not-trust"),
                ("_stiffness", "the same of the stiffness at working depth"),
                ("_damping", "the same of the damping at working depth"),
            )
        ),
        Column("prepared", TEXT, "", "how each channel was made, as JSON; null of arrays"),
        Column("error", TEXT, "", "why there are no numbers; null where there are"),
        Column("error_kind", TEXT, "", "name of the error's class"),
        Column("version", TEXT, "", "of the palpate that made the row"),
        Column("settings", TEXT, "", "digest of the settings, which the file's notes hold"),
    ]


def _law(settings: Settings) -> list[Column]:
    found = []
    law = settings.law
    for name, unit in zip(law.names(), law.units, strict=True):
        found.append(Column(name, NUMBER, unit, f"{name} of the {law.kind} law"))
        found.append(Column(f"{name}_standard_error", NUMBER, unit, f"of the {name}"))
    return found


def _at_depth() -> list[Column]:
    found = []
    for name, unit in AT_DEPTH.items():
        words = f"{name} at working depth"
        found.append(Column(f"{name}_at_depth", NUMBER, unit, words))
        found.append(Column(f"{name}_at_depth_standard_error", NUMBER, unit, "what repeats"))
        moved = "what the findings would move; NaN without a full diagnosis"
        found.append(Column(f"{name}_at_depth_systematic", NUMBER, unit, moved))
    return found


def schema_of(settings: Settings) -> "pa.Schema":
    """Return the Arrow schema: unit and description of each column, settings of the whole."""
    pa = needed("pyarrow", "a table of contacts")
    kinds = {
        WHOLE: pa.int64(),
        TEXT: pa.string(),
        TEXTS: pa.list_(pa.string()),
        NUMBER: pa.float64(),
        NUMBERS: pa.list_(pa.float64()),
    }
    fields = [
        pa.field(
            each.name,
            kinds[each.kind],
            metadata={"unit": each.unit, "description": each.words}
            if each.unit
            else {"description": each.words},
        )
        for each in columns_of(settings)
    ]
    notes = {
        "palpate": settings.version,
        "settings": json.dumps(settings.plain(), sort_keys=True),
        "law": settings.law.kind,
    }
    return pa.schema(fields, metadata=notes)


def empty_columns(settings: Settings, count: int) -> dict[str, Any]:
    """Return columns of so many rows of which nothing is known but who made them."""
    nothing: dict[str, Any] = {}
    for each in columns_of(settings):
        nothing[each.name] = np.full(count, np.nan) if each.kind == NUMBER else [None] * count
    nothing["method"] = [settings.method] * count
    nothing["checked"] = [settings.diagnosis] * count
    nothing["version"] = [settings.version] * count
    nothing["settings"] = [settings.digest] * count
    return nothing


def table_of(columns: Mapping[str, Any], settings: Settings) -> "pa.Table":
    """Return columns as a table of the settings' schema."""
    pa = needed("pyarrow", "a table of contacts")
    schema = schema_of(settings)
    arrays = [pa.array(columns[field.name], type=field.type) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)


def table_of_rows(rows: Sequence[Mapping[str, Any]], settings: Settings) -> "pa.Table":
    """Return rows, of which each says what it knows, as a table of the settings' schema."""
    columns = empty_columns(settings, len(rows))
    for k, row in enumerate(rows):
        for name, value in row.items():
            columns[name][k] = value
    return table_of(columns, settings)
