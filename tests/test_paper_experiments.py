"""The paper's experiments: the same again, every claim judged, and what physics says they find."""

import json
import math

import numpy as np
import pytest
from paper_cases import SEED

from palpate import ConstantForgetting, HuntCrossley, KelvinVoigt, KelvinVoigtRLS, SingleStageRLS
from palpate.estimators import DoubleStageRLS, ExtendedKelvinVoigtRLS
from palpate.figures.style import as_svg
from palpate.lab import THREE_SINES
from palpate.paper import EXPERIMENTS, Outcome, running
from palpate.paper.changes import correction, palpated
from palpate.paper.experiment import all_claims
from palpate.paper.judges import JUDGES
from palpate.paper.judging import named
from palpate.paper.methods import Held
from palpate.paper.rig import convergence_times, from_starts, identified, pressed, starts_of

pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")

# The others take seconds each: their motions are long, or they press often.
QUICK = ("fig06", "fig07", "fig08", "fig16")
# Two of them stand for all in what costs a run or a drawing of its own.
QUICKEST = ("fig06", "fig07")
_outcomes: dict[str, Outcome] = {}


def marked(quick: tuple[str, ...]) -> list:
    slow = pytest.mark.slow
    return [pytest.param(n, marks=() if n in quick else slow) for n in EXPERIMENTS]


def outcome_of(name: str) -> Outcome:
    if name not in _outcomes:
        _outcomes[name] = EXPERIMENTS[name].run(SEED)
    return _outcomes[name]


def largest(name: str, number: str) -> float:
    return max(named(number, outcome_of(name).numbers).values())


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


@pytest.mark.parametrize("name", marked(QUICKEST))
def test_the_same_seed_gives_the_same_outcome(name):
    assert repr(EXPERIMENTS[name].run(SEED)) == repr(outcome_of(name))


@pytest.mark.parametrize("name", marked(QUICK))
def test_what_was_measured_can_be_written_down_judged_and_drawn(name, tmp_path):
    experiment, outcome = EXPERIMENTS[name], outcome_of(name)
    (tmp_path / "outcomes").mkdir()
    running.write_outcome(tmp_path, experiment, outcome)
    again = running.read_outcome(tmp_path, experiment, SEED)
    assert repr(again) == repr(outcome)
    for finding in experiment.findings(again).values():
        assert finding.ours is None or math.isfinite(finding.ours)
    for table in experiment.tabulated([again] * 2):
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.header)}
    if name in QUICKEST:
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
    assert (tmp_path / "report.html").stat().st_size < 2e6


def test_starts_follow_the_rule_of_the_paper_and_agree_at_once_where_they_are_one():
    contact = pressed("ball", "three-sines", SEED)
    starts = starts_of(contact, SingleStageRLS)
    assert starts["I"] == HuntCrossley(0.1, 0.1, 1.0)
    assert starts["II"] == HuntCrossley(0.1, 0.1, 2.0)
    assert starts["III"].parameters == pytest.approx([5000.0, 5000.0, 1.0], rel=0.2)
    assert starts_of(contact, DoubleStageRLS) == starts
    linear = starts_of(contact, KelvinVoigtRLS)
    assert linear["low"] == KelvinVoigt(0.1, 0.1)
    assert 2.0 <= linear["high"].stiffness / 2000.0 <= 3.0
    assert set(starts_of(contact, ExtendedKelvinVoigtRLS)) == {"low", "high"}
    results = from_starts(contact, SingleStageRLS, {"one": starts["I"], "again": starts["I"]})
    assert np.all(convergence_times(results.values()) == 0.0)


def test_a_held_probe_stops_where_its_speed_is_zero_and_stays():
    held = Held(THREE_SINES, 5.0)
    time = 1e-3 * np.arange(8000)
    command = held.at(time)
    still = time > held.stop
    assert np.ptp(command.penetration[still]) == 0.0
    assert np.all(command.velocity[still] == 0.0)
    assert abs(command.velocity[~still][-1]) < 2e-3


def test_what_a_sample_corrects_of_its_error_is_what_the_regressors_say():
    contact = palpated(0.07, SEED, 3.0)
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


