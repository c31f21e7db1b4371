"""Faults of sensors, clocks, files and mounts; the truth is the material."""

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from benchmarks.diagnosis.trials import Trial
from benchmarks.diagnosis.unseen import Damage, Unseen, delayed, first_order, percent, play, units
from palpate.validation import Floats

# ---- the force sensor


def curved_gain(part: float) -> Damage:
    """The gain grows with the force."""

    def damage(t: Trial) -> None:
        t.force = t.force * (1.0 + part * t.force / t.peak)

    return damage


def soft_saturation(reach: float) -> Damage:
    """The gain falls toward the end of the range."""

    def damage(t: Trial) -> None:
        t.force = reach * t.peak * np.tanh(t.force / (reach * t.peak))

    return damage


def sensor_hysteresis(part: float) -> Damage:
    """Prandtl: plays of three widths in the force."""

    def damage(t: Trial) -> None:
        lag = sum(play(t.force, width * t.peak) - t.force for width in (0.1, 0.3, 0.6))
        t.force = t.force + part * lag / 0.5

    return damage


def bouc_wen(part: float) -> Damage:
    """A state that follows the force's changes and saturates."""

    def damage(t: Trial) -> None:
        state, at = np.zeros(t.time.size), 0.0
        for k, step in enumerate((np.diff(t.force) / (0.1 * t.peak)).tolist(), start=1):
            at = float(np.clip(at + step - abs(step) * at, -1.0, 1.0))
            state[k] = at
        t.force = t.force + part * t.peak * state

    return damage


def creep_of_sensor(part: float) -> Damage:
    """A part of the reading follows after seconds."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * first_order(t, t.force, 1.0 / (2.0 * np.pi * 3.0))

    return damage


def ringing(hertz: float) -> Damage:
    """The sensor is a resonator of little damping."""

    def damage(t: Trial) -> None:
        turn = 2.0 * np.pi * hertz * t.step
        pole = np.exp(-0.05 * turn)
        back = [1.0, -2.0 * pole * np.cos(turn), pole**2]
        rest = t.force - t.force[0]
        t.force = t.force[0] + lfilter([sum(back)], back, rest)

    return damage


def slow_force(hertz: float) -> Damage:
    """A filter of first order."""

    def damage(t: Trial) -> None:
        t.force = first_order(t, t.force, hertz)

    return damage


def butterworth(hertz: float) -> Damage:
    """A filter of second order."""

    def damage(t: Trial) -> None:
        sections = butter(2, hertz, fs=1.0 / t.step, output="sos")
        t.force = t.force[0] + sosfilt(sections, t.force - t.force[0])

    return damage


def moving_mean(ms: float) -> Damage:
    """Means over the last milliseconds."""

    def damage(t: Trial) -> None:
        width = max(1, round(1e-3 * ms / t.step))
        total = np.cumsum(np.concatenate([np.full(width, t.force[0]), t.force]))
        t.force = (total[width:] - total[:-width]) / width

    return damage


def one_direction(part: float) -> Damage:
    """The gain is another while the force falls."""

    def damage(t: Trial) -> None:
        t.force = t.force * np.where(np.gradient(t.force) < 0.0, 1.0 - part, 1.0)

    return damage


def step_of_offset(part: float) -> Damage:
    """The zero jumps midway."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * (t.time > 0.5 * t.time[-1])

    return damage


def step_of_gain(part: float) -> Damage:
    """The gain jumps midway; the truth is before."""

    def damage(t: Trial) -> None:
        t.force = t.force * (1.0 + part * (t.time > 0.5 * t.time[-1]))

    return damage


def temperature(part: float) -> Damage:
    """The zero drifts while the sensor warms."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * (1.0 - np.exp(-t.time / (0.3 * t.time[-1])))

    return damage


def tilting_tool(part: float) -> Damage:
    """The tool's weight turns with the wrist, slowly."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * np.sin(2.0 * np.pi * 0.15 * t.time)

    return damage


# ---- what adds to the force


def cable(part: float) -> Damage:
    """A spring on the probe, in free air too."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * t.penetration / t.deepest

    return damage


def guide(part: float) -> Damage:
    """Coulomb friction of the probe's guide, in free air too."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * np.tanh(50.0 * t.velocity / t.speed)

    return damage


def stribeck(part: float) -> Damage:
    """Friction of the guide that is largest at rest."""

    def damage(t: Trial) -> None:
        w = t.velocity / t.speed
        t.force = t.force + part * t.peak * np.tanh(50.0 * w) * (1.0 + np.exp(-((5.0 * w) ** 2)))

    return damage


