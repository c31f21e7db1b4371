"""The energy that a material takes from a probe in a loop, measured and by the law."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.finding import Quantity
from palpate.force_laws import ForceLaw
from palpate.quantities.restitution import UNKNOWN
from palpate.quantities.work import Loops, Path, put_in
from palpate.validation import Floats, defined

# Of the energy lost: the law's loss is off by more than this before it is said.
UNACCOUNTED = 0.10


@dataclass(frozen=True, slots=True, eq=False)
class EnergyLoss:
    """Energy lost in the loops of a recording, J.

    Attributes
    ----------
    kind : str
        ``"touch"``: from out of contact to out of contact. ``"cycle"``: from one passage through
        the median depth to the next, of a probe that stays in contact. ``"none"``: no loop closes.
    measured : Quantity
        ∮ F dx, mean of the loops; its standard error is what white noise of force and penetration
        makes of it, and systematic what an error of the penetration would that goes by the place,
        as an encoder's does, and a delay or a drift of the force's zero that the diagnosis names.
    predicted : Quantity
        The same by the law along the same motion, with the relative standard error of its damping:
        over a closed loop all that a law loses is lost in its damper. What the diagnosis' findings
        may move is not in it: it shows as what parts the two.
    put_in : float
        Work that went in, mean of the loops.
    fraction : Quantity
        measured/put_in.
    start, stop : numpy.ndarray, shape (m,)
        Of each loop, s.
    lost, predicted_lost, put_in_each : numpy.ndarray, shape (m,)
        In each loop.
    remarks : tuple of str
        What a reader should know of it.
    """

    kind: str
    measured: Quantity
    predicted: Quantity
    put_in: float
    fraction: Quantity
    start: Floats
    stop: Floats
    lost: Floats
    predicted_lost: Floats
    put_in_each: Floats
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the means as plain numbers and words; what is not defined is None."""
        return {
            "kind": self.kind,
            "loops": len(self.lost),
            "measured": self.measured.as_dict(),
            "predicted": self.predicted.as_dict(),
            "put_in": defined(self.put_in),
            "fraction": self.fraction.as_dict(),
            "remarks": list(self.remarks),
        }


def energy_of(
    path: Path,
    loops: Loops,
    law: ForceLaw,
    damping: Quantity,
    *,
    force_noise: float,
    depth_noise: float,
    skewed: bool,
    drifting: bool,
) -> EnergyLoss:
    """Return the energy lost in loops of a path.

    Parameters
    ----------
    path : Path
        The motion, and the force without the sensor's offset.
    loops : Loops
        Of it.
    law : ForceLaw
        What was identified.
    damping : Quantity
        Of the law at working depth, N·s/m: its relative error is that of the predicted loss.
    force_noise, depth_noise : float
        Standard deviations of white noise, N and m.
    skewed : bool
        Whether force and penetration may be apart in time, which moves the measured loss as it
        does the damping.
    drifting : bool
        Whether the zero of the force may drift, whose ∮ F dx is no loss.
    """
    work = path.work(path.force)
    lost = loops.over(work)
    predicted = loops.over(path.work(path.felt(law)))
    variance = loops.over(path.variance(force_noise, depth_noise))
    each = put_in(work, loops)
    samples = np.arange(len(path.time))
    start, stop = (np.interp(ends, samples, path.time) for ends in (loops.starts, loops.stops))
    arrays = (start, stop, lost, predicted, each)
    if not len(loops):
        words = "no touch is whole, and no cycle closes"
        return EnergyLoss("none", UNKNOWN, UNKNOWN, math.nan, UNKNOWN, *arrays, remarks=(words,))
    # Over a closed loop a law's loss is proportional to its damping.
    by_damping = abs(float(predicted.mean()) / damping.value) if damping.value else math.nan
    noise = float(np.sqrt(variance.sum())) / len(loops)
    moved = by_damping * damping.systematic if skewed else 0.0
    # An encoder's error goes by the place, and is the same in every loop: ∮ e dF, e of one sign.
    steps = depth_noise * float(loops.swings(path.force).mean())
    drifted = _drifted(path, loops, law) if drifting else 0.0
    measured = Quantity(float(lost.mean()), noise, math.hypot(moved, steps, drifted))
    of_law = Quantity(float(predicted.mean()), by_damping * damping.standard_error, 0.0)
    remarks = _remarks(measured, of_law)
    if not remarks:
        remarks = _loop_by_loop(loops.kind, lost, predicted, variance)
    whole = float(each.mean())
    fraction = _part(measured, whole)
    return EnergyLoss(
        loops.kind, measured, of_law, whole, fraction, *arrays, remarks=tuple(remarks)
    )


def _drifted(path: Path, loops: Loops, law: ForceLaw) -> float:
    """Return ∮ ḋ t dx, mean of the loops, J, of a zero that drifts as what the law leaves does."""
    inside = path.inside
    time = path.time[inside] - path.time[inside].mean()
    left = path.force[inside] - path.felt(law)[inside]
    rate = float(time @ left / (time @ time))
    return abs(rate * float(loops.over(path.work(path.time)).mean()))


def _part(quantity: Quantity, whole: float) -> Quantity:
    if not whole > 0.0:
        return UNKNOWN
    parts = (quantity.value, quantity.standard_error, quantity.systematic)
    return Quantity(*(part / whole for part in parts))


def _remarks(measured: Quantity, predicted: Quantity) -> list[str]:
    remarks = []
    if abs(measured.value) < 2.0 * measured.standard_error:
        remarks.append("the energy lost is not distinguishable from 0")
    elif measured.value < 0.0:
        remarks.append(
            "the recording gives energy back that was not put in: the force is late, or the "
            "surface moves"
        )
    errors = (measured.standard_error, predicted.standard_error)
    known = [error for error in errors if math.isfinite(error)]
    off = abs(measured.value - predicted.value)
    if predicted.value < 0.0:
        remarks.append("the law makes energy: its damping is negative")
    elif measured.value > 0.0 and off > max(UNACCOUNTED * measured.value, 2.0 * math.hypot(*known)):
        remarks.append(
            f"the law accounts for {predicted.value / measured.value:.0%} of what was lost"
        )
    return remarks


def _loop_by_loop(kind: str, lost: Floats, predicted: Floats, variance: Floats) -> list[str]:
    """Say where the law's loss is right on the whole, and not in the single loops."""
    size, off, noise = (
        float(np.sqrt(np.mean(square))) for square in (lost**2, (lost - predicted) ** 2, variance)
    )
    if off <= max(UNACCOUNTED * size, 2.0 * noise):
        return []
    return [
        f"the law's loss is {off / size:.0%} off {kind} by {kind}: what is lost goes otherwise "
        "with speed or depth"
    ]
