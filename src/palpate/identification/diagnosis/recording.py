"""The channels of a recording and their checks: units, signs, clocks, steps and spikes.

Each check looks at the data once, independent of the fitted law. To add one: a function of a
:class:`Data`, and its name in ``CHECKS``.
"""

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from palpate.digits import format_quantity, percent, rounded
from palpate.findings import Check, Finding, Mark, NextStep, Remedy
from palpate.identification.diagnosis.outcome import ModelSelection
from palpate.input.preparation.held import hold_length, report_held_channel
from palpate.input.preparation.resolution import noise_of
from palpate.input.preparation.touch import exclude_load_transfer
from palpate.input.preparation.velocity import (
    find_spikes,
    largest_of,
    noise_gain,
    step_of,
    window_samples,
)
from palpate.method.contact import Contact
from palpate.method.rows import median, rms
from palpate.validation import Floats, Indices, Mask


class Data:
    """The finite samples of a contact, and properties of its channels.

    Parameters
    ----------
    contact : Contact
        The prepared contact.
    """

    def __init__(self, contact: Contact) -> None:
        self.contact = contact
        channels = contact.penetration, contact.velocity, contact.force
        self.known: Mask = np.all(np.isfinite(channels), axis=0)
        self.time = contact.time[self.known]
        self.penetration = contact.penetration[self.known]
        self.velocity = contact.velocity[self.known]
        self.force = contact.force[self.known]
        self.segment = contact.segment[self.known]
        self.sample_time = contact.sample_time
        #: How the velocity was computed from the penetration; None: it was recorded.
        self.velocity_filter = contact.velocity_filter
        #: Model selections, keyed by how laws were compared; the methods of one contact share them.
        self.laws: dict[str, ModelSelection] = {}

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"<Data of {self.contact.source or 'a contact'}: {len(self)} samples>"

    def samples(self, *, rejecting: bool) -> "Data":
        """Return the data without load transfer if outliers are rejected, else the data itself."""
        return self._without_load_transfer if rejecting else self

    @cached_property
    def _without_load_transfer(self) -> "Data":
        contact = exclude_load_transfer(self.contact)
        return self if contact is self.contact else Data(contact)

    @cached_property
    def force_step(self) -> float:
        """Median gap between the distinct values of the force, N."""
        return step_of(self.force)

    @cached_property
    def force_noise(self) -> float:
        """Standard deviation of the force's noise, N, including its rounding."""
        return max(noise_of(self.force), self.force_step / math.sqrt(12.0))

    @cached_property
    def penetration_noise(self) -> float:
        """Standard deviation of the penetration's noise, m, including its rounding."""
        return max(noise_of(self.penetration), step_of(self.penetration) / math.sqrt(12.0))

    @cached_property
    def penetration_step(self) -> float:
        """Step of the penetration, m; 0 if most samples differ, so that it is not rounded."""
        distinct = np.unique(self.penetration).size
        return step_of(self.penetration) if 2 * distinct < len(self) else 0.0

    @cached_property
    def velocity_noise(self) -> float:
        """Standard deviation of the velocity's noise, m/s; after a filter, for white noise of x."""
        if self.velocity_filter is None:
            return noise_of(self.velocity)
        return self.penetration_noise * noise_gain(self.velocity_filter) / self.sample_time

    @property
    def filter_samples(self) -> int:
        """Samples in the window of the velocity filter."""
        velocity_filter = self.velocity_filter
        return (
            window_samples(self.sample_time) if velocity_filter is None else velocity_filter.samples
        )

    @property
    def wider_window(self) -> Remedy | None:
        """Remedy for a differentiated velocity that is noisy: twice the filter's window.

        None where it was followed, or would flatten the motion: a window T loses (ωT)²/40 of it.
        """
        prepared = self.contact.prepared
        if prepared is not None and prepared.settings.velocity_window is not None:
            return None
        window = 2.0 * self.filter_samples * self.sample_time
        moving = self.velocity[self.penetration > 0.0]
        rate = float(np.std(moving) / (np.std(self.penetration[self.penetration > 0.0]) or np.inf))
        if rate * window > MOST_TURN:
            return None
        return Remedy(NextStep.WIDER_WINDOW, f"{window:.2g}")

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the checks of the data, then findings of the preparation."""
        with np.errstate(all="ignore"):  # absurd samples overflow; a check then finds them
            reported = [check(self) for check in (CHECKS if len(self) >= FEWEST_SAMPLES else ())]
        return (*(each for each in reported if each is not None), *self.contact.findings)

    @cached_property
    def peak_force(self) -> float:
        """99.9th percentile of |force|, N, on which single spikes have no effect."""
        return largest_of(self.force)

    @cached_property
    def peak_penetration(self) -> float:
        """99.9th percentile of the penetration, m."""
        return float(np.percentile(self.penetration, 99.9)) if len(self) else 0.0


MOST_TURN = 1.0  # of the motion in a window, rad, which takes 2.5 % off the velocity
FORCE_STEP = 0.04  # fraction of the largest force
# Fraction of the largest penetration. With 0.8 % the velocity's noise makes the damping 3 % too
# small, with 1.5 % it makes it 16 % too small (three draws each).
PENETRATION_STEP = 0.01
# Fraction of samples that equal the previous one. Noise dithers the lab's steps of 1/8 N: 55 %
# repeat.
REPEATED = 0.85


def check_steps(data: Data) -> Finding | None:
    """Steps above 4 % of the force or 1 % of the penetration, and over 85 % of samples repeat."""
    effect = ": the velocity is coarse and the damping too small"
    finer = Remedy(NextStep.FINER_FORCE)
    smoother = data.wider_window if data.velocity_filter else Remedy(NextStep.DIFFERENTIATE)
    force = data.force, "force", "N", data.peak_force, FORCE_STEP
    penetration = data.penetration, "penetration", "m", data.peak_penetration, PENETRATION_STEP
    for channel, consequence, remedy in ((force, "", finer), (penetration, effect, smoother)):
        values, name, unit, peak, most = channel
        step = step_of(values)
        if 0.0 < most * peak < step and np.mean(np.diff(values) == 0.0) > REPEATED:
            return Check.COARSE_STEPS.finding(
                f"the {name} is quantised in steps of {format_quantity(step, unit)}, "
                f"{percent(step / peak)} of its largest value{consequence}",
                remedy,
                mark="with-care",
            )
    return None


def check_held_channel(data: Data) -> Finding | None:
    """Changes every k ≤ 60 samples: a delay of (k − 1)/2 samples, or of k/2 with two clocks."""
    for name, values in (("force", data.force), ("penetration", data.penetration)):
        if beat := hold_length(values):
            samples = 0.5 * (beat - (beat == round(beat)))
            return report_held_channel(name, beat, samples * data.sample_time)
    return None


MOST_RANKED = 5000  # samples whose ranks are taken
RANKS_AGAINST = -0.3  # rank correlation; recordings with the right signs have 0.4 and more


def check_signs(data: Data) -> Finding | None:
    """Rank correlation of x and F below −0.3, and less force at the deepest 5 % than at the least.

    It runs before any gate, because a gate removes the samples that show the wrong sign.
    """
    every = -(-len(data) // MOST_RANKED)
    x = data.penetration[::every]
    force = data.force[::every]
    if np.ptp(x) == 0.0 or np.ptp(force) == 0.0:
        return None
    apart = _ranks(x) - _ranks(force)
    correlation = 1.0 - 6.0 * float(apart @ apart) / (len(x) * (len(x) ** 2 - 1.0))  # Spearman's
    if correlation >= RANKS_AGAINST:
        return None
    low, high = np.percentile(x, [5.0, 95.0])
    deep = float(force[x >= high].mean())
    shallow = float(force[x <= low].mean())
    if deep >= shallow:
        return None
    step = NextStep.FLIP_PENETRATION
    sentence = (
        f"the force falls from {rounded(shallow, 3)} N to {rounded(deep, 3)} N as the "
        "penetration grows: the penetration must be positive into the material"
    )
    if deep < 0.0 and abs(deep) > abs(shallow):
        step = NextStep.FLIP_FORCE
        sentence = (
            f"the force is negative, {rounded(deep, 3)} N, where the penetration is largest: "
            "compression must be positive"
        )
    return Check.SIGNS.finding(sentence, Remedy(step), mark="do-not-trust")


def _ranks(values: Floats) -> Indices:
    return np.argsort(np.argsort(values, kind="stable"))


SOME = 1e-3
MANY = 2e-2  # fractions of the samples
# Fraction of the rms velocity. At slower speeds the probe reverses and friction jumps between its
# two signs within a sample (on the robot at up to 0.26). Spikes occur at any speed, so they are
# counted at faster speeds only.
SLOW = 1.0 / 3.0
# Fraction of the largest force, and multiple of its noise: tails heavier than a Gaussian's are not
# spikes.
LARGE = 0.05
FAR = 16.0
FEWEST_SPIKES = 3.0
FEWEST_FAST = 0.2  # fraction of the samples; with fewer all samples are counted


def check_spikes(data: Data) -> Finding | None:
    """More than 0.1 % of the samples are spikes; force spikes count only while the probe moves."""
    force = find_spikes(data.force)
    penetration = find_spikes(data.penetration)
    places = np.flatnonzero(force)
    previous_samples = np.maximum(places - 1, 0)
    next_samples = np.minimum(places + 1, len(data) - 1)
    leaps = np.abs(
        data.force[places] - 0.5 * (data.force[previous_samples] + data.force[next_samples])
    )
    force[places] = leaps > max(LARGE * data.peak_force, FAR * data.force_noise)
    speed = np.abs(data.velocity)
    fast = speed > SLOW * rms(speed)
    if np.mean(fast) < FEWEST_FAST:
        fast = np.ones_like(fast)
    fractions = {"force": float(np.mean(force[fast])), "penetration": float(np.mean(penetration))}
    name = max(fractions, key=fractions.__getitem__)
    fraction = fractions[name]
    if fraction <= SOME or fraction * len(data) < FEWEST_SPIKES:
        return None
    return Check.SPIKES.finding(
        f"{percent(fraction)} of the {name} samples are spikes",
        Remedy(NextStep.CABLE, name),
        mark="do-not-trust" if fraction > MANY else "with-care",
    )


WIDTH = 7  # samples of a local parabola
MOST_STAMPS = 20_000  # samples that are used
# Ratio of the residual against the time stamps to the residual against the sample index: recordings
# have at most 1.13, jittered time stamps 4 to 7.5, and missing samples 0.4 to 0.7.
RATIO = 2.0
UNEVEN = 0.2  # sd(Δt)/mean


def check_time_stamps(data: Data) -> Finding | None:
    """A local parabola fits the time stamps twice worse than it fits the sample index.

    Penetration and force have the same stamp, so only a differentiated velocity is wrong. A
    standard deviation σ of the stamps is a noise v σ of the position; the relative noise of the
    velocity, squared, is missing in the damping.
    """
    used = slice(0, MOST_STAMPS)
    time = data.time[used]
    x = data.penetration[used]
    steps = np.diff(time)
    steps = steps[(np.diff(data.segment[used]) == 0) & (steps > 0.0)]
    if steps.size < 10 * WIDTH or float(steps.std()) <= UNEVEN * float(steps.mean()):
        return None
    by_index = _distance_to_parabola(np.arange(len(x), dtype=np.float64), x)
    ratio = _distance_to_parabola(time, x) / by_index if by_index > 0.0 else 0.0
    if ratio <= RATIO:
        return None
    lost = 0.0
    if data.velocity_filter is not None:
        even = np.convolve(time, np.full(data.filter_samples, 1.0 / data.filter_samples), "valid")
        half = data.filter_samples // 2
        error = float(np.std(time[half : half + even.size] - even))
        lost = (error * noise_gain(data.velocity_filter) / data.sample_time) ** 2
    return Check.TIME_STAMPS.finding(
        "the time stamps jump where the penetration is smooth: they are times of arrival, not of "
        "sampling",
        Remedy(NextStep.SENSOR_TIMES),
        z=ratio,
        damping="with-care" if lost > CARE else "trust",
        moves_percent=(0.0, -100.0 * lost),
    )


def _distance_to_parabola(time: Floats, x: Floats) -> float:
    """Median residual of the middle sample of a window against a parabola through the window."""
    windows = np.lib.stride_tricks.sliding_window_view(np.arange(len(x)), WIDTH)
    t = time[windows] - time[windows[:, WIDTH // 2], None]
    t = t / np.maximum(np.abs(t).max(axis=1, keepdims=True), 1e-300)
    basis = np.stack([np.ones_like(t), t, t**2], axis=2)
    normal = basis.transpose(0, 2, 1) @ basis + 1e-9 * np.eye(3)
    right = (basis * x[windows][:, :, None]).sum(axis=1)
    middle = np.linalg.solve(normal, right[:, :, None])[:, 0, 0]
    return median(np.abs(x[windows[:, WIDTH // 2]] - middle))


DEEPEST = 0.25
FASTEST = 3.0  # m, m/s; the recordings reach at most 19 mm and 0.84 m/s
# F/x² in Pa, a modulus that depends little on geometry: recordings have 6e3 to 7e7 Pa.
SOFTEST = 2.0
HARDEST = 5e8
LARGEST_FORCE = 5e3  # N; the testing machine presses TPU with 2.6 kN
SLOWEST = 0.2  # s between samples


def check_penetration_unit(data: Data) -> Finding | None:
    """Largest x > 0.25 m, rms v > 3 m/s, or F/x² < 2 Pa."""
    depth = data.peak_penetration
    force = data.peak_force
    touched = data.penetration > 0.0
    speed = rms(data.velocity[touched]) if touched.any() else 0.0
    large = depth > DEEPEST or speed > FASTEST or force < SOFTEST * depth * depth
    size = f"the penetration reaches {rounded(depth, 3)} m at {rounded(force, 3)} N"
    suspicion = f"{size}: it may be in millimetres, or swapped with another column"
    return _unit_finding(
        data, Check.PENETRATION_UNIT, "penetration", "mm", suspicion if large else ""
    )


def check_force_unit(data: Data) -> Finding | None:
    """F > 5 kN or F/x² > 5e8 Pa; it finds 87 % of such errors, so the peak is always shown."""
    depth = data.peak_penetration
    force = data.peak_force
    large = force > LARGEST_FORCE or force > HARDEST * depth * depth
    size = f"the force reaches {rounded(force, 3)} N at {rounded(1e3 * depth, 3)} mm"
    suspicion = f"{size}: it may be in millinewtons"
    return _unit_finding(data, Check.FORCE_UNIT, "force", "mN", suspicion if large else "")


def _unit_finding(
    data: Data, check: Check, channel: str, guess: str, suspicion: str
) -> Finding | None:
    """Report a unit that is suspected, or that only the other channel's option states."""
    sentence = _half_stated(data.contact, channel) or suspicion
    if not sentence or channel in data.contact.stated_units or data.peak_penetration <= 0.0:
        return None
    remedy = _unit_remedy(data.contact, channel, guess)
    return check.finding(sentence, remedy, mark="do-not-trust")


