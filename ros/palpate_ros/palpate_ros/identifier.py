"""Identify the contact from the messages of poses and wrenches. This module needs no ROS.

The messages may be rclpy's or those of another package: only their fields are read.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import palpate

SCHEMA = 4  # of palpate_msgs/ContactEstimate
#: Bits of the message's field ``checks``.
CHECKS = {
    "stuck force": 1,
    "saturation": 2,
    "spikes": 4,
    "late force": 8,
    "lost contact": 16,
    "baseline": 32,
    "change": 64,
}
#: What each check that makes the numbers wrong means.
FAULTS = {
    "stuck force": "force or position repeats its value while the other one changes",
    "saturation": "the force repeats its largest value while the position changes",
    "late force": "the damping is negative: the force is later than the position",
}
FREE, CONTACT, CHANGED, INVALID, LOST, TARING = 0, 1, 3, 4, 5, 6
NOT_DIAGNOSED, DO_NOT_TRUST = -1, 0
OK, WARN, ERROR, STALE = range(4)
_WAITING = 1024  # messages of a topic that wait for the other one
_LONGEST_OVERTAKING = 1.0  # s: an older stamp means that the clock was set
_KEPT_FOR = 10.0  # s for which a fault is reported after it was last found
_FEWEST = 20  # samples with a fault before it is reported
_SILENT = 0.2  # s
_TAKEN = (palpate.Status.UPDATED, palpate.Status.GUARDED, palpate.Status.RESTARTED)
_REFUSED = (
    palpate.Status.NOT_FINITE,
    palpate.Status.OUT_OF_RANGE,
    palpate.Status.INVALID_STEP,
)


@dataclass(frozen=True)
class Settings:
    """The node's parameters: ``config/palpate.yaml``."""

    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    surface: float = 0.0
    flip_force: bool = False
    wrench_frame: str = "tool"
    sample_time: float = 1e-3
    tare_time: float = 0.0
    tolerance: float = 2e-3
    payload: str = ""


@dataclass(frozen=True)
class Diagnostics:
    """Level, sentence and values of a ``diagnostic_msgs/DiagnosticStatus``."""

    level: int
    message: str
    values: dict[str, str]


