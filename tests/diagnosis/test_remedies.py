"""What palpate advises is followed to its end: it runs, helps, and does not go in a circle."""

import json
import math
import re

import pytest
from recordings import BESIDE
from test_diagnosis import CAUSES, INPUTS

import palpate

MARKS = ("trust", "with-care", "do-not-trust")
OPTION = re.compile(r"(--[a-z-]+)(?: ((?!then\b|if\b|or\b|and\b)[^-\s,;][^\s,;]*))?")
NUMBERS = ("stiffness", "damping")
#: A bar may end wider by the draw of its own estimate.
AS_WIDE = 1.02
FOLDERS = (BESIDE, BESIDE.parent / "cases")
FILES = [path for folder in FOLDERS if folder.is_dir() for path in sorted(folder.glob("*.csv"))]
FAULTS = {**CAUSES, **INPUTS}
#: Answers by file and options: the advice of both numbers begins with the same one.
ANSWERED = {}


def identified(run, path, options):
    """By number: mark, relative bar and next step; None if palpate refuses the file."""
    key = path, *options.items()
    if key not in ANSWERED:
        ANSWERED[key] = _identified(run, path, options)
    return ANSWERED[key]


def _identified(run, path, options):
    given = [word for option in options.items() for word in option if word]
    code, out, _ = run("identify", path, *given, "--json")
    if code != 0:
        return None
    [result] = json.loads(out)["results"]
    answer = {}
    for name in NUMBERS:
        number, limit = result["working_depth"][name], result["limits"][name]
        errors = [number[part] or 0.0 for part in ("standard_error", "systematic")]
        bar = math.hypot(*errors) / abs(number["value"]) if number["value"] else math.inf
        mark = number.get("mark") or "trust"
        answer[name] = mark, bar, (limit or {}).get("remedy") if mark != "trust" else None
    return answer


def follow(run, path, name):
    """Follow the advice of one number to its end; return the marks before and after."""
    options, found = {}, identified(run, path, {})
    if found is None:
        pytest.skip("refused, with the option that it needs")
    first = found[name][0]
    for _ in range(3):
        mark, bar, remedy = found[name]
        steps = [
            (option, value)
            for option, value in OPTION.findall(remedy or "")
            if value or "flip" in option
        ]
        if not steps:
            assert "surface normal" not in (remedy or "")  # these are of one axis
            return
        option, value = steps[0]
        assert options.get(option) != value, f"{remedy}: again"
        options[option] = value
        found = identified(run, path, options)
        assert found is not None, f"{remedy}: does not run"
        assert MARKS.index(found[name][0]) <= MARKS.index(mark), f"{remedy}: a worse mark"
        assert found[name][1] <= AS_WIDE * bar or found[name][0] != mark, f"{remedy}: a wider bar"
    mark, _, remedy = found[name]
    assert mark != first, f"three steps, and still: {remedy}"


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="no recordings of others next to the checkout")
@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_advice_on_recordings_of_others_is_followed_to_its_end(path, name, run):
    follow(run, path, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("fault", FAULTS)
def test_advice_on_a_fault_is_followed_to_its_end(fault, name, run, tmp_path):
    path = tmp_path / "fault.csv"
    palpate.write_contact(FAULTS[fault], path)
    follow(run, path, name)