def of_velocity(part: float) -> Damage:
    """Cross-talk, in free air too."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * t.velocity / t.speed

    return damage


def shaken_mass(part: float) -> Damage:
    """A mass beyond the sensor, on an arm that vibrates at 15 Hz."""

    def damage(t: Trial) -> None:
        slow = np.gradient(t.velocity, t.time)
        shake = np.sin(2.0 * np.pi * 15.0 * t.time)
        t.force = t.force + part * t.peak * (slow / (t.turns * t.speed) + shake)

    return damage


def hum(part: float) -> Damage:
    """Mains, which low rates fold down."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * np.sin(2.0 * np.pi * 50.03 * t.time + 1.0)

    return damage


def harmonic(part: float) -> Damage:
    """Hum at three times the motion's frequency."""

    def damage(t: Trial) -> None:
        t.force = t.force + part * t.peak * np.sin(3.0 * t.turns * t.time + 1.0)

    return damage


def folded(part: float) -> Damage:
    """A vibration beside the sampling rate, folded near the motion."""

    def damage(t: Trial) -> None:
        turns = 2.0 * np.pi * t.rate + t.random.uniform(0.7, 1.5) * t.turns
        t.force = t.force + part * t.peak * np.sin(turns * t.time)

    return damage


def lateral(part: float) -> Damage:
    """The probe slides sideways, to and fro, with friction on the sensor's axis."""

    def damage(t: Trial) -> None:
        t.force = t.force * (1.0 + part * np.tanh(5.0 * np.sin(2.0 * np.pi * 0.4 * t.time)))

    return damage


# ---- the position sensor and the mount


def backlash(part: float) -> Damage:
    """The encoder follows behind a play."""

    def damage(t: Trial) -> None:
        t.position = play(t.position, part * t.deepest)

    return damage


def stick_slip(part: float) -> Damage:
    """The tip sticks and jumps; the encoder does not see it."""

    def damage(t: Trial) -> None:
        tip, at = np.empty(t.time.size), float(t.penetration[0])
        reach = part * t.deepest
        for k, x in enumerate(t.penetration.tolist()):
            if abs(x - at) > reach:
                at, reach = x, part * t.deepest * t.random.uniform(0.3, 1.0)
            tip[k] = at
        t.force = np.where(tip > 0.0, t.law.force(np.maximum(tip, 0.0), t.velocity), 0.0)

    return damage


def slow_position(hertz: float) -> Damage:
    """A filter of first order on the position."""

    def damage(t: Trial) -> None:
        t.position = first_order(t, t.position, hertz)

    return damage


def both_filtered(hertz: float) -> Damage:
    """Filters on both channels, one of 1.5 times the corner of the other."""

    def damage(t: Trial) -> None:
        t.position = first_order(t, t.position, hertz)
        t.force = first_order(t, t.force, 1.5 * hertz)

    return damage


def eccentric(part: float) -> Damage:
    """An encoder's error, periodic in its angle."""

    def damage(t: Trial) -> None:
        turns = 2.0 * np.pi * t.penetration / (0.8 * t.deepest)
        t.position = t.position + part * t.deepest * np.sin(turns)

    return damage


def growing(part: float) -> Damage:
    """The arm warms and grows."""

    def damage(t: Trial) -> None:
        grown = 1.0 - np.exp(-t.time / (0.4 * t.time[-1]))
        t.position = t.position + part * t.deepest * grown

    return damage


def wind_up(part: float) -> Damage:
    """The arm's joints give way with the force, and come back late."""

    def damage(t: Trial) -> None:
        t.position = t.position + part * t.deepest * play(t.force / t.peak, 0.4)

    return damage


def coarse_position(part: float) -> Damage:
    """Steps of the position."""

    def damage(t: Trial) -> None:
        step = part * t.deepest
        t.position = step * np.round(t.position / step)

    return damage


def series_spring(part: float) -> Damage:
    """A mount that gives way in proportion to the force."""

    def damage(t: Trial) -> None:
        t.position = t.position + part * t.deepest * t.force / t.peak

    return damage


def damped_mount(part: float) -> Damage:
    """A mount that gives way, and comes back within 30 ms."""

    def damage(t: Trial) -> None:
        given = first_order(t, t.force / t.peak, 1.0 / (2.0 * np.pi * 0.03))
        t.position = t.position + part * t.deepest * given

    return damage


def loose_mount(part: float) -> Damage:
    """A mount that gives way from a third of the peak force on."""

    def damage(t: Trial) -> None:
        beyond = np.maximum(t.force / t.peak - 0.33, 0.0)
        t.position = t.position + part * t.deepest * beyond

    return damage


