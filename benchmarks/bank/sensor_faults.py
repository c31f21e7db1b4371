"""Faults of sensors, clocks, files and mounts; the truth is the material."""

from collections.abc import Callable

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from benchmarks.bank.trials import Fault, Trial, severities
from palpate.validation import Floats


def delayed(trial: Trial, values: Floats, seconds: float | Floats) -> Floats:
    """Values that come later, by linear interpolation on the fine grid."""
    return np.interp(trial.time - seconds, trial.time, values)


def first_order(trial: Trial, values: Floats, hertz: float) -> Floats:
    """Values behind a filter of first order, which starts at rest."""
    keep = float(np.exp(-2.0 * np.pi * hertz * trial.step))
    made: Floats = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0]
    return made


def play(values: Floats, width: float) -> Floats:
    """Values behind a play of a width, which follow only when it is used up."""
    made, at = np.empty_like(values), float(values[0])
    for k, value in enumerate(values.tolist()):
        at = min(max(at, value - 0.5 * width), value + 0.5 * width)
        made[k] = at
    return made


# ---- the force sensor


def curved_gain(t: Trial, part: float) -> None:
    """The gain grows with the force."""
    t.force = t.force * (1.0 + part * t.force / t.peak)


def soft_saturation(t: Trial, reach: float) -> None:
    """The gain falls toward the end of the range."""
    t.force = reach * t.peak * np.tanh(t.force / (reach * t.peak))


def sensor_hysteresis(t: Trial, part: float) -> None:
    """Prandtl: plays of three widths in the force."""
    lag = sum(play(t.force, width * t.peak) - t.force for width in (0.1, 0.3, 0.6))
    t.force = t.force + part * lag / 0.5


def bouc_wen(t: Trial, part: float) -> None:
    """A state that follows the force's changes and saturates."""
    state, at = np.zeros(t.time.size), 0.0
    for k, step in enumerate((np.diff(t.force) / (0.1 * t.peak)).tolist(), start=1):
        at = float(np.clip(at + step - abs(step) * at, -1.0, 1.0))
        state[k] = at
    t.force = t.force + part * t.peak * state


def creep_of_sensor(t: Trial, part: float) -> None:
    """A part of the reading follows after seconds."""
    t.force = t.force + part * first_order(t, t.force, 1.0 / (2.0 * np.pi * 3.0))


def ringing(t: Trial, hertz: float) -> None:
    """The sensor is a resonator of little damping."""
    turn = 2.0 * np.pi * hertz * t.step
    pole = np.exp(-0.05 * turn)
    back = [1.0, -2.0 * pole * np.cos(turn), pole**2]
    rest = t.force - t.force[0]
    t.force = t.force[0] + lfilter([sum(back)], back, rest)


def slow_force(t: Trial, hertz: float) -> None:
    """A filter of first order."""
    t.force = first_order(t, t.force, hertz)


def butterworth(t: Trial, hertz: float) -> None:
    """A filter of second order."""
    sections = butter(2, hertz, fs=1.0 / t.step, output="sos")
    t.force = t.force[0] + sosfilt(sections, t.force - t.force[0])


def moving_mean(t: Trial, ms: float) -> None:
    """Means over the last milliseconds."""
    width = max(1, round(1e-3 * ms / t.step))
    total = np.cumsum(np.concatenate([np.full(width, t.force[0]), t.force]))
    t.force = (total[width:] - total[:-width]) / width


def one_direction(t: Trial, part: float) -> None:
    """The gain is another while the force falls."""
    t.force = t.force * np.where(np.gradient(t.force) < 0.0, 1.0 - part, 1.0)


def step_of_offset(t: Trial, part: float) -> None:
    """The zero jumps midway."""
    t.force = t.force + part * t.peak * (t.time > 0.5 * t.time[-1])


def step_of_gain(t: Trial, part: float) -> None:
    """The gain jumps midway; the truth is before."""
    t.force = t.force * (1.0 + part * (t.time > 0.5 * t.time[-1]))


def temperature(t: Trial, part: float) -> None:
    """The zero drifts while the sensor warms."""
    t.force = t.force + part * t.peak * (1.0 - np.exp(-t.time / (0.3 * t.time[-1])))


def tilting_tool(t: Trial, part: float) -> None:
    """The tool's weight turns with the wrist, slowly."""
    t.force = t.force + part * t.peak * np.sin(2.0 * np.pi * 0.15 * t.time)


# ---- what adds to the force


