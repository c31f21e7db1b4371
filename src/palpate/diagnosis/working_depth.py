"""Force, stiffness and damping at a depth, with what they may be wrong by."""

import math

import numpy as np

from palpate.diagnosis.alike import Alike
from palpate.diagnosis.cause import beside
from palpate.diagnosis.finding import Finding, Mark, Quantity, WorkingDepth, severity_of, worst
from palpate.diagnosis.fit import Fit
from palpate.diagnosis.marking import CARE, Judged
from palpate.diagnosis.misfit import WIDE_DAMPING, standard_errors
from palpate.digits import with_error

# Standard errors that a number is off before that counts: less widens no bar by over an eighth.
OFF = 0.5


def working_depth(fit: Fit, judged: Judged) -> WorkingDepth:
    """Return the numbers at the fit's working depth.

    Parameters
    ----------
    fit : Fit
        At its working depth.
    judged : Judged
        The causes that may move them.
    """
    own = standard_errors(fit)
    found = (0.0, *(a * b for a, b in zip(judged.systematic(fit), fit.sizes, strict=True)))
    others = (_off_least_squares(fit, own), _without_offset(fit))
    moved = tuple(max(parts) for parts in zip(found, *others, strict=True))
    return _numbers(fit, _with_surface(fit, _with_memory(fit, own)), moved)


def sign(fit: Fit, at: WorkingDepth, others: list[Finding]) -> list[Finding]:
    """Of numbers that others trust: the bars leave the sign open, or the damping is negative.

    Twice the repeatable part, 95 %, and all of the systematic one, which is no deviation but how
    far a cause moves the number. A small bar leaves no sign open that matters: the damping of a
    spring is 0 ± little. What causes move is more than that where it calls for care; what repeats
    is calibrated, and more than that where it is wide.
    """
    marks: dict[str, Mark] = {"stiffness": "trust", "damping": "trust"}
    parts = []
    for name, size, unit in zip(marks, fit.sizes, ("N/m", "N·s/m"), strict=True):
        found: Quantity = getattr(at, name)
        bar = math.hypot(2.0 * found.standard_error, found.systematic)
        matters = found.systematic > CARE * size or bar > WIDE_DAMPING * size
        negative = name == "damping" and found.value < -max(bar, CARE * size)
        known = worst(*(getattr(other, name) for other in others)) == "do-not-trust"
        if not known and (negative or (matters and abs(found.value) <= bar)):
            marks[name] = "do-not-trust"
            words = f"the sign of the {name} is not known"
            if negative:
                words = f"the {name} is negative, and that of no passive material is"
            total = math.hypot(found.standard_error, found.systematic)
            parts.append(f"{words}: {with_error(found.value, total, unit=unit)}")
    remedy = "mend what the other findings name, or record a faster motion: palpate design"
    severity = severity_of(worst(marks["stiffness"], "with-care"))
    both = marks["stiffness"], marks["damping"]
    said = Finding("sign", "; ".join(parts), remedy, math.nan, *both, severity)
    return [said] if parts else []


def _with_memory(fit: Fit, errors: tuple[float, float, float]) -> tuple[float, float, float]:
    """The wider of these and the method's own, where memory was taken out of the force.

    The least squares beside it takes what the material remembers for known.
    """
    if not isinstance(fit.estimate, Alike):
        return errors
    force, stiffness, damping = (
        max(error, own) for error, own in zip(errors, fit.estimate.own_errors, strict=True)
    )
    return force, stiffness, damping


def nothing_known(fit: Fit) -> WorkingDepth:
    """Return the numbers at the working depth of a fit that could not be checked."""
    unknown = (math.nan, math.nan, math.nan)
    return _numbers(fit, unknown, (0.0, 0.0, 0.0) if math.isfinite(fit.depth) else unknown)


def _off_least_squares(fit: Fit, errors: tuple[float, ...]) -> tuple[float, ...]:
    """How far the method's own force, stiffness and damping are off the least squares of its law.

    The errors are those of the least squares. A method that forgets, or weighs light touch as much
    as firm, has an answer of its own, and no error bar of these is about it.
    """
    own, best = fit.units.local(fit.estimate.law), fit.solution.law
    quantities = (fit.force_at_depth, fit.stiffness, fit.damping)
    apart = (abs(quantity(own) - quantity(best)) for quantity in quantities)
    return tuple(a if a > OFF * error else 0.0 for a, error in zip(apart, errors, strict=True))


def _without_offset(fit: Fit) -> tuple[float, ...]:
    """How far the numbers of a method that knows no offset move when one is fitted beside its law.

    No tare is exact; what it leaves is in no residual that a stiffness can take up.
    """
    if fit.with_offset:
        return (0.0, 0.0, 0.0)
    found = beside(fit, np.ones(len(fit.band)))
    if found is None:
        return (0.0, 0.0, 0.0)
    moved = np.abs(fit.gradients @ found.change[: len(fit.solution.law.symbols)])
    return tuple(each if math.isfinite(each) else 0.0 for each in moved.tolist())


def _numbers(fit: Fit, errors: tuple[float, ...], moved: tuple[float, ...]) -> WorkingDepth:
    law, depth = fit.estimate.law, fit.depth
    values = (math.nan, math.nan, math.nan)
    if math.isfinite(depth):
        values = float(law.force(depth, 0.0)), law.stiffness_at(depth), law.damping_at(depth)
    quantities = (Quantity(*each) for each in zip(values, errors, moved, strict=True))
    return WorkingDepth(depth, *quantities)


def _with_surface(fit: Fit, errors: tuple[float, float, float]) -> tuple[float, float, float]:
    """With how far the numbers move as the depth does, by the deviation of the surface.

    The law holds at the place where the probe was; how deep that is, no fit knows better than it
    knows the surface.
    """
    law, depth = fit.estimate.law, fit.depth
    deviation = min(fit.data.contact.surface_deviation or 0.0, 0.5 * depth)
    if not deviation > 0.0:
        return errors
    low, high = depth - deviation, depth + deviation
    moves = (
        float(law.force(high, 0.0)) - float(law.force(low, 0.0)),
        law.stiffness_at(high) - law.stiffness_at(low),
        law.damping_at(high) - law.damping_at(low),
    )
    force, stiffness, damping = (
        math.hypot(error, 0.5 * move) for error, move in zip(errors, moves, strict=True)
    )
    return force, stiffness, damping
