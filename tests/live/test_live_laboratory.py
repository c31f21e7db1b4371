"""The laboratory that goes on is that of the batch run, and continuous whatever is asked of it."""

import os
import sys
import time

import numpy as np
import pytest

from palpate import HuntCrossley, InvalidParameterError, lab
from palpate.live.laboratory import Laboratory, start_bench
from palpate.live.sources import EndOfSourceError

STEP = 1e-3


def ongoing(probe=None, *, material=lab.BALL, trajectory=lab.THREE_SINES, sensors=lab.PERFECT):
    bench = lab.Bench(material, trajectory, probe or lab.IdealProbe(), sensors)
    return lab.OngoingBench(bench, seed=4)


def advanced(bench, seconds, block=20):
    return np.concatenate([bench.advance(block) for _ in range(round(seconds / STEP / block))])


@pytest.mark.parametrize("block", [pytest.param(1, marks=pytest.mark.slow), 37])
def test_a_bench_that_goes_on_is_the_batch_run_to_the_last_bit(block):
    bench = lab.Bench(lab.SOFT_THEN_HARD, lab.PALPATION)
    size = 2500 // block * block
    batch = bench.run(4, seconds=size * STEP).contact
    going = lab.OngoingBench(bench, 4)
    rows = np.concatenate([going.advance(block) for _ in range(size // block)])
    np.testing.assert_array_equal(rows[:, 1], batch.penetration)
    np.testing.assert_array_equal(rows[:, 0], batch.time)
    tare = float(batch.provenance["tare"].split()[3])  # in six digits
    assert rows[:, 2] - tare == pytest.approx(batch.force, abs=1e-5)


@pytest.mark.parametrize("ask", ["change", "place", "move"])
def test_no_command_makes_the_probe_jump(ask):
    bench = ongoing()
    before = advanced(bench, 4.0)
    getattr(bench, ask)(lab.TAPPING if ask == "move" else lab.SPONGE)
    depth = np.concatenate([before, advanced(bench, 6.0)])[:, 1]
    speed = np.diff(depth) / STEP
    # The quickest of both motions, and the way to the beginning of the other in 0.5 s.
    assert np.abs(speed).max() < 0.15
    # Over one sample the speed changes by what an acceleration of some 2 m/s² makes of it.
    assert np.abs(np.diff(speed)).max() < 5e-3
    assert bench.trajectory is (lab.TAPPING if ask == "move" else lab.THREE_SINES)
    assert bench.material is (lab.BALL if ask == "move" else lab.SPONGE)


def test_a_new_material_starts_only_after_the_probe_has_left():
    bench = ongoing()
    advanced(bench, 4.0)
    bench.change(lab.SPONGE)
    now = advanced(bench, 1.0)
    expected = lab.SPONGE.law.force(now[:, 1], np.gradient(now[:, 1], STEP))
    np.testing.assert_allclose(now[5:-5, 2], expected[5:-5], rtol=2e-3)
    bench.place(lab.BALL)
    leaving = advanced(bench, 0.4)
    assert bench.material is lab.SPONGE
    assert leaving[-1, 1] < leaving[0, 1]
    resting = advanced(bench, 1.0)
    assert bench.material is lab.BALL
    assert resting[-1, 1] < 0.0


def test_the_last_command_in_a_transition_wins():
    bench = ongoing()
    advanced(bench, 3.0)
    for _ in range(300):
        bench.move(lab.TAPPING)
        bench.advance(1)
    bench.move(lab.TWO_SINES)
    began = time.perf_counter()
    advanced(bench, 4.0)
    assert bench.trajectory is lab.TWO_SINES
    assert time.perf_counter() - began < 5.0


def test_a_diverged_simulation_restarts_on_the_first_material():
    bench = ongoing(lab.TwinPantograph())
    advanced(bench, 3.0)
    bench.change(lab.Homogeneous(HuntCrossley(K=1e9, B=1e9, n=1.0), "a rock"))
    with pytest.raises(InvalidParameterError, match="too stiff"):
        advanced(bench, 2.0)
    again = advanced(bench, 1.0)
    assert bench.material is lab.BALL
    assert again[0, 1] < 0.0


@pytest.mark.long
def test_the_laboratory_runs_in_real_time_and_does_what_it_is_asked():
    source = Laboratory("ball", probe="ideal")
    source.open()
    began, rows, asked = time.monotonic(), [], ""
    while time.monotonic() - began < 1.0:
        arrival = source.take(0.2)
        assert arrival is not None
        assert arrival.there <= time.monotonic()
        rows.append(arrival)
        if len(rows) == 300:
            asked = source.ask({"change": "sponge"})
    assert asked.startswith("material: sponge")
    assert source.chosen["material"] == "sponge"
    assert source.chosen["truth"]["K"] == 300.0
    assert len(rows) == pytest.approx(1000, abs=150)
    assert np.diff([row.time for row in rows]) == pytest.approx(STEP)
    assert source.counts.lost == 0
    assert source.offers["material"] == list(lab.MATERIALS)
    for wrong in ({}, {"colour": "red"}, {"material": "jelly"}, {"motion": 3}):
        with pytest.raises(InvalidParameterError):
            source.ask(wrong)
    assert "ideal probe" in source.name
    source._process.kill()
    with pytest.raises(EndOfSourceError, match="ended unexpectedly"):
        list(iter(lambda: source.take(0.2), None))
    source.close()
    source.close()


def test_the_process_of_the_diagnosis_ends_with_the_loop():
    source = Laboratory("ball", probe="ideal")
    source.open()
    pid = source._process.pid
    source.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.slow
def test_samples_that_the_loop_misses_come_later():
    source = Laboratory("ball", probe="ideal", sample_time=1e-4)
    source.open()
    time.sleep(3.0)  # more than the connection holds
    # Once its clock is reset, the laboratory is 0.2 s ahead again: the next sample is due then.
    times = [source.take(1.0).time for _ in range(30_000)]
    assert np.diff(times) == pytest.approx(1e-4)
    source.close()


def test_without_mujoco_an_ideal_probe_is_taken_and_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    bench, probe, words = start_bench("ball", "three-sines", "twin-pantograph", 1e-3)
    assert probe == "ideal probe"
    assert "needs MuJoCo" in words
    assert len(bench.advance(10)) == 10