def off_axis(degrees: float) -> Damage:
    """The probe moves, and the sensor looks, along an axis that is not the normal."""

    def damage(t: Trial) -> None:
        cosine = np.cos(np.radians(degrees))
        t.force, t.position = t.force * cosine, t.position / cosine

    return damage


def force_scale(part: float) -> Damage:
    """A gain that is wrong."""

    def damage(t: Trial) -> None:
        t.force = t.force * (1.0 + part)

    return damage


def position_scale(part: float) -> Damage:
    """A position gain that is wrong."""

    def damage(t: Trial) -> None:
        t.position = t.position * (1.0 + part)

    return damage


def bouncing(ms: float) -> Damage:
    """After each touch down the light probe leaves the surface once more."""

    def damage(t: Trial) -> None:
        downs = np.flatnonzero(np.diff((t.penetration > 0.0).astype(int)) == 1)
        for down in downs.tolist():
            start = down + round(0.02 / t.step)
            t.force[start : start + round(1e-3 * ms / t.step)] = 0.0

    return damage


# ---- clocks


def skew(ms: float) -> Damage:
    """The force comes late."""

    def damage(t: Trial) -> None:
        t.force = delayed(t, t.force, 1e-3 * ms)

    return damage


def clock_drift(part: float) -> Damage:
    """The clocks agree at the start, and drift apart."""

    def damage(t: Trial) -> None:
        t.force = delayed(t, t.force, part * t.time)

    return damage


def wandering_skew(ms: float) -> Damage:
    """The force comes late by a time that wanders about its mean."""

    def damage(t: Trial) -> None:
        white = t.random.standard_normal(t.time.size)
        slow = first_order(t, white, 2.0)
        late = 1e-3 * ms * np.clip(1.0 + 0.5 * slow / np.std(slow), 0.0, None)
        t.force = delayed(t, t.force, late)

    return damage


def held_force(every: float) -> Damage:
    """The force is read once in so many samples."""

    def damage(t: Trial) -> None:
        step = int(every)
        t.force = np.repeat(t.force[::step], step)[: t.force.size]

    return damage


def held_position(every: float) -> Damage:
    """The position is read once in so many samples, and drawn straight between."""

    def damage(t: Trial) -> None:
        place = np.arange(0, t.time.size, int(every))
        t.position = np.interp(
            t.time - every * (t.time[1] - t.time[0]), t.time[place], t.position[place]
        )

    return damage


def packets(size: float) -> Damage:
    """Samples that arrive in packets and bear the time of arrival."""

    def damage(t: Trial) -> None:
        place = np.arange(t.time.size)
        rest = size - 1.0 - place % size
        t.time = t.time + 0.98 * rest * (t.time[1] - t.time[0])

    return damage


def repeated_stamps(part: float) -> Damage:
    """Some samples bear the stamp of the one before."""

    def damage(t: Trial) -> None:
        hit = np.flatnonzero(t.random.random(t.time.size - 1) < part) + 1
        t.time[hit] = t.time[hit - 1]

    return damage


# ---- the file


def duplicated(part: float) -> Damage:
    """Force samples that were lost; the one before stands in their place."""

    def damage(t: Trial) -> None:
        for k in np.flatnonzero(t.random.random(t.time.size - 1) < part).tolist():
            t.force[k + 1] = t.force[k]

    return damage


def interpolated(part: float) -> Damage:
    """Gaps of 0.1 s in both channels, drawn straight."""

    def damage(t: Trial) -> None:
        width = max(3, round(0.1 * t.rate))
        count = max(1, round(part * t.time.size / width))
        for k in t.random.integers(1, max(2, t.time.size - width - 1), count).tolist():
            for values in (t.force, t.position):
                values[k : k + width] = np.linspace(values[k], values[k + width - 1], width)

    return damage


