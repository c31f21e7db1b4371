"""The terminal's answer is short, and its next steps can be followed and do not contradict."""

import re
import statistics

import pytest
from test_diagnosis import CAUSES, INPUTS
from test_recordings import files, has_penetration

import palpate
from palpate import ESTIMATORS
from palpate.cli.reading import ReadingOptions

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
    """By the default method and by model selection."""
    return [palpate.identify(contact, law=law, trace=False) for law in (None, "auto")]


@pytest.mark.parametrize("name", FAULTS)
def test_the_next_steps_of_a_fault_can_be_followed(name):
    try:
        results = results_of(FAULTS[name])
    except palpate.RecordingError:  # such as a force that pulls: the error says what to do
        return
    assert [faults_of(each) for each in results] == [[], []]


@pytest.mark.parametrize("name", ["memory", "delay", "surface", "friction"])
def test_no_method_recommends_itself(name):
    for result in palpate.compare(FAULTS[name], trace=False).values():
        assert faults_of(result) == [], result.method


@pytest.mark.parametrize("path", files("*.csv"))
def test_the_next_steps_of_a_recording_can_be_followed(path):
    if path is not None and has_penetration(path):
        assert [faults_of(each) for each in results_of(palpate.prepare(path))] == [[], []]


@pytest.mark.slow
@pytest.mark.parametrize("path", files("*.csv"))
def test_no_method_recommends_itself_on_a_recording(path):
    if path is not None:
        for result in palpate.compare(palpate.prepare(path), trace=False).values():
            assert faults_of(result) == [], result.method


def test_the_next_step_of_a_wrong_surface_leads_to_trust(tmp_path, run):
    file = tmp_path / "off.csv"
    palpate.write_contact(FAULTS["surface"], file)
    status, out, _ = run("identify", file)
    [step] = re.findall(r"next step: Run again with (--surface estimate)\.", out)
    status, out, _ = run("identify", file, *step.split())
    assert (status, out.split(". ")[0]) == (0, "off.csv: trust")


def test_an_answer_is_short(monkeypatch, run):
    """Lines that are not blank at 80 columns, of one contact each."""
    monkeypatch.setenv("COLUMNS", "80")
    counts = {}
    for parameter in files("*.csv"):
        path = parameter.values[0]
        if path is None:
            pytest.skip("no recordings beside the checkout, and PALPATE_DATA is not set")
        if has_penetration(path):
            monkeypatch.chdir(path.parent)
            out = run("identify", path.name)[1]
            assert max(map(len, out.splitlines())) <= 80
            counts[path.name] = sum(1 for line in out.splitlines() if line.strip())
    assert statistics.median(counts.values()) <= 12
    assert max(counts.values()) <= 16, max(counts, key=counts.__getitem__)


@pytest.mark.slow
@pytest.mark.parametrize("path", files("D_*raw*.csv"))
def test_a_recording_of_many_places_is_counts_and_the_worst_three(path, monkeypatch, run):
    if path is None:
        return
    monkeypatch.setenv("COLUMNS", "80")
    lines = run("identify", path)[1].splitlines()
    assert len([line for line in lines if line.strip()]) <= 20
    assert re.match(rf"{re.escape(path.name)}: \d+ places: (\d+ trust, )?\d+ with care", lines[0])


def test_methods_agree_or_a_sentence_says_why_not(tmp_path, run):
    """On relaxation: the default law says by how much model selection changes its numbers."""
    file = tmp_path / "relaxing.csv"
    palpate.write_contact(FAULTS["memory"], file)
    plain, relaxing = results_of(palpate.prepare(file))
    one, other = plain.diagnosis.working_depth, relaxing.dynamic_stiffness()
    assert abs(one.stiffness.value - other.stiffness.value) < 3.0 * one.stiffness.whole_error
    assert "K′ and B′ at" in run("identify", file, "--law", "auto")[1]
    assert "K′ and B′ at" in run("compare", file)[1]
