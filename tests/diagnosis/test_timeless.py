"""A curve without time: the stiffness alone, and no damping anywhere."""

import json
import math

import faults
import numpy as np
import pandas
import pytest

import palpate
from palpate import InvalidParameterError, RecordingError
from palpate.errors import ExportRefusedError

NOISY = faults.noisy(faults.FORCE)
CURVE = {"penetration": faults.X, "force": NOISY}


@pytest.fixture(scope="module")
def result() -> palpate.Identification:
    return palpate.identify(**CURVE, no_time=True)


def numbers_under(whole, name: str, path: str = "") -> list[str]:
    """Paths to the numbers whose path holds a name."""
    if isinstance(whole, dict):
        return [
            p for key, each in whole.items() for p in numbers_under(each, name, f"{path}/{key}")
        ]
    if isinstance(whole, list):
        return [p for k, each in enumerate(whole) for p in numbers_under(each, name, f"{path}/{k}")]
    return [path] if name in path and isinstance(whole, float | int) else []


def test_without_time_the_refusal_names_the_option_and_no_rate():
    with pytest.raises(RecordingError, match="--no-time gives the stiffness alone") as refused:
        palpate.prepare(pandas.DataFrame({"depth_m": faults.X, "force_N": NOISY}))
    assert "--rate if" in str(refused.value)
    assert not any(sign.isdigit() for sign in str(refused.value))


def test_the_stiffness_is_that_of_the_same_curve_with_time(result):
    there = result.diagnosis.working_depth
    true = faults.LAW.stiffness_at(there.depth)
    assert abs(there.stiffness.value - true) < 3.0 * there.stiffness.whole_error
    # Without a damper the loop of press and release is a misfit, which widens the bar.
    assert there.stiffness.whole_error < 0.1 * true
    marks = result.diagnosis.verdict
    assert (marks.stiffness, marks.damping, marks.overall) == ("trust", "do-not-trust", "trust")
    assert result.diagnosis.findings[0].check == "no time"


def test_files_frames_and_arrays_agree_without_time(result, tmp_path):
    frame = pandas.DataFrame({"depth_mm": 1e3 * faults.X, "force_N": NOISY})
    frame.to_csv(tmp_path / "curve.csv", index=False)
    timed = frame.assign(time_s=7.0 * faults.TIME, velocity_m_s=faults.V)
    for source in (frame, tmp_path / "curve.csv", timed):
        found = palpate.identify(source, no_time=True)
        assert found.law.parameters == pytest.approx(result.law.parameters, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("release", [False, True])
@pytest.mark.parametrize("noise", [2e-3, 1e-2])
def test_rows_of_a_press_give_the_stiffness_and_no_damping(exponent, release, noise):
    """100 rows with a tenth of free air, as switches and static curves are published."""
    x = np.linspace(-1e-3, 9e-3, 100)
    x = np.concatenate([x, x[::-1]]) if release else x
    force = 10.0 * np.maximum(x / 9e-3, 0.0) ** exponent
    force += 10.0 * noise * np.random.default_rng(3).standard_normal(x.size)
    table = pandas.DataFrame({"position_mm": 12.0 + 1e3 * x, "force_N": force})
    found = palpate.identify(table, no_time=True)
    there = found.diagnosis.working_depth
    assert math.isnan(there.damping.value)
    assert found.diagnosis.verdict.stiffness == "trust"
    depth = there.depth + found.contact.prepared.surface.position - 12e-3
    true = 10.0 / 9e-3 * exponent * (depth / 9e-3) ** (exponent - 1.0)
    assert abs(there.stiffness.value - true) < 3.0 * there.stiffness.whole_error


@pytest.mark.long
def test_no_number_of_a_damping_is_given(result, tmp_path):
    assert result.law.names() == ["K", "n"]
    assert result.trace.parameters.shape[1] == result.covariance.shape[0] == 2
    assert math.isnan(result.damping_at(3e-3).value)
    assert math.isnan(result.law.damping_at(3e-3))
    assert not hasattr(result.law, "B")
    assert not [name for name in result.to_pandas() if "damping" in name]
    assert numbers_under(result.as_dict(), "damping") == []
    derived = ("restitution", "energy", "passivity", "small_oscillation")
    assert [result.as_dict()[name] for name in derived] == [None] * 4
    for refused in (
        result.restitution, result.dynamic_stiffness, lambda: result.energy,
        lambda: result.passivity,
    ):  # fmt: skip
        with pytest.raises(InvalidParameterError, match="the recording has no time"):
            refused()
    assert "damping not given: the recording has no time" in repr(result)
    assert not [f for f in result.diagnosis.findings if math.isfinite(f.moves_damping_percent)]
    result.save(tmp_path)
    saved = palpate.load_result(tmp_path)
    assert saved.law == result.law
    assert saved.contact.timeless
    assert numbers_under(json.loads((tmp_path / "result.json").read_text()), "damping") == []
    for source in (result, saved, saved.law):
        with pytest.raises(ExportRefusedError, match="the recording has no time"):
            palpate.exports.export(source, "mujoco", replay=False)


def test_the_figure_shows_each_parameter_of_the_spring_over_the_samples(result):
    axes = result.plot(["all"]).axes
    assert not [each for each in axes if "N·s" in each.get_ylabel()]
    [exponent] = [each for each in axes if each.get_ylabel().startswith("n")]
    assert exponent.lines[0].get_ydata()[-1] == pytest.approx(result.law.n, rel=0.01)
    assert {each.get_xlabel() for each in axes if each.axison} >= {"sample"}


def test_in_a_table_the_damping_is_unknown(result):
    contact = palpate.prepare(**CURVE, no_time=True)
    [row] = palpate.identify_many([contact], diagnosis="full").to_pylist()
    assert row["error"] is None
    assert row["K"] == pytest.approx(result.law.K)
    assert all(math.isnan(v) for k, v in row.items() if "damping" in k and isinstance(v, float))
    assert row["verdict_damping"] is None


def test_methods_and_settings_that_need_time_are_refused():
    contact = palpate.prepare(**CURVE, no_time=True)
    for method in ("single-stage", "viscoelastic", "kelvin-voigt"):
        with pytest.raises(InvalidParameterError, match="without time only variable-projection"):
            palpate.identify(contact, method)
    assert list(palpate.compare(contact)) == ["variable-projection"]
    with pytest.raises(InvalidParameterError, match="no_time excludes rate, delay and mass"):
        palpate.prepare(**CURVE, no_time=True, rate=100.0)
    with pytest.raises(InvalidParameterError, match="no_time excludes a time"):
        palpate.prepare(**CURVE, time=faults.TIME, no_time=True)


def test_what_changes_the_stiffness_still_marks_it():
    millimetres = palpate.diagnose(
        palpate.prepare(penetration=1e3 * faults.X, force=NOISY, no_time=True)
    )
    assert millimetres.verdict.stiffness == "do-not-trust"
    memory = faults.remembering(2.0, 0.3)
    found = palpate.diagnose(
        palpate.prepare(penetration=memory.penetration, force=memory.force, no_time=True)
    )
    assert found.verdict.stiffness != "trust"
    assert not any(" s" in each.message.split() for each in found.findings)
