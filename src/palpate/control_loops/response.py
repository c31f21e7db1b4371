"""The gain at which a sampled, delayed loop begins to swing on a linear contact.

The contact is its stiffness S = ∂F/∂x and damping C = ∂F/∂v. With the states penetration, velocity,
filtered force and its rate, the plant between two samples is exact for a held command and any
delay, x⁺ = Φ x + Γ₀ u[k−d] + Γ₁ u[k−d−1]; no delay is approximated by a Padé polynomial. The loop
swings at the smallest gain for which its open-loop response passes through −1.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from palpate.control_loops.loop import Complex, ControlLoop
from palpate.validation import Floats

_STATES = 4
_POINTS = 400  # of the grid of frequencies: 2.4 % apart at 1 kHz
_LOWEST = 0.3  # rad/s
# Terms of the exponential's series: at a norm of 1/4 the next is below 1e-17.
_TERMS = 12
_NORM = 0.25
_HALVINGS = 16  # of a cell of the grid, to a ten-thousandth of a per cent


def matrix_exponential(matrices: Floats) -> Floats:
    """Return the exponentials of square matrices, shape (…, n, n), by scaling and squaring."""
    norm = float(np.abs(matrices).sum(axis=-1).max(initial=0.0))
    squarings = max(0, math.ceil(math.log2(max(norm / _NORM, 1.0))))
    small = matrices / 2.0**squarings
    # exp − 1, which keeps its digits where the step is short.
    moved = small.copy()
    for term in range(_TERMS, 1, -1):
        moved = small + small @ moved / term if term == _TERMS else small @ (moved / term) + small
    for _ in range(squarings):
        moved = 2.0 * moved + moved @ moved
    return moved + np.eye(matrices.shape[-1])


class Onset(NamedTuple):
    """Factor on the gain at which the loop begins to swing, and at which frequency.

    Attributes
    ----------
    gain : numpy.ndarray
        ∞ where the loop does not swing at any gain.
    frequency : numpy.ndarray
        rad/s; NaN without an onset.
    """

    gain: Floats
    frequency: Floats

    def lowest(self, other: "Onset") -> "Onset":
        """Return the smaller onset of each pair."""
        first = self.gain <= other.gain
        return Onset(
            np.where(first, self.gain, other.gain),
            np.where(first, self.frequency, other.frequency),
        )


class SampledPlant(NamedTuple):
    """Robot, contact and force filter from sample to sample, as polynomials in z − 1.

    By Faddeev and LeVerrier, (δ − Ψ)⁻¹ = Σ Nₖ δᵏ / det with δ = z − 1 and Ψ = Φ − 1; in z itself
    the polynomials would lose their digits at low frequencies, where all poles are near 1.

    Attributes
    ----------
    determinant : numpy.ndarray, shape (cells, 5)
        Coefficients of the determinant, the highest power first.
    early, late : numpy.ndarray, shape (cells, 4)
        Of the measurement, for the commands u[k−d] and u[k−d−1].
    delayed : int
        Whole samples of delay, d.
    """

    determinant: Floats
    early: Floats
    late: Floats
    delayed: int

    @classmethod
    def of(cls, loop: ControlLoop, stiffness: Floats, damping: Floats) -> Self:
        """Return the plant on contacts of these stiffnesses and dampings, shapes (cells,)."""
        continuous = _continuous(loop, stiffness, damping)
        step = 1.0 / loop.sample_rate
        delayed = math.floor(loop.known_delay / step + 1e-9)
        fraction = max(0.0, loop.known_delay - delayed * step)
        rest = matrix_exponential(continuous * (step - fraction))
        first = matrix_exponential(continuous * fraction)
        held = rest[:, :_STATES, :_STATES]
        psi = held @ first[:, :_STATES, :_STATES] - np.eye(_STATES)
        early = rest[:, :_STATES, -1]
        late = np.einsum("cij,cj->ci", held, first[:, :_STATES, -1])
        measured = 2 if loop.measures_force else 0
        numerator = np.broadcast_to(np.eye(_STATES), psi.shape)
        determinant = [np.ones(len(psi))]
        tops: list[tuple[Floats, Floats]] = []
        for k in range(1, _STATES + 1):
            row = numerator[:, measured]
            tops.append(((row * early).sum(axis=-1), (row * late).sum(axis=-1)))
            product = psi @ numerator
            determinant.append(-np.trace(product, axis1=-2, axis2=-1) / k)
            numerator = product + determinant[-1][:, None, None] * np.eye(_STATES)
        both = np.moveaxis(np.array(tops), (0, 1, 2), (2, 0, 1))
        return cls(np.stack(determinant, axis=-1), both[0], both[1], delayed)

    def cells(self, index: NDArray[np.intp]) -> "SampledPlant":
        """Return the plant of some of the cells."""
        return SampledPlant(
            self.determinant[index], self.early[index], self.late[index], self.delayed
        )

    def open_loop(self, loop: ControlLoop, frequency: Floats) -> Complex:
        """Return the open loop's response, at frequencies [rad/s], shape (cells or 1, points)."""
        angle = 1j * frequency / loop.sample_rate
        delta = np.expm1(angle)
        unit_delay = np.exp(-angle)
        early = _polynomial(self.early, delta)
        late = _polynomial(self.late, delta)
        measured = (early + late * unit_delay) / _polynomial(self.determinant, delta)
        response: Complex = loop.response(unit_delay) * measured * unit_delay**self.delayed
        return response


