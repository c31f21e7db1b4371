"""The loop is the same recursion as everywhere, and says what is wrong with a source."""

import gc
import math

import numpy as np
import pytest
from scripted import PLACE, Scripted, Silence, T, arrivals, column, looped, measured, pressed, rings

import palpate
from palpate import ESTIMATORS, OnlinePreparation, Status, ViscoelasticContact
from palpate.findings import Finding
from palpate.live.choices import LiveCommand, State
from palpate.live.console import ShownDepth, describe_depth
from palpate.live.loop import Loop
from palpate.live.ring import COLUMNS, SAMPLE
from palpate.live.running import default_estimator
from palpate.live.sources import Arrival, EndOfSourceError, Replay
from palpate.live.view import verdict_on
from palpate.method.estimators.estimate import Trace

TIMES, POSITIONS, FORCES = measured()
SCRIPT = arrivals(TIMES, POSITIONS, FORCES)
PREPARED = "time", "penetration", "velocity", "force"


def touch(**more):
    return palpate.Contact(**vars(pressed()), **more)


def replay_of(times, positions, forces, estimator=None):
    """What the same recursion gives offline: the prepared contact, and the trace of it.

    By ``update``, ``estimate`` and ``predict``: a replay predicts by an estimate of a few samples
    before where each costs several samples.
    """
    contact = OnlinePreparation().replay(positions, forces, times)
    estimator = estimator or default_estimator()
    trace = Trace.empty(len(contact), len(estimator.law_type.symbols))
    columns = contact.penetration, contact.velocity, contact.force, contact.time_steps
    samples = list(zip(*(column.tolist() for column in columns), strict=True))
    for part in contact.segments():
        estimator.leave_contact()
        for k in range(len(contact))[part]:
            trace.predicted_force[k] = estimator.predict(*samples[k][:2])
            trace.status[k] = estimator.update(*samples[k])
            trace.parameters[k] = estimator.estimate().parameters
    return contact, trace


