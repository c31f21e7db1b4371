"""A position and a force in two files: who gives what, the offset of the clocks, and its error."""

import json

import numpy as np
import pytest
from containers import write_hdf5
from scipy.optimize import nnls

import palpate
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.input.preparation.clock_offset import rough_offset
from palpate.input.recordings import Recording
from palpate.method.contact import Delay
from palpate.method.estimators.least_squares import nonnegative

LAWS = {
    "hunt-crossley": GeneralisedHuntCrossley(K=9000.0, n=1.4, B=15000.0, p=1.4),
    "half-space": GeneralisedHuntCrossley(K=6000.0, n=1.4, B=60.0, p=0.4),
}
STEP = 1.25e-4  # s, of the motion itself


def touched(law="hunt-crossley", *, seed=0, pose=500.0, push=1000.0, offset=37e-3, drift=0.0):
    """Times and penetration on one clock; times and force on another, which is ahead."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 5.0, STEP)
    x, start = np.full(t.size, -4e-3), 0.5
    for _ in range(4):
        seconds = random.uniform(0.5, 0.9)
        phase = np.clip((t - start) / seconds, 0.0, 1.0)
        x += random.uniform(8e-3, 11e-3) * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
        start += seconds + random.uniform(0.1, 0.3)
    force = np.maximum(LAWS[law].force_along(x, np.gradient(x, t), STEP), 0.0)
    at, later = np.arange(0.03, 4.9, 1.0 / pose), np.arange(0.11, 4.95, 1.0 / push)
    noise = random.standard_normal(at.size + later.size)
    depth = np.interp(at, t, x) + 5e-6 * noise[: at.size]
    return (
        at,
        depth,
        later * (1.0 + drift) + offset,
        np.interp(later, t, force) + 0.03 * noise[at.size :],
    )


def tables(at, depth, later, force, **names):
    pose = Recording({"time_s": at, "penetration_m": depth}, source="pose.csv")
    return pose, Recording({"t": later, "Fz_N": force}, source="ft.csv")


def offset_of(result, later) -> float:
    """The offset that palpate took out of the force's clock, s."""
    return float(np.median(later - result.contact.prepared.recording.channels["ft.csv/t"]))


def errors_in_bars(result, law):
    """Errors of stiffness and damping at the working depth, in bars."""
    at = result.working_depths[0]
    truth = LAWS[law].dynamic_stiffness(at.depth, result.frequency)
    pairs = (at.stiffness, truth.real), (at.damping, truth.imag / result.frequency)
    return [abs(found.value - true) / found.whole_error for found, true in pairs]


@pytest.mark.long
@pytest.mark.parametrize(
    "offset, rates",
    [(37e-3, (500.0, 1000.0)), (-0.4, (1000.0, 500.0)), (0.0, (250.0, 2000.0)), (12.0, (125, 500))],
)
def test_the_offset_of_two_clocks_is_found_with_its_error(offset, rates):
    at, depth, later, force = touched(pose=rates[0], push=rates[1], offset=offset)
    result = palpate.identify(
        *tables(at, depth, later, force)[:1], companion=tables(at, depth, later, force)[1]
    )
    error = result.contact.delay.standard_error
    assert abs(offset_of(result, later) - offset) < min(3.0 * error, 2e-3)
    stiffness, damping = errors_in_bars(result, "hunt-crossley")
    assert stiffness < 3.0
    assert damping < 2.0


def test_a_dated_clock_against_one_from_zero_is_an_offset():
    at, depth, later, force = touched(offset=37e-3)
    stamps = (1.7e18 + 1e9 * later).astype(np.int64).astype("M8[ns]")
    force_file = Recording({"t": stamps, "Fz_N": force}, source="ft.csv")
    contact = palpate.prepare(tables(at, depth, later, force)[0], companion=force_file)
    moved = contact.prepared.recording.channels["ft.csv/t"]
    assert np.median(later - moved) == pytest.approx(37e-3, abs=1e-3)
    assert "ft.csv's clock is 1700000000.037" in contact.provenance["clocks"]


