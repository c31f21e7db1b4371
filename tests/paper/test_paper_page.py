"""``python -m paper``: judges, what runs and stays on disk, and a page that needs nothing else."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from paper_cases import Tiny, no_processes
from report_reading import Reading

from palpate import PalpateError, RecordingError, lab, write_contact
from paper import command, experiments, running
from paper.choices import DRAWS, Share, draws
from paper.experiment import Claim, all_claims, claims_file
from paper.experiments import EXPERIMENTS
from paper.judging import (
    NEVER,
    SeedAnswer,
    about,
    between,
    farthest_from,
    increasing,
    judge,
    largest,
    least,
    number,
)
from paper.report import (
    SIGNS,
    Judgement,
    Report,
    Reproduction,
    Section,
    abstract,
    figures_of,
    not_held,
    write_report,
)
from paper.running import run_paper

DRAWING = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg" width="9pt" height="9pt" viewBox="0 0 9 9">
<defs><clipPath id="clip"><path d="M 0 0"/></clipPath></defs>
<path d="m0 0 9 9" clip-path="url(#clip)" stroke="#0072b2"/>
</svg><!-- a remark -->
"""


@pytest.fixture
def report(tmp_path):
    every = [Tiny("fig01"), Tiny("fig02"), Tiny("fig09"), Tiny("fig03")]
    seeds = {"fig01": 3, "fig02": 3, "fig09": 1, "fig03": 3}
    outcomes = {(e.name, seed): e.run(seed) for e in every for seed in range(seeds[e.name])}
    failures = ["fig08, seed 2: <broken>"]
    report = Report(every, 3, tmp_path, outcomes, {"fig01", "fig02"}, failures)
    for name in report.rendered:
        for path in figures_of(tmp_path, name):
            path.write_text(DRAWING, encoding="utf-8")
    write_report(report)
    return report


@pytest.fixture
def page(report):
    return Reading((report.folder / "report.html").read_text(encoding="utf-8"))


def test_the_page_has_every_claim_with_its_verdict(page, report):
    for each in report.judgements:
        for words in (each.claim.words, each.verdict_text, each.claim.where, each.ours_text):
            assert words in page.words
        assert each.remark in page.words
    for section in report.sections:
        for table in (*section.experiment.tables(section.say), section.say.every_number()):
            for words in (
                table.title,
                table.note,
                *table.header,
                *(c for row in table.rows for c in row),
            ):
                assert words in page.words
    for words in ("fig09 (1 of 3 seeds)", "fig03 (no figure)", "fig08, seed 2: <broken>"):
        assert words in page.words
    for ours in ("hunt-crossley", "K 2000", "0.5 N", "P₀", "palpate", "processors"):
        assert ours in page.words
    assert "{'" not in page.words
    text = (report.folder / "report.html").read_text(encoding="utf-8")
    assert text.count('role="img" aria-label="A line &amp; nothing else."') == 2
    assert 'stroke="var(--drawing-line-0)"' in text  # a drawing takes the page's colours
    assert "fig01-drawing-clip" in text


def test_the_page_is_self_contained_and_its_links_work(report, page):
    text = (report.folder / "report.html").read_text(encoding="utf-8")
    assert page.open == re.findall("<script|<link|<img", text) == []
    assert len(page.names) == len(set(page.names))
    assert page.references <= {f"#{name}" for name in page.names}
    assert text.count("<th") == text.count("<thead") + text.count('<th scope="')
    assert text.count("<caption") == text.count("<table") > 5


def test_the_abstract_names_every_claim_that_can_be_checked_once():
    lines = [line["claims"].split() for line in claims_file()["abstract"].values()]
    every = {
        f"{n}.{c.key}": EXPERIMENTS[n].judges[c.key] for n in EXPERIMENTS for c in all_claims()[n]
    }
    assert sorted(key for line in lines for key in line) == sorted(
        key for key, judge in every.items() if judge.conditions
    )
    assert len(lines) == 10

    def judged(key, holds):
        name, _, short = key.partition(".")
        return Judgement(name, Claim(short, "V", "words"), (SeedAnswer(holds),))

    for holds, counted in (((True, True), (2, 2)), ((True, False), (1, 2)), ((None, True), (1, 1))):
        (line,) = abstract([judged(*each) for each in zip(lines[0], holds, strict=False)])
        assert line[2:] == counted
    assert list(abstract([judged(lines[1][0], None)])) == []


