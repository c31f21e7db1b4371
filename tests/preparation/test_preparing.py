"""From a recording, a file, a frame or arrays to a contact: one way, the same numbers."""

import dataclasses
import inspect
import math
import pickle
import sys
import types

import faults
import numpy as np
import pandas
import polars
import pytest
from cases import MATERIALS, exciting
from recordings import HEADER, SIGNALS, recording, rows_of, text_of, written

import palpate
from palpate import Columns, InvalidParameterError, Recording, RecordingError, prepare
from palpate.fleet.arrays import Curves
from palpate.fleet.tasks import Settings
from palpate.input.preparation.options import Options, describe_option
from palpate.input.preparation.preparing import join_contacts
from palpate.input.preparation.velocity import velocity_of
from palpate.input.recordings import opening

CHANNELS = ("time", "penetration", "velocity", "force")
ARRAYS = {name: getattr(SIGNALS, name) for name in ("time", "penetration", "force")}
TABLE = {"time_s": SIGNALS.time, "penetration_m": SIGNALS.penetration, "force_N": SIGNALS.force}
FRAMES = pytest.mark.parametrize("frame", [pandas.DataFrame, polars.DataFrame])


def numbers(contact: palpate.Contact) -> list[bytes]:
    return [getattr(contact, name).tobytes() for name in CHANNELS]


def recorded(**channels) -> Recording:
    return Recording({**TABLE, **channels}, source="probe.bag")


def test_file_recording_frame_and_arrays_give_the_same_contact(tmp_path):
    path = recording(tmp_path)
    expected = numbers(prepare(**ARRAYS))
    for source in (
        path, str(path), palpate.open_recording(path), recorded(), pandas.DataFrame(TABLE),
        polars.DataFrame(TABLE),
    ):  # fmt: skip
        assert numbers(prepare(source)) == expected


def test_a_velocity_that_is_there_is_taken():
    given = prepare(**vars(SIGNALS), provenance={"velocity": "a tachometer"})
    assert np.array_equal(given.velocity, SIGNALS.velocity)
    assert given.provenance == {"velocity": "a tachometer"}
    column = prepare(recorded(velocity_m_s=SIGNALS.velocity))
    assert np.array_equal(column.velocity, SIGNALS.velocity)
    assert column.provenance["velocity"] == "column 'velocity_m_s'"


def test_velocity_is_never_taken_across_a_segments_border():
    signals = exciting(MATERIALS["ball"], seconds=0.5)
    parts = [slice(0, 100), slice(100, 101), slice(101, 103), slice(103, 500)]
    labels = np.concatenate([np.full(p.stop - p.start, k) for k, p in enumerate(parts)])
    jump = signals.penetration + 1e-3 * labels
    given = {"time": signals.time, "penetration": jump, "force": signals.force}
    apart = prepare(**given, segment=labels)
    for part in parts:
        assert np.array_equal(apart.velocity[part], velocity_of(signals.time[part], jump[part]))
    assert np.max(np.abs(prepare(**given).velocity)) > 5.0 * np.max(np.abs(apart.velocity))


@pytest.mark.parametrize(
    "column",
    [
        pandas.Series([None, *SIGNALS.force[1:]]),
        polars.Series([None, *SIGNALS.force[1:]]),
        pandas.Series([pandas.NA, *SIGNALS.force[1:]], dtype=object),
        np.r_[math.nan, SIGNALS.force[1:]],
    ],
    ids=["pandas", "polars", "pandas objects", "NumPy"],
)
def test_unknown_values_are_nan(column):
    frame = polars.DataFrame if isinstance(column, polars.Series) else pandas.DataFrame
    contact = prepare(frame({**TABLE, "force_N": column}))
    assert np.isnan(contact.force).nonzero()[0].tolist() == [0]


@FRAMES
def test_a_frame_with_text_in_a_cell_is_refused_by_column_and_sample(frame):
    force = ["1.5"] * 600
    assert (prepare(frame({**TABLE, "force_N": force})).force == 1.5).all()
    force[7] = "n/a"
    with pytest.raises(
        RecordingError, match=r"^column 'force_N', sample 7: 'n/a' is not a number; drop --strict"
    ):
        prepare(frame({**TABLE, "force_N": force}), strict=True)
    lenient = prepare(frame({**TABLE, "force_N": force}))
    assert np.flatnonzero(np.isnan(lenient.force)).tolist() == [7]
    words = "excluded 1 sample of 'force_N' without a usable number: 'n/a'"
    assert words in lenient.findings[0].message


