"""``python -m benchmarks.laws``: which law it is, its memory and its numbers, against the truth.

Recordings made by others are looked for in ``PALPATE_DATA``, or ``../shared/data`` beside the
checkout, and are left out where they are absent.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import App, Parameter
from rich.console import Console

from benchmarks import machine, report
from benchmarks.law_cost import measure_cost
from benchmarks.law_recordings import folder_of_recordings, held_out, microrheology
from benchmarks.law_sums import measure_sums
from benchmarks.report import Limit, Row, Section
from palpate import (
    ContactGate,
    FlatSpectrum,
    GeneralisedHuntCrossley,
    PowerLawRelaxation,
    Scale,
    SingleRelaxation,
    ViscoelasticContact,
)
from palpate.validation import Floats
from palpate.writing import check_outputs, write_text

app = App(name="python -m benchmarks.laws", help_format="plaintext", version_flags=[])

DT = 1e-3
SECONDS = 4.0
UNITS = Scale(10e-3, 50e-3, 20.0)
GATE = ContactGate(1e-3)
EXPONENT = 1.5
STIFFNESS = 0.5 * 20.0 / 10e-3**EXPONENT
PERCENT = 100.0


@dataclass(frozen=True)
class Truth:
    """A law, and what the verdict on it should be."""

    name: str
    verdict: tuple[str, str, bool]  # damping, memory, linear
    law: GeneralisedHuntCrossley

    def found_by(self, estimator: ViscoelasticContact) -> bool:
        """Whether the verdict is this law."""
        chosen = estimator.verdict().candidate
        return (chosen.damping, chosen.memory, chosen.linear) == self.verdict


def _law(damping: str, memory: float, relaxation: Any = None, n: float = EXPONENT) -> Any:
    p = n - 1.0 if damping == "half-space" else n
    force = 0.0 if damping == "none" else 0.1
    stiffness = 0.5 * 20.0 / 10e-3**n
    return GeneralisedHuntCrossley(
        stiffness, n, force * 20.0 / 50e-3 / 10e-3**p, p, memory * stiffness, relaxation
    )


def truths(full: bool) -> Iterator[Truth]:
    """Laws without memory, and with that of one tier."""
    yield Truth("Kelvin–Voigt", ("half-space", "none", True), _law("half-space", 0.0, n=1.0))
    yield Truth("Hunt–Crossley", ("hunt-crossley", "none", False), _law("hunt-crossley", 0.0))
    yield Truth("half-space", ("half-space", "none", False), _law("half-space", 0.0))
    # Of six times a factor of four apart, or twelve of two, from two time steps on.
    low, high = (2.0**0.5, 4096.0 * 2.0**0.5) if full else (1.0, 4096.0)
    kinds: dict[str, tuple[float, Any]] = {"flat": (0.5, FlatSpectrum(low * DT, high * DT))}
    if full:
        kinds["single"] = 0.5, SingleRelaxation(0.05)
        kinds["power-law"] = 1.0, PowerLawRelaxation(0.3, low * DT, high * DT)
    for memory, (size, relaxation) in kinds.items():
        for damping in ("none", "hunt-crossley", "half-space"):
            if memory != "flat" or damping != "none":
                law = _law(damping, size, relaxation)
                yield Truth(f"{damping}, {memory}", (damping, memory, False), law)


def motion(seed: int) -> tuple[Floats, Floats]:
    """An approach of 0.4 s, and three sines of 4, 11 and 15 rad/s about 10 mm."""
    first, second = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, 2)
    time = DT * np.arange(round((SECONDS + 0.4) / DT)) - 0.4
    parts = ((1e-3, 4.0, 0.0), (1.8e-3, 11.0, first), (1.8e-3, 15.0, second))
    start = 10e-3 + sum(size * math.sin(phase) for size, _, phase in parts)
    slow = (start + 2e-3) / 0.4
    x = 10e-3 + sum(size * np.sin(rate * time + phase) for size, rate, phase in parts)
    v = sum(size * rate * np.cos(rate * time + phase) for size, rate, phase in parts)
    return np.where(time < 0.0, start + slow * time, x), np.where(time < 0.0, slow, v)


def noise(seed: int, size: int, correlation: float) -> Floats:
    """Gaussian noise of unit variance, white or AR(1)."""
    white = np.random.default_rng(10_000 + seed).standard_normal(size)
    if correlation == 0.0:
        return white
    result, now, fresh = np.empty(size), white[0], math.sqrt(1.0 - correlation**2)
    for k, each in enumerate(white.tolist()):
        result[k] = now = correlation * now + fresh * each
    return result


def identified(
    law: GeneralisedHuntCrossley, seed: int, decibels: float, correlation: float, memory: str
) -> tuple[ViscoelasticContact, tuple[Floats, Floats, Floats], float]:
    """An estimator that has learned one motion, the motion and the force, and the noise, N."""
    x, v = motion(seed)
    clean = law.force_along(x, v, DT)
    deviation = float(np.sqrt(np.mean(clean[x > 0.0] ** 2))) * 10.0 ** (-decibels / 20.0)
    force = clean + deviation * noise(seed, x.size, correlation)
    estimator = ViscoelasticContact(memory=memory, gate=GATE, scale=UNITS)  # type: ignore[arg-type]
    estimator.replay(x, v, force, at=())
    estimator.settle()
    return estimator, (x, v, force), deviation


def measure_verdicts(seeds: int, decibels: float, full: bool) -> Section:
    """How often each law is found, and what bars and dynamic stiffness are worth then."""
    memory, rows = "any" if full else "auto", []
    for truth in truths(full):
        right, moved, covered, ratios = 0, [], [], []
        for seed in range(seeds):
            estimator, samples, deviation = identified(truth.law, seed, decibels, 0.0, memory)
            found = truth.found_by(estimator)
            right += found
            told = estimator.dynamic_stiffness(10e-3, 15.0)
            exact = truth.law.dynamic_stiffness(10e-3, 15.0)
            away = told.stiffness - exact.real, told.damping - exact.imag / 15.0
            moved.append((away[0] / exact.real, 15.0 * away[1] / exact.imag))
            bars = told.stiffness_error, told.damping_error
            covered.append([abs(a) < 1.96 * b for a, b in zip(away, bars, strict=True)])
            if found:
                bound = cramer_rao(truth, samples[0], samples[1], deviation)
                off = estimator.estimate().parameters - truth.law.parameters
                ratios.append(off[list(bound)] / np.array(list(bound.values())))
        size = PERCENT * np.sqrt(np.mean(np.square(moved), axis=0))
        held = PERCENT * np.mean(covered, axis=0)
        over = float(np.max(np.sqrt(np.mean(np.square(ratios), axis=0)))) if ratios else math.nan
        rows += [
            Row(f"{truth.name}: right law", PERCENT * right / seeds, "%", limit=at_least(95.0)),
            Row(f"{truth.name}: K′, rms error", size[0], "%", limit=Limit(0.3)),
            Row(f"{truth.name}: B′, rms error", size[1], "%", limit=Limit(0.8)),
            Row(f"{truth.name}: K′ within its bars", held[0], "%", limit=at_least(85.0)),
            Row(f"{truth.name}: B′ within its bars", held[1], "%", limit=at_least(85.0)),
            Row(f"{truth.name}: largest RMSE/CRLB", over, "", limit=Limit(1.5)),
        ]
    tier = "full" if full else "everyday"
    return Section(f"{tier} tier, {decibels:g} dB, {seeds} seeds", rows, (MOTION,))


MOTION = "White noise; 4 s at 1 kHz of sines of 4, 11 and 15 rad/s about 10 mm after an approach."


def at_least(bound: float) -> Limit:
    """A lower bound."""
    return Limit(bound, at_least=True)


def cramer_rao(truth: Truth, x: Floats, v: Floats, deviation: float) -> dict[int, float]:
    """The least standard errors of the numbers of a law that are fitted, by their places."""
    damping, memory, linear = truth.verdict
    places = [0] + ([] if linear else [1]) + ([] if damping == "none" else [2])
    places += {"none": [], "flat": [4], "single": [4, 7], "power-law": [4, 5]}[memory]
    columns = []
    for place in places:
        step = 1e-5 * truth.law.parameters[place]
        sides = []
        for sign in (1.0, -1.0):
            numbers = truth.law.parameters
            numbers[place] += sign * step
            if place == 1:
                numbers[3] += sign * step  # p goes with n
            sides.append(GeneralisedHuntCrossley.from_parameters(numbers).force_along(x, v, DT))
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    slopes = np.column_stack([*columns, np.ones_like(x)])[x > GATE.minimum_penetration]
    size = np.linalg.norm(slopes, axis=0)
    inverse = np.linalg.inv((slopes / size).T @ (slopes / size))
    errors = deviation * np.sqrt(np.diag(inverse)) / size
    return dict(zip(places, errors.tolist(), strict=False))


def measure_false_memory(seeds: int) -> Section:
    """How often memory is found where there is none."""
    rows = []
    for name, correlation, limit in (("white", 0.0, 2.0), ("AR(1) 0.9", 0.9, 5.0)):
        for decibels in (30.0, 40.0, 50.0):
            for damping in ("hunt-crossley", "half-space"):
                found = 0
                for seed in range(seeds):
                    law = _law(damping, 0.0)
                    estimator = identified(law, seed, decibels, correlation, "auto")[0]
                    found += estimator.verdict().candidate.memory != "none"
                words = f"{damping}, {name}, {decibels:g} dB"
                rows.append(Row(words, PERCENT * found / seeds, "%", limit=Limit(limit)))
    return Section(f"Memory where there is none, {seeds} seeds", rows)


def measure_recordings(folder: Path) -> Section:
    """How far the law of one part of a recording predicts the other, over Hunt–Crossley."""
    rows = []
    for split, limit in (("second half", 0.72), ("odd blocks", 0.62)):
        ratios = held_out(folder, split)
        rows += [Row(f"{split}: {name}", ratio, "") for name, ratio in ratios.items()]
        mean = float(np.exp(np.mean(np.log(list(ratios.values())))))
        rows.append(Row(f"{split}: geometric mean of {len(ratios)}", mean, "", limit=Limit(limit)))
        if split == "odd blocks":
            worst = max(ratios.values())
            rows.append(Row("odd blocks: the largest", worst, "", limit=Limit(1.1)))
    for name, stiffness, damping in microrheology(folder):
        rows += [
            Row(f"{name}: K′ at 100 Hz", PERCENT * abs(stiffness), "%", limit=Limit(25.0)),
            Row(f"{name}: B′ at 100 Hz", PERCENT * abs(damping), "%", limit=Limit(10.0)),
        ]
    return Section("Recordings made by others: RMSE of the held-out part over that of HC", rows)


@app.default
def main(
    *,
    quick: Annotated[bool, Parameter(negative="")] = False,
    seeds: int = 100,
    markdown: Path | None = None,
) -> None:
    """Measure, and print a table.

    Parameters
    ----------
    quick
        A short run, for a first look: 5 seeds.
    seeds
        So many of each law.
    markdown
        Write the tables to this file as Markdown.
    """
    check_outputs([] if markdown is None else [markdown])
    count = 5 if quick else seeds
    sections: list[Section] = [measure_sums()]
    sections += [measure_verdicts(count, 40.0, full) for full in (False, True)]
    # Where others are at work too some ten passes leave little of them.
    sections += [measure_false_memory(count), measure_cost(20_000, 3 if quick else 20)]
    folder = folder_of_recordings()
    if folder is not None:
        sections.append(measure_recordings(folder))
    show(sections, markdown)


def show(sections: Sequence[Section], markdown: Path | None) -> None:
    """Print the tables, and write them down where that is asked for."""
    where = machine.describe("")
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=140)
    report.print_sections(sections, where, console)
    if markdown is not None:
        write_text(markdown, report.as_markdown(sections, where))


if __name__ == "__main__":
    app()
