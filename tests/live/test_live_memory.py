"""Ring, board and histogram: what a reader sees is whole, and what it does not see is counted."""

import multiprocessing
import time
from contextlib import contextmanager

import numpy as np
import pytest

from palpate.live.loop import Histogram
from palpate.live.ring import SAMPLE, SIZE, Board, Reader, Writer

SPAWN = multiprocessing.get_context("spawn")


def writing(kind, address, seconds, gate):
    """Rows or pages whose numbers are all of one value, as quickly as it goes."""
    made = Writer(made=address) if kind == "ring" else Board(address)
    gate.send("there")
    until, k = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        if kind == "ring":
            made.write(*[float(k)] * len(SAMPLE))
        else:
            made.write({"k": k, "words": "x" * (k % 3000), "again": k})
        k += 1
    gate.send(k)
    made.close()


@contextmanager
def another_process(kind, address, seconds):
    """One that writes; its end says how many it has written."""
    gate, theirs = SPAWN.Pipe()
    process = SPAWN.Process(target=writing, args=(kind, address, seconds, theirs))
    process.start()
    assert gate.recv() == "there"
    yield gate
    process.join()


def test_a_reader_that_races_the_writer_sees_whole_rows_and_counts_the_rest():
    ring = Writer(256)  # so small that it goes round all the time
    reader = Reader(ring.address)
    seen, dropped, last = 0, 0, -1.0
    with another_process("ring", ring.address, 0.7) as gate:
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
    reader.close()
    ring.close()


@pytest.fixture
def ring():
    made = Writer(8)
    yield made
    made.close()


def written(ring, *numbers):
    for k in numbers:
        ring.write(*[float(k)] * len(SAMPLE))


def test_a_reader_that_falls_behind_gets_the_newest_and_knows_how_many_it_lost(ring):
    written(ring, *range(5))
    early, late = Reader(ring.address), Reader(ring.address)
    assert early.take().rows[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    written(ring, *range(5, 20))
    # The oldest row of a full ring may be written over while it is read, so it is not given.
    rows, dropped = late.take()
    assert rows[:, 0].tolist() == [13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0]
    assert dropped == 13
    assert late.take().rows.size == 0
    begun_late = Reader(ring.address)
    rows, dropped = begun_late.take()
    assert (len(rows), dropped) == (7, 13)
    for each in (early, late, begun_late):
        each.close()


def test_a_reader_goes_back_as_far_as_half_the_ring(ring):
    reader = Reader(ring.address)
    written(ring, *range(6))
    reader.take()
    reader.go_back(4)
    assert reader.take().rows[:, 0].tolist() == [4.0, 5.0]
    reader.go_back(0)
    rows, dropped = reader.take()
    assert rows[:, 0].tolist() == [2.0, 3.0, 4.0, 5.0]
    assert dropped == 0
    reader.go_back(99)
    assert len(reader.take().rows) == 0
    reader.close()


@pytest.mark.slow
def test_a_page_that_is_read_while_it_is_written_is_whole():
    board = Board()
    newest, different = -1, 0
    with another_process("board", board.name, 0.5) as gate:
        while not gate.poll():
            if page := board.read():
                assert page["k"] == page["again"] >= newest
                assert len(page["words"]) == page["k"] % 3000
                different += page["k"] > newest
                newest = page["k"]
        assert board.read()["k"] == gate.recv() - 1
    assert different > 5
    board.close()


def test_a_page_that_is_too_long_is_cut_to_its_first_fields():
    board = Board()
    board.write({"first": 1, "second": "x" * SIZE})
    assert board.read() == {"first": 1}
    board.close()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_histogram_knows_percentiles_to_the_width_of_its_bins(seed):
    times = np.random.default_rng(seed).lognormal(np.log(2e-5), 1.5, 20_000)
    histogram = Histogram(1e-3)
    for each in times.tolist():
        histogram.add(each)
    found = histogram.as_dict()
    for name, percent in (("p50", 50.0), ("p99", 99.0), ("p99.9", 99.9)):
        true = np.percentile(times, percent, method="inverted_cdf")
        # A bin is a twentieth of a decade wide, and its upper end is what is said.
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
