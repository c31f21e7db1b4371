"""From a robot's poses and wrenches to a contact; an answer that is off is not trusted."""

import math
from dataclasses import replace

import numpy as np
import pytest
from probing import BALL, NOISE, PVC, SPONGE, Motion, tapping, three_sines
from robots import BIAS, NORMAL, ORIGIN, hand, table_of, topics_of, travelling

import palpate
from palpate import (
    FlatPunch,
    FlatSpectrum,
    GeneralisedHuntCrossley,
    HuntCrossley,
    Recording,
    RecordingError,
    identify,
    prepare,
)
from palpate.digits import with_error
from palpate.input.channels.frames import rotate_to_base
from palpate.input.preparation.normal import normal_from_forces, parse_normal
from palpate.input.preparation.orientation import largest_turn
from palpate.input.preparation.surface import find_surface
from palpate.input.preparation.touch import never_touches


def turn(axis, angle) -> np.ndarray:
    """Quaternion x, y, z, w."""
    return np.array([*(math.sin(angle / 2) * np.asarray(axis)), math.cos(angle / 2)])


def with_turns(felt, turns, **more) -> Recording:
    """With the orientation of the tool."""
    return table_of(felt, **{f"q{axis}": turns[:, k] for k, axis in enumerate("xyzw")}, **more)


BACK = np.array([-1, -1, -1, 1])


def off(result, law: HuntCrossley) -> float:
    """How far force, stiffness and damping at working depth are off, in total standard errors."""
    there = result.diagnosis.working_depth
    truth = law.force(there.depth, 0.0), law.stiffness_at(there.depth), law.damping_at(there.depth)
    found = there.force, there.stiffness, there.damping
    return max(
        abs(each.value - true) / math.hypot(each.standard_error, each.systematic)
        for each, true in zip(found, truth, strict=True)
    )


@pytest.mark.parametrize("law", [BALL, PVC, SPONGE], ids=["ball", "pvc", "sponge"])
@pytest.mark.parametrize("made", [table_of, topics_of], ids=["one clock", "two clocks"])
def test_a_tapping_robot_is_identified_without_an_option(law, made):
    contact = prepare(made(hand(6.0, law)))
    found = contact.prepared
    assert found.normal.vector == pytest.approx(NORMAL, abs=2e-3)
    # A thousand free samples and more: BIAS to 5 standard errors of their mean.
    assert found.zero == pytest.approx(BIAS, abs=5 * NOISE / math.sqrt(1000))
    assert -found.surface.position == pytest.approx(float(ORIGIN @ NORMAL), abs=0.5e-3)
    result = identify(contact)
    # Four standard errors: three numbers of six runs, of which one in 16 000 is beyond by chance.
    assert off(result, law) < 4.0
    assert result.diagnosis.verdict.overall != "do-not-trust"


def test_a_force_that_is_the_probes_is_turned_and_said():
    mirrored = hand(6.0, BALL)
    recorded = table_of(replace(mirrored, force=-mirrored.force))
    contact = prepare(recorded)
    assert off(identify(contact), BALL) < 4.0
    assert any("palpate reversed its sign" in finding.message for finding in contact.findings)
    asked = prepare(recorded, flip=["force"])
    assert not any("palpate reversed" in finding.message for finding in asked.findings)
    np.testing.assert_allclose(asked.force, contact.force, atol=1e-9)


@pytest.mark.parametrize("given", ["0.48,-0.36,0.8", (0.96, -0.72, 1.6)])
def test_a_normal_that_is_given_is_taken(given):
    contact = prepare(table_of(hand(6.0)), normal=given)
    assert contact.prepared.normal.vector == pytest.approx(NORMAL)
    assert off(identify(contact), BALL) < 4.0
    contact = prepare(table_of(hand(6.0)), normal=-NORMAL)
    assert any(finding.severity == "do-not-trust" for finding in contact.findings)


def test_axes_are_normals_and_what_is_no_normal_is_refused():
    for name, vector in {"z": [0, 0, 1], "-x": [-1, 0, 0], "+y": [0, 1, 0]}.items():
        assert parse_normal(name).vector.tolist() == vector
    for wrong in ("w", "", "1,2", "0,0,0", "a,b,c", (1, 2), 7, "nan,0,1"):
        with pytest.raises(palpate.InvalidParameterError, match="normal must be x, y, z, -x"):
            prepare(table_of(hand(1.0)), normal=wrong)
    noise = np.random.default_rng(1).standard_normal((500, 3))
    with pytest.raises(RecordingError, match=r"--normal z"):
        normal_from_forces(noise, np.zeros((500, 3)))