def cable(t: Trial, part: float) -> None:
    """A spring on the probe, in free air too."""
    t.force = t.force + part * t.peak * t.penetration / t.deepest


def guide(t: Trial, part: float) -> None:
    """Coulomb friction of the probe's guide, in free air too."""
    t.force = t.force + part * t.peak * np.tanh(50.0 * t.velocity / t.speed)


def stribeck(t: Trial, part: float) -> None:
    """Friction of the guide that is largest at rest."""
    w = t.velocity / t.speed
    t.force = t.force + part * t.peak * np.tanh(50.0 * w) * (1.0 + np.exp(-((5.0 * w) ** 2)))


def of_velocity(t: Trial, part: float) -> None:
    """Cross-talk, in free air too."""
    t.force = t.force + part * t.peak * t.velocity / t.speed


def shaken_mass(t: Trial, part: float) -> None:
    """A mass beyond the sensor, on an arm that vibrates at 15 Hz."""
    slow = np.gradient(t.velocity, t.time)
    shake = np.sin(2.0 * np.pi * 15.0 * t.time)
    t.force = t.force + part * t.peak * (slow / (t.turns * t.speed) + shake)


def hum(t: Trial, part: float) -> None:
    """Mains, which low rates fold down."""
    t.force = t.force + part * t.peak * np.sin(2.0 * np.pi * 50.03 * t.time + 1.0)


def harmonic(t: Trial, part: float) -> None:
    """Hum at three times the motion's frequency."""
    t.force = t.force + part * t.peak * np.sin(3.0 * t.turns * t.time + 1.0)


def folded(t: Trial, part: float) -> None:
    """A vibration beside the sampling rate, folded near the motion."""
    turns = 2.0 * np.pi * t.rate + t.random.uniform(0.7, 1.5) * t.turns
    t.force = t.force + part * t.peak * np.sin(turns * t.time)


def lateral(t: Trial, part: float) -> None:
    """The probe slides sideways, back and forth, with friction on the sensor's axis."""
    t.force = t.force * (1.0 + part * np.tanh(5.0 * np.sin(2.0 * np.pi * 0.4 * t.time)))


# ---- the position sensor and the mount


def backlash(t: Trial, part: float) -> None:
    """The encoder follows behind a play."""
    t.position = play(t.position, part * t.deepest)


def stick_slip(t: Trial, part: float) -> None:
    """The tip sticks and jumps; the encoder does not see it."""
    tip, at = np.empty(t.time.size), float(t.penetration[0])
    reach = part * t.deepest
    for k, x in enumerate(t.penetration.tolist()):
        if abs(x - at) > reach:
            at, reach = x, part * t.deepest * t.random.uniform(0.3, 1.0)
        tip[k] = at
    t.force = np.where(tip > 0.0, t.law.force(np.maximum(tip, 0.0), t.velocity), 0.0)


def slow_position(t: Trial, hertz: float) -> None:
    """A filter of first order on the position."""
    t.position = first_order(t, t.position, hertz)


def both_filtered(t: Trial, hertz: float) -> None:
    """Filters on both channels, one of 1.5 times the corner of the other."""
    t.position = first_order(t, t.position, hertz)
    t.force = first_order(t, t.force, 1.5 * hertz)


def eccentric(t: Trial, part: float) -> None:
    """An encoder's error, periodic in its angle."""
    turns = 2.0 * np.pi * t.penetration / (0.8 * t.deepest)
    t.position = t.position + part * t.deepest * np.sin(turns)


def growing(t: Trial, part: float) -> None:
    """The arm warms and grows."""
    grown = 1.0 - np.exp(-t.time / (0.4 * t.time[-1]))
    t.position = t.position + part * t.deepest * grown


def wind_up(t: Trial, part: float) -> None:
    """The arm's joints come back late from what they gave way, which is corrected."""
    load = t.force / t.peak
    t.position = t.position + part * t.deepest * (play(load, 0.4) - load)


def coarse_position(t: Trial, part: float) -> None:
    """Steps of the position."""
    step = part * t.deepest
    t.position = step * np.round(t.position / step)


def series_spring(t: Trial, part: float) -> None:
    """A mount that gives way in proportion to the force."""
    t.position = t.position + part * t.deepest * t.force / t.peak


def damped_mount(t: Trial, part: float) -> None:
    """A mount that gives way, and comes back within 30 ms."""
    given = first_order(t, t.force / t.peak, 1.0 / (2.0 * np.pi * 0.03))
    t.position = t.position + part * t.deepest * given


