"""Outcomes on disk."""

import json
import math

import pytest
from paper_cases import Tiny

from palpate.paper import Finding
from palpate.paper import outcomes as on_disk


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "outcomes").mkdir()
    return tmp_path


def stored(folder, seed=1):
    experiment = Tiny()
    on_disk.write(folder, "tiny", seed, on_disk.as_text(experiment, experiment.run(seed)))
    return experiment, on_disk.path_of(folder, "tiny", seed)


def test_an_outcome_survives_being_written_and_read(folder):
    experiment, _ = stored(folder)
    before, after = experiment.run(1), on_disk.read(folder, experiment, 1)
    assert after.seed == 1
    assert after.findings == dict(before.findings)
    assert after.findings["lost"] == Finding(None)  # what was not measured stays unmeasured
    assert after.numbers["square"] == 1
    assert after.numbers["deep"]["list"][0] == pytest.approx(1.0 / 3.0, rel=1e-8)
    assert after.curves["line"][2] == pytest.approx(4.0 / 3.0, rel=1e-5)


def test_what_is_not_finite_is_null_on_disk_and_nan_in_memory(folder):
    experiment, path = stored(folder)
    text = path.read_text(encoding="utf-8")
    assert "NaN" not in text
    assert "Infinity" not in text
    after = on_disk.read(folder, experiment, 1)
    assert math.isnan(after.curves["line"][1])
    assert math.isnan(after.numbers["nothing"])
    assert math.isnan(after.numbers["deep"]["list"][1])


def test_written_again_after_reading_it_is_the_same_file(folder):
    experiment, path = stored(folder)
    again = on_disk.as_text(experiment, on_disk.read(folder, experiment, 1))
    assert again == path.read_text(encoding="utf-8")


def test_an_outcome_of_other_code_is_not_taken_over(folder):
    experiment, path = stored(folder)
    whole = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**whole, "made_by": "another version"}), encoding="utf-8")
    assert on_disk.read(folder, experiment, 1) is None


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"made_by": 1}', "null"])
def test_an_absent_or_damaged_outcome_is_not_taken_over(folder, content):
    experiment, path = stored(folder)
    path.write_text(content, encoding="utf-8")
    assert on_disk.read(folder, experiment, 1) is None
    assert on_disk.read(folder, experiment, 2) is None


def test_tables_are_taken_over_only_beside_their_figures(folder):
    experiment = Tiny()
    tables = experiment.tables([experiment.run(0)])
    on_disk.write_tables(folder, experiment, 1, tables)
    assert on_disk.read_tables(folder, experiment, 1) is None
    for path in on_disk.figures_of(folder, "tiny"):
        path.write_text("<svg/>", encoding="utf-8")
    assert on_disk.read_tables(folder, experiment, 1) == tables
    assert on_disk.read_tables(folder, experiment, 2) is None  # drawn of fewer seeds
