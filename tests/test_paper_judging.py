"""Judges and verdicts: what they say of numbers, and in which words."""

import math

import pytest

from palpate.paper import Claim, SeedAnswer
from palpate.paper.judging import (
    NEVER,
    about,
    between,
    farthest_from,
    increasing,
    judge,
    largest,
    least,
    number,
)
from palpate.paper.report import SIGNS, Judgement, Reproduction

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
    "what never happens is infinite": ("time slow", None),
    "the least": (least("scatter α = 5"), 1.0),
    "the largest and the least of several": (largest(least("scatter α = 5", 7.0), 6.0), 6.0),
    "names written as one": (least("scatter α = {5|50} K"), 1.0),
    "a ratio": (number("scatter α = 50") / least("scatter α = 5"), 100.0),
    "over nothing": (number("bias") / 0.0, None),
    "a multiple": (number("bias") * 10.0, -30.0),
    "the farthest": (farthest_from(3.2, "scatter α = 5"), 1.0),
}


@pytest.mark.parametrize("quantity, value", QUANTITIES.values(), ids=QUANTITIES)
def test_a_quantity_is_computed_from_the_numbers(quantity, value):
    assert judge(quantity)(NUMBERS) == SeedAnswer(None, value)  # without conditions: not checked


BOUNDS = {
    "above": (number("value") > "bias", (-2.9,), (-3.0,)),
    "below": (number("value") < 4.0, (3.9,), (4.0,)),
    "at least": (number("value") >= 4.0, (4.0,), (3.9,)),
    "at most": (number("value") <= "scatter α = 5", (5.0,), (5.1,)),
    "below all": (number("value") < "scatter α = 5{ K| B}", (0.9,), (1.0, 3.9)),
    "between": (between("value", 1.0, 2.0), (1.0, 2.0), (0.9, 2.1)),
    "about": (about("value", 90.0), (45.0, 180.0), (44.0, 181.0)),
    "happens": (number("value") < NEVER, (0.0,), (math.inf,)),
    "never": (number("value") >= NEVER, (math.inf,), (0.0,)),
    "increasing": (increasing("bias", "value", "time slow"), (0.0,), (-3.0, math.inf)),
}


@pytest.mark.parametrize("bound, kept, broken", BOUNDS.values(), ids=BOUNDS)
def test_a_bound_is_kept_or_broken_and_all_have_to_be_kept(bound, kept, broken):
    for values, holds in ((kept, True), (broken, False)):
        for value in values:
            numbers = {**NUMBERS, "value": value}
            assert judge(bound)(numbers).holds is holds
            assert judge("bias", number("bias") < 0.0, bound)(numbers).holds is holds
            assert judge("bias", number("bias") > 0.0, bound)(numbers).holds is False


def test_what_is_not_known_cannot_be_checked():
    numbers = {**NUMBERS, "error K [%]": math.nan, "error B [%]": 1.0}
    for unknown in (number("error") > 3.0, number("bias") < "error", largest("bias", "error") < 3):
        assert judge(unknown, number("bias") < 0.0)(numbers).holds is None
    assert judge(number("bias") < "error").words([numbers]) == "error: not known"
    assert judge()(NUMBERS) == SeedAnswer(None)
    with pytest.raises(KeyError, match="scatter α = 6"):
        judge("scatter α = 6")(NUMBERS)


def test_the_words_say_every_other_number_that_was_used_with_its_unit_once():
    words = judge(
        number("scatter α = 50") / "scatter α = 5 K|B" > 3.0,
        number("scatter α = 50") > "bias",
        beside=["time {slow|slow}", least("time slow")],
    ).words([NUMBERS])
    assert words == (
        "scatter α = 50: 100 %; scatter α = 5 K or B: 4.00 %; time slow: never; "
        "least time slow: 2.00 s; bias: −3.00"
    )
    assert judge(number("bias") > "bias").words([NUMBERS]) == ""
    seeds = [{"bias": 0.0, "time [s]": value} for value in (1.0, math.nan, 3.0)]
    assert judge("bias", beside="time").words(seeds) == "time: 3.00 s (1.00 to never)"


def test_a_second_material_is_judged_beside_the_first():
    two = judge(number("bias") < 0.0, elsewhere="elsewhere")
    assert two(NUMBERS).holds is True
    assert two.words([NUMBERS]) == "On the elsewhere it does not hold (4.00)"
    seeds = [NUMBERS, {**NUMBERS, "elsewhere bias": -4.0}]
    assert two.words(seeds) == "On the elsewhere it holds in 1 of 2 seeds (0 (−4.00 to 4.00))"


CLAIM = Claim("key", "V", "words", unit="mm")
VERDICTS = {
    "all seeds hold": ((True, True), Reproduction.REPRODUCED, "reproduced"),
    "no seed holds": ((False, False), Reproduction.NOT_REPRODUCED, "not reproduced"),
    "some hold": ((True, False, True), Reproduction.PARTLY, "reproduced in 2 of 3 seeds"),
    "none can tell": ((None, None), Reproduction.UNCHECKED, "cannot be checked"),
    "one cannot tell": (
        (True, None),
        Reproduction.REPRODUCED,
        "reproduced (1 of 2 seeds can tell)",
    ),
}


@pytest.mark.parametrize("holds, verdict, words", VERDICTS.values(), ids=VERDICTS)
def test_a_verdict_counts_the_seeds_that_can_tell(holds, verdict, words):
    judgement = Judgement("fig", CLAIM, tuple(SeedAnswer(each) for each in holds))
    assert (judgement.verdict, judgement.verdict_words, judgement.ours) == (verdict, words, None)
    assert len({SIGNS[each] for each in Reproduction}) == 4
