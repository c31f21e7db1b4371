"""The work for each recording of ``benchmarks.diagnosis``: identify, and compare with the truth."""

import math
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.bank.material_faults import KNOWN_MATERIAL_FAULTS, MATERIAL_FAULTS
from benchmarks.bank.sensor_faults import KNOWN_SENSOR_FAULTS, SENSOR_FAULTS
from benchmarks.bank.trials import (
    CLEAN_MOTIONS,
    LENGTHS,
    NOISES,
    Fault,
    Trial,
    clean,
    good,
    hard,
    ideal,
    spoil,
)
from benchmarks.common.recordings import recorded
from palpate import (
    Contact,
    GeneralisedHuntCrossley,
    HuntCrossley,
    Identification,
    PalpateError,
    RecordingError,
    identify,
    lab,
    prepare,
)
from palpate.identification.diagnosis import Quantity, bars, verdict
from palpate.validation import Floats

Row = dict[str, Any]
Jobs = dict[str, Callable[[], list[Row]]]
NONE = [Fault("none", str(k)) for k in range(5)]
UNSEEN: list[Fault] = [*NONE, *SENSOR_FAULTS, *MATERIAL_FAULTS]
KNOWN: list[Fault] = [Fault("clean", ""), *KNOWN_SENSOR_FAULTS, *KNOWN_MATERIAL_FAULTS]
BANKS = {"good": good, "hard": hard}
QUANTITIES = ("stiffness", "damping")
#: A lie is off by more than so many bars, both parts, and by more than a fraction: that of a
#: damping of the good, the hard and the clean bank, and that of all others.
BARS, LEAST_DAMPING, LEAST = 3.0, 0.10, 0.05
PROBED = ("ball", "sponge", "pvc")  # by the robot
BLOCKS = {"C": 10, "G": 5}  # of equal time, into which each recording of a set is cut
LEVER = "A_aurora_220118"  # one muscle under loads of 100 to 1000 mN: each recording is a repeat


@dataclass
class Marked:
    """What palpate says of one recording, and the truth.

    Attributes
    ----------
    overall, stiffness, damping : str
        The verdicts; ``"refused"`` if the recording was not identified.
    errors : dict
        Of both quantities at the printed depth, over the truth.
    bars : dict
        Both parts of the standard errors together, over the size of the truth.
    deviations, relative : tuple of float
        Errors of K, B and n, in the standard errors of the estimate and relative, where Hunt and
        Crossley's law was selected.
    described : bool
        Whether the law describes the material.
    named : tuple of str
        Checks whose findings are significant or cost a mark, and what the law itself says.
    flagged : bool
        Whether a flag without a diagnosis would have warned.
    delay : float
        The delay in the message, s; NaN if none was found.
    changes : tuple of float
        Times of the reported changes of the material, s.
    seconds : float
        CPU of the diagnosis.
    largest_named : list of bool
        By :func:`largest_named`.
    """

    overall: str = "refused"
    stiffness: str = "refused"
    damping: str = "refused"
    errors: dict[str, float] = field(default_factory=dict)
    bars: dict[str, float] = field(default_factory=dict)
    deviations: tuple[float, ...] = ()
    relative: tuple[float, ...] = ()
    described: bool = True
    named: tuple[str, ...] = ()
    flagged: bool = True
    delay: float = math.nan
    changes: tuple[float, ...] = ()
    seconds: float = math.nan
    largest_named: list[bool] = field(default_factory=list)


def marked(made: Trial) -> Marked:
    """Identify and diagnose; compare with the truth."""
    try:
        result = identify(made.contact)
        start = time.process_time()
        diagnosis = result.diagnosis
        seconds = time.process_time() - start
        largest = largest_named(result)
    except PalpateError:
        return Marked()
    there = diagnosis.working_depth
    said = Marked(
        diagnosis.verdict.overall,
        diagnosis.verdict.stiffness,
        diagnosis.verdict.damping,
        described=made.described,
        named=_names(result),
        flagged=bool(result.flags),
        delay=_delay(result),
        changes=tuple(episode.start for episode in diagnosis.episodes[1:]),
        seconds=seconds,
        largest_named=largest,
    )
    for name, true in zip(QUANTITIES, made.truth(there.depth), strict=True):
        quantity: Quantity = getattr(there, name)
        said.errors[name] = (quantity.value - true) / abs(true)
        said.bars[name] = quantity.whole_error / abs(true)
    if len(result.law.parameters) == len(made.law.parameters):
        off = np.subtract(result.law.parameters, made.law.parameters)
        said.deviations = tuple((off / result.estimate.standard_errors).tolist())
        said.relative = tuple((off / made.law.parameters).tolist())
    return said


