"""Experiments on all cores: what is finished stays on disk, whatever happens then."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from paper_cases import Tiny, no_processes

from palpate import PalpateError, RecordingError
from palpate.paper import Claim, running
from palpate.paper.judging import judge, number
from palpate.paper.report import figures_of
from palpate.paper.running import run_paper


def run(folder, *experiments, seeds=2, **options):
    return run_paper(experiments, seeds=seeds, folder=folder, workers=1, **options)


def made(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "outcomes").iterdir()}


@pytest.fixture
def stored(tmp_path):
    (tmp_path / "outcomes").mkdir()
    running.write_outcome(tmp_path, Tiny(), Tiny().run(1))
    return tmp_path, running.path_of(tmp_path, "tiny", 1)


def test_an_outcome_survives_being_written_and_read(stored):
    folder, path = stored
    before, after = Tiny().run(1), running.read_outcome(folder, Tiny(), 1)
    assert after.numbers["third"] == before.numbers["third"]  # to the last bit: judges ask for it
    assert after.curves["line"][2] == pytest.approx(4.0 / 3.0, rel=1e-4)
    assert math.isnan(after.curves["line"][1])  # null on disk
    assert Tiny().findings(after) == Tiny().findings(before)
    first = path.read_bytes()
    assert b"NaN" not in first
    running.write_outcome(folder, Tiny(), after)
    assert path.read_bytes() == first


CHANGES = [
    {"provenance": {"versions": {"palpate": "0.0.1"}}}, {"seed": 2}, {"provenance": None},
    "", "{", "[]", "{}", '{"provenance": 1}', "null",
]  # fmt: skip


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_an_outcome_of_another_version_or_seed_or_a_damaged_one_is_not_reused(stored, change):
    folder, path = stored
    assert running.read_outcome(folder, Tiny(seconds=1e-9), 1) is None  # of another setting
    assert running.read_outcome(folder, Tiny(), 2) is None  # absent
    assert running.read_outcome(folder, Tiny(), 1) is not None
    whole = json.loads(path.read_text(encoding="utf-8"))
    content = change if isinstance(change, str) else json.dumps({**whole, **change})
    path.write_text(content, encoding="utf-8")
    assert running.read_outcome(folder, Tiny(), 1) is None
    root = Path(running.__file__).parents[1]  # what judges and reports is other code
    assert all((root / name).exists() for name in running.NOT_MEASURING)


def test_figures_are_reused_only_as_a_pair_of_as_many_seeds(tmp_path):
    assert not running.figures_are_current(tmp_path, Tiny(), 1)
    running.write_figures(tmp_path, Tiny(), 1, ("<svg/>", "<svg/>"))
    assert running.figures_are_current(tmp_path, Tiny(), 1)
    assert not running.figures_are_current(tmp_path, Tiny(), 2)
    assert not running.figures_are_current(tmp_path, Tiny(seconds=1e-9), 1)
    figures_of(tmp_path, "tiny")[1].write_text("<svg/>", encoding="utf-8")
    assert not running.figures_are_current(tmp_path, Tiny(), 1)


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
    begun = {"begun": lambda report: taken.append(len(report.outcomes))}
    again = run(folder, Tiny("a"), Tiny("b"), **begun)
    assert (taken, again.summary) == ([4], report.summary)
    assert again.judgements[0].held == 1
    monkeypatch.setattr(Tiny, "claims", (Claim("even", "I", "the seed is odd, it seems"),))
    monkeypatch.setattr(Tiny, "judges", {"even": judge(number("third") > -1.0)})
    assert run(folder, Tiny("a"), Tiny("b")).judgements[0].held == 2
    assert made(folder) == before
    assert "odd, it seems" in (folder / "report.html").read_text(encoding="utf-8")


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
from paper_cases import Tiny
from palpate import cli, paper
paper.EXPERIMENTS = {"a": Tiny("a"), "b": Tiny("b", group="slow", seconds=60.0, slow_from=2)}
sys.argv = ["palpate", "paper", "--seeds", "4", "--workers", "1", "-o", sys.argv[1]]
cli.main()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signal can be sent there")
@pytest.mark.parametrize("how", ["to the parent", "as a terminal does", "kill -9"])
def test_a_run_that_is_stopped_ends_at_once_and_is_resumed(tmp_path, how):
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
    number_of_signal = signal.SIGKILL if how == "kill -9" else signal.SIGINT
    (os.killpg if how == "as a terminal does" else os.kill)(process.pid, number_of_signal)
    # Ends when the workers, which hold its streams, are gone too.
    out, err = process.communicate(timeout=30.0)
    before = made(tmp_path)
    assert "b-seed2.json" not in before
    if how != "kill -9":
        assert (process.returncode, out) == (130, "")
        assert "Traceback" not in err
        assert err.splitlines()[-1].startswith("palpate: interrupted")
        assert not [name for name in before if name.startswith(".")]
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "Not finished" in page
        assert "b (2 of 4 seeds)" in page
        assert 'id="a"' in page  # what is finished can be read
    if how == "as a terminal does":  # what is left does not depend on who was interrupted
        return
    taken = []
    begun = {"begun": lambda report: taken.append(len(report.outcomes))}
    run(tmp_path, Tiny("a"), SLOW, seeds=1, **begun)
    assert taken == [2]
    after = made(tmp_path)
    assert {name: after[name] for name in before} == before