def loose_mount(t: Trial, part: float) -> None:
    """A mount that gives way from a third of the peak force on."""
    beyond = np.maximum(t.force / t.peak - 0.33, 0.0)
    t.position = t.position + part * t.deepest * beyond


def off_axis(t: Trial, degrees: float) -> None:
    """The probe moves, and the sensor looks, along an axis that is not the normal."""
    cosine = np.cos(np.radians(degrees))
    t.force, t.position = t.force * cosine, t.position / cosine


def force_scale(t: Trial, part: float) -> None:
    """A gain that is wrong."""
    t.force = t.force * (1.0 + part)


def position_scale(t: Trial, part: float) -> None:
    """A position gain that is wrong."""
    t.position = t.position * (1.0 + part)


def bouncing(t: Trial, ms: float) -> None:
    """After each touch down the light probe leaves the surface once more."""
    downs = np.flatnonzero(np.diff((t.penetration > 0.0).astype(int)) == 1)
    for down in downs.tolist():
        start = down + round(0.02 / t.step)
        t.force[start : start + round(1e-3 * ms / t.step)] = 0.0


# ---- clocks


def skew(t: Trial, ms: float) -> None:
    """The force comes late."""
    t.force = delayed(t, t.force, 1e-3 * ms)


def clock_drift(t: Trial, part: float) -> None:
    """The clocks agree at the start, and drift apart."""
    t.force = delayed(t, t.force, part * t.time)


def wandering_skew(t: Trial, ms: float) -> None:
    """The force comes late by a time that wanders about its mean."""
    white = t.random.standard_normal(t.time.size)
    slow = first_order(t, white, 2.0)
    late = 1e-3 * ms * np.clip(1.0 + 0.5 * slow / np.std(slow), 0.0, None)
    t.force = delayed(t, t.force, late)


def held_force(t: Trial, every: float) -> None:
    """The force is read once in so many samples."""
    step = int(every)
    t.force = np.repeat(t.force[::step], step)[: t.force.size]


def held_position(t: Trial, every: float) -> None:
    """The position is read once in so many samples, and drawn straight between."""
    place = np.arange(0, t.time.size, int(every))
    t.position = np.interp(
        t.time - every * (t.time[1] - t.time[0]), t.time[place], t.position[place]
    )


def packets(t: Trial, size: float) -> None:
    """Samples that arrive in packets and bear the time of arrival."""
    place = np.arange(t.time.size)
    rest = size - 1.0 - place % size
    t.time = t.time + 0.98 * rest * (t.time[1] - t.time[0])


def repeated_stamps(t: Trial, part: float) -> None:
    """Some samples bear the stamp of the one before."""
    hit = np.flatnonzero(t.random.random(t.time.size - 1) < part) + 1
    t.time[hit] = t.time[hit - 1]


# ---- the file


def duplicated(t: Trial, part: float) -> None:
    """Force samples that were lost; the one before stands in their place."""
    for k in np.flatnonzero(t.random.random(t.time.size - 1) < part).tolist():
        t.force[k + 1] = t.force[k]


def interpolated(t: Trial, part: float) -> None:
    """Gaps of 0.1 s in both channels, drawn straight."""
    width = max(3, round(0.1 * t.rate))
    count = max(1, round(part * t.time.size / width))
    for k in t.random.integers(1, max(2, t.time.size - width - 1), count).tolist():
        for values in (t.force, t.position):
            values[k : k + width] = np.linspace(values[k], values[k + width - 1], width)