def largest_named(result: Identification) -> list[bool]:
    """Whether each printed reason that names a part of a bar names its largest part."""
    parts: list[bars.BarPart] = []

    def record(*of: Any) -> list[Any]:
        parts.extend(bars.all_parts(*of))
        return bars.check_precision(*of)

    with patch.object(verdict, "check_precision", record):
        again = result.at_depth(result.diagnosis.working_depth.depth)
        printed = again.diagnosis.working_depth
    largest = []
    for number, quantity in enumerate((printed.stiffness, printed.damping)):
        named = [part.errors[number] for part in parts if part.reason in quantity.reason]
        if named:
            largest.append(bool(max(named) == max(part.errors[number] for part in parts)))
    return largest


def _names(result: Identification) -> tuple[str, ...]:
    law, findings = result.law, result.diagnosis.findings
    names = [f.check for f in findings if f.severity != "note" or math.isfinite(f.z)]
    if isinstance(law, GeneralisedHuntCrossley):
        names += ["memory"] * (law.M > 0.0)
        names += ["damping form"] * (law.p != law.n)
    return tuple(name for name in dict.fromkeys(names) if name != "precision")


def _delay(result: Identification) -> float:
    """Return the delay in the message ``the force is 5.0 ± 0.1 ms late …``, s."""
    messages = [f.message for f in result.diagnosis.findings if f.check == "delay"]
    number = re.search(r"is (\S+) ± \S+ ms (late|early)", messages[0] if messages else "")
    if number is None:
        return math.nan
    return float(number[1]) * (1e-3 if number[2] == "late" else -1e-3)


def lies(row: Row, name: str) -> bool:
    """Whether a quantity is off by more than three bars, and by more than a little."""
    off = abs(row["errors"].get(name, 0.0))  # nothing is wrong in a refusal
    loose = name == "damping" and row["bank"] not in ("ideal", "robot")
    least = LEAST_DAMPING if loose else LEAST
    return bool(off > max(least, BARS * row["bars"].get(name, 0.0)))


def recordings_of(bank: str, seeds: range, robot: range) -> Jobs:
    """Return every job of a bank by its key in the store."""
    if bank == "clean":
        keys = [(kind, m, length) for kind in NOISES for m in CLEAN_MOTIONS for length in LENGTHS]
        return {
            f"clean/{'/'.join(key)}/{seed}": partial(_clean, *key, seed)
            for seed in seeds
            for key in keys
        }
    faults = UNSEEN if bank in BANKS else KNOWN
    draw = bank if bank in BANKS else "ideal"
    jobs: Jobs = {
        f"{draw}/{fault.kind}/{fault.severity}/{seed}": partial(_with_fault, draw, place, seed)
        for seed in seeds
        for place, fault in enumerate(faults)
    }
    if bank not in BANKS:
        jobs |= {
            f"robot/{name}/{seed}": partial(_robot, name, seed) for seed in robot for name in PROBED
        }
        jobs |= {
            f"pair/{material}/{motion}": partial(_pair, material, motion)
            for material in lab.MATERIALS
            for motion in lab.TRAJECTORIES
        }
        jobs |= {f"recording/{path.stem}": partial(_recording, path) for path in recorded()}
        jobs |= {
            f"repeats/{name}": partial(_repeats, name, paths)
            for name, paths in objects_of().items()
        }
    return jobs


def _with_fault(bank: str, place: int, seed: int) -> list[Row]:
    """Return the row of a bank, a fault's place and a seed."""
    if bank == "ideal":
        return [_row(bank, KNOWN[place], spoil(ideal(seed), KNOWN[place]))]
    fault = UNSEEN[place]
    made = BANKS[bank](seed, f"{bank}/{fault.kind}/{fault.severity}")
    return [_row(bank, fault, spoil(made, fault))]


def _row(bank: str, fault: Fault, made: Trial) -> Row:
    head = {"bank": bank, "kind": fault.kind, "severity": fault.severity, "shown": fault.shown}
    head |= {"names": fault.names, "stops": fault.stops}
    return head | asdict(marked(made))


def _clean(kind: str, motion: str, length: str, seed: int) -> list[Row]:
    """Return the row of a recording without a fault."""
    made = clean(seed, kind, motion, length)
    return [{"motion": motion, "length": length} | _row("clean", Fault(kind, ""), made)]


