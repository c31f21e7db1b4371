"""Fleets over data sets of robot learning: a row for each episode, and the card."""

import numpy as np
from dataset_files import episodes, write_lerobot_2, write_lerobot_3, write_robomimic

from palpate.fleet.files import read_results, sources_of
from palpate.fleet.running import identify_batch
from palpate.fleet.tasks import MOST_DIAGNOSED, ContactSource, Settings, batches, default_diagnosis

SIX = episodes()


def test_each_episode_has_a_row_with_its_verdict_and_free_air_has_no_contact(run, tmp_path):
    write_lerobot_3(tmp_path / "set", SIX, in_a_file=4)
    folder = tmp_path / "rows"
    status, out, _ = run("fleet", tmp_path / "set", "-o", folder, "--workers", 1)
    assert status == 0
    words = [line.split()[2:4] for line in out.splitlines() if line.startswith("set [")]
    assert [pair[0] for pair in words] == ["trust", "trust", "no", "trust", "no", "trust"]
    assert "failed" not in out
    table = read_results(folder)
    assert table["index"].to_pylist() == [*range(6)]
    for row, each in zip(table.to_pylist(), SIX, strict=True):
        assert row["checked"] == "full"
        if each.law is None:
            assert row["error_kind"] == "NoContactError"
            continue
        stiffness = each.law.at_rest(row["depth"])[1]
        bar = np.hypot(
            row["stiffness_at_depth_standard_error"], row["stiffness_at_depth_systematic"]
        )
        assert abs(row["stiffness_at_depth"] - stiffness) < 3.0 * bar
        assert abs(row["rate"] - 30.0) < 1e-3
        assert abs(row["largest_force"] - each.force[:, 2].max()) < 0.3


def test_episodes_of_one_file_keep_their_numbers_whatever_the_batches(tmp_path):
    write_lerobot_3(tmp_path / "set", SIX, in_a_file=4)
    sources = sources_of([tmp_path / "set/data/chunk-000/file-001.parquet"])
    tables = [
        identify_batch(batch.table, Settings(diagnosis="full"))
        for batch in batches(sources, [10.0])
    ]
    assert [row["index"] for table in tables for row in table.to_pylist()] == [4, 5]


def test_a_missing_file_is_the_error_of_its_episode_alone(tmp_path):
    write_lerobot_2(tmp_path / "set", SIX)
    (tmp_path / "set/data/chunk-000/episode_000003.parquet").unlink()
    [batch] = batches(sources_of([tmp_path / "set"]), [1e-6])
    errors = identify_batch(batch.table, Settings()).column("error").to_pylist()
    assert [error is None for error in errors] == [True, True, False, False, False, True]
    assert "is missing" in errors[3]


def test_a_folder_lists_its_data_sets_and_recordings_each_once(tmp_path):
    write_lerobot_2(tmp_path / "all/set", SIX)
    write_robomimic(tmp_path / "all/demos.hdf5", SIX[:2])
    (tmp_path / "all/touch.csv").write_text("time,position,force\n")
    listed = [(each.name[len(f"{tmp_path}/all/") :], each.kind) for each in sources_of([tmp_path])]
    assert listed == [("demos.hdf5", "episodes"), ("set", "episodes"), ("touch.csv", "file")]
    broken = tmp_path / "all/set/meta/info.json"
    broken.write_text("{")
    assert [each.kind for each in sources_of([tmp_path])] == ["episodes", "file", "file"]


def test_the_full_diagnosis_is_the_default_for_a_moderate_number_of_recordings():
    few, many = (
        ContactSource("set", "episodes", count) for count in (MOST_DIAGNOSED, MOST_DIAGNOSED + 1)
    )
    curves = ContactSource("map", "map", 10)
    answers = [default_diagnosis(each) for each in ([few], [many], [curves], [few, curves])]
    assert answers == ["full", "input", "input", "input"]