def bursts(t: Trial, size: float) -> None:
    """Noise that is larger in a tenth of the time."""
    width = max(3, round(0.05 * t.rate))
    for k in t.random.integers(0, t.time.size, max(1, t.time.size // (10 * width))).tolist():
        there = t.force[k : k + width]
        there += size * t.noise * t.random.standard_normal(there.size)


def clusters(t: Trial, part: float) -> None:
    """Clusters of eight samples that are off by a third of the peak, one in a hundred."""
    for k in t.random.integers(0, t.time.size, max(1, t.time.size // 800)).tolist():
        t.force[k : k + 8] += part * t.peak


def coarse_velocity(t: Trial, part: float) -> None:
    """A velocity column in steps."""
    step = part * t.speed
    t.recorded_velocity = step * np.round(t.velocity / step)


def late_velocity(t: Trial, ms: float) -> None:
    """A velocity column behind a filter."""
    t.recorded_velocity = first_order(t, t.velocity, 1e3 / (2.0 * np.pi * ms))


def small_velocity(t: Trial, part: float) -> None:
    """A velocity column that is too small."""
    t.recorded_velocity = (1.0 - part) * t.velocity


# ---- what the diagnosis looks for


def wrong_surface(t: Trial, mm: float) -> None:
    """The penetration is counted from another surface."""
    t.position = t.position + 1e-3 * mm
    t.truth = lambda depth: t.of_the_law(depth - 1e-3 * mm)


def drift_of_zero(t: Trial, part: float) -> None:
    """The zero of the force drifts by a part of its largest."""
    t.force = t.force + part * float(t.force.max()) * t.time / t.time[-1]


def untared(t: Trial, newtons: float) -> None:
    """A sensor that was not tared."""
    t.force = t.force + newtons


def saturation(t: Trial, part: float) -> None:
    """The sensor's range ends below the largest force."""
    t.force = np.minimum(t.force, part * float(t.force.max()))


def mass_beyond_sensor(t: Trial, kilograms: float) -> None:
    """A mass beyond the sensor."""
    t.force = t.force + kilograms * np.gradient(t.velocity, t.time)


def stuck(t: Trial, part: float) -> None:
    """The force is constant in segments of 0.1 s."""
    for k in t.random.integers(2000, t.time.size - 100, round(70.0 * part)):
        t.force[k : k + 100] = t.force[k]


def spikes(t: Trial, part: float) -> None:
    """Single samples at half the largest force more, or less."""
    hit = t.random.random(t.time.size) < part
    signs = t.random.choice([-1.0, 1.0], t.time.size)
    t.force = np.where(hit, t.force + 0.5 * signs * float(t.force.max()), t.force)


def coarse_force(t: Trial, part: float) -> None:
    """Steps of a part of the largest force."""
    step = part * float(t.force.max())
    t.force = step * np.round(t.force / step)


def jitter(t: Trial, part: float) -> None:
    """Wrong time stamps."""
    t.time = t.time + part * t.step * t.random.uniform(-1.0, 1.0, t.time.size)


def missing(t: Trial, part: float) -> None:
    """Samples that were never written."""
    keep = t.random.random(t.time.size) >= part
    for name in ("time", "penetration", "position", "velocity", "force"):
        setattr(t, name, getattr(t, name)[keep])


def scaled(channel: str, factor: float) -> Callable[[Trial], None]:
    """A channel in another unit, or with another sign."""

    def damage(t: Trial) -> None:
        setattr(t, channel, factor * getattr(t, channel))
        t.described = False

    return damage


def swapped(t: Trial) -> None:
    """Force and penetration exchanged."""
    t.position, t.force = t.force, t.position


def reversed_velocity(t: Trial) -> None:
    """A velocity column with the wrong sign."""
    t.recorded_velocity = -t.velocity


def _stopping(kind: str, severity: str, damage: Callable[[Trial], None], check: str) -> Fault:
    return Fault(kind, severity, damage, sampled=True, names=(check,), stops=True)


_SURFACES = (0.2, -0.2, 0.35, -0.35, 0.7, -0.7, 1.5, -1.5)  # mm
#: Faults that the diagnosis looks for.
KNOWN_SENSOR_FAULTS: list[Fault] = [
    *severities("surface", wrong_surface, *_SURFACES, unit="mm", sampled=True, names=("surface",)),
    *severities("delay", skew, 0.5, 1.0, 2.0, 5.0, 10.0, -3.0, unit="ms", names=("delay",)),
    *severities("offset drift", drift_of_zero, 0.05, 0.15, names=("offset drift",)),
    *severities("inertia", mass_beyond_sensor, 0.1, 0.4, unit="kg", names=("inertia",)),
    *severities("saturation", saturation, 0.95, 0.8, 0.6, sampled=True, names=("saturation",)),
    *severities("stuck", stuck, 0.08, sampled=True, names=("stuck force",)),
    *severities("spikes", spikes, 0.01, sampled=True, names=("spikes",)),
    *severities("coarse", coarse_force, 0.2, 0.05, sampled=True, names=("coarse steps",)),
    *severities("jitter", jitter, 0.1, sampled=True),
    *severities("missing", missing, 0.1, sampled=True),
    *severities("bias", untared, 3.0, unit="N", sampled=True),
    _stopping("unit", "mm", scaled("position", 1e3), "penetration unit"),
    _stopping("unit", "mN", scaled("force", 1e3), "force unit"),
    _stopping("unit", "ms", scaled("time", 1e3), "time unit"),
    _stopping("sign", "force", scaled("force", -1.0), "signs"),
    _stopping("sign", "penetration", scaled("position", -1.0), "signs"),
    _stopping("swapped", "columns", swapped, "penetration unit"),
    _stopping("velocity", "reversed", reversed_velocity, "velocity column"),
]
#: Faults for most of which palpate has no check.
SENSOR_FAULTS: list[Fault] = [
    *severities("curved gain", curved_gain, 0.1, 0.25),
    *severities("soft saturation", soft_saturation, 2.0, 1.2),
    *severities("sensor hysteresis", sensor_hysteresis, 0.02, 0.06),
    *severities("sensor hysteresis, Bouc–Wen", bouc_wen, 0.01, 0.03),
    *severities("creep of the sensor", creep_of_sensor, 0.03, 0.08),
    *severities("ringing sensor", ringing, 80.0, 30.0, unit="Hz"),
    *severities("slow force, 1st order", slow_force, 50.0, 20.0, 5.0, unit="Hz"),
    *severities("slow force, 2nd order", butterworth, 40.0, 15.0, unit="Hz"),
    *severities("force averaged over", moving_mean, 10.0, 30.0, unit="ms"),
    *severities("gain of one direction", one_direction, 0.01, 0.04),
    *severities("offset step", step_of_offset, 0.03, 0.1),
    *severities("gain step", step_of_gain, 0.06, 0.15),
    *severities("temperature of the sensor", temperature, 0.03, 0.1),
    *severities("tool's weight", tilting_tool, 0.02, 0.08),
    *severities("cable spring", cable, 0.03, 0.1),
    *severities("friction of the guide", guide, 0.005, 0.02),
    *severities("friction, Stribeck", stribeck, 0.005, 0.02),
    *severities("cross-talk of velocity", of_velocity, 0.01, 0.03),
    *severities("shaken mass", shaken_mass, 0.01, 0.03),
    *severities("mains hum", hum, 0.01, 0.04),
    *severities("hum at a harmonic", harmonic, 0.01, 0.04),
    *severities("folded vibration", folded, 0.01, 0.03),
    *severities("sliding sideways", lateral, 0.02, 0.06),
    *severities("backlash", backlash, 0.005, 0.02),
    *severities("stick–slip", stick_slip, 0.01, 0.04),
    *severities("slow position", slow_position, 50.0, 20.0, 5.0, unit="Hz"),
    *severities("both filtered, otherwise", both_filtered, 20.0, 8.0, unit="Hz"),
    *severities("eccentric encoder", eccentric, 0.005, 0.02),
    *severities("growing arm", growing, 0.02, 0.06),
    *severities("arm's wind-up", wind_up, 0.02, 0.06),
    *severities("coarse position", coarse_position, 0.005, 0.02),
    *severities("series spring", series_spring, 0.06, 0.2, shown=False),
    *severities("damped mount", damped_mount, 0.06, 0.2, shown=False),
    *severities("loose mount", loose_mount, 0.06, 0.2, shown=False),
    *severities("off axis", off_axis, 10.0, 20.0, unit="°", shown=False),
    *severities("force scale", force_scale, 0.02, 0.06, shown=False),
    *severities("position scale", position_scale, 0.02, 0.06, shown=False),
    *severities("bouncing probe", bouncing, 10.0, 30.0, unit="ms"),
    *severities("skew", skew, 2.0, 5.0, -4.0, unit="ms"),
    *severities("clock drift", clock_drift, 3e-4, 1e-3),
    *severities("wandering skew", wandering_skew, 2.0, 5.0, unit="ms"),
    *severities("force held", held_force, 3.0, 6.0, sampled=True, unit="samples"),
    *severities("position held", held_position, 3.0, 6.0, sampled=True, unit="samples"),
    *severities("packets", packets, 3.0, 8.0, sampled=True, unit="samples"),
    *severities("repeated stamps", repeated_stamps, 0.02, sampled=True),
    *severities("duplicated force", duplicated, 0.1, 0.3, sampled=True),
    *severities("interpolated gaps", interpolated, 0.1, 0.3, sampled=True),
    *severities("burst noise", bursts, 5.0, 20.0, sampled=True, unit="σ"),
    *severities("outlier clusters", clusters, 0.1, 0.3, sampled=True),
    *severities("coarse velocity", coarse_velocity, 0.1, 0.4),
    *severities("late velocity", late_velocity, 5.0, 20.0, unit="ms"),
    *severities("small velocity", small_velocity, 0.03, 0.1),
]
