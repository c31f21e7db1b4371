"""The rows of a table of contacts: their columns, and their values at working depth."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from palpate._core import Status
from palpate.errors import NoContactError, RecordingError
from palpate.findings import Finding
from palpate.fleet.tasks import Settings, Table, needed
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley, HuntCrossley
from palpate.identification.diagnosis import Quantity
from palpate.identification.quantities import indentation
from palpate.identification.quantities.elastic_modulus import ElasticModulus
from palpate.identifying import Identification, identify
from palpate.input.preparation.delay import find_delay
from palpate.input.preparation.places import divide_by_place
from palpate.method.contact import Contact
from palpate.method.estimators.estimate import Estimate
from palpate.validation import Floats

Row = dict[str, Any]
_Column = tuple[str, Any, str, str]  # name, type, unit and meaning
_FINDING = "severity", "check", "message", "remedy", "stiffness", "damping"
#: Quantities at working depth and their units.
AT_DEPTH = {"force": "N", "stiffness": "N/m", "damping": "N·s/m"}


def table_schema(settings: Settings) -> Any:
    """Return the schema of a table: type, unit and description of each column, and the settings."""
    pa = needed("pyarrow", "a table of contacts")
    whole = pa.int64()
    text = pa.string()
    number = pa.float64()
    numbers = pa.list_(number)
    found = pa.list_(pa.struct([(part, text) for part in _FINDING]))
    law = settings.law

    def with_errors(name: str, unit: str, meaning: str, systematic: str = "") -> list[_Column]:
        """Return the columns of a number and of its errors."""
        columns = [
            (name, number, unit, meaning),
            (f"{name}_standard_error", number, unit, "statistical uncertainty"),
            (f"{name}_systematic", number, unit, systematic),
        ]
        return columns if systematic else columns[:2]

    columns = [
        ("source", text, "", "the file, folder or array that the contact is from"),
        ("index", whole, "", "number of the contact in the source, from 0; null if single"),
        ("part", whole, "", "number of the place of a travelling probe, from 0; null otherwise"),
        *((axis, number, "m", f"position on the material along {axis}") for axis in "xyz"),
        ("method", text, "", "the estimator"),
        ("fit", text, "", "recursion, whole-curve or approach; null after a failure"),
    ]
    for name, unit in zip(law.names(), law.units, strict=True):
        columns += with_errors(name, unit, f"{name} of the {law.kind} law")
    if law.relaxes:
        columns.append(("law", text, "", "the law with its relaxation times, as JSON"))
    columns += [
        ("law_name", text, "", "the law, such as hunt-crossley or half-space with relaxation"),
        ("covariance", numbers, "", "of the law's parameters, row by row, SI"),
        *with_errors("offset", "N", "force out of contact; NaN if not estimated"),
        *with_errors("surface", "m", "penetration at the surface; NaN if not estimated"),
        ("depth", number, "m", "working depth: median penetration below the surface"),
        ("largest_depth", number, "m", "largest penetration below the surface, in contact"),
        ("frequency", number, "rad/s", "of the motion; stiffness and damping at depth are for it"),
    ]
    for name, unit in AT_DEPTH.items():
        moved = "systematic uncertainty; NaN without a full diagnosis"
        columns += with_errors(name, unit, f"{name} at working depth", moved)
    if law.relaxes:
        meaning = "after relaxation; NaN where nothing relaxes"
        columns += with_errors("relaxed_stiffness", "N/m", meaning)
    if settings.tip is not None:
        meaning = "Young's modulus for the stated tip"
        columns += with_errors("modulus", "Pa", meaning, "systematic uncertainty")
        columns.append(("verdict_modulus", text, "", "trust, with-care or do-not-trust"))
    columns += [
        ("residual", number, "N", "standard deviation of the force minus the fitted force"),
        ("samples", whole, "", "number of samples of the contact"),
        ("rate", number, "Hz", "samples per second"),
        ("contact_fraction", number, "", "samples in contact over all; NaN without free air"),
        ("largest_force", number, "N", "largest force in contact"),
        *with_errors("force_delay", "s", "delay by which Hunt-Crossley fits best, of an episode"),
        ("taken", whole, "", "number of samples used by the estimate"),
        ("flags", found, "", "warnings about the estimate"),
        ("checked", text, "", "which checks were requested: none, input or full"),
        ("findings", found, "", "problems of data and fit; null if nothing was checked"),
    ]
    for name in ("stiffness", "damping"):
        words = f"mark of the {name} at working depth; null without a full diagnosis"
        columns.append((f"verdict_{name}", text, "", words))
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


def build_table(columns: Mapping[str, Any], count: int, settings: Settings) -> Table:
    """Return columns as a table of the settings' schema; absent columns are NaN or null."""
    pa = needed("pyarrow", "a table of contacts")
    schema = table_schema(settings)
    empty = _empty_row(schema, settings)
    arrays = [
        pa.array(columns.get(name, [empty[name]] * count), type=schema.field(name).type)
        for name in schema.names
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def table_of_rows(rows: Sequence[Mapping[str, Any]], settings: Settings) -> Table:
    """Return rows as a table of the settings' schema; absent values are NaN or null."""
    pa = needed("pyarrow", "a table of contacts")
    schema = table_schema(settings)
    empty = _empty_row(schema, settings)
    return pa.Table.from_pylist([{**empty, **row} for row in rows], schema=schema)


def _empty_row(schema: Any, settings: Settings) -> Row:
    """Return a row without results, with the columns that describe the run."""
    unknown = {each.name: math.nan if each.type == "double" else None for each in schema}
    run = {"method": settings.method, "checked": settings.diagnosis, "version": settings.version}
    return {**unknown, **run, "settings": settings.digest}


# A contact's identification as a row of the table.


def identify_rows(
    contact: Contact,
    settings: Settings,
    *,
    columns: type[ForceLaw] | None = None,
) -> Iterator[Row]:
    """Identify a contact: yield one row, or one per place if the probe travels.

    Parameters
    ----------
    contact : Contact
        The contact.
    settings : Settings
        The settings of the identification.
    columns : type of ForceLaw, optional
        The law of the table's columns. Default: the law of the settings.

    Raises
    ------
    PalpateError
        A contact at one place cannot be identified. If the contact has several places, a failing
        place is a row with its error instead.
    """
    prepared = contact.prepared
    if prepared is None or not prepared.places:
        yield identify_row(contact, settings, columns=columns)
        return
    rejecting = settings.estimator_for(contact).rejects_outliers
    for part, (place, contact_there) in enumerate(divide_by_place(contact, rejecting=rejecting)):
        row: Row = {"part": part, **dict(zip("xyz", place.position.tolist(), strict=True))}
        try:
            row |= identify_row(contact_there, settings, columns=columns)
        except Exception as error:
            row |= failure(error)
        yield row


def identify_row(
    contact: Contact,
    settings: Settings,
    *,
    columns: type[ForceLaw] | None = None,
) -> Row:
    """Identify a contact at one place with the recursive estimator; see :func:`identify_rows`.

    Raises
    ------
    PalpateError
        It cannot be identified.
    """
    result = identify(contact, settings.estimator_for(contact), trace=False)
    row = _law_columns(result, columns or settings.law)
    row |= _sample_columns(result)
    if settings.tip is not None and result.depths:
        row |= _modulus_columns(result.elastic_modulus(settings.tip, settings.poisson_ratio))
    if settings.diagnosis == "full":
        return row | _delay_columns(result.contact) | _diagnosis_columns(result)
    if settings.diagnosis == "input" and result.data is not None:
        row["findings"] = [finding_cell(finding) for finding in result.data.findings]
    if result.law.remembers:  # the selection of this law has diagnosed it
        return row | _working_depth_columns(result, systematic=False)
    if not result.depths:
        return row
    law, covariance = _in_columns(result, columns or settings.law)
    return row | values_for_depth(law, covariance, result.depths[0])


def _law_columns(result: Identification, columns: type[ForceLaw]) -> Row:
    """Return the law with its errors in the columns of a table, and what belongs to the law."""
    row: Row = {"fit": "recursion", "method": result.method, "law_name": law_name(result)}
    row["frequency"] = result.frequency
    law, covariance = _in_columns(result, columns)
    if not result.contact.timeless:  # the spring's covariance does not belong to the table's law
        row["covariance"] = covariance.reshape(-1).tolist()
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(covariance)).tolist()
    for name, value, error in zip(law.names(), law.parameters.tolist(), errors, strict=True):
        row |= {name: value, f"{name}_standard_error": error}
    if law.relaxes:
        row["law"] = json.dumps(law.description())
    if law.remembers and result.depths:
        relaxed = result.relaxed_stiffness()
        row["relaxed_stiffness"] = relaxed.value
        row["relaxed_stiffness_standard_error"] = relaxed.standard_error
    for name in ("offset", "surface"):
        if (error := getattr(result.estimate, f"{name}_standard_error")) > 0.0:
            row |= {name: getattr(result.estimate, name), f"{name}_standard_error": error}
    return row