def test_a_wrench_in_the_tools_frame_is_turned_by_the_orientation():
    felt = hand(6.0)
    orientation = np.tile(turn((0.0, 0.6, 0.8), 0.7), (len(felt.time), 1))
    in_tool = rotate_to_base(felt.force, orientation * BACK)
    np.testing.assert_allclose(rotate_to_base(in_tool, orientation), felt.force, atol=1e-12)
    recorded = with_turns(replace(felt, force=in_tool), orientation)
    contact = prepare(recorded, force_frame="tool")
    assert contact.prepared.normal.vector == pytest.approx(NORMAL, abs=2e-3)
    assert off(identify(contact), BALL) < 4.0
    found = prepare(recorded)  # in contact the force points along the motion
    assert found.prepared.normal.vector == pytest.approx(NORMAL, abs=2e-3)
    assert any("--force-frame base" in (finding.remedy or "") for finding in found.findings)


def test_frames_that_the_recording_names_decide():
    recorded = topics_of(hand(2.0))
    for frame, severity in (("base_link", None), ("ft_sensor", "with-care")):
        recorded.frames.update({"/ft.wrench.force.x": frame, "/pose.pose.position.x": "base_link"})
        found = [r.severity for r in prepare(recorded).findings if r.check == "force frame"]
        assert found == ([] if severity is None else [severity])


def test_an_orientation_that_changes_calls_for_the_tools_weight():
    felt = hand(3.0)
    turns = np.array([turn((1.0, 0.0, 0.0), each) for each in np.linspace(0.0, 0.5, 3000)])
    assert largest_turn(turns) == pytest.approx(0.25, abs=0.01)
    recorded = with_turns(felt, turns)
    found = [r for r in prepare(recorded).findings if r.check == "orientation"]
    assert found[0].severity == "with-care"
    assert marks(prepare(recorded)) == {"with-care"}
    weighed = prepare(recorded, tool_weight=1.2, force_frame="tool").findings
    assert not [r for r in weighed if r.check == "orientation"]


def turning(reach: float, *, weight: float = 3.0) -> Recording:
    """A sensor with an offset, on a tool of a weight that swings by so many radians."""
    felt = hand(8.0, bias=np.zeros(3))
    turns = np.array([turn((0.6, 0.8, 0.0), reach * math.sin(1.1 * t + 0.3)) for t in felt.time])
    force = rotate_to_base(felt.force - [0.0, 0.0, weight], turns * BACK) + BIAS
    return with_turns(replace(felt, force=force), turns)


@pytest.mark.parametrize(
    "reach, settings",
    [
        (0.5, {"force_frame": "base"}),
        (0.5, {"force_frame": "base", "tare": (0.0, 0.03)}),
        (0.001, {"force_frame": "tool"}),
    ],
)
def test_a_tools_weight_that_changes_nothing_is_refused(reach, settings):
    with pytest.raises(RecordingError, match="--tool-weight 3N has no effect: in the frame"):
        prepare(turning(reach), tool_weight=3.0, **settings)


def test_invalid_quaternions_are_refused():
    felt = hand(1.0)
    with pytest.raises(RecordingError, match="not a quaternion x, y, z, w: its norm is 2"):
        prepare(with_turns(felt, np.ones((1000, 4))), force_frame="tool")
    with pytest.raises(RecordingError, match="needs an orientation"):
        prepare(table_of(felt), force_frame="tool")


def test_a_drift_of_the_sensor_is_taken_off_and_said():
    felt = hand(8.0)
    drift = np.linspace(0.0, 0.4, len(felt.time))[:, None] * NORMAL
    contact = prepare(table_of(replace(felt, force=felt.force + drift)))
    assert contact.prepared.drift == pytest.approx(0.4, rel=0.05)
    assert any("drifts by" in finding.message for finding in contact.findings)
    assert off(identify(contact), BALL) < 4.0


def test_no_free_time_is_found_where_there_is_none():
    motion = three_sines(4.0)
    contact = prepare(table_of(hand(motion=motion)))
    assert contact.prepared.zero is None
    said = {finding.check: finding for finding in contact.findings}
    assert "found no free air" in said["no tare"].message
    assert said["surface"].severity == "with-care"
    assert "position is assumed" in said["surface"].message
    with pytest.raises(RecordingError, match="palpate found no free air"):
        prepare(table_of(hand(motion=motion)), tare="find")
    contact = prepare(table_of(hand(4.0)), tare=(0.0, 0.03))
    assert contact.prepared.zero == pytest.approx(BIAS, abs=5 * NOISE / math.sqrt(30))
    with pytest.raises(RecordingError, match="no sample between 90 s and 91 s"):
        prepare(table_of(hand(2.0)), tare=(90.0, 91.0))


