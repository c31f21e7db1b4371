"""Every experiment says the same again, judges every claim, and finds what physics says it must."""

import json
import math

import numpy as np
import pytest
from paper_cases import SEED

from palpate import HuntCrossley, KelvinVoigt, KelvinVoigtRLS, SingleStageRLS
from palpate.estimators import DoubleStageRLS, ExtendedKelvinVoigtRLS
from palpate.figures.style import save
from palpate.lab import THREE_SINES
from palpate.paper.comparison.materials import COMPARISONS
from palpate.paper.experiment import Experiment, Outcome
from palpate.paper.forgetting.experiment import FORGETTING, Held
from palpate.paper.hysteresis.experiment import HYSTERESIS
from palpate.paper.intermittent.experiment import INTERMITTENT
from palpate.paper.near_truth.experiment import NEAR_TRUTH
from palpate.paper.richness.experiment import RICHNESS
from palpate.paper.sessions import pressed
from palpate.paper.starts import convergence_times, from_starts, starts_of

pytest.importorskip("mujoco")
matplotlib = pytest.importorskip("matplotlib")

EXPERIMENTS = (*FORGETTING, *COMPARISONS, *NEAR_TRUTH, *HYSTERESIS, *RICHNESS, *INTERMITTENT)
# The others take seconds each: their motions are long.
QUICK = ("fig07", "fig08", "fig16", "fig09")
# Two of them stand for all in what costs a run or a drawing of its own.
QUICKEST = ("fig07", "fig08")


def marked(quick: tuple[str, ...]) -> list:
    return [
        pytest.param(each, id=each.name, marks=() if each.name in quick else pytest.mark.slow)
        for each in EXPERIMENTS
    ]


NAMED = marked(QUICK)
FEWER = marked(QUICKEST)
_outcomes: dict[str, Outcome] = {}


def named(name: str) -> Experiment:
    return next(each for each in EXPERIMENTS if each.name == name)


def outcome_of(name: str) -> Outcome:
    if name not in _outcomes:
        _outcomes[name] = named(name).run(SEED)
    return _outcomes[name]


def holds(name: str, key: str) -> bool | None:
    return outcome_of(name).findings[key].holds


@pytest.mark.parametrize("experiment", FEWER)
def test_the_same_seed_gives_the_same_outcome(experiment):
    again, first = experiment.run(SEED), outcome_of(experiment.name)
    assert repr(again) == repr(first)


@pytest.mark.parametrize("experiment", NAMED)
def test_every_claim_has_a_finding_and_every_number_can_be_written_down(experiment):
    outcome = outcome_of(experiment.name)
    assert set(outcome.findings) == {claim.key for claim in experiment.claims}
    json.dumps(outcome.numbers)
    for curve in outcome.curves.values():
        assert all(type(value) is float for value in curve)
    for finding in outcome.findings.values():
        assert finding.words
        assert finding.holds in (True, False, None)
        assert finding.ours is None or math.isfinite(finding.ours)


@pytest.mark.parametrize("experiment", FEWER)
def test_it_is_drawn_and_tabulated(experiment, tmp_path):
    outcomes = [outcome_of(experiment.name)] * 2
    figure = experiment.draw(outcomes, dark=True)
    # Laying out takes most of the time; where the whole paper runs it is done.
    figure.set_layout_engine(None)
    with matplotlib.rc_context({"savefig.dpi": 30}):
        save(figure, tmp_path / "figure.png")
    for table in experiment.tables(outcomes):
        assert table.rows
        assert all(len(row) == len(table.header) for row in table.rows)


def test_names_and_claims_are_unique():
    assert len({each.name for each in EXPERIMENTS}) == len(EXPERIMENTS)
    for each in EXPERIMENTS:
        assert len({claim.key for claim in each.claims}) == len(each.claims)


def test_starts_follow_the_rule_of_the_paper():
    contact = pressed("ball", "three-sines", SEED)
    starts = starts_of(contact, SingleStageRLS)
    assert starts["I"] == HuntCrossley(0.1, 0.1, 1.0)
    assert starts["II"] == HuntCrossley(0.1, 0.1, 2.0)
    high = starts["III"]
    assert 2.0 <= high.stiffness / 2000.0 <= 3.0
    assert 2.0 <= high.damping / 2000.0 <= 3.0
    assert high.exponent == 1.0
    assert starts_of(contact, DoubleStageRLS) == starts
    linear = starts_of(contact, KelvinVoigtRLS)
    assert linear["low"] == KelvinVoigt(0.1, 0.1)
    assert 2.0 <= linear["high"].stiffness / 2000.0 <= 3.0
    assert set(starts_of(contact, ExtendedKelvinVoigtRLS)) == {"low", "high"}


