"""What becomes of a claim over the seeds."""

import pytest
from paper_cases import Tiny

from palpate.paper import Claim, Finding
from palpate.paper.report.verdicts import SIGNS, Judgement, Verdict, judgements

CLAIM = Claim("key", "V", "words", unit="mm")


def judged(*holds, ours=()):
    numbers = [*ours, *[None] * (len(holds) - len(ours))]
    findings = (Finding(*each) for each in zip(holds, numbers, strict=True))
    return Judgement("fig", CLAIM, tuple(findings))


VERDICTS = {
    "all seeds hold": ((True, True), Verdict.REPRODUCED, "reproduced"),
    "no seed holds": ((False, False), Verdict.NOT_REPRODUCED, "not reproduced"),
    "some hold": ((True, False, True), Verdict.PARTLY, "reproduced in 2 of 3 seeds"),
    "none can tell": ((None, None), Verdict.UNCHECKED, "cannot be checked"),
    "one cannot tell": ((True, None), Verdict.REPRODUCED, "reproduced (1 of 2 seeds can tell)"),
    "no seeds": ((), Verdict.UNCHECKED, "cannot be checked"),
}


@pytest.mark.parametrize("holds, verdict, words", VERDICTS.values(), ids=VERDICTS)
def test_a_verdict_counts_the_seeds_that_can_tell(holds, verdict, words):
    judgement = judged(*holds)
    assert judgement.verdict is verdict
    assert judgement.verdict_words == words


def test_every_verdict_has_a_sign_of_its_own():
    assert len(set(SIGNS.values())) == len(Verdict) == len(SIGNS)


def test_ours_is_the_median_with_the_range_and_the_unit():
    judgement = judged(True, True, True, ours=(3.0, 1.0, 2.5))
    assert judgement.ours == (2.5, 1.0, 3.0)
    assert judgement.ours_words == "2.50 mm (1.00 to 3.00)"


def test_what_was_not_measured_or_is_not_finite_is_left_out_of_ours():
    assert judged(True, True, ours=(float("nan"), 4.0)).ours_words == "4.00 mm"
    assert judged(True, True).ours_words == ""


def test_judging_an_experiment_holds_each_claim_against_each_seed():
    even, lost = judgements(Tiny(), [Tiny().run(seed) for seed in range(3)])
    assert (even.held, even.checked, even.verdict) == (2, 3, Verdict.PARTLY)
    assert lost.verdict is Verdict.UNCHECKED
