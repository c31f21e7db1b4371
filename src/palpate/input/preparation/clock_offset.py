"""The offset of the clocks of two files, a position and a force: found, removed and reported.

It is found in two steps. The rough offset is the lag at which the position explains most of the
force. The fine offset is the lag that a contact law explains best.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import palpate._core as _core
from palpate.digits import rounded, with_error
from palpate.errors import RecordingError
from palpate.findings import Check, Finding
from palpate.force_laws import steps_over_breaks
from palpate.input.channels.two_files import FilePair, pair_recordings, signal_of
from palpate.input.preparation.delay import LONGEST_FOUND, MOST_SAMPLES, find_delay, motion_period
from palpate.input.preparation.resolution import noise_of
from palpate.input.preparation.settings import Preparation, check_delay
from palpate.input.preparation.velocity import find_spikes
from palpate.input.recordings import Recording
from palpate.method.contact import Contact, Delay
from palpate.method.estimators.least_squares import least_squares, nonnegative
from palpate.method.rows import typical_step
from palpate.validation import Floats

MOST_ROUNDS = 5  # the surface depends on the offset, and the offset on the surface
SETTLED = 0.3  # standard errors; a smaller correction is the last
INSIGNIFICANT = 2.0  # standard errors; a smaller offset of clocks that both show the date is none
DEFAULT_ERROR = 1e-3  # s, of an offset that is passed without a standard error


class ClockOffset(NamedTuple):
    """The offset of the force's clock, its lag after the origins, and its drift, all in s."""

    delay: Delay
    lag: float
    drift: float


def align(
    first: Recording,
    second: Recording,
    settings: Preparation,
    prepare: Callable[[Recording, Preparation], Contact],
) -> tuple[Recording, Preparation]:
    """Move the force's clock to the position's; return one recording, and settings for it.

    Parameters
    ----------
    first, second : Recording
        A position and a force, in any order.
    settings : Preparation
        Its delay, if any, is the whole offset of the clocks; else the offset is found.
    prepare : callable
        Makes a contact from a recording and settings.

    Raises
    ------
    RecordingError
        The files do not have a position and a force, or no offset of their clocks explains the
        force.
    """
    pair = pair_recordings(first, second, settings.columns, settings.units, settings.rate)
    requested = settings.delay
    settings = replace(settings, columns=pair.columns, rate=None, delay=0.0)
    if isinstance(requested, str) or requested == 0.0:
        delay, lag, drift = _find_offset(pair, settings, prepare)
    else:
        if isinstance(requested, int | float):
            requested = (requested, DEFAULT_ERROR)
        delay = check_delay("delay", requested)
        lag = delay.seconds - pair.distance
        drift = 0.0
    insignificant = abs(delay.seconds) < INSIGNIFICANT * delay.standard_error
    if pair.dated and delay.found and insignificant and not drift:
        finding = _report_one_clock(delay)
        recording = pair.moved(-pair.distance)
        remainder = replace(delay, found=False)
        error = math.hypot(delay.standard_error, delay.seconds)
    else:
        finding = _report_offset(pair.names[1], delay, drift)
        recording = pair.moved(lag)
        remainder = delay
        error = math.hypot(delay.standard_error, drift / math.sqrt(12.0))
    recording = replace(
        recording,
        notes={**recording.notes, "clocks": finding.message},
        findings=(*recording.findings, finding),
    )
    remainder = replace(remainder, seconds=0.0, standard_error=error)
    return recording, replace(settings, delay=remainder if error else 0.0)


def _find_offset(
    pair: FilePair, settings: Preparation, prepare: Callable[[Recording, Preparation], Contact]
) -> ClockOffset:
    near = -pair.distance if pair.dated else None
    lag = rough_offset(signal_of(pair.position), signal_of(pair.force), near)
    if lag is None:
        raise RecordingError(
            f"{pair.recording.source}: palpate cannot find the offset of the two clocks: the "
            "position explains the force at no offset; record the same touches in both files, or "
            "pass the offset, such as --delay 37ms+-0.5ms"
        )
    reach = LONGEST_FOUND
    for _ in range(MOST_ROUNDS):
        contact = prepare(pair.moved(lag), settings)
        delay, drift = fine_offset(contact, reach)
        lag += delay.seconds
        reach = 4.0 * max(delay.standard_error + abs(delay.seconds), contact.sample_time)
        if abs(delay.seconds) < SETTLED * delay.standard_error:
            break
    return ClockOffset(replace(delay, seconds=lag + pair.distance), lag, drift)


