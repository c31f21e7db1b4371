"""The pictures of pages that draw with their own command, as a reader does."""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples"
# Pages of docs/how-to.
DOORS = "csv", "robot-log", "testing-machine", "afm", "robot-learning"
FENCED = re.compile(r"^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
DRAWING = re.compile(r"palpate (.+) --figure \S+(.*)$", re.M)


def draw_door(name: str) -> None:
    """Run a page's first script in an empty folder, and draw what its command draws."""
    page = (IMAGES.parent / "how-to" / f"{name}.md").read_text("utf-8")
    script = next(each["text"] for each in FENCED.finditer(page) if each["language"] == "python")
    drawing = DRAWING.search(page)
    assert drawing is not None, f"{name}.md has no command with --figure"
    (IMAGES / "doors").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "examples").symlink_to(EXAMPLES)
        subprocess.run([sys.executable, "-c", script], cwd=folder, check=True)
        command = [sys.executable, "-m", "palpate", *shlex.split(drawing[1] + drawing[2])]
        for options, ending in (([], ""), (["--dark"], "-dark")):
            figure = IMAGES / "doors" / f"{name}{ending}.svg"
            subprocess.run([*command, "--figure", figure, *options], cwd=folder, check=True)
