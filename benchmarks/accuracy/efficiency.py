"""Root mean square error over the Cramér–Rao bound."""

from collections.abc import Callable
from functools import partial

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, SYMBOLS
from benchmarks.accuracy.table import Group, Limit, Line
from benchmarks.accuracy.trials import OFFSET_LEFT, SURFACE_LEFT, TIMES, Trial, bounds, rms, run

SINGLE_STAGE = tuple(f"single-stage {symbol}" for symbol in SYMBOLS)


def ideal(campaign: Campaign) -> list[Group]:
    return [
        _group(
            campaign,
            "RMSE over the Cramér–Rao bound, no offset",
            "True x and v, white noise of 0.05 N, three sines; `VariableProjection(offset=False)` "
            "and `SingleStageRLS()`.",
            [Trial(name) for name in MATERIALS],
            lambda _: Limit(1.15),
            seeds=5 * campaign.seeds,
        )
    ]


def unknown_offset(campaign: Campaign) -> list[Group]:
    return [
        _group(
            campaign,
            "RMSE over the Cramér–Rao bound, unknown offset",
            "True x and v, white noise of 0.05 N, three sines, and for each seed a force offset "
            "from N(0, (0.1 N)²); `VariableProjection()`. The bound treats the offset as a "
            "nuisance parameter.",
            [Trial(name, "offset") for name in MATERIALS],
            lambda _: Limit(1.15),
            seeds=5 * campaign.seeds,
        )
    ]


def sensor_chain(campaign: Campaign) -> list[Group]:
    variants = (
        ("offset unknown", "`VariableProjection()`", None, None),
        (
            "offset known from the pause",
            f"`offset_deviation={OFFSET_LEFT:.4f}`, the uncertainty after the pause",
            OFFSET_LEFT,
            None,
        ),
        (
            "offset known from the pause, the surface to the encoder's step",
            "The same, and `surface_deviation` as `identify` derives it from the encoder's steps",
            OFFSET_LEFT,
            SURFACE_LEFT,
        ),
    )
    return [
        _group(
            campaign,
            f"RMSE over the Cramér–Rao bound, the paper's sensor chain, {words}",
            f"{settings}. Force in steps of 1/8 N after 0.05 N of noise, a bias measured in a 2 s "
            "pause and removed, a 20 µm encoder at random alignment to the surface, velocity "
            "by a Savitzky–Golay filter of 15 ms. The bound assumes white noise of 0.05 N and an "
            "unknown offset. Quantisation of the force alone multiplies it by 1.23. It includes "
            "no prior knowledge of the offset, so ratios below 1 are possible.",
            [Trial(name, "chain", offset, surface) for name in MATERIALS],
            lambda time: Limit(1.3 if time <= 5.0 else 1.5),
            seeds=campaign.seeds,
        )
        for words, settings, offset, surface in variants
    ]


def _group(
    campaign: Campaign,
    title: str,
    definition: str,
    trials: list[Trial],
    limit: Callable[[float], Limit],
    seeds: int,
) -> Group:
    lines = []
    for trial in trials:
        outcomes = campaign.map(
            f"{trial.sensor}, {trial.material}", partial(run, trial), range(seeds)
        )
        bound = bounds(trial)
        ours = rms([outcome.errors for outcome in outcomes]) / bound
        single = rms([outcome.single_stage for outcome in outcomes]) / bound
        for i, time in enumerate(TIMES):
            name = f"{trial.material}, {time:g} s"
            lines.append(Line(name, tuple(ours[i]), (limit(time),), tuple(single[i])))
    scatter = (2.0 * seeds) ** -0.5
    notes = [f"{seeds} seeds; each ratio is known to ±{scatter:.1%} (one standard error)."]
    return Group(title, definition, SYMBOLS, lines, SINGLE_STAGE, notes=notes)
