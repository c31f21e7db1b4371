"""When each claim of ``claims.toml`` holds, by the numbers that its experiment measures."""

from collections.abc import Mapping

from palpate.paper.judging import (
    Judge,
    about,
    above,
    at_least,
    at_most,
    below,
    between,
    finite,
    increasing,
    judge,
    never,
    that,
    unchecked,
)
from palpate.paper.quantities import farthest_from, largest, least, ratio, times

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


def _from(material: str, claimed: float) -> Judge:
    """From when on condition 10 holds, ms."""
    beside = [
        f"holds from P₀ = {each} {material}"
        for each in ("10, ours", "100000, every positive force")
    ]
    return judge(f"holds from {material}", about(claimed), beside=beside)


def _violated(material: str, ending: str = "") -> dict[str, Judge]:
    return {
        f"violated{ending}": judge(
            f"seconds until it holds {material}", about(5.0), beside=[f"broken {material}"]
        ),
        f"margin{ending}": judge(f"fastest after 5 s {material}", above(0.75), below(1.0)),
    }


CONDITION_ON_SPONGE = {
    **_violated("sponge"),
    **_violated("relaxing-sponge", "-relaxing"),
    "speed": judge(
        "worst error, 1 times slower",
        above("worst error, 10 times slower"),
        beside=["worst error, 2 times slower"],
    ),
    "shortcoming": judge("broken sponge", above(0.0)),
    "limit": judge("final limit sponge"),
    "conservative": judge("worst error, 1 times slower", at_most(5.0)),
}

CONDITION_ON_PHANTOM = {
    # "A few samples" may be broken where the condition is said to be met: so much of the contact.
    "final": judge("faster than the final limit pvc", at_most(0.5)),
    "from": _from("pvc", 300.0),
    "moment": judge(
        "fastest about 8.7 s pvc",
        that("broken about 8.7 s pvc", above(0.0)),
        beside=["fastest after 2 s is at pvc", "peak speed pvc", "final limit pvc"],
    ),
}

_BOTH = ("single-stage", "kelvin-voigt")
_OVER_KELVIN_VOIGT = ratio("time single-stage K|B", "time kelvin-voigt K|B")
_BESIDE_SPEED = [
    *(f"time P₀ = {size} {method} K|B" for size in ("10", "1000", "1e+06") for method in _BOTH),
    *(f"settled {method} K|B" for method in _BOTH),
]
_DOUBLE_OVER_SINGLE = least(
    *(
        ratio(f"rmse double-stage {start}", f"rmse single-stage {start}")
        for start in ("I", "II", "III")
    )
)
_KELVIN_VOIGT_ERROR = ratio(least("rmse kelvin-voigt"), "rmse single-stage")
_EXTENDED = "extended-kelvin-voigt"
_RELAXING = "relaxing sponge"

COMPARED_ON_BALL = {
    "rate": judge("time single-stage", below("time double-stage")),
    "error": judge(_DOUBLE_OVER_SINGLE, above(1.0)),
    "consistency": judge(
        "spread double-stage", above(5.0), that("spread single-stage", at_most(5.0))
    ),
    "wide-range": judge(
        "off the truth single-stage", at_most(5.0), that("off the truth double-stage", above(5.0))
    ),
    "kelvin-voigt-error": judge(_KELVIN_VOIGT_ERROR, above(1.0)),
    "kelvin-voigt-rate": judge(_OVER_KELVIN_VOIGT, below(1.0), beside=_BESIDE_SPEED),
    "parameters": unchecked(),
}

COMPARED_ON_SPONGE = {
    "kelvin-voigt-rate": judge(
        _OVER_KELVIN_VOIGT, between(1.0 / 1.5, 1.5), beside=_BESIDE_SPEED, elsewhere=_RELAXING
    ),
    "insensitive": judge(
        largest(*(f"spread {method}" for method in _BOTH)), at_most(5.0), elsewhere=_RELAXING
    ),
    "inconsistent": judge("spread double-stage", above(5.0), elsewhere=_RELAXING),
    "kelvin-voigt-error": judge(_KELVIN_VOIGT_ERROR, above(1.0), elsewhere=_RELAXING),
    "double-stage-error": judge(_DOUBLE_OVER_SINGLE, above(1.0), elsewhere=_RELAXING),
    "parameters": unchecked(),
}

COMPARED_ON_PHANTOM = {
    "parameters": unchecked(),
    "robust": judge(largest(*(f"spread {method}" for method in _BOTH)), at_most(5.0)),
    "first-small": judge(
        largest(*(f"first over final single-stage {start} K|B" for start in ("I", "II", "III"))),
        below(0.1),
    ),
    "inconsistent": judge("spread double-stage", above(5.0)),
    "kelvin-voigt-rate": judge(_OVER_KELVIN_VOIGT, above(1.0), beside=_BESIDE_SPEED),
    "extended-rate": judge(f"time {_EXTENDED} B", below(*(f"time {method} B" for method in _BOTH))),
    "quadratic-never": judge(
        f"time {_EXTENDED} K₂",
        never(),
        beside=[f"time P₀ = {size} {_EXTENDED} K₂" for size in ("10", "1000", "1e+06")],
    ),
    "best-error": judge(
        ratio(least(least("rmse kelvin-voigt"), least(f"rmse {_EXTENDED}")), "rmse single-stage"),
        above(1.0),
    ),
    "as-good": judge(
        ratio(least(f"rmse {_EXTENDED}"), least("rmse single-stage")),
        below(1.1),
        that(least(f"rmse {_EXTENDED}"), below(least("rmse kelvin-voigt"))),
    ),
}

