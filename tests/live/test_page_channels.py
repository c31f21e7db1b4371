"""What of the loop's rows goes to a browser: stiffness at a depth, gaps, clocks that are set."""

import struct

import numpy as np
import pytest
from cases import KINDS, exciting
from hypothesis import given
from hypothesis import strategies as st

from palpate import FlatSpectrum, GeneralisedHuntCrossley, Status
from palpate.estimators import ESTIMATORS
from palpate.force_laws import ForceLaw, HuntCrossley
from palpate.lab import MATERIALS
from palpate.live.page import watch
from palpate.live.page.watch import CHANNELS, HEADER, History, at_depth, channels_of
from palpate.live.ring import COLUMNS, ESTIMATE, MOST_PARAMETERS, SAMPLE, Board, Writer
from palpate.live.sinks import Session

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


def test_what_the_law_in_force_has_not_is_no_curve():
    rows = rows_of([0.0, 1.0])
    law = GeneralisedHuntCrossley(1e3, 1.5, 2e3, 1.5, 5e2, FlatSpectrum(2e-3, 2.0))
    rows[:, AT["parameter_0"] : AT["parameter_0"] + MOST_PARAMETERS] = law.parameters
    square = np.diag([1.0, 0.01, 4.0, 0.01, 1.0, 0.0, 0.0, 0.0])
    rows[:, AT["covariance_0"] : AT["covariance_0"] + MOST_PARAMETERS**2] = square.ravel()
    found = channels_of(rows, GeneralisedHuntCrossley, 1e-3)
    numbers = found[CHANNELS.index("parameter_0") :][:MOST_PARAMETERS, 0]
    assert np.isfinite(numbers).tolist() == [True] * 5 + [False] * 3
    # Of a law whose numbers are always its own one that is given has an error of 0, and a curve.
    assert np.isfinite(channels_of(rows, HuntCrossley, 1e-3)[CHANNELS.index("parameter_5")]).all()


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_stiffness_and_damping_at_a_depth_are_those_of_the_estimate(kind):
    estimator = kind()
    signals = exciting(next(iter(MATERIALS.values())).law, noise=0.05, seed=3)
    estimator.replay(*signals[:800].arrays)
    estimate = estimator.estimate()
    parameters, covariance = estimate.parameters[None], estimate.covariance[None]
    for depth in (1e-4, 0.01):
        found = at_depth(estimator.law_type, parameters, covariance, depth)[:, 0]
        expected = [*estimate.stiffness_at(depth), *estimate.damping_at(depth)]
        # Damping by differences of the force, which has sixteen digits of which these take eight.
        np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("method", ESTIMATORS)
def test_many_laws_at_once_are_each_of_them(method):
    law = ESTIMATORS[method].law_type
    parameters = np.random.default_rng(5).uniform(0.5, 2.0, (20, len(law.symbols)))
    parameters[:, -1] += 2.0  # the longest relaxation time, of a law that has some
    quick, slow = law.many_at(parameters, 0.01), ForceLaw.many_at.__func__(law, parameters, 0.01)
    np.testing.assert_allclose(quick, slow, rtol=1e-9)  # by differences over 2 mm/s


@given(st.binary(min_size=8 * len(COLUMNS), max_size=8 * len(COLUMNS)))
def test_any_floats_make_channels_that_are_finite_or_nothing(content):
    row = np.array([struct.unpack(f"<{len(COLUMNS)}d", content)])
    found = channels_of(row, HuntCrossley, 0.005)
    assert found.dtype == np.dtype("<f4")
    assert not np.isinf(found).any()


@pytest.fixture
def history():
    return History(1e-3)


def test_what_is_kept_is_the_last_seconds_without_a_gap(history):
    history.show(HuntCrossley, 0.01, 0.0)
    times = np.arange(40_000) * 1e-3
    for part in np.array_split(rows_of(times, force=times), 321):
        history.add(part, DELAY)
    assert history.total == 40_000
    assert history.oldest == 40_000 - 12_000
    number, kept, values = frame(history, history.oldest, history.total)
    assert number == history.oldest
    np.testing.assert_array_equal(kept, times[-12_000:])
    np.testing.assert_array_equal(values["force"], times[-12_000:].astype(np.float32))
    expected = 1.3 * 2000.0 * 0.01**0.3
    np.testing.assert_allclose(values["stiffness"][1:], expected, rtol=1e-6)


