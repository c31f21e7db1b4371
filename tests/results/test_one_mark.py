"""Every output prints a number with its own mark, that of its ``Quantity``."""

import json
import re
from html import unescape

import faults
import numpy as np
import pytest

import palpate
from palpate import Status
from palpate.findings import spoken
from palpate.fleet.card import card_of
from palpate.fleet.maps import map_of
from palpate.fleet.report import _tiles
from palpate.live.diagnosing import diagnose_samples
from palpate.live.sinks import diagnosis_fields
from palpate.live.view import fact_texts
from palpate.method.contact import Delay
from palpate.output import figures
from palpate.output.reports import identification

# Under half-space damping no sample shows a skew: this error leaves the sign of B' open, not K'.
DELAY = Delay(0.0, 8e-3)
HALF_SPACE = palpate.GeneralisedHuntCrossley(K=9000.0, n=1.4, B=60.0, p=0.4)
CIRCUMSTANCES = identification.Circumstances("today", "palpate identify", "")


@pytest.fixture(scope="module")
def contact():
    force = faults.pushed(faults.X, faults.V, HALF_SPACE)
    return faults.recorded(force, delay=(DELAY.seconds, DELAY.standard_error))


@pytest.fixture(scope="module")
def result(contact):
    return palpate.identify(contact)


@pytest.fixture(scope="module")
def table(contact):
    return palpate.identify_many([contact] * 2, diagnosis="full")


@pytest.fixture(scope="module")
def status(contact):
    signals = contact.time, contact.penetration, contact.velocity, contact.force
    samples = np.column_stack([*signals, np.full(len(contact), float(Status.UPDATED))])
    loop = {"method": "variable-projection", "generation": 0, "counts": {}, "sample_time": 1e-3}
    loop["force_delay"] = [DELAY.seconds, DELAY.standard_error]
    return {**loop, "page": diagnose_samples(samples, loop)}


def terminal(result, table, status):
    return result.summary().split("At working depth")[0]


def notebook(result, table, status):
    return identification.card(result).split("At working depth")[0]


def report(result, table, status):
    whole = identification.page(result, CIRCUMSTANCES)
    return whole[whole.index('<div class="tiles">') : whole.index("</header>")]


def figure(result, table, status):
    return " ".join(each.get_text() for each in figures.draw(result).texts)


def as_json(result, table, status):
    there = json.loads(json.dumps(result.as_dict()["working_depth"]))
    return "; ".join(f"{name} {there[name]['mark']}" for name in ("stiffness", "damping"))


def row(result, table, status):
    [first, _] = table.to_pylist()
    assert "verdict" not in first
    return f"stiffness {first['verdict_stiffness']} damping {first['verdict_damping']}"


def fleet_page(result, table, status):
    return " ".join(_tiles(table)).split("</div>")[-1]


def wire(result, table, status):
    said = diagnosis_fields(status["page"], status)
    assert said["damping_reason"]
    assert not said["stiffness_reason"]
    return f"stiffness {said['stiffness_verdict']} damping {said['damping_verdict']}"


def live_page(result, table, status):
    page = {"loop": status, "others": {"diagnosis": status["page"]}, "page": {}, "now": {}}
    page["depth"] = {"value": np.nan, "frequency": np.nan, "chosen": False}
    tiles = fact_texts(page, "contact")["working"]
    return "; ".join(f"{tile[0]} {tile[3]}" for tile in tiles)


OUTPUTS = [terminal, notebook, report, figure, as_json, row, fleet_page, wire, live_page]


@pytest.mark.parametrize("output", OUTPUTS, ids=lambda output: output.__name__)
def test_the_mark_beside_a_number_is_its_own(output, result, table, status):
    marks = result.stiffness.mark, result.damping.mark
    assert marks == ("trust", "do-not-trust")
    words = unescape(re.sub(r"<[^>]*>", " ", output(result, table, status))).lower()
    first, second = words.index("stiffness"), words.index("damping")
    for beside, mark in ((words[first:second], marks[0]), (words[second:], marks[1])):
        found = re.findall("do not trust|with care|trust", spoken(beside))
        assert found[:1] == [spoken(mark)]


def test_a_map_counts_the_findings_on_its_own_quantity(table):
    assert map_of(table, ["index"]).warnings == ()
    assert not map_of(table, ["index"]).mistrusted.any()
    damping = map_of(table, ["index"], of="damping")
    assert damping.mistrusted.all()
    assert "do not trust, precision: at 2 of 2 places" in damping.warnings


def test_a_card_has_both_marks(table):
    card = card_of(table)
    assert dict(card.numbers)["verdicts on stiffness"] == "trust 2, with care 0, do not trust 0"
    assert [marks for _, *marks, _ in card.worst] == [["trust", "do not trust"]] * 2


def test_a_number_is_a_float_and_a_part_has_its_own(result):
    assert (
        float(result.stiffness)
        == result.stiffness.value
        == result.working_depths[0].stiffness.value
    )
    parts = palpate.identify(faults.changed(0.3)).by_segment()
    assert {part.stiffness.mark for part in parts.segments} == {"trust"}
    assert parts.diagnosis.working_depth.stiffness.mark is None
    assert "2 segments: stiffness 2 trust; damping 2 trust" in parts.summary()