def _in_columns(result: Identification, columns: type[ForceLaw]) -> tuple[ForceLaw, Floats]:
    """Return law and covariance; in a table of the generalised law a power law is one of these."""
    law: ForceLaw = result.law
    if columns is not GeneralisedHuntCrossley or law.powers is None:
        return law, result.covariance
    to_columns = power_law_derivatives(type(law))
    covariance: Floats = to_columns @ result.covariance @ to_columns.T
    return GeneralisedHuntCrossley.of(law), covariance


def _sample_columns(result: Identification) -> Row:
    """Return the columns on the samples, their fit and their preparation."""
    contact = result.contact
    taken = result.trace.taken
    residual = contact.force[taken] - result.fitted_force[taken]
    count = int(np.count_nonzero(taken))
    row: Row = {
        "samples": len(contact),
        "residual": float(np.sqrt(np.mean(residual**2))) if residual.size else math.nan,
        "taken": count,
        "largest_depth": result.largest_depth,
        "largest_force": float(np.max(contact.force[taken], initial=0.0)),
        "rate": 1.0 / contact.sample_time,
        "flags": [finding_cell(finding) for finding in result.findings],
        "prepared": json.dumps(dict(contact.provenance), ensure_ascii=False),
    }
    if contact.tare_deviation is not None:  # without free air the surface is an assumption
        row["contact_fraction"] = count / len(contact)
    return row


