"""A run on the bench: sensors, seeds, files, and what identification makes of them."""

import os
import subprocess
import sys

import numpy as np
import pytest

import palpate
from palpate import GeneralisedHuntCrossley, SingleRelaxation, ViscoelasticContact, identify, lab

IDEAL = lab.IdealProbe()
IN_CLASS = ("ball", "sponge", "pvc", "inclusion")


def standardised(name: str, seed: int, seconds: float) -> np.ndarray:
    """Errors of K, B and n in standard errors of the identification."""
    material = lab.MATERIALS[name]
    contact = lab.Bench(material, lab.THREE_SINES).run(seed, seconds=seconds).contact
    result = palpate.identify(contact)
    return (result.law.parameters - material.law.parameters) / result.estimate.standard_errors


def test_the_force_is_rounded_noisy_and_free_of_its_bias_and_with_perfect_sensors_the_truth():
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
    assert "bias is still in" in run.contact.provenance["tare"]
    steps = run.contact.penetration / 20e-6
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.parametrize("probe", [IDEAL, lab.TwinPantograph()], ids=["ideal", "robot"])
def test_the_same_seed_gives_the_same_file_and_another_does_not(probe, tmp_path):
    bench = lab.Bench(lab.PVC, lab.THREE_SINES, probe)
    files = [tmp_path / f"{k}.csv" for k in range(3)]
    for file, seed in zip(files, (4, 4, 5), strict=True):
        palpate.write_contact(bench.run(seed, seconds=4.0).contact, file)
    same, again, other = (file.read_bytes() for file in files)
    assert same == again
    assert same != other


@pytest.mark.parametrize("seeds", [1, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", IN_CLASS)
def test_identify_recovers_a_material_within_its_error_bars(name, seeds):
    seconds = 5.0 if seeds == 1 else 10.0
    errors = [standardised(name, seed, seconds) for seed in range(seeds)]
    inside = sum(np.abs(error).max() < 3.0 for error in errors)
    # Three parameters, each within 3 σ in 99.7 %: 19 or 20 of 20 in 99.7 % of such tests.
    assert inside >= max(seeds - 1, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, memory",
    [
        (GeneralisedHuntCrossley(8000.0, 1.5, 60.0, 0.5), "auto"),
        (GeneralisedHuntCrossley(8000.0, 1.5, 4e3, 1.5, 4e3, SingleRelaxation(0.1)), "any"),
        (GeneralisedHuntCrossley(8000.0, 1.5, 60.0, 0.5, 4e3, SingleRelaxation(0.1)), "any"),
    ],
    ids=["half-space", "single", "half-space single"],
)
def test_what_the_robot_presses_is_found_with_its_memory(law, memory):
    bench = lab.Bench(lab.Homogeneous(law), lab.THREE_SINES)
    for seed in range(4):
        estimate = identify(bench.run(seed).contact, ViscoelasticContact(memory=memory)).estimate
        assert type(estimate.law.relaxation) is type(law.relaxation)
        known = estimate.standard_errors > 0.0
        errors = (estimate.parameters - law.parameters)[known] / estimate.standard_errors[known]
        # Seen over ten seeds: 2.5 at most, of up to six numbers.
        assert np.abs(errors).max() < 3.5


@pytest.mark.slow
def test_of_tissue_an_oscillation_feels_what_is_found():
    for seed in range(4):
        contact = lab.Bench(lab.TISSUE, lab.THREE_SINES).run(seed).contact
        felt = identify(contact, ViscoelasticContact()).estimator.dynamic_stiffness()
        exact = lab.TISSUE.law.dynamic_stiffness(felt.depth, felt.frequency)
        # Six relaxation times stand for the spectrum. Seen over ten seeds: 0.2 and 0.9 %.
        assert felt.stiffness == pytest.approx(exact.real, rel=4e-3)
        assert felt.frequency * felt.damping == pytest.approx(exact.imag, rel=15e-3)


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
