"""Advice names the arguments of functions in Python, and the options of a command at the prompt."""

import ast
import dataclasses
import inspect
import pickle
import re

import pytest
from test_structure import modules, tree

import palpate
from palpate import spelling
from palpate.cli.reading import ReadingOptions
from palpate.findings import NextStep, Remedy
from palpate.spelling import ARGUMENTS, FLAGS, options_in_advice, spell_advice


@pytest.fixture
def in_python(monkeypatch):
    """Spell advice as without the command line."""
    monkeypatch.setattr(spelling, "_commanded", False)


SPELLED = {
    "run again with --velocity-window 20ms": "run again with velocity_window=0.02",
    "--delay 14ms+-0.2ms": "delay=(0.014, 0.0002)",
    "run again with --delay find if so": "run again with delay='find' if so",
    "--unit penetration=mm,force=gf": "units={'penetration': 'mm', 'force': 'gf'}",
    "pass --flip-force to confirm": "pass flip=['force'] to confirm",
    "choose one: --position left --force left": (
        "choose one: columns=Columns(position='left') columns=Columns(force='left')"
    ),
    "name it with --time, or --rate if": "name it with columns=Columns(time=…), or rate if",
    "--min-penetration 5.1mm": "gate=ContactGate(0.0051, 0, 0)",
    "--stop 2.92, then --start 2.92": "window=(None, 2.92), then window=(2.92, None)",
    "--tip-offset 3mm,0,-140mm": "tip_offset=(0.003, 0, -0.14)",
    "drop --strict to skip such rows": "drop strict=True to skip such rows",
    "omit --scheduler to use": "omit --scheduler to use",
}  # fmt: skip


@pytest.mark.parametrize("words", SPELLED)
def test_an_option_in_a_sentence_is_an_argument_in_python(words, in_python):
    assert spell_advice(words) == SPELLED[words]
    with options_in_advice():
        assert spell_advice(words) == words


def test_every_option_of_a_recording_has_its_argument():
    names = {each.name.replace("_", "-") for each in dataclasses.fields(ReadingOptions)}
    renamed = {"companion": "with", "reject-outliers": "no-reject-outliers"}
    renamed |= {"weak-prior": "no-weak-prior"}
    assert {renamed.get(name, name) for name in names} - {"save-config"} <= {*ARGUMENTS, *FLAGS}


def test_every_argument_is_one_of_a_public_function():
    functions = (
        palpate.prepare, palpate.identify, palpate.open_recording, palpate.diagnose,
        palpate.VariableProjection, palpate.Columns,
    )  # fmt: skip
    known = {name for each in functions for name in inspect.signature(each).parameters}
    exported = {"time_step", "tip_radius", "form", "geom", "model", "max_depth", "max_speed", "tip"}
    spelled = [*(argument for argument, _ in ARGUMENTS.values()), *FLAGS.values()]
    for argument in spelled:
        for name in re.findall(r"(\w+)=", argument):
            assert name in known | exported, argument


def test_sentences_are_written_only_on_request():
    """A finding that is made at an import would keep the spelling of that moment."""
    for name, path in modules():
        for node in tree(path).body:
            made = ast.unparse(node) if isinstance(node, ast.Assign | ast.AnnAssign) else ""
            assert not (".finding(" in made and "--" in made), name


def test_errors_and_findings_name_arguments_in_python(in_python, tmp_path):
    values = list(range(100))
    with pytest.raises(palpate.PalpateError) as caught:
        palpate.identify({"a": values, "b": values, "c": values})
    assert "--" not in str(caught.value)
    assert "Columns(" in str(caught.value)
    step = Remedy(NextStep.WIDER_WINDOW, "0.02")
    assert step == "run again with velocity_window=0.02"
    with options_in_advice():
        again = pickle.loads(pickle.dumps(step))
    assert (again.step, str(again)) == (
        NextStep.WIDER_WINDOW,
        "run again with --velocity-window 0.02",
    )


@pytest.mark.parametrize("step", NextStep)
def test_a_step_is_one_sentence_without_its_dot(step):
    words = Remedy(step, "1", "2", "3")
    assert "{" not in words
    assert not words.endswith(".")
