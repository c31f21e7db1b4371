"""The laboratory: its materials and motions; sensors, seeds, files, and what is identified."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import palpate
from palpate import (
    GeneralisedHuntCrossley,
    HuntCrossley,
    InvalidParameterError,
    KelvinVoigt,
    RecordingError,
    SingleRelaxation,
    ViscoelasticContact,
    identify,
    lab,
)

IDEAL = lab.IdealProbe()


def test_the_simulated_force_sensor_adds_noise_and_rounding():
    run = lab.Bench(lab.BALL, lab.THREE_SINES, IDEAL).run(seed=3)
    error = run.contact.force - run.truth.force
    # Noise and rounding, √(0.05² + 0.125²/12) = 0.062 N, and 10 000 samples of it.
    assert error.std() == pytest.approx(0.0616, rel=0.05)
    assert abs(error.mean()) < 5e-3  # 2 000 samples of the pause leave 1.4 mN, rounding 1.7 mN
    steps = np.diff(np.unique(run.contact.force))
    np.testing.assert_allclose(steps / 0.125, np.round(steps / 0.125), atol=1e-9)
    run = lab.Bench(lab.BALL, lab.THREE_SINES, IDEAL, lab.PERFECT).run()
    np.testing.assert_array_equal(run.contact.penetration, run.truth.penetration)
    np.testing.assert_array_equal(run.contact.force, run.truth.force)


def test_without_a_pause_the_bias_stays_and_the_penetration_may_be_rounded():
    trajectory = lab.Probing(pause=0.0)
    sensors = lab.Sensors(force_bias=5.0, penetration_resolution=20e-6)
    run = lab.Bench(lab.BALL, trajectory, IDEAL, sensors).run(seed=1)
    assert abs((run.contact.force - run.truth.force).mean()) > 0.1
    assert "bias not removed" in run.contact.provenance["tare"]
    steps = run.contact.penetration / 20e-6
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("probe", [IDEAL, lab.TwinPantograph()], ids=["ideal", "robot"])
def test_the_same_seed_gives_the_same_file_and_another_does_not(probe, tmp_path):
    bench = lab.Bench(lab.PVC, lab.THREE_SINES, probe)
    files = [tmp_path / f"{k}.csv" for k in range(3)]
    for file, seed in zip(files, (4, 4, 5), strict=True):
        palpate.write_contact(bench.run(seed, seconds=4.0).contact, file)
    same, again, other = (file.read_bytes() for file in files)
    assert same == again
    assert same != other


@pytest.mark.long
@pytest.mark.parametrize("seeds", [1, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["ball", "sponge", "pvc", "inclusion"])
def test_identify_recovers_a_material_within_its_error_bars(name, seeds):
    seconds, law, inside = 5.0 if seeds == 1 else 10.0, lab.MATERIALS[name].law, 0
    for seed in range(seeds):
        run = lab.Bench(lab.MATERIALS[name], lab.THREE_SINES).run(seed, seconds=seconds)
        found = palpate.identify(run.contact)
        off = np.abs(found.law.parameters - law.parameters) / found.estimate.standard_errors
        inside += off.max() < 3.0
    # Three parameters, each within 3 σ in 99.7 %: 19 or 20 of 20 in 99.7 % of such tests. On the
    # stiffest material half an encoder's count is a dead band, of which no bar of K, B and n knows.
    assert inside >= max(seeds - (2 if name == "inclusion" else 1), 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [
        GeneralisedHuntCrossley(K=8000.0, n=1.5, B=60.0, p=0.5),
        GeneralisedHuntCrossley(
            K=8000.0, n=1.5, B=4e3, p=1.5, M=4e3, relaxation=SingleRelaxation(0.1)
        ),
        GeneralisedHuntCrossley(
            K=8000.0, n=1.5, B=60.0, p=0.5, M=4e3, relaxation=SingleRelaxation(0.1)
        ),
    ],
    ids=["half-space", "single", "half-space single"],
)
def test_a_relaxing_material_pressed_by_a_robot_is_found(law):
    bench = lab.Bench(lab.Homogeneous(law), lab.THREE_SINES)
    for seed in range(4):
        result = identify(bench.run(seed).contact, ViscoelasticContact())
        assert result.law.remembers == law.remembers
        felt = result.dynamic_stiffness()
        exact = law.dynamic_stiffness(felt.depth, felt.frequency)
        for found, truth in (
            (felt.stiffness, exact.real),
            (felt.damping, exact.imag / felt.frequency),
        ):
            assert abs(found.value - truth) < 3.5 * found.whole_error


@pytest.mark.slow
def test_the_file_does_not_depend_on_what_the_processor_can_do(tmp_path):
    core = pytest.importorskip("numpy._core._multiarray_umath", reason="NumPy 1 names it otherwise")
    extensions = [name for name in core.__cpu_dispatch__ if core.__cpu_features__[name]]
    if not extensions:
        pytest.skip("this processor has nothing beyond NumPy's baseline")
    files = []
    for disabled in ("", " ".join(extensions)):
        files.append(tmp_path / f"{bool(disabled)}.csv")
        arguments = ["lab", "pvc", "--seconds", "3", "-o", str(files[-1])]
        program = f"import sys; from palpate.cli import main; sys.argv[1:] = {arguments!r}; main()"
        environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": disabled}
        subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    first, second = (file.read_bytes() for file in files)
    assert first == second


TIME = np.arange(0.0, 3.0, 1e-3)
DEPTH = 6e-3 + 4e-3 * np.sin(5.0 * TIME)
SPEED = 20e-3 * np.cos(5.0 * TIME)
HERE = np.zeros_like(TIME)


@pytest.mark.parametrize("name", lab.MATERIALS)
def test_step_by_step_simulation_equals_the_whole_motion(name):
    material = lab.MATERIALS[name]
    along = material.force(TIME, HERE, DEPTH, SPEED)
    touch = material.touch()
    steps = [touch(*sample) for sample in zip(TIME, HERE, DEPTH, SPEED, strict=True)]
    # A spectrum is summed in another order: some roundings.
    np.testing.assert_allclose(along, steps, rtol=1e-12, atol=1e-12)
    # It says its truth in plain numbers.
    assert json.loads(json.dumps(material.describe())) == material.describe()


# What remembers lags behind a probe that leaves.
@pytest.mark.parametrize("name", sorted(lab.MATERIALS.keys() - {"relaxing-sponge", "tissue"}))
def test_a_material_pushes_where_it_is_touched_and_nowhere_else(name):
    force = lab.MATERIALS[name].force(TIME, HERE, DEPTH - 6e-3, SPEED)
    inside = DEPTH > 6e-3
    assert (force[inside] > 0.0).all()
    assert (force[~inside] == 0.0).all()


def test_a_held_material_relaxes_with_its_time_constant():
    material = lab.Relaxing(lab.RELAXING_SPONGE.law, 150.0, 0.5)
    depth = np.full_like(TIME, 0.01)
    force = material.force(TIME[1:], HERE[1:], depth[1:], HERE[1:])
    # It is touched at its first sample, where nothing has stretched the branch yet.
    touch = material.touch()
    touch(0.0, 0.0, 0.0, 0.0)
    pressed = np.array([touch(t, 0.0, 0.01, 0.0) for t in TIME[1:]])
    above = pressed - 300.0 * 0.01
    # Pressed in within the first millisecond, then left alone: exact but for rounding.
    np.testing.assert_allclose(above, above[0] * np.exp(-(TIME[1:] - TIME[1]) / 0.5), rtol=1e-9)
    # Within that millisecond it relaxes already: the mean of e^(−t/τ) over it is left.
    assert above[0] == pytest.approx(150.0 * 0.01 * (1.0 - np.exp(-0.002)) / 0.002, rel=1e-9)
    np.testing.assert_allclose(force, 3.0)


def test_a_relaxing_material_never_pulls_on_a_leaving_probe():
    material = lab.Relaxing(lab.RELAXING_SPONGE.law, 3000.0, 0.1)
    force = material.force(TIME, HERE, DEPTH - 5e-3, SPEED)
    inside = DEPTH > 5e-3
    assert force.min() == 0.0
    assert (force[inside] == 0.0).any()
    assert force.max() > 1.0


def test_a_layer_is_its_law_at_the_surface_and_stiffens_above_a_body():
    bare = lab.OVER_BAR.law.force(DEPTH, SPEED)
    layered = lab.OVER_BAR.force(TIME, HERE, DEPTH, SPEED)
    pressed = DEPTH > 0.0
    factor = layered[pressed] / bare[pressed]
    # King's for a rigid substrate, 1/(1 − w), w = e^(−0.63 · 7 mm / x): 1.5 at 4 mm.
    np.testing.assert_allclose(factor, 1.0 / (1.0 - np.exp(-0.63 * 7e-3 / DEPTH[pressed])))
    assert np.interp(4e-3, np.sort(DEPTH[pressed]), np.sort(factor)) == pytest.approx(1.5, abs=0.01)
    near = lab.OVER_BAR.touch()
    assert near(0.0, 0.0, 1e-4, 0.0) == lab.OVER_BAR.law.force(1e-4, 0.0)
    assert near(0.0, 0.0, -1e-4, 0.0) == 0.0


def test_the_place_decides_between_zones_and_the_time_between_episodes():
    laws = lab.PVC.law, lab.INCLUSION.law
    parts = tuple(lab.Homogeneous(law) for law in laws)
    soft, hard = (law.force(DEPTH, SPEED) for law in laws)
    lateral_position = 0.01 * np.sin(TIME)
    zones = lab.SpaceVaryingMaterial(parts, (0.002,)).force(TIME, lateral_position, DEPTH, SPEED)
    np.testing.assert_array_equal(zones, np.where(lateral_position < 0.002, soft, hard))
    episodes = lab.TimeVaryingMaterial(parts, (1.5,)).force(TIME, HERE, DEPTH, SPEED)
    np.testing.assert_array_equal(episodes, np.where(TIME < 1.5, soft, hard))


PROBE = lab.IdealProbe()
TWO, THREE = (lab.BALL, lab.PVC), (lab.BALL, lab.PVC, lab.PVC)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: lab.Homogeneous("ball"), "law must be a ForceLaw"),
        (lambda: lab.Homogeneous(KelvinVoigt(K=-1.0, B=1.0)), "K must be in"),
        (lambda: lab.Relaxing(KelvinVoigt(K=1.0, B=1.0), 1.0, 1.0), "law must be a HuntCrossley"),
        (
            lambda: lab.Relaxing(HuntCrossley(K=1.0, B=1.0, n=1.0), 1.0, 0.0),
            "relaxation_time must be",
        ),
        (lambda: lab.SpaceVaryingMaterial(TWO, ()), "borders must have length 1"),
        (lambda: lab.Layered(lab.PVC.law, 0.0, 1.0), "depth must be"),
        (lambda: lab.Layered(lab.PVC.law, 1e-3, -1.0), "influence must be"),
        (lambda: lab.SpaceVaryingMaterial(THREE, (1.0, 0.0)), "borders must increase"),
        (lambda: lab.TimeVaryingMaterial((lab.BALL, 3), (1.0,)), "must be a Material, not 3"),
        (lambda: lab.TwinPantograph(counts_per_turn=-1.0), "counts_per_turn must be in"),
        (lambda: lab.SplineTrajectory([0.0, 1.0], [0.0, 1.0]), "at least four"),
        (lambda: lab.SplineTrajectory([0.0, 1.0, 1.0, 2.0], [0.0] * 4), "time must increase"),
        (lambda: lab.Probing(clearance=-1.0), "clearance must be in"),
        (lambda: lab.Palpation(shift=6.0), "shift must be in"),
        (lambda: lab.Tapping(depths=()), "depths must have"),
        (lambda: lab.Bench("ball", lab.THREE_SINES, PROBE), "material must be a Material"),
        (lambda: lab.Bench(lab.BALL, "sines", PROBE), "trajectory must be a Trajectory"),
        (lambda: lab.Bench(lab.BALL, lab.THREE_SINES, "robot"), "probe must be a Probe"),
        (lambda: lab.Sensors(force_noise=-1.0), "force_noise must be in"),
        (lambda: lab.Bench(lab.BALL, lab.ONE_SINE, PROBE).run(-1), "seed must be in"),
    ],
)
def test_nonsense_is_refused_by_name(make, words):
    with pytest.raises(InvalidParameterError, match=words):
        make()


CLOCK = np.arange(0.0, 40.0, 1e-3)
MOVES = {
    **lab.TRAJECTORIES,
    "followed": lab.SplineTrajectory(CLOCK[::500], 1e-3 * np.sin(CLOCK[::500]), pause=0.0),
}


@pytest.mark.parametrize("name", MOVES)
def test_the_commanded_speeds_are_the_slopes_of_the_commanded_places(name):
    h = 1e-5
    inside = CLOCK[10:-10]
    ahead, behind, now = (MOVES[name].at(inside + shift) for shift in (h, -h, 0.0))
    # Central differences: h² x‴/6 is below 1e-8 of these motions, and rounding below 1e-11.
    slope = (ahead.penetration - behind.penetration) / (2.0 * h)
    np.testing.assert_allclose(now.velocity, slope, atol=2e-6)
    slope = (ahead.lateral_position - behind.lateral_position) / (2.0 * h)
    np.testing.assert_allclose(now.lateral_velocity, slope, atol=2e-6)


@pytest.mark.parametrize("name", lab.TRAJECTORIES)
def test_nothing_moves_in_the_pause_and_the_probe_is_above_the_surface(name):
    trajectory = lab.TRAJECTORIES[name]
    assert trajectory.pause == 2.0
    command = trajectory.at(CLOCK[CLOCK <= 2.0])
    assert (command.penetration == command.penetration[0]).all()
    assert command.penetration[0] < 0.0
    assert (command.velocity == 0.0).all()
    assert np.ptp(command.lateral_position) == 0.0


def test_the_three_sines_are_those_of_the_paper_once_the_approach_is_over():
    start = 2.417
    after = CLOCK[start <= CLOCK]
    command = lab.THREE_SINES.at(after)
    t = after - start
    x = 10e-3 + 1e-3 * np.sin(4 * t) + 1.8e-3 * np.sin(11 * t) + 1.8e-3 * np.sin(15 * t)
    np.testing.assert_allclose(command.penetration, x, rtol=1e-12)
    # They meet 2π later, at t = 8.7 s: where the paper sees condition 10 broken on the phantom.
    later = (after > 3.0) & (after < 10.0)
    assert after[later][np.argmax(command.velocity[later])] == pytest.approx(8.7, abs=0.01)
    assert command.velocity.max() == pytest.approx(50.8e-3, rel=1e-4)


@pytest.mark.parametrize("name", ["three-sines", "two-sines", "one-sine", "palpation"])
def test_the_probe_stays_in_the_material_or_leaves_it_as_is_meant(name):
    assert lab.TRAJECTORIES[name].at(CLOCK[CLOCK > 2.5]).penetration.min() > 4e-3
    # Near the surface at speed now and then, tapping after every stroke.
    command = lab.NEAR_SURFACE.at(CLOCK)
    x, v = command.penetration, command.velocity
    leaving = np.flatnonzero((x[1:] <= 0.0) & (x[:-1] > 0.0))
    assert leaving.size >= 2
    assert v[leaving].min() < -8e-3
    x = lab.TAPPING.at(CLOCK).penetration
    touches = np.count_nonzero((x[1:] > 0.0) & (x[:-1] <= 0.0))
    assert touches == pytest.approx(1.4 * 38.0, abs=1.0)


def test_palpation_changes_sides_every_five_seconds():
    changes = CLOCK[1:][np.diff(lab.PALPATION.at(CLOCK).lateral_position >= 0.0)]
    np.testing.assert_allclose(changes, 2.0 + 5.0 * np.arange(1, 8), atol=2e-3)


def test_a_custom_motion_rests_before_and_after():
    time = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
    depth = np.array([0.0, 1e-3, 3e-3, 2e-3, 0.0])
    followed = lab.SplineTrajectory(time, depth)
    np.testing.assert_allclose(followed.at(time).penetration, depth, atol=1e-18)
    outside = followed.at(np.array([0.0, 4.0]))
    assert (outside.penetration == 0.0).all()
    assert (outside.velocity == 0.0).all()


def test_a_motion_is_read_from_a_file_with_its_pause(tmp_path):
    time = np.arange(0.0, 5.0, 0.01)
    depth = np.where(time < 2.0, -1e-3, -1e-3 + 5e-3 * np.sin(time - 2.0) ** 2)
    columns, header = np.column_stack([time, depth]), "time_s,penetration_m"
    np.savetxt(tmp_path / "motion.csv", columns, "%.17g", ",", header=header, comments="")
    followed = lab.SplineTrajectory.read(tmp_path / "motion.csv")
    assert followed.pause == pytest.approx(2.0, abs=0.011)
    np.testing.assert_allclose(followed.at(time).penetration, depth, atol=1e-15)


@pytest.mark.parametrize(
    "text, words",
    [
        ("time_s,depth\n0,1\n", r"motion\.csv: no column 'penetration_m'"),
        ("time_s,penetration_m\n0,0\n1,0.001\n", r"motion\.csv: .* at least four finite samples"),
    ],
)
def test_a_file_that_holds_no_motion_is_refused_by_its_name(tmp_path, text, words):
    (tmp_path / "motion.csv").write_text(text)
    with pytest.raises(RecordingError, match=words):
        lab.SplineTrajectory.read(tmp_path / "motion.csv")