def test_a_page_that_slept_goes_on_with_the_newest_rows_under_their_own_numbers(history):
    history.add(rows_of(np.arange(16_000) * 1e-3), DELAY)
    assert (history.total, history.oldest) == (16_000, 4_000)
    np.testing.assert_allclose(frame(history, 15_998, 16_000)[1], [15.998, 15.999], rtol=1e-12)


def test_thinned_rows_are_the_same_ones_however_they_are_cut(history):
    history.add(rows_of(np.arange(100) * 1e-3), DELAY)
    times = [frame(history, a, b, every=4)[1] for a, b in ((0, 7), (7, 8), (8, 31), (31, 100))]
    np.testing.assert_array_equal(np.concatenate(times), np.arange(0, 100, 4) * 1e-3)


def test_a_measurement_without_a_sample_stands_where_the_next_one_would(history):
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


def test_no_line_leads_from_one_estimator_to_the_next(history):
    history.show(HuntCrossley, 0.01, 0.0)
    history.add(rows_of(np.arange(6) * 1e-3, method=[0, 0, 0, 1, 1, 1]), DELAY)
    known = np.isfinite(frame(history, 0, 6)[2]["stiffness"])
    assert known.tolist() == [True] * 3 + [False] * 3  # the board has not said yet what 1 is
    assert history.show(HuntCrossley, 0.01, 1.0)
    known = np.isfinite(frame(history, 0, 6)[2]["parameter_0"])
    assert known.tolist() == [True] * 3 + [False] + [True] * 2
    assert history.show(ESTIMATORS["kelvin-voigt"].law_type, 0.01, 2.0)
    assert not np.isfinite(frame(history, 0, 6)[2]["parameter_0"]).any()
    assert not history.show(ESTIMATORS["kelvin-voigt"].law_type, 0.01, 2.0)


@pytest.fixture
def watched(monkeypatch):
    """A ring, the loop's board, and what a page sees of them at once."""
    monkeypatch.setattr(watch, "ALIVE", 0.0)
    writers, board, own = (Writer(64), Writer(64, len(ESTIMATE))), Board(), Board()
    addresses = [each.address for each in writers]
    seen = watch.Watch(Session(*addresses, board.name, {"page": own.name}, own.name))
    yield writers, board, seen
    seen.run.close()
    for each in (own, board, *writers):
        each.close()


def test_a_loop_whose_source_is_still_being_opened_is_not_dead(watched):
    _, board, seen = watched
    seen.look()
    assert seen.page({})["alive"]
    board.write({"sample_time": 1e-3, "generation": 0, "law": {"kind": "hunt-crossley"}})
    seen.take()
    assert not seen.page({})["alive"]  # it has been, and says nothing more


def test_an_estimate_is_never_shown_by_the_law_of_another_estimator(watched):
    (samples, estimates), board, seen = watched

    def write(*times, **columns):
        for row in rows_of(times, estimate=estimates.count, **columns):
            estimates.write(*row[len(SAMPLE) :])
            samples.write(*row[: len(SAMPLE)])
        seen.take()

    law = {name: getattr(HuntCrossley, name) for name in ("kind", "symbols", "units")}
    law["names"] = HuntCrossley.names()
    board.write({"sample_time": 1e-3, "generation": 0, "law": law, "state": "contact"})
    write(0.0, 0.2)
    write(0.4, status=float(Status.RESTARTED))
    seen.look()
    page = seen.page({"clients": 1}, ended=True)
    assert page["view"]["numbers"][2] == ["Stiffness K [N/mⁿ]", "2000"]
    assert page["view"]["changes"][0][1][0] == "K = 2000 N/mⁿ"
    assert page["facts"]["state-name"] == "Stopped"  # not by a word of its own
    assert ["page: browsers", "1", ""] in page["facts"]["counts"]
    assert seen.page({})["now"]["parameters"] == [2000.0, 3000.0, 1.3]
    board.write({"sample_time": 1e-3, "generation": 1, "law": {"kind": "kelvin-voigt"}})
    seen.look()
    write(0.401)  # the last one of the estimator before
    (change,) = seen.page({})["changes"]
    assert change["before"]["parameters"] == change["after"]["parameters"] == [2000.0, 3000.0, 1.3]
    assert "parameters" not in seen.page({})["now"]
    write(0.402, method=1)
    assert seen.page({})["now"]["parameters"] == [2000.0, 3000.0]
    write(0.403, method=2)  # of which the board has not said yet what it identifies
    assert "parameters" not in seen.page({})["now"]
