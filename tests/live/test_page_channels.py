"""Of the loop's rows what goes to a browser; the ring, the board and the histogram they come by."""

import math
import multiprocessing
import struct
import time
from contextlib import contextmanager

import numpy as np
import pytest
from cases import KINDS, exciting
from hypothesis import given
from hypothesis import strategies as st

from palpate import FlatSpectrum, GeneralisedHuntCrossley, Status
from palpate.force_laws import HuntCrossley
from palpate.lab import MATERIALS
from palpate.live.console import read_numbers
from palpate.live.loop import Histogram
from palpate.live.page import watch
from palpate.live.page.watch import (
    CHANNELS,
    HEADER,
    History,
    compute_channels,
)
from palpate.live.ring import (
    COLUMNS,
    ESTIMATE,
    MOST_PARAMETERS,
    SAMPLE,
    SIZE,
    Reader,
    SharedJson,
    Writer,
)
from palpate.live.sinks import Session, Watching
from palpate.method.estimators import ESTIMATORS

AT = {name: place for place, name in enumerate(COLUMNS)}
DELAY = 0.009


def rows_of(times, **columns):
    """Rows as the loop writes them, of a law that does not change."""
    rows = np.zeros((len(times), len(COLUMNS)))
    rows[:, AT["time"]] = times
    rows[:, AT["arrived"]] = np.asarray(times) + DELAY
    rows[:, AT["parameter_0"] : AT["parameter_0"] + 4] = [2000.0, 3000.0, 1.3, np.nan]
    for name, values in columns.items():
        rows[:, AT[name]] = values
    return rows


def frame(history, first, until, **options):
    options = {"every": 1, "dropped": 0, "void": False, **options}
    message = history.frame(first, until, **options)
    _, count, number, _, _ = HEADER.unpack_from(message)
    times = np.frombuffer(message, "<f8", count, HEADER.size)
    values = np.frombuffer(message, "<f4", offset=HEADER.size + 8 * count)
    return number, times, dict(zip(CHANNELS, values.reshape(len(CHANNELS), count), strict=True))


def test_channels_that_the_law_lacks_have_no_curve():
    rows = np.hstack([rows_of([0.0, 1.0]), np.zeros((2, 4))])
    law = GeneralisedHuntCrossley(
        K=1e3, n=1.5, B=2e3, p=1.5, M=5e2, relaxation=FlatSpectrum(2e-3, 2.0)
    )
    rows[:, AT["parameter_0"] : AT["parameter_0"] + 5] = law.parameters
    square = np.diag([1.0, 0.01, 4.0, 0.01, 1.0, 0.0, 0.0, 0.0])
    rows[:, AT["covariance_0"] : AT["covariance_0"] + MOST_PARAMETERS**2] = square.ravel()
    found = compute_channels(rows, GeneralisedHuntCrossley)
    numbers = found[CHANNELS.index("parameter_0") :][:MOST_PARAMETERS, 0]
    assert np.isfinite(numbers).tolist() == [True] * 5 + [False] * 3
    # Of a law whose numbers are always its own one that is given has an error of 0, and a curve.
    assert np.isfinite(compute_channels(rows, HuntCrossley)[CHANNELS.index("parameter_5")]).all()


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_stiffness_and_damping_in_a_row_are_those_of_the_estimate(kind):
    estimator = kind()
    signals = exciting(next(iter(MATERIALS.values())).law, noise=0.05, seed=3)
    estimator.replay(*signals[:800].arrays)
    estimate, size = estimator.estimate(), len(estimator.law_type.symbols)
    row, square = rows_of([0.0]), np.zeros((MOST_PARAMETERS, MOST_PARAMETERS))
    row[0, AT["parameter_0"] : AT["parameter_0"] + size] = estimate.parameters
    square[:size, :size] = estimate.covariance
    row[0, AT["covariance_0"] :][: square.size] = square.ravel()
    found = read_numbers(row, estimator.law_type, 0.01)
    if not estimator.law_type.relaxes:  # a law with a spectrum has more numbers
        assert found == {
            "stiffness": estimate.stiffness_at(0.01),
            "damping": estimate.damping_at(0.01),
        }
    assert read_numbers(row, estimator.law_type, math.nan) == {}


