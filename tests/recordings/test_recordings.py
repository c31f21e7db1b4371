"""Recordings made by others: they may not be copied into the project, so absent is a skip.

The folder is ``../shared/data`` beside the checkout, or where ``PALPATE_DATA`` says. Its README
holds the reference fits; numbers are read from there, not repeated here.
"""

import json
import math

import numpy as np
import pytest
from recordings import FOLDER, files, has_penetration

import palpate
from palpate import ESTIMATORS, ContactGate, RecordingError, SingleStageRLS, open_recording, prepare
from palpate.input.preparation.places import divide_by_place


def one_of_each_set(*patterns: str) -> list:
    """Of each set, which a file's first letter names, one; the others are slow, and the long F."""
    found, seen = [], {"F"}
    for each in files(*patterns):
        path = each.values[0]
        marks = [] if path is None or path.name[0] not in seen else [pytest.mark.slow]
        seen.add("" if path is None else path.name[0])
        found.append(pytest.param(path, id=each.id, marks=[*each.marks, *marks]))
    return found


def reference_rmse(name: str) -> float:
    """The README's "final RMSE%" of the log form in SI: the third number of its column."""
    rows = [line.split("|") for line in (FOLDER / "README.md").read_text().splitlines()]
    [header] = [row for row in rows if any("final RMSE%" in cell for cell in row[1:])]
    column = next(k for k, cell in enumerate(header) if "final RMSE%" in cell)
    [row] = [row for row in rows if len(row) > column and row[1].strip() == name]
    return float(row[column].split("(")[0].split(",")[2])


@pytest.mark.long
@pytest.mark.parametrize("path", one_of_each_set("*.csv"))
def test_every_recording_runs_through_every_method(path):
    if not has_penetration(path):
        return
    results = palpate.compare(prepare(path))
    assert list(results) == list(ESTIMATORS)
    for result in results.values():
        assert result.trace.taken.any()
        assert np.isfinite(result.trace.parameters).all()
        assert np.isfinite(result.trace.standard_errors).all()
        assert math.isfinite(result.fit_rmse_percent)
    json.dumps(results["variable-projection"].as_dict(), allow_nan=False)


@pytest.mark.slow
@pytest.mark.parametrize("path", files("*.csv"))
def test_every_method_is_diagnosed_on_every_recording(path):
    if has_penetration(path):
        for result in palpate.compare(prepare(path)).values():
            json.dumps(result.as_dict(), allow_nan=False)


@pytest.mark.parametrize("path", files("A_*.json", "D_dvrk_palpation_trial4_a.json"))
def test_the_single_stage_fits_as_the_reference_does(path):
    fit = json.loads(path.read_text())["fit"]
    contact = prepare(path.with_suffix(".csv"))
    contact = contact.window(*fit["time"]) if "time" in fit else contact
    gate = ContactGate(fit["x_min"], make_force=fit["F_min"], break_force=fit["F_min"])
    result = palpate.identify(contact, SingleStageRLS(gate=gate))
    # Within 0.5 points; the velocity filter alone moves it by 0.1.
    assert result.fit_rmse_percent == pytest.approx(reference_rmse(path.stem), abs=0.5)


@pytest.mark.parametrize("path", files("B_*.csv"))
def test_a_heel_strike_is_known_to_break_condition_ten(path):
    """Far outside the method's validity (README, set B): an honest result says so."""
    result = palpate.identify(prepare(path), SingleStageRLS())
    assert result.violated_fraction > 0.1
    assert any("|v| ≥ 0.1 K/B" in flag for flag in result.flags)


@pytest.mark.parametrize("path", files("E_*.csv"))
def test_a_micro_scale_recording_learns_damping_in_units_of_its_own(path):
    """In SI the log form never learns B here (README, set E); a scale of the data's own does."""
    contact = prepare(path)
    scaled = palpate.identify(contact, SingleStageRLS())
    plain = palpate.identify(contact, SingleStageRLS(gate=scaled.gate, scale=palpate.Scale()))
    assert scaled.scale.penetration < 1e-3
    # B/K is some 1e4 s/m, against some 1e2 in SI: of two orders of magnitude one is asked.
    assert abs(scaled.law.dissipation) > 10.0 * abs(plain.law.dissipation)


