"""When each claim of ``claims.toml`` holds, by the numbers that its experiment measures."""

from collections.abc import Mapping

from palpate.paper.judging import (
    Condition,
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
from palpate.paper.quantities import Quantity, farthest_from, largest, least, ratio, times

FOLLOWED = {
    "formula": judge("peak speed commanded"),
    "depth": judge(farthest_from(10.0, "mean depth")),
    "inside": judge(least("least depth"), above(0.0)),
    # Half a step of the sensor, 1/16 N.
    "pause": judge(farthest_from(0.0, "bias left"), between(-62.5, 62.5)),
    "rich": judge("largest error", at_most(5.0)),
}


def _repetitions(material: str) -> dict[str, Judge]:
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
    **_repetitions("pvc"),
    "differ": judge("spread pvc single-stage", above("spread {ball|sponge} single-stage")),
    "consistent": judge(
        ratio("spread pvc double-stage", "spread pvc single-stage"),
        above(1.0),
        beside="mean final double-stage n",
    ),
    "harder": judge(ratio("motion pvc", "motion ball")),
}


def _from(material: str, claimed: float) -> Judge:
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
    "from": _from("pvc", 300.0),
    "moment": judge(
        "fastest about 8.7 s pvc",
        beside="{fastest after 2 s is at|peak speed|final limit} pvc",
    ),
}

_SIZES = "overshoot P₀ = {100|1000|10000} K|B"
_STARTS = "overshoot start {I|II|III} K|B"

FORGETTING = {
    "unity": judge("λ after 1 s"),
    "varying": judge(
        ratio("varying rmse λ = 0.99", "varying rmse λ = 1"),
        below(1.0),
        beside="varying error of K λ = {0.99|1}",
    ),
    "constant": judge("largest error λ = 1", below("largest error λ = 0.99")),
    "slow": judge("time λ = 1", above("time α = 5")),
    "constant-unstable": judge(
        least("largest error λ = {0.99|0.95|0.9}"),
        above(5.0),
        beside="held {error|guarded} λ = {0.99|0.9}",
    ),
    "fluctuates": judge(ratio("scatter α = 0.1", "scatter α = 5"), above(3.0)),
    "slowly-unstable": judge("largest error α = 0.1", above(5.0), beside="held error α = 0.1"),
    "best": judge(
        "time α = 5",
        below("time {λ = 1|α = 0.1}"),
        that("scatter α = 5", below("scatter {λ = 1|α = 0.1}")),
    ),
    "balance": judge(
        largest("time α = {5|6|7|8}"),
        below("time λ = 1"),
        that(largest("scatter α = {5|6|7|8}"), below("scatter α = 0.1")),
        beside="{time|scatter} α = {1|20}",
    ),
    "alike": judge(
        ratio(*(of("time P₀ = {20|100|1000|10000|1e+06}") for of in (largest, least))),
        at_most(1.5),
        beside="time P₀ = {1|10}",
    ),
    "overshoot": judge("overshoot P₀ = 1e+06 K|B", increasing(_SIZES, "overshoot P₀ = 1e+06 K|B")),
    "by-start": judge(
        ratio(largest(_STARTS), largest(1e-3, least(_STARTS))),
        above(ratio(largest(_SIZES), largest(1e-3, least(_SIZES)))),
    ),
}

_BOTH = "{single-stage|kelvin-voigt}"
#: "The same initial conditions for the EWRLS": the same P₀ for all, and whatever it is.
_SAME = ("P₀ = 10", "P₀ = 1000", "P₀ = 1e+06")
_OVER_KELVIN_VOIGT = [
    ratio(f"time {same} single-stage K|B", f"time {same} kelvin-voigt K|B") for same in _SAME
]
_BESIDE_SPEED = (f"time {_BOTH} K|B", f"settled {_BOTH} K|B")
_OWN_UNITS = f"time {_BOTH}, own units, P₀ = {{10|1000|1e+06}}"
_DOUBLE_OVER_SINGLE = least(
    *(
        ratio(f"rmse double-stage {start}", f"rmse single-stage {start}")
        for start in ("I", "II", "III")
    )
)
_BESIDE_ERROR = [f"least double over single {same}" for same in _SAME]
_KELVIN_VOIGT_ERROR = ratio(least("rmse kelvin-voigt"), "rmse single-stage")
_RELAXING = "relaxing sponge"
_ROBUST = largest(f"spread {_BOTH}")
_WITH, _WITHOUT = (f"time {words} ln" for words in ("with", "without"))


