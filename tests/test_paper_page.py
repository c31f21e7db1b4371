"""``palpate paper`` and its page, which needs nothing beside it, the same as JSON."""

import json
import re

import pytest
from paper_cases import Tiny, no_processes
from test_report_page import Reading

from palpate import paper
from palpate.paper import EXPERIMENTS, Claim, SeedAnswer
from palpate.paper.experiment import all_claims, claims_file
from palpate.paper.report import Judgement, Report, abstract, figures_of, not_held, write_report

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
    for name in report.drawn:
        for path in figures_of(tmp_path, name):
            path.write_text(DRAWING, encoding="utf-8")
    write_report(report)
    return report


@pytest.fixture
def page(report):
    return Reading((report.folder / "report.html").read_text(encoding="utf-8"))


def test_the_page_says_every_claim_with_its_verdict_table_and_figure(page, report):
    for each in report.judgements:
        for words in (each.claim.words, each.verdict_words, each.claim.where, each.ours_words):
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
    for ours in ("hunt-crossley", "stiffness 2000", "0.5 N", "P₀", "palpate", "processors"):
        assert ours in page.words
    assert "{'" not in page.words
    text = (report.folder / "report.html").read_text(encoding="utf-8")
    assert text.count('role="img" aria-label="A line &amp; nothing else."') == 2
    assert 'stroke="var(--drawing-line-0)"' in text  # a drawing takes the page's colours
    assert "fig01-drawing-clip" in text


def test_the_page_needs_nothing_beside_it_and_every_link_has_its_target(report, page):
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


def test_the_data_hold_the_same_and_what_is_held_against_nothing_with_its_reason(report, page):
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
    assert {row.count("|") for row in rows} == {7}


@pytest.fixture
def run(run):
    """``palpate paper`` with these arguments."""
    return lambda *arguments: run("paper", *arguments)


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(paper, "EXPERIMENTS", {name: Tiny(name) for name in ("a", "b")})


def test_it_prints_the_claims_and_where_the_page_is(run, tiny, tmp_path, monkeypatch):
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
