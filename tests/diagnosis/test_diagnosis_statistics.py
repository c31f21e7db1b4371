"""How often the diagnosis is right, over seeds; `benchmarks.diagnosis` has many more faults."""

import faults
import numpy as np
import pytest

import palpate
from palpate import lab

pytestmark = pytest.mark.slow

SEEDS = range(40)


def late(seconds: float, seed: int) -> palpate.Contact:
    time, x, v = faults.motion()
    force = np.interp(time - seconds, time, faults.pushed(x, v))
    return faults.contact(time, x, faults.noisy(force, seed))


def overall(contact: palpate.Contact) -> str:
    return palpate.diagnose(contact).verdict.overall


def test_clean_recordings_are_trusted_and_their_bars_cover_the_truth():
    """Their rms is 1.4: the velocity filter's 0.1 % of the damping, the same in each, is in it."""
    deviations = []
    for seed in SEEDS:
        found = palpate.diagnose(faults.clean(seed))
        assert found.verdict.overall == "trust"
        there = found.working_depth
        truth = faults.LAW.stiffness_at(there.depth), faults.LAW.damping_at(there.depth)
        for quantity, true in zip((there.stiffness, there.damping), truth, strict=True):
            deviations.append((quantity.value - true) / quantity.standard_error)
    assert 0.5 < np.sqrt(np.mean(np.square(deviations))) < 1.7


@pytest.mark.parametrize("milliseconds, least", [(2.0, 0.8), (5.0, 1.0)])
def test_a_delay_is_seen(milliseconds, least):
    seen = [overall(late(1e-3 * milliseconds, seed)) != "trust" for seed in SEEDS]
    assert np.mean(seen) >= least


def test_a_change_of_five_per_cent_is_seen():
    seen = []
    for seed in SEEDS:
        time, x, v = faults.motion()
        force = faults.pushed(x, v) * np.where(time > 3.5, 1.05, 1.0)
        found = palpate.diagnose(faults.contact(time, x, faults.noisy(force, seed)))
        seen.append(len(found.episodes) == 2)
    assert np.mean(seen) >= 0.98


@pytest.mark.parametrize("name", ["ball", "sponge", "pvc"])
@pytest.mark.parametrize("millimetres", [0.35, -0.35])
def test_a_wrong_surface_is_seen_on_the_robot(robot_runs, name, millimetres):
    for run in robot_runs[name]:
        contact = palpate.prepare(
            time=run.time, penetration=run.penetration + 1e-3 * millimetres, force=run.force
        )
        found = palpate.diagnose(contact)
        assert "surface" in [finding.check for finding in found.findings if finding.z > 4.5]


def test_clean_runs_of_the_robot_are_trusted(robot_runs):
    assert {overall(run) for runs in robot_runs.values() for run in runs} == {"trust"}


@pytest.mark.parametrize("probe", [lab.IdealProbe, lab.TwinPantograph])
def test_the_damping_of_a_sponge_is_in_its_bar_or_untrusted(probe):
    """B′ of a spring beside a Maxwell branch E, τ: B xⁿ + E τ/(1 + (ωτ)²), by another law."""
    if probe is lab.TwinPantograph:
        pytest.importorskip("mujoco", reason="needs MuJoCo: pip install '.[lab]'")
    sponge = lab.MATERIALS["relaxing-sponge"]
    bench = lab.Bench(sponge, lab.THREE_SINES, probe=probe())
    for seed in range(16):
        result = palpate.identify(bench.run(seed, seconds=10.0).contact, law="auto")
        felt, tau = result.dynamic_stiffness(), sponge.relaxation_time
        relaxed = sponge.branch_stiffness * tau / (1.0 + (felt.frequency * tau) ** 2)
        off = felt.damping.value - sponge.law.damping_at(felt.depth) - relaxed
        trusted = result.diagnosis.verdict.damping == "trust"
        assert not (trusted and abs(off) > 2.0 * felt.damping.whole_error)


@pytest.fixture(scope="module")
def robot_runs() -> dict[str, list[palpate.Contact]]:
    """Ten seconds on each material, four times."""
    pytest.importorskip("mujoco", reason="needs MuJoCo: pip install '.[lab]'")
    return {
        name: [
            lab.Bench(lab.MATERIALS[name], lab.THREE_SINES).run(seed).contact for seed in range(4)
        ]
        for name in ("ball", "sponge", "pvc")
    }
