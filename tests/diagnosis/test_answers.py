"""The terminal's answer is short, and its next steps can be followed and do not contradict."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from recordings import files, has_penetration
from test_diagnosis import CAUSES, INPUTS

import palpate
from benchmarks.bank import sensor_faults
from palpate import ESTIMATORS, GeneralisedHuntCrossley, SingleRelaxation
from palpate.cli.printing import print_identifications
from palpate.cli.reading import ReadingOptions
from palpate.findings import MARKS, MAY_CAP, worst

FAULTS = {**CAUSES, **INPUTS}
OPTION = re.compile(r"--([a-z-]+)(?: ([^\s,;]+))?")
FLAGS = {"changes", "flip-force", "flip-penetration", "no-reject-outliers", "strict"}
OPTIONS = {name.replace("_", "-") for name in vars(ReadingOptions())} | {"law", "method", "at"}
#: A value of an option: a number, perhaps with a unit, two numbers, or a word that it offers.
VALUE = re.compile(
    r"-?[\d.]+(e-?\d+)?[A-Za-zµ]*((:|\+-)-?[\d.]+[a-z]*)?$|\w+=\w+$"
    r"|(auto|none|fit|find|estimate|tool|base|inf|z)$"
)
ONE_VALUE = ("delay", "min-penetration", "velocity-window", "tare")
#: Next steps of which a result may name one of each row, but not both.
OPPOSITES = [
    ("press (deeper|harder)", "press less deep"),
    ("faster", "slower|more slowly"),
    ("--flip-force", "--flip-penetration"),
    ("--surface fit", "--surface estimate"),
    ("record longer", "record less"),
]


def remedies(result: palpate.Identification) -> list[str]:
    found = [*result.diagnosis.findings, *result.findings, *result.contact.findings]
    return [each.remedy for each in found if each.remedy]


def faults_of(result: palpate.Identification) -> list[str]:
    """What is wrong with the next steps of a result, in words; empty where nothing is."""
    steps, wrong = remedies(result), []
    steps = [step.replace("without --law and --method", "") for step in steps]
    for step in steps:
        for option, value in OPTION.findall(step):
            if option not in OPTIONS | FLAGS:
                wrong.append(f"no option of identify: {step}")
            elif option not in FLAGS and not (VALUE.match(value) or value in ESTIMATORS):
                wrong.append(f"without its value: {step}")
        chosen = result.estimator.chooses_law
        if f"--method {result.method}" in step and "--surface estimate" not in step:
            wrong.append(f"the method just used: {step}")
        if (chosen and "--law auto" in step) or "palpate compare" in step:
            wrong.append(f"what was just done: {step}")
        if result.estimate.surface_standard_error and "--surface estimate" in step:
            wrong.append(f"the surface is estimated already: {step}")
    whole = "\n".join(steps)
    for one, other in OPPOSITES:
        if re.search(one, whole) and re.search(other, whole):
            wrong.append(f"contradiction: {one} and {other}")
    values = {(name, value) for name, value in OPTION.findall(whole) if name in ONE_VALUE}
    names = [name for name, _ in values]
    return wrong + [f"two values: --{each}" for each in ONE_VALUE if names.count(each) > 1]


def results_of(contact: palpate.Contact) -> list[palpate.Identification]:
    """By Hunt and Crossley's law and by the selected one."""
    return [palpate.identify(contact, law=law, trace=False) for law in ("hunt-crossley", None)]


@pytest.mark.long
@pytest.mark.parametrize("name", ["memory", "delay", "surface", "friction"])
def test_no_method_recommends_itself(name):
    for result in palpate.compare(FAULTS[name], trace=False).values():
        assert faults_of(result) == [], result.method


@pytest.mark.slow
@pytest.mark.parametrize("path", files("*.csv"))
def test_no_method_recommends_itself_on_a_recording(path):
    if path is not None:
        for result in palpate.compare(palpate.prepare(path), trace=False).values():
            assert faults_of(result) == [], result.method


def test_a_step_that_does_not_help_is_not_said(tmp_path, run):
    """A part of the depths of a bent sensor is bent too."""
    file = tmp_path / "bent.csv"
    palpate.write_contact(faults.damaged(sensor_faults.curved_gain, 0.2), file)
    for half in ([], ["--min-penetration", "3.8mm"]):
        whole = json.loads(run("identify", file, *half, "--json")[1])["results"][0]
        limit = whole["limits"]["stiffness"]
        assert limit["check"] == "unknown law"
        assert limit["remedy"] == "check the force sensor with a spring up to the same force"