@pytest.mark.long
def test_half_space_damping_hides_a_clock_offset():
    """A force that is late by 7 ms without damping fits nearly as well: no fit can tell."""
    for seed in range(2):
        at, depth, later, force = touched("half-space", seed=seed)
        pose, push = tables(at, depth, later, force)
        result = palpate.identify(pose, companion=push)
        error = result.contact.delay.standard_error
        assert 0.5e-3 < error < 5e-3
        assert abs(offset_of(result, later) - 37e-3) < 2.5 * error
        stiffness, damping = errors_in_bars(result, "half-space")
        assert stiffness < 3.0
        assert damping < 2.0
        assert result.diagnosis.verdict.damping != "trust"
        assert result.diagnosis.remedy == "record position and force by one clock"


@pytest.mark.parametrize("offset, moved", [(0.2e-3, False), (37e-3, True)])
def test_dated_clocks_move_only_by_a_significant_offset(offset, moved):
    at, depth, later, force = touched("half-space", pose=50.0, push=100.0, offset=offset)
    stamps = [(1.7e18 + 1e9 * each).astype(np.int64) for each in (at, later)]
    pose = Recording({"t": stamps[0], "penetration_m": depth}, {"t": "ns"}, "pose.csv")
    push = Recording({"t": stamps[1], "Fz_N": force}, {"t": "ns"}, "ft.csv")
    contact = palpate.prepare(pose, companion=push)
    shift = stamps[1] - contact.prepared.recording.channels["ft.csv/t"]
    assert (abs(float(np.median(shift))) > 10e6) is moved
    assert ("not applied" in contact.provenance["clocks"]) is not moved
    assert contact.delay.found is moved  # the offset found is in the bar in either case
    assert contact.delay.standard_error > 0.0


@pytest.mark.long
def test_a_drifting_clock_is_reported_and_widens_the_bar():
    [steady, drifting] = (touched(drift=drift) for drift in (0.0, 1e-3))
    results = [
        palpate.prepare(pose, companion=push)
        for pose, push in (tables(*each) for each in (steady, drifting))
    ]
    [none, drift] = (each.findings[0] for each in results)
    assert (none.check, none.severity, drift.severity) == ("clock offset", "note", "with-care")
    assert "it drifts by 4." in drift.message or "it drifts by 5" in drift.message
    assert "--start" in drift.remedy
    assert results[1].delay.standard_error > 10.0 * results[0].delay.standard_error


@pytest.fixture
def files(tmp_path):
    """A pose in space as an NPZ file and a wrench in HDF5, the force on an oblique normal."""
    at, depth, later, force = touched(pose=250.0, push=500.0)
    normal = np.array([0.48, -0.36, 0.8])
    position = np.array([0.41, -0.12, 0.233]) - depth[:, None] * normal
    wrench = np.array([0.3, -0.2, 0.6]) + force[:, None] * normal
    np.savez(tmp_path / "pose.npz", time=at, position=position)
    columns = {"time_s": later} | {f"F{axis}_N": wrench[:, k] for k, axis in enumerate("xyz")}
    return tmp_path / "pose.npz", write_hdf5(tmp_path / "ft.h5", columns)


@pytest.mark.long
def test_pose_and_wrench_files_combine_in_any_order_and_format(files, printed, tmp_path):
    config = tmp_path / "run.toml"
    out = printed("identify", files[0], "--with", files[1], "--save-config", config)
    [line] = [line for line in out.splitlines() if line.startswith("clocks")]
    assert line.split()[1:4] == ["ft.h5's", "clock", "is"]
    assert float(line.split()[4]) == pytest.approx(37.0, abs=1.0)
    assert line.endswith("ms ahead; it was moved")
    for others in ([files[0], "--config", config], [files[1], "--with", files[0]]):
        again = printed("identify", *others)
        assert again.splitlines()[1:4] == out.splitlines()[1:4]
    contact = palpate.prepare(files[0], companion=files[1])
    again = contact.prepared.again()
    assert np.array_equal(again.force, contact.force)
    assert again.delay == contact.delay