def _report_one_clock(delay: Delay) -> Finding:
    """Report that two clocks that count from 1970 are taken for one."""
    size = with_error(1e3 * delay.seconds, 1e3 * delay.standard_error, unit="ms")
    return Check.CLOCK_OFFSET.finding(
        f"both clocks count from 1970: the offset found, {size}, is not significant and was not "
        "applied"
    )


def _report_offset(name: str, delay: Delay, drift: float) -> Finding:
    """Report the offset of a file's clock and its drift."""
    late = abs(delay.seconds)
    size, unit = (1e3, "ms") if late < 1.0 else (1.0, "s")
    amount = with_error(late * size, delay.standard_error * size, unit=unit)
    if late > 1e4:  # one clock shows the date
        amount = f"{late:.4f} s ± {rounded(1e3 * delay.standard_error, 2)} ms"
    direction = "ahead" if delay.seconds > 0.0 else "behind"
    message = f"{name}'s clock is {amount} {direction}; it was moved"
    if not drift:
        return Check.CLOCK_OFFSET.finding(message)
    message += f"; it drifts by {rounded(1e3 * abs(drift), 2)} ms over the recording"
    remedy = "identify shorter parts, --start and --stop: palpate finds the offset of each"
    return Check.CLOCK_OFFSET.finding(message, remedy, damping="with-care")


# The rough offset.

BINS = 24  # bins of the position
CLIPPED = 0.1, 99.9  # percentiles of the force, beyond which it may be a spike
MOST_STEPS = 1 << 15  # steps of the common grid, and about the samples for the fine offset
LEAST_EXPLAINED = 0.5  # fraction of the variance of the force
NEAR = 1.0  # s; between clocks that show the date such an offset is preferred if it fits as well
AS_WELL = 0.95  # fraction of the best


