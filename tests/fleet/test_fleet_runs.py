"""A fleet on Dask: folders, schedulers, interruptions, and what is refused."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import zarr
from distributed import nanny
from fleets import LAW, contact, write_recordings, write_zarr

from palpate import FleetError, RecordingError, write_contact
from palpate.fleet import running
from palpate.fleet.files import Results, describe_array, list_sources, read_results, read_seconds
from palpate.fleet.running import identify_and_time, identify_batch
from palpate.fleet.tasks import Settings, batches, tasks_table

# Dask closes what it opened a moment after it says so.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    write_recordings(folder / "all", 3)
    (folder / "all" / "bad.csv").write_text("time_s,penetration_m\n1,2\n")
    (folder / "all" / "notes.md").write_text("of the day")
    write_zarr(folder / "all" / "array.zarr", 5)
    return folder / "all"


def test_a_folder_of_all_kinds_becomes_a_row_each(
    printed, refused, recordings, tmp_path, monkeypatch, threaded
):
    monkeypatch.setattr("palpate.output.reports.html.drawing", lambda *_: iter(()))
    results = tmp_path / "results"
    out = printed("fleet", recordings, "-o", results, "--workers", 1, "--report")
    assert "9 contacts in" in out
    assert any(line.split()[:3] == ["bad.csv", "–", "failed"] for line in out.splitlines())
    mark = "(?:no finding|flagged)"
    row = rf"\S+ ± .+ N/m +{mark} +\S+ ± .+ N·s/m +{mark} +\S+ Hz"
    assert len(re.findall(row, out)) == 8
    table = read_results(results)
    names = [name.rpartition("/")[2] for name in table.column("source").to_pylist()]
    assert names == ["array.zarr"] * 5 + ["bad.csv"] + [f"touch-{k:03d}.csv" for k in range(3)]
    errors = table.column("error").to_pylist()
    assert [error is None for error in errors] == [True] * 5 + [False] + [True] * 3
    assert read_seconds(results).num_rows == table.num_rows
    page = (results / "report.html").read_text()
    assert "bad.csv" in page
    assert "no force" in page

    before = {path: path.stat().st_mtime_ns for path in parts(results)}
    whole = json.loads(printed("fleet", recordings, "-o", results, "--json"))  # starts no worker
    assert [whole[k] for k in ("reused", "rows", "failures", "identified")] == [9, 0, 1, 8]
    assert {path: path.stat().st_mtime_ns for path in parts(results)} == before

    line = refused("fleet", recordings, "-o", results, "--method", "single-stage")
    assert 'run with method "auto", but this run has "single-stage"' in line


def begun(recordings, folder, **settings):
    sources, chosen = list_sources([recordings]), Settings(**settings)
    return Results.begin(folder, chosen, sources), sources, chosen


def finished(run, most=None, *, seconds=10.0, workers=1):
    """Identify what is left of a run, or so many batches of it; which contacts these are."""
    results, sources, settings = run
    waiting = batches(sources, [seconds] * len(sources), workers, results.done())[:most]
    for batch in waiting:
        results.write(batch, *identify_and_time(batch.table, settings))
    return [k for batch in waiting for k in range(batch.first, batch.end)]


@pytest.mark.long  # in a worker process
def test_file_names_that_are_not_utf_8_are_ordinary_rows(printed, tmp_path):
    folder = tmp_path / "all"
    write_recordings(folder, 2)
    (folder / "touch-001.csv").rename(folder / os.fsdecode(b"touch-\xff\xe9.csv"))
    write_zarr(folder / "array.zarr", 2)
    (folder / "array.zarr").rename(folder / os.fsdecode(b"array\xff.zarr"))
    (folder / "literal\\xff.csv").write_bytes((folder / "touch-000.csv").read_bytes())
    for words in ("5 contacts in", "5 of 5 contacts reused"):
        out = printed("fleet", folder, "-o", tmp_path / "results", "--workers", 1)
        assert words in out
    table = read_results(tmp_path / "results")
    names = sorted(name.rpartition("/")[2] for name in table["source"].to_pylist())
    arrays = [r"array\xff.zarr"] * 2
    assert names == [*arrays, r"literal\xff.csv", "touch-000.csv", r"touch-\xff\xe9.csv"]
    assert table["error"].to_pylist() == [None] * 5


def test_a_fleet_of_which_nothing_was_identified_fails(run, tmp_path):
    (tmp_path / "bad.csv").write_text("time_s,penetration_m\n1,2\n")
    done = begun(tmp_path / "bad.csv", tmp_path / "r", diagnosis="full")  # the default
    finished(done)  # without a worker, which takes seconds
    status, out, err = run("fleet", tmp_path / "bad.csv", "-o", tmp_path / "r")
    assert status == 2
    assert "failed: bad.csv: there is a penetration, and no force" in out
    assert err.startswith("palpate: no contact was identified; the column error")


@pytest.mark.long
@pytest.mark.parametrize("seconds, workers", [(0.2, 1), (0.01, 8)])
def test_a_resumed_fleet_gives_the_same_results(seconds, workers, recordings, tmp_path):
    """Nothing is done again, and nothing is lost, by a run with fewer or more workers."""
    finished(begun(recordings, tmp_path / "at-once"))
    first = finished(begun(recordings, tmp_path / "in-two"), 1, seconds=0.2)
    with pytest.raises(FleetError, match=f"{9 - len(first)} of 9 contacts are missing"):
        read_results(tmp_path / "in-two")
    begun_again = begun(recordings, tmp_path / "in-two")
    then = finished(begun_again, seconds=seconds, workers=workers)
    assert sorted([*first, *then]) == list(range(9))
    assert sum(end - start for start, end in begun_again[0].done()) == 9
    tables = [read_results(tmp_path / name) for name in ("at-once", "in-two")]
    assert len({repr(table.to_pylist()) for table in tables}) == 1  # NaN is not NaN
    assert read_seconds(tmp_path / "in-two")["source"] == tables[1]["source"]
    # What two runs at once wrote, with batches of their own, counts once.
    results, sources, settings = begun_again
    for batch in batches(sources, [0.02] * len(sources))[:2]:
        results.write(batch, *identify_and_time(batch.table, settings))
    finished(begun_again)
    assert repr(read_results(tmp_path / "in-two").to_pylist()) == repr(tables[0].to_pylist())
    assert read_seconds(tmp_path / "in-two").num_rows == tables[0].num_rows


@pytest.mark.long
def test_batches_are_balanced_and_the_longest_come_first(tmp_path):
    lengths = [200, 400, 800, 1600, 3200, 6400, 12800, 25600]
    for k in range(48):
        write_contact(contact(samples=lengths[k % 8]), tmp_path / f"{k:03d}.csv")
    sources = list_sources([tmp_path])
    work = [source.seconds("full", whole_curve=False) for source in sources]
    assert max(work) > 5.0 * min(work)
    for workers in (1, 2, 4):
        cut = batches(sources, work, workers)
        seconds = [batch.seconds for batch in cut]
        assert seconds == sorted(seconds, reverse=True)
        share = [0.0] * workers  # as workers take them, one after the other
        for each in seconds:
            share[share.index(min(share))] += each
        assert min(share) > 0.8 * max(share)
        assert len(cut) >= 4 * workers
        assert sorted(k for batch in cut for k in range(batch.first, batch.end)) == list(range(48))
    assert len(batches(sources[:3], [1e-3] * 3, 64)) == 1  # a task would cost more


def test_a_folder_of_something_else_is_refused_in_a_line(recordings, tmp_path):
    begun(recordings, tmp_path / "other", diagnosis="none")
    with pytest.raises(FleetError, match='diagnosis "none", but this run has "input"'):
        begun(recordings, tmp_path / "other")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("dear")
    with pytest.raises(FleetError, match=r"holds thesis\.tex, which palpate fleet did not write"):
        begun(recordings, tmp_path / "mine")
    manifest = tmp_path / "other" / "_fleet.json"
    older = {
        name: value for name, value in json.loads(manifest.read_text()).items() if name != "schema"
    }
    manifest.write_text(json.dumps(older))
    with pytest.raises(FleetError, match=r"have schema 1, but palpate .* reads schema 2; run"):
        read_results(tmp_path / "other")
    manifest.write_text("{")
    with pytest.raises(FleetError, match="cannot be read"):
        begun(recordings, tmp_path / "other")
    write_recordings(tmp_path / "all", 2)
    begun(tmp_path / "all", tmp_path / "results")
    with (tmp_path / "all" / "touch-000.csv").open("a") as file:
        file.write("# one more line\n")
    with pytest.raises(FleetError, match="other sources, or of these before they changed"):
        begun(tmp_path / "all", tmp_path / "results")


def test_sources_are_listed_once_in_order_without_the_results(recordings, tmp_path, monkeypatch):
    """Twice the same contact would halve the variance of a mean of repeats."""
    names = [source.name for source in list_sources([recordings])]
    assert names == sorted(names)
    assert len(names) == 5
    assert len(list_sources([f"{recordings}/touch-*.csv", recordings / "touch-001.csv"])) == 3
    folder = tmp_path / "all"
    write_recordings(folder, 2)
    (folder / "link.csv").symlink_to("touch-001.csv")
    (folder / "loop").symlink_to(folder)
    monkeypatch.chdir(tmp_path)
    assert len(list_sources(["all", folder / "touch-000.csv", "./all/../all", "all/*.csv"])) == 2
    finished(begun(folder, folder / "results"))  # results are no recordings
    assert len(list_sources([folder])) == 2
    assert len(list_sources([folder], leave_out=folder / "results")) == 2
    with pytest.raises(RecordingError, match="is the results folder"):
        list_sources([folder], leave_out=folder)


@pytest.mark.parametrize("name", ["absent", "*.mcap", "empty", "other/*.csv", "al"])
def test_an_unknown_name_among_known_ones_is_refused(name, recordings, tmp_path):
    (tmp_path / "empty").mkdir()
    for beside in ([], [recordings]):
        with pytest.raises(RecordingError, match=r"no recording found|no such file"):
            list_sources([*beside, tmp_path / name])


@pytest.mark.parametrize(
    "name, values, words",
    [
        ("velocity", np.ones((2, 3)), "has no array 'penetration'"),
        ("penetration", np.zeros((0, 600)), "no contacts; the arrays"),
        ("penetration", np.zeros((4, 600), dtype=complex), "complex128; real numbers are required"),
    ],
)
def test_an_array_of_no_contacts_is_refused(name, values, words, tmp_path):
    group = zarr.open_group(str(tmp_path / "a.zarr"), mode="w")
    for each in (name, "force"):
        group.create_array(each, data=values)
    with pytest.raises(RecordingError, match=words):
        list_sources([tmp_path / "a.zarr"])


def test_an_unreadable_file_of_a_folder_is_a_row_with_a_reason(tmp_path):
    write_recordings(tmp_path, 1)
    (tmp_path / "gone.csv").symlink_to("nowhere.csv")
    (tmp_path / "empty.zarr").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")  # nobody writes to it
    sources = list_sources([tmp_path])
    table = tasks_table([s.name for s in sources], [s.kind for s in sources], [None] * 3)
    rows = identify_batch(table, Settings(diagnosis="none")).to_pylist()
    errors = {row["source"].rpartition("/")[2]: row["error"] for row in rows}
    assert errors.pop("touch-000.csv") is None
    assert set(errors) == {"gone.csv", "empty.zarr"}
    assert all(errors.values())


def test_encoded_arrays_are_decoded_or_refused(tmp_path):
    """As xarray packs them: with a factor, an offset, and a number for what is missing."""
    path = str(tmp_path / "packed.zarr")
    _, _, f = write_zarr(path, 2)
    before = describe_array(path).stamp
    assert describe_array(path).stamp == before
    group = zarr.open_group(path, mode="a")
    group["force"][:] = 2.0 * f
    assert describe_array(path).stamp != before
    packed = np.round((f - 1.0) / 1e-4).astype("int32")
    packed[1, ::7] = -99999
    group.create_array("force", data=packed, overwrite=True)
    group["force"].attrs.update(scale_factor=1e-4, add_offset=1.0, _FillValue=-99999)
    rows = identify_batch(tasks_table([path] * 2, ["zarr"] * 2, [0, 1]), Settings()).to_pylist()
    for row in rows:
        assert abs(row["K"] - LAW.K) < 5.0 * row["K_standard_error"]
        assert abs(row["offset"]) < 5.0 * row["offset_standard_error"]
    assert rows[1]["samples"] == f.shape[1] - len(range(0, f.shape[1], 7))


def test_arrays_in_other_units_are_identified_in_si(tmp_path):
    x, v, f = write_zarr(tmp_path / "si.zarr", 2)
    group = zarr.open_group(str(tmp_path / "mm.zarr"), mode="w")
    group.create_array("time", data=np.arange(x.shape[1]) * 1.0).attrs["units"] = "ms"
    units = {"penetration": "mm", "velocity": "mm/s", "force": "mN"}
    for values, (name, unit) in zip((x, v, f), units.items(), strict=True):
        group.create_array(name, data=1e3 * values).attrs["units"] = unit
    finished(begun(tmp_path / "si.zarr", tmp_path / "one"))
    finished(begun(tmp_path / "mm.zarr", tmp_path / "other"))
    one, other = (read_results(tmp_path / name) for name in ("one", "other"))
    for name in ("K", "B", "n"):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-6)  # 1e-3 is no binary number


@pytest.mark.parametrize(
    "options, words",
    [
        (("--scheduler", "tcp://127.0.0.1:9"), "tcp://127.0.0.1:9: no Dask scheduler answers"),
        (("--scheduler", "nonsense"), "nonsense: no Dask scheduler answers"),
        (("--scheduler", "tls://127.0.0.1:9"), "tls://127.0.0.1:9: no Dask scheduler answers"),
        (("--curve", 1), "--curve applies to one recording"),
    ],
)
def test_a_missing_scheduler_or_wrong_option_is_one_line(
    options, words, refused, recordings, tmp_path, monkeypatch
):
    monkeypatch.setattr(running, "PATIENCE", 0.5)
    line = refused("fleet", recordings, "-o", tmp_path / "results", *options)
    assert line.startswith(f"palpate: {words}")


# What follows runs palpate as a person does, in processes that end in many ways.


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """An array of which the recursion, with a full diagnosis, takes some seconds."""
    folder = tmp_path_factory.mktemp("many")
    write_recordings(folder / "all", 160)
    return folder / "all"


def started(many, results, *arguments):
    command = [sys.executable, "-m", "palpate", "fleet", str(many), "-o", str(results)]
    command += ["--diagnosis", "full", *(arguments or ["--workers", "2"])]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def parts(results):
    return sorted(results.glob("part-*.parquet"))


def contents(results):
    return {path.name: path.read_bytes() for path in parts(results)}


def wait_for_parts(results, count, process):
    while len(parts(results)) < count:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)


@pytest.fixture(scope="module")
def undisturbed(many, tmp_path_factory):
    results = tmp_path_factory.mktemp("results") / "calm"
    assert started(many, results).wait(timeout=180) == 0
    return results


def assert_same_rows(results, others):
    """Of runs with other numbers of workers, which cut the work elsewhere."""
    assert len({repr(read_results(each).to_pylist()) for each in (results, others)}) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "how, workers", [(signal.SIGINT, ()), (signal.SIGKILL, ("--workers", "1"))]
)
def test_a_run_that_is_ended_keeps_what_is_done_and_goes_on(
    how, workers, many, undisturbed, tmp_path
):
    results = tmp_path / "results"
    process = started(many, results)
    wait_for_parts(results, 2, process)
    process.send_signal(how)
    _, err = process.communicate(timeout=60)
    if how == signal.SIGINT:
        assert process.returncode == 130
        assert "repeat the command to continue" in err
        assert "Traceback" not in err
    kept = contents(results)
    assert 2 <= len(kept) < len(parts(undisturbed))
    assert started(many, results, *workers).wait(timeout=180) == 0
    assert kept.items() <= contents(results).items()
    if workers:
        assert_same_rows(results, undisturbed)
    else:
        assert contents(results) == contents(undisturbed)
    assert not [path for path in results.iterdir() if path.name.startswith(".palpate-")]


@pytest.mark.slow
def test_killed_workers_lose_no_row(many, undisturbed, tmp_path):
    results = tmp_path / "results"
    process = started(many, results)
    for count in (1, 2, 3):
        wait_for_parts(results, count, process)
        running = [each.pid for each in psutil.Process(process.pid).children(recursive=True)]
        if count == 1 and shutil.which("ss"):  # nothing listens beyond this machine
            listed = subprocess.run(["ss", "-ltnp"], capture_output=True, text=True, check=True)
            own = [f"pid={each}," for each in (process.pid, *running)]
            lines = [line for line in listed.stdout.splitlines() if any(pid in line for pid in own)]
            assert lines
            assert all(line.split()[3].startswith("127.0.0.1:") for line in lines), lines
        commands = {each: Path(f"/proc/{each}/cmdline").read_bytes() for each in running}
        spawned = [each for each, command in commands.items() if b"spawn_main" in command]
        os.kill(spawned[0], signal.SIGKILL)
    assert process.wait(timeout=180) == 0
    assert contents(results) == contents(undisturbed)


@pytest.mark.slow
def test_a_recording_that_kills_its_worker_is_a_row_with_a_reason(tmp_path):
    """As one does that makes a library crash; here the reader of text ends its process."""
    write_recordings(tmp_path / "all", 3)
    program = f"""
