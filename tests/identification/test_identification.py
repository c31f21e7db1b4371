"""A whole contact, with one method or with all of them, and its figures of merit."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pandas
import polars
import pytest
from cases import MATERIALS, Signals, bits, contact_of, exciting, tapping
from recordings import recording

import palpate
from palpate import (
    ESTIMATORS,
    ConstantForgetting,
    Contact,
    ContactGate,
    HuntCrossley,
    InvalidParameterError,
    OutlierRejection,
    RecordingError,
    Scale,
    SingleStageRLS,
    Status,
    Trace,
    ViscoelasticContact,
    compare,
    identify,
)
from palpate.input.preparation.gate import choose_gate, suggest_scale
from palpate.method.estimators.contact_estimator import CompiledEstimator
from palpate.method.estimators.estimate import (
    prediction_rmse_percent,
    rmse_percent,
    violated_fraction,
)

RECORDED = Path(__file__).parents[2] / "examples" / "recordings" / "ball.csv"
CONTACT = contact_of(tapping(MATERIALS["ball"], noise=0.02, seed=1))


def test_identify_chooses_the_gate_and_the_scale_it_is_not_given(kind):
    result = identify(CONTACT, kind())
    assert result.gate == choose_gate(CONTACT)
    assert result.scale == suggest_scale(CONTACT)
    assert bits(identify(CONTACT, kind.method).trace) == bits(result.trace)
    assert identify(CONTACT).method == "variable-projection"  # unless it is told


def test_identify_does_not_change_the_given_estimator(kind):
    gate, scale = ContactGate(5e-4, 0.5), Scale(1e-3, 1e-2, 1.0)
    given = kind(
        outlier_rejection=OutlierRejection(20.0),
        gate=gate,
        scale=scale,
        forgetting=ConstantForgetting(1.0),
        sample_time=2e-3,
    )
    given.update(0.01, 0.0, 5.0)
    before = given._state()
    first, second = identify(CONTACT, given), identify(CONTACT, given)
    assert first.estimator.settings == given.settings
    assert (first.gate, first.scale) == (gate, scale)
    assert given._state() == before
    assert bits(first.trace) == bits(second.trace)  # it starts afresh
    assert identify(CONTACT, plain := kind()).gate is not None
    assert plain.settings["gate"] is None


def test_a_segments_border_ends_contact(kind):
    signals = exciting(MATERIALS["ball"], noise=0.05, seed=2)
    gate, scale = ContactGate(1e-3, 1.0), Scale(15e-3, 50e-3, 30.0)
    contact = contact_of(signals, segment=np.arange(1000) // 400)
    result = identify(contact, kind(gate=gate, scale=scale))
    by_hand = kind(gate=gate, scale=scale)
    for part in (slice(0, 400), slice(400, 800), slice(800, 1000)):
        by_hand.update(0.0, 0.0, 0.0)
        by_hand.replay(*signals[part].arrays, contact.time_steps[part])
    assert np.array_equal(by_hand.estimate().parameters, result.law.parameters)
    assert result.trace.taken.all()


def test_an_identification_can_go_on(kind):
    result = identify(CONTACT, kind(outlier_rejection=False))  # a jump to another place is one
    before = result.estimate.samples
    result.estimator.update(5e-3, 0.0, 10.0)
    assert result.estimate.samples == before + 1


def test_the_figures_of_merit_are_of_the_samples_taken(kind):
    result = identify(CONTACT, kind())
    taken = result.trace.taken
    assert 0 < taken.sum() < len(CONTACT)
    fitted = result.law.force(CONTACT.penetration[taken], CONTACT.velocity[taken])
    assert result.fit_rmse_percent == rmse_percent(CONTACT.force[taken], fitted)
    # 0.02 N of noise on some 4 N is 0.5 %, beside what one law in place of another leaves.
    assert 0.1 < result.fit_rmse_percent < 10.0
    assert result.estimate.valid == (result.estimate.validity_margin > 0.0)
    if result.law.kind == "hunt-crossley":
        assert result.violated_fraction == np.mean(~result.trace.validity[taken])
    else:
        assert math.isnan(result.violated_fraction)


def test_compare_gives_every_method_the_same_samples():
    results = compare(CONTACT)
    assert list(results) == list(ESTIMATORS)
    for method, result in results.items():
        assert result.method == method
        if not result.estimator.chooses_samples:
            assert np.array_equal(result.trace.taken, results["single-stage"].trace.taken)
        alone = identify(CONTACT, ESTIMATORS[method]())
        if alone.method == method:  # a selected Hunt–Crossley law has variable projection's numbers
            assert bits(result.trace) == bits(alone.trace)
    gate = ContactGate(1e-3, 2.0)
    assert all(result.gate == gate for result in compare(CONTACT, gate=gate).values())


def test_a_result_is_plain_numbers_and_words(kind):
    result = identify(CONTACT, kind())
    plain = result.as_dict()
    law = result.law
    assert plain["method"] == kind.method
    assert plain["law"] == {"kind": law.kind, **law.as_dict()}
    errors = dict(zip(law.as_dict(), result.standard_errors.tolist(), strict=True))
    assert plain["standard_errors"] == errors
    assert (result.standard_errors >= result.estimate.standard_errors).all()
    assert plain["fit_rmse_percent"] == result.fit_rmse_percent
    assert plain["prediction_rmse_percent"] == result.prediction_rmse_percent
    assert plain["contact_samples"] == result.estimate.samples
    if law.kind != "hunt-crossley":
        assert plain["violated_fraction"] is None


def flags_of(signals: Signals) -> str:
    return "; ".join(identify(contact_of(signals), SingleStageRLS()).flags)


BALL = exciting(HuntCrossley(K=2000.0, B=500.0, n=1.0), seconds=1.0, noise=0.02, seed=4)


STILL = Signals(np.arange(5000) * 1e-3, np.full(5000, 0.01), np.zeros(5000), np.full(5000, 9.0))
FLAGGED = {
    "few samples": (BALL[:20], SingleStageRLS, {}, ("only 20 samples in contact", "than 0.2 s of")),
    "negative damping": (
        exciting(palpate.KelvinVoigt(K=1500.0, B=-8.0)),
        palpate.KelvinVoigtRLS, {}, ("negative damping",)
    ),
    "condition 10": (  # the limit is 10 mm/s of 50
        exciting(HuntCrossley(K=2000.0, B=20000.0, n=1.0), noise=0.02, seed=5),
        SingleStageRLS, {}, ("|v| ≥ 0.1 K/B in", "%"),
    ),
    "guard": (
        STILL,
        SingleStageRLS, {"forgetting": ConstantForgetting(0.9)}, ("covariance was limited on",)
    ),
}  # fmt: skip


@pytest.mark.parametrize("signals, kind, settings, words", FLAGGED.values(), ids=FLAGGED)
def test_doubtful_contacts_are_flagged(signals, kind, settings, words):
    flags = "; ".join(identify(contact_of(signals), kind(**settings)).flags)
    assert all(each in flags for each in words)
    assert identify(contact_of(BALL), palpate.KelvinVoigtRLS()).flags == ()


def test_refused_samples_are_counted_by_channel():
    force, depth = BALL.force.copy(), BALL.penetration.copy()
    force[[100, 200, 300]] = math.nan
    flags = flags_of(dataclasses.replace(BALL, force=force))
    assert "3 samples rejected: not finite: force is NaN or infinite in 3 of 1000" in flags
    force[[100, 200, 300]] = 1e300
    assert "3 samples rejected: out of range" in flags_of(dataclasses.replace(BALL, force=force))
    depth[[100, 200]] = math.nan
    table = {"time_s": BALL.time, "penetration_m": depth, "force_N": BALL.force}
    flags = "; ".join(identify(palpate.Recording(table)).flags)
    # The velocity is worked out from the depth: that it is not known either goes without saying.
    words = "penetration (column 'penetration_m') is NaN or infinite in 2 of 1000"
    assert f"2 samples rejected: not finite: {words}" in flags
    assert "velocity" not in flags


def test_no_contact_is_an_error_that_names_the_gate():
    with pytest.raises(RecordingError, match=r"^probe\.csv: no contact found") as caught:
        identify(contact_of(BALL, source="probe.csv"), SingleStageRLS(gate=ContactGate(0.5, 7.0)))
    words = str(caught.value)
    assert "above 0.5 m and force above 7 N" in words
    assert f"{BALL.penetration.max():.3g} m and {BALL.force.max():.3g} N" in words
    unknown = np.full(10, math.nan)
    nothing = Contact(np.arange(10.0), penetration=unknown, velocity=unknown, force=unknown)
    for contact, words in (
        (contact_of(BALL[:0]), "there are no samples"),
        (nothing, "the largest are no m and no N"),
    ):
        with pytest.raises(RecordingError, match=words):
            identify(contact)


def test_a_contact_without_a_velocity_says_so():
    unknown = dataclasses.replace(BALL, velocity=np.full(len(BALL), math.nan))
    origin = {"velocity": "column 'speed'"}
    with pytest.raises(RecordingError, match=r"^p\.csv: no sample in contact has a vel") as caught:
        identify(contact_of(unknown, source="p.csv", provenance=origin))
    words = str(caught.value)
    assert "velocity (column 'speed') is NaN or infinite in 1000 of 1000" in words
    assert "differentiate the penetration" in words
    # In contact only: the rest of the channel does not hide it.
    contact = contact_of(tapping(MATERIALS["ball"]), provenance=origin)
    known = np.where(contact.penetration > 0.0, math.nan, contact.velocity)
    assert 0 < np.isfinite(known).sum() < len(known)
    with pytest.raises(RecordingError, match="no sample in contact has a velocity"):
        identify(dataclasses.replace(contact, velocity=known), "kelvin-voigt")


@pytest.mark.parametrize("frame", [pandas.DataFrame, polars.DataFrame])
def test_identify_and_compare_take_what_is_not_yet_a_contact(frame, tmp_path):
    path = recording(tmp_path)
    contact = palpate.prepare(path)
    expected = {name: bits(result.trace) for name, result in compare(contact).items()}
    opened = palpate.open_recording(path)
    for source in (path, str(path), opened, frame(dict(opened.channels))):
        assert bits(identify(source).trace) == expected["variable-projection"]
        results = compare(source, gate=None)
        assert {name: bits(result.trace) for name, result in results.items()} == expected


def test_unknown_recordings_and_estimators_are_refused_by_name():
    with pytest.raises(InvalidParameterError, match=r"^recording must be a Recording"):
        identify([1.0, 2.0])
    for wrong, words in (("spring", "method"), (SingleStageRLS, "estimator"), (3, "estimator")):
        with pytest.raises(InvalidParameterError, match=rf"^{words} must be ") as caught:
            identify(CONTACT, wrong)
        assert all(name in str(caught.value) for name in ESTIMATORS)
        assert repr(wrong) in str(caught.value)


def trace_of(status, predicted, margin=1.0) -> Trace:
    size = len(status)
    return Trace(
        np.zeros((size, 2)),
        np.zeros((size, 2)),
        np.asarray(predicted, dtype=float),
        np.broadcast_to(np.asarray(margin, dtype=float), (size,)),
        np.asarray(status, dtype=np.uint8),
    )


@pytest.mark.parametrize("unit", [1, 1e-9])
@pytest.mark.parametrize(
    "measured, predicted, expected",
    [
        ([3.0, 4.0], [3.0, 4.0], 0.0),
        ([3.0, 4.0], [0.0, 0.0], 100.0),
        ([-3.0, 4.0], [-3.0, 3.5], 10.0),
        ([], [], math.nan),
        ([0.0, 0.0], [0.0, 0.0], math.nan),
    ],
)
def test_rmse_percent_is_the_error_as_a_share_of_the_force(measured, predicted, expected, unit):
    found = rmse_percent([unit * f for f in measured], [unit * f for f in predicted])
    # Two squares, a root: a few roundings.
    assert found == pytest.approx(expected, rel=1e-13, nan_ok=True)
    with pytest.raises(InvalidParameterError, match="measured has 2, predicted has 3"):
        rmse_percent([1.0, 2.0], [1.0, 2.0, 3.0])


def test_the_prediction_error_counts_settled_contact_only():
    status = [Status.UPDATED, Status.HELD, Status.HELD, Status.UPDATED, Status.GUARDED]
    steps = np.array([0.15, 5.0, 5.0, 0.15, 0.15])
    trace = trace_of(status, [9.0, 9.0, 9.0, 1.1, 0.9])
    assert prediction_rmse_percent(trace, np.ones(5), steps) == pytest.approx(10.0, rel=1e-12)
    assert trace.taken.tolist() == [True, False, False, True, True]
    # Contact time after each sample taken: 0.1, 0.2, 0.3 … s; the first two are start-up.
    trace = trace_of(
        [Status.WAITING] * 2 + [Status.UPDATED] * 6, [9, 9, 99, 99, 2.2, 1.8, 2.2, 1.8]
    )
    steps = np.repeat([0.1, 0.0999], [2, 6])  # so that no rounding of 0.2 decides
    found = prediction_rmse_percent(trace, np.full(8, 2.0), steps)
    assert found == pytest.approx(10.0, rel=1e-12)
    short = trace_of([Status.UPDATED] * 10, np.ones(10))
    assert math.isnan(prediction_rmse_percent(short, np.ones(10), np.full(10, 0.01)))


def test_the_violated_fraction_is_of_the_samples_taken():
    status = [Status.WAITING, Status.UPDATED, Status.GUARDED, Status.UPDATED, Status.HELD]
    trace = trace_of(status, np.ones(5), [-1.0, 0.5, -0.5, 0.0, -1.0])
    assert violated_fraction(trace) == pytest.approx(2.0 / 3.0, rel=1e-15)  # 0 is at the limit
    assert math.isnan(violated_fraction(trace_of([Status.WAITING] * 3, np.ones(3))))


@pytest.mark.parametrize("law, often", [(None, [1, 2]), ("hunt-crossley", [0, 1])])
def test_identify_replays_the_law_with_relaxation_as_often_as_it_must(monkeypatch, law, often):
    replayed, real = [], CompiledEstimator.replay
    monkeypatch.setattr(
        CompiledEstimator,
        "replay",
        lambda self, *given, **more: replayed.append(self.method) or real(self, *given, **more),
    )
    assert identify(RECORDED, law=law).diagnosis.verdict.overall == "trust"
    # A selected Hunt–Crossley law once more, by variable projection.
    assert [replayed.count(ViscoelasticContact.method), len(replayed)] == often
