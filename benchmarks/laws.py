"""``python -m benchmarks.laws``: the law that palpate selects, against simulated materials.

Each part has its own contacts, identified by ``palpate.identify``
from time, penetration and force: **a** materials of the family, **b** little motion, **c** no
memory, four kinds of noise, **f** late forces, **g** outside of the family, **h** changes; **m** is
others' microrheology, from ``PALPATE_DATA`` or ``../shared/data`` next to the checkout. The tables
*d* and *e* are of the contacts of a to c.
"""

import json
import math
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks.bank.trials import MOTIONS
from benchmarks.common.recordings import recorded
from benchmarks.common.report import (
    Limit,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.common.workers import Workers
from palpate import (
    ChangeDetector,
    GeneralisedHuntCrossley,
    PalpateError,
    ViscoelasticContact,
    identify,
    prepare,
)
from palpate.validation import Floats
from palpate.writing import check_outputs

Random = np.random.Generator

DAMPERS = "hunt-crossley", "half-space", "kelvin-voigt"
# Ranges of the relaxation times, s; a spectrum has four times an octave from the first to the last.
MEMORIES = {
    "none": (),
    "one time": ((0.03, 1.0),),
    "two times": ((0.02, 0.1), (0.3, 2.0)),
    "three times": ((0.02, 0.06), (0.15, 0.5), (1.0, 3.0)),
    "flat": ((3e-3, 20e-3), (1.0, 10.0)),
    "power law": ((3e-3, 20e-3), (1.0, 10.0)),
}
SLS = "SLS × √x"
RELAXING = [(damper, memory) for damper in DAMPERS for memory in MEMORIES if memory != "none"]
USUAL = list(MOTIONS)
SHORT = "one touch", "one cycle"
BEGINNINGS = *SHORT, "lasting sine", "lasting sine after a hold"
NOISES = "white", "AR .9", "20 Hz low-pass", "∝ load"
LAGS = "delay", "late force"  # checks whose significant finding names a late force
LATE = "clean", "3 ms late", "10 ms late", "low-passed"
RATES = 100.0, 200.0, 500.0, 1000.0
MOST = 4000  # samples of a recording
FINE = 4000.0  # Hz at least, of the simulation


@dataclass(frozen=True)
class Material:
    """F = K xⁿ + B xᵖ v + Σ mᵢ gᵢ,  ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ  for x > 0, else 0.

    One outside of the family has n = 1.5, and F = √x (K x + B v + Σ mᵢ gᵢ) with gᵢ of x: a standard
    linear solid times the radius of contact.
    """

    stiffness: float
    exponent: float
    damping: float
    damping_exponent: float
    times: Floats
    branches: Floats  # mᵢ, N/mⁿ
    outside: bool = False

    def elastic(self, x: Floats, step: float) -> Floats:
        """Force of spring and memory, N."""
        depth = np.maximum(x, 0.0)
        power = depth if self.outside else depth**self.exponent
        force, rise = self.stiffness * power, np.diff(power, prepend=power[0])
        for tau, stiffness in zip(self.times, self.branches, strict=True):
            keep = math.exp(-step / tau)  # exact where xⁿ is linear within a step
            share = stiffness * tau / step * (1.0 - keep)
            force = force + share * lfilter([1.0], [1.0, -keep], rise)
        return np.where(x > 0.0, force * (np.sqrt(depth) if self.outside else 1.0), 0.0)

    def damper(self, x: Floats, v: Floats) -> Floats:
        """Force of the damper, N."""
        return np.where(x > 0.0, self.damping * np.maximum(x, 1e-9) ** self.damping_exponent * v, 0)

    def response(self, depth: float, omega: float) -> tuple[float, float]:
        """K′ and B′ of a small oscillation about a depth at which it has relaxed, SI."""
        phase = 1j * omega * self.times
        memory = complex(np.sum(self.branches * phase / (1.0 + phase)))
        share = 1.0 if self.outside else self.exponent
        slope = depth ** (self.exponent - 1.0)
        whole = slope * (self.exponent * self.stiffness + share * memory)
        return whole.real, whole.imag / omega + self.damping * depth**self.damping_exponent


@dataclass(frozen=True)
class Case:
    """The kinds of one contact; with a seed its key sets all that is drawn."""

    part: str
    number: int
    damper: str
    memory: str
    motion: str
    noise: str = "white"
    fault: str = "clean"

    @property
    def key(self) -> str:
        """The same text in every build."""
        return "/".join(map(str, asdict(self).values()))


@dataclass(frozen=True)
class Pressed:
    """A simulated recording, its material, and the motion's median depth and frequency."""

    time: Floats
    penetration: Floats
    force: Floats
    material: Material
    rate: float
    depth: float
    frequency: float  # rms speed over rms displacement in contact, rad/s


def cases(part: str) -> list[Case]:
    """Return every contact of a part."""
    white = "white"
    rows: dict[str, list[Any]] = {
        "a": [*product(DAMPERS, MEMORIES, USUAL)] * 2,
        "b": [(*RELAXING[k % 15], motion) for motion in BEGINNINGS for k in range(24)],
        "c": [*product(DAMPERS, ["none"], USUAL, NOISES)] * 3,
        "f": [
            *((*RELAXING[k % 15], USUAL[k % 6], white, fault) for fault in LATE for k in range(33)),
            *((DAMPERS[k % 3], "none", USUAL[k // 3 % 6], white, LATE[2]) for k in range(33)),
        ],
        "g": [
            *product(["half-space"], [SLS], USUAL * 4),
            *product(DAMPERS[:2], ["none"], USUAL * 2, [white], ["friction"]),
        ],
        "h": [
            ("hunt-crossley", memory, motion, noise, fault)
            for noise, fault in ((white, "clean"), ("AR .9", "clean"), (white, "K + 10 %"))
            for memory, motion in [*product(("none", "one time"), ("multi-sine", "chirp"))] * 5
        ],
    }
    return [Case(part, k, *row) for k, row in enumerate(rows.get(part, []))]


def press(case: Case, seed: int) -> Pressed:
    """Draw motion and material, and simulate the force on a finer clock."""
    random = np.random.default_rng([seed, zlib.crc32(case.key.encode())])
    rate = float(random.choice(RATES[2:] if case.motion in SHORT or case.part == "h" else RATES))
    noise = _between(random, 1e-3 if case.part == "c" else 2e-3, 2e-2)
    every = math.ceil(FINE / rate)
    step = 1.0 / (every * rate)
    wave, first = _motion(case.motion, step, min(random.uniform(4.0, 10.0), MOST / rate), random)
    x = _between(random, 1e-3, 15e-3) * wave / np.max(wave)
    v = np.gradient(x, step)
    inside = np.flatnonzero(x > 0.0)
    inside = inside[inside >= first]
    depth = float(np.median(x[inside]))
    omega = float(np.sqrt(np.mean(v[inside] ** 2)) / np.std(x[inside]))
    fastest = float(np.max(np.abs(v[inside])))
    material = _material(case, random, float(np.max(x)), depth, omega, fastest)
    elastic = material.elastic(x, step)
    if case.fault == "K + 10 %":
        elastic[x.size // 2 :] *= 1.1
    force = _fault(case.fault, elastic + material.damper(x, v), v, step, random)[first::every]
    peak = float(np.max(force))
    force = force + noise * peak * _noise(case.noise, force / peak, rate, random)
    times = np.arange(force.size) / rate
    return Pressed(times, x[first::every], force, material, rate, depth, omega)


def _between(random: Random, low: float, high: float) -> float:
    return math.exp(random.uniform(math.log(low), math.log(high)))


def _clock(step: float, seconds: float) -> Floats:
    return np.asarray(step * np.arange(float(round(seconds / step))))


def _motion(kind: str, step: float, seconds: float, random: Random) -> tuple[Floats, int]:
    """Penetration at every step in any unit, and the first that is recorded."""
    if kind in MOTIONS:
        faster = random.uniform(2.0, 5.0) if kind == "press" else 1.0  # several presses
        time = _clock(step, seconds)
        while (x := MOTIONS[kind](time, seconds, faster, random))[0] > 0.0:
            pass  # another that begins in free air
        return x, 0
    if kind == "one touch":
        lasts, above = random.uniform(0.06, 0.18), random.uniform(0.4, 1.5)
        width = 0.5 * math.pi * lasts / math.acos(math.sqrt(above / (1.0 + above)))
        time = _clock(step, 1.0) - 0.5
        bell = np.cos(np.pi * np.clip(time / width, -0.5, 0.5)) ** 2
        return np.asarray((1.0 + above) * bell - above), 0
    # Cycles that begin in contact, after some seconds of the same, or of rest there.
    turns, before = random.uniform(0.5, 2.0), random.uniform(1.0, 4.0)
    count = 1 if kind == "one cycle" else random.integers(6, 13)
    time = _clock(step, before + count / turns) - before
    moving = np.maximum(time, 0.0) if kind.endswith("hold") else time
    phase = random.uniform(0.0, 2.0 * np.pi)
    x = 1.0 + random.uniform(0.2, 0.7) * np.sin(2.0 * np.pi * turns * moving + phase)
    approach = np.clip((time + before) / 0.5, 0.0, 1.0)
    begun = approach**2 * (3.0 - 2.0 * approach)
    return np.asarray(x * begun), int(np.searchsorted(time, 0.0))


def _material(
    case: Case, random: Random, deepest: float, depth: float, omega: float, fastest: float
) -> Material:
    """Draw a material whose damper has a loss tangent of 0.03 to 0.3 at the motion's frequency."""
    n = 1.0 if case.damper == "kelvin-voigt" else random.uniform(1.1, 2.2)
    n = 1.5 if case.memory == SLS else n
    p = {"hunt-crossley": n, "half-space": n - 1.0, "kelvin-voigt": 0.0}[case.damper]
    stiffness = _between(random, 0.3, 50.0) / deepest**n
    # The damper alone does not pull.
    loss = min(_between(random, 0.03, 0.3), 0.6 * omega * depth / (n * fastest))
    damping = loss * stiffness * n * depth ** (n - 1.0 - p) / omega
    ranges = MEMORIES["one time" if case.memory == SLS else case.memory]
    times = np.array([_between(random, *each) for each in ranges])
    shares = random.uniform(0.5, 1.5, times.size)
    if case.memory in ("flat", "power law"):
        times = times[0] * 2.0 ** np.arange(0.0, math.log2(times[1] / times[0]), 0.25)
        shares = times ** -(random.uniform(0.1, 0.3) if case.memory == "power law" else 0.0)
    branches = stiffness * random.uniform(0.3, 1.5) * shares / max(float(np.sum(shares)), 1e-9)
    return Material(stiffness, n, damping, p, times, branches, case.memory == SLS)


def _fault(fault: str, force: Floats, v: Floats, step: float, random: Random) -> Floats:
    if fault.endswith("late"):
        late = round(1e-3 * float(fault.split()[0]) / step)
        return np.concatenate([np.full(late, force[0]), force[: force.size - late]])
    if fault == "low-passed":
        return np.asarray(lfilter(*butter(2, random.uniform(15.0, 30.0), fs=1.0 / step), force))
    if fault == "friction":
        way = np.tanh(5.0 * v / np.sqrt(np.mean(v**2)))
        return np.asarray(force * (1.0 + random.uniform(0.03, 0.08) * way))
    return force


def _noise(kind: str, load: Floats, rate: float, random: Random) -> Floats:
    """Noise of unit variance; where it grows with the load, at the peak."""
    white = random.standard_normal(load.size)
    if kind == "AR .9":
        return np.asarray(math.sqrt(1.0 - 0.81) * lfilter([1.0], [1.0, -0.9], white))
    if kind == "20 Hz low-pass":
        slow = lfilter(*butter(2, 20.0, fs=rate), white)
        return np.asarray(slow / np.std(slow))
    return white * (0.05 + load) if kind == "∝ load" else white


Outcomes = list[dict[str, Any]]
NUMBERS = {"K′": "stiffness", "B′": "damping"}
TURN = 2.0 * math.pi
SENSOR = (
    "4 to 10 s, at most 4000 samples, at 100 to 1000 Hz, h and short motions of b from 500 Hz; "
    "noise of 0.2 to 2 % of the peak force, in c from 0.1 %, white but where stated."
)


def measure(case: Case, seed: int) -> dict[str, Any]:
    """Identify one contact; return what is known of it and of its truth, as plain numbers."""
    pressed, outcome = press(case, seed), asdict(case)
    try:
        contact = prepare(time=pressed.time, penetration=pressed.penetration, force=pressed.force)
        if case.part == "h":
            watching = ViscoelasticContact(change_detector=ChangeDetector())
            changes = identify(contact, watching, trace=False).changes / pressed.time.size
            return outcome | {"changes": (changes * pressed.rate).tolist()}  # parts of the whole
        result = identify(contact, law="auto", trace=False)
        response, findings = result.dynamic_stiffness(), result.diagnosis.findings
    except PalpateError as error:
        return outcome | {"error": str(error)}
    surface, omega = result.estimate.surface, pressed.frequency
    law = GeneralisedHuntCrossley.of(result.law)
    by_law = law.dynamic_stiffness(pressed.depth - surface, omega)
    here = pressed.material.response(response.depth + surface, response.frequency)
    moving = pressed.material.response(pressed.depth, omega)
    for k, name in enumerate(NUMBERS.values()):
        number = getattr(response, name)
        outcome |= {name: number.value, f"{name}_bar": number.whole_error, f"true_{name}": here[k]}
        found = (by_law.real, by_law.imag / omega)[k]  # at the motion's own depth and frequency
        outcome |= {f"moving_{name}": found, f"true_moving_{name}": moving[k]}
    verdict = result.law_verdict
    # A finding that only widens a bar is a note.
    significant = [f.check for f in findings if f.severity != "note" or math.isfinite(f.z)]
    return outcome | {
        "found": verdict and (verdict.candidate.damping, verdict.candidate.memory),
        "remembers": bool(getattr(result.law, "remembers", False)),
        "findings": significant,
    }


def _where(outcomes: Outcomes, **kinds: str) -> Outcomes:
    return [o for o in outcomes if all(o[name] == kind for name, kind in kinds.items())]


def _relaxing(outcomes: Outcomes) -> Outcomes:
    return [o for o in outcomes if o["memory"] != "none"]


def _off(outcomes: Outcomes, name: str) -> list[float]:
    """Relative errors, percent; 100 where palpate has no answer."""
    return [
        100.0 * abs(o[name] / o[f"true_{name}"] - 1.0) if name in o else 100.0 for o in outcomes
    ]


def _share(title: str, each: list[Any], limit: Limit | None = None) -> Row:
    """How many are true."""
    part = 100.0 * sum(map(bool, each)) / max(len(each), 1)
    return Row(f"{title}, {len(each)}", part, "%", limit=limit)


def _errors(
    title: str, outcomes: Outcomes, limits: tuple[float | None, ...] = (None, None), at: str = ""
) -> Iterator[Row]:
    for k, (symbol, name) in enumerate(NUMBERS.items()):
        middle, high, worst = np.percentile(_off(outcomes, at + name), [50.0, 90.0, 100.0])
        words = f"median {middle:.3g}, worst {worst:.3g}"
        bound = limits[k]
        limit = None if bound is None else Limit(bound)
        row = f"{title}, {len(outcomes)}: {symbol} off, 90 %"
        yield Row(row, float(high), "%", reference=words, limit=limit)


def _within(outcomes: Outcomes, name: str) -> list[bool]:
    return [
        name in o and abs(o[name] - o[f"true_{name}"]) <= 2.0 * o[f"{name}_bar"] for o in outcomes
    ]


def _bars(title: str, outcomes: Outcomes, limit: Limit | None = None) -> Iterator[Row]:
    for symbol, name in NUMBERS.items():
        yield _share(f"{title}: {symbol} within two bars", _within(outcomes, name), limit)
        known = [o for o in outcomes if name in o]
        bars = [100.0 * o[f"{name}_bar"] / abs(o[name] or math.nan) for o in known]
        ratio = float(np.nanmedian(bars) / np.median(_off(known, name)))
        bound = Limit(5.0) if limit and name == "damping" else None
        yield Row(f"{title}: {symbol}, median bar over median error", ratio, "", limit=bound)


def _family(a: Outcomes) -> Iterator[Row]:
    yield from _errors("family", a, (1.0, 6.0))
    for memory in MEMORIES:
        yield from _errors(memory, _where(a, memory=memory))


def _little_motion(b: Outcomes) -> Iterator[Row]:
    for motion, limit in zip(BEGINNINGS, (15.0, 8.0, None, None), strict=True):
        some = _where(b, motion=motion)
        yield from _errors(motion, some, (None, limit))
        yield from _errors(f"{motion}, at its own depth and frequency", some, at="moving_")


def _memoryless(c: Outcomes) -> Iterator[Row]:
    yield Row(
        "no memory: B′ off, median", float(np.median(_off(c, "damping"))), "%", limit=Limit(0.5)
    )
    yield from _errors("no memory", c, (None, 3.2))
    named = [o.get("found") == ("hunt-crossley", "none") for o in _where(c, damper="hunt-crossley")]
    yield _share("Hunt–Crossley named", named, at_least(97.0))
    for field, kinds in (("noise", NOISES), ("damper", ("hunt-crossley", "half-space"))):
        for kind in kinds:
            false = [o.get("remembers") for o in _where(c, **{field: kind})]
            yield _share(f"{kind}: memory named", false, Limit(2.0))
    kelvin = _where(c, damper="kelvin-voigt")
    ramps = [o.get("remembers") for o in _where(kelvin, motion="ramps")]
    yield _share("kelvin-voigt, ramps: memory named", ramps)
    others = [o.get("remembers") for o in kelvin if o["motion"] != "ramps"]
    yield _share("kelvin-voigt, other motions: memory named", others)


def _memory_named(a: Outcomes) -> Iterator[Row]:
    yield _share("memory named", [o.get("remembers") for o in _relaxing(a)], at_least(95.0))
    for memory in list(MEMORIES)[1:]:
        yield _share(memory, [o.get("remembers") for o in _where(a, memory=memory)])


def _covered(abc: Outcomes) -> Iterator[Row]:
    family = _where(abc, part="a")
    yield from _bars("a", family, at_least(93.0))
    for noise in NOISES:
        yield from _bars(f"c, {noise}", _where(abc, part="c", noise=noise), at_least(93.0))
    for motion in BEGINNINGS:
        yield from _bars(f"b, {motion}", _where(abc, part="b", motion=motion))
    classes = sorted({(o["damper"], o["memory"]) for o in _relaxing(family)})
    for symbol, name in NUMBERS.items():
        parts = [_within(_where(family, damper=d, memory=m), name) for d, m in classes]
        worst = min(parts, key=sum)
        yield _share(
            f"a, worst of 15 classes that relax: {symbol} within two bars", worst, at_least(90)
        )


def _late(f: Outcomes) -> Iterator[Row]:
    limits = (Limit(2.0), at_least(50.0), at_least(90.0), None)
    groups = {fault: _relaxing(_where(f, fault=fault)) for fault in LATE}
    groups[f"no memory, {LATE[2]}"] = _where(f, memory="none")
    for (title, some), limit in zip(groups.items(), (*limits, None), strict=True):
        named = [bool(set(LAGS) & set(o.get("findings", ()))) for o in some]
        yield _share(f"{title}: a lag is named", named, limit)
        yield from _errors(title, some)


def _outside(g: Outcomes) -> Iterator[Row]:
    for title, some in ((SLS, _where(g, memory=SLS)), ("friction", _where(g, fault="friction"))):
        yield from _errors(title, some)
        yield from _bars(title, some)


def _changes(h: Outcomes) -> Iterator[Row]:
    changed = _where(h, fault="K + 10 %")
    quiet = {noise: _where(h, fault="clean", noise=noise) for noise in NOISES[:2]}
    for noise, some in quiet.items():
        yield _share(f"{noise}: false alarms", [o["changes"] for o in some])
    found = [any(part > 0.5 for part in o["changes"]) for o in changed]
    yield _share("K + 10 % at half time: found", found, at_least(95.0))
    for memory in ("none", "one time"):
        each = [right for right, o in zip(found, changed, strict=True) if o["memory"] == memory]
        yield _share(f"K + 10 % at half time: found, memory: {memory}", each)


def sections_of(outcomes: Outcomes) -> Iterator[Section]:
    """Yield the table of each part that was measured."""
    for parts, title, rows in (
        ("a", "a: materials of the family", _family),
        ("b", "b: little motion, materials that relax", _little_motion),
        ("c", "c: materials without memory", _memoryless),
        ("a", "d: memory named where there is some, of part a", _memory_named),
        ("abc", "e: bars, of parts a to c", _covered),
        ("f", "f: late forces", _late),
        ("g", "g: outside of the family", _outside),
        ("h", "h: alarms of ViscoelasticContact(change_detector=ChangeDetector())", _changes),
    ):
        own = [o for o in outcomes if o["part"] in parts]
        if {o["part"] for o in own} == set(parts):
            refused = sum("error" in o for o in own)
            notes = SENSOR, f"{len(own)} contacts, {refused} refused, which count as 100 % off."
            yield Section(title, list(rows(own)), notes)


def fourier_rows() -> Iterator[Row]:
    """Compare K′ of microrheology by a law with its Fourier analysis in the notes."""
    for path in recorded("F_microrheo_*.csv"):
        notes = json.loads(path.with_suffix(".json").read_text())
        known = {row["freq_hz"]: row["K_N_per_m"] for row in notes["dynamic_stiffness"]}
        result = identify(path, law="auto", trace=False)
        printed, general = result.dynamic_stiffness(), GeneralisedHuntCrossley.of(result.law)
        for hertz in (printed.frequency / TURN, 1.0, 3.0, 10.0, 30.0, 100.0):
            reference = np.interp(
                np.log(hertz), np.log(sorted(known)), [known[f] for f in sorted(known)]
            )
            ratio = general.dynamic_stiffness(printed.depth, TURN * hertz).real / reference
            where = f"{hertz:g} Hz" if hertz in known else f"the printed {hertz:.2g} Hz"
            limit = Limit(20.0) if hertz <= 10.0 else None
            off = 100.0 * abs(ratio - 1.0)
            yield Row(
                f"{path.stem}: K′ off at {where}", off, "%", reference=f"{ratio:.2f} ×", limit=limit
            )


def main(
    *,
    part: str = "abcfghm",
    seed: int = 0,
    workers: int | None = None,
    markdown: Path | None = None,
) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    part
        Letters of the parts to measure.
    seed
        Another seed draws other contacts.
    workers
        Worker processes. Default: one per core.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    todo = [case for each in part for case in cases(each)]
    outcomes = Workers(workers).map("contacts", partial(measure, seed=seed), todo)
    sections = list(sections_of(outcomes))
    if "m" in part and (rows := list(fourier_rows())):
        sections.append(Section("m: AFM microrheology against its Fourier analysis", rows))
    publish(sections, describe_machine(), "Laws with memory", markdown)


if __name__ == "__main__":
    run_command(main)