# What physics says, whatever the seed: keys that hold, keys that do not, and numbers with the
# least and the most that they may be.
PHYSICS = {
    "the single stage forgets its start, and the same P₀ means another thing in other units": (
        "fig08",
        "consistency wide-range kelvin-voigt-rate logarithm",
        "richer",
        {"bias at 0.1 K/B": (0.0, 1.0), "bias at 0.5 K/B": (3.0, 100.0)},
    ),
    "K₂ moves only under a large covariance": (
        "fig16",
        "quadratic-never",
        "",
        {"time P₀ = 10 extended-kelvin-voigt K₂": (math.inf, math.inf),
         "time extended-kelvin-voigt K₂": (0.0, 1.0)},
    ),
    "forgetting that does not fade keeps the estimate restless": (
        "fig07", "fluctuates constant-unstable overshoot", "", {},
    ),
    "the double stage converges where its conditions are made to hold": (
        "fig09",
        "because",
        "",
        {f"{material} off the truth, {given} given": (0.0, 1.0)
         for material in ("ball", "sponge") for given in ("K and B", "n")}
        | {"error ball 0.01": (0.0, 10.0), "apart ball 0.5, single stage": (0.0, 0.1)},
    ),
    "a linear damper pulls near the surface and Hunt–Crossley does not": (
        "fig10",
        "negative-force damping-and-speed deep-enough",
        "",
        {"least force single stage": (0.0, 1.0), "least force variable projection": (0.0, 1.0)},
    ),
    "one sine is enough": ("fig17", "one-converges", "", {}),
    "one sine is enough for Kelvin–Voigt": ("fig18", "one-enough", "", {}),
    "self-perturbation follows a change": (
        "fig19",
        "perturbed-converges perturbed-error small-gain gain-by-itself reset sensitivity",
        "gain-by-contrast",
        {"mean error after change regular, 7 % apart 1": (0.25, 1.0)},
    ),
    "a sponge that relaxes is found out, and its memory identified": (
        "today",
        "",
        "",
        {f"mark of all {name}": (2.0, 2.0)
         for name in ("single stage", "double stage", "Kelvin–Voigt", "variable projection")}
        | {"rmse unseen memory: --law any": (0.0, 2.5), "K′ off memory: --law any": (0.0, 1.5)},
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name, held, broken, numbers",
    [pytest.param(*each, id=words, marks=() if each[0] in QUICK else pytest.mark.slow)
     for words, each in PHYSICS.items()],
)  # fmt: skip
def test_an_experiment_finds_what_physics_says(name, held, broken, numbers):
    findings = EXPERIMENTS[name].findings(outcome_of(name))
    assert {key: findings[key].holds for key in held.split()} == dict.fromkeys(held.split(), True)
    assert not any(findings[key].holds for key in broken.split())
    for number, (low, high) in numbers.items():
        assert low <= largest(name, number) <= high, number


# By the same data: the errors of laws that are ever farther from the material.
@pytest.mark.parametrize(
    "name, numbers",
    [("fig08", ["rmse single-stage", "rmse kelvin-voigt"]),
     ("fig16", [f"rmse {law}" for law in ("variable-projection", "single-stage",
                                          "extended-kelvin-voigt", "kelvin-voigt")]),
     pytest.param("fig13", ["rmse variable-projection", "rmse single-stage I"],
                  marks=pytest.mark.slow),
     pytest.param("fig09", [f"apart ball {off}" for off in (0.01, 0.05, 0.1, 0.3)],
                  marks=pytest.mark.slow),
     pytest.param("fig17", [f"time P₀ = {size} one sine, 450 s K" for size in ("10", "1", "0.1")],
                  marks=pytest.mark.slow),
     pytest.param("fig19", ["mean error after change self-perturbing 1",
                            "mean error after change regular 1"], marks=pytest.mark.slow)],
)  # fmt: skip
def test_one_number_is_larger_than_the_one_before(name, numbers):
    values = [largest(name, number) for number in numbers]
    assert all(a < b for a, b in zip(values, values[1:], strict=False))
