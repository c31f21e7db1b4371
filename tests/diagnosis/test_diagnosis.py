"""Each fault is named by its check, and a clean recording by none."""

import dataclasses

import faults
import numpy as np
import pytest
from faults import FORCE, LAW, SPRING, STEP, TIME, V, X, contact, recorded

import palpate
from benchmarks.bank import material_faults, sensor_faults
from palpate import lab
from palpate.findings import MAY_CAP, NextStep, worst
from palpate.identification.diagnosis import Data
from palpate.identification.diagnosis.causes import NUISANCES
from palpate.identification.diagnosis.delay import _earlier_samples, find_delay
from palpate.identification.diagnosis.fit import Fit, FitInput
from palpate.identification.diagnosis.recording import CHECKS, SOME
from palpate.input.preparation.held import hold_length
from palpate.input.preparation.preparing import join_contacts
from palpate.input.preparation.velocity import find_spikes
from palpate.input.recordings.units import unit_size
from palpate.method.estimators.least_squares import mean_error, robust_covariance


def grave(contact: palpate.Contact, method: str | None = None) -> list[str]:
    """The checks that found more than a note, the gravest first."""
    findings = palpate.diagnose(contact, method).findings
    return [finding.check for finding in findings if finding.severity != "note"]


def named(contact: palpate.Contact, method: str | None = "variable-projection") -> list[str]:
    """The checks that found anything, by one law unless another method is asked for."""
    return [finding.check for finding in palpate.diagnose(contact, method).findings]


def test_a_clean_recording_is_trusted():
    found = palpate.diagnose(faults.clean())
    assert found.verdict == palpate.Verdict("trust", "trust", "trust")
    assert {finding.severity for finding in found.findings} == {"note"}
    there = found.working_depth
    assert there.stiffness.value == pytest.approx(faults.LAW.stiffness_at(there.depth), rel=5e-3)
    assert there.damping.value == pytest.approx(faults.LAW.damping_at(there.depth), rel=5e-2)
    # What priors leave of errors that 6 s of three sines nearly exclude.
    assert there.stiffness.systematic < 1.5 * there.stiffness.standard_error
    assert there.damping.systematic < 2e-3 * there.damping.value
    assert 0.0 < there.stiffness.standard_error < 5e-3 * there.stiffness.value


NOISY, DEPTH = faults.noisy(FORCE), np.maximum(X, 0.0)
CAUSES = {
    "slow change": faults.damaged(material_faults.softening, 0.1),
    "offset drift": recorded(FORCE + 2.0 * TIME / TIME[-1]),
    "memory": faults.remembering(0.3, 0.2),
    "friction": faults.damaged(material_faults.friction, 0.04),
    # In proportion to the slope of the spring.
    "damping form": recorded(SPRING + 9e-3 * LAW.B * DEPTH ** (LAW.n - 1.0) * V),
    "shape": recorded(6.0 * np.sinh(DEPTH / 5e-3) * (1.0 + V)),  # no power of depth
    "square speed": faults.damaged(material_faults.square_of_speed, 0.04),
    "inertia": faults.damaged(sensor_faults.mass_beyond_sensor, 0.4),
    "delay": faults.late(5e-3),
    "surface": faults.surface_off(-0.8e-3),
    "change": faults.changed(0.2),
    "saturation": faults.damaged(sensor_faults.saturation, 0.8, sampled=True),
    "stuck force": contact(TIME, X, np.where(np.abs(TIME - 3.25) < 0.25, NOISY[3000], NOISY)),
}


@pytest.mark.parametrize("name", CAUSES)
def test_a_cause_is_found_by_its_check_and_is_in_the_bars(name):
    diagnosis = palpate.diagnose(CAUSES[name], "variable-projection")
    [found] = [each for each in diagnosis.findings if each.check == name]
    assert (found.severity == "note") == (name not in MAY_CAP)
    # B′ is that at the motion's own speed, so a square of the speed is no error of it.
    if found.severity == "note" and name != "square speed":
        there = diagnosis.working_depth
        # Of a cause without a prior half, since another may be the true one.
        part = 0.0099 if name in NUISANCES else 0.0049
        for quantity, percent in (
            (there.stiffness, found.moves_stiffness_percent),
            (there.damping, found.moves_damping_percent),
        ):
            assert quantity.systematic >= part * abs(percent * quantity.value)


