"""The rows of a table of contacts: their columns, and their values at working depth."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis import Data
from palpate.estimators.estimate import Estimate
from palpate.findings import Finding
from palpate.fleet.tasks import Settings, Table, needed
from palpate.force_laws import ForceLaw
from palpate.identification.identified import Identified
from palpate.preparation.along_penetration import at_places
from palpate.validation import Floats

Row = dict[str, Any]
#: Quantities at working depth and their units.
AT_DEPTH = {"force": "N", "stiffness": "N/m", "damping": "N·s/m"}


def schema_of(settings: Settings) -> Any:
    """Return the schema of a table: type, unit and description of each column, and the settings."""
    pa = needed("pyarrow", "a table of contacts")
    whole, text, number = pa.int64(), pa.string(), pa.float64()
    texts, numbers = pa.list_(text), pa.list_(number)
    law = settings.law
    columns = [
        ("source", text, "", "the file, folder or array that the contact is from"),
        ("index", whole, "", "number of the contact in the source, from 0; null if single"),
        ("part", whole, "", "number of the place of a travelling probe, from 0; null otherwise"),
        *((axis, number, "m", f"position on the material along {axis}") for axis in "xyz"),
        ("method", text, "", "the estimator"),
        ("fit", text, "", "recursion or whole-curve; null after a failure"),
    ]
    for name, unit in zip(law.names(), law.units, strict=True):
        columns.append((name, number, unit, f"{name} of the {law.kind} law"))
        columns.append((f"{name}_standard_error", number, unit, f"standard error of the {name}"))
    if law.relaxes:
        columns.append(("law", text, "", "the law with its relaxation times, as JSON"))
    columns += [
        ("covariance", numbers, "", "of the law's parameters, row by row, SI"),
        ("offset", number, "N", "force out of contact; NaN if not estimated"),
        ("offset_standard_error", number, "N", "standard error of the offset"),
        ("surface", number, "m", "penetration at the surface; NaN if not estimated"),
        ("surface_standard_error", number, "m", "standard error of the surface"),
        ("depth", number, "m", "working depth: median penetration below the surface"),
        ("largest_depth", number, "m", "largest penetration below the surface, in contact"),
    ]
    for name, unit in AT_DEPTH.items():
        moved = "systematic uncertainty; NaN without a full diagnosis"
        columns.append((f"{name}_at_depth", number, unit, f"{name} at working depth"))
        columns.append((f"{name}_at_depth_standard_error", number, unit, "statistical uncertainty"))
        columns.append((f"{name}_at_depth_systematic", number, unit, moved))
    columns += [
        ("residual", number, "N", "standard deviation of the force minus the fitted force"),
        ("samples", whole, "", "number of samples of the contact"),
        ("taken", whole, "", "number of samples used by the estimate"),
        ("flags", texts, "", "warnings about the estimate"),
        ("checked", text, "", "which checks were requested: none, input or full"),
        ("findings", texts, "", "severity, check and message; null if nothing was checked"),
    ]
    for name, words in (
        ("verdict", "trust, with-care or do-not-trust"),
        ("verdict_stiffness", "the same for the stiffness at working depth"),
        ("verdict_damping", "the same for the damping at working depth"),
    ):
        columns.append((name, text, "", f"{words}; null without a full diagnosis"))
    columns += [
        ("prepared", text, "", "how each channel was prepared, as JSON; null for arrays"),
        ("error", text, "", "why the row has no numbers; null if it has"),
        ("error_kind", text, "", "name of the error's class"),
        ("version", text, "", "version of palpate that wrote the row"),
        ("settings", text, "", "digest of the settings, which are in the file's metadata"),
    ]
    fields = [
        pa.field(name, kind, metadata={**({"unit": unit} if unit else {}), "description": words})
        for name, kind, unit, words in columns
    ]
    notes = {
        "palpate": settings.version,
        "settings": json.dumps(settings.plain(), sort_keys=True),
        "law": law.kind,
    }
    return pa.schema(fields, metadata=notes)


def table_of(columns: Mapping[str, Any], count: int, settings: Settings) -> Table:
    """Return columns as a table of the settings' schema; absent columns are NaN or null."""
    pa = needed("pyarrow", "a table of contacts")
    schema = schema_of(settings)
    nothing = _nothing(schema, settings)
    arrays = [
        pa.array(columns.get(name, [nothing[name]] * count), type=schema.field(name).type)
        for name in schema.names
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def table_of_rows(rows: Sequence[Mapping[str, Any]], settings: Settings) -> Table:
    """Return rows as a table of the settings' schema; absent values are NaN or null."""
    pa = needed("pyarrow", "a table of contacts")
    schema = schema_of(settings)
    nothing = _nothing(schema, settings)
    return pa.Table.from_pylist([{**nothing, **row} for row in rows], schema=schema)


def _nothing(schema: Any, settings: Settings) -> Row:
    """Return a row without values, except how it was made."""
    unknown = {each.name: math.nan if each.type == "double" else None for each in schema}
    made = {"method": settings.method, "checked": settings.diagnosis, "version": settings.version}
    return {**unknown, **made, "settings": settings.digest}


# A contact's identification as a row of the table.


def rows_of(contact: Contact, settings: Settings) -> Iterator[Row]:
    """Identify a contact: yield one row, or one per place where the probe travels.

    Raises
    ------
    PalpateError
        A contact at one place cannot be identified. One of several places that cannot be is a row
        with its error.
    """
    prepared = contact.prepared
    if prepared is None or not prepared.places:
        yield row_of(contact, settings)
        return
    rejecting = settings.estimator_for(contact).rejects_outliers
    for part, (place, there) in enumerate(at_places(contact, rejecting=rejecting)):
        row: Row = {"part": part, **dict(zip("xyz", place.position.tolist(), strict=True))}
        try:
            row |= row_of(there, settings)
        except Exception as error:
            row |= failure(error)
        yield row


def row_of(contact: Contact, settings: Settings) -> Row:
    """Identify a contact at one place by the recursive estimator.

    Raises
    ------
    PalpateError
        It cannot be identified.
    """
    result = Identified.of(Data(contact), settings.estimator_for(contact), trace=False)
    contact, data = result.contact, result.data
    assert data is not None
    estimate, law = result.estimate, result.law
    row: Row = {"fit": "recursion", "samples": len(contact)}
    if not contact.timeless:  # that of the spring is not of the table's law
        row["covariance"] = result.covariance.reshape(-1).tolist()
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(result.covariance)).tolist()
    for name, value, error in zip(law.names(), law.parameters.tolist(), errors, strict=True):
        row |= {name: value, f"{name}_standard_error": error}
    if law.relaxes:
        row["law"] = json.dumps(law.description())
    for name in ("offset", "surface"):
        if (error := getattr(estimate, f"{name}_standard_error")) > 0.0:
            row |= {name: getattr(estimate, name), f"{name}_standard_error": error}
    left = contact.force[result.trace.taken] - result.fitted_force[result.trace.taken]
    row["residual"] = float(np.sqrt(np.mean(left**2))) if left.size else math.nan
    row["taken"] = int(np.count_nonzero(result.trace.taken))
    row["largest_depth"] = result.largest_depth
    row["flags"] = list(result.flags)
    row["prepared"] = json.dumps(dict(contact.provenance), ensure_ascii=False)
    if settings.diagnosis == "full":
        return row | _diagnosed(result)
    if settings.diagnosis == "input":
        row["findings"] = [format_finding(finding) for finding in data.findings]
    return row | (at_depth(law, result.covariance, result.depths[0]) if result.depths else {})


