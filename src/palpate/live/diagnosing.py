"""Repeated diagnosis of the last seconds, in a separate process."""

import time
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from palpate import control_loops
from palpate._core import Status
from palpate.digits import rounded
from palpate.errors import PalpateError
from palpate.identifying import identify
from palpate.live.choices import CHOICES
from palpate.live.realtime import lower_priority
from palpate.live.sinks import PLACE, Watching, diagnosis_basis
from palpate.live.view import answer
from palpate.method.contact import Contact, Delay, VelocityFilter
from palpate.method.estimators import ContactEstimator, estimator_named
from palpate.output.results import view
from palpate.validation import Floats, finite_or_none

WINDOW = 20.0  # s
EVERY = 5.0  # s from the end of one diagnosis to the next, at least
_LOOKED_EVERY = 0.5  # s
_LEAST = 500  # samples
_MOST_ROWS = 200_000  # 20 s at 10 kHz; the window of a faster source is shorter
_SAMPLE = [PLACE[name] for name in ("time", "penetration", "velocity", "force", "status")]
# Sample times: a longer gap starts a new segment.
_GAP = 10.0
# Delays to skip after a change: for two, the velocity filter's window contains both materials.
_SMEARED = 3.0


class Diagnosing:
    """Identifies the last seconds as ``palpate identify`` does, and diagnoses them, repeatedly.

    It uses the method and the laws of the loop.

    Parameters
    ----------
    window : float
        Length of the data to diagnose, s. Default: 20.
    every : float
        Time from the end of one diagnosis to the next, s. Default: 5.
    loop : ControlLoop, optional
        Also say which gains of this loop are safe on the material. They are only shown.
    """

    name = "diagnosis"

    def __init__(
        self,
        window: float = WINDOW,
        every: float = EVERY,
        loop: control_loops.ControlLoop | None = None,
    ) -> None:
        self._window = window
        self._every = every
        self._loop = loop

    def run(self, watching: Watching, commands: Connection) -> None:
        """Diagnose until the loop stops."""
        lower_priority()
        samples = np.empty((0, len(_SAMPLE)))
        due = time.monotonic() + self._every
        page = _no_gains(self._loop)
        tare = None
        while watching.wait(_LOOKED_EVERY):
            rows = watching.take()[:, _SAMPLE]
            status = watching.status()
            if status.get("tare") != tare:  # earlier samples have another offset
                samples = samples[:0]
                rows = rows[:0]
                tare = status.get("tare")
            delay = float(status.get("delay", 0.0))
            samples = recent(np.concatenate([samples, rows]), self._window, delay)
            if time.monotonic() >= due and len(samples) >= _LEAST:
                page = diagnose_samples(samples, status, self._loop)
                due = time.monotonic() + self._every
            watching.tell(page)


def recent(samples: Floats, window: float, delay: float) -> Floats:
    """Return the samples of the last seconds since the last clock jump and change of material.

    The loop restarts its estimate when it detects a change, so the diagnosis starts there too.

    Parameters
    ----------
    samples : numpy.ndarray, shape (k, 5)
        Time, penetration, velocity, force and status.
    window : float
        Length of the window, s.
    delay : float
        Delay of the preparation, s: half of its filter window, and two samples.
    """
    samples = samples[np.isfinite(samples).all(axis=1)][-_MOST_ROWS:]
    if not len(samples):
        return samples
    back = np.flatnonzero(np.diff(samples[:, 0]) <= 0.0)
    samples = samples[back[-1] + 1 :] if len(back) else samples
    time = samples[:, 0]
    changed = np.flatnonzero(samples[:, 4] == Status.RESTARTED)
    settled = time[changed[-1]] + _SMEARED * delay if len(changed) else -np.inf
    recent: Floats = samples[(time > settled) & (time >= time[-1] - window)]
    return recent


def build_contact(
    samples: Floats,
    sample_time: float,
    velocity_filter: VelocityFilter | None = None,
    delay: Delay | None = None,
) -> Contact:
    """Return the samples as a contact, with a new segment after each gap."""
    gaps = np.diff(samples[:, 0], prepend=samples[:1, 0]) > _GAP * sample_time
    time, *columns = samples[:, :4].T
    names = ("penetration", "velocity", "force")
    signals: dict[str, Any] = dict(zip(names, columns, strict=True))
    signals |= {"velocity_filter": velocity_filter, "delay": delay}
    return Contact(time, **signals, segment=np.cumsum(gaps), source="the last seconds")


def _estimator(status: dict[str, Any]) -> ContactEstimator:
    """Return an estimator of the loop's method with the same laws and the same known exponent."""
    settings = status.get("settings", {})
    known = {name: settings[name] for name in CHOICES if name in settings}
    if (exponent := status.get("exponent")) is not None:
        known["exponent"] = exponent
    return estimator_named(status["method"])(**known)


def _no_gains(loop: control_loops.ControlLoop | None) -> dict[str, Any]:
    """Return a status that says whether gains will be chosen."""
    return {} if loop is None else {"gains": None}


def diagnose_samples(
    samples: Floats,
    status: dict[str, Any],
    loop: control_loops.ControlLoop | None = None,
) -> dict[str, Any]:
    """Diagnose these samples with the loop's method, and return the diagnosis as a status.

    With a control loop the status holds which gains are safe.
    """
    first = float(samples[0, 0])
    last = float(samples[-1, 0])
    about = f"the last {rounded(last - first, 2)} s at {time.strftime('%H:%M:%S')}"
    page: dict[str, Any] = {"window": [first, last], "of": diagnosis_basis(status)}
    page |= _no_gains(loop)
    try:
        used = status.get("velocity_filter")
        step = float(status.get("sample_time", 1e-3))
        late = status.get("force_delay")
        contact = build_contact(
            samples,
            step,
            used and VelocityFilter(**used),
            late and Delay(*late),
        )
        result = identify(contact, _estimator(status), trace=False)
        if (depth := status.get("depth")) is not None:
            result = result.at_depth(depth)
        diagnosis = result.diagnosis
        lines = view.number_lines(result)
        if loop is not None:
            known = control_loops.contact_knowledge(result)
            advice = control_loops.gains_for(known, loop)
            page["gains"] = {"verdict": advice.verdict, "lines": advice.describe()}
    except PalpateError as error:  # the probe touched nothing
        said = str(error)
        return {**page, "verdict": None, "reason": said, "said": said, "lines": [[about, "soft"]]}
    rows = (f"{name}: {text}".replace("\n", "  ") for name, text in view.fit_rows(result))
    deciding = {each.check: each.link for each in diagnosis.limits if each is not None}
    return {
        **page,
        "said": answer(lines),
        "verdict": diagnosis.verdict.as_dict(),
        "lines": [
            *([text, ""] for text in (diagnosis.remedy, *rows) if text),
            *([f"palpate explain {check}", "", link] for check, link in deciding.items()),
            [
                f"{about}, by {result.method}; ± of stiffness and damping includes the systematic "
                "uncertainty",
                "soft",
            ],
        ],
        "numbers": [line._asdict() for line in lines],
        "answer": answer(lines),
        "working_depths": [working_depth.as_dict() for working_depth in diagnosis.working_depths],
        "frequency": finite_or_none(result.frequency),
    }