def test_the_next_step_of_a_late_force_leads_to_trust(tmp_path, run):
    file = tmp_path / "late.csv"
    palpate.write_contact(FAULTS["delay"], file)
    status, out, _ = run("identify", file)
    [step] = re.findall(r"^next +run again with (--delay find)", out, re.MULTILINE)
    status, out, _ = run("identify", file, *step.split())
    assert status == 0
    assert len(re.findall(r"^(?:stiffness|damping) .* trust", out, re.MULTILINE)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("path", files("D_*raw*.csv"))
def test_a_recording_of_many_places_prints_counts_and_the_worst(path, monkeypatch, run):
    if path is None:
        return
    monkeypatch.setenv("COLUMNS", "80")
    lines = run("identify", path)[1].splitlines()
    assert len([line for line in lines if line.strip()]) <= 12
    assert lines[0] == path.name
    assert re.match(r"\d+ places: stiffness \d+ .*; damping \d+ ", lines[1])


@pytest.mark.long
def test_relaxing_and_plain_laws_give_the_same_stiffness(tmp_path, run):
    """K′ and B′ at the working depth and the motion's frequency; the relaxed stiffness beside."""
    file = tmp_path / "relaxing.csv"
    palpate.write_contact(FAULTS["memory"], file)
    contact = palpate.prepare(file)
    plain, relaxing = (palpate.identify(contact, law=law) for law in ("hunt-crossley", None))
    assert relaxing.law.remembers
    one, other = plain.diagnosis.working_depth, relaxing.diagnosis.working_depth
    assert other.stiffness == relaxing.dynamic_stiffness().stiffness
    assert abs(one.stiffness.value - other.stiffness.value) < 3.0 * one.stiffness.whole_error
    words = run("identify", file)[1]
    assert re.search(
        rf"^stiffness .* at .*, {relaxing.frequency / 6.2832:.2f}", words, re.MULTILINE
    )
    assert " N/m after " in words
    assert "Hz" not in run("identify", file, "--law", "hunt-crossley")[1].splitlines()[1]


def test_too_few_samples_give_hunt_crossley():
    """A law with memory has then only its start, of which every bar is 10¹⁰⁰."""
    whole = FAULTS["memory"]
    channels = ("time", "penetration", "velocity", "force")
    time, *others = (getattr(whole, name)[2000:2004] for name in channels)
    few = palpate.Contact(time, **dict(zip(channels[1:], others, strict=True)))
    result = palpate.identify(few)
    assert not result.law.remembers
    assert result.diagnosis.verdict.overall == "do-not-trust"
    assert (result.standard_errors < 1e9).all()


def test_a_reversed_force_is_refused_with_what_to_do():
    """One sample of noise is then in contact, from which no law is estimated."""
    contact = FAULTS["memory"]
    with pytest.raises(palpate.RecordingError, match="must be positive"):
        palpate.identify(replace(contact, force=-contact.force))


def test_a_relaxed_stiffness_at_its_bound_is_not_given(tmp_path, run):
    """Of a law without a spring in parallel, K = 0 fits best and its error is unknown."""
    depth = 4e-3 + 2e-3 * np.sin(4.0 * np.pi * (time := 1e-3 * np.arange(6000)))
    speed = 8e-3 * np.pi * np.cos(4.0 * np.pi * time)
    law = GeneralisedHuntCrossley(
        K=0.0, n=1.5, B=1e3, p=1.5, M=1e5, relaxation=SingleRelaxation(0.2)
    )
    force = law.force_along(depth, speed, np.full(time.size, 1e-3))
    force += np.random.default_rng(0).normal(0.0, 0.01, time.size)
    file = tmp_path / "fluid.csv"
    contact = palpate.Contact(time, penetration=depth, velocity=speed, force=force)
    palpate.write_contact(contact, file)
    out = run("identify", file)[1]
    assert "K = 0" not in out
    course = r"at (\S+) mm.*stiffness (\S+) ± \S+ N/m after (\S+) ms, (\S+) ± \S+ N/m after (\S+) s"
    numbers = map(float, re.search(course, " ".join(out.split())).groups())
    depth, first, shortest, last, longest = numbers
    assert first == pytest.approx(law.stiffness_after(1e-3 * depth, 1e-3 * shortest), rel=0.1)
    # A motion of 2 Hz shows little of what is left after its 1/ω of 80 ms: to a fifth.
    assert last == pytest.approx(law.stiffness_after(1e-3 * depth, longest), rel=0.2)
    assert "K = 0 N/m" in run("identify", file, "-v")[1]


LIMITS = {"stiffness": (0.10, 0.25), "damping": (0.20, 0.60)}


def contradictions(result: palpate.Identification) -> list[str]:
    """Marks that their error bars do not give and that no fault of the recording lowers."""
    found, wrong = result.diagnosis, []
    given = []
    for k, name in enumerate(LIMITS):
        number, mark = getattr(found.working_depth, name), getattr(found.verdict, name)
        limit, size = found.limits[k], abs(number.value)
        bar = number.whole_error / size if size else math.inf
        assert (limit is None) == (mark == "trust")
        if limit is not None and getattr(limit, name) != mark:
            wrong.append(f"{name}: decided by a finding that gives another mark")
        if math.isnan(number.value):
            assert limit is not None
            continue
        given.append(mark)
        by_bar = MARKS[sum(not bar <= most for most in LIMITS[name])]
        if MARKS.index(mark) < MARKS.index(by_bar):
            wrong.append(f"{name}: {mark} beside a bar of {bar:.0%}")
        open_sign = not number.value > 2.0 * number.whole_error
        faults, step = MAY_CAP - {"precision"}, "--delay 0ms"  # a law that cannot tell a late force
        capped = limit is not None and (limit.check in faults or step in (limit.remedy or ""))
        if mark != by_bar and not open_sign and not capped:
            wrong.append(f"{name}: {mark} beside a bar of {bar:.0%}, by {limit.check}")
    if found.verdict.overall != worst(*given):
        wrong.append("overall")
    return wrong


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_following_the_next_steps_mends_a_fault(name):
    try:
        results = results_of(FAULTS[name])
    except palpate.RecordingError:  # such as a force that pulls: the error says what to do
        return
    assert [faults_of(each) for each in results] == [[], []]
    assert contradictions(results[1]) == []


@pytest.mark.long
@pytest.mark.parametrize("path", files("*.csv"))
def test_the_answer_to_a_recording_is_short_and_holds_the_same(path, monkeypatch, capsys):
    """Lines that are not blank at 80 columns, of one contact each."""
    if not has_penetration(path):
        return
    results = results_of(palpate.prepare(path))
    assert [faults_of(each) for each in results] == [[], []]
    assert contradictions(results[1]) == []
    monkeypatch.setenv("COLUMNS", "80")
    print_identifications([Path(path.name)], results[1:], None, as_json=False)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 12