def power_law_derivatives(law: type[ForceLaw]) -> Floats:
    """Derivatives of the generalised law's five parameters with respect to a power law's."""
    names = law.names()
    like = {"p": "n", **{name: name for name in names}}
    columns = GeneralisedHuntCrossley.names()
    derivatives = np.zeros((len(columns), len(names)))
    for k, name in enumerate(columns):
        if (source := like.get(name)) in names:
            derivatives[k, names.index(source)] = 1.0
    return derivatives


def law_name(result: Identification) -> str:
    """Return the name of the selected law, or the kind of an identified law."""
    estimator = result.estimator
    return str(estimator.candidate) if estimator.chooses_law else str(result.law.kind)


def failure(error: Exception) -> Row:
    """Return the columns for a contact that could not be identified: message and class."""
    words = " ".join(str(error).split()) or type(error).__name__
    return {"error": words, "error_kind": type(error).__name__}


def touches_nothing(table: Table) -> list[bool]:
    """Return for each row whether its recording is in free air from begin to end."""
    kinds = table.column("error_kind").to_pylist()
    return [kind == NoContactError.__name__ for kind in kinds]


def finding_cell(finding: Finding) -> dict[str, str | None]:
    """Return a finding as a value of the columns ``flags`` and ``findings``."""
    return {name: getattr(finding, name) for name in _FINDING}