def same(rows, contact, trace, *, predicted=True):
    """The prepared samples and every estimate, to the last bit."""
    given = rows[np.isfinite(column(rows, "time"))]
    assert len(given) == len(contact)
    for name in PREPARED:
        np.testing.assert_array_equal(column(given, name), getattr(contact, name))
    size = trace.parameters.shape[1]
    found = np.column_stack([column(given, f"parameter_{k}") for k in range(size)])
    known = np.isfinite(found[:, 0])
    np.testing.assert_array_equal(found[known], trace.parameters[known])
    # Where an estimator starts is no estimate.
    learned = np.isin(trace.status, (Status.UPDATED, Status.GUARDED, Status.RESTARTED))
    np.testing.assert_array_equal(known, np.cumsum(learned) > 0)
    # The law and its regression in scaled units round a prediction differently.
    if predicted:
        force = column(given, "predicted_force")
        np.testing.assert_allclose(force, trace.predicted_force, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(column(given, "status"), trace.status)


@pytest.mark.parametrize("method", ESTIMATORS)
def test_the_loop_over_a_recording_is_the_replay_to_the_last_bit(method):
    estimator, source = ESTIMATORS[method](), Replay(touch(), speed=math.inf)
    source.open()
    loop, rows = looped((), estimator=estimator.copy(), source=source)
    # That of drift tracking is solved every other sample, from which its replay predicts.
    replay = replay_of(TIMES, POSITIONS, FORCES, estimator.copy())
    same(rows, *replay, predicted=method != "drift-tracking")
    assert loop.counts.taken == len(TIMES) == len(rows)
    assert loop.status()["counts"]["jumps"] == 0
    assert "N/m" in describe_depth(loop.status(), rows[-1], 8e-3)  # in the terminal's line


def test_estimates_are_published_at_50_hz_and_at_changes():
    commands = [(605, LiveCommand("reset")), (1333, LiveCommand("hold"))]
    _, each = looped(SCRIPT, commands=commands)
    _, rows = looped(SCRIPT, commands=commands, every_sample=False)
    size = len(SAMPLE)
    number = column(rows, "estimate")
    first = np.append(True, np.diff(number) > 0.0)
    # All that is of the sample is the same, and each estimate that of the sample it came with.
    differ = [SAMPLE.index(name) for name in ("cycle", "lateness", "estimate")]
    np.testing.assert_array_equal(*(np.delete(a[:, :size], differ, axis=1) for a in (each, rows)))
    np.testing.assert_array_equal(rows[first, size:], each[first, size:])
    assert np.diff(np.flatnonzero(first)).max() <= 21
    assert 100 <= number[-1] <= 108
    state = np.flatnonzero(np.diff(column(rows, "state"))) + 1
    assert first[[605, 1333, *state]].all()
    assert not any(name.startswith(("parameter", "covariance")) for name in SAMPLE)


def test_the_end_of_a_run_has_the_last_estimate():
    source = Replay(touch(), speed=math.inf)
    with rings() as (*rows, reader):
        estimator = default_estimator(palpate.VariableProjection)  # changes with every sample
        loop = Loop(source, OnlinePreparation(), estimator, *rows)
        loop.run()
        last = reader.take()[0][-1:]
        end = reader.now()
    parameters = loop.estimator.estimate().parameters
    assert column(end, "parameter_0") == parameters[0] != column(last, "parameter_0")
    np.testing.assert_array_equal(end[:, : len(SAMPLE)], last[:, : len(SAMPLE)])


def depths_shown(depths, every=0.2):
    shown, found = ShownDepth(), []
    rows = np.zeros((len(depths), len(COLUMNS)))
    rows[:, PLACE["time"]] = T * np.arange(len(depths))
    rows[:, PLACE["penetration"]], rows[:, PLACE["state"]] = depths, State.CONTACT
    for look in np.split(rows, range(0, len(rows), round(every / T))[1:]):
        shown.see(look)
        found.append(shown.value)
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize("every", [0.033, 0.2], ids=["the page", "the console"])
def test_the_shown_depth_follows_a_new_motion(every):
    time = T * np.arange(60_000)
    # Its median lies between 8.8 and 8.9 mm, on either side in turns.
    swing = 8.85e-3 + 3e-3 * np.sin(2.0 * np.pi * 0.7 * time) + 2e-4 * np.sin(0.3 * time)
    found = depths_shown(swing, every)[round(10.0 / every) :]
    assert found[0] == pytest.approx(8.85e-3, rel=0.06)
    assert (found == found[0]).all()
    found = depths_shown(np.where(time < 20.0, swing, 1.3 * swing), every)
    assert len(set(found[round(40.0 / every) :])) == 1
    assert found[-1] == pytest.approx(1.3 * 8.85e-3, rel=0.06)


def test_a_law_is_shown_at_a_depth_that_stays():
    """Of a loop that compares laws: the motion's own depth and frequency are a running mean."""
    shown, depths, own = ShownDepth(), [], []

    def look():
        taken = loop.counts.taken
        if taken % 250 == 0 and (verdict := shown.verdict(loop.status(), taken * T)):
            depths.append(verdict.law.depth)
            own.append(verdict_on(loop.status()).law.depth)

    with rings() as (*rows, _):
        estimator, script = ViscoelasticContact(), arrivals(*measured(8.0))
        loop = Loop(Scripted(script), OnlinePreparation(), estimator, *rows, look)
        loop.run()
    assert len(set(own[8:])) > 1
    assert len(set(depths[8:])) == 1
    assert depths[-1] == pytest.approx(own[-1], rel=0.1)


@pytest.mark.parametrize(
    "values",
    [{"position": math.nan}, {"force": math.inf}, {"position": 1e300}],
    ids=["NaN", "infinite", "absurd"],
)
def test_samples_that_are_not_numbers_are_reported_and_forgotten(values):
    loop, rows = looped([*SCRIPT[:900], SCRIPT[900]._replace(**values), *SCRIPT[901:]])
    states = column(rows, "state")
    assert states[899] == State.CONTACT
    assert states[900] == State.INVALID
    # It is seen for half a second, and then is over.
    assert (states[900:1399] == State.INVALID).all()
    assert (states[1401:] == State.CONTACT).all()
    assert loop.counts.refused == 1
    assert any("NaN, infinite" in words for words in loop.said)
    assert loop.status()["fault"] == ""  # it is over
    # But for that sample, whose window has a hole, all is as if it had never come.
    gone = ([*each[:900], *each[901:]] for each in (TIMES, POSITIONS, FORCES))
    same(rows, *replay_of(*gone))


STALLED = [each._replace(there=1.5) for each in SCRIPT[1000:1500]]


@pytest.mark.parametrize(
    "script, counted, invalid",
    [
        (
            [*SCRIPT[:901], *[SCRIPT[900]] * 3, *SCRIPT[901:]],
            {"repeated": 3, "refused": 3},
            slice(901, 904),
        ),
        ([*SCRIPT[:905], SCRIPT[900], *SCRIPT[905:]], {"disordered": 1}, slice(905, 906)),
        (
            [*SCRIPT[:1000], Silence(0.5), *STALLED, *SCRIPT[1500:]],
            {"silences": 1, "refused": 0},
            slice(0),
        ),
    ],
    ids=["repeated", "after a later one", "a stall of the wire that loses nothing"],
)
def test_excess_and_late_samples_are_counted_and_ignored(script, counted, invalid):
    loop, rows = looped(script)
    counts = loop.status()["counts"]
    assert {name: counts[name] for name in counted} == counted
    assert (column(rows, "state")[invalid] == State.INVALID).all()
    same(rows, *replay_of(TIMES, POSITIONS, FORCES))


@pytest.mark.parametrize("jump", [-5.0, 40.0, -1.79e9], ids=["back", "ahead", "epoch to boot"])
def test_a_clock_that_is_set_is_seen_and_a_new_window_begins(jump):
    later = [time + jump * (k >= 1000) for k, time in enumerate(TIMES)]
    loop, rows = looped(arrivals(later, POSITIONS, FORCES, there=TIMES))
    states = column(rows, "state")
    assert states[999] == State.CONTACT
    assert states[1000] == State.INVALID
    assert states[-1] == State.CONTACT
    assert loop.status()["counts"]["jumps"] == 1
    assert any("clock went" in words for words in loop.said)
    # As two recordings, of which the second begins where the clock was set.
    apart = [time + 1000.0 * (k >= 1000) for k, time in enumerate(TIMES)]
    contact, trace = replay_of(apart, POSITIONS, FORCES)
    given = rows[np.isfinite(column(rows, "time"))]
    # A clock near 1.8e9 s has a resolution of 0.24 µs: of a step, and so of a velocity, 2.4e-4.
    for name in PREPARED[1:]:
        fine = {"rtol": 3e-4, "atol": 1e-6} if name == "velocity" else {"rtol": 1e-12}
        np.testing.assert_allclose(column(given, name), getattr(contact, name), **fine)
    found = [column(given, f"parameter_{k}")[-1] for k in range(trace.parameters.shape[1])]
    np.testing.assert_allclose(found, trace.parameters[-1], rtol=1e-3)


def test_a_silent_source_is_lost_and_found_again():
    times = [*TIMES[:1000], *(time + 30.0 for time in TIMES[1000:])]
    script = arrivals(times, POSITIONS, FORCES)
    loop, rows = looped([*script[:1000], Silence(30.0), *script[1000:], Silence(5.0)])
    assert loop.counts.silences == 2
    assert loop.status()["counts"]["gaps"] == 1
    assert any("no samples arrive" in words for words in loop.said)
    states = column(rows, "state")
    # Until the new window is whole nothing is known of the contact.
    assert states[1000] == State.LOST
    assert states[1030] == State.CONTACT
    same(rows, *replay_of(times, POSITIONS, FORCES))
    # During the second silence the estimate is held.
    assert loop.state is State.LOST
    assert loop.estimator.estimate().law.K == column(rows, "parameter_0")[-1]


def test_a_command_is_heard_while_a_source_is_slow():
    source = Scripted([*SCRIPT[:2], Silence(30.0)])
    source.sample_time, asked = 2.0, []
    take = source.take
    source.take = lambda timeout: (asked.append(timeout), take(timeout))[1]
    loop, _ = looped((), OnlinePreparation(sample_time=2.0), source=source)
    assert max(asked) <= 1.0
    assert loop.counts.silences == 0  # 20 sample times are 40 s


def test_a_source_that_ends_of_a_sudden_says_why():
    def torn():
        yield SCRIPT[0]
        raise EndOfSourceError("the cable is out")

    assert "the cable is out" in looped(torn())[0].said[-1]


def test_samples_that_come_too_seldom_for_the_window_are_said_to():
    loop, rows = looped(arrivals([10.0 * time for time in TIMES], POSITIONS, FORCES))
    assert np.isnan(column(rows, "time")).all()
    assert loop.state is State.INVALID
    assert "--rate" in loop.status()["fault"]
    assert any("--rate" in words for words in loop.said)


def test_the_same_fault_in_each_sample_is_said_once_a_second():
    loop, _ = looped([each._replace(force=math.nan) for each in SCRIPT])
    assert loop.counts.refused == len(TIMES)
    assert sum("NaN, infinite" in words for words in loop.said) == 2


def test_hold_resume_and_reset_act_on_the_estimate():
    wishes = {600: "hold", 1200: "resume", 1400: "hold", 1500: "reset"}
    loop, rows = looped(SCRIPT, commands=[(k, LiveCommand(wish)) for k, wish in wishes.items()])
    stiffness, states = column(rows, "parameter_0"), column(rows, "state")
    assert (stiffness[600:1200] == stiffness[599]).all()
    assert stiffness[1210] != stiffness[599]
    assert (states[600:1200] == State.HELD).all()
    assert states[1200] == State.CONTACT
    assert (column(rows, "method")[[1499, 1500]] == [0.0, 1.0]).all()
    assert loop.status()["generation"] == 1
    # While it is held nothing is updated: the times of that are not those of updates.
    assert loop.cycle.count == np.isfinite(column(rows, "time")).sum() - 600 - 600
    assert np.isfinite(stiffness[1490:1500]).all()
    assert np.isnan(stiffness[1500:]).all()
    assert describe_depth(loop.status(), rows[-1], 8e-3) == "no estimate yet"
    assert describe_depth(loop.status(), rows[1499], 8e-3) == "another estimator starts"


def test_a_tare_is_taken_and_taken_off():
    free = arrivals(TIMES[:600], [-1e-3] * 600, [3.0] * 600)
    touching = [each._replace(force=each.force + 3.0) for each in SCRIPT[600:]]
    loop, rows = looped([*free, *touching], commands=[(50, LiveCommand("tare", {"seconds": 0.5}))])
    assert (column(rows, "state")[60:540] == State.TARING).all()
    assert loop.status()["tare"] == pytest.approx(3.0, rel=1e-12)
    assert column(rows, "force")[-1] == pytest.approx(FORCES[-10], abs=1e-9)


def at_rest(depth, force, seconds=0.6, noise=0.02, begin=0.0):
    """Arrivals of a probe at these depths and forces: numbers, or functions of time."""
    random = np.random.default_rng(7)
    times = begin + T * np.arange(round(seconds / T))
    depths, forces = (
        np.broadcast_to(each(times) if callable(each) else each, times.shape)
        for each in (depth, force)
    )
    depths = depths + 1e-6 * random.standard_normal(times.size)
    forces = forces + noise * random.standard_normal(times.size)
    return arrivals(times.tolist(), depths.tolist(), forces.tolist())


PRESSING = {
    "held inside": ((5e-3, 12.0), "the probe is 5 mm inside the material"),
    "moving inside": (
        (lambda t: 5e-3 + 1e-3 * np.sin(20.0 * t), lambda t: 9.0 + 2.0 * np.sin(20.0 * t)),
        "the probe is 5",
    ),
    "touching meanwhile": (
        (lambda t: 8e-3 * t - 3e-3, lambda t: 2e3 * np.maximum(8e-3 * t - 3e-3, 0.0)),
        "inside the material",
    ),
    "pressing, of another zero of the position": (
        (lambda t: -0.3 + 1e-3 * np.sin(20.0 * t), lambda t: 9.0 + 2.0 * np.sin(20.0 * t)),
        "N as the probe moves",
    ),
    "relaxing, of another zero of the position": (
        (-0.3, lambda t: 5.0 + 3.0 * np.exp(-t)),
        "so it is not steady",
    ),
}


@pytest.mark.parametrize("motion, words", PRESSING.values(), ids=PRESSING)
def test_a_tare_in_contact_waits_until_the_probe_is_lifted(motion, words):
    script = at_rest(*motion)
    loop, rows = looped(script, OnlinePreparation(tare_time=0.5))
    assert (column(rows, "state") == State.TARING).all()
    assert math.isnan(loop.preparation.tare)
    [said] = [each for each in loop.said if "tare refused" in each]
    assert words in said
    assert "lift the probe out of the material" in said
    assert loop.status()["tare_refused"] in said
    lifted = at_rest(-0.31, 3.0, 1.5, begin=0.6)
    loop, rows = looped([*script, *lifted], OnlinePreparation(tare_time=0.5))
    assert loop.status()["tare"] == pytest.approx(3.0, abs=0.01)
    assert loop.status()["tare_refused"] == ""
    assert column(rows, "state")[-1] == State.FREE


FREE = {
    "at rest": (-5e-3, 3.0),
    "moving": (lambda t: -5e-3 + 2e-3 * np.sin(20.0 * t), 3.0),
    "drifting a little": (-5e-3, lambda t: 3.0 + 0.1 * t),
}


@pytest.mark.parametrize("motion", FREE.values(), ids=FREE)
def test_a_tare_in_free_air_is_taken(motion):
    loop, _ = looped(at_rest(*motion), OnlinePreparation(tare_time=0.5))
    assert loop.status()["tare"] == pytest.approx(3.0, abs=0.06)
    assert not any("refused" in each for each in loop.said)


def test_a_tare_command_in_contact_changes_nothing():
    loop, rows = looped(SCRIPT, commands=[(800, LiveCommand("tare", {"seconds": 0.3}))])
    [said] = [each for each in loop.said if "tare refused" in each]
    assert "the earlier zero holds" in said
    assert loop.status()["tare"] == 0.0
    assert (column(rows, "state")[1150:] == State.CONTACT).all()
    assert column(rows, "force")[-1] == pytest.approx(FORCES[-10], abs=1e-9)


@pytest.mark.long
def test_a_run_without_a_successful_tare_fails_with_the_reason(run, tmp_path):
    palpate.write_contact(touch(), tmp_path / "pressing.csv")
    words = [tmp_path / "pressing.csv", "--tare", "1s", "--no-page", "--no-diagnosis"]
    status, _, err = run("live", *words, "--speed", "20")
    assert status == 2
    assert "tare refused: the probe is" in err
    assert "or omit --tare" in err


def test_commands_change_what_exists_and_refuse_the_rest():
    commands = [
        (500, LiveCommand("estimator", {"method": "single-stage"})),
        (600, LiveCommand("estimator", {"method": "magic"})),
        (700, LiveCommand("source", {"material": "ball"})),
        (800, LiveCommand("record", {"on": True})),
        (900, LiveCommand("tare", {"seconds": -1.0})),
        (1000, LiveCommand("stop")),
    ]
    known = default_estimator().replace(exponent=1.5)
    loop, rows = looped(SCRIPT, estimator=known, commands=commands)
    status, said = loop.status(), " ".join(loop.said)
    assert status["method"] == "single-stage"
    assert loop.estimator.settings["exponent"] == 1.5  # the tip is the same
    assert len(rows) == 1000
    assert status["record"] == {"wish": 1, "on": True, "since": 800}
    for words in ("asked for {'material': 'ball'}", "magic", "seconds must be in"):
        assert words in said


@pytest.mark.parametrize("value, direction", [((0.0, 0.0, 0.0), None), (0.0, [0, 0, -1])])
def test_a_vector_without_a_usable_direction_is_refused(value, direction):
    with pytest.raises(palpate.InvalidParameterError, match="--direction"):
        looped([Arrival(0.0, value, value, 0.0)], OnlinePreparation(direction=direction))


def test_each_finding_of_the_preparation_is_reported_once():
    ends = Finding("file", "it ends before its end", "record it again")
    place = Finding("surface", "its place is an assumption")
    source = Replay(touch(tare_deviation=0.01, findings=[ends, place]))
    assert source.news() == [
        "tare computed from the whole recording, as in palpate identify",
        "file: it ends before its end (record it again)",
        "surface: its place is an assumption",
    ]
    assert source.news() == []


def test_the_loop_makes_no_cycles_so_that_it_needs_no_collector():
    bad = SCRIPT[100]._replace(force=math.nan)
    loop, _ = looped([*SCRIPT[:100], bad, *SCRIPT[101:300], SCRIPT[299], *SCRIPT[300:500]])
    with rings() as (loop.samples, loop.estimates, _):
        gc.collect()
        gc.freeze()  # to look through all tests again and again takes a second
        gc.disable()
        collected = []
        try:
            for start in range(500, 900, 100):  # an earlier test's thread may leave one cycle
                for arrival in SCRIPT[start : start + 100]:
                    loop.step(arrival)
                    loop.status()
                collected.append(gc.collect())
            assert min(collected) == 0
        finally:
            gc.enable()
            gc.unfreeze()
