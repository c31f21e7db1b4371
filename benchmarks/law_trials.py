"""Verdicts, parameters and error bars for known laws, over many seeds."""

import math

import numpy as np

from benchmarks.law_truths import (
    Truth,
    cramer_rao,
    identified,
    law_of,
    truths,
)
from benchmarks.report import Limit, Row, Section

PERCENT = 100.0
MOTION = "White noise; 4 s at 1 kHz of sines of 4, 11 and 15 rad/s about 10 mm after an approach."
# Limits for K′ and B′ at 40 dB, and for RMSE/CRLB at each.
LARGEST_OFF = 0.3, 0.8
OVER_BOUND = {30.0: 1.25, 40.0: 1.5}


def at_least(bound: float) -> Limit:
    """A lower bound."""
    return Limit(bound, at_least=True)


def measure_verdicts(seeds: range, decibels: float, full: bool) -> Section:
    """Measure how often each law is found, and then its error bars and dynamic stiffness."""
    rows = [row for truth in truths(full) for row in _rows(truth, seeds, decibels, full)]
    tier = "full" if full else "common"
    title = f"{tier} tier, {decibels:g} dB, seeds {seeds.start} to {seeds.stop - 1}"
    return Section(title, rows, (MOTION,))


def _rows(truth: Truth, seeds: range, decibels: float, full: bool) -> list[Row]:
    right, moved, covered, ratios = 0, [], [], []
    exact = truth.law.dynamic_stiffness(10e-3, 15.0)
    for seed in seeds:
        memory = "any" if full else "auto"
        estimator, (x, v, _), deviation = identified(truth.law, seed, decibels, 0.0, memory)
        found = estimator.dynamic_stiffness(10e-3, 15.0)
        away = found.stiffness - exact.real, found.damping - exact.imag / 15.0
        moved.append((away[0] / exact.real, 15.0 * away[1] / exact.imag))
        bars = found.stiffness_error, found.damping_error
        covered.append([abs(a) < 1.96 * b for a, b in zip(away, bars, strict=True)])
        if truth.found_by(estimator):
            right += 1
            bound = cramer_rao(truth, x, v, deviation)
            off = estimator.estimate().parameters - truth.law.parameters
            ratios.append(off[list(bound)] / np.array(list(bound.values())))
    size = PERCENT * np.sqrt(np.mean(np.square(moved), axis=0))
    held = PERCENT * np.mean(covered, axis=0)
    over = float(np.max(np.sqrt(np.mean(np.square(ratios), axis=0)))) if ratios else math.nan
    asked = decibels == 40.0
    off_limits = [Limit(bound) if asked else None for bound in LARGEST_OFF]
    return [
        Row(
            f"{truth.name}: right law",
            PERCENT * right / len(seeds),
            "%",
            limit=at_least(95.0) if asked else None,
        ),
        Row(f"{truth.name}: K′, rms error", size[0], "%", limit=off_limits[0]),
        Row(f"{truth.name}: B′, rms error", size[1], "%", limit=off_limits[1]),
        Row(f"{truth.name}: K′ within its bars", held[0], "%", limit=at_least(85.0)),
        Row(f"{truth.name}: B′ within its bars", held[1], "%", limit=at_least(85.0)),
        Row(f"{truth.name}: largest RMSE/CRLB", over, "", limit=Limit(OVER_BOUND[decibels])),
    ]


def measure_false_memory(seeds: range) -> Section:
    """Measure how often memory is selected for a law without it."""
    rows = []
    for name, correlation, limit in (("white", 0.0, 2.0), ("AR(1) 0.9", 0.9, 5.0)):
        for decibels in (30.0, 40.0, 50.0):
            for damping in ("hunt-crossley", "half-space"):
                found = 0
                for seed in seeds:
                    law = law_of(damping, 0.0)
                    estimator = identified(law, seed, decibels, correlation, "auto")[0]
                    found += estimator.verdict().candidate.memory != "none"
                words = f"{damping}, {name}, {decibels:g} dB"
                rows.append(Row(words, PERCENT * found / len(seeds), "%", limit=Limit(limit)))
    return Section(f"Memory where there is none, {len(seeds)} seeds", rows)