@pytest.mark.slow
@pytest.mark.parametrize("path", files("D_dvrk_trial4_raw*.csv"))
def test_a_robots_own_recording_goes_end_to_end(path):
    """Poses and forces over a phantom; a window of it was cut and projected by hand by others."""
    fit = json.loads((FOLDER / "D_dvrk_palpation_trial4_a.json").read_text())
    by_hand = palpate.identify(FOLDER / "D_dvrk_palpation_trial4_a.csv").diagnosis.working_depth
    contact = prepare(path)
    start, stop = fit["t_start_s"], fit["t_end_s"]
    [(place, own)] = [
        each
        for each in divide_by_place(contact, rejecting=True)
        if each[0].start <= start and each[0].stop >= stop
    ]
    assert place.normal.vector == pytest.approx(fit["normal"], abs=0.02)
    found = palpate.identify(own).at_depth(by_hand.depth).diagnosis.working_depth
    for name in ("stiffness", "damping"):
        ours, theirs = getattr(found, name), getattr(by_hand, name)
        total = math.hypot(*(e for q in (ours, theirs) for e in (q.standard_error, q.systematic)))
        assert abs(ours.value - theirs.value) < 3.0 * total


@pytest.mark.slow
@pytest.mark.parametrize("path", files("D_dvrk_*raw*.csv"))
def test_a_probe_that_travels_is_identified_place_by_place(path):
    result = palpate.identify(prepare(path)).by_place()
    assert len(result.segments) > 100
    stiffness = [part.diagnosis.working_depth.stiffness.value for part in result.segments]
    assert 100.0 < np.median(stiffness) < 1000.0  # N/m; README, set D: 340 to 540
    json.dumps(result.as_dict(), allow_nan=False)


@pytest.mark.parametrize("path", files("G_silicone_*.csv"))
def test_a_surface_that_is_never_seen_is_called_an_assumption(path):
    findings = palpate.identify(path).diagnosis.findings
    assert any(f.check == "surface" and "position is assumed" in f.message for f in findings)


@pytest.mark.parametrize("path", one_of_each_set("[ACDEFG]_*[!w].csv"))
def test_every_recording_dissipates_energy(path):
    if not has_penetration(path):
        pytest.skip("a travelling probe: its places have their own")
    result = palpate.identify(path)
    energy, drop_restitution = result.energy, result.restitution()
    assert energy.kind in ("touch", "cycle")
    assert 0.0 < energy.measured.value < energy.put_in  # each of these materials damps
    assert 0.0 < drop_restitution.coefficient.value < 1.0
    if not result.law.remembers:  # whose force in an unknown state may be below the offset
        assert 0.0 <= result.passivity.fraction < 0.05
    json.dumps(result.as_dict(), allow_nan=False)


@pytest.mark.parametrize("path", files("afm_maps/*.jpk-force-map"))
def test_every_curve_of_a_force_map_is_read(path):
    with pytest.raises(RecordingError, match="curves; choose one with --curve N") as refusal:
        open_recording(path)
    count = int(str(refusal.value).partition("holds ")[2].split()[0])
    names = {"force", "height (measured)", "height (piezo)", "segment", "time", "tip position"}
    for number in range(count):
        curve = open_recording(path, curve=number)
        assert set(curve.channels) == names
        assert not curve.losses
        approach = curve.channels["segment"] == 0
        height = curve.channels["height (measured)"]
        assert height[approach][0] > height[approach][-1]  # it comes down
        assert curve.channels["force"].argmax() == pytest.approx(approach.sum(), abs=600)

    taken = FOLDER / "E_afm_refpoints_c0.csv"
    about = json.loads(taken.with_suffix(".json").read_text())
    if not about["path"].endswith(path.name):
        return
    curve, other = open_recording(path, curve=about["curve"]), open_recording(taken)
    rows = np.rint(other.numbers("time_s") * about["rate_hz"]).astype(int)
    force = curve.channels["force"][rows] - about["baseline_force_N"]
    # Nine digits were written there.
    np.testing.assert_allclose(force, other.numbers("force_N"), rtol=1e-8, atol=1e-17)
    height = curve.channels["height (measured)"][rows]
    np.testing.assert_allclose(height, other.numbers("height_m"), rtol=1e-8)