def test_a_time_of_day_is_counted_from_the_first():
    days = pandas.Series(pandas.date_range("2026-01-01", periods=600, freq="ms"))
    for time in (days, days - days[0]):
        contact = prepare(pandas.DataFrame({**TABLE, "time_s": time}))
        np.testing.assert_array_equal(contact.time, 1e-9 * (1_000_000 * np.arange(600)))


@pytest.mark.parametrize("bad", [3, [1.0, 2.0], polars.DataFrame(TABLE).lazy()])
@pytest.mark.filterwarnings("ignore::polars.exceptions.PerformanceWarning")
def test_unsupported_recordings_are_refused(bad):
    words = "^recording must be a Recording, a path, or a table such as a pandas or polars"
    for call in (prepare, palpate.identify):
        with pytest.raises(InvalidParameterError, match=words):
            call(bad)


SOME = np.arange(600) % 100 == 3
WRONG_ARRAYS = {
    "^time is missing": {**ARRAYS, "time": None},
    "^penetration is missing": {**ARRAYS, "penetration": None},
    "^force is missing": {**ARRAYS, "force": None},
    "^pass a recording or arrays, not both: name the channel velocity": {
        "recording": recorded(),
        "velocity": SIGNALS.time,
    },
    "time has 600, penetration has 600, force has": {**ARRAYS, "force": np.ones(3)},
    r"sample 1 is 0\.0 s after 0\.0 s": {**ARRAYS, "time": np.zeros(600)},
    **{
        rf"{name} must not be masked, but 6 values are": {
            **ARRAYS, name: np.ma.masked_array(vars(SIGNALS)[name], SOME),
        }
        for name in ("penetration", "velocity", "force")
    },
}  # fmt: skip


@pytest.mark.parametrize("words, given", WRONG_ARRAYS.items(), ids=WRONG_ARRAYS)
def test_arrays_that_make_no_contact_are_refused_by_name(words, given):
    with pytest.raises(InvalidParameterError, match=words):
        prepare(**given)


@pytest.mark.parametrize("name", CHANNELS)
@pytest.mark.parametrize("bad", [["a"] * 600, [10**400] * 600, 1j * np.ones(600)], ids="thc")
def test_arrays_of_another_type_are_refused_by_name(name, bad):
    with pytest.raises(InvalidParameterError, match=f"^{name} must be an array of real numbers"):
        prepare(**{**vars(SIGNALS), name: bad})
    column = {"time": "time_s", "force": "force_N"}.get(name)
    if column:
        with pytest.raises(RecordingError, match=f"^probe.bag: column '{column}'"):
            prepare(recorded(**{column: bad}))


def test_a_recordings_channels_are_arrays_without_a_mask():
    assert Recording({"a": [1, 2]}).numbers("a").tolist() == [1.0, 2.0]
    with pytest.raises(InvalidParameterError, match="channel 'a' must be an array, not list"):
        Recording({"a": [[1], [2, 3]]})
    with pytest.raises(InvalidParameterError, match="channel 'a' must not be masked"):
        Recording({"a": np.ma.masked_array(SIGNALS.force, SOME)})
    # A mask that hides nothing is not worth a word.
    contact = prepare(**{**ARRAYS, "force": np.ma.masked_array(SIGNALS.force)})
    assert list(contact.provenance) == ["velocity"]


def test_a_missing_column_raises_an_error_that_names_it():
    for role in ("velocity", "segment", "force"):
        with pytest.raises(palpate.MissingChannelError) as caught:
            prepare(recorded(), columns=Columns(**{role: "Fz"}))
    error = caught.value
    assert (error.channel, error.available) == ("Fz", list(TABLE))
    assert str(error) == ("probe.bag: no column 'Fz'; available: time_s, penetration_m, force_N")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # as from another process


def test_a_note_does_not_overwrite_what_was_done_and_is_kept(tmp_path):
    notes = "# velocity: by a wizard\n# force: a feather\n# probe: 7\n"
    path = written(tmp_path / "n.csv", notes + text_of(rows_of()))
    provenance = prepare(path).provenance
    assert "spline" in provenance["velocity"]
    assert provenance["note on velocity"] == "by a wizard"
    assert provenance["force"] == "column 'force_N'"
    assert provenance["note on force"] == "a feather"
    assert provenance["probe"] == "7"
    assert "spline" in prepare(path, provenance={"velocity": "mine"}).provenance["velocity"]