@pytest.mark.parametrize("name", ["memory", "damping form"])
def test_a_law_that_is_selected_has_what_another_lacks(name):
    """Its damping might be a lag, unless the clocks are known."""
    diagnosis = palpate.diagnose(CAUSES[name])
    assert not any(each.check == name and each.z > 0.0 for each in diagnosis.findings)
    assert diagnosis.verdict == palpate.Verdict("trust", "with-care", "with-care")
    assert diagnosis.remedy.step is NextStep.IN_STEP
    known = dataclasses.replace(CAUSES[name], delay=palpate.method.contact.Delay(0.0, 1e-4))
    assert palpate.diagnose(known).verdict.overall == "trust"


def touches(force_of):
    """Touches at 1 Hz through the surface to 8 mm, of a force by time, penetration and velocity."""
    x = np.where(TIME < 0.5, -3e-3, 2.5e-3 - 5.5e-3 * np.cos(2.0 * np.pi * (TIME - 0.5)))
    v = np.gradient(x, TIME)
    return contact(TIME, x, faults.noisy(force_of(x, v)))


def neck(x, v):
    """Until 0.5 mm above the surface the material holds a probe that withdraws, less when deep."""
    return np.where((v < 0.0) & (x > -0.5e-3), 0.5 * np.exp(-np.maximum(x, 0.0) / 2e-3), 0.0)


def adhesive(x, v):
    """Force of Johnson, Kendall and Roberts's form, −√x, in both directions."""
    return 20.0 * np.sqrt(np.maximum(x, 0.0))


@pytest.mark.parametrize("pull", [neck, adhesive])
def test_a_material_that_pulls_is_called_adhesive_and_not_relaxing(pull):
    found = palpate.diagnose(touches(lambda x, v: faults.pushed(x, v) - pull(x, v)))
    [adhesion] = [finding for finding in found.findings if finding.check == "adhesion"]
    assert adhesion.message.startswith("adhesion: near the surface the material pulls the probe")
    assert "--min-penetration" in adhesion.remedy
    assert adhesion.stiffness == adhesion.damping == "with-care"
    assert not any("relax" in finding.message for finding in found.findings)
    stiffness, truth = found.working_depth.stiffness, LAW.stiffness_at(found.working_depth.depth)
    depth = found.working_depth.depth
    truth -= (pull(depth + 1e-6, 1.0) - pull(depth - 1e-6, 1.0)) / 2e-6
    assert abs(stiffness.value - truth) < 2.0 * stiffness.whole_error


def test_friction_or_a_pull_in_air_is_not_adhesion():
    rubbed = touches(lambda x, v: faults.pushed(x, v) + 0.3 * np.tanh(1e3 * v))
    tied = touches(lambda x, v: faults.pushed(x, v) - 40.0 * x)
    light = touches(lambda x, v: faults.pushed(x, v))
    for found in map(palpate.diagnose, (rubbed, tied, light)):
        assert "adhesion" not in [finding.check for finding in found.findings]


RANDOM, COARSE = np.random.default_rng(5), 0.1 * FORCE.max()
# Stamped on arrival: late by up to nine tenths of a step.
STAMPS = np.maximum.accumulate(TIME + 0.9 * STEP * np.random.default_rng(3).random(TIME.size))
# A force that comes at a lower rate, and is held; of a contact that palpate did not prepare.
HELD = dataclasses.replace(contact(TIME, X, NOISY), force=np.repeat(NOISY[::8], 8)[: X.size])
INPUTS = {
    "penetration unit": faults.scaled(penetration=1e3),
    "force unit": faults.scaled(force=1e3),
    "time unit": faults.scaled(time=1e3),
    "signs": faults.scaled(force=-1.0),
    "velocity column": recorded(FORCE, velocity=-V),
    "time stamps": contact(STAMPS + 1e-9 * np.arange(TIME.size), X, NOISY),
    "held channel": HELD,
    "spikes": contact(TIME, X, NOISY + 10.0 * (RANDOM.random(TIME.size) < 0.01)),
    "coarse steps": contact(TIME, X, COARSE * np.round(FORCE / COARSE)),
}


