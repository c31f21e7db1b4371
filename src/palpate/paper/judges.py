"""When each claim of ``claims.toml`` holds, by the numbers that its experiment measures."""

from collections.abc import Mapping

from palpate.paper.judging import (
    Judge,
    above,
    at_most,
    below,
    between,
    farthest_from,
    increasing,
    judge,
    largest,
    least,
    ratio,
    that,
    times,
)

# Forgetting factors that the paper recommends, and P₀ above the norm that it names.
_RECOMMENDED = [f"α = {rate}" for rate in (5, 6, 7, 8)]
_ABOVE_TEN = ["20", "100", "1000", "10000", "1e+06"]
_SIZES = [f"overshoot P₀ = {size} K|B" for size in ("100", "1000", "10000", "1e+06")]
_STARTS = [f"overshoot start {start} K|B" for start in ("I", "II", "III")]

FORGETTING = {
    "unity": judge("λ after 1 s", above(0.999)),
    "slow": judge("time λ = 1", above("time α = 5")),
    "constant-unstable": judge(
        least(*(f"largest error λ = {factor}" for factor in (0.99, 0.95, 0.9))),
        above(5.0),
        beside=[f"held {what} λ = {f}" for f in (0.99, 0.9) for what in ("error", "guarded")],
    ),
    "fluctuates": judge(ratio("scatter α = 0.1", "scatter α = 5"), above(3.0)),
    "slowly-unstable": judge("largest error α = 0.1", above(5.0), beside=["held error α = 0.1"]),
    "best": judge(
        "time α = 5",
        below("time λ = 1", "time α = 0.1"),
        that("scatter α = 5", below("scatter λ = 1", "scatter α = 0.1")),
    ),
    "balance": judge(
        largest(*(f"time {each}" for each in _RECOMMENDED)),
        below("time λ = 1"),
        that(largest(*(f"scatter {each}" for each in _RECOMMENDED)), below("scatter α = 0.1")),
        beside=["time α = 1", "scatter α = 1", "time α = 20", "scatter α = 20"],
    ),
    "alike": judge(
        ratio(*(of(*(f"time P₀ = {size}" for size in _ABOVE_TEN)) for of in (largest, least))),
        at_most(1.5),
        beside=["time P₀ = 1", "time P₀ = 10"],
    ),
    "overshoot": judge(_SIZES[-1], increasing(*_SIZES)),
    "by-start": judge(
        ratio(largest(*_STARTS), largest(1e-3, least(*_STARTS))),
        above(ratio(largest(*_SIZES[:3]), largest(1e-3, least(*_SIZES[:3])))),
    ),
}

FOLLOWED = {
    "formula": judge("peak speed commanded"),
    "depth": judge(farthest_from(10.0, "mean depth"), between(9.0, 11.0)),
    "inside": judge(least("least depth"), above(0.0)),
    # Half a step of the sensor, 1/16 N.
    "pause": judge(farthest_from(0.0, "bias left"), between(-62.5, 62.5)),
    "rich": judge("largest error", at_most(5.0)),
}


def _repetitions(material: str) -> dict[str, Judge]:
    """Footnote 3: estimates agree where they are within 5 %."""
    return {
        "agree": judge(
            f"spread {material} single-stage",
            at_most(5.0),
            beside=[f"spread {material} variable-projection"],
        ),
        "stiffness": judge("mean final single-stage K", beside=["mean final single-stage B"]),
        "ratio": judge("B/K single-stage"),
        "exponent": judge("mean final single-stage n"),
        # A Hunt–Crossley law lets an unloaded surface come back at K/B: so long from 10 mm, in ms.
        "restitution": judge(times(10.0, "B/K single-stage")),
        "elastic": judge("B/K single-stage"),
    }


PHANTOM_REPEATED = {
    **_repetitions("pvc"),
    "differ": judge(
        "spread pvc single-stage", above("spread ball single-stage", "spread sponge single-stage")
    ),
    "consistent": judge(
        ratio("spread pvc double-stage", "spread pvc single-stage"),
        above(1.0),
        beside=["mean final double-stage n"],
    ),
    "harder": judge("motion over the ball's", below(0.98)),
}

#: By experiment and key.
JUDGES: Mapping[str, Mapping[str, Judge]] = {
    "fig03": FOLLOWED,
    "fig05": _repetitions("ball"),
    "fig07": FORGETTING,
    "fig11": _repetitions("sponge"),
    "fig14": PHANTOM_REPEATED,
}