@dataclass
class ContactIdentifier:
    """Takes each pose and wrench, and returns the fields of an estimate for each pair."""

    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        settings = self.settings
        if settings.wrench_frame not in ("tool", "base"):
            raise palpate.InvalidParameterError(
                f"wrench_frame must be tool or base, not {settings.wrench_frame!r}"
            )
        step = settings.sample_time
        self.compensation = None
        if settings.payload:
            payload = palpate.Payload.load(settings.payload)
            frame: Any = "base" if settings.wrench_frame == "base" else "sensor"
            self.compensation = palpate.PayloadCompensation(
                payload=payload, sample_time=step, frame=frame
            )
        self.preparation = palpate.OnlinePreparation(
            sample_time=step,
            direction=list(settings.direction),
            surface=settings.surface,
            flip=("force",) if settings.flip_force else (),
            tare_time=settings.tare_time,
        )
        self.estimator = palpate.ViscoelasticContact(
            sample_time=step,
            outlier_rejection=palpate.OutlierRejection(),
            change_detector=palpate.ChangeDetector(),
        )
        self.counts = dict.fromkeys(("taken", "learned", "refused", "unpaired", "repeated"), 0)
        self._poses: deque[tuple[float, Any]] = deque()
        self._wrenches: deque[tuple[float, Any]] = deque(maxlen=_WAITING)
        self._heard: dict[str, float] = {}
        self._stamps: dict[str, float] = {}
        self._paired_at = -math.inf
        self._last: dict[str, Any] = {}
        self._learned = math.nan
        self._refused_at = -math.inf
        self._refusal = ""
        self._faults: dict[str, tuple[int, float]] = {}

    def take_pose(self, message: Any, now: float) -> list[dict[str, Any]]:
        """Take a PoseStamped or TransformStamped that arrived at ``now``, s by any clock."""
        pose = getattr(message, "pose", None)
        if pose is None:
            position, turn = message.transform.translation, message.transform.rotation
        else:
            position, turn = pose.position, pose.orientation
        values = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]
        return self._queue("pose", self._poses, message, values, now)

    def take_wrench(self, message: Any, now: float) -> list[dict[str, Any]]:
        """Take a WrenchStamped that arrived at ``now``, s by any clock."""
        parts = message.wrench.force, message.wrench.torque
        values = [value for part in parts for value in (part.x, part.y, part.z)]
        return self._queue("wrench", self._wrenches, message, values, now)

    def _queue(
        self, topic: str, queue: deque[tuple[float, Any]], message: Any, values: Any, now: float
    ) -> list[dict[str, Any]]:
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        self._heard[topic] = now
        before = self._stamps.get(topic, -math.inf)
        if 0.0 <= before - stamp <= _LONGEST_OVERTAKING:
            self.counts["repeated"] += 1
            return []
        if stamp < before:
            self._poses.clear()
            self._wrenches.clear()
        self._stamps[topic] = stamp
        queue.append((stamp, np.array(values, dtype=float)))
        if len(self._poses) > _WAITING:
            self._poses.popleft()
            self.counts["unpaired"] += 1
        estimates = [self._identify(*pair) for pair in self._pairs()]
        if estimates:
            self._paired_at = now
        return estimates

    def _pairs(self) -> Iterator[tuple[float, Any, Any]]:
        """Yield each pose that has a wrench at its stamp, interpolated between two neighbours."""
        wrenches = self._wrenches
        while self._poses and wrenches and self._poses[0][0] <= wrenches[-1][0]:
            stamp, pose = self._poses.popleft()
            while len(wrenches) > 1 and wrenches[1][0] <= stamp:
                wrenches.popleft()
            (before, first), (after, second) = wrenches[0], wrenches[min(1, len(wrenches) - 1)]
            span = after - before
            if before <= stamp and 0.0 < span <= 2.0 * self.settings.tolerance:
                yield stamp, pose, first + (stamp - before) / span * (second - first)
                continue
            near, wrench = min(wrenches[0], wrenches[-1], key=lambda each: abs(each[0] - stamp))
            if abs(near - stamp) <= self.settings.tolerance:
                yield stamp, pose, wrench
            else:
                self.counts["unpaired"] += 1

    def _identify(self, stamp: float, pose: Any, wrench: Any) -> dict[str, Any]:
        self.counts["taken"] += 1
        time, position, force = stamp, pose[:3], wrench[:3]
        status = palpate.Status.UPDATED
        if self.compensation is not None:
            status = self.compensation.update(position, pose[3:], wrench, stamp)
            time, position = self.compensation.time, self.compensation.position
            force = self.compensation.force
        elif self.settings.wrench_frame == "tool":
            force = _turn(pose[3:], force)
        sample = None
        if status is palpate.Status.UPDATED:
            sample = self.preparation.update(position, force, time)
            status = self.preparation.status
        learned = palpate.Status.WAITING
        if sample is not None:
            learned = self.estimator.update(*sample)
        elif status is palpate.Status.RESTARTED:
            self.estimator.leave_contact()
        if {status, learned} & set(_REFUSED):
            self.counts["refused"] += 1
            self._refused_at = stamp
            self._refusal = "samples are refused: not finite, out of range, or not in order"
        self._last = self._describe(stamp, sample, learned)
        return self._last

    def _describe(self, stamp: float, sample: Any, learned: palpate.Status) -> dict[str, Any]:
        """Return the fields of the message ``palpate_msgs/ContactEstimate``."""
        estimate = self.estimator.estimate()
        if sample is not None and estimate.samples:
            self._learned = sample.time - estimate.age
        self.counts["learned"] += learned in _TAKEN
        known = estimate.samples > 0
        checks = [check for check in CHECKS if check in estimate.flags]
        for check in checks:
            count, last = self._faults.get(check, (0, stamp))
            self._faults[check] = (count + 1 if stamp - last < _KEPT_FOR else 1, stamp)
        size = len(estimate.parameters)
        spare = [math.nan] * (8 - size)
        unknown = [math.nan] * size
        age = max(stamp - self._learned, 0.0)
        fresh = age <= 1.0
        mark = DO_NOT_TRUST if self._find_faults(stamp) else NOT_DIAGNOSED
        candidate = self.estimator.candidate
        values = [math.nan] * 3 if sample is None else list(sample[:3])
        return {
            "schema": SCHEMA,
            "checks": sum(CHECKS[check] for check in checks),
            "number": self.counts["taken"] - 1,
            "time": stamp,
            "prepared_time": math.nan if sample is None else sample.time,
            "learned_time": self._learned,
            "age": age,
            **dict(zip(("penetration", "velocity", "force"), values, strict=True)),
            "predicted_force": math.nan,
            "stiffness": estimate.stiffness.value,
            "stiffness_standard_error": estimate.stiffness.standard_error,
            "damping": estimate.damping.value,
            "damping_standard_error": estimate.damping.standard_error,
            "depth": estimate.depth,
            "frequency": estimate.frequency,
            "offset": estimate.offset,
            "surface": estimate.surface,
            "margin": estimate.validity_margin,
            "parameters": [*(estimate.parameters if known else unknown), *spare],
            "standard_errors": [*(estimate.standard_errors if known else unknown), *spare],
            "state": self._state(stamp, sample, learned, checks),
            "stiffness_usable": bool(estimate.stiffness.usable and fresh),
            "damping_usable": bool(estimate.damping.usable and fresh),
            # Only `palpate live` diagnoses; a fault is enough for the worst mark.
            **dict.fromkeys(("stiffness_mark", "damping_mark"), mark),
            "method": "viscoelastic",
            "law": type(estimate.law).kind,
            "selected_law": str(candidate or ""),
            "parameter_names": " ".join(type(estimate.law).names()),
            "flags": "; ".join(estimate.flags),
        }

    def _state(self, stamp: float, sample: Any, learned: palpate.Status, checks: list[str]) -> int:
        if 0.0 <= stamp - self._refused_at < 0.5:
            return INVALID
        if sample is None and self.settings.tare_time and math.isnan(self.preparation.tare):
            return TARING
        if "change" in checks:
            return CHANGED
        return CONTACT if learned in _TAKEN else FREE

    def diagnose(self, now: float) -> Diagnostics:
        """Return what is wrong with the robot's messages, at a time of their arrival's clock, s."""
        last = self._last
        silent = max(_SILENT, 20.0 * self.settings.sample_time)
        missing = [
            topic
            for topic in ("pose", "wrench")
            if now - self._heard.get(topic, -math.inf) > silent
        ]
        since = now - self._paired_at
        unpaired = since > silent
        age = last.get("age", math.nan) + (since if unpaired else 0.0)
        level, message = self._fault(missing, age, unpaired=unpaired)
        usable = age <= 1.0
        values = {name: f"{last.get(name, math.nan):.6g}" for name in ("stiffness", "damping")}
        values |= {
            f"{name}_usable": str(bool(last.get(f"{name}_usable")) and usable)
            for name in ("stiffness", "damping")
        }
        values |= {"flags": last.get("flags", ""), "age": f"{age:.3f}"}
        values |= {"law": last.get("selected_law", "")}
        covariance = self.estimator.estimate().covariance
        values["covariance"] = " ".join(f"{value:.6g}" for value in covariance.ravel())
        values["covariance_time"] = f"{last.get('learned_time', math.nan):.9f}"
        values |= {name: str(count) for name, count in self.counts.items()}
        return Diagnostics(level, message, values)

    def _fault(self, missing: list[str], age: float, *, unpaired: bool) -> tuple[int, str]:
        if missing:
            return STALE, f"no {' and no '.join(missing)} arrives: the estimate is {age:.1f} s old"
        if unpaired:
            return STALE, (
                "no pose has a wrench at its stamp: check the clocks, or raise tolerance; the "
                f"estimate is {age:.1f} s old"
            )
        stamp = self._last["time"]
        if 0.0 <= stamp - self._refused_at < _KEPT_FOR:
            return WARN, self._refusal
        for check in self._find_faults(stamp):
            return ERROR, f"{check}: {FAULTS[check]}"
        if self._last["checks"] & CHECKS["lost contact"] and math.isfinite(age):
            return OK, f"lost contact: the numbers are of the last contact, {age:.1f} s ago"
        return OK, "in contact" if self._last["state"] == CONTACT else "no contact yet"

    def _find_faults(self, stamp: float) -> list[str]:
        """Return the faults that were found repeatedly within the last seconds."""
        found = {check: self._faults.get(check, (0, -math.inf)) for check in FAULTS}
        return [
            check
            for check, (count, last) in found.items()
            if count >= _FEWEST and 0.0 <= stamp - last < _KEPT_FOR
        ]


def _turn(quaternion: Any, vector: Any) -> Any:
    """Return a vector in the axes to which a quaternion x, y, z, w turns; NaN for none."""
    length = float(np.linalg.norm(quaternion))
    if not 0.99 < length < 1.01:
        return np.full(3, math.nan)
    axis, angle = quaternion[:3] / length, quaternion[3] / length
    twice = 2.0 * np.cross(axis, vector)
    return vector + angle * twice + np.cross(axis, twice)