@pytest.mark.parametrize("law", [BALL, PVC, SPONGE], ids=["ball", "pvc", "sponge"])
@pytest.mark.parametrize("rule", ["baseline", "threshold"])
def test_a_surface_is_found_within_its_deviation(law, rule):
    """Three deviations: the rules err by the unknown exponent, which the deviation stands for."""
    motion = tapping(6.0)
    for seed in range(3):
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(motion))
        found = find_surface(0.3 + motion.x, motion.v, law.force(motion.x, motion.v) + noise, rule)
        assert not found.assumed
        assert abs(found.position - 0.3) < 3.0 * found.deviation
        # Of strokes to 10 mm. By a threshold the soft sponge is known 2.5 mm late.
        assert found.deviation < (1.5e-3 if rule == "baseline" else 3e-3)


@pytest.mark.parametrize("rule", ["baseline", "fit"])
def test_pushes_on_a_hovering_probe_do_not_move_the_surface(rule):
    """A cable pushes by 10 % of the peak force, 20 mm above the material and 1 mm above it."""
    motion, hover = tapping(6.0), np.linspace(-1.0, 1.0, 400)
    push = 0.1 * BALL.force(motion.x, motion.v).max() * np.cos(0.5 * np.pi * hover) ** 2
    x, v, force = motion.x, motion.v, BALL.force(motion.x, motion.v)
    for height in (20e-3, 1e-3):
        x = np.concatenate([1e-3 * hover - height, x])
        v, force = np.concatenate([0.0 * hover + 1e-3, v]), np.concatenate([push, force])
    force += NOISE * np.random.default_rng(1).standard_normal(len(force))
    found = find_surface(0.3 + x, v, force, rule)
    assert abs(found.position - 0.3) < 3.0 * found.deviation < 3e-3


# That a force of the probe's is turned is tested above, of one place.
@pytest.mark.parametrize(
    "sign", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)], ids=["the material's", "the probe's"]
)
def test_a_probe_that_travels_is_cut_into_places(sign):
    """Ball, then sponge 30 mm on, with a lift between: each is identified for itself."""
    felt = travelling((BALL, tapping(4.0)), (SPONGE, tapping(4.0)))
    recorded = table_of(replace(felt, force=sign * felt.force))
    contact = prepare(recorded)
    assert len(contact.prepared.places) == 2
    assert any("2 places" in finding.message for finding in contact.findings)
    result = identify(contact).with_query(palpate.QueryOptions(tip=FlatPunch(0.1))).by_place()
    assert len(result.segments) == 2
    table = " ".join(result.summary().split())
    for part, law in zip(result.segments, (BALL, SPONGE), strict=True):
        assert off(part, law) < 4.0
        stiffness = part.diagnosis.working_depth.stiffness
        error = math.hypot(stiffness.standard_error, stiffness.systematic)
        assert with_error(stiffness.value, error) in table
    episodes = result.as_dict()["episodes"]
    assert [episode["kind"] for episode in episodes] == ["place", "place"]
    far = np.array(episodes[1]["place"]["position"]) - episodes[0]["place"]["position"]
    assert np.linalg.norm(far - (far @ NORMAL) * NORMAL) == pytest.approx(0.03, abs=2e-3)
    moduli = [episode["elastic_modulus"] for episode in episodes]
    assert [modulus["tip"]["kind"] for modulus in moduli] == ["punch", "punch"]
    assert moduli[0]["value"] > 4.0 * moduli[1]["value"]  # a ball and a sponge, both of n = 1
    assert prepare(recorded, spot=1.0).prepared.places == ()