@pytest.mark.parametrize("window", [None, 0.05])
def test_steps_too_short_for_any_velocity_are_refused_by_row(tmp_path, window):
    rows = [[repr(5e-324 * k), repr(1e-3 * k), "1"] for k in range(30)]
    path = written(tmp_path / "s.csv", text_of(rows, HEADER))
    with pytest.raises(RecordingError, match=r"column 'time_s', row 3: 4\.94066e-324 s is hardly"):
        prepare(path, velocity_window=window, strict=True)
    assert len(prepare(path, velocity_window=window)) == 1


def test_empty_and_huge_inputs_give_no_warning():
    assert len(prepare(time=[], penetration=[], force=[])) == 0
    with pytest.raises(RecordingError, match=r"^probe\.bag: the recording has no samples"):
        prepare(recorded(time_s=[], penetration_m=[], force_N=[]))
    absurd = np.where(np.arange(600) % 2, 1e308, -1e308)
    for samples in (2, 600):
        given = {name: values[:samples] for name, values in ARRAYS.items()}
        velocity = prepare(**{**given, "penetration": absurd[:samples]}).velocity
        assert not (np.abs(velocity) < 1e300).any()


@pytest.mark.parametrize("name", TABLE)
@pytest.mark.parametrize("filling", [1.0, "1.0"])
def test_a_channel_of_several_numbers_a_sample_is_refused(name, filling):
    with pytest.raises(RecordingError, match=rf"'{name}': must have one number per .*\(600, 3\)"):
        prepare(recorded(**{name: np.full((600, 3), filling)}))


def test_a_new_format_needs_one_module_and_one_row(monkeypatch, tmp_path):
    module = types.ModuleType("toy_format")
    module.read = lambda path, request: recorded()
    monkeypatch.setitem(sys.modules, "toy_format", module)
    row = palpate.input.recordings.Format("toy", (".toy",), "toy_format")
    monkeypatch.setattr(opening, "FORMATS", [*opening.FORMATS, row])
    (tmp_path / "a.TOY").write_bytes(b"toy")
    assert numbers(prepare(tmp_path / "a.TOY")) == numbers(prepare(recorded()))
    for suffix in ("", ".txt", ".log"):
        assert len(prepare(recording(tmp_path, f"probe{suffix}"))) == 600


def coarse(**more) -> palpate.Contact:
    """A probe whose encoder is coarse: the velocity is noisy, and the damping too small."""
    time = np.arange(3000) * 1e-3
    x = 4e-3 + 2e-3 * np.sin(12.0 * time) + 0.5e-3 * np.sin(31.0 * time)
    v = np.gradient(x, time)
    random = np.random.default_rng(3)
    force = palpate.HuntCrossley(K=2e3, B=2e3, n=1.3).force(x, v) + random.normal(0.0, 0.02, x.size)
    noisy = x + random.normal(0.0, 1e-4, x.size)
    return prepare(time=time, penetration=noisy, force=force, **more)


def checks_of(contact: palpate.Contact) -> list[str]:
    return [each.check for each in palpate.identify(contact, trace=False).diagnosis.findings]


def test_no_note_of_a_user_changes_what_is_known_of_the_velocity(tmp_path):
    """What a later step needs to know is a field, whatever the provenance says."""
    plain = coarse(velocity_window=15e-3)
    assert "velocity noise" in checks_of(plain)
    expected = palpate.identify(plain).diagnosis
    words = {"velocity": "centred differences in the controller"}
    noted = coarse(velocity_window=15e-3, provenance=words)
    for contact in (noted, dataclasses.replace(plain, provenance={"velocity": "mine"})):
        found = palpate.identify(contact).diagnosis
        assert found.verdict == expected.verdict
        assert found.findings == expected.findings
    recorded = palpate.Contact(**{name: getattr(plain, name) for name in CHANNELS})
    assert recorded.velocity_filter is None
    told = dataclasses.replace(recorded, provenance=words)
    assert (
        palpate.identify(told).diagnosis.findings == palpate.identify(recorded).diagnosis.findings
    )


