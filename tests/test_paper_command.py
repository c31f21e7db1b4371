"""``palpate paper``, as a user meets it."""

import pytest
from paper_cases import Tiny, no_processes

from palpate import paper


@pytest.fixture
def run(run):
    """``palpate paper`` with these arguments."""
    return lambda *arguments: run("paper", *arguments)


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(paper, "EXPERIMENTS", {name: Tiny(name) for name in ("a", "b")})


def test_it_prints_the_claims_and_where_the_page_is(run, tiny, tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr("palpate.paper.running.processes", no_processes)
    folder = tmp_path / "report"
    status, out, err = run("-o", folder, "--seeds", 2, "--workers", 1)
    assert status == 0
    assert "reproduced in 1 of 2 seeds" in " ".join(out.split())
    assert "4 claims: 0 reproduced, 2 partly reproduced" in out
    assert out.splitlines()[-1] == f"page: {folder / 'report.html'}"
    assert err.splitlines()[-1].endswith("6 of 6 tasks")
    status, out, err = run("-o", folder, "--seeds", 2, "--only", "b")
    assert err == "2 of 2 outcomes reused from an earlier run by the same code\n"
    assert "2 claims" in out


@pytest.mark.parametrize("module, extra", [("matplotlib", "figures"), ("mujoco", "lab")])
def test_a_missing_extra_is_named_before_the_work(run, tmp_path, without, module, extra):
    without(module)
    status, out, err = run("-o", tmp_path / "report")
    assert (status, out, err.count("\n"), f"palpate[{extra}]" in err) == (2, "", 1, True)
    assert not (tmp_path / "report").exists()
