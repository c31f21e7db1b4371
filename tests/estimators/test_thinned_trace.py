"""An estimate along the way only where it is asked for; all else is as with a full trace."""

import numpy as np
import pytest
from cases import MATERIALS, contact_of, exciting, knowledge, tapping

import palpate
from palpate import ESTIMATORS, InvalidParameterError, Trace, compare, diagnose, identify
from palpate.output.figures import draw

# Contact is lost and made again, and some samples are bad.
SIGNALS = tapping(MATERIALS["ball"], noise=0.02, seed=1)
SIGNALS.force[700:703] += 5.0
SIGNALS.force[900] = np.nan
CONTACT = contact_of(SIGNALS)


@pytest.fixture(scope="module", params=ESTIMATORS.values(), ids=ESTIMATORS)
def method(request):
    return request.param


@pytest.fixture(scope="module")
def full(method):
    """Of each method, with a whole trace."""
    return identify(CONTACT, method(), trace="full")


def same(one, other) -> bool:
    return np.array_equal(one, other, equal_nan=True)


@pytest.mark.long
@pytest.mark.parametrize("trace", [False, 30])
def test_a_thinned_trace_changes_no_result(method, full, trace):
    thinned = identify(CONTACT, method(), trace=trace)
    assert knowledge(thinned.estimator) == knowledge(full.estimator)
    for name in ("status", "predicted_force", "validity_margin"):
        assert same(getattr(thinned.trace, name), getattr(full.trace, name)), name
    assert thinned.flags == full.flags
    assert same(thinned.covariance, full.covariance)
    assert thinned.diagnosis.as_dict() == full.diagnosis.as_dict()
    for name in ("prediction_rmse_percent", "fit_rmse_percent", "violated_fraction"):
        assert same(getattr(thinned, name), getattr(full, name)), name
    assert thinned.as_dict() == full.as_dict()


def test_a_window_of_a_thinned_trace_keeps_its_estimates_in_their_places():
    trace = identify(CONTACT, trace=0.1).trace
    for window in (slice(95, 505), slice(505, 95, -1), slice(1, 2), slice(None, None, 50)):
        part = trace[window]
        chosen = np.arange(len(trace))[window]
        assert set(chosen[part.after]) == set(chosen) & set(trace.after)
        assert same(part.status, trace.status[window])
        assert same(part.everywhere(part.time), trace.everywhere(trace.time)[window])


def test_segments_are_thinned_each_by_itself_and_joined():
    segment = np.where(CONTACT.time < 0.95, 0, 1)
    trace = identify(contact_of(SIGNALS, segment=segment), trace=0.5).trace
    times = [0.0, 0.5, 0.949, 0.95, 1.45, 1.95, 1.999]
    assert trace.time == pytest.approx(times, abs=1.1e-3)  # a sample
    parts = [Trace.empty(3, 3), trace]
    assert (Trace.joined(parts, 3).after == np.concatenate([[0, 1, 2], trace.after + 3])).all()
    # A whole number is of estimates in all.
    segment = np.arange(len(CONTACT)) // 100
    trace = identify(contact_of(SIGNALS, segment=segment), trace=7).trace
    assert trace.after.tolist() == [0, 333, 666, 1000, 1333, 1666, 1999]
    assert same(trace.time, CONTACT.time[trace.after])


def test_trace_takes_a_count_or_an_interval_in_seconds():
    for rows in (1, 2, 300, np.int64(1999)):
        trace = identify(CONTACT, trace=rows).trace
        assert len(trace.after) == len(trace.time) == rows
        assert trace.after[-1] == len(CONTACT) - 1
        assert trace.after[0] == 0 or rows == 1
        assert rows == 1 or np.ptp(np.diff(trace.after)) <= 1
    assert identify(CONTACT, trace=1.0).trace.after.tolist() == [0, 1000, 1999]
    assert identify(CONTACT, trace=1e-4).trace.full  # below a sample


def test_the_estimates_of_a_long_recording_are_2000_by_default():
    long = contact_of(tapping(MATERIALS["ball"], seconds=2.5, noise=0.02))
    assert len(identify(long).trace.after) == 2000
    assert identify(CONTACT).trace.full  # of 2000 samples
    assert all(len(each.trace.after) == 2000 for each in compare(long).values())
    without = compare(CONTACT, trace=False)
    assert all(not len(each.trace.parameters) for each in without.values())


@pytest.mark.parametrize("trace", [True, "half", 0, 0.0, -1, -1.0, np.nan, None, [1.0], 1e10])
def test_an_invalid_trace_is_refused_in_one_line(trace):
    with pytest.raises(InvalidParameterError, match=r"^trace must [^\n]*$"):
        identify(CONTACT, trace=trace)
    with pytest.raises(InvalidParameterError, match=r"^trace must "):
        compare(CONTACT, trace=trace)


@pytest.mark.parametrize("at", [[1, 0], [0, 0], [-1], [10_000], [0.5], [np.nan], "last", [[1]]])
def test_an_invalid_choice_of_estimates_is_refused(method, at):
    with pytest.raises(InvalidParameterError, match=r"^at must [^\n]*$"):
        method().replay(*SIGNALS.arrays, at=at)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["variable-projection", "kelvin-voigt", "viscoelastic"])
def test_figures_frames_and_stretches_are_there_without_a_trace(kind):
    whole, result = (identify(CONTACT, kind, trace=trace) for trace in ("full", False))
    lines = [
        [same(a.get_xydata(), b.get_xydata()) for a, b in zip(x.lines, y.lines, strict=True)]
        for x, y in zip(draw(result).axes, draw(whole).axes, strict=True)
    ]
    assert all(map(all, lines))
    frame = result.to_pandas()
    assert frame["K"].isna().all() if "K" in frame else True
    assert same(frame["fitted_force"], whole.to_pandas()["fitted_force"])
    parameters = result.to_xarray()["parameters"]
    assert parameters.shape[0] == len(CONTACT)
    assert parameters.isnull().all()
    assert repr(result) == repr(whole)
    assert result.summary() == whole.summary()
    assert result.by_segment().noticed is not None


@pytest.mark.parametrize("trace", [False, 0.2, 50])
@pytest.mark.parametrize("table", ["trace.parquet", "trace.csv"])
def test_a_thinned_trace_is_saved_and_read_back(trace, table, tmp_path, monkeypatch):
    from palpate.output.reports import identification

    monkeypatch.setattr(identification, "has_pyarrow", lambda: table == "trace.parquet")
    monkeypatch.setattr(identification, "page", lambda *_: "")  # which is drawn for seconds
    result = identify(CONTACT, trace=trace)
    result.save(tmp_path)
    found = palpate.load_result(tmp_path / "result.json").trace
    assert (tmp_path / table).exists()
    for name in found.__dataclass_fields__:
        assert same(getattr(found, name), getattr(result.trace, name)), name


def test_a_diagnosis_writes_no_estimates_down(monkeypatch):
    written, replay = [], palpate.VariableProjection.replay

    def watched(self, *arrays, at=None):
        written.append(at)
        return replay(self, *arrays, at=at)

    monkeypatch.setattr(palpate.VariableProjection, "replay", watched)
    diagnose(contact_of(exciting(MATERIALS["ball"], noise=0.02), surface_deviation=1e-5))
    assert written
    assert all(at is not None and not len(at) for at in written)
