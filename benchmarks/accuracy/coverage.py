"""How often the 95 % interval contains the truth."""

from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, SYMBOLS
from benchmarks.accuracy.table import Group, Limit, Line
from benchmarks.accuracy.trials import OFFSET_LEFT, SURFACE_LEFT, TIMES, Trial, run


def coverage(campaign: Campaign) -> list[Group]:
    ideal = "True x and v, white noise of 0.05 N, an unknown offset; `VariableProjection()`."
    chain = (
        "The paper's sensor chain with {}: an encoder's steps and a surface up to half a step "
        "away are not in the model, so 95 % is not guaranteed here."
    )
    return [
        _group(
            campaign,
            "Coverage of the 95 % interval",
            ideal,
            [Trial(name, "offset", single_stage=False) for name in MATERIALS],
            # Above 95, because a bar is never below that of white noise, and is wider because the
            # noise is not known to be white.
            (Limit(99.0, 93.0),),
            5 * campaign.seeds,
        ),
        *(
            _group(
                campaign,
                f"Coverage under the paper's sensor chain, {words}",
                chain.format(settings),
                [Trial(name, "chain", offset, surface, single_stage=False) for name in MATERIALS],
                (),
                campaign.seeds,
            )
            for words, settings, offset, surface in (
                ("offset unknown", "`VariableProjection()`", None, None),
                (
                    "offset known from the pause",
                    "`offset_deviation` set to the uncertainty after the pause",
                    OFFSET_LEFT,
                    None,
                ),
                (
                    "offset known from the pause, the surface to the encoder's step",
                    "the same, and `surface_deviation` as `identify` derives it from the steps",
                    OFFSET_LEFT,
                    SURFACE_LEFT,
                ),
            )
        ),
    ]


def _group(
    campaign: Campaign,
    title: str,
    definition: str,
    trials: list[Trial],
    limits: tuple[Limit, ...],
    seeds: int,
) -> Group:
    lines = []
    for trial in trials:
        outcomes = campaign.map(f"coverage, {trial.material}", partial(run, trial), range(seeds))
        fraction = 100.0 * np.mean([outcome.covered for outcome in outcomes], axis=0)
        lines += [
            Line(f"{trial.material}, {time:g} s", tuple(fraction[i]), limits)
            for i, time in enumerate(TIMES)
            if time >= 1.0
        ]
    spread = 196.0 * (0.95 * 0.05 / seeds) ** 0.5
    low, high = 95.0 - spread, min(95.0 + spread, 100.0)
    notes = [
        f"%, {seeds} seeds: a true 95 % shows as {low:.1f} to {high:.1f} % in 19 of 20 cells"
        " (binomial)."
    ]
    return Group(title, definition, SYMBOLS, lines, precision=".1f", notes=notes)