def test_starts_that_are_one_converge_at_once():
    contact = pressed("ball", "three-sines", SEED)
    law = HuntCrossley(0.1, 0.1, 1.0)
    results = from_starts(contact, SingleStageRLS, {"one": law, "again": law})
    assert np.all(convergence_times(list(results.values())) == 0.0)


def test_a_held_probe_stops_where_its_speed_is_zero_and_stays():
    held = Held(THREE_SINES, 5.0)
    time = 1e-3 * np.arange(8000)
    command = held.at(time)
    still = time > held.stop
    assert np.ptp(command.penetration[still]) == 0.0
    assert np.all(command.velocity[still] == 0.0)
    assert abs(command.velocity[~still][-1]) < 2e-3


def test_on_the_ball_the_single_stage_forgets_its_start_and_the_double_stage_does_not():
    assert holds("fig08", "consistency")
    assert holds("fig08", "wide-range")


def test_on_the_ball_the_error_is_least_by_hunt_crossley():
    methods = outcome_of("fig08").numbers["methods"]
    single = max(methods["single-stage"]["rmse"].values())
    assert single < min(methods["kelvin-voigt"]["rmse"].values())
    assert methods["variable-projection"]["rmse"]["no start"] < 1.02 * single


def test_on_the_phantom_a_spring_alone_does_not_do():
    methods = outcome_of("fig16").numbers["methods"]
    order = ("variable-projection", "single-stage", "extended-kelvin-voigt", "kelvin-voigt")
    errors = [max(methods[name]["rmse"].values()) for name in order]
    assert errors == sorted(errors)


def test_the_quadratic_coefficient_moves_only_under_a_large_covariance():
    extended = outcome_of("fig16").numbers["methods"]["extended-kelvin-voigt"]
    assert math.isnan(extended["same covariance"]["10"][1])
    assert extended["times"][1] < 1.0


def test_forgetting_that_does_not_fade_keeps_the_estimate_restless():
    assert holds("fig07", "fluctuates")
    assert holds("fig07", "constant-unstable")
    assert holds("fig07", "overshoot")


def test_the_double_stage_ends_nearer_the_truth_the_nearer_it_starts():
    ball = outcome_of("fig09").numbers["ball"]
    apart = [max(ball[off]["apart"]) for off in ("0.01", "0.05", "0.1", "0.3")]
    assert apart == sorted(apart)
    assert max(ball["0.01"]["error"]) < 10.0
    assert max(ball["0.5, single stage"]["apart"]) < 0.1


@pytest.mark.slow
def test_a_linear_damper_pulls_near_the_surface_and_hunt_crossley_does_not():
    assert all(finding.holds for finding in outcome_of("fig10").findings.values())
    for name in ("single stage", "variable projection"):
        assert outcome_of("fig10").numbers["methods"][name]["least"] >= 0.0


@pytest.mark.slow
def test_one_sine_is_enough_and_how_soon_hangs_on_the_initial_covariance():
    assert holds("fig17", "one-converges")
    assert holds("fig18", "one-enough")
    tiny, small, more = outcome_of("fig17").numbers["long"].values()
    assert tiny[0] > 5.0 * small[0] > 25.0 * more[0]


@pytest.mark.slow
def test_self_perturbation_follows_a_change_that_least_squares_does_not():
    methods = outcome_of("fig19").numbers["methods"]
    regular, perturbed = (methods[name]["zone errors"] for name in ("regular", "self-perturbing"))
    assert perturbed[0] == pytest.approx(regular[0], rel=0.05)
    assert all(b < 0.1 * a for a, b in zip(regular[1:], perturbed[1:], strict=True))
    assert holds("fig19", "perturbed-converges")


@pytest.mark.slow
def test_a_sponge_leaves_the_single_stage_biased():
    methods = outcome_of("fig13").numbers["methods"]
    projected = methods["variable-projection"]["rmse"]["no start"]
    assert projected < 0.8 * methods["single-stage"]["rmse"]["I"]