def check_time_unit(data: Data) -> Finding | None:
    """Median step > 0.2 s: the velocity, and with it the damping, may be 1000 times too small.

    The stiffness does not depend on the unit of time, unless another unit is suspected too.
    """
    contact = data.contact
    if data.sample_time <= SLOWEST or "time" in contact.stated_units or contact.timeless:
        return None
    step = rounded(data.sample_time, 3)
    sentence = f"there is a sample every {step} s: the times may be in milliseconds"
    others = check_penetration_unit(data) or check_force_unit(data)
    mark: Mark = "trust" if others is None else "do-not-trust"
    remedy = _unit_remedy(contact, "time", "ms")
    return Check.TIME_UNIT.finding(sentence, remedy, stiffness=mark, damping="do-not-trust")


def _half_stated(contact: Contact, channel: str) -> str:
    """The sentence if an option states only the other unit, and the file none; else empty."""
    missing = contact.assumed_units - contact.stated_units
    if not contact.assumed_units >= POSITION_AND_FORCE or missing != {channel}:
        return ""
    return f"the file states no unit: palpate assumes that the {channel} is in {SI[channel]}"


POSITION_AND_FORCE = frozenset(("penetration", "force"))
SI = {"time": "s", "penetration": "m", "force": "N"}


def _unit_remedy(contact: Contact, channel: str, guess: str) -> Remedy:
    """Remedy for a suspected unit: state it, or confirm the one that was used; both without any."""
    if channel in POSITION_AND_FORCE <= contact.assumed_units:
        return Remedy(NextStep.BOTH_UNITS)
    return Remedy(NextStep.UNIT, channel, guess, SI[channel])