import os, sys
from pathlib import Path
if __name__ == "__main__":
    from palpate.fleet.running import run_fleet
    run_fleet([{str(tmp_path / "all")!r}], Path({str(tmp_path / "results")!r}), workers=1)
"""
    ending = """
import os, palpate.input.recordings.text as reader
read = reader.read
def ended(path, request):
    if path.name == "touch-001.csv":
        os._exit(9)
    return read(path, request)
reader.read = ended
"""
    (tmp_path / "sitecustomize.py").write_text(ending)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path}
    subprocess.run([sys.executable, "-c", program], check=True, timeout=180, env=environment)
    errors = read_results(tmp_path / "results").column("error").to_pylist()
    assert [error is None for error in errors] == [True, False, True]
    assert "the worker process ended" in errors[1]


@pytest.fixture
def scheduler(tmp_path):
    about = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    command += ["--port", "0", "--no-dashboard", "--scheduler-file", str(about)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while not about.exists() or not about.read_text().strip():
        assert process.poll() is None
        time.sleep(0.05)
    yield json.loads(about.read_text())["address"]
    process.terminate()
    process.wait()


@pytest.mark.slow
def test_a_client_of_dask_can_be_given(scheduler, many, undisturbed, tmp_path, monkeypatch):
    monkeypatch.setattr(running, "PATIENCE", 2.0)
    with (
        pytest.raises(FleetError, match="has no workers"),
        running.open_client(scheduler=scheduler),
    ):
        pass
    command = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, "--no-dashboard"]
    worker = subprocess.Popen([*command, "--nthreads", "1"], stderr=subprocess.DEVNULL)
    try:
        process = started(many, tmp_path / "results", "--scheduler", scheduler)
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        assert_same_rows(tmp_path / "results", undisturbed)
        monkeypatch.setattr(running, "__version__", "9.9")
        with (
            pytest.raises(FleetError, match=r"has palpate \d.*, but this is palpate 9\.9"),
            running.open_client(scheduler=scheduler),
        ):
            pass
    finally:
        worker.terminate()
        worker.wait()


@pytest.mark.slow
def test_a_worker_that_ends_before_it_has_started_is_started_anew(monkeypatch):
    starting, failures = nanny.Nanny.instantiate, iter([])

    async def instantiate(self):
        for failure in failures:
            raise failure
        return await starting(self)

    monkeypatch.setattr(nanny.Nanny, "instantiate", instantiate)
    monkeypatch.setattr(running, "_ASK_AGAIN", 0.5)
    with running.open_client(workers=2) as client:
        failures = iter([RuntimeError("killed while it was started")])
        while len(client.cluster.workers) < 2:  # they are listed a moment after they have started
            time.sleep(0.05)
        client.cluster.sync(client.cluster.workers[0].close)
        client.wait_for_workers(2, timeout=30.0)
        assert client.submit(sum, [2, 3]).result(timeout=30.0) == 5
