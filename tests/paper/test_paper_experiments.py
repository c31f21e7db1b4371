"""The paper's experiments: the same again, every claim judged, and what physics says they find."""

import json
import math

import numpy as np
import pytest
from paper_cases import SEED

from palpate import ConstantForgetting, HuntCrossley, KelvinVoigt, KelvinVoigtRLS, SingleStageRLS
from palpate.method.estimators import DoubleStageRLS, ExtendedKelvinVoigtRLS
from palpate.output.figures.style import as_svg
from paper import running
from paper.changes import correction, palpated, stiffer
from paper.choices import DRAWS, choosing, draws, shares
from paper.experiment import Outcome, Seeds, all_claims
from paper.experiments import EXPERIMENTS
from paper.judging import JUDGES, quantities
from paper.rig import (
    convergence_times,
    from_starts,
    identified,
    simulated_contact,
    starts_of,
)

# The others take seconds each: their motions are long, or they press often.
QUICK = ("fig06", "fig07", "fig08", "fig16")
# Two of them stand for all in what costs a run or a drawing of its own.
QUICKEST = ("fig06", "fig07")
_outcomes: dict[str, Outcome] = {}


ALL = [
    pytest.param(name, marks=pytest.mark.long if name in QUICK else pytest.mark.slow)
    for name in EXPERIMENTS
]


def outcome_of(name: str) -> Outcome:
    if name not in _outcomes:
        _outcomes[name] = EXPERIMENTS[name].run(SEED)
    return _outcomes[name]


def test_every_claim_has_an_experiment_and_a_judge_and_none_is_left_over():
    assert list(all_claims()) == list(EXPERIMENTS)
    assert JUDGES.keys() == EXPERIMENTS.keys()
    for name, experiment in EXPERIMENTS.items():
        assert experiment.name == name
        assert len(experiment.caption) > 50
        assert {claim.key for claim in experiment.claims} <= experiment.judges.keys()
        for claim in experiment.claims:
            assert claim.where
            assert len(claim.words) > 10
            assert "{" not in claim.reading + claim.depends


@pytest.mark.parametrize("name", ALL)
def test_measurements_can_be_saved_judged_and_drawn(name, tmp_path):
    experiment, outcome = EXPERIMENTS[name], outcome_of(name)
    (tmp_path / "outcomes").mkdir()
    running.write_outcome(tmp_path, experiment, outcome)
    again = running.read_outcome(tmp_path, experiment, SEED)
    assert repr(again) == repr(outcome)
    for finding in experiment.findings(again).values():
        assert finding.ours is None or math.isfinite(finding.ours)
    say = Seeds([again.numbers] * 2)
    for table in (*experiment.tables(say), say.every_number()):
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.header)}
    if name in QUICKEST:
        assert repr(experiment.run(SEED)) == repr(outcome)  # the same seed gives the same
        figure = experiment.figure([again] * 2)
        # Laying out takes most of the time; where the whole paper runs it is done.
        figure.set_layout_engine("none")
        assert "<svg" in as_svg(figure)


@pytest.mark.slow
def test_the_whole_paper_runs_and_every_claim_has_its_verdict(tmp_path):
    running.run_paper(list(EXPERIMENTS.values()), seeds=1, folder=tmp_path)
    whole = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert whole["unfinished"] == whole["failures"] == []
    assert [each["name"] for each in whole["experiments"]] == list(EXPERIMENTS)
    assert len(whole["claims"]) == 111
    # 17 drawings of 0.1 MB each, and the tables.
    assert (
        tmp_path / "report.html"
    ).stat().st_size < 3.5e6  # 3.2 MB: paths as matplotlib writes them, rounded


def test_initial_values_follow_the_rule_of_the_paper():
    contact = simulated_contact("ball", "three-sines", SEED)
    starts = starts_of(contact, SingleStageRLS)
    assert starts["I"] == HuntCrossley(K=0.1, B=0.1, n=1.0)
    assert starts["II"] == HuntCrossley(K=0.1, B=0.1, n=2.0)
    assert starts["III"].parameters == pytest.approx([5000.0, 5000.0, 1.0], rel=0.2)
    assert starts_of(contact, DoubleStageRLS) == starts
    linear = starts_of(contact, KelvinVoigtRLS)
    assert linear["low"] == KelvinVoigt(K=0.1, B=0.1)
    assert 2.0 <= linear["high"].K / 2000.0 <= 3.0
    assert set(starts_of(contact, ExtendedKelvinVoigtRLS)) == {"low", "high"}
    results = from_starts(contact, SingleStageRLS, {"one": starts["I"], "again": starts["I"]})
    assert np.all(convergence_times(results.values()) == 0.0)