def failure(error: Exception) -> Row:
    """Return the columns of a contact that could not be identified: message and class."""
    words = " ".join(str(error).split()) or type(error).__name__
    return {"error": words, "error_kind": type(error).__name__}


def format_finding(finding: Finding) -> str:
    """Return a finding in one line: severity, check and message."""
    return f"{finding.severity}: {finding.check}: {finding.message}"


def at_depth(law: ForceLaw, covariance: Floats, depth: float) -> Row:
    """Return force, stiffness and damping at a depth; errors by the delta method: √(gᵀ C g)."""
    known = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)
    with np.errstate(all="ignore"):
        values, errors = known.with_errors(lambda of: of.at_rest(depth))
    row: Row = {"depth": depth}
    for name, value, error in zip(AT_DEPTH, values.tolist(), errors.tolist(), strict=True):
        row |= {f"{name}_at_depth": value, f"{name}_at_depth_standard_error": error}
    return row


def place_in_notes(notes: Mapping[str, str]) -> Row:
    """Return the stage's position, m, that the instrument recorded with a force curve."""
    row: Row = {}
    for axis in "xy":
        with suppress(ValueError, IndexError, KeyError):
            number, *unit = notes[f"position {axis}"].split()
            if unit == ["m"]:
                row[axis] = float(number)
    return row


def _diagnosed(result: Identified) -> Row:
    found = result.diagnosis
    there, marks = found.working_depth, found.verdict
    row: Row = {
        "depth": there.depth,
        "findings": [format_finding(finding) for finding in found.findings],
        "verdict": marks.overall,
        "verdict_stiffness": marks.stiffness,
        "verdict_damping": marks.damping,
    }
    for name in AT_DEPTH:
        quantity = getattr(there, name)
        row[f"{name}_at_depth"] = quantity.value
        row[f"{name}_at_depth_standard_error"] = quantity.standard_error
        row[f"{name}_at_depth_systematic"] = quantity.systematic
    return row