@pytest.mark.long
def test_a_travelling_probe_is_fitted_by_the_law_of_each_place():
    """Laws that relax, each with the state in which its place began, not the place before."""
    relaxing = [
        GeneralisedHuntCrossley(K=k, n=1.2, B=0.0, p=1.2, M=k, relaxation=FlatSpectrum(0.05, 5.0))
        for k in (800.0, 400.0)
    ]
    felt = travelling(*((law, tapping(4.0)) for law in relaxing))
    result = identify(prepare(table_of(felt))).by_place()
    assert len(result.segments) == 2
    pairs = [(part.contact.force, part.fitted_force, part.trace) for part in result.segments]
    off = np.concatenate([(f - fitted)[trace.taken] for f, fitted, trace in pairs])
    force = np.concatenate([f[trace.taken] for f, _, trace in pairs])
    fit = 100.0 * math.sqrt(np.sum(off**2) / np.sum(force**2))
    assert result.fit_rmse_percent == pytest.approx(fit)
    assert result.as_dict()["fit_rmse_percent"] == pytest.approx(fit)
    assert fit < 1.5 * 100.0 * NOISE / math.sqrt(np.mean(force**2))  # the noise, and little more
    own = result.contact.force - result.fitted_force
    assert np.nanstd(own[result.trace.taken]) == pytest.approx(np.std(off), rel=0.05)


def test_a_place_without_force_uses_the_normal_of_the_others():
    firm = tapping(4.0)
    light = Motion(np.minimum(firm.x, 1.2e-3), firm.v * (firm.x < 1.2e-3))
    felt = travelling((BALL, firm), (BALL, light))
    noise = 0.3 * np.random.default_rng(3).normal(size=felt.force.shape)
    contact = prepare(table_of(replace(felt, force=felt.force + noise)))
    assert len(contact.prepared.places) == 2
    normals = [place.normal.vector for place in contact.prepared.places]
    assert normals[1] == pytest.approx(contact.prepared.normal.vector)
    assert normals[1] != pytest.approx(normals[0], abs=1e-6)


def test_a_position_along_one_axis_finds_its_sign_and_its_surface():
    motion = tapping(6.0)
    noise = NOISE * np.random.default_rng(5).standard_normal(len(motion))
    force = BALL.force(motion.x, motion.v) + noise
    for sign in (1.0, -1.0):
        channels = {"t": motion.time, "z_m": 0.412 + sign * motion.x, "Fz_N": sign * force}
        contact = prepare(Recording(channels))
        assert off(identify(contact), BALL) < 4.0
        said = [finding.message for finding in contact.findings if finding.check == "direction"]
        assert len(said) == (0 if sign > 0 else 2)


def test_the_preparation_can_be_run_again_identically():
    for recorded, more in (
        (table_of(hand(3.0)), {"delay": 2e-3, "velocity_window": 21e-3}),
        (topics_of(hand(3.0)), {"surface": "threshold", "window": (0.2, 2.5)}),
    ):
        contact = prepare(recorded, **more)
        again = contact.prepared.again()
        for name in ("time", "penetration", "velocity", "force", "segment"):
            np.testing.assert_array_equal(getattr(again, name), getattr(contact, name))
        assert again.provenance == contact.provenance
        # By their text: from Python 3.13 on a NaN makes two equal dataclasses differ.
        assert repr(again.findings) == repr(contact.findings)
        settings = contact.prepared.settings
        assert {name: getattr(settings, name) for name in more} == more


SIDE = np.cross(NORMAL, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(NORMAL, [0.0, 0.0, 1.0]))
FELT = hand(4.0)


def said(contact, step: str) -> list[str]:
    return [finding.severity for finding in contact.findings if finding.check == step]


def marks(contact) -> set[str]:
    verdict = identify(contact).diagnosis.verdict
    return {verdict.stiffness, verdict.damping, verdict.overall}


def test_a_coarse_force_is_not_called_clipped():
    contact = prepare(table_of(FELT))
    assert not said(contact, "direction")
    assert not said(contact, "saturated axis")
    coarse = replace(FELT, force=0.05 * np.round(FELT.force / 0.05))
    assert not said(prepare(table_of(coarse)), "saturated axis")


TURN = np.array([0.0, -0.6 * np.sin(0.35), -0.8 * np.sin(0.35), np.cos(0.35)])
OF_OTHER_AXES = {
    "the force's z is turned": {"force": FELT.force * [1.0, 1.0, -1.0]},
    "the force's x is turned": {"force": FELT.force * [-1.0, 1.0, 1.0]},
    "the position's z is turned": {"position": FELT.position * [1.0, 1.0, -1.0]},
    "the position's x is turned": {"position": FELT.position * [-1.0, 1.0, 1.0]},
    "axes are swapped": {"force": FELT.force[:, [1, 0, 2]]},
    "the tool's frame": {"force": rotate_to_base(FELT.force, np.tile(TURN, (len(FELT.time), 1)))},
}