@pytest.mark.long
@given(st.binary(min_size=8 * len(COLUMNS), max_size=8 * len(COLUMNS)))
def test_any_floats_make_channels_that_are_finite_or_nothing(content):
    row = np.array([struct.unpack(f"<{len(COLUMNS)}d", content) + (0.0,) * 4])
    found = compute_channels(row, HuntCrossley)
    assert found.dtype == np.dtype("<f4")
    assert not np.isinf(found).any()


@pytest.fixture
def history():
    return History(1e-3)


def test_the_history_is_the_last_seconds_without_a_gap(history):
    history.show(HuntCrossley, 0.01, 0.0)
    history.response = np.array([900.0, 5.0, 30.0, 1.0])
    times = np.arange(40_000) * 1e-3
    for part in np.array_split(rows_of(times, force=times), 321):
        history.add(part, DELAY)
    assert history.total == 40_000
    assert history.oldest == 40_000 - 12_000
    number, kept, values = frame(history, history.oldest, history.total)
    assert number == history.oldest
    np.testing.assert_array_equal(kept, times[-12_000:])
    np.testing.assert_array_equal(values["force"], times[-12_000:].astype(np.float32))
    assert (values["stiffness"] == 900.0).all()


def test_thinned_rows_are_the_same_ones_however_they_are_cut(history):
    history.add(rows_of(np.arange(100) * 1e-3), DELAY)
    times = [frame(history, a, b, every=4)[1] for a, b in ((0, 7), (7, 8), (8, 31), (31, 100))]
    np.testing.assert_array_equal(np.concatenate(times), np.arange(0, 100, 4) * 1e-3)


def test_an_empty_measurement_keeps_its_place(history):
    times = np.arange(10) * 1e-3
    rows = rows_of(times)
    rows[3:5, AT["time"]] = np.nan
    rows[7, [AT["time"], AT["arrived"]]] = np.nan  # and one without any time at all
    history.add(rows, DELAY)
    times[7] = times[6]
    np.testing.assert_allclose(frame(history, 0, 10)[1], times, atol=1e-15)


def test_a_clock_that_is_set_back_voids_what_was_before(history):
    history.add(rows_of([100.0, 100.001]), DELAY)
    history.add(rows_of([100.002, 5.0, 5.001]), DELAY)
    assert (history.total, history.begins, history.oldest) == (5, 3, 3)
    np.testing.assert_array_equal(frame(history, 3, 5)[1], [5.0, 5.001])
    history.add(rows_of([5.0005, 5.002]), DELAY)  # that is jitter
    np.testing.assert_array_equal(frame(history, 5, 7)[1], [5.001, 5.002])


def test_the_response_is_that_of_its_time_and_of_one_depth(history):
    history.show(GeneralisedHuntCrossley, 0.01, 0.0)
    for k, response in enumerate(([900.0, 5.0, 30.0, 1.0], [950.0, 4.0, 31.0, 0.9])):
        history.response = np.array(response)
        history.add(rows_of([k * 1e-3]), DELAY)
    values = frame(history, 0, 2)[2]
    found = [values[name].tolist() for name in ("stiffness", "stiffness_error", "damping")]
    assert found == [[900.0, 950.0], [5.0, 4.0], [30.0, 31.0]]
    history.show(GeneralisedHuntCrossley, 0.02, 0.0)
    assert np.isnan(frame(history, 0, 2)[2]["stiffness"]).all()


def test_no_line_leads_from_one_estimator_to_the_next(history):
    history.show(HuntCrossley, 0.01, 0.0)
    history.response = np.ones(4)
    history.add(rows_of(np.arange(6) * 1e-3, method=[0, 0, 0, 1, 1, 1]), DELAY)
    known = np.isfinite(frame(history, 0, 6)[2]["stiffness"])
    assert known.tolist() == [True] * 3 + [False] * 3  # the board has not said yet what 1 is
    assert history.show(HuntCrossley, 0.01, 1.0)
    known = np.isfinite(frame(history, 0, 6)[2]["parameter_0"])
    assert known.tolist() == [True] * 3 + [False] + [True] * 2
    assert history.show(ESTIMATORS["kelvin-voigt"].law_type, 0.01, 2.0)
    assert not np.isfinite(frame(history, 0, 6)[2]["parameter_0"]).any()
    assert not history.show(ESTIMATORS["kelvin-voigt"].law_type, 0.01, 2.0)