def test_a_damping_of_uncertain_sign_is_not_trusted():
    time, x, v = faults.motion()
    force = faults.noisy(faults.pushed(x, v, palpate.HuntCrossley(K=9000.0, B=-4000.0, n=1.4)))
    negative = palpate.diagnose(faults.contact(time, x, force))
    assert negative.reason.startswith("the damping is negative")
    late = [palpate.diagnose(faults.late(seconds)) for seconds in (6e-3, 8e-3, 12e-3)]
    for found in (negative, *late):
        assert found.verdict == palpate.Verdict("trust", "do-not-trust", "do-not-trust")
    for found in late:
        assert found.reason.startswith("the sign of the damping is open: ")
        assert ", since the force is " in found.reason  # with the cause that opens it


@pytest.mark.parametrize("noise", [0.03, 0.3, 1.0])
def test_an_open_sign_of_damping_marks_the_damping_alone(noise):
    """Seeds 0 and 1, of either sign; the force reaches 14 N."""
    time, x, v = faults.motion()
    force = faults.pushed(x, v, palpate.HuntCrossley(K=9000.0, B=0.0, n=1.4))
    for seed in (0, 1):
        noises = noise * np.random.default_rng(seed).standard_normal(x.size)
        found = palpate.diagnose(faults.contact(time, x, force + noises))
        damping = found.working_depth.damping
        assert abs(damping.value) < 4.0 * damping.standard_error
        assert (found.verdict.stiffness, found.verdict.damping) == ("trust", "do-not-trust")


@pytest.mark.parametrize("name", INPUTS)
def test_only_its_own_check_finds_a_fault_of_the_data(name):
    found = [finding.check for finding in Data(INPUTS[name]).findings]
    others = ["velocity column"] if name == "time unit" else []
    assert [check for check in found if check not in others] == [name]
    assert len(INPUTS) == len(CHECKS)


# A force that is reversed throughout is refused: tests/cli/test_diagnose_command.py.
@pytest.mark.parametrize("name", sorted(MAY_CAP & {*INPUTS, *CAUSES} - {"signs", "time stamps"}))
def test_faults_that_no_error_bar_covers_cap_the_marks(name):
    diagnosis = palpate.diagnose({**INPUTS, **CAUSES}[name])
    verdict = diagnosis.verdict
    found = next(each for each in diagnosis.findings if each.check == name)
    assert found.damping != "trust"
    for quantity in ("stiffness", "damping"):
        mark = getattr(verdict, quantity)
        assert mark == worst(mark, getattr(found, quantity))


def test_friction_that_jumps_as_the_probe_turns_is_not_called_spikes():
    time, x, v = faults.motion()
    unsteady = v + 2e-3 * np.random.default_rng(5).standard_normal(v.size)
    rubbed = 0.2 * faults.pushed(x, np.zeros_like(x)) * np.sign(unsteady)
    contact = faults.contact(time, x, faults.noisy(faults.pushed(x, v) + rubbed))
    assert named(contact)[0] in ("precision", "friction", "misfit")
    assert "spikes" not in named(contact)
    assert np.mean(find_spikes(contact.force)) > SOME  # as jumps they are spikes


def test_each_sign_has_its_own_remedy():
    force, depth = faults.scaled(force=-1.0), faults.scaled(penetration=-1.0)
    remedies = [Data(contact).findings[0].remedy for contact in (force, depth)]
    assert remedies == [f"run again with --flip-{each}" for each in ("force", "penetration")]


def test_a_delay_is_measured_and_moves_the_damping():
    [finding] = [f for f in palpate.diagnose(CAUSES["delay"]).findings if f.check == "delay"]
    assert float(finding.message.split()[3]) == pytest.approx(5.0, abs=0.5)
    assert "--delay find" in finding.remedy
    assert finding.moves_damping_percent > 10.0
    assert "cannot tell which" in finding.message


def test_a_small_error_of_the_velocity_biases_the_damping_alike():
    found = palpate.diagnose(faults.with_velocity(1.2))
    [finding] = [f for f in found.findings if f.check == "velocity column"]
    wrong = found.working_depth.damping.value / faults.LAW.damping_at(found.working_depth.depth)
    # It is measured over 15 samples, with a micrometre of noise: to half a per cent.
    assert finding.moves_damping_percent == pytest.approx(20.0, abs=0.5)
    assert wrong == pytest.approx(1.0 / 1.2, abs=0.02)
    assert (found.verdict.stiffness, found.verdict.damping) == ("trust", "with-care")
    assert palpate.diagnose(faults.with_velocity(1.04)).verdict.damping == "trust"


