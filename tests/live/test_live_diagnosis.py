"""The diagnosis of the last seconds is that of the library, and beside the loop."""

from pathlib import Path

import numpy as np
import pytest
from cases import MATERIALS
from scripted import arrivals, looped, measured, pressed

import palpate
from palpate.live import run
from palpate.live.diagnosing import Diagnosing, contact_of, diagnosed, outdated, recent
from palpate.live.ring import COLUMNS
from palpate.live.sinks import Watching
from palpate.live.sources import EndOfSourceError, Replay

SAMPLE = [COLUMNS.index(name) for name in ("time", "penetration", "velocity", "force", "status")]
LATE = 9e-3  # s
STATUS = {"method": "variable-projection", "sample_time": 1e-3}


@pytest.fixture(scope="module")
def samples():
    """What the loop wrote of four seconds on the ball."""
    _, rows = looped(arrivals(*measured(4.0)))
    return rows[:, SAMPLE]


def test_it_is_the_librarys_own(samples):
    page = diagnosed(recent(samples, 20.0, LATE), STATUS)
    known = samples[np.isfinite(samples).all(axis=1)]
    diagnosis = palpate.identify(contact_of(known, 1e-3)).diagnosis
    assert page["verdict"] == diagnosis.verdict.as_dict()
    assert page["reason"] == diagnosis.reason
    assert page["said"].startswith("trust")
    depth = page["working_depths"][0]
    stiffness = MATERIALS["ball"].stiffness_at(depth["depth"])
    bars = depth["stiffness"]
    assert abs(bars["value"] - stiffness) < 4.0 * bars["standard_error"] + bars["systematic"]


def test_it_is_of_the_last_seconds_of_one_clock(samples):
    short = recent(samples, 1.0, LATE)
    assert short[-1, 0] - short[0, 0] == pytest.approx(1.0, abs=2e-3)
    earlier = samples.copy()
    earlier[:, 0] += 100.0
    both = recent(np.concatenate([earlier, samples]), 20.0, LATE)
    np.testing.assert_array_equal(both, recent(samples, 20.0, LATE))


def test_it_is_of_what_is_touched_since_the_loop_noticed_a_change(samples):
    times, positions, forces = measured(4.0)
    softer = arrivals([4.0 + time for time in times], positions, [0.3 * f for f in forces])
    _, rows = looped([*arrivals(times, positions, forces), *softer])
    page = diagnosed(recent(rows[:, SAMPLE], 20.0, LATE), STATUS)
    assert page["window"][0] == pytest.approx(4.0, abs=0.5)
    assert page["verdict"]["overall"] == "trust"


def test_a_gap_begins_another_segment_and_no_contact_is_said(samples):
    known = recent(samples, 20.0, LATE)
    contact = contact_of(np.concatenate([known[:1000], known[1500:]]), 1e-3)
    assert len(list(contact.segments())) == 2
    known[:, 1], known[:, 3] = -1e-3, 0.0  # free
    page = diagnosed(known, STATUS)
    assert page["verdict"] is None
    assert page["reason"]


def test_it_says_when_it_is_no_longer_of_what_the_loop_does(samples):
    status = {**STATUS, "counts": {"changes": 1}, "tare": None}
    page = diagnosed(recent(samples, 1.0, LATE), status)
    assert outdated(page, status) == ""
    later = {**status, "method": "single-stage", "counts": {"changes": 2}}
    words = "another estimator runs now and the material has changed since"
    assert outdated(page, later) == words
    assert outdated(page, {**status, "tare": 0.3}) == "the force was tared since"


class Reading:
    """A sink that keeps what the diagnosis said."""

    name = "reading"

    def __init__(self, path):
        self.path = path

    def run(self, session, commands):
        watching = Watching(session)
        while watching.wait(0.1):
            if said := watching.others()["diagnosis"].get("said"):
                self.path.write_text(said)
        watching.close()


class Heard(Replay):
    """A recording at its own pace, until its verdict has been read."""

    said: Path

    def take(self, timeout):
        if self.said.exists():
            raise EndOfSourceError
        return super().take(timeout)


@pytest.mark.slow
def test_it_says_its_verdict_while_the_loop_runs(tmp_path):
    source = Heard(palpate.Contact(**vars(pressed(30.0))))
    source.said = tmp_path / "said"
    status = run(source, None, [Diagnosing(every=1.0), Reading(source.said)])
    assert source.said.read_text().startswith("trust")
    assert status["counts"]["taken"] < 30_000
