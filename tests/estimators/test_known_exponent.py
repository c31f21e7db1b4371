"""An exponent that the shape of the tip tells is kept, by every method whose law has one."""

import dataclasses
import json

import cases
import numpy as np
import pytest
from cases import exciting, tapping

import palpate
from palpate import (
    ESTIMATORS,
    ChangeDetector,
    ConstantForgetting,
    Contact,
    HuntCrossley,
    InvalidParameterError,
    OutlierRejection,
    Scale,
    identify,
)

KEEPERS = {name: kind for name, kind in ESTIMATORS.items() if "exponent" in kind().settings}
SPHERE = HuntCrossley(K=30e3, B=20e3, n=1.5)


def contact_of(law=SPHERE, *, seconds=2.0, noise=0.05, seed=3, tap=False) -> Contact:
    make = tapping if tap else exciting
    return cases.contact_of(make(law, seconds=seconds, noise=noise, seed=seed))


@pytest.fixture(params=KEEPERS.values(), ids=KEEPERS)
def keeper(request):
    return request.param


def places_of(keeper, *names):
    """Where these are among the parameters of a method's law."""
    return [keeper.law_type.names().index(name) for name in names]


def test_every_method_whose_law_has_an_exponent_can_keep_it():
    assert set(KEEPERS) == {n for n, k in ESTIMATORS.items() if "n" in k.law_type.names()}


def test_the_answer_is_the_least_squares_of_the_rest(keeper):
    settings = {"exponent": 1.5, "scale": Scale(10e-3, 20e-3, 30.0)}
    if "forgetting" in keeper().settings:
        settings["forgetting"] = ConstantForgetting()
    if "initial_covariance" in keeper().settings:  # so that the start weighs nothing
        settings["initial_covariance"] = 1e8
    if keeper is palpate.ViscoelasticContact:  # the truth does not relax
        settings["memory"] = "none"
    contact = contact_of(noise=0.1)
    x, v, force = contact.penetration, contact.velocity, contact.force
    estimator = keeper(**settings)
    estimator.replay(x, v, force)
    if keeper is palpate.ViscoelasticContact:  # its answer is of most samples only
        estimator.finish_pending()
    now = estimator.estimate()
    assert now.law.n == 1.5
    # K and B by the normal equations.
    inside = (x > 0.0) & (force > 0.0)
    rows, wanted = np.column_stack([x**1.5, x**1.5 * v, np.ones_like(x)])[inside], force[inside]
    if keeper.minimises == "logarithm":
        rows = np.column_stack([np.ones_like(x), v])[inside]
        wanted = np.log(wanted) - 1.5 * np.log(x[inside])
    elif not now.offset_standard_error:
        rows = rows[:, :2]
    wanted = np.linalg.lstsq(rows, wanted, rcond=None)[0][:2]
    if keeper.minimises == "logarithm":
        wanted = np.exp(wanted[0]) * np.array([1.0, wanted[1]])
    own = places_of(keeper, "K", "B")
    errors, found = now.standard_errors[own], now.parameters[own]
    if keeper is palpate.DriftTracking:  # it lets K drift, and knows that
        assert np.all(np.abs(found - SPHERE.parameters[:2]) < 4.0 * errors)
    else:  # weak priors move it by a hundredth of an error
        assert np.all(np.abs(found - wanted) < 0.01 * errors)


def test_a_known_exponent_improves_the_other_parameters(keeper):
    contact = contact_of()
    free, kept = identify(contact, keeper()), identify(contact, keeper(exponent=1.5))
    assert kept.fixed == ("n",)
    assert free.fixed == ()
    assert kept.law.n == 1.5
    keeper = type(kept.estimator)  # variable projection where Hunt–Crossley was selected
    [place] = places_of(keeper, "n")
    others = places_of(keeper, "K", "B")
    assert kept.standard_errors[place] == 0.0
    assert not kept.covariance[place].any()
    assert not any("exponent" in flag for flag in kept.flags)
    # K and n of a free exponent depend on each other by far the most.
    assert kept.standard_errors[0] < 0.3 * free.standard_errors[0]
    assert np.isnan(kept.correlations[place]).all()
    assert np.isfinite(kept.correlations[np.ix_(others, others)]).all()
    assert not kept.trace.standard_errors[:, place].any()
    assert (kept.trace.parameters[kept.trace.taken, place] == 1.5).all()


@pytest.mark.slow
def test_error_bars_of_the_rest_hold_the_truth(keeper):
    away = []
    for seed in range(60):
        result = identify(contact_of(seed=seed, noise=0.2), keeper(exponent=1.5), trace=False)
        own = places_of(type(result.estimator), "K", "B")
        off = result.law.parameters[own] - SPHERE.parameters[:2]
        away.append(off / result.standard_errors[own])
    covered = np.mean(np.abs(away) < 1.96)
    # Four deviations of the binomial scatter of 120 (0.08) below 0.95; drift bars are wide anyhow.
    assert covered > 0.87