def indentation_row(found: indentation.Indentation, settings: Settings) -> Row:
    """Return the columns for the approach of a force curve; it has no damping."""
    depth = found.depth
    law = settings.law.names()
    row: Row = {
        "fit": "approach",
        "law_name": HuntCrossley.kind,
        "K": found.K.value,
        "K_standard_error": found.K.standard_error,
        "offset": found.baseline[0],
        "surface": found.contact_point.value,
        "surface_standard_error": found.contact_point.whole_error,
        "depth": depth,
        "largest_depth": found.largest_depth,
        "residual": found.residual,
        "samples": found.samples,
        "taken": found.taken,
        "flags": [],
        "findings": [finding_cell(finding) for finding in found.findings],
    }
    tip = found.modulus.tip
    if "n" in law:
        row |= {"n": tip.exponent, "n_standard_error": 0.0}
    force = found.K.scaled(tip.force(1.0, depth) / tip.factor)
    exponent = tip.exponent_at(depth)
    for name, value in (("force", force), ("stiffness", force.scaled(exponent / depth))):
        row |= _quantity_columns(name, value)
    mark = found.modulus.mark
    return row | _modulus_columns(found.modulus) | {"verdict_stiffness": mark}


def _modulus_columns(elastic_modulus: ElasticModulus) -> Row:
    return {
        **_quantity_columns("modulus", elastic_modulus.value),
        "verdict_modulus": elastic_modulus.mark,
    }


def _quantity_columns(name: str, quantity: Quantity) -> Row:
    errors = {"standard_error": quantity.standard_error, "systematic": quantity.systematic}
    return {name: quantity.value, **{f"{name}_{kind}": error for kind, error in errors.items()}}


def values_for_depth(
    law: ForceLaw,
    covariance: Floats,
    depth: float,
    frequency: float = math.nan,
) -> Row:
    """Return force, stiffness and damping at a depth; errors by the delta method: √(gᵀ C g).

    For a law that relaxes stiffness and damping are K′ and B′ at a frequency ω, rad/s.
    """
    if isinstance(law, GeneralisedHuntCrossley) and not law.remembers:
        # Its M is 0, but has an error if the law relaxes once the surface moves by its deviation.
        covariance = np.pad(covariance[:-1, :-1], (0, 1))
    estimate = Estimate.from_law(law, covariance, status=Status.UPDATED, samples=1)

    def response(law: ForceLaw) -> tuple[float, ...]:
        if not law.remembers:
            return law.at_rest(depth)
        assert isinstance(law, GeneralisedHuntCrossley)
        stiffness = complex(law.dynamic_stiffness(depth, frequency))
        return law.at_rest(depth)[0], stiffness.real, stiffness.imag / frequency

    with np.errstate(all="ignore"):
        values, errors = estimate.with_errors(response)
    row: Row = {"depth": depth}
    for name, value, error in zip(AT_DEPTH, values.tolist(), errors.tolist(), strict=True):
        row |= {name: value, f"{name}_standard_error": error}
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


def _diagnosis_columns(result: Identification) -> Row:
    diagnosis = result.diagnosis
    return _working_depth_columns(result) | {
        "findings": [finding_cell(finding) for finding in diagnosis.findings],
        "verdict_stiffness": diagnosis.working_depth.stiffness.mark,
        "verdict_damping": diagnosis.working_depth.damping.mark,
    }


def _delay_columns(contact: Contact) -> Row:
    """Return the delay of the force in an episode of a data set, whose rows have one time each."""
    prepared = contact.prepared
    if prepared is None or prepared.recording.episode is None or contact.delay is not None:
        return {}
    try:
        delay = find_delay(contact, least_samples=3)
    except RecordingError:
        return {}
    return {"force_delay": delay.seconds, "force_delay_standard_error": delay.standard_error}


def _working_depth_columns(result: Identification, *, systematic: bool = True) -> Row:
    working_depth = result.diagnosis.working_depth
    row: Row = {"depth": working_depth.depth}
    for name in AT_DEPTH:
        quantity = getattr(working_depth, name)
        row[name] = quantity.value
        row[f"{name}_standard_error"] = quantity.standard_error
        if systematic:
            row[f"{name}_systematic"] = quantity.systematic
    return row