@pytest.mark.long
def test_info_shows_both_files_on_one_clock(files, printed):
    out = printed("info", files[0], "--with", files[1])
    assert "ft.h5/time_s" in out
    assert "note: clocks: ft.h5's clock is 3" in out
    roles = {
        row["name"]: row["role"]
        for row in json.loads(printed("info", files[0], "--with", files[1], "--json"))["channels"]
    }
    assert [*roles.values()].count("force") == [*roles.values()].count("position") == 3


def test_a_given_offset_is_not_searched_and_its_error_counts():
    at, depth, later, force = touched()
    pose, push = tables(at, depth, later, force)
    contact = palpate.prepare(pose, companion=push, delay=(37e-3, 4e-4))
    assert contact.delay == Delay(0.0, 4e-4)
    moved = contact.prepared.recording.channels["ft.csv/t"]
    np.testing.assert_allclose(moved, later - 37e-3, atol=1e-9)
    same = palpate.prepare(pose, companion=push, delay=(0.0, 1e-4))
    assert same.delay == Delay(0.0, 1e-4)
    np.testing.assert_array_equal(same.prepared.recording.channels["ft.csv/t"], later)


def test_files_without_a_common_contact_are_refused_with_the_remedy(run, tmp_path):
    at, depth, later, force = touched()
    pose, push = tables(at, depth, later, force)
    noise = np.random.default_rng(0).standard_normal(later.size)
    with pytest.raises(palpate.RecordingError, match="cannot find the offset of the two clocks"):
        palpate.prepare(pose, companion=Recording({"t": later, "Fz_N": noise}))
    with pytest.raises(palpate.RecordingError, match="no channel looks like the force"):
        palpate.prepare(pose, companion=pose)
    both = Recording({"time_s": at, "penetration_m": depth, "force_N": depth})
    with pytest.raises(palpate.RecordingError, match="each file has a position and a force"):
        palpate.prepare(both, companion=both)
    with pytest.raises(palpate.InvalidParameterError, match="excludes arrays and no_time"):
        palpate.prepare(pose, companion=push, no_time=True)
    status, _, err = run("identify", tmp_path / "a.csv", tmp_path / "b.csv", "--with", "ft.csv")
    assert (status, err.count("\n")) == (2, 1)
    assert "--with joins a second file to one file" in err


@pytest.mark.long
def test_a_companion_with_only_a_force_provides_the_force():
    at, depth, later, force = touched()
    pose, push = tables(at, depth, later, force)
    estimated = np.full(at.size, 3.0) + np.arange(at.size)
    robot = Recording(
        {**pose.channels, "tau_N": estimated, "force_N": estimated}, source="pose.csv"
    )
    contacts = [palpate.prepare(each, companion=push) for each in (pose, robot)]
    assert np.array_equal(contacts[0].force, contacts[1].force)


def test_a_periodic_motion_prefers_a_small_clock_offset():
    time = np.arange(0.0, 30.0, 5e-3)
    position = np.sin(2.0 * np.pi * time)[:, None]
    force = np.maximum(position, 0.0)
    late = time + 0.9, force[:]
    far = rough_offset((time, position), (time[:-170] + 0.9, force[170:]))
    assert abs(rough_offset((time, position), late, 0.9) - 0.9) < 0.01
    assert abs(rough_offset((time, position), (time[:-170] + 0.9, force[170:]), 0.05) - 0.05) < 0.01
    assert abs(far % 1.0 - 0.05) < 0.01


def test_the_nonnegative_least_squares_is_that_of_scipy():
    random = np.random.default_rng(1)
    for _ in range(20):
        matrix, values = random.standard_normal((60, 9)), random.standard_normal(60)
        none = np.zeros(9, dtype=bool)
        found = nonnegative(matrix.T @ matrix, matrix.T @ values, none, ~none)
        np.testing.assert_allclose(found, nnls(matrix, values)[0], atol=1e-7)