def _robot(name: str, seed: int) -> list[Row]:
    """Press a material once with the robot, and put each fault on the recording."""
    material = lab.MATERIALS[name]
    run = lab.Bench(material, lab.THREE_SINES).run(seed)
    law: HuntCrossley = material.law  # type: ignore[attr-defined]  # of a homogeneous one
    return [_row("robot", fault, _sensed(run, law, fault, seed)) for fault in KNOWN]


def _sensed(run: lab.Measurement, law: HuntCrossley, fault: Fault, seed: int) -> Trial:
    truth, random = run.truth, np.random.default_rng([seed, 7])
    signals = (truth.time, truth.penetration, truth.velocity, truth.force)
    made = Trial(*signals, law, random, 1e3, 0.05, least=1e-3)
    if not fault.sampled:
        fault.damage(made)
    sensed = lab.Sensors().force(made.force, random)
    made.force = sensed - float(sensed[made.time < lab.THREE_SINES.pause].mean())
    made.position = np.array(run.contact.penetration)
    if fault.sampled:
        fault.damage(made)
    return made


def _pair(material: str, motion: str) -> list[Row]:
    """Return the verdict on one material under one motion; ``"refused"`` if there is none."""
    bench = lab.Bench(lab.MATERIALS[material], lab.TRAJECTORIES[motion])
    try:
        overall: str = identify(bench.run(0).contact).diagnosis.verdict.overall
    except RecordingError:
        overall = "refused"
    return [{"bank": "pair", "material": material, "motion": motion, "overall": overall}]


def _recording(path: Path) -> list[Row]:
    """Return verdict, reason, and relative errors of stiffness and damping; or an error."""
    head = {"bank": "recording", "name": path.stem}
    try:
        diagnosis = identify(path).diagnosis
    except RecordingError as error:
        return [{**head, "overall": "not identified", "reason": str(error).rpartition("/")[2]}]
    there, verdict = diagnosis.working_depth, diagnosis.verdict
    errors = [
        100.0 * error / abs(quantity.value) if quantity.value else math.nan
        for quantity in (there.stiffness, there.damping)
        for error in (quantity.standard_error, quantity.systematic)
    ]
    marks = {name: getattr(verdict, name) for name in ("overall", *QUANTITIES)}
    return [{**head, **marks, "reason": diagnosis.reason, "errors": errors}]


def objects_of() -> dict[str, list[Path]]:
    """Return the recordings of each object that was pressed repeatedly, by its name."""
    objects = {LEVER: recorded(f"{LEVER}*.csv")}
    objects |= {path.stem: [path] for initial in BLOCKS for path in recorded(f"{initial}_*.csv")}
    return {name: paths for name, paths in objects.items() if paths}


def _repeats(name: str, paths: list[Path]) -> list[Row]:
    """Return reduced χ at a common working depth, without the systematic part and with it."""
    results = []
    for part in blocks_of(name, paths):
        try:
            results.append(identify(part))
        except RecordingError:  # a block without contact
            continue
    depth = float(np.median([result.diagnosis.working_depth.depth for result in results]))
    there = [result.at_depth(depth).diagnosis.working_depth for result in results]
    row = {"bank": "repeats", "name": name, "repeats": len(there), "depth": depth}
    return [row | {key: _factors([getattr(each, key) for each in there]) for key in QUANTITIES}]


def blocks_of(name: str, paths: list[Path]) -> Iterator[Contact]:
    """The repeats of one object: its recordings, or blocks of one of them."""
    count = BLOCKS.get(name.partition("_")[0], 1)
    for contact in map(prepare, paths):
        borders = np.linspace(contact.time[0], contact.time[-1], count + 1)
        for start, stop in pairwise(borders.tolist()):
            yield contact.window(start, stop)


def _factors(quantities: list[Quantity]) -> list[float]:
    """Return scatter in per cent, and reduced χ by the statistical and by both error bars."""
    values = np.array([quantity.value for quantity in quantities])
    statistical = np.array([quantity.standard_error for quantity in quantities])
    both = np.hypot(statistical, [quantity.systematic for quantity in quantities])
    scatter = 100.0 * float(np.std(values, ddof=1) / abs(np.mean(values)))
    return [scatter, _reduced_chi(values, statistical), _reduced_chi(values, both)]


def _reduced_chi(values: Floats, errors: Floats) -> float:
    weights = errors**-2.0
    mean = float(weights @ values / weights.sum())
    return float(np.sqrt(((values - mean) ** 2 * weights).sum() / (len(values) - 1)))