def test_the_bias_by_noise_of_the_velocity_is_reported():
    found = palpate.diagnose(faults.with_velocity(noise=0.3), "variable-projection")
    [finding] = [f for f in found.findings if f.check == "velocity noise"]
    there = found.working_depth
    wrong = 1.0 - there.damping.value / faults.LAW.damping_at(there.depth)
    # Noise of 0.3 rms is 8 % of ⟨v² + σ²⟩; in contact, by the weight of each depth, within 3 %.
    assert 0.01 * finding.moves_damping_percent == pytest.approx(wrong, abs=0.03)
    assert there.damping.systematic > 0.0
    assert grave(faults.with_velocity(noise=0.1)) == []


def test_coarse_steps_and_held_values_are_checked_first():
    coarse, fine = (
        named(palpate.prepare(time=TIME, penetration=step * np.round(X / step), force=NOISY))
        for step in (2e-4, 2e-5)
    )
    assert "coarse steps" in coarse
    assert "coarse steps" not in fine
    found = grave(HELD)
    assert "held channel" in found
    assert "stuck force" not in found


@pytest.mark.parametrize("beat", [2, 3.3, 6.25, 12.5, 20])
@pytest.mark.parametrize("channel", ["force", "penetration"])
def test_a_held_channel_is_read_where_it_changes(beat, channel):
    """As of a load cell of 80 Hz in a log of 500 Hz: 6.25 samples."""
    last = np.floor(np.floor(np.arange(TIME.size) / beat) * beat).astype(int)
    force, x = NOISY, X
    if channel == "force":
        force = NOISY[last]
    else:
        x = X[last]
    found = palpate.diagnose(palpate.prepare(time=TIME, penetration=x, force=force))
    [held] = [finding for finding in found.findings if finding.check == "held channel"]
    name = "position" if channel == "penetration" else channel
    assert held.message == (
        f"the {name} changes only every {beat:.0f} samples (sample and hold): palpate uses the "
        "samples at which it changes"
    )
    assert found.verdict.overall == "trust"
    there = found.working_depth
    for quantity, true in (
        (there.stiffness, faults.LAW.stiffness_at(there.depth)),
        (there.damping, faults.LAW.damping_at(there.depth)),
    ):
        assert abs(quantity.value - true) < 3.0 * quantity.whole_error


@pytest.mark.parametrize("turning", [False, True])
def test_held_poses_and_wrenches_are_read_where_they_change(turning):
    """Of a load cell of 80 Hz on a robot of 500 Hz; in a tool that turns too."""
    time = TIME[::2]
    late = np.ceil(np.floor(np.arange(time.size) / 6.25 + 1e-9) * 6.25 - 1e-9).astype(int)
    half, zero = 0.05 * np.sin(0.7 * time) * turning, np.zeros_like(time)  # half the angle about x
    held = (NOISY[::2] * np.stack([zero, np.sin(2 * half), np.cos(2 * half)]))[:, late]
    names = ("ee_x", "ee_y", "ee_z", "f_x", "f_y", "f_z", "qx", "qy", "qz", "qw")
    values = (0.4 + zero, zero, 0.3 - X[::2], *held, np.sin(half), zero, zero)
    channels = dict(zip(names, (*values, np.cos(half)), strict=True))
    frame = "tool" if turning else "base"
    contact = palpate.prepare(palpate.Recording({"time_s": time, **channels}), force_frame=frame)
    found = palpate.diagnose(contact)
    assert [f.severity for f in found.findings if f.check == "held channel"] == ["note"]
    assert len(contact) == pytest.approx(time.size / 6.25, abs=2.0)
    there = found.working_depth
    assert there.stiffness.value == pytest.approx(LAW.stiffness_at(there.depth), rel=0.01)
    damping = there.damping
    assert abs(damping.value - LAW.damping_at(there.depth)) < 2.0 * damping.whole_error


