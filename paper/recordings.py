"""The paper's methods, initial values and tables on recordings of others: ``--recording FILE …``.

Nothing is simulated, and no truth is known: what can be compared is how well each method predicts
the force, and whether its result depends on the initial values.
"""

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np

import palpate
from paper import rig
from paper.experiment import Floats, Table, by_symbol
from paper.judging import Numbers, format_values, number, readable

#: The paper's methods, and variable projection from the same samples.
METHODS: Mapping[str, rig.Method] = {
    "single stage": palpate.SingleStageRLS,
    "double stage": palpate.DoubleStageRLS,
    "Kelvin–Voigt": palpate.KelvinVoigtRLS,
    "extended": palpate.ExtendedKelvinVoigtRLS,
    "variable projection": palpate.VariableProjection,
}
#: A sample is used from these shares of the largest force and penetration on, since recordings
#: differ by 1e4 in both.
LEAST = 0.05
#: The error is counted after 0.2 s of contact, as in the paper, or a fifth of it if that is less.
BEGIN, SHARE = 0.2, 0.2
#: Seeded initial values: K and B/K within these decades, n within these values.
STARTS, SEED = 10, 2012
DECADES, DAMPING, EXPONENTS = (1.0, 5.0), (-2.0, 1.0), (0.5, 3.0)
_FILE = Path(__file__).with_name("recordings.json")
ABOUT = (
    "How do the paper's methods compare on contacts that others recorded? Nothing is simulated, "
    "and no truth is known: the table has the error of the predicted force, and whether a result "
    "depends on the initial values. Where the recordings are from: [sources](sources.md)."
)
NOTE = (
    "RMSE%: one-step prediction error, 100 √(Σe²/ΣF²), after 0.2 s of contact, the smallest over "
    "the initial values of the paper's tables (I to III, low and high); bold: the smallest of "
    "all. *single* and *double*: range of K of these stages, %, over sets I to III, and over ten "
    "seeded initial values (K 10 to 1e5, B/K 0.01 to 10 s/m, n 0.5 to 3). P₀, in SI, is the "
    "default of each method: 1e3 for the single stage, 1e8 for Kelvin–Voigt and stage 1, 1e10 for"
    " the extended law. *Final law*: RMSE% of the last law on all samples in contact, of the "
    "single stage, and of `palpate identify` by default, which selects a law and an offset of the"
    " force."
)


def measure(path: Path) -> dict[str, float]:
    """Return the numbers of a recording."""
    contact = palpate.prepare(path)
    strongest, deepest = np.nanmax(contact.force), np.nanmax(contact.penetration)
    gate = palpate.ContactGate(
        minimum_penetration=LEAST * float(deepest), make_force=LEAST * float(strongest)
    )
    numbers: dict[str, float] = {"peak force [N]": strongest, "peak depth [mm]": 1e3 * deepest}
    random = np.random.default_rng(SEED)
    seeded = {str(k): _start(random) for k in range(STARTS)}
    for name, kind in METHODS.items():
        projected = kind is palpate.VariableProjection
        starts = {} if projected else rig.starts_of(contact, kind, gate=gate)
        results = rig.from_starts(contact, kind, starts, gate=gate)
        if projected:
            results = {rig.NO_START: rig.identified(contact, kind, gate=gate)}
        for start, result in results.items():
            numbers[f"rmse {name} {start} [%]"] = _error(result)
        if len(results) > 1:
            apart = 100.0 * rig.spread(results.values())[-1]
            numbers |= by_symbol(f"spread {name}", apart, "%", kind.law_type)
        if kind.law_type is palpate.HuntCrossley and not projected:
            others = rig.from_starts(contact, kind, seeded, gate=gate)
            apart = 100.0 * rig.spread(others.values())[-1]
            numbers |= by_symbol(f"seeded {name}", apart, "%", kind.law_type)
        numbers |= _pull(name, next(iter(results.values())))
    single = rig.identified(contact, palpate.SingleStageRLS, gate=gate)
    inside = single.trace.taken
    stiffness, damping, exponent = single.law.parameters
    speed = np.abs(contact.velocity[inside])
    broken = 100.0 * float(np.mean(speed * abs(damping) >= 0.1 * stiffness))
    numbers |= {"B/K [s/m]": damping / stiffness, "n": exponent, "broken [%]": broken}
    leaving = (contact.penetration > LEAST * deepest) & (contact.velocity < 0.0)
    numbers["least force while withdrawing [%]"] = 100.0 * contact.force[leaving].min() / strongest
    default = palpate.identify(contact)
    for name, result in {"single stage": single, "palpate": default}.items():
        left = (contact.force - result.predicted_force(contact))[inside]
        numbers[f"final {name} [%]"] = _percent(left, contact.force[inside])
    return {name: float(value) for name, value in numbers.items()}


def _start(random: np.random.Generator) -> palpate.HuntCrossley:
    stiffness, dissipation = (10.0 ** random.uniform(*each) for each in (DECADES, DAMPING))
    exponent = random.uniform(*EXPONENTS)
    return palpate.HuntCrossley(K=stiffness, B=stiffness * dissipation, n=exponent)