def _concluded(*others: str, elsewhere: str = "") -> dict[str, Judge]:
    """Section VIII, on one material: more robust than the others, and closer."""
    names, start = "|".join(others), "spread P₀ = {} single-stage"
    sizes = ("10", "1000", "1e+06")
    return {
        "concluded-robust": judge(
            start.format("1000"),
            *(that(start.format(size), below(f"spread P₀ = {size} {{{names}}}")) for size in sizes),
            beside=f"spread {{single-stage|{names}}}",
            elsewhere=elsewhere,
        ),
        "concluded-error": judge(
            _DOUBLE_OVER_SINGLE, above(1.0), beside=f"rmse {{{names}}}", elsewhere=elsewhere
        ),
    }


COMPARED_ON_BALL = {
    **_concluded("double-stage", "kelvin-voigt"),
    "rate": judge(
        largest(*(f"time {same} single-stage" for same in _SAME)),
        *(that(f"time {same} single-stage", below(f"time {same} double-stage")) for same in _SAME),
    ),
    "error": judge(_DOUBLE_OVER_SINGLE, above(1.0), beside=_BESIDE_ERROR),
    "consistency": judge(
        "spread double-stage", above(5.0), that("spread single-stage", at_most(5.0))
    ),
    "wide-range": judge(
        "off the truth single-stage", at_most(5.0), that("off the truth double-stage", above(5.0))
    ),
    "kelvin-voigt-error": judge(_KELVIN_VOIGT_ERROR),
    "kelvin-voigt-rate": judge(
        largest(*_OVER_KELVIN_VOIGT), below(1.0), beside=(*_BESIDE_SPEED, _OWN_UNITS)
    ),
    "logarithm": judge(
        largest(*(ratio(f"{_WITH}, {same} K|B", f"{_WITHOUT}, {same} K|B") for same in _SAME)),
        below(1.0),
    ),
    "richer": judge(
        ratio("condition number with ln", "condition number without ln"),
        below(0.5),
        beside=[f"{words}, own units, {same}" for same in _SAME for words in (_WITH, _WITHOUT)],
    ),
    "threshold": judge(
        "bias at 0.1 K/B", at_most(5.0), beside="{0.1 − ln 1.1|−0.1 − ln 0.9|bias at 0.5 K/B}"
    ),
    "sampled": judge("error at 1000 Hz", beside="error at {500|250|100|50} Hz"),
    "parameters": unchecked(),
}

COMPARED_ON_SPONGE = {
    **_concluded("double-stage", "kelvin-voigt", elsewhere=_RELAXING),
    "kelvin-voigt-rate": judge(
        least(*_OVER_KELVIN_VOIGT),
        at_least(1.0 / 1.5),
        that(largest(*_OVER_KELVIN_VOIGT), at_most(1.5)),
        beside=_BESIDE_SPEED,
        elsewhere=_RELAXING,
    ),
    "insensitive": judge(_ROBUST, at_most(5.0), elsewhere=_RELAXING),
    "inconsistent": judge("spread double-stage", above(5.0), elsewhere=_RELAXING),
    "kelvin-voigt-error": judge(
        _KELVIN_VOIGT_ERROR, beside=f"{_RELAXING} rmse {{kelvin-voigt|single-stage}}"
    ),
    "double-stage-error": judge(
        _DOUBLE_OVER_SINGLE, above(1.0), beside=_BESIDE_ERROR, elsewhere=_RELAXING
    ),
    "parameters": unchecked(),
}

