"""A hundred seconds at one penetration, then moving again."""

from collections import Counter
from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, SYMBOLS, Floats, feed, noise, sines
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import VariableProjection

BEFORE, HOLD, AFTER = 10_000, 100_000, 10_000  # samples
DEPTH = 10.5e-3  # m
LOOK = 100  # samples between two estimates


def holding(campaign: Campaign) -> list[Group]:
    lines, notes = [], [f"{campaign.seeds} seeds."]
    for material in MATERIALS:
        runs = campaign.map(
            f"holding, {material}", partial(_moves, material), range(campaign.seeds)
        )
        hold = np.max([run[0] for run in runs], axis=0)
        after = np.max([run[1] for run in runs], axis=0)
        lines.append(Line(material, tuple(hold.tolist()), (Limit(1.0),), tuple(after.tolist())))
        flags = Counter(flag for run in runs for flag in run[2])
        held = "; ".join(f"“{flag}” ({count})" for flag, count in flags.most_common())
        notes.append(f"{material}, flags of a contact held from the start: {held}.")
    return [
        Group(
            "Held for 100 s",
            "Three sines for 10 s, 100 s held at 10.5 mm, three sines for 10 s; 0.05 N of noise, "
            "`VariableProjection()`. Largest change of a parameter since the hold began, %, "
            "checked every 0.1 s; last columns: the same after the hold.",
            SYMBOLS,
            lines,
            tuple(f"after: {symbol}" for symbol in SYMBOLS),
            precision=".3f",
            notes=notes,
        )
    ]


def _moves(material: str, seed: int) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Return the largest changes during and after the hold [%], and the flags of a held contact."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    motion = sines((BEFORE + AFTER) * 1e-3)
    x = np.insert(motion.penetration, BEFORE, np.full(HOLD, DEPTH))
    v = np.insert(motion.velocity, BEFORE, np.zeros(HOLD))
    f = law.force(x, v) + noise(rng, len(x))
    ends = range(BEFORE, len(x) + 1, LOOK)
    known = np.array([e.parameters for e in feed(VariableProjection(), x, v, f, ends)])
    moves = 100.0 * np.abs(known / known[0] - 1.0)
    looks = HOLD // LOOK
    held = slice(BEFORE, BEFORE + HOLD)
    (estimate,) = feed(VariableProjection(), x[held], v[held], f[held], [HOLD])
    return moves[: looks + 1].max(axis=0), moves[looks + 1 :].max(axis=0), estimate.flags