def bursts(size: float) -> Damage:
    """Noise that is larger in a tenth of the time."""

    def damage(t: Trial) -> None:
        width = max(3, round(0.05 * t.rate))
        for k in t.random.integers(0, t.time.size, max(1, t.time.size // (10 * width))).tolist():
            there = t.force[k : k + width]
            there += size * t.noise * t.random.standard_normal(there.size)

    return damage


def clusters(part: float) -> Damage:
    """Clusters of eight samples that are off by a third of the peak, one in a hundred."""

    def damage(t: Trial) -> None:
        for k in t.random.integers(0, t.time.size, max(1, t.time.size // 800)).tolist():
            t.force[k : k + 8] += part * t.peak

    return damage


def velocity_column(values: Floats, t: Trial) -> None:
    t.recorded_velocity = values


def coarse_velocity(part: float) -> Damage:
    """A velocity column in steps."""

    def damage(t: Trial) -> None:
        step = part * t.speed
        t.recorded_velocity = step * np.round(t.velocity / step)

    return damage


def late_velocity(ms: float) -> Damage:
    """A velocity column behind a filter."""

    def damage(t: Trial) -> None:
        t.recorded_velocity = first_order(t, t.velocity, 1e3 / (2.0 * np.pi * ms))

    return damage


def small_velocity(part: float) -> Damage:
    """A velocity column that is too small."""

    def damage(t: Trial) -> None:
        t.recorded_velocity = (1.0 - part) * t.velocity

    return damage


SENSOR_FAULTS: list[Unseen] = [
    *percent("curved gain", curved_gain, 0.1, 0.25),
    *percent("soft saturation", soft_saturation, 2.0, 1.2),
    *percent("sensor hysteresis", sensor_hysteresis, 0.02, 0.06),
    *percent("sensor hysteresis, Bouc–Wen", bouc_wen, 0.01, 0.03),
    *percent("creep of the sensor", creep_of_sensor, 0.03, 0.08),
    *units("ringing sensor", "Hz", ringing, 80.0, 30.0),
    *units("slow force, 1st order", "Hz", slow_force, 50.0, 20.0, 5.0),
    *units("slow force, 2nd order", "Hz", butterworth, 40.0, 15.0),
    *units("force averaged over", "ms", moving_mean, 10.0, 30.0),
    *percent("gain of one direction", one_direction, 0.01, 0.04),
    *percent("offset step", step_of_offset, 0.03, 0.1),
    *percent("gain step", step_of_gain, 0.06, 0.15),
    *percent("temperature of the sensor", temperature, 0.03, 0.1),
    *percent("tool's weight", tilting_tool, 0.02, 0.08),
    *percent("cable spring", cable, 0.03, 0.1),
    *percent("friction of the guide", guide, 0.005, 0.02),
    *percent("friction, Stribeck", stribeck, 0.005, 0.02),
    *percent("cross-talk of velocity", of_velocity, 0.01, 0.03),
    *percent("shaken mass", shaken_mass, 0.01, 0.03),
    *percent("mains hum", hum, 0.01, 0.04),
    *percent("hum at a harmonic", harmonic, 0.01, 0.04),
    *percent("folded vibration", folded, 0.01, 0.03),
    *percent("sliding sideways", lateral, 0.02, 0.06),
    *percent("backlash", backlash, 0.005, 0.02),
    *percent("stick–slip", stick_slip, 0.01, 0.04),
    *units("slow position", "Hz", slow_position, 50.0, 20.0, 5.0),
    *units("both filtered, otherwise", "Hz", both_filtered, 20.0, 8.0),
    *percent("eccentric encoder", eccentric, 0.005, 0.02),
    *percent("growing arm", growing, 0.02, 0.06),
    *percent("arm's wind-up", wind_up, 0.02, 0.06),
    *percent("coarse position", coarse_position, 0.005, 0.02),
    *percent("series spring", series_spring, 0.06, 0.2, shown=False),
    *percent("damped mount", damped_mount, 0.06, 0.2, shown=False),
    *percent("loose mount", loose_mount, 0.06, 0.2),
    *(Unseen("off axis", f"{d:g}°", off_axis(d), shown=False) for d in (10.0, 20.0)),
    *percent("force scale", force_scale, 0.02, 0.06, shown=False),
    *percent("position scale", position_scale, 0.02, 0.06, shown=False),
    *units("bouncing probe", "ms", bouncing, 10.0, 30.0),
    *units("skew", "ms", skew, 2.0, 5.0, -4.0),
    *percent("clock drift", clock_drift, 3e-4, 1e-3),
    *units("wandering skew", "ms", wandering_skew, 2.0, 5.0),
    *units("force held", "samples", held_force, 3.0, 6.0, after=True),
    *units("position held", "samples", held_position, 3.0, 6.0, after=True),
    *units("packets", "samples", packets, 3.0, 8.0, after=True),
    *percent("repeated stamps", repeated_stamps, 0.02, after=True),
    *percent("duplicated force", duplicated, 0.1, 0.3, after=True),
    *percent("interpolated gaps", interpolated, 0.1, 0.3, after=True),
    *units("burst noise", "σ", bursts, 5.0, 20.0, after=True),
    *percent("outlier clusters", clusters, 0.1, 0.3, after=True),
    *percent("coarse velocity", coarse_velocity, 0.1, 0.4),
    *units("late velocity", "ms", late_velocity, 5.0, 20.0),
    *percent("small velocity", small_velocity, 0.03, 0.1),
]
