"""Skew between the clocks of force and position, from touches of a spring.

A spring has no damping: its force at a time t is F(x(t)), whatever the velocity. A force that is
recorded δ late is F(x(t − δ)) = F(x) − δ F′(x) v to first order, so that −δ is the coefficient of
the elastic force's rate. Three other things look like it: Coulomb friction of a part μ of the
force, like −4 μ/(π ω) at the angular frequency ω; a loss factor η of the spring, like −η/ω; and
damping. They depend on the frequency or on the depth, and a skew does not. So the touch needs two
speeds: friction is fitted beside δ, δ is fitted at each speed, and both must agree.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

import palpate._core as _core
from palpate.digits import percent, rounded, with_error
from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Mark
from palpate.identification.diagnosis.outcome import Quantity
from palpate.identification.quantities.energy import turning_points
from palpate.input.preparation.delay import LIGHT, LONGEST_FOUND
from palpate.input.preparation.preparing import Recorded, prepare
from palpate.method.contact import Contact
from palpate.method.estimators.least_squares import robust_covariance
from palpate.method.rows import median, norm, rms
from palpate.spelling import spell_advice
from palpate.validation import Floats, Indices, Mask, Plain, frozen

#: Loss factor that a steel spring with its mount may have; a spring alone has less than 1e-4.
LOSS_FACTOR = 1e-3
#: Standard error up to which a skew is trusted, s: it changes the damping of half of real
#: recordings by 0.7 %, and of one in ten by 3 %.
TRUSTED = 1e-4
LEAST_RATIO = 3.0  # of the two speeds: then δ of a loss factor differs by two thirds of itself
FEWEST_STROKES = 4  # at each speed: two periods, of which one may follow a change of speed
LEAST_TRAVEL = 0.25  # of a stroke, over the range of depths in contact
#: Peak over rms speed of a stroke, below which it is no sine, with 1.40, but a triangle, with 1.0:
#: of those on an independent simulator 45 % of the skews were within two bars.
LEAST_PEAK = 1.25
SWING = 0.1  # smallest swing between two turning points, over the same range
DEGREE = 3  # of the polynomial for the elastic force
SOFT_SIGN = 0.1  # below this part of a stroke's rms speed, friction turns its sign gradually
#: Friction over the force above which the touch is refused. At 1 % simulated touches keep their
#: accuracy; at 5 % its coupling to the turning points moves δ by half a bar and more.
MOST_FRICTION = 0.02
#: Residual over the range of forces above which the touch is not one of a spring.
MOST_RESIDUAL = 0.02
#: Part of the stiffness that relaxes above which the touch is not one of a spring: with a loss
#: factor of .001 it relaxes .1 % in each decade of time.
MOST_RELAXATION = 0.01
WINDOWS_A_PERIOD = 20  # windows over which noise is averaged, as in the search for a delay
BRANCHES = 4  # relaxation times, from the quick strokes' to four times the slow ones'
MOST_ROUNDS = 8
NEAR_ENOUGH = 0.6  # of a sample; at half a sample the shift would go back and forth
SURE = 3.0  # standard errors from which a spring is excluded


@frozen
class Skew(Plain):
    """How late the force is behind the position, from one or more touches of a spring.

    Parameters
    ----------
    delay : Quantity
        δ, s; positive if the force is late. The systematic part is a loss factor of the spring of
        .001, and half of the change from the first touch to the last.
    mark : str
        ``"trust"`` up to a standard error of 0.1 ms, else ``"with-care"``.
    frequencies : tuple of float
        Frequencies of the slow and of the quick strokes, Hz.
    by_speed : tuple of Quantity
        δ of the slow and of the quick strokes, s.
    friction : float
        Friction over the force.
    next_step : str
        What would narrow the bar; empty if nothing has to.
    touches : tuple of Skew
        The touches, if there are several.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> def depth(t):  # m: four strokes at 1 Hz, then eight at 4 Hz
    ...     return 3e-3 + 1.5e-3 * np.sin(2 * np.pi * np.where(t < 4, t, 4 * t))
    >>> t = np.arange(0.0, 6.0, 0.001)
    >>> force = 1000.0 * depth(t - 0.002)  # N: a spring, read 2 ms late
    >>> skew = palpate.skew({"time_s": t, "penetration_m": depth(t), "force_N": force})
    >>> skew.mark, [round(frequency, 1) for frequency in skew.frequencies]
    ('trust', [1.0, 4.0])
    """

    delay: Quantity
    mark: Mark
    frequencies: tuple[float, float]
    by_speed: tuple[Quantity, Quantity]
    friction: float
    next_step: str = ""
    touches: tuple["Skew", ...] = ()

    @property
    def option(self) -> str:
        """The value for ``--delay``, such as ``3.02ms+-0.05ms``."""
        error = 1e3 * self.delay.whole_error
        places = max(1 - math.floor(math.log10(error)), 0)
        return f"{1e3 * self.delay.value:.{places}f}ms+-{error:.{places}f}ms"

    def __str__(self) -> str:
        text = f"the force is {describe_delay(self.delay)}: --delay {self.option}"
        return spell_advice(text)


def describe_delay(delay: Quantity) -> str:
    """Describe a delay of the force: *3.02 ± 0.05 ms late*."""
    way = "late" if delay.value >= 0.0 else "early"
    return f"{with_error(1e3 * abs(delay.value), 1e3 * delay.whole_error, unit='ms')} {way}"


def skew(*touches: Contact | Recorded) -> Skew:
    """Return the skew between force and position, from touches of a spring with the same rig.

    Pass ``(delay.value, delay.whole_error)`` as ``delay=`` to :func:`palpate.identify`, for
    recordings made without restarting the rig.

    Parameters
    ----------
    *touches : Contact, Recording, path or frame
        Each a touch of a spring at two speeds, at least 3 times apart. A second touch, after the
        recordings of the material, shows how far the clocks have moved: half of the change is in
        the bar.

    Returns
    -------
    Skew
        Delay of the force, s, with its error bar and mark.

    Raises
    ------
    RecordingError
        A touch has one speed, or it is none of a spring: it relaxes, rubs or damps.
    InvalidParameterError
        There is no touch.

    Examples
    --------
    >>> import numpy as np
    >>> import palpate
    >>> def depth(t):  # m: four strokes at 1 Hz, then eight at 4 Hz
    ...     return 3e-3 + 1.5e-3 * np.sin(2 * np.pi * np.where(t < 4, t, 4 * t))
    >>> t = np.arange(0.0, 6.0, 0.001)
    >>> force = 1000.0 * depth(t - 0.002)  # N: a spring, read 2 ms late
    >>> delay = palpate.skew({"time_s": t, "penetration_m": depth(t), "force_N": force}).delay
    >>> round(delay.value, 5)  # s
    0.002
    """
    if not touches:
        raise InvalidParameterError("pass at least one touch of a spring")
    contacts = (each if isinstance(each, Contact) else prepare(each) for each in touches)
    found = [_Touch(each).skew() for each in contacts]
    return found[0] if len(found) == 1 else _combine(found)


def _combine(found: Sequence[Skew]) -> Skew:
    """Return the mean of several touches, with half of their range in its bar."""
    values = np.array([each.delay.value for each in found])
    statistical = np.array([each.delay.standard_error for each in found])
    lossy = float(np.mean([each.delay.systematic for each in found]))
    delay = Quantity(
        float(values.mean()),
        norm(statistical) / len(found),
        math.hypot(lossy, 0.5 * float(np.ptp(values))),
    )
    worst = max(found, key=lambda each: each.delay.whole_error)
    trusted = delay.whole_error <= TRUSTED
    moved = f"the clocks moved by {rounded(1e3 * float(np.ptp(values)), 2)} ms between the touches"
    return Skew(
        delay,
        "trust" if trusted else "with-care",
        worst.frequencies,
        worst.by_speed,
        max(each.friction for each in found),
        "" if trusted else worst.next_step or f"{moved}: touch the spring more often",
        tuple(found),
    )


@frozen(eq=False)
class _Strokes:
    """Samples of the strokes, with the motion a whole number of samples earlier."""

    depth: Floats
    velocity: Floats
    force: Floats
    quick: Mask
    sign: Floats  # of the velocity, between −1 and 1
    place: Indices  # of the motion in the contact


@frozen(eq=False)
class _SpringFit:
    """δ that a shift by whole samples leaves at both speeds, s, and what a spring would not do."""

    late: Floats
    errors: Floats
    friction: float  # over the force
    residual: float  # rms of window means, over the range of forces
    relaxing: float  # part of the stiffness that relaxes, if that is certain
    by_depth: tuple[float, float]  # change of δ over the range of depths, s, and its error


class _Touch:
    """The least squares of one touch."""

    def __init__(self, contact: Contact) -> None:
        self.contact = contact
        self.step = contact.sample_time
        inside = contact.penetration > 0.0
        if not inside.any():
            raise self.refusal("the probe never touches it")
        self.shallowest = LIGHT * median(contact.penetration[inside])
        used = contact.penetration > self.shallowest
        self.range = float(np.ptp(contact.penetration[used]))
        self.stroke_speed = np.full(len(contact), np.nan)  # m/s, rms; NaN outside strokes
        self.quick = np.zeros(len(contact), dtype=bool)
        self.omega = self._label_strokes()

    def refusal(self, why: str) -> RecordingError:
        """Return the error that says why this touch does not show the skew."""
        return RecordingError.of(self.contact.source, f"it does not show the skew: {why}")

    def _label_strokes(self) -> tuple[float, float]:
        """Find the strokes, and return the angular frequencies of the slow and the quick ones."""
        time = self.contact.time
        depth = self.contact.penetration
        velocity = self.contact.velocity
        strokes = []
        for part in self.contact.segments():
            turns = part.start + turning_points(depth[part], SWING * self.range)
            # Before the first turning point and after the last the probe comes and goes.
            pairs = zip(turns[1:-2].tolist(), turns[2:-1].tolist(), strict=True)
            strokes += [slice(a, b) for a, b in pairs]
        far = LEAST_TRAVEL * self.range
        strokes = [
            each
            for each in strokes
            if abs(depth[each.stop] - depth[each.start]) > far
            and min(depth[each.start], depth[each.stop]) > self.shallowest
        ]
        if len(strokes) < 2 * FEWEST_STROKES:
            raise self.refusal(
                f"it has too few strokes within the contact, {len(strokes)} of "
                f"{2 * FEWEST_STROKES}: press the spring, then move back and forth without leaving "
                "it, slowly and then quickly"
            )
        omega = np.array([math.pi / (time[each.stop] - time[each.start]) for each in strokes])
        border = math.sqrt(float(omega.min() * omega.max()))
        quick = omega > border
        slowly, quickly = (median(omega[each]) for each in (~quick, quick))
        few = min(int(quick.sum()), int((~quick).sum())) < FEWEST_STROKES
        if few or quickly < 0.95 * LEAST_RATIO * slowly:
            speeds = [rounded(float(each) / math.tau, 2) for each in (omega.min(), omega.max())]
            raise self.refusal(
                f"its strokes are at {speeds[0]} to {speeds[1]} Hz; hold one frequency, then one "
                f"at least {LEAST_RATIO:g} times as high, such as 1 Hz and 4 Hz, for "
                f"{FEWEST_STROKES} strokes each"
            )
        for each, fast in zip(strokes, quick.tolist(), strict=True):
            self.stroke_speed[each] = rms(velocity[each])
            self.quick[each] = fast
        peaks = [
            float(np.percentile(np.abs(velocity[each]), 90.0)) / self.stroke_speed[each.start]
            for each in strokes
        ]
        if np.median(peaks) < LEAST_PEAK:
            raise self.refusal(
                "its strokes have a constant speed, at which friction looks like a lag: move as "
                "a sine does"
            )
        return slowly, quickly

    def skew(self) -> Skew:
        """Fit δ at both speeds, beside friction, and check that this is a spring."""
        shift = 0
        longest = int(LONGEST_FOUND / self.step)
        for _ in range(MOST_ROUNDS):
            fit = self._fit(shift)
            delays = shift * self.step + fit.late
            nearest = round(float(np.mean(delays)) / self.step)
            left = abs(float(np.mean(fit.late))) / self.step
            if left < NEAR_ENOUGH or abs(nearest) > longest:
                break
            shift = nearest
        self._check(fit)
        lossy = LOSS_FACTOR / np.array(self.omega)
        weights = 1.0 / (fit.errors**2 + lossy**2)
        weights /= weights.sum()
        delay = Quantity(
            float(weights @ delays),
            norm(weights * fit.errors),
            float(weights @ lossy),
        )
        slow, quick = (
            Quantity(float(each), float(error), float(wrong))
            for each, error, wrong in zip(delays, fit.errors, lossy, strict=True)
        )
        trusted = delay.whole_error <= TRUSTED
        frequencies = self.omega[0] / math.tau, self.omega[1] / math.tau
        quicker = f"touch it quicker than {rounded(frequencies[1], 2)} Hz, at 3 Hz or more"
        longer = "touch it longer: the noise sets the bar"
        remedy = quicker if delay.systematic > delay.standard_error else longer
        return Skew(
            delay,
            "trust" if trusted else "with-care",
            frequencies,
            (slow, quick),
            fit.friction,
            "" if trusted else remedy,
        )

    def _strokes(self, shift: int) -> _Strokes:
        """Return the samples whose motion, ``shift`` samples earlier, lies in a stroke."""
        contact = self.contact
        place = np.arange(len(contact)) - shift
        there = np.clip(place, 0, len(contact) - 1)
        speed = self.stroke_speed[there]
        used = (place == there) & (contact.segment[there] == contact.segment)
        used &= (
            np.isfinite(speed) & np.isfinite(contact.force) & np.isfinite(contact.velocity[there])
        )
        used &= contact.penetration[there] > self.shallowest
        there = there[used]
        velocity = contact.velocity[there]
        return _Strokes(
            contact.penetration[there],
            velocity,
            contact.force[used],
            self.quick[there],
            np.clip(velocity / (SOFT_SIGN * speed[used]), -1.0, 1.0),
            there,
        )

    def _fit(self, shift: int) -> _SpringFit:
        """Fit F = P(x) − δ P′(x) v + μ (P(x) − P(x₀)) sign(v) + c sign(v).

        P is a polynomial, x₀ the least depth, and δ that of the stroke's speed.
        """
        rows = self._strokes(shift)
        scaled = rows.depth / self.range
        powers = scaled[:, None] ** np.arange(DEGREE + 1)
        lowest = (self.shallowest / self.range) ** np.arange(DEGREE + 1)
        elastic = np.linalg.lstsq(powers, rows.force, rcond=None)[0]
        for _ in range(2):
            slope = powers[:, :-1] @ (np.arange(1, DEGREE + 1) * elastic[1:]) / self.range
            rate = -slope * rows.velocity
            load = (powers - lowest) @ elastic
            columns = np.column_stack(
                [rate * ~rows.quick, rate * rows.quick, load * rows.sign, rows.sign, powers]
            )
            sizes = np.linalg.norm(columns, axis=0)
            solution = np.linalg.lstsq(columns / sizes, rows.force, rcond=None)[0] / sizes
            elastic = solution[4:]
        residual = rows.force - columns @ solution
        forces = float(np.ptp(np.percentile(rows.force, [5.0, 95.0])))
        width = max(int(math.tau / self.omega[1] / WINDOWS_A_PERIOD / self.step), 1)
        averaged = _mean(columns, width)
        left = _mean(residual[:, None], width)[:, 0]
        own = np.linalg.qr(averaged / sizes)[0]

        def amount(column: Floats) -> tuple[float, float]:
            """Return the coefficient of one more column, and its standard error."""
            (remainder,) = _mean(column[:, None], width).T
            remainder = remainder - own @ (own.T @ remainder)
            found = float(remainder @ left / max(remainder @ remainder, 1e-300))
            after = left - found * remainder
            covariance = robust_covariance(remainder[:, None], after, (), own.shape[1])
            return found, math.sqrt(float(covariance[0, 0]))

        stiffness = float(np.mean(slope))
        branches = [amount(stiffness * each[rows.place]) for each in self._relaxing]
        return _SpringFit(
            solution[:2],
            np.sqrt(np.diag(robust_covariance(averaged, left))[:2]),
            friction=math.hypot(float(solution[2]), float(solution[3]) / forces),
            residual=float(np.std(left)) / forces,
            relaxing=max((part for part, error in branches if part > SURE * error), default=0.0),
            by_depth=amount(rate * (scaled - scaled.mean())),
        )

    @cached_property
    def _relaxing(self) -> Floats:
        """Return the states of Maxwell branches on a linear spring, m, a row a relaxation time."""
        depth = self.contact.penetration
        path = np.where(np.isfinite(depth), np.maximum(depth, 0.0), 0.0)
        slowly, quickly = self.omega
        times = np.geomspace(1.0 / quickly, 4.0 / slowly, BRANCHES)
        states = _core.relaxation_states(1.0, times, self.contact.time_steps, path)
        rows: Floats = states.T
        return rows

    def _check(self, fit: _SpringFit) -> None:
        """Refuse a touch that is not one of a spring."""
        spring = "touch a steel spring, without a guide that rubs"
        if fit.friction > MOST_FRICTION:
            raise self.refusal(f"friction is {percent(fit.friction)} of the force; {spring}")
        if fit.relaxing > MOST_RELAXATION:
            part = percent(fit.relaxing)
            raise self.refusal(f"the force relaxes by {part}, as a material's does; {spring}")
        bar = math.hypot(*fit.errors, *(LOSS_FACTOR / np.array(self.omega)))
        difference = float(fit.late[1] - fit.late[0])
        if abs(difference) > 2.0 * bar:
            size = rounded(1e3 * difference, 2)
            raise self.refusal(
                f"the slow and the quick strokes disagree by {size} ms, as where a material damps; "
                f"{spring}"
            )
        if fit.residual > MOST_RESIDUAL:
            part = percent(fit.residual)
            raise self.refusal(f"the force is {part} off that of a spring; {spring}")
        slope, error = fit.by_depth
        if abs(slope) > max(SURE * error, bar):
            raise self.refusal(f"its lag depends on the depth, as where a material damps; {spring}")


def _mean(values: Floats, width: int) -> Floats:
    """Return the means of ``width`` rows each."""
    windows = len(values) // width
    averages: Floats = values[: windows * width].reshape(windows, width, -1).mean(axis=1)
    return averages
