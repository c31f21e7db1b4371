"""What palpate advises is followed to its end: no advice goes in a circle or does not run."""

import json
import re

import pytest
from recordings import BESIDE

MARKS = ("trust", "with-care", "do-not-trust")
OPTION = re.compile(r"(--[a-z-]+)(?: ((?!then\b|if\b|or\b|and\b)[^-\s,;][^\s,;]*))?")
FOLDERS = (BESIDE, BESIDE.parent / "cases")
# Ten minutes of a robot are one case of many steps; the rest takes five minutes together.
LONG = ("D_dvrk_RAL18T1_full_raw", "D_dvrk_trial4_raw_first212s")
FILES = [
    path
    for folder in FOLDERS
    if folder.is_dir()
    for path in sorted(folder.glob("*.csv"))
    if path.stem not in LONG
]


def next_step(run, path, options):
    """The marks, and the next step of the worse one; None if palpate refuses the file."""
    given = [word for option in options.items() for word in option if word]
    code, out, _ = run("identify", path, *given, "--json")
    if code != 0:
        return None
    [result] = json.loads(out)["results"]
    there, limits = result["working_depth"], result["limits"]
    marks = {name: there[name].get("mark") or "trust" for name in ("stiffness", "damping")}
    name = max(marks, key=lambda each: MARKS.index(marks[each]))
    return marks, (limits[name] or {}).get("remedy") if marks[name] != "trust" else None


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="no recordings of others next to the checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_advice_is_followed_to_its_end(path, run):
    options, found = {}, next_step(run, path, {})
    if found is None:
        pytest.skip("refused, with the option that it needs")
    first = found[0]
    for _ in range(3):
        marks, remedy = found
        steps = [
            (name, value) for name, value in OPTION.findall(remedy or "") if value or "flip" in name
        ]
        if not steps:
            break
        name, value = steps[0]
        assert options.get(name) != value, f"{remedy}: again"
        options[name] = value
        found = next_step(run, path, options)
        assert found is not None, f"{remedy}: does not run"
    else:
        marks, remedy = found
        assert not OPTION.search(remedy or "") or marks != first, (
            f"three steps, and still: {remedy}"
        )
    assert "surface normal" not in (remedy or "")  # these are of one axis
