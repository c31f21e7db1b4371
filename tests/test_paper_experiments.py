"""The paper's experiments themselves."""

import json

import pytest
from paper_cases import SEED

from palpate.paper import EXPERIMENTS
from palpate.paper import outcomes as on_disk
from palpate.paper.report.verdicts import Verdict, judge
from palpate.paper.runner import run_paper

pytest.importorskip("mujoco")

# Those that press once and are done in a second.
QUICK = ("fig06", "fig15")


@pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=EXPERIMENTS)
def test_an_experiment_says_what_it_shows_and_claims(experiment):
    assert experiment.title
    assert EXPERIMENTS[experiment.name] is experiment
    keys = [claim.key for claim in experiment.claims]
    assert keys
    assert len(keys) == len(set(keys))
    for claim in experiment.claims:
        assert claim.where
        assert len(claim.words) > 10


@pytest.mark.parametrize("name", QUICK)
def test_the_same_seed_gives_the_same_outcome(name):
    experiment = EXPERIMENTS[name]
    first, second = (on_disk.as_text(experiment, experiment.run(SEED)) for _ in range(2))
    assert first == second


@pytest.mark.parametrize("name", QUICK)
def test_an_outcome_read_back_draws_and_tabulates_like_a_fresh_one(name):
    from palpate.figures.style import as_svg

    experiment = EXPERIMENTS[name]
    outcome = experiment.run(SEED)
    assert set(outcome.findings) == {claim.key for claim in experiment.claims}
    again = on_disk.from_text(on_disk.as_text(experiment, outcome))
    assert experiment.tables([again]) == experiment.tables([outcome])
    assert again.findings.keys() == outcome.findings.keys()
    assert "<svg" in as_svg(experiment.draw([again], dark=True))
    for judgement in judge(experiment, [again]):
        assert judgement.verdict in Verdict


@pytest.mark.slow
def test_the_whole_paper_runs_and_every_claim_has_its_verdict(tmp_path):
    run_paper(list(EXPERIMENTS.values()), seeds=1, folder=tmp_path)
    whole = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert whole["unfinished"] == whole["failures"] == []
    assert [each["name"] for each in whole["experiments"]] == list(EXPERIMENTS)
    assert len(whole["claims"]) == sum(len(each.claims) for each in EXPERIMENTS.values())
    assert (tmp_path / "report.html").stat().st_size < 10e6
    for experiment in EXPERIMENTS.values():
        again = on_disk.read(tmp_path, experiment, 0)
        written = on_disk.path_of(tmp_path, experiment.name, 0).read_text(encoding="utf-8")
        assert on_disk.as_text(experiment, again) == written