LAW = {name: getattr(HuntCrossley, name) for name in ("kind", "symbols", "units")}
LAW |= {"names": HuntCrossley.names(), "shown": [0, 1, 2]}
OTHER = {"kind": "kelvin-voigt", "names": ["K", "B"], "shown": []}
STATUS = {
    "method": "variable-projection",
    "sample_time": 1e-3,
    "generation": 0,
    "law": LAW,
    "state": "contact",
}


@pytest.fixture
def watched(monkeypatch):
    """A ring, the loop's board, and what a page sees of them at once."""
    monkeypatch.setattr(watch, "ALIVE", 0.0)
    writers, shared_json, own = (Writer(64), Writer(64, len(ESTIMATE))), SharedJson(), SharedJson()
    memories = [each.memory for each in writers]
    shared_json.write({**STATUS, "state": "none"})
    seen = watch.Watch(
        Watching(Session(*memories, shared_json.memory, {"page": own.memory}), "page")
    )
    return writers, shared_json, seen


def test_a_loop_whose_source_is_still_being_opened_is_not_dead(watched):
    _, shared_json, seen = watched
    seen.look()
    assert seen.page({})["state"] == "none"
    shared_json.write(STATUS)
    seen.look()
    assert seen.page({})["state"] == "dead"  # it has been, and says nothing more


def test_an_estimate_is_shown_by_its_own_law(watched):
    (samples, estimates), shared_json, seen = watched

    def write(*times, **columns):
        for row in rows_of(times, estimate=estimates.count, **columns):
            estimates.write(*row[len(SAMPLE) :])
            samples.write(*row[: len(SAMPLE)])
        seen.take()

    shared_json.write(STATUS)
    seen.look()
    write(0.0, 0.2)
    write(0.4, status=float(Status.RESTARTED))
    seen.look()
    page = seen.page({"browsers": 1}, ended=True)
    assert page["view"]["numbers"][0] == ["K [N/mⁿ]", "2000"]
    assert page["view"]["changes"][0][1][0] == "K = 2000 N/mⁿ"
    assert page["facts"]["state-name"] == "Stopped"  # not by a word of its own
    assert ["page: browsers", "1", ""] in page["facts"]["counts"]
    assert seen.page({})["now"]["parameters"] == [2000.0, 3000.0, 1.3]
    shared_json.write({**STATUS, "generation": 1, "law": OTHER})
    seen.look()
    write(0.401)  # the last one of the estimator before
    (change,) = seen.page({})["changes"]
    assert change["before"]["parameters"] == change["after"]["parameters"] == [2000.0, 3000.0, 1.3]
    assert "parameters" not in seen.page({})["now"]
    write(0.402, method=1)
    assert seen.page({})["now"]["parameters"] == [2000.0, 3000.0]
    write(0.403, method=2)  # of which the board has not said yet what it identifies
    assert "parameters" not in seen.page({})["now"]


SPAWN = multiprocessing.get_context("spawn")


def writing(kind, memory, seconds, gate):
    """Rows or pages whose numbers are all of one value, as quickly as it goes."""
    made = Writer(memory=memory) if kind == "ring" else SharedJson(memory)
    gate.send("there")
    until, k = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        if kind == "ring":
            made.write(*[float(k)] * len(SAMPLE))
        else:
            made.write({"k": k, "words": "x" * (k % 3000), "again": k})
        k += 1
    gate.send(k)


@contextmanager
def another_process(kind, memory, seconds):
    """One that writes; its end says how many it has written."""
    gate, theirs = SPAWN.Pipe()
    process = SPAWN.Process(target=writing, args=(kind, memory, seconds, theirs))
    process.start()
    assert gate.recv() == "there"
    yield gate
    process.join()


