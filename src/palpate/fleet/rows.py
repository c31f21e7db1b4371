"""Force, stiffness and damping of many Hunt–Crossley laws, each at its own working depth."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import palpate._core as _core
from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis import Data, Finding
from palpate.estimators.curves import CurveFits
from palpate.estimators.estimate import Estimate
from palpate.fleet.tasks import Settings, needed
from palpate.force_laws import ForceLaw
from palpate.identification.identified import Identified
from palpate.preparation.along_penetration import Place, at_places
from palpate.validation import Floats

if TYPE_CHECKING:
    import pyarrow as pa


Numbers = tuple[Floats, Floats]
#: At the working depth: what it is, and its unit.
AT_DEPTH = {"force": "N", "stiffness": "N/m", "damping": "N·s/m"}


def working_depths(
    penetration: Floats, force: Floats, fits: CurveFits, *, threads: int = 1
) -> Numbers:
    """Median and largest penetration of each row where contact is firm, m; NaN where it never is.

    Firm is what the gate of :func:`palpate.choose_gate` takes, at whose median
    :func:`palpate.identify` works: not what the law leaves decides, but the noise.

    Parameters
    ----------
    penetration : numpy.ndarray, shape (k, samples)
        m; counted from the surfaces of the fits here.
    force : numpy.ndarray, shape (k, samples)
        N.
    fits : CurveFits
        Of these rows.
    threads : int
        That share the rows.
    """
    found = np.empty((len(penetration), 2))
    _core.working_depths(penetration, force, fits.surface, found, threads)
    return found[:, 0].copy(), found[:, 1].copy()


@dataclass(frozen=True, slots=True, eq=False)
class LawsAtDepth:
    """Values and standard errors, SI, one a row.

    F = K xⁿ, S = n K xⁿ⁻¹, C = B xⁿ with x = X − d: at the place X where the probe was, so that
    what is not known of the surface d moves them as little as it moves the force there.
    """

    force: Numbers
    stiffness: Numbers
    damping: Numbers

    @classmethod
    def of(cls, fits: CurveFits, depth: Floats) -> "LawsAtDepth":
        """Return them for each fit at its own depth, m; NaN where that is."""
        with np.errstate(all="ignore"):
            k, c, n = fits.stiffness, fits.damping, fits.exponent
            power, log, none = depth**n, np.log(depth), np.zeros_like(depth)
            force, damping = k * power, c * power
            stiffness = n * force / depth
            bend = (n - 1.0) * stiffness / depth
            # By K, B, n, F₀ and d.
            of_force = [power, none, log * force, none, -stiffness]
            of_stiffness = [
                n * power / depth, none, (1.0 / n + log) * stiffness, none, -bend,
            ]  # fmt: skip
            of_damping = [none, power, log * damping, none, -n * damping / depth]
            return cls(
                (force, _error(of_force, fits)),
                (stiffness, _error(of_stiffness, fits)),
                (damping, _error(of_damping, fits)),
            )


def _error(gradient: list[Floats], fits: CurveFits) -> Floats:
    """√(gᵀ C g) of each row."""
    g = np.stack(gradient, axis=1)
    variance = np.einsum("ki,kij,kj->k", g, fits.covariance, g)
    found: Floats = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return found


# The columns of a table of contacts: what each holds, and in which unit.

WHOLE, TEXT, TEXTS, NUMBER, NUMBERS = "int64", "string", "texts", "float64", "numbers"


@dataclass(frozen=True, slots=True)
class TableColumn:
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


def columns_of(settings: Settings) -> list[TableColumn]:
    """Return the columns of a table that is made by these settings, in their order."""
    return [
        TableColumn("source", TEXT, "", "the file, folder or array that the contact is from"),
        TableColumn(
            "index", WHOLE, "", "which contact of the source, from 0; null where it is one"
        ),
        TableColumn(
            "part", WHOLE, "", "which place of a probe that travels, from 0; null of one place"
        ),
        *(TableColumn(axis, NUMBER, "m", f"where on the material, along {axis}") for axis in "xyz"),
        TableColumn("method", TEXT, "", "the estimator"),
        TableColumn("fit", TEXT, "", "recursion or whole-curve; null of a failure"),
        *_law(settings),
        TableColumn("covariance", NUMBERS, "", "of the law's parameters, a row after another, SI"),
        TableColumn("offset", NUMBER, "N", "force out of contact; NaN where it is not estimated"),
        TableColumn("offset_standard_error", NUMBER, "N", "of the offset"),
        TableColumn("surface", NUMBER, "m", "of the penetration; NaN where it is not estimated"),
        TableColumn("surface_standard_error", NUMBER, "m", "of the surface"),
        TableColumn("depth", NUMBER, "m", "working depth: median penetration below the surface"),
        TableColumn(
            "largest_depth", NUMBER, "m", "largest penetration below the surface, in contact"
        ),
        *_at_depth(),
        TableColumn(
            "residual", NUMBER, "N", "standard deviation of what the law leaves of the force"
        ),
        TableColumn("samples", WHOLE, "", "of the contact"),
        TableColumn("taken", WHOLE, "", "samples that the estimate is made of"),
        TableColumn("flags", TEXTS, "", "what to know before trusting the numbers"),
        TableColumn("checked", TEXT, "", "which checks were asked for: none, input or full"),
        TableColumn(
            "findings", TEXTS, "", "severity, check and sentence; null where none was made"
        ),
        *(
            TableColumn(f"verdict{name}", TEXT, "", f"{words}; null without a full diagnosis")
            for name, words in (
                ("", "trust, with-care or do-not-trust"),
                ("_stiffness", "the same of the stiffness at working depth"),
                ("_damping", "the same of the damping at working depth"),
            )
        ),
        TableColumn("prepared", TEXT, "", "how each channel was made, as JSON; null of arrays"),
        TableColumn("error", TEXT, "", "why there are no numbers; null where there are"),
        TableColumn("error_kind", TEXT, "", "name of the error's class"),
        TableColumn("version", TEXT, "", "of the palpate that made the row"),
        TableColumn("settings", TEXT, "", "digest of the settings, which the file's notes hold"),
    ]


def _law(settings: Settings) -> list[TableColumn]:
    found = []
    law = settings.law
    for name, unit in zip(law.names(), law.units, strict=True):
        found.append(TableColumn(name, NUMBER, unit, f"{name} of the {law.kind} law"))
        found.append(TableColumn(f"{name}_standard_error", NUMBER, unit, f"of the {name}"))
    return found


def _at_depth() -> list[TableColumn]:
    found = []
    for name, unit in AT_DEPTH.items():
        words = f"{name} at working depth"
        found.append(TableColumn(f"{name}_at_depth", NUMBER, unit, words))
        found.append(TableColumn(f"{name}_at_depth_standard_error", NUMBER, unit, "what repeats"))
        moved = "what the findings would move; NaN without a full diagnosis"
        found.append(TableColumn(f"{name}_at_depth_systematic", NUMBER, unit, moved))
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


# A contact, and what was identified of it, as a row of the table.

Row = dict[str, Any]


def rows_of(contact: Contact, settings: Settings) -> Iterator[Row]:
    """Identify a contact: a row, or one for each place of a probe that travels.

    Raises
    ------
    PalpateError
        It cannot be identified, and is of one place; a place that cannot is a row with its reason.
    """
    prepared = contact.prepared
    if prepared is None or not prepared.places:
        yield row_of(contact, settings)
        return
    for part, (place, there) in enumerate(at_places(contact)):
        row: Row = {"part": part, **_where(place)}
        try:
            row |= row_of(there, settings)
        except Exception as error:
            row |= failure(error)
        yield row


def row_of(contact: Contact, settings: Settings) -> Row:
    """Identify a contact of one place by the recursion.

    Raises
    ------
    PalpateError
        It cannot be identified.
    """
    data = Data(contact)
    result = Identified.of(data, settings.estimator_for(contact), trace=False)
    estimate, law = result.estimate, result.law
    row: Row = {"fit": "recursion", "samples": len(contact)}
    row |= _parameters(law, result.covariance)
    if estimate.offset_standard_error > 0.0:
        row |= {"offset": estimate.offset, "offset_standard_error": estimate.offset_standard_error}
    if estimate.surface_standard_error > 0.0:
        row["surface"] = estimate.surface
        row["surface_standard_error"] = estimate.surface_standard_error
    left = contact.force[result.trace.taken] - result.fitted_force[result.trace.taken]
    row["residual"] = float(np.sqrt(np.mean(left**2))) if left.size else math.nan
    row["taken"] = int(np.count_nonzero(result.trace.taken))
    row["largest_depth"] = result.largest_depth
    row["flags"] = list(result.flags)
    row["prepared"] = json.dumps(dict(contact.provenance), ensure_ascii=False)
    if settings.diagnosis == "full":
        return row | _diagnosed(result)
    if settings.diagnosis == "input":
        row["findings"] = [in_words(finding) for finding in data.findings]
    return row | (at_depth(law, result.covariance, result.depths[0]) if result.depths else {})


def failure(error: BaseException) -> Row:
    """Return what a row says of a contact that could not be identified."""
    words = " ".join(str(error).split()) or type(error).__name__
    return {"error": words, "error_kind": type(error).__name__}


def in_words(finding: Finding) -> str:
    """Return a finding in a line: severity, check, sentence."""
    return f"{finding.severity}: {finding.check}: {finding.sentence}"


def at_depth(law: ForceLaw, covariance: Floats, depth: float) -> Row:
    """Force, stiffness and damping at a depth, with errors by the delta method: √(gᵀ C g)."""
    known = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)
    with np.errstate(all="ignore"):
        values, errors = known.with_errors(
            lambda of: (of.force(depth, 0.0), of.stiffness_at(depth), of.damping_at(depth))
        )
    row: Row = {"depth": depth}
    for name, value, error in zip(AT_DEPTH, values.tolist(), errors.tolist(), strict=True):
        row |= {f"{name}_at_depth": value, f"{name}_at_depth_standard_error": error}
    return row


def place_in_notes(notes: Mapping[str, str]) -> Row:
    """Where an instrument says that a curve was taken: its stage's position, m."""
    row: Row = {}
    for axis in "xy":
        with suppress(ValueError, IndexError, KeyError):
            number, *unit = notes[f"position {axis}"].split()
            if unit == ["m"]:
                row[axis] = float(number)
    return row


def _where(place: Place) -> Row:
    return dict(zip("xyz", place.position.tolist(), strict=True))


def _parameters(law: ForceLaw, covariance: Floats) -> Row:
    row: Row = {"covariance": covariance.reshape(-1).tolist()}
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(covariance))
    parts = zip(law.names(), law.parameters.tolist(), errors.tolist(), strict=True)
    for name, value, error in parts:
        row |= {name: value, f"{name}_standard_error": error}
    return row


def _diagnosed(result: Identified) -> Row:
    found = result.diagnosis
    there, marks = found.working_depth, found.verdict
    row: Row = {
        "depth": there.depth,
        "findings": [in_words(finding) for finding in found.findings],
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