_OTHERWISE = ["0.5, n right", "0.1, P₀ = 1e4", "0.1, P₀ = 10", "0.1, in cm"]


def _apart(material: str) -> list[str]:
    """How far apart the starts end."""
    near = ["0.01", "0.02", "0.05", "0.1", "0.2", "0.3", "0.5", *_OTHERWISE]
    return [f"apart {material} {case}" for case in near]


_PULL = "least force, ideal probe,"

NEAR_SURFACE = {
    "negative-force": judge(
        "least force Kelvin–Voigt",
        below(0.0),
        beside=["least force single stage", "least force variable projection"],
    ),
    "always-positive": judge("least force felt", at_least(0.0), beside=["least force measured"]),
    "power": judge(
        "energy given Kelvin–Voigt", above(0.0), that("energy given single stage", at_most(0.0))
    ),
    "damping-and-speed": judge(
        f"{_PULL} three times the damping",
        below(f"{_PULL} as it is"),
        that(f"{_PULL} half the speed", above(f"{_PULL} as it is")),
    ),
    "deep-enough": judge("least force 10 mm deep", above(0.0)),
}

_BY_SIZE = [f"time P₀ = {size} one sine" for size in ("1", "10", "100", "1000", "10000", "1e+06")]

RICHNESS = {
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
        beside=[
            *(f"time P₀ = {size} one sine, 450 s" for size in ("0.1", "1", "10")),
            "time of variable projection one sine",
        ],
    ),
    "one-consistent": judge("largest difference from three sines, one sine", at_most(5.0)),
    "not-enough": judge(
        largest(*(f"condition number of {of}, one sine" for of in ("1, v, x", "x, v, a"))),
        above(1e6),
        beside=["condition number of 1, v, ln x, one sine"],
    ),
    "richer": judge(
        ratio(*(f"condition number of {of}, one sine" for of in ("1, v, ln x", "1, v, x"))),
        below(0.5),
    ),
}

RICHNESS_FOR_KELVIN_VOIGT = {
    "one-enough": judge("time one sine", finite(), beside=["time two sines", *_BY_SIZE]),
    "sooner": judge(ratio("time one sine", "time of single-stage one sine K|B"), below(1.0)),
}

#: The paper's 0.05 N, read as up to half as much again.
_FLOOR = 0.075
_TENTH = ", a tenth stiffer"
_AFTER = "mean error after change"

INTERMITTENT = {
    "first-error": judge(
        "first error regular", between(1.0, 3.0), that("first error lasts regular", at_most(4.0))
    ),
    "first-zone": judge("mean error before regular", at_most(_FLOOR)),
    "regular-error": judge(
        f"{_AFTER} regular 1", between(0.25, 1.0), beside=[f"{_AFTER} regular{_TENTH} 1"]
    ),
    "regular-remains": judge(
        f"{_AFTER} regular 3",
        above(2.0 * _FLOOR),
        that(f"{_AFTER} regular 1", above(2.0 * _FLOOR)),
        beside=[f"{_AFTER} regular 2", f"{_AFTER} regular 4"],
    ),
    "regular-constant": judge(
        "range after 10 s regular K", at_most(5.0), beside=[f"range after 10 s regular{_TENTH} K"]
    ),
    "regular-unsuitable": judge("K off at a zone's end regular", above(20.0)),
    "perturbed-error": judge(
        f"{_AFTER} self-perturbing",
        at_most(_FLOOR),
        beside=[f"{_AFTER} self-perturbing{_TENTH}", f"{_AFTER} variable projection"],
    ),
    "perturbed-soon": judge(
        "back self-perturbing",
        at_most(2.0),
        beside=["back regular", "back constants exchanged", "back variable projection"],
    ),
    "perturbed-converges": judge(
        "K off at a zone's end self-perturbing",
        at_most(5.0),
        beside=["K off at a zone's end variable projection"],
    ),
    "dead-zone": judge(
        "error that perturbs",
        that(f"{_AFTER} self-perturbing{_TENTH} 1", at_most(_FLOOR)),
        that(f"{_AFTER} constants exchanged{_TENTH} 1", above(_FLOOR)),
    ),
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
    "fig06": {"holds": judge("broken after that ball", at_most(0.0)), "from": _from("ball", 90.0)},
    "fig07": FORGETTING,
    "fig08": COMPARED_ON_BALL,
    "fig09": {
        "small-range": judge("reach ball", above(0.0), below(50.0), beside=_apart("ball")),
        "within-ten": judge("reach sponge", between(10.0, 10.0), beside=_apart("sponge")),
    },
    "fig10": NEAR_SURFACE,
    "fig11": _repetitions("sponge"),
    "fig12": CONDITION_ON_SPONGE,
    "fig13": COMPARED_ON_SPONGE,
    "fig14": PHANTOM_REPEATED,
    "fig15": CONDITION_ON_PHANTOM,
    "fig16": COMPARED_ON_PHANTOM,
    "fig17": RICHNESS,
    "fig18": RICHNESS_FOR_KELVIN_VOIGT,
    "fig19": INTERMITTENT,
}
