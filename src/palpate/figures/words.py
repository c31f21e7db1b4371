"""What titles say of an identification."""

from pathlib import Path

from palpate.digits import with_error
from palpate.figures.scales import scale_of
from palpate.identification import Identified
from palpate.results.parameters import OFFERED, parameter_rows

JOINED = "\N{NO-BREAK SPACE}"


def kept_together(value: float, *errors: float, unit: str = "") -> str:
    """As :func:`palpate.digits.with_error`, in words that no line is broken between."""
    return with_error(value, *errors, unit=unit).replace(" ", JOINED)


def parameters_of(result: Identified) -> str:
    """The law's parameters and their standard errors; not the spectrum that it was offered."""
    rows = [row for row in parameter_rows(result) if row.name != OFFERED]
    return ", ".join(str(row).replace(" ", JOINED) for row in rows)


def at_depth(result: Identified) -> str:
    """Force, stiffness and damping at working depth."""
    there = result.diagnosis.working_depth
    quantities = (
        ("force", there.force, "N"),
        ("stiffness", there.stiffness, "N/m"),
        ("damping", there.damping, "N·s/m"),
    )
    words = [
        f"{name} {kept_together(q.value, q.standard_error, q.systematic, unit=unit)}"
        for name, q, unit in quantities
    ]
    length = scale_of(there.depth, "m")
    relaxed = ", once relaxed" if result.law.remembers else ""
    return f"at {length.factor * there.depth:.4g} {length.unit}{relaxed}: {', '.join(words)}"


def force_at_depth(result: Identified) -> str:
    """Force at working depth."""
    there = result.diagnosis.working_depth
    length, force = scale_of(there.depth, "m"), there.force
    words = kept_together(force.value, force.standard_error, force.systematic, unit="N")
    return f"force at {length.factor * there.depth:.4g} {length.unit}: {words}"


def name_of(result: Identified) -> str:
    """Name of the recording's file; what no font has, such as a byte that is not UTF-8, is �."""
    name = Path(result.contact.source).name
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in name)


def verdict_of(result: Identified) -> str:
    """Verdict and its reason."""
    return f"{result.diagnosis.verdict.overall}: {result.diagnosis.reason}"


def fit_of(result: Identified) -> str:
    """File, method and how well the law fits."""
    name = name_of(result)
    fitted = "the stretches' own laws fit" if result.stretches else "final law fits"
    fit = f"{result.method}, {fitted} to {result.fit_rmse_percent:.2g}{JOINED}%"
    return f"{name}: {fit}" if name else fit
