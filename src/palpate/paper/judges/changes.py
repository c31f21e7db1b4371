"""What is said of a change of material: section VII."""

from palpate.paper.judging import (
    Condition,
    above,
    at_least,
    at_most,
    below,
    between,
    increasing,
    judge,
    that,
)
from palpate.paper.quantities import Quantity, least, ratio, times

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