def test_the_correction_of_a_sample_follows_its_regressors():
    contact = palpated(stiffer(0.07), SEED, 3.0)
    result = identified(contact, SingleStageRLS, forgetting=ConstantForgetting())
    taken = result.trace.taken
    x, v = contact.penetration[taken], contact.velocity[taken]
    phi = np.stack([np.ones_like(x), v, np.log(x)], axis=1)
    covariance = np.linalg.inv(np.eye(3) / 1e3 + phi[:-1].T @ phi[:-1])
    expected = phi[-1] @ covariance @ phi[-1]
    time, corrected = correction(result)
    assert time[-1] == contact.time[-1]
    # The parameters, of the order of 1e5, are known to 1e-16 of their size.
    assert corrected[-1] == pytest.approx(100.0 * expected / (1.0 + expected), rel=1e-3)


def test_every_claim_that_can_be_checked_has_its_share_of_the_draws():
    searched = {
        f"{name}.{claim.key}"
        for name, each in EXPERIMENTS.items()
        for claim in each.claims
        if each.judges[claim.key].searched
    }
    assert shares().keys() == searched
    assert {len(share.held) for share in shares().values()} == {DRAWS}


@pytest.mark.long
def test_a_draw_varies_only_what_the_paper_leaves_open():
    contact = simulated_contact("ball", "three-sines", SEED)
    with choosing(draws()[0]):
        other = simulated_contact("ball", "three-sines", SEED)
        single, double = (identified(other, kind) for kind in (SingleStageRLS, DoubleStageRLS))
    settings, drawn = single.estimator.settings, draws()[0].drawn
    assert settings["forgetting"] == SingleStageRLS().settings["forgetting"]  # stated
    assert settings["initial_covariance"] == drawn["P₀ of the single stage"]
    assert double.estimator.settings["initial_covariance"][2] == drawn["P₀ of n, stage 2"]
    assert other.time[-1] == pytest.approx(2.0 + drawn["duration [s]"], abs=2e-3)
    assert contact.time[-1] == pytest.approx(12.0, abs=2e-3)
    assert identified(contact, SingleStageRLS).estimator.settings["initial_covariance"] == 1e3


# What physics says, whatever the seed: claims that hold, and that do not.
HOLD = {
    "fig07": "fluctuates constant-unstable overshoot",
    "fig08": "consistency wide-range kelvin-voigt-rate logarithm",
    "fig09": "because",
    "fig10": "negative-force damping-and-speed deep-enough",
    "fig16": "quadratic-never",
    "fig17": "one-converges",
    "fig18": "one-enough",
    "fig19": "perturbed-converges perturbed-error small-gain gain-by-itself reset sensitivity",
}
DO_NOT = {"fig08": "richer", "fig19": "gain-by-contrast"}
# Numbers of which each is larger than the one before.
RISING = {
    "fig08": "rmse {single-stage|kelvin-voigt}",
    "fig09": "apart ball {0.5, single stage|0.01|0.05|0.1|0.3}",
    "fig13": "rmse {variable-projection|single-stage I}",
    "fig16": "rmse {variable-projection|single-stage|extended-kelvin-voigt|kelvin-voigt}",
    "fig17": "time P₀ = {10|1|0.1} one sine, 450 s K",
    "today": "rmse unseen {relaxation: --law auto|variable projection}",
}


@pytest.mark.parametrize("name", ALL)
def test_an_experiment_finds_what_physics_says(name):
    findings = EXPERIMENTS[name].findings(outcome_of(name))
    for keys, holds in ((HOLD, True), (DO_NOT, False)):
        for key in keys.get(name, "").split():
            assert findings[key].holds is holds, key
    rising = quantities(RISING[name]) if name in RISING else ()
    values = [quantity.of(outcome_of(name).numbers) for quantity in rising]
    assert values == sorted(set(values))