def test_too_few_changes_of_a_held_channel_stay_a_matter_of_care():
    part = slice(1000, 2000)
    force = np.repeat(NOISY[::20], 20)[: X.size]
    found = palpate.diagnose(
        palpate.prepare(time=TIME[part], penetration=X[part], force=force[part])
    )
    [held] = [finding for finding in found.findings if finding.check == "held channel"]
    assert held.severity == "with-care"
    assert "ms late on average" in held.message


def test_steps_of_a_noisy_or_of_a_ramped_channel_are_not_held():
    random = np.random.default_rng(2)
    for noise in (0.0, 0.3, 1.0):
        assert (
            hold_length(np.round(np.linspace(0.0, 300.0, 2000) + noise * random.normal(size=2000)))
            == 0
        )


@pytest.mark.parametrize("band", [0.2, 0.5, 1.0])
def test_a_dead_band_is_a_note_and_its_samples_are_left_out(band):
    found = palpate.diagnose(recorded(np.where(band > NOISY, 0.0, NOISY), noise=False))
    assert found.verdict.overall == "trust"
    [note] = [finding for finding in found.findings if finding.check == "dead band"]
    assert note.message.startswith(f"the force is zero below {band:g} N")
    there = found.working_depth
    true = faults.LAW.stiffness_at(there.depth)
    assert abs(there.stiffness.value - true) < 3.0 * there.stiffness.whole_error


def test_a_sensor_that_is_lost_in_contact_has_no_dead_band():
    force = np.where(NOISY < 0.2, 0.0, NOISY)
    force[3000:3400] = 0.0
    found = palpate.diagnose(recorded(force, noise=False))
    assert "dead band" not in [finding.check for finding in found.findings]
    assert found.verdict.overall == "do-not-trust"
    assert "stuck force" in [finding.check for finding in found.findings]


@pytest.mark.parametrize("at", [2.0, 3.0, 4.4])
def test_a_sensor_that_is_zeroed_in_contact_is_not_called_late(at):
    found = palpate.diagnose(faults.zeroed(at))
    assert found.reason.startswith("the force jumps by -")
    assert f"at {at - 1e-3:g} s while the probe presses" in found.reason
    assert found.verdict.overall != "trust"


def test_a_small_jump_marks_only_what_it_changes():
    found = palpate.diagnose(recorded(np.where(TIME < 3.0, FORCE, FORCE + 0.06 * FORCE.max())))
    jump = next(finding for finding in found.findings if finding.check == "force jump")
    there = found.working_depth
    assert abs(there.stiffness.value / LAW.stiffness_at(there.depth) - 1.0) < 0.05
    assert jump.stiffness == "trust"
    assert jump.moves_stiffness_percent == pytest.approx(3.2, abs=0.5)


def test_jitter_of_the_time_stamps_is_not_taken_for_jerk():
    """Stamps that are 3 samples late on average, seed 5; the damping is 2 to 5 % off."""
    late = 3.0 * STEP * np.random.default_rng(5).exponential(size=TIME.size)
    stamps = np.sort(TIME + late) + 1e-9 * np.arange(TIME.size)
    there = palpate.diagnose(contact(stamps, X, NOISY)).working_depth
    truth = LAW.damping_at(there.depth)
    assert abs(there.damping.value / truth - 1.0) < 2.0 * there.damping.whole_error / truth < 0.3


STATED = [
    ({"penetration": "nm", "force": "uN"}, 128e-9, 3e-4),
    ({"penetration": "mm", "force": "kN"}, 5e-3, 2e4),
]


def pressed(units, depth: float, force: float, **named) -> palpate.Recording:
    """A hard material, or a large one, in the units of a recording's header; SI without any."""
    size = {name: unit_size(name, unit) for name, unit in units.items()}
    x = X * depth / X.max()
    f = np.where(x > 0.0, force * np.maximum(x / depth, 0.0) ** 1.5, 0.0)
    f = f + 1e-3 * force * np.random.default_rng(1).standard_normal(x.size)
    channels = {
        "time_s": TIME,
        f"depth_{units.get('penetration', 'm')}": x / size.get("penetration", 1.0),
        f"load_{units.get('force', 'N')}": f / size.get("force", 1.0),
    }
    return palpate.Recording(channels)


