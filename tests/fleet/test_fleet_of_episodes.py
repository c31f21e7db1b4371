"""Fleets over data sets of robot learning: a row for each episode, and the card."""

import re

import numpy as np
import pyarrow as pa
import pytest
from dataset_files import episodes, write_lerobot_2, write_lerobot_3, write_robomimic
from fleets import rows

from palpate.fleet.card import card_of, find_groups
from palpate.fleet.files import list_sources, read_results
from palpate.fleet.rows import table_of_rows
from palpate.fleet.running import identify_batch
from palpate.fleet.tasks import MOST_DIAGNOSED, ContactSource, Settings, batches, default_diagnosis

SIX = episodes()


@pytest.mark.long
def test_each_episode_is_a_row_with_its_verdict(run, tmp_path, threaded):
    write_lerobot_3(tmp_path / "set", SIX, in_a_file=4)
    folder = tmp_path / "rows"
    status, out, _ = run("fleet", tmp_path / "set", "-o", folder, "--workers", 1)
    assert status == 0
    words = [line for line in out.splitlines() if line.startswith("set [")]
    assert ["no contact" in line for line in words] == [each.law is None for each in SIX]
    assert sum("N/m  " in line and "trust" in line for line in words) == 4
    assert "failed" not in out
    card = (folder / "card.md").read_text()
    assert "| episodes that touch | 4 of 6 (66.7 %); 2 in free air |" in card
    assert "Damping at 30 Hz: a force that is one sample (33.3 ms) late" in card
    assert "<h1>Data card: set</h1>" in (folder / "card.html").read_text()
    table = read_results(folder)
    assert table["index"].to_pylist() == [*range(6)]
    for row, each in zip(table.to_pylist(), SIX, strict=True):
        assert row["checked"] == "full"
        if each.law is None:
            assert row["error_kind"] == "NoContactError"
            continue
        stiffness = each.law.at_rest(row["depth"])[1]
        bar = np.hypot(row["stiffness_standard_error"], row["stiffness_systematic"])
        assert abs(row["stiffness"] - stiffness) < 3.0 * bar
        assert abs(row["rate"] - 30.0) < 1e-3
        assert abs(row["largest_force"] - each.force[:, 2].max()) < 0.3


def test_episodes_keep_their_numbers_in_any_batches(tmp_path):
    write_lerobot_3(tmp_path / "set", SIX, in_a_file=4)
    sources = list_sources([tmp_path / "set/data/chunk-000/file-001.parquet"])
    tables = [
        identify_batch(batch.table, Settings(diagnosis="full"))
        for batch in batches(sources, [10.0])
    ]
    assert [row["index"] for table in tables for row in table.to_pylist()] == [4, 5]


def test_a_missing_file_is_the_error_of_its_episode_alone(tmp_path):
    write_lerobot_2(tmp_path / "set", SIX)
    (tmp_path / "set/data/chunk-000/episode_000003.parquet").unlink()
    [batch] = batches(list_sources([tmp_path / "set"]), [1e-6])
    errors = identify_batch(batch.table, Settings()).column("error").to_pylist()
    assert [error is None for error in errors] == [True, True, False, False, False, True]
    assert "is missing" in errors[3]


def test_a_folder_lists_its_data_sets_and_recordings_each_once(tmp_path):
    write_lerobot_2(tmp_path / "all/set", SIX)
    write_robomimic(tmp_path / "all/demos.hdf5", SIX[:2])
    (tmp_path / "all/touch.csv").write_text("time,position,force\n")
    begin = len(f"{tmp_path}/all/")
    listed = [(each.name[begin:], each.kind) for each in list_sources([tmp_path])]
    assert listed == [("demos.hdf5", "episodes"), ("set", "episodes"), ("touch.csv", "file")]
    broken = tmp_path / "all/set/meta/info.json"
    broken.write_text("{")
    assert [each.kind for each in list_sources([tmp_path])] == ["episodes", "file", "file"]


def test_moderate_fleets_get_the_full_diagnosis():
    few, many = (
        ContactSource("set", "episodes", count) for count in (MOST_DIAGNOSED, MOST_DIAGNOSED + 1)
    )
    curves = ContactSource("map", "map", 10)
    answers = [default_diagnosis(each) for each in ([few], [many], [curves], [few, curves])]
    assert answers == ["full", "input", "input", "input"]


@pytest.mark.long
def test_the_card_states_how_late_the_force_is(tmp_path):
    write_lerobot_3(tmp_path / "set", episodes(12, rate=50.0, samples=500, late=0.012), rate=50)
    [batch] = batches(list_sources([tmp_path / "set"]), [1e-6])
    card = card_of(identify_batch(batch.table, Settings(diagnosis="full")))
    words = dict(card.numbers)["force against position"]
    late, error = map(float, re.match(r"([\d.]+) ± ([\d.]+) ms late", words).groups())
    assert abs(late - 12.0) < 1.0
    assert error < 1.0
    assert any(each.startswith("The force is ") for each in card.cautions)


ONE_HEAP = {
    "normal": lambda random, n: random.normal(size=n),
    "uniform": lambda random, n: random.uniform(size=n),
    "skewed": lambda random, n: random.lognormal(0.0, 1.0, n),
    "heavy-tailed": lambda random, n: random.standard_t(2.0, n),
    "rounded": lambda random, n: np.round(2.0 * random.normal(size=n)),
    "alike": lambda random, n: np.full(n, 30.0),
}