def test_a_contact_keeps_how_its_velocity_was_computed(tmp_path, undrawn):
    contact = coarse(velocity_window=31e-3)
    filtered = palpate.VelocityFilter(31, 2)
    assert contact.velocity_filter == filtered
    arrays = {name: getattr(contact, name) for name in CHANNELS}
    given = prepare(**arrays)
    assert given.velocity_filter is None
    recorded = palpate.Contact(**arrays)
    palpate.write_contact(contact, tmp_path / "own.csv", velocity=True)
    palpate.write_contact(recorded, tmp_path / "other.csv", velocity=True)
    result = palpate.identify(contact)
    result.save(tmp_path / "result")
    saved = palpate.load_result(tmp_path / "result").contact
    online = palpate.OnlinePreparation(velocity_window=31e-3)
    for each in (
        contact.window(0.5, 2.0),
        contact.taken(slice(100, 900)),
        pickle.loads(pickle.dumps(contact)),
        join_contacts([contact, contact]),
        join_contacts([given, contact]),  # of one of them only, which is enough to doubt
        result.contact,
        prepare(tmp_path / "own.csv"),
        saved,
        prepare(tmp_path / "result" / "trace.parquet"),
        online.replay(contact.penetration, contact.force),
    ):
        assert each.velocity_filter == filtered
    assert prepare(tmp_path / "other.csv").velocity_filter is None
    assert join_contacts([given, given]).velocity_filter is None
    spline = prepare(tmp_path / "own.csv", columns=Columns(velocity="none"))
    assert spline.velocity_filter.penalty > 0.0
    palpate.identify(spline).save(tmp_path / "spline")
    assert (
        palpate.load_result(tmp_path / "spline").contact.velocity_filter == spline.velocity_filter
    )
    with pytest.raises(InvalidParameterError, match="samples must be in"):
        palpate.VelocityFilter(2, 2)


def test_rows_of_arrays_know_that_their_velocity_was_computed():
    contact = coarse()
    arrays = {"penetration": contact.penetration[None], "force": contact.force[None]}
    curves = Curves(contact.time, **arrays).add_velocities()
    assert curves.contact(0, Settings()).velocity_filter == contact.velocity_filter
    assert dataclasses.replace(curves, filters=None).contact(0, Settings()).velocity_filter is None


# Clocks that tick slowly, and rows that were written twice.


