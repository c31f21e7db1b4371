"""What is said of motions: followed, repeated, slow enough, near the surface, rich enough."""

from palpate.paper.judges.methods import SAME
from palpate.paper.judging import (
    Judge,
    about,
    above,
    at_least,
    at_most,
    below,
    between,
    finite,
    judge,
    that,
)
from palpate.paper.quantities import farthest_from, largest, least, ratio, times

FOLLOWED = {
    "formula": judge("peak speed commanded"),
    "depth": judge(farthest_from(10.0, "mean depth")),
    "inside": judge(least("least depth"), above(0.0)),
    # Half a step of the sensor, 1/16 N.
    "pause": judge(farthest_from(0.0, "bias left"), between(-62.5, 62.5)),
    "rich": judge("largest error", at_most(5.0)),
}


def repetitions(material: str) -> dict[str, Judge]:
    """Footnote 3: estimates agree where they are within 5 %."""
    spread = f"spread {material}"
    return {
        "agree": judge(
            f"{spread} single-stage", at_most(5.0), beside=f"{spread} variable-projection"
        ),
        "stiffness": judge("mean final single-stage K", beside="mean final single-stage B"),
        "ratio": judge("B/K single-stage"),
        "exponent": judge("mean final single-stage n"),
        # A Hunt–Crossley law lets an unloaded surface come back at K/B: so long from 10 mm, in ms.
        "restitution": judge(times(10.0, "B/K single-stage")),
        "elastic": judge("B/K single-stage"),
    }


PHANTOM_REPEATED = {
    **repetitions("pvc"),
    "differ": judge("spread pvc single-stage", above("spread {ball|sponge} single-stage")),
    "consistent": judge(
        ratio("spread pvc double-stage", "spread pvc single-stage"),
        above(1.0),
        beside="mean final double-stage n",
    ),
    "harder": judge(ratio("motion pvc", "motion ball")),
}


def holds_from(material: str, claimed: float) -> Judge:
    """From when on condition 10 holds, ms."""
    others = f"holds from P₀ = {{10, ours|100000, every positive force}} {material}"
    return judge(f"holds from {material}", about(claimed), beside=others)


CONDITION_ON_SPONGE = {
    "violated": judge("seconds until it holds sponge", about(5.0), beside="broken sponge"),
    "margin": judge("fastest after 5 s sponge", above(0.75), below(1.0)),
    "violated-relaxing": judge(
        "seconds until it holds relaxing-sponge", beside="broken relaxing-sponge"
    ),
    "margin-relaxing": judge("fastest after 5 s relaxing-sponge"),
    "speed": judge(
        "worst error, 1 times slower",
        above("worst error, 10 times slower"),
        beside="worst error, 2 times slower",
    ),
    "shortcoming": judge("broken sponge"),
    "limit": judge("final limit sponge"),
    "conservative": judge("worst error, 1 times slower", at_most(5.0)),
    "concluded": judge("broken, 10 times slower", beside="broken, 1 times slower"),
}

CONDITION_ON_PHANTOM = {
    "final": judge("faster than the final limit pvc"),
    "from": holds_from("pvc", 300.0),
    "moment": judge(
        "fastest about 8.7 s pvc",
        beside="{fastest after 2 s is at|peak speed|final limit} pvc",
    ),
}

_PULL = "least force, ideal probe,"

NEAR_SURFACE = {
    "negative-force": judge(
        "least force Kelvin–Voigt",
        below(0.0),
        beside="least force {single stage|variable projection}",
    ),
    "always-positive": judge("least force felt", beside="least force measured"),
    "power": judge("energy given Kelvin–Voigt", beside="energy given single stage"),
    "damping-and-speed": judge(
        f"{_PULL} three times the damping",
        below(f"{_PULL} as it is"),
        that(f"{_PULL} half the speed", above(f"{_PULL} as it is")),
    ),
    "deep-enough": judge("least force 10 mm deep", above(0.0)),
}

_BY_SIZE = "time P₀ = {1|10|100|1000|10000|1e+06} one sine"
_CONDITION = "condition number of {}, one sine"
_CONDITIONS = {of: _CONDITION.format(of) for of in ("1, v, ln x", "1, v, x", "x, v, a")}

RICHNESS = {
    "too-long": judge(
        "time one sine",
        above(5.0),
        beside=("time {two|three} sines", "time P₀ = {0.1|1|10} one sine, 450 s"),
    ),
    "two-enough": judge(
        "largest difference from three sines, two sines",
        at_most(5.0),
        that("time two sines", finite()),
    ),
    "one-converges": judge("time one sine", finite()),
    "one-slower": judge(ratio("time one sine", "time three sines"), at_least(2.0), beside=_BY_SIZE),
    "five-hundred": judge(
        "time one sine",
        finite(),
        above(100.0),
        beside=("time P₀ = {0.1|1|10} one sine, 450 s", "time of variable projection one sine"),
    ),
    "one-consistent": judge("largest difference from three sines, one sine", at_most(5.0)),
    "not-enough": judge(
        largest(_CONDITIONS["1, v, x"], _CONDITIONS["x, v, a"]),
        above(1e6),
        beside=_CONDITIONS["1, v, ln x"],
    ),
    "richer": judge(ratio(_CONDITIONS["1, v, ln x"], _CONDITIONS["1, v, x"]), below(0.5)),
}

RICHNESS_FOR_KELVIN_VOIGT = {
    "one-enough": judge("time one sine", finite(), beside=("time two sines", _BY_SIZE)),
    "sooner": judge(
        largest(
            *(
                ratio(f"time {same} one sine", f"time {same} of single-stage one sine K|B")
                for same in SAME
            )
        ),
        below(1.0),
        beside="time one sine",
    ),
}