def rough_offset(
    motion: tuple[Floats, Floats], push: tuple[Floats, Floats], near: float | None = None
) -> float | None:
    """Return the lag at which the position explains most of the force, s; None if none does.

    At each lag the force is compared with its means over 24 bins of the position: these explain
    Σ Sₖ²/Nₖ − (Σ Sₖ)²/Σ Nₖ, where Sₖ and Nₖ are sum and number of the forces in a bin. The sums at
    all lags are correlations, computed by a Fourier transform. Each axis of the position is tried.

    Parameters
    ----------
    motion, push : tuple of numpy.ndarray
        Times [s], shape (k,), and values, shape (k, axes), of the position and of the force.
    near : float, optional
        A lag near which the right one lies, s, if one within a second of it fits as well.
    """
    t, position = _select_increasing(*motion)
    s, force = _select_increasing(*push)
    if min(t.size, s.size) < BINS:
        return None
    step = max(
        typical_step(t),
        typical_step(s),
        float(np.ptp(t) + np.ptp(s)) / MOST_STEPS,
    )
    grid = np.arange(t[0], t[-1], step)
    others = np.arange(s[0], s[-1], step)
    centred = force - np.median(force, axis=0)
    main_axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    compression = np.interp(others, s, centred @ main_axis)
    compression = np.clip(compression, *np.percentile(compression, CLIPPED))
    size = 1 << (grid.size + others.size).bit_length()
    powers = (np.ones_like(compression), compression, compression**2)
    spectra = [np.fft.rfft(power, size) for power in powers]

    def correlate(mask: Floats) -> list[Floats]:
        """Number, sum and sum of squares of the forces at the masked positions, at each lag."""
        selection = np.conj(np.fft.rfft(mask, size))
        number, total, squares = (np.fft.irfft(selection * power, size) for power in spectra)
        return [np.maximum(np.rint(number), 1.0), total, squares]

    number, total, squares = correlate(np.ones_like(grid))
    lags = step * ((np.arange(size) + size // 2) % size - size // 2) + others[0] - grid[0]
    variance = squares - total**2 / number
    most = lag = share = 0.0
    for column in position.T:
        x = np.interp(grid, t, column)
        bins = np.digitize(x, np.linspace(x.min(), x.max(), BINS + 1)[1:-1])
        explained = -(total**2) / number
        for k in range(BINS):
            in_bin, sum_in_bin, _ = correlate(np.where(bins == k, 1.0, 0.0))
            explained += sum_in_bin**2 / in_bin
        explained[number < BINS] = 0.0
        best = int(np.argmax(explained))
        if near is not None:
            close = np.where(np.abs(lags - near) < NEAR, explained, 0.0)
            best = int(np.argmax(close)) if close.max() > AS_WELL * explained[best] else best
        if explained[best] > most:
            most = float(explained[best])
            lag = float(lags[best])
            share = most / max(float(variance[best]), TINY)
    return lag if share > LEAST_EXPLAINED else None


def _select_increasing(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The samples without spikes whose time exceeds all before."""
    keep = np.isfinite(time) & np.isfinite(values).all(axis=1)
    with np.errstate(invalid="ignore"):
        keep &= ~np.any([find_spikes(column) for column in values.T], axis=0)
    time = time[keep]
    later = np.diff(np.maximum.accumulate(time), prepend=-np.inf) > 0.0
    return time[later], values[keep][later]


# The fine offset. A late force and damping can have the same effect, since K (x − vτ)ⁿ is
# K xⁿ − τ n K xⁿ⁻¹ v. Only damping of the Hunt–Crossley form differs from it everywhere. With
# another law only two facts tell them apart: where the force begins and ends, and that no damping
# is negative.

SHIFTS = 20  # shifts to each side
RELAXATION_TIMES = 10
EXPONENTS = (0.6, 3.2)
STARTS = (1.0, 1.4, 2.0)  # exponents
ENOUGH = 1e-2  # fraction of Σ r²; a step that reduces it by less is the last
TINY = 1e-300
FEWEST, MOST_ROWS = 50, 4000
IN_AIR = 4.0  # standard deviations of the noise; a smaller force may be none
WEIGHTS = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
#: Difference of scores N ln(RSS) above which Hunt–Crossley is not the law. With that law it is
#: mostly below 5, with half-space damping in a single press about 9.
CLEARLY = 6.0
EQUAL_LAWS = 0.004  # difference of ln(RSS), due to interpolation and the steps of the search
# A shift fits as well as the best if the mean square is at most 5 % larger: a finite number of
# relaxation times and a filtered velocity cause errors of that size.
EQUAL_COST = 1.05
# A drift is reported above this many standard errors and this change over the recording, s.
SIGNIFICANT, LEAST_DRIFT = 4.0, 1e-3


class FineOffset(NamedTuple):
    """The delay that is left in the force, and its drift over the recording, s."""

    delay: Delay
    drift: float


def fine_offset(contact: Contact, reach: float = LONGEST_FOUND) -> FineOffset:
    """Return the delay that is left in the force, and its drift over the recording, s.

    If Hunt–Crossley fits as well as a law that has any damping and relaxation, it is the delay of
    :func:`find_delay`. Else it is the middle of the shifts at which the more general law fits as
    well as at the best one, and its standard error is that of an even distribution over them.

    Parameters
    ----------
    contact : Contact
        The contact, aligned to within the reach.
    reach : float
        Largest shift, s.

    Raises
    ------
    RecordingError
        No sample is in contact.
    """
    contact = contact.taken(slice(MOST_SAMPLES))
    longest = min(LONGEST_FOUND, motion_period(contact) / 6.0)
    reach = min(reach, longest)
    if not reach > 0.0:
        raise RecordingError.of(contact.source, "there is no contact")
    shifts = np.linspace(-reach, reach, 2 * SHIFTS + 1)
    law = _AnyLaw(contact, reach)
    fits = law.fits(shifts)
    costs = np.array([fit.cost for fit in fits])
    residual = fits[int(np.argmin(costs))].residual
    energy = max(float(residual @ residual), TINY)
    correlation = max(float(residual[1:] @ residual[:-1]) / energy, 0.0)
    samples = residual.size * (1.0 - correlation) / (1.0 + correlation)
    with suppress(RecordingError):
        delay = find_delay(contact)
        least = min(float(costs.min()), law.fit(delay.seconds).cost)
        plain = law.fit(delay.seconds, plain=True).cost
        if math.log(plain / least) < max(CLEARLY / samples, EQUAL_LAWS):
            return FineOffset(delay, law.drift(delay.seconds, samples))
    within = shifts[costs <= costs.min() * max(math.exp(4.0 / samples), EQUAL_COST)]
    low, high = float(within[0]), float(within[-1])
    if reach < longest and (low == shifts[0] or high == shifts[-1]):
        return fine_offset(contact, 2.0 * reach)
    middle = 0.5 * (low + high)
    # The force begins somewhere between two samples.
    error = math.hypot(high - low, contact.sample_time) / math.sqrt(12.0)
    delay = Delay(middle, error, found=True, from_contact=True)
    return FineOffset(delay, law.drift(middle, samples))


class _Fit(NamedTuple):
    """The least mean square of the force, N²; exponent and surface [m]; the residual, N."""

    cost: float
    parameters: Floats
    residual: Floats


class _AnyLaw:
    """Least squares of the force by a law with any damping and relaxation, at a shifted motion.

    Its columns are xⁿ, the dampers xⁿ v, xⁿ⁻¹ v and v, and relaxing forces, with factors ≥ 0, and
    an offset; plain it has xⁿ, xⁿ v and the offset, and is the Hunt–Crossley law.
    """

    def __init__(self, contact: Contact, reach: float) -> None:
        with np.errstate(invalid="ignore"):
            usable = np.isfinite(contact.force) & ~find_spikes(contact.force)
        usable &= np.isfinite(contact.penetration) & np.isfinite(contact.velocity)
        self.contact = _smooth_motion(contact)
        #: Every so many samples are used; the motion between them is interpolated from all.
        self.every = max(len(contact) // MOST_STEPS, 1)
        thinned = self.contact.taken(slice(None, None, self.every))
        step = thinned.sample_time
        self.time = thinned.time
        self.steps = steps_over_breaks(thinned.time, thinned.penetration, step)
        longest = max(0.5 * float(np.ptp(self.time)), 4.0 * step)
        self.relaxation_times = np.geomspace(2.0 * step, longest, RELAXATION_TIMES)
        # The surface of a position is estimated; that of a penetration is known.
        self.placed = contact.prepared is not None and contact.prepared.surface is not None
        margin = 0.5 * float(np.nanmax(contact.penetration)) if self.placed else 0.0
        self.bounds = np.array([EXPONENTS[0], -margin]), np.array([EXPONENTS[1], margin])
        ends = np.array([self._shift_motion(-reach), self._shift_motion(reach)])
        near = usable[:: self.every] & (ends[:, 0].max(axis=0) > -margin)
        rows = np.flatnonzero(near & np.isfinite(ends).all(axis=(0, 1)))
        if rows.size < FEWEST:
            message = "too few samples are in contact to find the offset of the clocks"
            raise RecordingError.of(contact.source, message)
        self.rows = rows[:: max(-(-rows.size // MOST_ROWS), 1)]
        self.force = thinned.force[self.rows]
        self.light = self.force < IN_AIR * noise_of(contact.force)
        surfaces = (-0.4 * margin, 0.0) if self.placed else (0.0,)
        starts = [np.array([n, surface]) for n in STARTS for surface in surfaces]
        fits = [self.fit(0.0, start) for start in starts]
        self.start = min(fits, key=lambda fit: fit.cost).parameters

    def fits(self, shifts: Floats) -> list[_Fit]:
        """Return the fit at each shift [s].

        From the middle to each side, each search begins where the one before ended.
        """
        middle = len(shifts) // 2
        fits = {middle: self.fit(shifts[middle])}
        for step, end in ((1, len(shifts)), (-1, -1)):
            for k in range(middle + step, end, step):
                fits[k] = self.fit(shifts[k], fits[k - step].parameters)
        return [fits[k] for k in range(len(shifts))]

    def drift(self, shift: float, samples: float) -> float:
        """Return the change of the delay over the recording, s; 0 if it is not significant."""
        span = max(float(np.ptp(self.time)), TINY)
        late = (self.time - 0.5 * (self.time[0] + self.time[-1])) / span
        step = max(5.0 * LEAST_DRIFT, self.contact.sample_time)
        low, cost, high = (self.fit(shift + by * late).cost for by in (-step, 0.0, step))
        bend = low + high - 2.0 * cost
        if not bend > 0.0:
            return 0.0
        drift = 0.5 * step * (low - high) / bend
        error = step * math.sqrt(2.0 * cost / bend / samples)
        return drift if abs(drift) > max(SIGNIFICANT * error, LEAST_DRIFT) else 0.0

    def fit(
        self, shift: float | Floats, start: Floats | None = None, *, plain: bool = False
    ) -> _Fit:
        """Fit the law, its exponent and surface from a start, to the motion a shift [s] earlier."""
        x, v = self._shift_motion(shift)

        def model(parameters: Floats) -> tuple[Floats, Floats]:
            return self._solve(x, v, parameters, plain)

        start = self.start if start is None else start
        fitted = least_squares(model, start, self.bounds, ENOUGH)
        cost = max(float(fitted.residual @ fitted.residual) / self.rows.size, TINY)
        return _Fit(cost, fitted.parameters, fitted.residual)

    def _shift_motion(self, shift: float | Floats) -> tuple[Floats, Floats]:
        """Penetration and velocity a time earlier; NaN outside of a segment."""
        contact = self.contact
        earlier = self.time - shift
        x = np.full(earlier.size, np.nan)
        v = x.copy()
        for run in contact.segments():
            thinned = slice(-(-run.start // self.every), -(-run.stop // self.every))
            for shifted, values in ((x, contact.penetration), (v, contact.velocity)):
                time = contact.time[run]
                shifted[thinned] = np.interp(earlier[thinned], time, values[run], np.nan, np.nan)
        return x, v

    def _solve(
        self, x: Floats, v: Floats, parameters: Floats, plain: bool
    ) -> tuple[Floats, Floats]:
        """Return the residual at an exponent and a surface, and the slopes of the force by them.

        The slopes are those of the law whose factors follow the exponent and the surface
        (variable projection): nearly F ln x and −n F/x, with the law's force F, less what the
        factors make up for.
        """
        n, surface = parameters.tolist()
        path = np.where(x > surface, x - surface, 0.0)
        depth = path[self.rows]
        speed = np.nan_to_num(v[self.rows])
        inside = depth > 0.0
        safe = np.where(inside, depth, 1.0)
        elastic = safe**n
        columns = [elastic, elastic * speed]
        if not plain:
            times, steps = self.relaxation_times, self.steps
            states = _core.relaxation_states(n, times, steps, path)[self.rows]
            columns += [safe ** (n - 1.0) * speed, speed, *states.T]
        pressing = np.column_stack(columns) * inside[:, None]
        matrix = np.column_stack([np.ones_like(depth), pressing])
        matrix /= np.maximum(np.linalg.norm(matrix, axis=0), TINY)
        free = np.arange(matrix.shape[1]) < 1
        separate = np.zeros_like(inside)
        for _ in range(2):
            used = np.where(separate[:, None], 0.0, matrix)
            # einsum: threads of a BLAS that wait for each other take a hundred times as long.
            gram = np.einsum("ij,ik->jk", used, used)
            factors = nonnegative(gram, used.T @ self.force, free, np.ones_like(free))
            offset = factors[0] * matrix[0, 0]
            fitted = matrix @ factors - offset
            # Where the law pulls and no force is measured, probe and material have separated.
            separate = self.light & inside & (fitted < 0.0)
        fitted = np.where(separate, 0.0, fitted)
        slopes = np.column_stack([fitted * np.log(safe), -n * fitted / safe])
        slopes *= (inside & ~separate)[:, None] * np.array([1.0, self.placed])
        active = used[:, factors != 0.0]
        normal = np.einsum("ij,ik->jk", active, active)
        normal += 1e-10 * np.eye(len(normal))
        slopes -= active @ np.linalg.solve(normal, active.T @ slopes)
        return self.force - offset - fitted, slopes


def _smooth_motion(contact: Contact) -> Contact:
    """Interpolate the motion where it is unknown, and smooth it.

    Interpolation halves the variance of noise midway between two samples, where a shift would then
    fit best; after these weights it lowers it by a tenth.
    """
    depth = contact.penetration.copy()
    speed = contact.velocity.copy()
    usable = np.isfinite(depth) & np.isfinite(speed)
    margin = len(WEIGHTS) // 2
    for run in contact.segments():
        time = contact.time[run]
        valid = usable[run]
        if valid.any():
            for values in (depth[run], speed[run]):
                values[:] = np.interp(time, time[valid], values[valid])
        if len(time) > len(WEIGHTS):
            depth[run][margin:-margin] = np.convolve(depth[run], WEIGHTS, "valid")
    return replace(contact, penetration=depth, velocity=speed)
