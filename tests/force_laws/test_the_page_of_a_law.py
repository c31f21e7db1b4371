"""The law of ``docs/contributing/extending.md``, added to a copy of the package as it says."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import palpate

ROOT = Path(__file__).resolve().parents[2]
# The editable installation would import the package from the checkout.
RUN = """
import sys
sys.meta_path[:] = [each for each in sys.meta_path if "Redirecting" not in type(each).__name__]
sys.path.insert(0, "src")
import palpate, pytest
assert palpate.__file__.startswith(sys.argv[1])
sys.exit(pytest.main(["-q", "-n0", "-p", "no:cacheprovider", *sys.argv[2:]]))
"""
#: Where the page wants the law to be listed, and the entry.
LISTED = {
    "tests/force_laws/test_force_laws.py": '"fung": palpate.Fung(A=0.8, d=4e-3, B=1500.0),',
    "tests/design/test_design.py": "palpate.Fung(A=0.8, d=4e-3, B=1500.0),",
    "tests/cli/test_lab_command.py": '"fung": "--A 0.8 --d 4e-3 --B 1500",',
}


@pytest.mark.long
def test_the_law_of_the_page_passes_the_tests_of_a_law(tmp_path):
    [code] = re.findall(
        r"```python\n(@register.*?)```",
        (ROOT / "docs/contributing/extending.md").read_text(),
        re.DOTALL,
    )
    ignored = shutil.ignore_patterns("__pycache__", "*.so")
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=ignored)
    shutil.copytree(ROOT / "tests", tmp_path / "tests", ignore=ignored)
    for name in ("examples", "docs", "pyproject.toml", "README.md", "CMakeLists.txt"):
        (tmp_path / name).symlink_to(ROOT / name)
    package = tmp_path / "src" / "palpate"
    core = Path(palpate._core.__file__)
    (package / core.name).symlink_to(core)
    with (package / "force_laws" / "laws.py").open("a") as laws:
        laws.write(f"\n\n{code}")
    for face in ("force_laws/__init__.py", "_public.py"):
        with (package / face).open("a") as names:
            names.write("\nfrom palpate.force_laws.laws import Fung as Fung\n")
    for test, entry in LISTED.items():
        text = (tmp_path / test).read_text()
        (tmp_path / test).write_text(
            re.sub(r"^LAWS = [\[{]$", rf"\g<0>\n    {entry}", text, flags=re.M)
        )
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path), *LISTED],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert "fung" in (tmp_path / "tests/cli/test_lab_command.py").read_text()