@pytest.mark.parametrize("channel", OF_OTHER_AXES.values(), ids=OF_OTHER_AXES)
def test_a_channel_in_other_axes_is_not_to_be_trusted(channel):
    contact = prepare(table_of(replace(FELT, **channel)))
    assert "do-not-trust" in said(contact, "direction")
    assert marks(contact) == {"do-not-trust"}


def test_friction_across_the_motion_calls_for_care_with_both_numbers():
    pressed = BALL.force(FELT.motion.x, FELT.motion.v)
    contact = prepare(table_of(replace(FELT, force=FELT.force + np.outer(0.3 * pressed, SIDE))))
    assert said(contact, "direction") == ["with-care"]
    assert marks(contact) == {"with-care"}


def test_a_given_normal_needs_the_motion_or_the_force_along_it():
    assert "do-not-trust" in said(prepare(table_of(FELT), normal="z"), "direction")
    slid = replace(FELT, position=FELT.position + np.outer(0.3 * FELT.motion.x, SIDE))
    assert said(prepare(table_of(slid), spot=1.0), "direction") == ["with-care"]
    assert not said(prepare(table_of(slid), normal=NORMAL, spot=1.0), "direction")


def test_a_clipped_axis_is_reported_and_a_constant_one_is_not():
    clipped = FELT.force.copy()
    clipped[:, 2] = np.minimum(clipped[:, 2], 0.6 * clipped[:, 2].max())
    contact = prepare(table_of(replace(FELT, force=clipped)))
    assert said(contact, "saturated axis") == ["do-not-trust"]
    assert marks(contact) == {"do-not-trust"}
    felt = hand(4.0, normal=np.array([0.0, 0.0, 1.0]), bias=np.zeros(3))
    for value in (0.0, 1.5):
        alone = felt.force * [0.0, 0.0, 1.0] + [value, value, 0.0]
        contact = prepare(table_of(replace(felt, force=alone)))
        assert (said(contact, "saturated axis"), said(contact, "force axes")) == ([], ["note"])
        assert marks(contact) == {"trust"}


def test_a_position_that_was_commanded_calls_for_care():
    felt = table_of(FELT).channels
    renamed = {f"{n[:2]}_cmd_m" if n.startswith("p") else n: each for n, each in felt.items()}
    contact = prepare(Recording(renamed))
    assert said(contact, "channels") == ["with-care"]
    assert "looks like a commanded" in contact.findings[0].message
    assert not said(prepare(Recording({**renamed, **felt})), "channels")  # measured is there


def test_options_without_effect_are_named():
    along = Recording({"t": FELT.time, "z_m": -FELT.motion.x, "Fz_N": FELT.force @ NORMAL})
    contact = prepare(along, normal="z", tool_weight=1.0)
    assert [r.message for r in contact.findings if r.check == "options"] == [
        "--normal and --tool-weight had no effect: position and force do not both have three axes"
    ]
    assert not said(prepare(table_of(FELT), normal=NORMAL), "options")


def test_stiffness_and_parameters_are_known_no_better_than_the_surface():
    """Of pvc, F = K x²: 20 µm of the surface are many errors of a stiffness whose law is known."""
    for seed in range(1000, 1006):
        contact = prepare(table_of(hand(6.0, PVC, seed=seed)))
        result = identify(contact)
        there = result.diagnosis.working_depth
        # Three standard errors: of six runs one is beyond by chance in sixty.
        error = there.stiffness.value - PVC.stiffness_at(there.depth)
        assert abs(error) < 3.0 * there.stiffness.standard_error
        slope = PVC.K * PVC.n * (PVC.n - 1.0)
        assert there.stiffness.standard_error > 0.9 * slope * contact.surface_deviation
        # A surface that is 20 µm off is no offset of the force; three numbers that hang together.
        away = np.abs(result.law.parameters - PVC.parameters)
        assert (away < 3.0 * result.standard_errors).all()
        assert (result.standard_errors > result.estimate.standard_errors).all()


@pytest.mark.parametrize("zero", [0.0, 0.3])
def test_axes_that_measure_nothing_make_no_contact_of_free_air(zero):
    time = 0.02 * np.arange(300.0)
    force = np.full((300, 3), zero)
    force[:, 2] = 0.02 * np.random.default_rng(0).standard_normal(300)
    position = np.zeros((300, 3))
    position[:, 2] = 4e-3 * np.sin(5.0 * time)
    assert never_touches(force, position)
    assert not never_touches(force + 10.0 * position, position)