_EXTENDED = "extended-kelvin-voigt"
_EXTENDED_ERROR = least(f"rmse {_EXTENDED}")

COMPARED_ON_PHANTOM = {
    **_concluded("double-stage", "kelvin-voigt", _EXTENDED),
    "parameters": unchecked(),
    "robust": judge(_ROBUST, at_most(5.0)),
    "first-small": judge(largest("first over final single-stage {I|II|III} K|B"), below(0.1)),
    "inconsistent": judge("spread double-stage", above(5.0)),
    "kelvin-voigt-rate": judge(least(*_OVER_KELVIN_VOIGT), above(1.0), beside=_BESIDE_SPEED),
    "extended-rate": judge(
        least(*(f"time {same} {_EXTENDED} B" for same in _SAME)),
        *(that(f"time {same} {_EXTENDED} B", below(f"time {same} {_BOTH} B")) for same in _SAME),
        beside=f"time {{{_EXTENDED}|single-stage|kelvin-voigt}} B",
    ),
    "quadratic-never": judge(
        least(*(f"time {same} {_EXTENDED} K₂" for same in _SAME)),
        never(),
        beside=f"time {_EXTENDED} K₂",
    ),
    "best-error": judge(
        ratio(least(least("rmse kelvin-voigt"), _EXTENDED_ERROR), "rmse single-stage")
    ),
    "as-good": judge(ratio(_EXTENDED_ERROR, least("rmse single-stage"))),
}

_APART = (
    "apart {} {{0.01|0.02|0.05|0.1|0.2|0.3|0.5|0.5, n right|0.1, P₀ = 1e4|0.1, P₀ = 10|0.1, in cm}}"
)

NEAR_TRUTH = {
    "small-range": judge("reach ball", above(0.0), below(50.0), beside=_APART.format("ball")),
    "within-ten": judge("reach sponge", between(10.0, 10.0), beside=_APART.format("sponge")),
    # Not met where it fails; and where they are made to hold, it no longer does.
    "because": judge(
        largest("ball ends apart, {K and B given|n given}"),
        at_most(5.0),
        that("ball ends apart, starts I to III", above(5.0)),
        that("ball (5) broken, starts I to III", above(50.0)),
        that("ball (6) one-sided, starts I to III", above(0.5)),
        beside=("ball {(5) broken|(6) one-sided}, near, ending right", "apart ball 0.5, n right"),
    ),
    "power": judge(
        "ball 0.01^0.2",
        beside=("ball stage 1 {K|rmse}, n {right|0.2 too large}", "apart ball {0.1|0.1, in cm}"),
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
                for same in _SAME
            )
        ),
        below(1.0),
        beside="time one sine",
    ),
}

#: The paper's 0.05 N, read as up to half as much again.
_FLOOR = 0.075
_NEAR = ", 7 % apart"
_AFTER = "mean error after change"
_OFF = "K off at a zone's end"
_SP = "self-perturbing"


def _remains(which: str) -> Quantity:
    """The second visit of the other zone over the first."""
    return ratio(f"{_AFTER} regular{which} 3", f"{_AFTER} regular{which} 1")


def _smaller(which: str) -> Quantity:
    """How many times smaller self-perturbation makes the error."""
    return ratio(least(f"{_AFTER} regular{which}"), f"{_AFTER} {_SP}{which}")


def _tenfold(which: str) -> Condition:
    """The gain after each change."""
    before = times(10.0, f"corrected before a change {_SP}{which}")
    return that(least(f"corrected after a change {_SP}{which}"), above(before))