@pytest.mark.parametrize("heap", ONE_HEAP)
@pytest.mark.parametrize("count", [1, 20, 100, 1000, 10_000])
def test_one_heap_of_values_is_never_split(heap, count):
    for seed in range(20):
        values = ONE_HEAP[heap](np.random.default_rng(seed), count)
        assert len(find_groups(values)) == 1


@pytest.mark.parametrize("count, share", [(20, 0.5), (40, 0.25), (100, 0.1), (10_000, 0.25)])
def test_two_heaps_of_values_are_told_apart_with_their_outliers(count, share):
    """12 deviations apart; a value in fifty is wild or missing."""
    lower = round(share * count)
    for seed in range(10):
        values = np.random.default_rng(seed).normal(size=count)
        values[lower:] += 12.0
        truth = values < 6.0
        wild = np.arange(0, count // 100) * 7 % count
        values[wild] = np.where(wild % 2 == 0, 1e4, np.nan)
        low, high = (np.delete(group, wild) for group in find_groups(values))
        assert (low == np.delete(truth, wild)).all()
        assert (high == ~low).all()


def test_the_card_gives_a_median_and_a_share_for_each_of_two_groups():
    count, random = 1000, np.random.default_rng(1)
    late = 0.3e-3 + 1e-3 * random.normal(size=count)
    late[:250] += 12e-3
    rate = np.where(np.arange(count) % 2, 30.0, 60.0)
    table = rows(
        np.full(count, 1000.0),
        np.full(count, 10.0),
        source=["set"] * count,
        index=list(range(count)),
        damping=[10.0] * count,
        rate=rate.tolist(),
        force_delay=late.tolist(),
        force_delay_standard_error=[1e-3] * count,
    )
    card = card_of(table)
    numbers = dict(card.numbers)
    words = numbers["force against position"]
    pattern = r"([\d.]+) ± ([\d.]+) ms late in (\d+) % "
    (first, one, most), (second, other, rest) = re.findall(pattern, words)
    assert (most, rest) == ("75", "25")
    assert abs(float(first) - 0.3) < 3.0 * float(one)
    assert abs(float(second) - 12.3) < 3.0 * float(other)
    assert numbers["sample rate"].startswith("median 30 Hz in 50 % and 60 Hz in 50 %, 5–95 %")
    [caution] = [each for each in card.cautions if each.startswith("The force is ")]
    assert "in 75 % and" in caution
    assert "a --delay for each group" in caution


def judged():
    """Rows of forty episodes: two failed, one of free air, four not to be trusted."""
    count, marks = 40, ["do-not-trust"] * 4 + ["with-care"] * 6 + ["trust"] * 30
    number = np.arange(count)
    table = rows(
        1000.0 + number,
        0.01 * (1000.0 + number),
        source=["a/set"] * count,
        index=number.tolist(),
        verdict_stiffness=marks,
        verdict_damping=["trust"] * count,
        findings=[[_finding("do-not-trust", "| bad")]] * 4
        + [[_finding("with-care", "poor")]] * 6
        + [[]] * 30,
        damping=[20.0] * count,
        damping_standard_error=[1.0] * count,
        rate=[10.0] * count,
        frequency=[4.0 * np.pi] * count,
        largest_force=(1.0 + number).tolist(),
    )
    failed = [
        {"source": "a/set", "index": k, "error": f"a/set: {words}", "error_kind": kind}
        for k, words, kind in (
            (40, "no column", "RecordingError"),
            (41, "no column", "RecordingError"),
            (42, "no contact found", "NoContactError"),
        )
    ]
    return pa.concat_tables([table, table_of_rows(failed, Settings())])


def _finding(severity, message):
    marks = {"stiffness": severity, "damping": "trust"}
    return {"severity": severity, "check": "misfit", "message": message, "remedy": None, **marks}


def test_the_card_of_a_fleet_counts_marks_and_names_the_worst():
    card = card_of(judged())
    numbers = dict(card.numbers)
    touching = "40 of 43 (93 %); 1 in free air, 2 that could not be identified"
    assert numbers["episodes that touch"] == touching
    assert numbers["peak force"].endswith("largest 40 in set [39]")
    assert numbers["verdicts on stiffness"] == "trust 30, with care 6, do not trust 4"
    assert numbers["force against position"].startswith("unknown")
    named = [(name, verdict) for name, verdict, *_ in card.worst]
    doubtful = [(f"set [{k}]", "do not trust") for k in range(4)]
    failed = [("set [40]", "failed"), ("set [41]", "failed")]
    assert sorted(named[:2]) == failed
    assert sorted(named[2:6]) == doubtful
    text = " ".join(card.cautions)
    assert "Damping at 10 Hz" in text
    assert "5 samples per period" in text
    assert "4 of 40 contacts have a stiffness marked do not trust" in text
    lines = card.markdown.splitlines()
    assert len(lines) <= 60
    assert r"misfit: \| bad" in card.markdown


def test_a_card_of_free_air_alone_says_so():
    table = judged().slice(42)
    assert card_of(table).cautions == (
        "No episode gave a stiffness: nothing can be said about what was touched.",
    )