@pytest.mark.long
def test_a_reader_that_races_the_writer_sees_only_whole_rows():
    ring = Writer(256)  # so small that it goes round all the time
    reader = Reader(ring.memory)
    seen, dropped, last = 0, 0, -1.0
    with another_process("ring", ring.memory, 0.7) as gate:
        while not gate.poll():
            rows, lost = reader.take()
            assert (rows == rows[:, :1]).all()  # none is half another's
            values = rows[:, 0]
            if len(values):
                assert (np.diff(values) == 1.0).all()
                assert values[0] == last + 1 + lost
                last = values[-1]
            else:
                last += lost
            seen, dropped = seen + len(rows), dropped + lost
        written = gate.recv()
    rows, lost = reader.take()
    assert seen + len(rows) + dropped + lost == written
    assert seen > 256
    assert dropped > 0


@pytest.fixture
def ring():
    return Writer(8)


def written(ring, *numbers):
    for k in numbers:
        ring.write(*[float(k)] * len(SAMPLE))


def test_a_slow_reader_gets_the_newest_rows_and_the_lost_count(ring):
    written(ring, *range(5))
    early, late = Reader(ring.memory), Reader(ring.memory)
    assert early.take()[0][:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    written(ring, *range(5, 20))
    # The oldest row of a full ring may be written over while it is read, so it is not given.
    rows, dropped = late.take()
    assert rows[:, 0].tolist() == [13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0]
    assert dropped == 13
    assert late.take()[0].size == 0
    begun_late = Reader(ring.memory)
    rows, dropped = begun_late.take()
    assert (len(rows), dropped) == (7, 13)


def test_a_reader_goes_back_as_far_as_half_the_ring(ring):
    reader = Reader(ring.memory)
    written(ring, *range(6))
    reader.take()
    reader.go_back(4)
    assert reader.take()[0][:, 0].tolist() == [4.0, 5.0]
    reader.go_back(0)
    rows, dropped = reader.take()
    assert rows[:, 0].tolist() == [2.0, 3.0, 4.0, 5.0]
    assert dropped == 0
    reader.go_back(99)
    assert len(reader.take()[0]) == 0


@pytest.mark.slow
def test_a_page_that_is_read_while_it_is_written_is_whole():
    shared_json = SharedJson()
    newest, different = -1, 0
    with another_process("board", shared_json.memory, 0.5) as gate:
        while not gate.poll():
            if page := shared_json.read():
                assert page["k"] == page["again"] >= newest
                assert len(page["words"]) == page["k"] % 3000
                different += page["k"] > newest
                newest = page["k"]
        assert shared_json.read()["k"] == gate.recv() - 1
    assert different > 5


def test_a_page_that_is_too_long_is_cut_to_its_first_fields():
    shared_json = SharedJson()
    shared_json.write({"first": 1, "second": "x" * SIZE})
    assert shared_json.read() == {"first": 1}


@pytest.mark.parametrize("seed", [0, 1])
def test_a_histogram_knows_percentiles_to_the_width_of_its_bins(seed):
    times = np.random.default_rng(seed).lognormal(np.log(2e-5), 1.5, 20_000)
    histogram = Histogram(1e-3)
    for each in times.tolist():
        histogram.add(each)
    found = histogram.as_dict()
    for name, percent in (("p50", 50.0), ("p99", 99.0), ("p99.9", 99.9)):
        true = np.percentile(times, percent, method="inverted_cdf")
        # A bin is a twentieth of a decade wide, and the percentile is its upper end.
        assert true <= found[name] * (1.0 + 1e-12)
        assert found[name] <= true * 10.0 ** (1.0 / 20.0)
    assert found["max"] == times.max()
    assert found["count"] == 20_000
    assert found["within"] == pytest.approx(np.mean(times <= 1e-3), abs=1e-12)


def test_a_histogram_takes_any_time_there_is():
    histogram = Histogram(1.0)
    for each in (0.0, -1.0, 1e-9, 1e-7, 99.9, 1e5):
        histogram.add(each)
    assert histogram.percentile(50.0) <= 1e-7
    assert histogram.percentile(100.0) <= 1e5
    assert histogram.over == 2
    assert np.isnan(Histogram(1.0).percentile(50.0))