def _error(result: palpate.Identification) -> float:
    contact, taken = result.contact, result.trace.taken
    elapsed = np.cumsum(contact.time_steps[taken])
    counted = elapsed > min(BEGIN, SHARE * elapsed[-1])
    error = (contact.force - result.trace.predicted_force)[taken]
    return _percent(error[counted], contact.force[taken][counted])


def _percent(error: Floats, force: Floats) -> float:
    return 100.0 * float(np.sqrt(np.dot(error, error) / np.dot(force, force)))


def _pull(name: str, result: palpate.Identification) -> dict[str, float]:
    """Return the energy that a law gives while it pulls on withdrawal, in percent of the press."""
    contact = result.contact
    force = result.law.force(contact.penetration, contact.velocity)
    work = force * contact.velocity * contact.time_steps * (contact.penetration > 0.0)
    given = work[(force < 0.0) & (contact.velocity < 0.0)].sum()
    return {f"energy given {name} [%]": 100.0 * given / work[contact.velocity > 0.0].sum()}


@cache
def measured() -> Mapping[str, Numbers]:
    """Return the committed numbers of each recording, by its name; none without the file."""
    every = json.loads(_FILE.read_text(encoding="utf-8")) if _FILE.is_file() else {}
    return {
        name: {key: math.nan if value is None else value for key, value in numbers.items()}
        for name, numbers in every.items()
    }


def plain(every: Mapping[str, Numbers]) -> dict[str, dict[str, float | None]]:
    """Return the numbers to four digits, None if not finite."""
    return {
        name: {k: float(f"{v:.4g}") if math.isfinite(v) else None for k, v in numbers.items()}
        for name, numbers in every.items()
    }


def table(every: Mapping[str, Numbers]) -> Table:
    """Return the table of methods by recording; the smallest error of each is bold."""
    rows = []
    for name, numbers in every.items():
        errors = [_least(numbers, method) for method in METHODS]
        cells = [f"**{e:.3g}**" if e == min(errors) else f"{e:.3g}" for e in errors]
        spreads = [
            readable(number(f"{which} {method} K").of(numbers))
            for method in ("single stage", "double stage")
            for which in ("spread", "seeded")
        ]
        finals = [f"{numbers[f'final {method} [%]']:.3g}" for method in ("single stage", "palpate")]
        rows.append((name, *cells, *spreads, *finals))
    spread_of = [f"{m}, {which}" for m in ("single", "double") for which in ("sets", "seeded")]
    header = ("recording", *METHODS, *spread_of, "final law: single stage", "palpate")
    return Table("RMSE% by method and recording", header, tuple(rows), NOTE)


def losses(every: Mapping[str, Numbers]) -> Iterator[str]:
    """Say where a method of the paper predicts the force better than palpate, and by how much."""
    for name, numbers in every.items():
        errors = {method: _least(numbers, method) for method in METHODS}
        own = errors.pop("variable projection")
        winner = min(errors, key=errors.__getitem__)
        words = []
        if errors[winner] < own:
            words.append(f"variable projection {own:.3g} %, {winner} {errors[winner]:.3g} %")
        single, default = (numbers[f"final {method} [%]"] for method in ("single stage", "palpate"))
        if single < default:
            words.append(
                f"final law of palpate {default:.3g} %, of the single stage {single:.3g} %"
            )
        if words:
            yield f"{name}: {'; '.join(words)}"


def summary(every: Mapping[str, Numbers]) -> Iterator[str]:
    """Say what the recordings answer to the paper's comparisons."""
    for better, worse, words in (
        ("single stage", "Kelvin–Voigt", ", as the paper says"),
        ("single stage", "double stage", ", as the paper says"),
        ("extended", "single stage", "; the paper says the reverse"),
        ("variable projection", "single stage", ""),
    ):
        won = sum(_least(numbers, better) < _least(numbers, worse) for numbers in every.values())
        count = f"{won} of {len(every)} recordings"
        yield f"{better} predicts the force better than {worse} on {count}{words}"
    for method in ("single stage", "double stage"):
        for which, words in (("spread", "sets I to III"), ("seeded", "seeded initial values")):
            apart = [number(f"{which} {method} K").of(numbers) for numbers in every.values()]
            yield f"spread of K over {words}, {method}: {format_values(apart, '%')}"


def _least(numbers: Numbers, method: str) -> float:
    return min(value for key, value in numbers.items() if key.startswith(f"rmse {method} "))


def markdown(every: Mapping[str, Numbers]) -> str:
    """Return the page."""
    shown = table(every)
    lines = ["| " + " | ".join(row) + " |" for row in (shown.header, *shown.rows)]
    lines[1:1] = ["|---" * len(shown.header) + "|"]
    items = [f"- {words}" for words in summary(every)]
    lost = [f"- {words}" for words in losses(every)] or ["Nowhere."]
    parts = [ABOUT, "", *items, "", *lines, "", shown.note, "", "## Where palpate loses", "", *lost]
    return "\n".join(["# Methods on recordings of others", "", *parts]) + "\n"
