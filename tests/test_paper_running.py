"""Experiments on all cores: what is finished stays, whatever happens then."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from paper_cases import Tiny, no_processes

from palpate import PalpateError, RecordingError
from palpate.paper import Claim
from palpate.paper.judging import above, judge
from palpate.paper.running import run_paper


def run(folder, *experiments, seeds=2, **options):
    return run_paper(experiments, seeds=seeds, folder=folder, workers=1, **options)


def made(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "outcomes").iterdir()}


def test_a_run_writes_everything_and_a_second_runs_nothing_though_claims_are_reworded(
    tmp_path, monkeypatch
):
    folder, steps, taken = tmp_path / "new" / "report", [], []
    report = run(folder, Tiny("a"), Tiny("b"), progress=lambda *step: steps.append(step))
    assert [section.experiment.name for section in report.sections] == ["a", "b"]
    assert [outcome.seed for outcome in report.sections[0].outcomes] == [0, 1]
    assert [step[1:] for step in steps] == [(done, 6) for done in range(1, 7)]
    files = {path.name for path in folder.iterdir()}
    assert files == {"a.svg", "a-dark.svg", "b.svg", "b-dark.svg", "claims.md", "outcomes",
                     "report.html", "report.json"}  # fmt: skip
    before = made(folder)
    monkeypatch.setattr("palpate.paper.running.processes", None)  # none is started
    again = run(folder, Tiny("a"), Tiny("b"), begun=lambda run: taken.append(run.reused))
    assert taken == [4]
    assert again.summary == report.summary
    assert again.judgements[0].held == 1
    monkeypatch.setattr(Tiny, "claims", (Claim("even", "I", "the seed is odd, it seems"),))
    monkeypatch.setattr(Tiny, "judges", {"even": judge("third", above(-1.0))})
    assert run(folder, Tiny("a"), Tiny("b")).judgements[0].held == 2
    assert made(folder) == before
    assert "odd, it seems" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_same_seed_gives_the_same_files(tmp_path):
    for name in ("one", "two"):
        run(tmp_path / name, Tiny("a"), seeds=1)
    for name in ("a.svg", "a-dark.svg", "outcomes/a-seed0.json", "claims.md"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_a_failure_names_experiment_and_seed_and_the_rest_is_done(tmp_path, monkeypatch):
    monkeypatch.setattr("palpate.paper.running.processes", no_processes)
    experiments = Tiny("bad", fails_at=1), Tiny("ugly", undrawable=True), Tiny("good")
    with pytest.raises(PalpateError, match=r"^bad, seed 1: ArithmeticError: no such square") as end:
        run(tmp_path, *experiments)
    assert "(and 1 more)" in str(end.value)
    whole = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [each["name"] for each in whole["experiments"]] == ["ugly", "good"]
    assert [words.split(":")[0] for words in whole["failures"]] == ["bad, seed 1", "ugly, figure"]
    assert whole["unfinished"] == ["bad (1 of 2 seeds)", "ugly (no figure)"]


def test_a_folder_that_cannot_be_written_is_said_before_the_work(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(RecordingError, match="file"):
            run(folder, Tiny(seconds=1e6))


def test_a_file_that_palpate_did_not_write_is_not_replaced_and_that_is_said_before_the_work(
    tmp_path,
):
    for name in ("report.html", "claims.md", "a-dark.svg"):
        (tmp_path / name).write_text("mine", encoding="utf-8")
        with pytest.raises(RecordingError, match=f"{name}: palpate did not write this file"):
            run(tmp_path, Tiny("a"))
        assert [path.name for path in tmp_path.iterdir()] == [name]
        (tmp_path / name).unlink()


SLOW = Tiny("b", group="slow", seconds=60.0, slow_from=2)
COMMAND = """
import sys
from paper_cases import Tiny, no_processes
from palpate import cli, paper
paper.EXPERIMENTS = {"a": Tiny("a"), "b": Tiny("b", group="slow", seconds=60.0, slow_from=2)}
sys.argv = ["palpate", "paper", "--seeds", "4", "--workers", "1", "-o", sys.argv[1]]
cli.main()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no interrupt can be sent there")
@pytest.mark.parametrize("whole_group", [False, True], ids=["to the parent", "as a terminal does"])
def test_an_interrupted_run_ends_at_once_and_is_resumed(tmp_path, whole_group):
    search = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(search)}
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, str(tmp_path)], env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60.0
    while len(list(tmp_path.glob("outcomes/[ab]-seed*.json"))) < 6:  # the third of b takes long
        assert time.monotonic() < deadline
        time.sleep(0.02)
    (os.killpg if whole_group else os.kill)(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30.0)
    assert (process.returncode, out) == (130, "")
    assert "Traceback" not in err
    assert err.splitlines()[-1].startswith("palpate: interrupted")
    before = made(tmp_path)
    assert "b-seed2.json" not in before
    assert not [name for name in before if name.startswith(".")]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Not finished" in page
    assert "b (2 of 4 seeds)" in page
    assert 'id="a"' in page  # what is finished can be read
    if whole_group:  # what is left does not depend on who was interrupted
        return
    taken = []
    run(tmp_path, Tiny("a"), SLOW, seeds=1, begun=lambda run: taken.append(run.reused))
    assert taken == [2]
    after = made(tmp_path)
    assert {name: after[name] for name in before} == before