def _polynomial(coefficients: Floats, at: Complex) -> Complex:
    value = coefficients[:, :1] * np.ones_like(at)
    for k in range(1, coefficients.shape[1]):
        value = value * at + coefficients[:, k : k + 1]
    return value


def _continuous(loop: ControlLoop, stiffness: Floats, damping: Floats) -> Floats:
    """Return the plant in continuous time, with the held command as a fifth state.

    The rate of the filtered force is in units of the corner, so that no entry is a square of it.
    """
    plant = loop.plant
    corner = loop.force_corner
    tool = loop.tool_mass
    matrices = np.zeros((len(stiffness), _STATES + 1, _STATES + 1))
    position, velocity, force, rate, command = range(_STATES + 1)
    matrices[:, position, velocity] = 1.0
    matrices[:, velocity, position] = -(plant.stiffness + stiffness) / loop.mass
    matrices[:, velocity, velocity] = -(plant.damping + damping) / loop.mass
    matrices[:, velocity, command] = plant.input / loop.mass
    matrices[:, force, rate] = corner
    sensed = tool * matrices[:, velocity]
    sensed[:, position] += stiffness
    sensed[:, velocity] += damping
    matrices[:, rate] = corner * sensed
    matrices[:, rate, force] = -corner
    matrices[:, rate, rate] = -math.sqrt(2.0) * corner
    return matrices


def find_onset(loop: ControlLoop, stiffness: Floats, damping: Floats) -> Onset:
    """Return where the loop begins to swing on linear contacts.

    Parameters
    ----------
    loop : ControlLoop
        The loop at gain 1.
    stiffness, damping : numpy.ndarray, shape (cells,)
        ∂F/∂x [N/m] and ∂F/∂v [N·s/m].
    """
    plant = SampledPlant.of(loop, stiffness, damping)
    highest = math.pi * loop.sample_rate
    frequency = np.geomspace(_LOWEST, highest, _POINTS)
    frequency[-1] = highest * (1.0 - 1e-9)
    response = plant.open_loop(loop, frequency[None, :])
    imaginary = response.imag
    imaginary[:, -1] = 0.0  # the response is real at half the sample rate
    crosses = np.sign(imaginary[:, 1:]) != np.sign(imaginary[:, :-1])
    crosses &= response.real[:, 1:] < 0.0
    cell, place = np.nonzero(crosses)
    low = frequency[place]
    high = frequency[place + 1]
    below = np.sign(imaginary[cell, place])
    crossing = plant.cells(cell)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        same = np.sign(crossing.open_loop(loop, middle[:, None])[:, 0].imag) == below
        low = np.where(same, middle, low)
        high = np.where(same, high, middle)
    middle = 0.5 * (low + high)
    real = crossing.open_loop(loop, middle[:, None])[:, 0].real
    onset = Onset(np.full(len(stiffness), np.inf), np.full(len(stiffness), np.nan))
    for k in np.argsort(-np.where(real < 0.0, -1.0 / real, np.inf)).tolist():
        if real[k] < 0.0:  # the smallest gain of a cell comes last
            onset.gain[cell[k]] = -1.0 / real[k]
            onset.frequency[cell[k]] = middle[k]
    return onset