@pytest.mark.parametrize("units, depth, force", STATED)
def test_a_stated_unit_is_not_guessed(units, depth, force):
    """By the header where palpate converts it, or by an option; of files, arrays and several."""
    assert palpate.diagnose(pressed(units, depth, force)).verdict.stiffness == "trust"
    bare = pressed({}, depth, force)
    [guess] = [f for f in Data(palpate.prepare(bare)).findings if f.check == "force unit"]
    assert guess.severity == "do-not-trust"
    assert guess.remedy == "run again with --unit force=mN, or with --unit force=N if it is right"
    told = palpate.prepare(bare, units={"force": "N"})
    assert told.stated_units == {"force"}
    assert Data(told).findings == ()
    assert Data(join_contacts([told, told])).findings == ()
    assert "force unit" in [
        f.check for f in Data(join_contacts([told, palpate.prepare(bare)])).findings
    ]
    arrays = dict(zip(("time", "penetration", "force"), bare.channels.values(), strict=True))
    assert [f.check for f in Data(palpate.prepare(**arrays)).findings] == ["force unit"]
    assert Data(palpate.prepare(**arrays, units={"force": "N"})).findings == ()


def written(folder, header: str, depth: float, force: float, step: float = 1e-3):
    """A touch of this depth and force as a text, with a header of one line or two."""
    f = force * np.maximum(X / X.max(), 0.0) ** 1.5
    f += 1e-3 * force * np.random.default_rng(1).standard_normal(X.size)
    rows = np.column_stack([step / 1e-3 * TIME, X * depth / X.max(), f])
    path = folder / "touch.csv"
    np.savetxt(path, rows, fmt="%.8g", delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize(
    "header, trusted",
    [
        ("Time,Travel,Load\ns,m,N", True),
        ("time [s],depth (m),load (N)", True),
        ('"t/s","Weg in m","F/N"', True),
        ("time_s,depth_m,load_N", False),
    ],
)
def test_a_stated_si_unit_is_trusted_and_a_suffix_is_not(tmp_path, header, trusted):
    found = palpate.diagnose(written(tmp_path, header, 7e-3, 2e4, step=0.5))
    assert (found.verdict.stiffness == "trust") is trusted
    units = {each.check for each in found.findings if str(each.check).endswith(" unit")}
    assert units == (set() if trusted else {"force unit", "time unit"})


def test_without_units_nothing_is_trusted_until_both_are_given(tmp_path):
    path = written(tmp_path, "time_s,depth,load", 4.0, 250.0)
    for units in ({}, {"penetration": "mm"}, {"force": "gf"}):
        found = palpate.diagnose(palpate.prepare(path, units=units))
        assert found.verdict.stiffness == "do-not-trust"
        assert found.remedy.endswith("such as --unit penetration=mm,force=gf")
    both = palpate.prepare(path, units={"penetration": "mm", "force": "gf"})
    assert palpate.diagnose(both).verdict.stiffness == "trust"
    named = written(tmp_path, "time_s,depth,load (gf)", 4.0, 250.0)
    assert "both" not in palpate.diagnose(named).remedy


def test_the_unit_of_one_channel_does_not_answer_for_another():
    x = pressed({}, 5.0, 20.0)  # millimetres in a column of metres
    told = palpate.prepare(x, units={"force": "N"})
    assert [f.check for f in Data(told).findings] == ["penetration unit"]


@pytest.mark.parametrize("fault", ["penetration", "force"])
def test_wrong_units_under_an_si_name_are_not_trusted(fault):
    names = {"time_s": TIME, "penetration_m": X, "force_N": NOISY}
    column = {"penetration": "penetration_m", "force": "force_N"}[fault]
    found = palpate.diagnose(palpate.Recording({**names, column: 1e3 * names[column]}))
    assert found.verdict.overall == "do-not-trust"
    assert found.findings[0].check == f"{fault} unit"


def test_a_low_rate_leaves_only_the_damping_open():
    [slow] = [f for f in Data(faults.scaled(time=1e3)).findings if f.check == "time unit"]
    assert (slow.stiffness, slow.damping) == ("trust", "do-not-trust")
    assert slow.remedy == "run again with --unit time=ms, or with --unit time=s if it is right"
    both = Data(faults.scaled(time=1e3, force=1e3)).findings
    assert {f.check: f.severity for f in both}["time unit"] == "do-not-trust"


def test_a_force_that_is_late_may_be_against_a_commanded_position():
    found = palpate.diagnose(faults.late(8e-3))
    assert "late, or the position is commanded, or the damping" in found.reason
    assert "commanded" not in palpate.diagnose(faults.late(-8e-3)).reason


def test_a_change_gives_its_time_and_a_law_for_each_stretch():
    first, second = palpate.diagnose(faults.changed(0.2)).episodes
    assert first.stop == second.start == pytest.approx(3.5, abs=0.05)
    before, after = (each.working_depth.stiffness.value for each in (first, second))
    assert after / before == pytest.approx(1.2, abs=0.01)
    # Two borders around it, a block apart, would leave episodes that are too short to tell.
    time, x, v = faults.motion(4.6)
    force = faults.noisy(np.where(time > 2.77, 1.2, 1.0) * faults.pushed(x, v))
    _, second = palpate.diagnose(faults.contact(time, x, force)).episodes
    assert second.start == pytest.approx(2.77, abs=0.05)


def test_a_wrong_surface_moves_the_parameters_and_not_the_working_depth():
    [finding] = [f for f in palpate.diagnose(CAUSES["surface"]).findings if f.check == "surface"]
    assert "0.793 mm" in finding.message
    assert abs(finding.moves_stiffness_percent) < 2.0
    assert finding.remedy == "run again with --surface estimate"


def test_a_wrong_surface_is_found_where_it_hardly_shows_in_the_residual():
    time, x, v = faults.motion()
    force = faults.pushed(x, v, palpate.HuntCrossley(K=1000.0, B=20.0, n=1.0))
    force = force + 0.2 * np.random.default_rng(0).standard_normal(force.size)
    found = palpate.diagnose(faults.contact(time, x + 0.35e-3, force))
    assert "surface" in [finding.check for finding in found.findings if finding.z > 8.0]
    stiffness = found.working_depth.stiffness
    truth = 1000.0
    assert abs(stiffness.value - truth) < 2.0 * stiffness.whole_error


def test_another_form_of_damper_is_named_before_the_surface():
    """On the robot, whose surface is significant then too."""
    run = lab.Bench(lab.MATERIALS["sponge"], lab.THREE_SINES).run(500)
    truth, law = run.truth, lab.MATERIALS["sponge"].law
    depth = float(np.median(truth.penetration[truth.penetration > 0.0]))
    spring = law.force(depth, 0.0) / depth * np.maximum(truth.penetration, 0.0)
    force = spring + law.damping_at(depth) * truth.velocity * (truth.penetration > 0.0)
    force = lab.Sensors().force(force, np.random.default_rng(0))
    force -= force[truth.time < lab.THREE_SINES.pause].mean()
    own = palpate.prepare(time=truth.time, penetration=run.contact.penetration, force=force)
    found = [check for check in named(own) if check in ("damping form", "surface")]
    assert found == ["damping form", "surface"]


def test_a_surface_is_not_sought_below_the_steps_of_the_penetration():
    contact = faults.surface_off(0.05e-3)
    coarse = 5e-5 * np.round(contact.penetration / 5e-5)
    coarse = palpate.prepare(time=contact.time, penetration=coarse, force=contact.force)
    checks = [{f.check for f in palpate.diagnose(each).findings} for each in (contact, coarse)]
    assert ["surface" in each for each in checks] == [True, False]


def test_without_free_air_the_surface_is_said_to_be_unknown():
    found = palpate.diagnose(faults.clean(free=False))
    assert found.verdict.overall == "trust"
    [note] = [finding for finding in found.findings if finding.check == "surface"]
    assert note.severity == "note"


def test_an_offset_that_free_air_contradicts_is_found():
    time, x, v = faults.motion()
    force = faults.pushed(x, v) + np.where(x > 0.0, 2.0, 0.0)
    assert set(named(faults.contact(time, x, faults.noisy(force)))) & {"offset", "surface"}


def test_a_linear_law_is_trusted_on_its_own_material_only():
    for method in ("kelvin-voigt", "extended-kelvin-voigt"):
        assert palpate.diagnose(faults.clean(), method).verdict.overall != "trust"
    time, x, v = faults.motion()
    force = np.where(x > 0.0, 1500.0 * x + 15.0 * v, 0.0)
    inside = slice(1500, None)  # where the touch is past
    contact = faults.contact(time[inside], x[inside], faults.noisy(force)[inside])
    verdict = palpate.diagnose(contact, "kelvin-voigt").verdict
    assert (verdict.stiffness, verdict.damping) == ("trust", "with-care")  # a lag looks the same


def test_a_method_far_from_its_least_squares_is_reported():
    result = palpate.identify(faults.clean())
    worse = dataclasses.replace(result.law, K=1.5 * result.law.K)
    estimate = palpate.Estimate.from_law(
        worse, result.estimate.covariance, status=result.estimate.status, samples=1000
    )
    given = FitInput(result.data, result.trace, estimate)
    found = palpate.identification.diagnosis.diagnose_parts(given)
    assert found.verdict.stiffness == "do-not-trust"
    assert "method" in [finding.check for finding in found.findings]


def test_an_uninformative_motion_or_short_contact_is_not_trusted():
    time = np.arange(0.0, 2.0, 1e-3)
    force = faults.noisy(np.full(time.size, 5.0))
    contact = palpate.prepare(time=time, penetration=np.full(time.size, 5e-3), force=force)
    found = palpate.diagnose(contact)
    assert found.verdict.overall == "do-not-trust"
    assert found.findings[0].check == "excitation"
    assert grave(faults.clean().window(2.0, 2.02)) == ["excitation"]


def test_the_data_are_checked_once_for_all_methods_and_diagnosed_once():
    results = palpate.compare(faults.clean()).values()
    assert len({id(result.data) for result in results}) == 1
    assert all(result.diagnosis is result.diagnosis for result in results)


def test_error_bars_grow_with_the_residuals_correlation():
    random = np.random.default_rng(0)
    x = np.column_stack([np.ones(4000), np.linspace(-1.0, 1.0, 4000)])
    white = random.standard_normal((100, 4000))
    slow = np.repeat(random.standard_normal(80), 50)
    even = np.median([np.sqrt(np.diag(robust_covariance(x, each))) for each in white], axis=0)
    assert even == pytest.approx([1 / 4000**0.5, (3 / 4000) ** 0.5], rel=0.25)
    assert np.all(np.sqrt(np.diag(robust_covariance(x, slow))) > 4.0 * even)
    assert mean_error(slow) > 4.0 * np.median([mean_error(each) for each in white])


@pytest.mark.parametrize("rows", [28, 600])
def test_error_bars_of_overlapping_windows_are_those_of_their_samples(rows):
    """Windows that share two thirds scatter √3 times as far as as many that share nothing."""
    random, slopes, errors, unaware = np.random.default_rng(2), [], [], []
    x = np.sin(np.arange(rows) / 30.0)[:, None]
    shared = [np.full(rows - lag, 1.0 - lag / 3.0) for lag in (1, 2)]
    for _ in range(200):
        noise = np.convolve(random.standard_normal(rows + 2), np.ones(3) / 3.0, "valid")
        slopes.append(float(x[:, 0] @ noise / (x**2).sum()))
        residual = noise - slopes[-1] * x[:, 0]
        errors.append(robust_covariance(x, residual, shared)[0, 0])
        unaware.append(robust_covariance(x, residual)[0, 0])
    assert np.mean(np.square(slopes)) == pytest.approx(np.median(errors), rel=0.25)
    assert rows > 28 or np.median(errors) > 2.0 * np.median(unaware)  # no levels tell of it yet


def test_a_delay_is_sought_within_each_segment():
    """Taps one after another, whose segments begin where no other ends."""
    time, x, v = faults.motion(12.0)
    force = faults.noisy(np.interp(time - 5e-3, time, faults.pushed(x, v)))
    order = np.random.default_rng(3).permutation(10)
    kept = np.concatenate([np.arange(1500 + 1000 * k, 1900 + 1000 * k) for k in order])
    moved = {"penetration": x[kept], "velocity": v[kept], "force": force[kept]}
    result = palpate.identify(palpate.Contact(time[kept], **moved, segment=np.repeat(order, 400)))
    fit = Fit(FitInput(result.data, result.trace, result.estimate))
    here, *others = (
        fit.data.segment[_earlier_samples(fit, fit.windows, shift)] for shift in (0, 20, -20)
    )
    assert all(np.all(other == here) for other in others)
    [found] = find_delay(fit)
    assert float(found.sentence.split()[3]) == pytest.approx(5.0, abs=0.6)
