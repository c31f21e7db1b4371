"""Broken contacts among the rows of arrays: none spoils another, and none lies."""

import numpy as np
import pytest
from fleets import LAW, STEP, curves

from palpate import VariableProjection, identify, identify_many, prepare

pytest.importorskip("pyarrow")
searching_or_not = pytest.mark.parametrize("surface", [None, "estimate"])


def rows_of(x, v, f, *, surface=None, rejection=None, **options):
    method = VariableProjection(surface=surface, outlier_rejection=rejection)
    clock = {} if "time" in options else {"sample_time": STEP}
    options = {"method": method, "diagnosis": "none", **clock, **options}
    return identify_many(penetration=x, velocity=v, force=f, **options).to_pylist()


@searching_or_not
def test_a_row_that_says_nothing_spoils_no_other(surface):
    x, v, f = curves(4)
    x[1], v[1] = 3e-3, 0.0  # a probe that is held
    x[2] = np.nan
    rows = rows_of(x, v, f, surface=surface)
    alone = rows_of(x[:1], v[:1], f[:1], surface=surface)
    assert rows[0]["stiffness"] == alone[0]["stiffness"]
    assert rows[3]["error"] is None
    assert rows[2]["error"] is not None


@searching_or_not
def test_times_that_do_not_increase_are_an_error_whatever_is_checked(surface):
    x, _, f = curves(3)
    time = np.tile(STEP * np.arange(x.shape[1]), (3, 1))
    time[1, 100] = time[1, 99]
    rows = rows_of(x, None, f, time=time, surface=surface)
    assert [row["error"] is None for row in rows] == [True, False, True]
    assert "sample 100 is at 0.099 s, after 0.099 s" in rows[1]["error"]
    assert np.isnan(rows[1]["stiffness"])


def spiked(x, f):
    f[0, [120, 330]] += 5.0
    x[0, 140] += 2e-3


def clipped(x, f):
    f[0] = np.minimum(f[0], 0.9 * f[0].max())


@searching_or_not
@pytest.mark.parametrize("spoil", [spiked, clipped])
def test_outliers_of_arrays_are_left_out_and_said_as_identify_does(spoil, surface):
    x, v, f = curves(1)
    spoil(x, f)
    [row] = rows_of(x, v, f, surface=surface)
    assert any("left out as outliers" in flag for flag in row["flags"])
    error = row["stiffness_at_depth_standard_error"]
    assert abs(row["stiffness_at_depth"] - LAW.stiffness_at(row["depth"])) < 5.0 * error
    assert error < 0.02 * row["stiffness_at_depth"]
    [all_of_it] = rows_of(x, v, f, surface=surface, rejection=False)
    assert not any("left out" in flag for flag in all_of_it["flags"])
    assert all_of_it["stiffness_at_depth_standard_error"] > 5.0 * error


def test_a_force_that_is_only_rounded_is_no_end_of_the_range():
    x, v, f = curves(1)
    [row] = rows_of(x, v, np.round(f / 0.2) * 0.2)
    assert not any("left out" in flag for flag in row["flags"])


@searching_or_not
def test_a_force_of_the_wrong_sign_is_refused_or_flagged(surface):
    x, v, f = curves(1)
    [row] = rows_of(x, v, -f, surface=surface)
    assert row["error"] or any("negative stiffness" in flag for flag in row["flags"])


def test_a_law_that_pulls_is_flagged_by_identify_too():
    x, v, f = (rows[0] for rows in curves(1))
    time = STEP * np.arange(x.size)
    touch = prepare(time=time, penetration=-x, velocity=-v, force=f, surface="estimate")
    result = identify(touch, VariableProjection(surface="estimate"), trace=False)
    assert result.law.stiffness < 0.0
    assert any("negative stiffness" in flag for flag in result.flags)


@pytest.mark.parametrize("shift", [-3e-3, 4e-3])
def test_a_surface_outside_the_default_range_is_found(shift):
    x, v, f = curves(2)
    rows = rows_of(x + shift, v, f, surface="estimate")
    assert [row["surface"] for row in rows] == pytest.approx([shift] * 2, abs=1e-4)
    assert not any("surface at the edge" in flag for row in rows for flag in row["flags"])


def test_the_checks_see_the_penetration_below_the_surface_that_was_found():
    """4 mN at 5 mm is a soft material; at 50 mm, most of it through the air, a wrong unit."""
    x, v, f = curves(1)
    [row] = identify_many(
        penetration=x + 0.045, velocity=v, force=1e-3 * f, sample_time=STEP,
        method=VariableProjection(surface="estimate", surface_range=(0.04, 0.05)),
        preparation={"surface": "estimate"},
    ).to_pylist()  # fmt: skip
    assert row["surface"] == pytest.approx(0.045, abs=1e-4)
    assert row["findings"] == []


def test_arrays_work_at_the_depth_of_identify_where_the_law_does_not_hold():
    """What a law leaves is no noise: a gate by it would call only the deepest samples firm."""
    x, v, f = curves(1)
    f += 0.3 * np.sin(3e3 * x) * (x > 0.0)
    [row] = rows_of(x, v, f)
    time = STEP * np.arange(x.shape[1])
    touch = prepare(time=time, penetration=x[0], velocity=v[0], force=f[0])
    own = identify(touch, trace=False)
    assert row["depth"] == pytest.approx(own.depths[0], rel=0.02)
    assert row["residual"] > 0.05
