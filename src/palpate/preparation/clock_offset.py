"""The offset of two clocks, of a position and of a force: roughly, and by the contact law."""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np

import palpate._core as _core
from palpate.contact import Contact, Delay
from palpate.errors import RecordingError
from palpate.estimators.least_squares import nonnegative
from palpate.force_laws import steps_over_breaks
from palpate.preparation.delay import LONGEST_FOUND, MOST_SAMPLES, find_delay, motion_period
from palpate.preparation.resolution import noise_of
from palpate.preparation.velocity import find_spikes
from palpate.validation import Floats

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
    (t, position), (s, force) = map(_increasing, (motion, push))
    if min(t.size, s.size) < BINS:
        return None
    span = float(np.ptp(t) + np.ptp(s))
    step = max(*(float(np.median(np.diff(each))) for each in (t, s)), span / MOST_STEPS)
    grid, others = (np.arange(each[0], each[-1], step) for each in (t, s))
    centred = force - np.median(force, axis=0)
    compression = np.interp(others, s, centred @ np.linalg.eigh(centred.T @ centred)[1][:, -1])
    compression = np.clip(compression, *np.percentile(compression, CLIPPED))
    size = 1 << (grid.size + others.size).bit_length()
    ones = np.ones_like(compression)
    spectra = [np.fft.rfft(each, size) for each in (ones, compression, compression**2)]

    def sums(taken: Floats) -> list[Floats]:
        """Number, sum and sum of squares of the forces at the positions taken, at each lag."""
        chosen = np.conj(np.fft.rfft(taken, size))
        count, total, squares = (np.fft.irfft(chosen * each, size) for each in spectra)
        return [np.maximum(np.rint(count), 1.0), total, squares]

    count, total, squares = sums(np.ones_like(grid))
    shifts = (np.arange(size) + size // 2) % size - size // 2
    lags = step * shifts + others[0] - grid[0]
    variance = squares - total**2 / count
    best = lag = share = 0.0
    for column in position.T:
        x = np.interp(grid, t, column)
        bins = np.digitize(x, np.linspace(x.min(), x.max(), BINS + 1)[1:-1])
        explained = -(total**2) / count
        for k in range(BINS):
            inside, part, _ = sums(np.where(bins == k, 1.0, 0.0))
            explained += part**2 / inside
        explained[count < BINS] = 0.0
        place = int(np.argmax(explained))
        if near is not None:
            close = np.where(np.abs(lags - near) < NEAR, explained, 0.0)
            place = int(np.argmax(close)) if close.max() > AS_WELL * explained[place] else place
        if explained[place] > best:
            best, lag = float(explained[place]), float(lags[place])
            share = best / max(float(variance[place]), 1e-300)
    return lag if share > LEAST_EXPLAINED else None


def _increasing(signal: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """The samples without spikes whose time exceeds all before."""
    time, values = signal
    keep = np.isfinite(time) & np.isfinite(values).all(axis=1)
    with np.errstate(invalid="ignore"):
        keep &= ~np.any([find_spikes(column) for column in values.T], axis=0)
    time, values = time[keep], values[keep]
    later = np.diff(np.maximum.accumulate(time), prepend=-np.inf) > 0.0
    return time[later], values[later]


# The fine offset. A late force and damping can have the same effect, since K (x − vτ)ⁿ is
# K xⁿ − τ n K xⁿ⁻¹ v. Only damping of the Hunt–Crossley form differs from it everywhere. With
# another law only two facts tell them apart: where the force begins and ends, and that no damping
# is negative.

SHIFTS = 20  # shifts to each side
RELAXATION_TIMES = 10
ROUNDS = 3  # corrections of exponent and surface
CLOSE = 0.05  # correction of the exponent
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


def fine_offset(contact: Contact, reach: float = LONGEST_FOUND) -> tuple[Delay, float]:
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
    law = _AnyLaw(contact, shifts)
    costs, rest = law.costs(shifts)
    correlation = max(float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300), 0.0)
    samples = rest.size * (1.0 - correlation) / (1.0 + correlation)
    with suppress(RecordingError):
        delay = find_delay(contact)
        least = min(float(costs.min()), law.fit(delay.seconds, law.start)[0])
        plain = law.fit(delay.seconds, law.start, plain=True, rounds=2 * ROUNDS)[0]
        if math.log(plain / least) < max(CLEARLY / samples, EQUAL_LAWS):
            return delay, law.drift(delay.seconds, samples)
    within = shifts[costs <= costs.min() * max(math.exp(4.0 / samples), EQUAL_COST)]
    if reach < longest and (within[0] == shifts[0] or within[-1] == shifts[-1]):
        return fine_offset(contact, 2.0 * reach)
    middle, width = 0.5 * float(within[0] + within[-1]), float(within[-1] - within[0])
    # The force begins somewhere between two samples.
    error = math.hypot(width, contact.sample_time) / math.sqrt(12.0)
    return Delay(middle, error, found=True, from_contact=True), law.drift(middle, samples)


class _AnyLaw:
    """Least squares of the force by a law with any damping and relaxation, at a shifted motion.

    Its columns are xⁿ, the dampers xⁿ v, xⁿ⁻¹ v and v, and relaxing forces, with factors ≥ 0, and
    an offset; plain it has xⁿ, xⁿ v and the offset, and is the Hunt–Crossley law.
    """

    def __init__(self, contact: Contact, shifts: Floats) -> None:
        # Interpolation halves the variance of noise midway between two samples, where a shift would
        # then fit best; after these weights it lowers it by a tenth.
        known = np.isfinite(contact.penetration) & np.isfinite(contact.velocity)
        depth, speed = contact.penetration.copy(), contact.velocity.copy()
        for part in contact.segments():
            time, there = contact.time[part], known[part]
            for values in (depth[part], speed[part]):
                if there.any():
                    values[:] = np.interp(time, time[there], values[there])
            if len(time) > len(WEIGHTS):
                own = np.convolve(depth[part], WEIGHTS, "valid")
                depth[part][len(WEIGHTS) // 2 : -(len(WEIGHTS) // 2)] = own
        self.contact = replace(contact, penetration=depth, velocity=speed)
        #: Every so many samples are used; the motion between them is interpolated from all.
        self.every = max(len(contact) // MOST_STEPS, 1)
        thinned = self.contact.taken(slice(None, None, self.every))
        self.time, step = thinned.time, thinned.sample_time
        self.steps = steps_over_breaks(thinned.time, thinned.penetration, step)
        longest = max(0.5 * float(np.ptp(self.time)), 4.0 * step)
        self.times = np.geomspace(2.0 * step, longest, RELAXATION_TIMES)
        with np.errstate(invalid="ignore"):
            known &= np.isfinite(contact.force) & ~find_spikes(contact.force)
        # The surface of a position is estimated; that of a penetration is known.
        self.placed = contact.prepared is not None and contact.prepared.surface is not None
        self.deep = float(np.nanmax(contact.penetration))
        low = -0.5 * self.deep if self.placed else 0.0
        ends = [self._moved(shift) for shift in (shifts[0], shifts[-1])]
        near = known[:: self.every] & (np.maximum(ends[0][0], ends[1][0]) > low)
        rows = np.flatnonzero(near & np.isfinite(ends).all(axis=(0, 1)))
        if rows.size < FEWEST:
            words = "too few samples are in contact to find the offset of the clocks"
            raise RecordingError.of(contact.source, words)
        self.rows = rows[:: max(-(-rows.size // MOST_ROWS), 1)]
        self.force = thinned.force[self.rows]
        self.light = self.force < IN_AIR * noise_of(contact.force)
        surfaces = (-0.2 * self.deep, 0.0) if self.placed else (0.0,)
        starts = [(n, surface) for n in (1.0, 1.4, 2.0) for surface in surfaces]
        fits = [self.fit(0.0, start, rounds=3 * ROUNDS) for start in starts]
        self.start = min(fits, key=lambda each: each[0])[1]

    def costs(self, shifts: Floats) -> tuple[Floats, Floats]:
        """Return the mean square of the residual, N², at each shift [s], and the least's residual.

        From the middle to each side, each search begins where the one before ended.
        """
        fits = {}
        for side in (shifts[shifts >= 0.0], shifts[shifts < 0.0][::-1]):
            start = self.start
            for shift in side.tolist():
                fits[shift] = self.fit(shift, start)
                start = fits[shift][1]
        least = min(fits.values(), key=lambda each: each[0])
        return np.array([fits[shift][0] for shift in shifts.tolist()]), least[2]

    def drift(self, shift: float, samples: float) -> float:
        """Return the change of the delay over the recording, s; 0 if it is not significant."""
        span = float(np.ptp(self.time))
        late = (self.time - 0.5 * (self.time[0] + self.time[-1])) / max(span, 1e-300)
        step = max(5.0 * LEAST_DRIFT, self.contact.sample_time)
        low, cost, high = (
            self.fit(shift + by * late, self.start, rounds=2 * ROUNDS)[0]
            for by in (-step, 0.0, step)
        )
        bend = low + high - 2.0 * cost
        if not bend > 0.0:
            return 0.0
        drift = 0.5 * step * (low - high) / bend
        error = step * math.sqrt(2.0 * cost / bend / samples)
        return drift if abs(drift) > max(SIGNIFICANT * error, LEAST_DRIFT) else 0.0

    def fit(
        self,
        shift: float | Floats,
        start: tuple[float, float],
        *,
        plain: bool = False,
        rounds: int = ROUNDS,
    ) -> tuple[float, tuple[float, float], Floats]:
        """Return the least mean square, its exponent and surface, and the residual.

        Each round corrects exponent and surface by their derivatives (Gauss–Newton), and by a third
        of it after a round that did not lower the mean square.
        """
        best = math.inf, start, np.zeros(self.rows.size)
        step, at, force = (0.0, 0.0), start, None
        for _ in range(rounds):
            rest, fitted, correction = self._solved(shift, plain, *at, force)
            cost = max(float(rest @ rest) / rest.size, 1e-300)
            if cost < best[0]:
                best, step = (cost, at, rest), correction
                force = fitted if abs(step[0]) < CLOSE else None
            else:
                step = step[0] / 3.0, step[1] / 3.0
            (n, surface), (by_n, by_surface), most = best[1], step, 0.1 * self.deep
            n = min(max(n + min(max(by_n, -0.2), 0.2), 0.6), 3.2)
            at = n, surface + min(max(by_surface, -most), most)
        return best

    def _moved(self, shift: float | Floats) -> tuple[Floats, Floats]:
        """Penetration and velocity a time earlier; NaN outside of a segment."""
        contact, earlier = self.contact, self.time - shift
        x, v = np.full((2, earlier.size), np.nan)
        for part in contact.segments():
            first, last = (-(-k // self.every) for k in (part.start, part.stop))
            own, time = slice(first, last), contact.time[part]
            for moved, values in ((x, contact.penetration), (v, contact.velocity)):
                moved[own] = np.interp(earlier[own], time, values[part], np.nan, np.nan)
        return x, v

    def _solved(
        self,
        shift: float | Floats,
        plain: bool,
        n: float,
        surface: float,
        force: Floats | None,
    ) -> tuple[Floats, Floats, tuple[float, float]]:
        """Return residual, force of the law, and the corrections of exponent and surface.

        The derivatives are nearly F ln x and −n F/x, with the force F of the round before if that
        was close, else with xⁿ.
        """
        x, v = self._moved(shift)
        path = np.where(x > surface, x - surface, 0.0)
        depth, speed = path[self.rows], np.nan_to_num(v[self.rows])
        inside = depth > 0.0
        safe = np.where(inside, depth, 1.0)
        elastic = safe**n
        shape = elastic if force is None else force
        columns = [shape * np.log(safe), shape / safe, elastic, elastic * speed]
        if not plain:
            states = _core.relaxation_states(n, self.times, self.steps, path)[self.rows]
            columns += [safe ** (n - 1.0) * speed, speed, *states.T]
        columns = [np.ones_like(depth), *(np.where(inside, each, 0.0) for each in columns)]
        matrix = np.column_stack(columns)
        sizes = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        matrix /= sizes
        place = np.arange(len(sizes))
        free, law = place < 3, (place < 1) | (place > 2)
        apart = self.light & inside
        for _ in range(2):
            taken = matrix[~apart]
            # einsum: threads of a BLAS that wait for each other take a hundred times as long.
            gram, moment = np.einsum("ij,ik->jk", taken, taken), taken.T @ self.force[~apart]
            factors = nonnegative(gram, moment, free, law)
            fitted, offset = matrix @ factors, factors[0] / sizes[0]
            # Where the law pulls and no force is measured, probe and material have separated.
            apart = self.light & inside & (fitted < offset)
        rest = self.force - np.where(apart, offset, fitted)
        change = nonnegative(gram, moment, free, law | (place < (3 if self.placed else 2)))
        shape, force = np.where(inside, shape, 0.0), np.where(inside, fitted - offset, 0.0)
        scale = float(shape @ force) / max(float(shape @ shape), 1e-300)
        by_n, by_surface = change[1:3] / sizes[1:3] / (scale or math.inf)
        return rest, force, (float(by_n), float(-by_surface / n))
