"""The report: a page that needs nothing beside it, the same as JSON, and a table to paste."""

import json
from html.parser import HTMLParser

import pytest
from paper_cases import Tiny

from palpate.paper import EXPERIMENTS, Claim, Finding
from palpate.paper.experiment import all_claims, claims_file
from palpate.paper.outcomes import figures_of
from palpate.paper.report.abstract import abstract
from palpate.paper.report.contents import Report, Section
from palpate.paper.report.not_held import not_held
from palpate.paper.report.verdicts import Judgement, Verdict
from palpate.paper.report.writing import write_report

DRAWING = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg" width="9pt" height="9pt" viewBox="0 0 9 9">
<defs><clipPath id="clip"><path d="M 0 0"/></clipPath></defs>
<path d="m0 0 9 9" clip-path="url(#clip)" stroke="#0072b2"/>
</svg><!-- a remark -->
"""
VOID = {"meta", "img", "source", "br"}


class Page(HTMLParser):
    """Checks that what is opened is closed, and collects what a test asks about."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open, self.tags, self.words = [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture
def report():
    experiments = [Tiny("fig01"), Tiny("fig02")]
    sections = [Section.of(each, [each.run(seed) for seed in range(3)]) for each in experiments]
    return Report(tuple(sections), 3, ("fig09 (1 of 3 seeds)",), ("fig08, seed 2: <broken>",))


@pytest.fixture
def folder(tmp_path, report):
    for section in report.sections:
        for path in figures_of(tmp_path, section.experiment.name):
            path.write_text(DRAWING, encoding="utf-8")
    write_report(report, tmp_path)
    return tmp_path


@pytest.fixture
def page(folder):
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_the_page_says_every_claim_with_its_verdict(page, report):
    for each in report.judgements:
        for words in (each.claim.words, each.verdict_words, each.claim.where, each.ours_words):
            assert words in page.words
        assert each.remark in page.words
    assert "nobody <knows> | any more" in page.words


def test_the_page_shows_every_table_and_figure(page, report):
    for section in report.sections:
        for table in section.tables:
            for words in (table.title, table.note, *table.header, *sum(table.rows, ())):
                assert words in page.words
    drawings = [drawing for drawing in page.all("svg") if drawing["role"] == "img"]
    assert [each["aria-label"] for each in drawings] == ["A line & nothing else"] * 2
    assert len(page.all("figcaption")) == 2


def test_the_page_needs_nothing_beside_it(page):
    assert page.all("script") == page.all("link") == page.all("img") == []
    assert all(link["href"].startswith("#") for link in page.all("a"))


def test_every_link_has_its_target(page):
    targets = {attributes.get("id") for _, attributes in page.tags}
    assert {link["href"][1:] for link in page.all("a")} <= targets
    named = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(named) == len(set(named))


def test_every_heading_of_a_table_has_its_scope(page):
    assert page.all("table")
    assert all(heading["scope"] in ("row", "col") for heading in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table"))


def test_the_page_says_what_is_missing_and_what_failed(page):
    assert "fig09 (1 of 3 seeds)" in page.words
    assert "fig08, seed 2: <broken>" in page.words


def test_the_page_says_what_is_ours(page):
    for words in ("hunt-crossley", "stiffness 2000", "0.5 N", "P₀", "palpate", "processors"):
        assert words in page.words
    assert "{'" not in page.words


def test_a_drawing_takes_the_colours_of_the_page(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert 'stroke="var(--drawing-line-0)"' in text
    assert "fig01-drawing-clip" in text


def test_the_abstract_names_every_claim_that_can_be_checked_once():
    listed = [key for line in claims_file()["abstract"].values() for key in line["claims"].split()]
    every = {
        f"{name}.{claim.key}": EXPERIMENTS[name].judges[claim.key]
        for name, claims in all_claims().items()
        for claim in claims
    }
    assert sorted(listed) == sorted(key for key, judge in every.items() if judge.conditions)
    assert len(claims_file()["abstract"]) == 10


def test_a_line_of_the_abstract_is_the_verdict_of_its_claims_together():
    first, *others = (line["claims"].split() for line in claims_file()["abstract"].values())

    def judged(key, holds):
        name, _, short = key.partition(".")
        return Judgement(name, Claim(short, "V", "words"), (Finding(holds),))

    for holds, verdict in (
        ((True, True), Verdict.REPRODUCED),
        ((True, False), Verdict.PARTLY),
        ((False, False), Verdict.NOT_REPRODUCED),
        ((None, True), Verdict.REPRODUCED),
    ):
        (line,) = abstract([judged(*each) for each in zip(first, holds, strict=False)])
        assert line.verdict is verdict
    assert list(abstract([judged(others[0][0], None)])) == []


def test_what_is_held_against_nothing_is_said_with_its_reason(folder, page):
    markdown = (folder / "claims.md").read_text(encoding="utf-8")
    judged = {claim.words for claims in all_claims().values() for claim in claims}
    for why, sentences in not_held().items():
        for where, words in sentences:
            assert where.partition("-")[0] in ("II", "III", "IV", "V", "VI", "VII", "VIII")
            assert words not in judged
            assert words in page.words
            assert words in markdown
        assert why in page.words
        assert why in markdown


def test_the_json_holds_the_same(folder, report):
    whole = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert len(whole["not_held"]) == len(not_held())
    assert [claim["words"] for claim in whole["claims"]] == [
        each.claim.words for each in report.judgements
    ]
    assert whole["claims"][0]["ours"] == {"median": 1.0, "least": 0.0, "largest": 2.0}
    assert whole["claims"][0]["verdict"] == "partly reproduced"
    assert [each["name"] for each in whole["experiments"]] == ["fig01", "fig02"]
    outcome = whole["experiments"][0]["outcomes"][2]
    assert outcome["numbers"] == {
        "seed [m]": 2,
        "remainder": 0,
        "third": 0.666666667,
        "never [s]": None,
    }
    assert outcome["findings"]["even"] == {
        "holds": True,
        "ours": 2,
    }
    assert whole["claims"][0]["seen"] == "never: never; remainder: 0 (0 to 1.00)"
    assert sum(whole["verdicts"].values()) == len(whole["claims"]) == 4


def test_the_table_to_paste_has_a_row_of_equal_cells_for_each_claim(folder, report):
    lines = (folder / "claims.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) == 2 + len(report.judgements)
    assert {row.replace("\\|", "").count("|") for row in rows} == {7}