INTERMITTENT = {
    "first-error": judge(
        "first error regular", between(1.0, 3.0), that("first error lasts regular", at_most(4.0))
    ),
    "first-zone": judge("mean error before regular", at_most(_FLOOR)),
    "regular-error": judge(f"{_AFTER} regular{_NEAR} 1", beside=f"{_AFTER} regular 1"),
    "regular-remains": judge(
        f"{_AFTER} regular{_NEAR} 3",
        that(_remains(_NEAR), between(0.5, 2.0)),
        that(_remains(""), between(0.5, 2.0)),
        beside=(f"{_AFTER} regular{_NEAR} {{1|2|4}}", f"{_AFTER} regular {{1|3}}"),
    ),
    "regular-constant": judge(
        f"range after 10 s regular{_NEAR} K", at_most(5.0), beside="range after 10 s regular K"
    ),
    "small-gain": judge(
        "corrected before a change regular",
        below(1.0),
        that(f"corrected before a change λ = 0.99{_NEAR}", above(1.0)),
        that(f"{_AFTER} λ = 0.99{_NEAR}", below(least(f"{_AFTER} regular{_NEAR}"))),
        beside="corrected at first regular",
    ),
    "regular-unsuitable": judge(
        f"{_OFF} regular", above(20.0), beside=f"{_OFF} {{regular|{_SP}}}{_NEAR}"
    ),
    "gain-by-itself": judge(
        least(f"corrected after a change {_SP}{_NEAR}"),
        _tenfold(_NEAR),
        _tenfold(""),
        beside="corrected after a change regular",
    ),
    "perturbed-error": judge(
        f"{_AFTER} {_SP}{_NEAR}",
        at_most(_FLOOR),
        that(f"first 2 ms {_SP}{_NEAR}", between(0.25, 1.0)),
        beside=(
            f"{_AFTER} {_SP}",
            f"first 2 ms {_SP}",
            f"{_AFTER} variable projection{_NEAR}",
        ),
    ),
    "perturbed-soon": judge(
        f"mean back {_SP}{_NEAR}",
        at_most(4.0),
        beside=(
            f"back {_SP}{_NEAR}",
            f"mean back {{{_SP}|regular|constants exchanged|variable projection}}",
        ),
    ),
    "perturbed-converges": judge(
        f"{_OFF} {_SP}",
        at_most(5.0),
        beside=(f"{_OFF} {_SP}{_NEAR}", f"{_OFF} variable projection"),
    ),
    "dead-zone": judge(
        "error that perturbs",
        that(f"{_AFTER} {_SP}{_NEAR} 1", at_most(_FLOOR)),
        that(f"{_AFTER} constants exchanged{_NEAR} 1", above(_FLOOR)),
    ),
    "sensitivity": judge(
        f"{_AFTER} γ = 0.25{_NEAR} 1",
        above(2.0 * _FLOOR),
        that(f"{_AFTER} γ = 0.25 1", at_most(2.0 * _FLOOR)),
        that(f"{_AFTER} {_SP}{_NEAR} 1", at_most(_FLOOR)),
    ),
    "gain-by-contrast": judge(
        ratio("K back with β = 0.05, ten times", "K back with β = 0.05, 1.3 times"),
        increasing("K back with β = 0.05, {1.3 times|twice|ten times}"),
        beside="K back with β = {0.005|0.5|5}, {1.3 times|ten times}",
    ),
    "reset": judge(ratio(f"time of K {_SP}", "time of K no reset"), below(1.0)),
    "threshold": judge(
        "error by force above 0.5 N",
        below("error by force above 0 N"),
        that("free, but force above 0.5 N", below("free, but force above 0 N")),
        beside="contact misjudged by force above {0|0.5} N",
    ),
    "concluded": judge(
        _smaller(_NEAR),
        at_least(2.0),
        that(_smaller(""), at_least(2.0)),
        that(f"time of K {_SP}{_NEAR}", below(f"time of K regular{_NEAR}")),
        that(f"time of K {_SP}", below("time of K regular")),
    ),
}

#: By experiment and key.
JUDGES: Mapping[str, Mapping[str, Judge]] = {
    "fig03": FOLLOWED,
    "fig05": _repetitions("ball"),
    "fig06": {"holds": judge("broken after that ball", at_most(0.0)), "from": _from("ball", 90.0)},
    "fig07": FORGETTING,
    "fig08": COMPARED_ON_BALL,
    "fig09": NEAR_TRUTH,
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
    "today": {},
}