def test_the_data_file_holds_every_claim_with_its_reason(report, page):
    markdown = (report.folder / "claims.md").read_text(encoding="utf-8")
    judged = {claim.words for claims in all_claims().values() for claim in claims}
    for why, sentences in not_held().items():
        for where, words in sentences:
            assert where.partition("-")[0] in ("II", "III", "IV", "V", "VI", "VII", "VIII")
            assert words not in judged
            assert all(words in text and why in text for text in (page.words, markdown))
    whole = json.loads((report.folder / "report.json").read_text(encoding="utf-8"))
    first, outcome = whole["claims"][0], whole["experiments"][0]["outcomes"][2]
    assert [claim["words"] for claim in whole["claims"]] == [
        each.claim.words for each in report.judgements
    ]
    assert first["ours"] == {"median": 1.0, "least": 0.0, "largest": 2.0}
    assert (first["verdict"], first["seeds_held"]) == ("partly reproduced", 2)
    assert first["seen"] == "never: never; remainder: 0 (0 to 1.00)"
    assert outcome["findings"]["even"] == {"holds": True, "ours": 2}
    numbers = {"seed [m]": 2, "remainder": 0, "third": 0.666666667, "never [s]": None}
    assert outcome["numbers"] == numbers
    assert sum(whole["verdicts"].values()) == len(whole["claims"]) == 6
    rows = [line.replace("\\|", "") for line in markdown.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + len(report.judgements)
    assert {row.count("|") for row in rows} == {8}


@pytest.fixture
def run(capsys):
    """``python -m paper`` in this process: exit status, standard output, standard error."""

    def call(*arguments) -> tuple[int, str, str]:
        return (command.main([*map(str, arguments)]), *capsys.readouterr())

    return call


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(experiments, "EXPERIMENTS", {name: Tiny(name) for name in ("a", "b")})


def test_it_prints_the_claims_and_where_the_page_is(run, tiny, tmp_path, monkeypatch):
    monkeypatch.setattr("paper.running.processes", no_processes)
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


def test_it_judges_draws_of_what_the_paper_leaves_open(run, tiny, tmp_path, monkeypatch):
    monkeypatch.setattr("paper.running.processes", no_processes)
    folder = tmp_path / "report"
    status, out, err = run("-o", folder, "--seeds", 2, "--settings", 3)
    assert (status, out) == (0, "a.even: 2 of 3\nb.even: 2 of 3\n")
    assert err.splitlines()[-1] == "draws: 3 of 3 tasks"
    answers = json.loads((folder / "settings.json").read_text(encoding="utf-8"))
    assert answers == {"a.even": "101", "b.even": "101"}


def test_the_benchmark_compares_the_methods_on_real_recordings(run, tmp_path):
    """Without simulation, and by the file alone; here of a ball, whose truth nobody uses."""
    bench = lab.Bench(lab.BALL, lab.THREE_SINES, lab.IdealProbe())
    good, bad = tmp_path / "ball.csv", tmp_path / "bad.csv"
    write_contact(bench.run(1, seconds=6.0).contact, good)
    bad.write_text("nothing\n")
    status, out, err = run("--recording", good, bad, "-o", tmp_path / "report")
    assert status == 0
    assert f"{bad}: skipped: " in err
    numbers = json.loads((tmp_path / "report" / "recordings.json").read_text("utf-8"))["ball"]
    assert numbers["final palpate [%]"] < numbers["final single stage [%]"]
    assert numbers["spread single stage K [%]"] < 5.0 < numbers["spread double stage K [%]"]
    page = (tmp_path / "report" / "recordings.md").read_text("utf-8")
    said = out.partition("where palpate loses:\n")[2].splitlines()
    assert page.partition("## Where palpate loses\n\n")[2].splitlines() == (
        [f"- {words}" for words in said] or ["Nowhere."]
    )
    assert run("--recording", bad, "-o", tmp_path / "other")[0] == 2


REFUSED = {
    "--only fig05 fig99": ["fig99", "--only", "fig05, fig06"],
    "--only fig05 -o file/below": ["file/below"],
    "--only fig05 --seeds 0": ["--seeds", '"0"'],
    "--only fig05 --workers many": ["--workers", '"many"'],
    "--onyl fig05": ["--onyl"],
}


@pytest.mark.parametrize("words", REFUSED)
def test_a_bad_option_is_refused_and_writes_nothing(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    status, out, err = run(*words.split())
    assert (status, out, err.count("\n"), err[:7]) == (2, "", 1, "paper: ")
    assert all(expected in err for expected in REFUSED[words])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.long
def test_the_module_runs_and_shows_its_help():
    module = [sys.executable, "-m", "paper", "--help"]
    root = Path(__file__).parents[2]
    shown = subprocess.run(module, cwd=root, capture_output=True, text=True, check=True).stdout
    assert shown.startswith("Usage: python -m paper")
    assert all(option in shown for option in ("--only", "--output -o", "--seeds", "--workers"))


@pytest.mark.parametrize("module, extra", [("matplotlib", "figures"), ("mujoco", "lab")])
def test_a_missing_extra_is_named_before_the_work(run, tmp_path, without, module, extra):
    without(module)
    status, out, err = run("-o", tmp_path / "report")
    assert (status, out, err.count("\n"), f".[{extra}]" in err) == (2, "", 1, True)
    assert not (tmp_path / "report").exists()


NUMBERS = {
    "scatter α = 5 K [%]": 1.0,
    "scatter α = 5 B [%]": 4.0,
    "scatter α = 5 n [%]": 5.0,
    "scatter α = 50 K [%]": 100.0,
    "time slow K [s]": math.nan,
    "time slow B [s]": 2.0,
    "bias": -3.0,
    "elsewhere bias": 4.0,
}
QUANTITIES = {
    "a name is the largest that it begins": ("scatter α = 5", 5.0),
    "of some symbols alone": ("scatter α = 5 K|B", 4.0),
    "what never happens is infinite": ("time slow", None),
    "the least": (least("scatter α = 5"), 1.0),
    "the largest and the least of several": (largest(least("scatter α = 5", 7.0), 6.0), 6.0),
    "names written as one": (least("scatter α = {5|50} K"), 1.0),
    "a ratio": (number("scatter α = 50") / least("scatter α = 5"), 100.0),
    "over nothing": (number("bias") / 0.0, None),
    "a multiple": (number("bias") * 10.0, -30.0),
    "the farthest": (farthest_from(3.2, "scatter α = 5"), 1.0),
}


@pytest.mark.parametrize("quantity, value", QUANTITIES.values(), ids=QUANTITIES)
def test_a_quantity_is_computed_from_the_numbers(quantity, value):
    assert judge(quantity)(NUMBERS) == SeedAnswer(None, value)  # without conditions: not checked


BOUNDS = {
    "above": (number("value") > "bias", (-2.9,), (-3.0,)),
    "below": (number("value") < 4.0, (3.9,), (4.0,)),
    "at least": (number("value") >= 4.0, (4.0,), (3.9,)),
    "at most": (number("value") <= "scatter α = 5", (5.0,), (5.1,)),
    "below all": (number("value") < "scatter α = 5{ K| B}", (0.9,), (1.0, 3.9)),
    "between": (between("value", 1.0, 2.0), (1.0, 2.0), (0.9, 2.1)),
    "about": (about("value", 90.0), (45.0, 180.0), (44.0, 181.0)),
    "happens": (number("value") < NEVER, (0.0,), (math.inf,)),
    "never": (number("value") >= NEVER, (math.inf,), (0.0,)),
    "increasing": (increasing("bias", "value", "time slow"), (0.0,), (-3.0, math.inf)),
}


@pytest.mark.parametrize("bound, kept, broken", BOUNDS.values(), ids=BOUNDS)
def test_a_bound_is_kept_or_broken_and_all_have_to_be_kept(bound, kept, broken):
    for values, holds in ((kept, True), (broken, False)):
        for value in values:
            numbers = {**NUMBERS, "value": value}
            assert judge(bound)(numbers).holds is holds
            assert judge("bias", number("bias") < 0.0, bound)(numbers).holds is holds
            assert judge("bias", number("bias") > 0.0, bound)(numbers).holds is False


def test_unknown_quantities_are_not_checked():
    numbers = {**NUMBERS, "error K [%]": math.nan, "error B [%]": 1.0}
    for unknown in (number("error") > 3.0, number("bias") < "error", largest("bias", "error") < 3):
        assert judge(unknown, number("bias") < 0.0)(numbers).holds is None
    assert judge(number("bias") < "error").describe([numbers]) == "error: unknown"
    assert judge()(NUMBERS) == SeedAnswer(None)
    with pytest.raises(KeyError, match="scatter α = 6"):
        judge("scatter α = 6")(NUMBERS)


def test_the_words_say_every_other_number_that_was_used_with_its_unit_once():
    words = judge(
        number("scatter α = 50") / "scatter α = 5 K|B" > 3.0,
        number("scatter α = 50") > "bias",
        beside=["time {slow|slow}", least("time slow")],
    ).describe([NUMBERS])
    assert words == (
        "scatter α = 50: 100 %; scatter α = 5 K or B: 4.00 %; time slow: never; "
        "least time slow: 2.00 s; bias: −3.00"
    )
    assert judge(number("bias") > "bias").describe([NUMBERS]) == ""
    seeds = [{"bias": 0.0, "time [s]": value} for value in (1.0, math.nan, 3.0)]
    assert judge("bias", beside="time").describe(seeds) == "time: 3.00 s (1.00 to never)"


def test_a_second_material_is_judged_beside_the_first():
    two = judge(number("bias") < 0.0, elsewhere="elsewhere")
    assert two(NUMBERS).holds is True
    assert two.describe([NUMBERS]) == "For the elsewhere the claim does not hold (4.00)"
    seeds = [NUMBERS, {**NUMBERS, "elsewhere bias": -4.0}]
    assert (
        two.describe(seeds)
        == "For the elsewhere the claim holds in 1 of 2 seeds (0 (−4.00 to 4.00))"
    )


CLAIM = Claim("key", "V", "words", unit="mm")
GROWING = number("n") >= 1.5
JUDGED_ON_RECORDINGS = {"even": judge(number("rmse") < 5.0, recorded=GROWING), "lost": judge()}
VERDICTS = {
    "all seeds hold": ((True, True), Reproduction.REPRODUCED, "reproduced"),
    "no seed holds": ((False, False), Reproduction.NOT_REPRODUCED, "not reproduced"),
    "some hold": ((True, False, True), Reproduction.PARTLY, "reproduced in 2 of 3 seeds"),
    "none can tell": ((None, None), Reproduction.UNCHECKED, "cannot be checked"),
    "one cannot tell": (
        (True, None),
        Reproduction.REPRODUCED,
        "reproduced (checked in 1 of 2 seeds)",
    ),
}


@pytest.mark.parametrize("holds, verdict, words", VERDICTS.values(), ids=VERDICTS)
def test_a_verdict_counts_the_seeds_that_can_tell(holds, verdict, words):
    judgement = Judgement("fig", CLAIM, tuple(SeedAnswer(each) for each in holds))
    assert (judgement.verdict, judgement.verdict_text, judgement.ours) == (verdict, words, None)
    assert len({SIGNS[each] for each in Reproduction}) == 5


@pytest.mark.parametrize("holds", [True, False])
@pytest.mark.parametrize("held", [7, 8])
def test_a_failed_claim_holds_elsewhere_if_a_fifth_of_draws_hold(holds, held):
    share = Share(tuple(k < held for k in range(DRAWS)))
    judgement = Judgement("fig", CLAIM, (SeedAnswer(holds),), share=share)
    fails = Reproduction.ELSEWHERE if held == 8 else Reproduction.NOT_REPRODUCED
    assert judgement.verdict is (Reproduction.REPRODUCED if holds else fails)
    assert judgement.settings_text.startswith(f"{held} of 40; ")


def test_a_share_says_which_setting_separates_best():
    few = [each.drawn["P₀ of the single stage"] for each in draws()]
    share = Share(tuple(size < 3.0 for size in few))
    assert share.where.startswith(f"{sum(share.held)} of {sum(share.held)} with P₀ of the single")
    assert Share((True, True)).where == Share((False,)).where == ""


def test_a_claim_on_recordings_counts_those_that_meet_its_condition(tmp_path, monkeypatch):
    every = {f"file {k}": {"rmse [%]": float(k), "n": k / 2.0} for k in range(6)}
    monkeypatch.setattr("paper.report.measured", lambda: every)
    experiment = Tiny()
    object.__setattr__(experiment, "judges", JUDGED_ON_RECORDINGS)
    (even, lost) = Section(experiment, [experiment.run(0)]).judgements
    assert (even.verdict_text, even.ours) == ("reproduced in 2 of 3 recordings", (4.0, 3.0, 5.0))
    assert lost.verdict is Reproduction.UNCHECKED
    monkeypatch.setattr("paper.report.measured", dict)
    assert Section(experiment, [experiment.run(0)]).judgements[0].verdict is lost.verdict


def ran(folder, *experiments, seeds=2, **options):
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
def test_only_outcomes_of_this_version_and_seed_are_reused(stored, change):
    folder, path = stored
    assert running.read_outcome(folder, Tiny(seconds=1e-9), 1) is None  # of another setting
    assert running.read_outcome(folder, Tiny(), 2) is None  # absent
    assert running.read_outcome(folder, Tiny(), 1) is not None
    whole = json.loads(path.read_text(encoding="utf-8"))
    content = change if isinstance(change, str) else json.dumps({**whole, **change})
    path.write_text(content, encoding="utf-8")
    assert running.read_outcome(folder, Tiny(), 1) is None
    # The code that judges and reports may change.
    beside = {root.name: root.parent for root in running.ROOTS}
    assert all((beside[name.split("/")[0]] / name).exists() for name in running.NOT_MEASURING)


@pytest.mark.long
def test_a_second_run_of_the_paper_repeats_no_experiment(tmp_path, monkeypatch):
    folder, steps, taken = tmp_path / "new" / "report", [], []
    report = ran(folder, Tiny("a"), Tiny("b"), progress=lambda *step: steps.append(step))
    assert [section.experiment.name for section in report.sections] == ["a", "b"]
    assert [outcome.seed for outcome in report.sections[0].outcomes] == [0, 1]
    assert [step[1:] for step in steps] == [(done, 6) for done in range(1, 7)]
    files = {path.name for path in folder.iterdir()}
    assert files == {"a.svg", "a-dark.svg", "b.svg", "b-dark.svg", "claims.md", "outcomes",
                     "report.html", "report.json"}  # fmt: skip
    before = made(folder)
    monkeypatch.setattr("paper.running.processes", None)  # none is started
    begun = {"begun": lambda report: taken.append(len(report.outcomes))}
    again = ran(folder, Tiny("a"), Tiny("b"), **begun)
    assert (taken, again.summary) == ([4], report.summary)
    assert again.judgements[0].held == 1
    monkeypatch.setattr(Tiny, "claims", (Claim("even", "I", "the seed is odd, it seems"),))
    monkeypatch.setattr(Tiny, "judges", {"even": judge(number("third") > -1.0)})
    assert ran(folder, Tiny("a"), Tiny("b")).judgements[0].held == 2
    assert made(folder) == before
    assert "odd, it seems" in (folder / "report.html").read_text(encoding="utf-8")


def test_a_failure_names_experiment_and_seed_and_the_rest_is_done(tmp_path, monkeypatch):
    monkeypatch.setattr("paper.running.processes", no_processes)
    experiments = Tiny("bad", fails_at=1), Tiny("ugly", undrawable=True), Tiny("good")
    with pytest.raises(PalpateError, match=r"^bad, seed 1: ArithmeticError: no such square") as end:
        ran(tmp_path, *experiments)
    assert "(and 1 more)" in str(end.value)
    whole = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [each["name"] for each in whole["experiments"]] == ["ugly", "good"]
    assert [words.split(":")[0] for words in whole["failures"]] == ["bad, seed 1", "ugly, figure"]
    assert whole["unfinished"] == ["bad (1 of 2 seeds)", "ugly (no figure)"]


def test_a_folder_that_cannot_be_written_is_said_before_the_work(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(RecordingError, match="file"):
            ran(folder, Tiny(seconds=1e6))


def test_a_foreign_file_is_never_replaced(
    tmp_path,
):
    for name in ("report.html", "claims.md", "a-dark.svg"):
        (tmp_path / name).write_text("mine", encoding="utf-8")
        with pytest.raises(RecordingError, match=f"{name}: palpate did not write this file"):
            ran(tmp_path, Tiny("a"))
        assert [path.name for path in tmp_path.iterdir()] == [name]
        (tmp_path / name).unlink()


SLOW = Tiny("b", group="slow", seconds=60.0, slow_from=2)
COMMAND = """
import sys
from paper_cases import Tiny
from paper import command, experiments
experiments.EXPERIMENTS = {"a": Tiny("a"), "b": Tiny("b", group="slow", seconds=60.0, slow_from=2)}
sys.exit(command.main(["--seeds", "4", "--workers", "1", "-o", sys.argv[1]]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signal can be sent there")
@pytest.mark.parametrize("how", ["to the parent", "as a terminal does", "kill -9"])
def test_a_run_that_is_stopped_ends_at_once_and_is_resumed(tmp_path, how):
    here = Path(__file__).parent
    search = [str(here), str(here.parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
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
        assert err.splitlines()[-1].startswith("paper: interrupted")
        assert not [name for name in before if name.startswith(".")]
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "Not finished" in page
        assert "b (2 of 4 seeds)" in page
        assert 'id="a"' in page  # what is finished can be read
    if how == "as a terminal does":  # what is left does not depend on who was interrupted
        return
    taken = []
    begun = {"begun": lambda report: taken.append(len(report.outcomes))}
    ran(tmp_path, Tiny("a"), SLOW, seeds=1, **begun)
    assert taken == [2]
    after = made(tmp_path)
    assert {name: after[name] for name in before} == before
