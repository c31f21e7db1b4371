"""``python -m benchmarks.diagnosis.halves [LAW…]``: others' recordings, each half by itself.

The first and the second half of each recording are identified by :func:`palpate.identify`: of the
segments, of the touches, or of the time in a contact of many cycles. K′ and B′ of the two are
compared at one depth and frequency: the median penetration and the motion's frequency, both of the
whole recording. A recording of one touch has no halves. For each law and set the table has the
difference of the halves (median and 90 %), the width of a bar, and the share of recordings whose
halves agree within two bars of the difference. Default laws: ``hunt-crossley`` and ``auto``. The
last lines count the stiffnesses that ``identify`` trusts in both halves, or in two repeats of one
object that follow each other, and those that are more than two bars of the difference apart.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from benchmarks.common.recordings import with_notes
from benchmarks.common.report import markdown_table, run_command
from benchmarks.diagnosis.marks import blocks_of, objects_of
from palpate import Contact, PalpateError, identify, prepare
from palpate.input.preparation.gate import choose_gate

FEWEST = 4  # segments or touches
TURNS = 7  # of a contact that is cut in time
SETS = {"C": "C", "D": "D", "G": "G", "C, D, G": "CDG", "all": "ABCDEFG"}


def touches_of(contact: Contact) -> list[tuple[int, int]]:
    """First and last sample of each touch that is at least a third as deep as the deepest."""
    inside = choose_gate(contact).makes(contact.penetration, contact.force)
    edges = np.flatnonzero(np.diff(np.r_[0, inside.astype(int), 0]))
    joined: list[list[int]] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if joined and start - joined[-1][1] < 6:  # noise at the gate
            joined[-1][1] = stop
        else:
            joined.append([start, stop])
    swings = [float(np.ptp(contact.penetration[a:b])) for a, b in joined]
    deep = 0.3 * max(swings, default=0.0)
    pairs = zip(joined, swings, strict=True)
    return [(a, b) for (a, b), swing in pairs if b - a > 20 and swing > deep]


def halves_of(contact: Contact, name: str) -> tuple[Contact, Contact] | None:
    """Return both halves of a recording, or None if it has one touch only."""
    inside = choose_gate(contact).makes(contact.penetration, contact.force)
    parts = [part for part in contact.segments() if inside[part].sum() > 30]
    if len(parts) >= FEWEST and name[0] not in "EF":  # whose breaks are those of the sensor
        chosen: list[NDArray[np.bool_]] = [np.zeros(len(contact), dtype=bool) for _ in range(2)]
        for k, part in enumerate(parts):
            # Heels alternate left and right: odd and even ones.
            chosen[k % 2 if name[0] == "B" else int(k >= len(parts) / 2)][part] = True
        return contact.taken(chosen[0]), contact.taken(chosen[1])
    touches = touches_of(contact)
    if not touches:
        return None
    if len(touches) >= FEWEST:
        middle = len(touches) // 2
        cut = (touches[middle - 1][1] + touches[middle][0]) // 2
    else:
        first, last = touches[0][0], touches[-1][1]
        velocity = contact.velocity[first:last]
        quick = np.abs(velocity) > 0.3 * np.nanpercentile(np.abs(velocity), 95)
        if np.count_nonzero(np.diff(np.sign(velocity[quick]))) < TURNS:
            return None
        cut = (first + last) // 2
    return contact.taken(slice(0, cut)), contact.taken(slice(cut, None))


@dataclass(frozen=True)
class Pair:
    """K′ and B′ of both halves of a recording: values and standard errors, shape (2, 2)."""

    name: str
    values: NDArray[np.float64]  # rows: halves
    errors: NDArray[np.float64]

    @property
    def apart(self) -> NDArray[np.float64]:
        """Relative differences of K′ and B′, percent."""
        one, two = self.values
        percent: NDArray[np.float64] = 200.0 * np.abs(two - one) / (np.abs(one) + np.abs(two))
        return percent

    @property
    def width(self) -> NDArray[np.float64]:
        """Standard errors of the first half, percent."""
        percent: NDArray[np.float64] = 100.0 * self.errors[0] / np.abs(self.values[0])
        return percent

    @property
    def agrees(self) -> NDArray[np.bool_]:
        """Whether the halves agree within two standard errors of their difference."""
        one, two = self.values
        agree: NDArray[np.bool_] = np.abs(two - one) < 2.0 * np.hypot(*self.errors)
        return agree


def response(depth: float, omega: float) -> Callable[[Any], tuple[float, float]]:
    """K′ and B′ of a law as a function of the law."""

    def of(law: Any) -> tuple[float, float]:
        if not law.relaxes:
            return law.stiffness_at(depth), law.damping_at(depth)
        whole = law.dynamic_stiffness(depth, omega)
        return whole.real, whole.imag / omega

    return of


def pair_of(path: Path, law: str) -> Pair | None:
    """Identify both halves; None where there is one touch only, or a half cannot be identified."""
    try:
        contact = prepare(path)
        halves = halves_of(contact, path.stem)
        if halves is None:
            return None
        inside = choose_gate(contact).makes(contact.penetration, contact.force)
        x, v = contact.penetration[inside], contact.velocity[inside]
        depth, omega = float(np.median(x)), float(np.sqrt(np.nanmean(v**2)) / np.std(x))
        values, errors = np.empty((2, 2)), np.empty((2, 2))
        for k, half in enumerate(halves):
            result = identify(half, law=law, trace=False)
            # Not by dynamic_stiffness(): a half's own band may exclude the whole's frequency.
            there = result.at(depth)
            systematic = there.stiffness.systematic, there.damping.systematic

            values[k], statistical = result.estimate.with_errors(response(depth, omega))
            errors[k] = [math.hypot(*each) for each in zip(statistical, systematic, strict=True)]
    except PalpateError as error:
        print(f"{path.stem}, {law}: {error}")
        return None
    return Pair(path.stem, values, errors)


def rows_of(law: str, pairs: list[Pair]) -> Iterator[list[object]]:
    """A row of the table for each set."""
    for title, letters in SETS.items():
        own = [pair for pair in pairs if pair.name[0] in letters]
        if not own:
            continue
        cells: list[object] = [title, law, len(own)]
        for k in range(2):
            apart = np.array([pair.apart[k] for pair in own])
            middle, high = np.percentile(apart, [50.0, 90.0])
            width = float(np.median([pair.width[k] for pair in own]))
            within = 100.0 * np.mean([pair.agrees[k] for pair in own])
            cells += [f"{middle:.2g} / {high:.3g}", f"{width:.2g}", f"{within:.0f}"]
        yield cells


def trusted_distances(name: str, repeats: Iterable[Contact]) -> Iterator[tuple[str, float]]:
    """Distance of K′, in bars of the difference, of each two consecutive repeats with *trust*."""
    results = []
    for contact in repeats:
        with suppress(PalpateError):
            results.append(identify(contact, trace=False))
    depth = float(np.median([each.diagnosis.working_depth.depth for each in results]))
    there = [each.at_depth(depth).diagnosis.working_depth.stiffness for each in results]
    for one, two in pairwise(there):
        if one.mark == two.mark == "trust":
            bar = math.hypot(one.whole_error, two.whole_error)
            yield name, abs(two.value - one.value) / bar


def main(*laws: str, v: Annotated[bool, Parameter("-v")] = False) -> None:
    """Print the table.

    Parameters
    ----------
    laws
        Default: hunt-crossley and auto.
    v
        Print each recording too.
    """
    rows = []
    for law in laws or ("hunt-crossley", "auto"):
        pairs = [pair for path in with_notes() if (pair := pair_of(path, law))]
        rows += list(rows_of(law, pairs))
        for pair in pairs if v else ():
            (k, b), (wide_k, wide_b) = pair.apart, pair.width
            print(f"{pair.name:28s} {law:14s} K′ {k:.2g} ({wide_k:.2g}) B′ {b:.2g} ({wide_b:.2g})")
    heads = ["set", "law", "recordings"]
    for name in ("K′", "B′"):
        heads += [f"{name} apart, median / 90 %, %", "bar, %", "within two bars, %"]
    print("\n".join(markdown_table(heads, rows)))
    halves = ((path.stem, halves_of(prepare(path), path.stem)) for path in with_notes())
    kinds: dict[str, list[tuple[str, Iterable[Contact]]]] = {
        "halves": [(name, pair) for name, pair in halves if pair is not None],
        "repeats": [(name, blocks_of(name, paths)) for name, paths in objects_of().items()],
    }
    for kind, recordings in kinds.items():
        distances = [each for pair in recordings for each in trusted_distances(*pair)]
        far = [f"{name} by {distance:.2g}" for name, distance in distances if distance > 2.0]
        print(f"\n{kind}, both trusted: {len(distances)}; more than two bars apart: {far or 0}")


if __name__ == "__main__":
    run_command(main)
