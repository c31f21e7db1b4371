"""Judges: what they say of numbers, and in which words."""

import math

import pytest

from palpate.paper.judging import (
    Finding,
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
from palpate.paper.quantities import (
    farthest_from,
    largest,
    least,
    over_seeds,
    ratio,
    readable,
    times,
)

NUMBERS = {
    "scatter α = 5 K [%]": 1.0,
    "scatter α = 5 B [%]": 4.0,
    "scatter α = 5 n [%]": 5.0,
    "scatter α = 50 K [%]": 100.0,
    "time slow K [s]": math.nan,
    "time slow B [s]": 2.0,
    "bias": -3.0,
    "elsewhere bias": 4.0,
}

QUANTITIES = {
    "a name is the largest that it begins": ("scatter α = 5", 5.0),
    "of some symbols alone": ("scatter α = 5 K|B", 4.0),
    "a name with its unit left out": ("scatter α = 50 K", 100.0),
    "what never happens is infinite": ("time slow", math.inf),
    "the least": (least("scatter α = 5"), 1.0),
    "the largest of several": (largest("scatter α = 5", 7.0), 7.0),
    "the least of several": (least("scatter α = 5", 7.0), 5.0),
    "names written as one": (least("scatter α = {5|50} K"), 1.0),
    "a ratio": (ratio("scatter α = 50", least("scatter α = 5")), 100.0),
    "over nothing": (ratio("bias", 0.0), math.inf),
    "a multiple": (times(10.0, "bias"), -30.0),
    "the farthest": (farthest_from(3.2, "scatter α = 5"), 1.0),
}


@pytest.mark.parametrize("quantity, value", QUANTITIES.values(), ids=QUANTITIES)
def test_a_quantity_is_computed_from_the_numbers(quantity, value):
    ours = judge(quantity)(NUMBERS).ours
    assert ours == (value if math.isfinite(value) else None)


BOUNDS = {
    "above": (above(4.0, "bias"), (4.5,), (4.0,)),
    "below": (below(4.0), (3.9,), (4.0,)),
    "at least": (at_least(4.0), (4.0,), (3.9,)),
    "at most": (at_most(4.0, "scatter α = 5"), (4.0,), (4.1,)),
    "between": (between(1.0, 2.0), (1.0, 2.0), (0.9, 2.1)),
    "about": (about(90.0), (45.0, 180.0), (44.0, 181.0)),
    "finite": (finite(), (0.0,), (math.inf,)),
    "never": (never(), (math.inf,), (0.0,)),
}


@pytest.mark.parametrize("bound, kept, broken", BOUNDS.values(), ids=BOUNDS)
def test_a_bound_is_kept_or_broken(bound, kept, broken):
    for values, holds in ((kept, True), (broken, False)):
        for value in values:
            numbers = {**NUMBERS, "value": value}
            assert judge("value", bound)(numbers).holds is holds
            assert judge("bias", that("value", bound))(numbers).holds is holds


def test_all_conditions_have_to_hold():
    assert judge("bias", below(0.0), above(-4.0))(NUMBERS).holds is True
    assert judge("bias", below(0.0), above(-2.0))(NUMBERS).holds is False
    assert judge("bias", increasing("bias", "scatter α = 5", "time slow"))(NUMBERS).holds is True
    assert judge("bias", increasing("scatter α = 5", "scatter α = 5"))(NUMBERS).holds is False


def test_without_conditions_a_claim_cannot_be_checked():
    assert judge("bias")(NUMBERS) == Finding(None, -3.0)
    assert unchecked()(NUMBERS) == Finding(None)


def test_what_is_not_known_cannot_be_checked():
    numbers = {**NUMBERS, "error K [%]": math.nan, "error B [%]": 1.0}
    for found in (
        judge("error", above(3.0))(numbers),
        judge("bias", below("error"))(numbers),
        judge(largest("bias", "error"), below(3.0))(numbers),
        judge(least("error", "bias"), below(3.0), that("bias", below(0.0)))(numbers),
    ):
        assert found.holds is None
    assert judge("bias", below("error")).words([numbers]) == "error: not known"


def test_the_words_say_every_other_number_that_was_used_with_its_unit_once():
    words = judge(
        ratio("scatter α = 50", "scatter α = 5 K|B"),
        above(3.0),
        that("scatter α = 50", above("bias")),
        beside=["time {slow|slow}", least("time slow")],
    ).words([NUMBERS])
    assert words == (
        "scatter α = 50: 100 %; scatter α = 5 K or B: 4.00 %; time slow: never; "
        "least time slow: 2.00 s; bias: −3.00"
    )
    assert judge("bias", above("bias")).words([NUMBERS]) == ""


def test_the_words_say_the_median_over_the_seeds_and_the_range():
    seeds = [{"bias": 0.0, "time [s]": value} for value in (1.0, math.nan, 3.0)]
    assert judge("bias", beside="time").words(seeds) == "time: 3.00 s (1.00 to never)"


def test_a_second_material_is_judged_beside_the_first():
    two = judge("bias", below(0.0), elsewhere="elsewhere")
    assert two(NUMBERS).holds is True
    assert two.words([NUMBERS]) == "On the elsewhere it does not hold (4.00)"
    seeds = [NUMBERS, {**NUMBERS, "elsewhere bias": -4.0}]
    assert two.words(seeds) == "On the elsewhere it holds in 1 of 2 seeds (0 (−4.00 to 4.00))"


def test_a_number_that_is_not_there_is_named():
    with pytest.raises(KeyError, match="scatter α = 6"):
        judge("scatter α = 6")(NUMBERS)


@pytest.mark.parametrize(
    "value, words",
    [(0.0, "0"), (99937.5, "99938"), (1993.2, "1993"), (50.81, "50.8"), (-0.0123, "−0.0123"),
     (1e-4, "1.00e−04"), (2e7, "2.00e+07"), (1.0, "1.00"), (math.inf, "never")],
)  # fmt: skip
def test_numbers_read_with_three_digits(value, words):
    assert readable(value) == words


def test_seeds_are_said_by_their_median_and_range():
    seeds = [{"time [s]": value} for value in (3.0, 1.0, 2.0)]
    assert over_seeds(seeds, "time") == "2.00 (1.00 to 3.00)"
    assert (
        over_seeds([*seeds, {"time [s]": math.nan}, *seeds[:1]], "time") == "3.00 (1.00 to never)"
    )
    assert over_seeds(seeds[:1], "time") == "3.00"
