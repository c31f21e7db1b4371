"""Law and diagnosis in the live loop: the verdict stands on the board, and survives."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from cases import MATERIALS
from message_files import typestore
from scripted import Scripted, T, arrivals, looped, measured, pressed, rings

import palpate
from palpate import FlatSpectrum, GeneralisedHuntCrossley, OnlinePreparation, SingleRelaxation
from palpate.live import run
from palpate.live.choices import LiveCommand
from palpate.live.diagnosing import Diagnosing, build_contact, diagnose_samples, recent
from palpate.live.loop import Loop
from palpate.live.page.watch import plain
from palpate.live.recorder import describe_run
from palpate.live.ring import COLUMNS
from palpate.live.ros import RosWire
from palpate.live.running import default_estimator
from palpate.live.schema import STATUS_TYPE, describe_status, estimates, read_run
from palpate.live.sinks import diagnosis_fields, why_outdated
from palpate.live.sources import EndOfSourceError, Replay
from palpate.live.view import NUMBERS, gain_texts, headline, law_card_texts, verdict_on
from palpate.live.wires import parse_address
from palpate.method.estimators.by_law import estimator_by_law
from palpate.output.results.view import describe_place, number_lines

BOX = FlatSpectrum(2e-3, 2.048)
LAWS = {
    "Kelvin–Voigt": GeneralisedHuntCrossley(K=1000.0, n=1.0, B=20.0, p=0.0),
    "Hunt–Crossley": GeneralisedHuntCrossley(K=2e4, n=1.5, B=4e4, p=1.5),
    "half-space": GeneralisedHuntCrossley(K=2e4, n=1.5, B=300.0, p=0.5),
    "Hunt–Crossley with relaxation": GeneralisedHuntCrossley(
        K=2e4, n=1.5, B=4e4, p=1.5, M=2e4, relaxation=BOX
    ),
    "half-space with relaxation": GeneralisedHuntCrossley(
        K=2e4, n=1.5, B=300.0, p=0.5, M=2e4, relaxation=BOX
    ),
}
MEMORY = LAWS["Hunt–Crossley with relaxation"]
ONE_TIME = GeneralisedHuntCrossley(
    K=2e4, n=1.5, B=4e4, p=1.5, M=2e4, relaxation=SingleRelaxation(0.1)
)


def swung(law, seconds=2.0, *, begins=0.0, seed=0):
    """Times, positions and forces: two sines to 11 mm, which begin and end each turn in the air.

    0.1 N beside some 10 N: 40 dB.
    """
    time = np.arange(round(begins / T), round(seconds / T)) * T
    x = 4e-3 - 6e-3 * np.cos(11 * time) + 1e-3 * np.sin(47 * time)
    v = np.gradient(x, T)
    force = law.force_along(x, v, T) + 0.1 * np.random.default_rng(seed).standard_normal(x.size)
    return time.tolist(), x.tolist(), force.tolist()


def read(loop):
    return verdict_on(json.loads(json.dumps(loop.status())))


def watched(script, law="auto", at=(), commands=None, **known):
    """Run a loop; return it, and its verdicts after so many samples each and at the end."""
    kind, settings = estimator_by_law(law)
    said, commands = {}, dict(commands or {})
    estimator = default_estimator(kind, **settings, **known)

    def asked():
        if loop.counts.taken in at:
            said.setdefault(loop.counts.taken, read(loop))
        return commands.pop(loop.counts.taken, None)

    with rings() as (samples, found, _):
        preparation = OnlinePreparation(sample_time=T)
        loop = Loop(Scripted(script), preparation, estimator, samples, found, asked)
        loop.run()
    return loop, said, read(loop)


@pytest.mark.parametrize("name", LAWS)
def test_the_loop_finds_each_everyday_law_and_its_numbers(name):
    law = LAWS[name]
    loop, _, verdict = watched(arrivals(*swung(law)))
    # The smoothed velocity does not tell which damper there is beside the relaxation.
    candidate = verdict.law.candidate
    assert str(candidate) == name or (law.remembers and candidate.memory == "spectrum")
    assert verdict.certainty == "strong"
    assert candidate == loop.estimator.verdict().candidate
    numbers = verdict.numbers()
    exact = law.dynamic_stiffness(verdict.law.depth, verdict.law.frequency)
    # The preparation's velocity is smoothed over 15 samples, which takes a percent off.
    assert numbers["stiffness"][0] == pytest.approx(exact.real, rel=0.02)
    assert numbers["damping"][0] == pytest.approx(exact.imag / verdict.law.frequency, rel=0.04)
    assert ("relaxed_stiffness" in numbers) == law.remembers
    assert "relaxation_time" not in numbers
    shown = loop.status()["law"]["shown"]
    assert [loop.estimator.law_type.symbols[k] for k in shown] == ["K", "n", "B", "M"]


def test_published_numbers_are_those_of_the_estimator_in_si():
    loop, _, verdict = watched(arrivals(*swung(ONE_TIME)))
    own, numbers = loop.estimator.dynamic_stiffness(), verdict.numbers()
    assert numbers["stiffness"] == (own.stiffness, own.stiffness_error)
    assert numbers["damping"] == (own.damping, own.damping_error)
    assert numbers["loss_tangent"][0] == pytest.approx(own.loss_tangent)
    time, error = numbers["relaxation_time"]
    assert abs(time - 0.1) < error
    fields = verdict.fields()
    assert {type(each) for each in fields.values()} == {str, float}
    assert {name for name in NUMBERS if math.isfinite(fields[name])} == set(NUMBERS)
    assert all(fields[f"{name}_standard_error"] > 0.0 for name in NUMBERS)


def test_before_the_first_sample_there_is_no_law_and_no_number():
    _, _, before = watched([])
    fields = before.fields()
    assert fields["law"] == ""
    assert not any(math.isfinite(fields[name]) for name in (*NUMBERS, "depth", "frequency"))
    assert str(before) == "no law yet"
    card = plain(law_card_texts(before, math.nan))
    assert (card["law-name"], card["law-badge"]) == ("Not known yet", "not known yet")
    assert {words for _, words in card["law-numbers"]} == {"–"}


def test_the_verdict_is_published_in_words_and_numbers():
    wire = RosWire(parse_address("dds", "/palpate", ()))
    said = {"state": "contact", "source": "rig", "time": 1.5, "lead": 1.0 / 3.0}
    said |= {"stiffness_verdict": "trust", "damping_verdict": "do-not-trust"}
    [status] = typestore().deserialize_cdr(wire.status(said), STATUS_TYPE).status
    values = {each.key: each.value for each in status.values}
    assert values == {**said, "time": "1.5", "lead": "0.333333333333333"}
    assert (status.level, status.message) == (2, "contact")


def test_a_change_discards_the_evidence_until_a_new_verdict():
    times, x, before = swung(MEMORY, 4.0)
    after = swung(LAWS["half-space"], 4.0, seed=1)[2]
    force = [a if t < 2.0 else 3.0 * b for t, a, b in zip(times, before, after, strict=True)]
    loop, said, verdict = watched(arrivals(times, x, force), at=range(2000, 2600, 5))
    assert loop.counts.changes >= 1
    assert str(verdict.law.candidate) == "half-space"
    assert verdict.law.samples < 2100
    turns = [law for _, law in verdict.turns]
    assert None in turns
    assert turns[-1] == "half-space"
    given_up = [page for page in said.values() if not page.law.known]
    assert given_up
    for page in given_up:  # until then the last verdict is marked as outdated
        assert page.certainty == "before"
        assert "outdated" in str(page)
        assert page.numbers() == {}
        assert page.changes == 0


def test_a_law_that_is_alone_on_offer_never_changes():
    commands = {1: LiveCommand("estimator", {"damping": "hunt-crossley", "memory": "none"})}
    _, _, verdict = watched(arrivals(*swung(MEMORY)), commands=commands)
    assert verdict.certainty == "alone"
    assert [law for _, law in verdict.turns] == ["Hunt–Crossley"]


def test_a_reset_forgets_the_verdict_and_another_method_has_none():
    commands = {
        1500: LiveCommand("reset"),
        2500: LiveCommand("estimator", {"method": "single-stage"}),
    }
    script = arrivals(*swung(MEMORY, 3.0))
    loop, said, verdict = watched(script, at=(1499, 1510), commands=commands)
    assert said[1499].law.known
    assert said[1510].certainty == "none"
    assert said[1510].turns == []
    assert verdict is None
    assert loop.status()["law"]["shown"] == [0, 1, 2]


def test_a_residual_that_is_far_from_white_is_warned_of():
    times, x, force = swung(LAWS["Hunt–Crossley"])
    noise, white = [0.0], np.random.default_rng(7).standard_normal(len(force))
    for each in white:
        noise.append(0.97 * noise[-1] + 0.1 * each)
    force = [f + each for f, each in zip(force, noise[1:], strict=True)]
    _, _, verdict = watched(arrivals(times, x, force))
    assert any(flag.startswith("correlated residuals: the residuals") for flag in verdict.flags)


def test_a_verdict_that_does_not_settle_says_so():
    # Without a damper laws of any damping form are the same, and take turns.
    law = GeneralisedHuntCrossley(
        K=2e4, n=1.5, B=0.0, p=1.5, M=2e4, relaxation=SingleRelaxation(0.05)
    )
    _, said, _ = watched(arrivals(*swung(law, 3.0)), at=range(400, 3000, 20))
    flags = {flag.split(":")[0] for page in said.values() for flag in page.flags}
    assert "unsettled law" in flags
    assert "no damper" in flags


def test_a_known_exponent_is_given_and_no_estimate():
    loop, rows = looped(arrivals(*swung(MEMORY)), estimator=default_estimator(exponent=1.5))
    verdict = read(loop)
    page, estimator = loop.status(), loop.estimator
    assert verdict.estimate.fixed == ("n",)
    run = read_run({**page, "origin": 10**12}, None)
    (last,) = estimates(rows[-1:], run, 0)
    said = describe_status(page, run, last, estimator.estimate().covariance)
    assert said["covariance"] == pytest.approx(estimator.estimate().covariance.ravel())
    assert said["n"] == 1.5
    assert "n 1.5 (fixed)" in said["words"]
    assert "p" not in said
    assert said["verdict_law"] == str(verdict.law.candidate)
    assert isinstance(said["verdict_stiffness"], float)
    assert said["verdict_since"] == pytest.approx(1000.0 + verdict.since)  # the robot's clock
    assert describe_run(page)["law"] == str(verdict.law.candidate)


SAMPLE = [COLUMNS.index(name) for name in ("time", "penetration", "velocity", "force", "status")]
LATE = 9e-3  # s
STATUS = {"method": "variable-projection", "sample_time": 1e-3}


@pytest.fixture(scope="module")
def samples():
    """What the loop wrote of four seconds on the ball."""
    _, rows = looped(arrivals(*measured(4.0)))
    return rows[:, SAMPLE]


def test_the_live_verdict_is_that_of_the_library(samples):
    page = diagnose_samples(recent(samples, 20.0, LATE), STATUS)
    known = samples[np.isfinite(samples).all(axis=1)]
    diagnosis = palpate.identify(build_contact(known, 1e-3)).diagnosis
    assert page["verdict"] == diagnosis.verdict.as_dict()
    assert page["said"].startswith("stiffness ")
    recorded = describe_run({**STATUS, "diagnosis": diagnosis_fields(page, STATUS)})
    assert recorded["diagnosis"] == page["said"]
    depth = page["working_depths"][0]
    stiffness = MATERIALS["ball"].stiffness_at(depth["depth"])
    bars = depth["stiffness"]
    assert abs(bars["value"] - stiffness) < 4.0 * bars["standard_error"] + bars["systematic"]


def test_the_headline_is_the_answer_of_identify():
    script = arrivals(*swung(MEMORY, 4.0))
    loop, rows = looped(script)
    status, known = loop.status(), recent(rows[:, SAMPLE], 20.0, LATE)
    page = diagnose_samples(known, status)
    result = palpate.identify(build_contact(known, 1e-3))
    assert result.law.remembers
    assert headline(page, status, {}, "") == (lines := number_lines(result))
    assert all(line.mark for line in lines)
    now = {"stiffness": (500.0, 1.0), "damping": (4.0, 0.1)}
    at = describe_place(9e-3, 2.0)
    for found, why in ((None, "--no-diagnosis"), ({}, "first"), (page, "material has changed")):
        first, second = headline(found, {**status, "counts": {"changes": 1}}, now, at)
        assert (first.name, first.value, first.at, first.mark) == (
            "stiffness",
            "500.0 ± 1.0 N/m",
            at,
            None,
        )
        assert second.value == "4.00 ± 0.10 N·s/m"
        assert why in first.reason


def test_the_diagnosis_uses_a_known_exponent_and_the_chosen_depth(samples):
    known = recent(samples, 20.0, LATE)
    page = diagnose_samples(known, {**STATUS, "exponent": 1.2, "depth": 5e-3})
    estimator = palpate.VariableProjection(exponent=1.2)
    result = palpate.identify(build_contact(known, 1e-3), estimator).at_depth(5e-3)
    assert page["working_depths"][0] == result.diagnosis.working_depth.as_dict()
    assert page["working_depths"][0]["depth"] == 5e-3
    assert {line["at"].split(",")[0] for line in page["numbers"]} == {"at 5 mm"}
    deciding = dict.fromkeys(f.check for f in result.diagnosis.limits if f is not None)
    commands = [line[0] for line in page["lines"] if "palpate explain" in line[0]]
    assert commands == [f"palpate explain {check}" for check in deciding] != []


def test_the_live_diagnosis_uses_the_last_seconds_of_one_clock(samples):
    short = recent(samples, 1.0, LATE)
    assert short[-1, 0] - short[0, 0] == pytest.approx(1.0, abs=2e-3)
    earlier = samples.copy()
    earlier[:, 0] += 100.0
    both = recent(np.concatenate([earlier, samples]), 20.0, LATE)
    np.testing.assert_array_equal(both, recent(samples, 20.0, LATE))


def test_the_live_verdict_is_of_the_material_since_the_change(samples):
    times, positions, forces = measured(4.0)
    softer = arrivals([4.0 + time for time in times], positions, [0.3 * f for f in forces])
    _, rows = looped([*arrivals(times, positions, forces), *softer])
    page = diagnose_samples(recent(rows[:, SAMPLE], 20.0, LATE), STATUS)
    assert page["window"][0] == pytest.approx(4.0, abs=0.5)
    assert page["verdict"]["stiffness"] == "trust"


def test_a_gap_begins_another_segment_and_no_contact_is_said(samples):
    known = recent(samples, 20.0, LATE)
    contact = build_contact(np.concatenate([known[:1000], known[1500:]]), 1e-3)
    assert len(list(contact.segments())) == 2
    known[:, 1], known[:, 3] = -1e-3, 0.0  # free
    page = diagnose_samples(known, STATUS)
    assert page["verdict"] is None
    assert page["reason"]


def test_an_outdated_live_verdict_is_marked(samples):
    status = {**STATUS, "counts": {"changes": 1}, "tare": None}
    page = diagnose_samples(recent(samples, 1.0, LATE), status)
    assert why_outdated(page, status) == ""
    later = {**status, "method": "single-stage", "counts": {"changes": 2}}
    words = "the estimator was changed since and the material has changed since"
    assert why_outdated(page, later) == words
    assert why_outdated(page, {**status, "tare": 0.3}) == "the force was tared since"


def test_the_gains_of_a_control_loop_hold_as_long_as_the_diagnosis(samples):
    loop = palpate.control_loops.ImpedanceControl(
        stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
        wanted_force=2.0, approach_speed=0.02,
    )  # fmt: skip
    page = diagnose_samples(recent(samples, 1.0, LATE), STATUS, loop)
    verdict, lines = gain_texts(page, STATUS)
    assert verdict.split()[0] == lines[0].split(":")[0].split()[0].lower()
    assert any("recommended" in line for line in lines)
    free = recent(samples, 1.0, LATE)
    free[:, 1] = -1e-3
    later = {**STATUS, "generation": 7}
    for found, status, why in [
        (None, STATUS, "no control loop"),
        ({"gains": None}, STATUS, "not known: the first diagnosis has not finished yet"),
        (page, later, "not known: the estimator was changed since"),
        (diagnose_samples(free, STATUS, loop), STATUS, "not known: "),
    ]:
        verdict, lines = gain_texts(found, status)
        assert (verdict.startswith(why), list(lines)) == (True, [])


class Reading:
    """A sink that keeps what the diagnosis said."""

    name = "reading"

    def __init__(self, path):
        self.path = path

    def run(self, watching, commands):
        while watching.wait(0.1):
            if said := watching.others()["diagnosis"].get("said"):
                self.path.write_text(said)


class Heard(Replay):
    """A recording at its own pace, until its verdict has been read."""

    said: Path

    def take(self, timeout):
        if self.said.exists():
            raise EndOfSourceError
        return super().take(timeout)


@pytest.mark.slow
def test_the_verdict_is_printed_while_the_loop_runs(tmp_path):
    source = Heard(palpate.Contact(**vars(pressed(30.0))))
    source.said = tmp_path / "said"
    status = run(source, None, [Diagnosing(every=1.0), Reading(source.said)])
    said = source.said.read_text().split("; ")
    assert [(part.split()[0], part.split()[-1]) for part in said] == [
        ("stiffness", "(trust)"),
        ("damping", "(trust)"),
    ]
    assert status["counts"]["taken"] < 30_000
