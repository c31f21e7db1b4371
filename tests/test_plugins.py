"""A package of one's own adds a law and a format without a line in palpate."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PLUGIN = Path(__file__).parents[1] / "examples" / "plugin"
BROKEN = """
[palpate.laws]
broken = no_such_module:Law

[palpate.formats]
broken = sys:version
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the installed example, and a second package whose entry points fail."""
    pytest.importorskip("setuptools")
    folder = tmp_path_factory.mktemp("installed")
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "palpate_fung.py"):
        (source / name).write_bytes((PLUGIN / name).read_bytes())
    words = [sys.executable, "-m", "pip", "install", *options, "--target", folder, source]
    subprocess.run(words, check=True, cwd=source)
    metadata = folder / "broken-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(BROKEN)
    return folder


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Presses on Fung's law with 10 mN of noise, in the plugin's format."""
    time = 1e-3 * np.arange(6000)
    depth = 0.004 * np.sin(7.0 * time) + 0.002 * np.sin(11.0 * time) + 0.003
    velocity = 0.028 * np.cos(7.0 * time) + 0.022 * np.cos(11.0 * time)
    force = 0.8 * np.expm1(depth / 4e-3) + 1500.0 * depth * velocity
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    path = tmp_path_factory.mktemp("recording") / "press.fung"
    np.savetxt(path, np.column_stack([time, depth, np.where(depth > 0.0, force, 0.0) + noise]))
    return path


def run(folder, *words):
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "100"}
    environment.pop("PALPATE_NO_PLUGINS", None)
    command = [sys.executable, "-m", "palpate", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)


@pytest.mark.long
def test_a_law_and_a_format_of_another_package_are_used_and_a_broken_one_is_one_line(
    installed, recording
):
    done = run(installed, "identify", recording, "--law", "fung", "-v")
    assert done.returncode == 0
    assert "fung" in done.stdout
    assert "A = 0.8" in done.stdout  # N, of the truth
    broken = [line for line in done.stderr.splitlines() if "is not loaded" in line]
    assert len(broken) == 2  # one of the laws, one of the formats
    assert any("no_such_module" in line for line in broken)
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_no_plugins_are_loaded_by_no_plugins_or_for_what_palpate_has(installed, recording):
    refused = run(installed, "lab", "fung", "--no-plugins", "-o", "no.csv")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    table = recording.with_suffix(".csv")
    rows = np.loadtxt(recording)
    np.savetxt(table, rows, delimiter=",", header="time_s,penetration_m,force_N", comments="")
    usual = run(installed, "identify", table)
    assert usual.returncode == 0
    assert "is not loaded" not in usual.stderr