OTHER = ": it may have another unit or sign, or be another channel"
MEAN = 15  # samples of a piece over which noise averages out
STOP = (0.8, 1.25)  # slopes; recorded columns have 1.01 to 1.08
CARE = 0.05  # fraction of the damping, the same as for every cause
SAME_SPEED = 0.01  # largest deviation of the slope from 1 that is not reported
ALIKE = 0.9  # correlation above which the slope is meaningful
VELOCITIES_AGAINST = -0.5


def check_velocity_column(data: Data) -> Finding | None:
    """Slope of ∫v dt on Δx, over pieces of 15 samples, if the two are correlated.

    Outside 0.8 … 1.25, or with a negative correlation, the column is another channel. Inside, the
    slope is the error of the damping B = ∂F/∂v.
    """
    if data.velocity_filter is not None or len(data) < 4 * MEAN:
        return None
    dx, integral = _displacements(data)
    if dx.size < 4 or np.ptp(dx) == 0.0 or np.ptp(integral) == 0.0:
        return None
    correlation = float(np.corrcoef(dx, integral)[0, 1])
    if correlation < VELOCITIES_AGAINST:
        sentence = "the velocity column runs against the rate of the penetration" + OTHER
        return Check.VELOCITY_COLUMN.finding(
            sentence, Remedy(NextStep.DIFFERENTIATE), mark="do-not-trust"
        )
    if correlation <= ALIKE:
        return None
    # Noise in Δx lowers the first slope, noise in ∫v dt raises the second: the one nearer to 1 is
    # less biased.
    slopes = float(dx @ integral / (dx @ dx)), float(integral @ integral / (dx @ integral))
    slope = min(slopes, key=lambda each: abs(each - 1.0))
    sentence = f"the velocity column is {rounded(slope, 3)} times the rate of the penetration"
    if not STOP[0] <= slope <= STOP[1]:
        return Check.VELOCITY_COLUMN.finding(
            sentence + OTHER, Remedy(NextStep.DIFFERENTIATE), mark="do-not-trust"
        )
    if abs(slope - 1.0) <= SAME_SPEED:
        return None
    wrong = f"{percent(abs(slope - 1.0))} too {'small' if slope > 1.0 else 'large'}"
    return Check.VELOCITY_COLUMN.finding(
        f"{sentence}: the damping is {wrong} if the penetration is right",
        Remedy(NextStep.DIFFERENTIATE),
        damping="with-care" if abs(slope - 1.0) > CARE else "trust",
        moves_percent=(0.0, 100.0 * (slope - 1.0)),
    )


def _displacements(data: Data) -> tuple[Floats, Floats]:
    """Displacement of each piece from the penetration, and from the integral of the velocity, m."""
    ends = np.arange(0, (len(data) // MEAN) * MEAN, MEAN)
    last = ends + MEAN - 1
    in_one_segment = data.segment[ends] == data.segment[last]
    ends = ends[in_one_segment]
    last = last[in_one_segment]
    steps = 0.5 * (data.velocity[1:] + data.velocity[:-1]) * np.diff(data.time)
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    return data.penetration[last] - data.penetration[ends], travel[last] - travel[ends]


#: Every check of the data.
CHECKS: tuple[Callable[[Data], Finding | None], ...] = (
    check_penetration_unit,
    check_force_unit,
    check_time_unit,
    check_signs,
    check_velocity_column,
    check_time_stamps,
    check_held_channel,
    check_spikes,
    check_steps,
)
FEWEST_SAMPLES = 20  # a shorter recording is reported only as short