def in_ticks(tick: float, rate: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Two seconds of touches at a rate, under the stamps of a timer."""
    time = np.arange(round(2.0 * rate)) / rate
    x = 2e-3 - 6e-3 * np.cos(8.0 * time)
    force = np.where(x > 0.0, 6000.0 * np.maximum(x, 0.0) ** 1.3, 0.0)
    force += 1e-3 * np.random.default_rng(3).standard_normal(x.size)
    stamps = np.floor(time / tick + 1e-9) * tick
    return time, {"time": stamps, "penetration": x, "force": force}


@pytest.mark.parametrize("rate", [500.0, 1000.0, 730.0])
@pytest.mark.parametrize("tick", [0.01, 0.008, 0.02])
def test_the_samples_of_a_slow_clock_are_spread_within_its_ticks(tick, rate):
    time, arrays = in_ticks(tick, rate)
    names = zip(("time_s", "penetration_m", "force_N"), arrays.values(), strict=True)
    columns = dict(names)
    milliseconds = {**columns, "time_ms": np.rint(1e3 * columns["time_s"]).astype(np.int64)}
    del milliseconds["time_s"]
    counts = {**columns, "time_ns": np.rint(1e9 * columns["time_s"]).astype(np.int64)}
    del counts["time_s"]
    made = [prepare(**arrays), prepare(pandas.DataFrame(columns))]
    made += [prepare(Recording(each)) for each in (milliseconds, counts)]
    for contact in made:
        assert len(contact) == time.size
        assert np.max(np.abs(contact.time - time - (contact.time - time).mean())) < 0.01 / rate * (
            1.0 if round(tick * rate, 6).is_integer() else 200.0
        )
        [finding] = contact.findings
        assert finding.severity == "note"
        assert finding.message.startswith(f"the clock ticks every {1e3 * tick:g} ms")
    with pytest.raises(RecordingError):
        prepare(Recording(columns), strict=True)


def test_times_of_a_slow_clock_stay_within_its_ticks():
    time, arrays = in_ticks(0.01, 500.0)
    keep = np.ones(time.size, dtype=bool)
    keep[300:500] = False
    keep[700::3] = False
    contact = prepare(**{name: values[keep] for name, values in arrays.items()})
    assert np.all(np.diff(contact.time) > 0.0)
    late = contact.time - arrays["time"][keep]
    assert late.min() > -1e-9
    assert late.max() < 0.01


@pytest.mark.parametrize("size", [2, 3, 8])
def test_samples_that_arrive_in_packets_are_spread_evenly(size):
    """Seed 3. Stamped 2 % of a step apart, on arrival."""
    time, x, v = faults.motion()
    noisy = faults.noisy(faults.pushed(x, v), seed=3)
    place, step = np.arange(time.size), time[1] - time[0]
    arrivals = time + 0.98 * step * (size - 1 - place % size)
    contact = prepare(time=arrivals, penetration=x, force=noisy)
    [finding] = contact.findings
    assert finding.message.startswith(f"samples arrive in packets of about {size}, every ")
    late = contact.time - time
    assert np.ptp(late[size:-size]) < 0.05 * step
    found = palpate.identify(contact).working_depths[0]
    assert found.damping.value == pytest.approx(faults.LAW.damping_at(found.depth), rel=0.05)


def test_samples_that_are_taken_in_bursts_keep_their_times():
    """Eight samples within 0.14 ms, every 8 ms, of a motion that goes on meanwhile."""
    bursts = np.arange(800) // 8 * 8e-3 + np.arange(800) % 8 * 2e-5
    x = 2e-3 * (1.0 - np.cos(2.0 * np.pi * 2.0 * bursts))
    contact = prepare(time=bursts, penetration=x, force=2e3 * x)
    assert np.array_equal(contact.time, bursts)


@pytest.mark.parametrize("way", ["arrays", "file", "frame"])
def test_rows_written_twice_are_dropped_with_a_note(way, tmp_path):
    twice = np.sort(np.r_[np.arange(500), [7, 7, 90, 300]])
    arrays = {name: np.asarray(values)[:500][twice] for name, values in ARRAYS.items()}
    columns = dict(zip(("time_s", "penetration_m", "force_N"), arrays.values(), strict=True))
    frame = pandas.DataFrame(columns)
    if way == "arrays":
        contact = prepare(**arrays)
    elif way == "frame":
        contact = prepare(frame)
    else:
        frame.to_csv(tmp_path / "twice.csv", index=False)
        contact = prepare(tmp_path / "twice.csv")
    assert np.array_equal(contact.time, np.asarray(ARRAYS["time"])[:500])
    [finding] = contact.findings
    assert (finding.check, finding.severity) == ("rows", "note")
    assert finding.message == "palpate dropped 4 rows that were written twice, of 504"


def test_repeated_times_in_arrays_are_refused():
    arrays = {name: np.array(values[:500]) for name, values in ARRAYS.items()}
    arrays["time"][20] = arrays["time"][19]
    with pytest.raises(InvalidParameterError, match="time must be finite and increase"):
        prepare(**arrays)


# Positions that were commanded.


@pytest.mark.parametrize("name", ["goal_pos", "action_pos", "cmd_pos", "target_tcp", "desiredPos"])
def test_a_commanded_position_calls_for_care(name):
    _, arrays = in_ticks(1e-3, 500.0)
    zero = np.zeros_like(arrays["force"])
    channels = {"time_s": np.arange(zero.size) / 500.0}
    channels |= {
        f"{name}_{a}": v for a, v in zip("xyz", (zero, zero, -arrays["penetration"]), strict=True)
    }
    channels |= {f"f{a}": v for a, v in zip("xyz", (zero, zero, arrays["force"]), strict=True)}
    contact = prepare(Recording(channels))
    [finding] = [each for each in contact.findings if each.check == "channels"]
    assert finding.severity == "with-care"
    assert (
        "commanded position, not a measured one: the robot's own compliance is in the numbers"
        in (finding.message)
    )


@pytest.mark.parametrize("name", [option.name for option in dataclasses.fields(Options)])
def test_each_option_is_described_once(name):
    parameter = inspect.signature(prepare).parameters[name]
    assert parameter.default == getattr(Options(), name)
    assert prepare.__doc__.count(f"\n    {name} : ") == 1
    described = describe_option(name)
    assert described.endswith(".")
    assert described[:20] in " ".join(prepare.__doc__.replace('``"', "").replace('"``', "").split())


def test_a_wrong_argument_of_prepare_is_named_by_python():
    with pytest.raises(TypeError, match=r"prepare\(\) got an unexpected keyword argument 'tara'"):
        prepare(tara="find")


@pytest.mark.parametrize("flip", ["force", ["force"], ("force",)])
def test_one_name_to_flip_is_as_good_as_a_list_of_one(flip):
    contact = prepare(**ARRAYS | {"force": -SIGNALS.force}, flip=flip)
    np.testing.assert_array_equal(contact.force, SIGNALS.force)
