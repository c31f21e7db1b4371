"""The benchmark of the loop, for some seconds: what does not depend on the machine's other work."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("uvicorn")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="of Linux: it reads /proc"),
]


def test_nothing_is_lost_with_page_recording_and_diagnosis(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2]))
    from benchmarks.live import measure

    section = measure(0.2, realtime=False, method=None)
    rows = {row.name.strip(): row.value for row in section.rows}
    assert rows["lost before the estimator"] == 0
    assert rows["refused"] == 0
    assert rows["samples taken"] > 10_000
    for process in ("loop", "page", "recorder", "lab", "diagnosis", "browser"):
        assert rows[process] > 0.0
    assert "benchmarks.live" in sys.modules