def test_the_surface_is_searched_for_beside_it():
    contact = contact_of(tap=True, noise=0.005)
    shifted = dataclasses.replace(contact, penetration=contact.penetration + 4e-4)
    settings = {"surface": "estimate", "exponent": 1.5}
    result = identify(shifted, palpate.VariableProjection(**settings))
    estimate = result.estimate
    assert estimate.law.n == 1.5
    assert estimate.standard_errors[2] == 0.0
    assert abs(estimate.surface - 4e-4) < 5.0 * estimate.surface_standard_error
    free = identify(shifted, palpate.VariableProjection(surface="estimate")).estimate
    assert estimate.surface_standard_error < free.surface_standard_error


def test_a_known_exponent_stays_through_changes_and_outliers(keeper):
    soft, hard = contact_of(), contact_of(HuntCrossley(K=90e3, B=50e3, n=1.5), seed=4)
    force = np.where(soft.time < 1.0, soft.force, hard.force)
    force[300:302] += 30.0
    settings = {"change_detector": ChangeDetector(), "outlier_rejection": OutlierRejection()}
    if keeper is not palpate.DriftTracking:
        settings["forgetting"] = ConstantForgetting(0.999)
    estimator = keeper(exponent=1.5, **settings)
    trace = estimator.replay(soft.penetration, soft.velocity, force)
    now = estimator.estimate()
    assert now.restarts == 1
    assert now.rejected >= 2
    [place] = places_of(keeper, "n")
    assert (trace.parameters[:, place] == 1.5).all()
    assert now.standard_errors[place] == 0.0
    assert now.law.K == pytest.approx(90e3, rel=0.05)


def test_a_wrong_exponent_is_a_finding():
    contact = contact_of(noise=0.02)
    result = identify(contact, palpate.VariableProjection(exponent=2.0), trace=False)
    [finding] = [each for each in result.diagnosis.findings if each.check == "shape"]
    assert result.diagnosis.verdict.overall != "trust"
    assert "exponent that was passed" in finding.message
    there = identify(contact, palpate.VariableProjection(exponent=1.5), trace=False)
    assert there.diagnosis.verdict.stiffness == "trust"
    modulus = there.elastic_modulus(palpate.Sphere(radius=0.1))
    assert modulus.refused is None
    assert any("the exponent was fixed" in remark for remark in modulus.remarks)


def test_a_change_of_the_material_is_found_with_it():
    law = HuntCrossley(K=90e3, B=50e3, n=1.5)
    soft, hard = contact_of(seconds=8.0), contact_of(law, seconds=8.0, seed=4)
    force = np.where(soft.time < 4.0, soft.force, hard.force)
    contact = dataclasses.replace(soft, force=force)
    parts = identify(contact, palpate.VariableProjection(exponent=1.5)).by_segment().segments
    assert [round(part.law.K, -4) for part in parts] == [30e3, 90e3]
    assert all(part.law.n == 1.5 and part.fixed for part in parts)


def test_a_fixed_exponent_is_shown_as_fixed(tmp_path, undrawn):
    from palpate.output.figures import draw

    result = identify(contact_of(), palpate.VariableProjection(exponent=1.5))
    assert "1.5 (fixed)" in result.summary()
    assert "1.5 (fixed)" in result._repr_html_()
    titles = [
        axes.get_title(loc) for axes in draw(result, ["n"]).axes for loc in ("left", "center")
    ]
    assert any("1.5\N{NO-BREAK SPACE}(fixed)" in title for title in titles)
    assert result.to_pandas().attrs["fixed"] == ["n"]
    assert result.to_xarray().attrs["fixed"] == ["n"]
    result.save(tmp_path)
    assert "1.5 (fixed)" in (tmp_path / "report.html").read_text()
    found = palpate.load_result(tmp_path)
    assert found.fixed == ("n",)
    assert found.standard_errors[2] == 0.0


def test_the_command_line_keeps_a_known_exponent(run, printed, refused, tmp_path):
    file = tmp_path / "sphere.csv"
    palpate.write_contact(contact_of(), file)
    out = printed("identify", file, "--exponent", "1.5")
    assert "n = 1.5 (fixed)" in out
    _, out, _ = run("identify", file, "--exponent", "1.5", "--json")
    [found] = json.loads(out)["results"]
    assert found["fixed"] == ["n"]
    assert found["standard_errors"]["n"] == 0.0
    _, out, _ = run("compare", file, "--exponent", "1.5", "--json")
    results = json.loads(out)["results"]
    assert {r["method"] for r in results if r.get("fixed")} == set(KEEPERS)
    line = refused("identify", file, "--exponent", "1.5", "--method", "kelvin-voigt")
    assert "kelvin-voigt cannot fix an exponent" in line
    assert "exponent must be in [0.1, 10]" in refused("identify", file, "--exponent", "99")


@pytest.mark.parametrize("value", [0.0, 0.05, 11.0, np.nan, "cone", [1.5]])
def test_invalid_exponents_and_drifts_are_refused_by_name(keeper, value):
    with pytest.raises(InvalidParameterError, match=r"^exponent must "):
        keeper(exponent=value)
    with pytest.raises(InvalidParameterError, match=r"^exponent_drift must be 0 "):
        palpate.DriftTracking(exponent=1.5, exponent_drift=0.01)
