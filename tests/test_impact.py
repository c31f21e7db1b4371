"""The rebound of a free body: the exact relation against the motion itself, and what others say."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from palpate import InvalidParameterError, dissipation_for, restitution
from palpate.quantities.restitution import approximations_of, restitution_slope

# d = b v₀ over all that is solved, and the borders between the ways in which it is.
PRODUCTS = [*10.0 ** np.arange(-18.0, 12.5, 0.5), 0.65, 0.67, 9.9e-6, 1.1e-5]
ENERGY_MADE = [-1e-7, -1e-3, -0.3, -0.39, -0.41, -0.9, -0.999, -1.0 + 1e-9]


def to_fifty_digits(d: float) -> Decimal:
    """Solve t − 1 + exp(−t) = d − ln(1 + d), t = −ln(1 − d e), by Newton's method in decimals."""
    with localcontext() as context:
        context.prec = 50
        exact = Decimal(d)
        wanted = exact - (1 + exact).ln()
        root = (2 * wanted).sqrt()
        t = min(wanted + 1, wanted + root) if d > 0.0 else -root
        for _ in range(60):
            t -= (t - 1 + (-t).exp() - wanted) / (1 - (-t).exp())
        return (1 - (-t).exp()) / exact


@pytest.mark.parametrize("d", [*PRODUCTS, *ENERGY_MADE])
def test_the_exact_relation_is_solved_to_rounding(d):
    exact = float(to_fifty_digits(d))
    # Seen: 3e-16; two roundings more for another machine's exponential. Below −1 + 1e-3 the d
    # itself holds no more: e depends on ln(1 + d).
    assert restitution(d, 1.0) == pytest.approx(exact, rel=1e-15 if d > -0.99 else 1e-9)


@pytest.mark.parametrize(
    "stiffness, exponent, mass", [(1e5, 1.0, 0.2), (1e6, 1.5, 1.0), (4e8, 2.0, 30.0)]
)
@pytest.mark.parametrize("d", [0.03, 0.5, 3.0, 30.0])
def test_a_body_that_falls_on_the_law_rebounds_by_it_whatever_its_mass(
    stiffness, exponent, mass, d
):
    """Against the equation of motion, integrated step by step."""
    speed, b = 0.7, d / 0.7

    def motion(_, state):
        depth, velocity = state
        force = stiffness * max(depth, 0.0) ** exponent * (1.0 + b * velocity)
        return velocity, -force / mass

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, -1.0
    # In units of the undamped depth and its time, so that one tolerance suits all.
    deepest = (0.5 * (exponent + 1.0) * mass * speed**2 / stiffness) ** (1.0 / (exponent + 1.0))
    span = (0.0, 1e3 * (1.0 + d) * deepest / speed)
    start = (0.0, speed)
    near = {"rtol": 1e-11, "atol": 1e-13 * deepest}
    found = solve_ivp(motion, span, start, method="DOP853", events=leaves, **near)
    [left] = found.y_events[0][-1:]
    # The integration's own tolerance, 1e-11 a step over some hundred steps.
    assert -left[1] / speed == pytest.approx(restitution(b, speed), rel=1e-8)


@pytest.mark.parametrize("d", [1e-6, 0.9e-4, 1.1e-4, 0.1, 2.0, 40.0, -0.3, -0.8])
def test_the_slope_is_that_of_the_relation(d):
    step = 1e-7 * abs(d)
    apart = to_fifty_digits(d + step) - to_fifty_digits(d - step)
    slope = float(apart / (Decimal(d + step) - Decimal(d - step)))
    # The difference's own error is 1e-14 d²; where the series ends, 1e-4, 1e-11 is left off.
    assert restitution_slope(np.array([d]))[0] == pytest.approx(slope, rel=1e-10)


def test_the_inverse_gives_the_dissipation_back():
    e = np.concatenate([10.0 ** np.arange(-12.0, 0.0, 0.25), 1.0 - 10.0 ** np.arange(-15.0, -0.2)])
    b = dissipation_for(e, 0.3)
    np.testing.assert_allclose(restitution(b, 0.3), e, rtol=1e-15)  # seen: 2e-16
    assert dissipation_for(1.0, 0.3) == 0.0
    assert isinstance(dissipation_for(0.5, 0.3), float)
    # Shapes go together as in NumPy.
    e = restitution([0.1, 1.0, 10.0], [[0.2], [2.0]])
    assert e.shape == (2, 3)
    assert e[1, 2] == restitution(10.0, 2.0)
    assert isinstance(restitution(1, 2), float)


def test_the_rebound_is_slower_than_one_over_the_dissipation_unless_the_law_makes_energy():
    speeds = 10.0 ** np.linspace(-3.0, 9.0, 40)
    back = speeds * restitution(2.0, speeds)
    assert np.all(np.diff(back) >= -1e-15)  # a few roundings
    assert np.all(back <= 0.5 + 1e-15)
    assert restitution(1e300, 1e300) >= 0.0
    assert restitution(0.0, 1.0) == 1.0
    assert restitution(-0.5, 1.0) > 1.0
    # Run backwards the motion is that of the damper of the same size: e(−d e(d)) = 1/e(d).
    e = restitution(0.5, 1.0)
    assert restitution(-0.5 * e, 1.0) == pytest.approx(1.0 / e, rel=1e-15)
    # A law that draws in does not throw back.
    assert math.isnan(restitution(-1.0, 1.0))
    assert math.isnan(restitution(-7.0, 1.0))


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: restitution([1.0, math.nan], 1.0), "dissipation must be finite, not nan; value 1"),
        (lambda: restitution(1.0, -2.0), "speed must be at least 0 and finite, not -2"),
        (lambda: restitution([1.0, 2.0], [1.0, 2.0, 3.0]), "shapes that go together"),
        (lambda: dissipation_for(1.01, 1.0), r"restitution must be in \[1e-12, 1\], not 1.01"),
        (lambda: dissipation_for(0.5, 0.0), "speed must be above 0"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(call, words):
    with pytest.raises(InvalidParameterError, match=words):
        call()


# d by e, written out once more from the publications; within 0.01 of the exact e above the next
# number; and within the last wherever they give one.
PUBLISHED = {
    "Hunt–Crossley": (lambda e: 1.5 * (1.0 - e), 0.905, 0.49),
    "Lankarani–Nikravesh": (lambda e: 0.75 * (1.0 - e**2), 0.924, 0.66),
    "Gonthier": (lambda e: (1.0 - e**2) / e, 0.957, 0.033),
    "Flores": (lambda e: 1.6 * (1.0 - e) / e, 0.818, 0.046),
    "Carvalho–Martins": (lambda e: 1.5 * (1 - e) * (11 - e) / (1 + 9 * e), 0.225, 0.11),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_an_approximation_is_the_inverse_of_what_was_published_and_as_near_as_said(name):
    published, near, worst = PUBLISHED[name]
    for e in (0.01, 0.3, 0.7, 0.99, 1.0):
        assert approximations_of(published(e), 1.0)[name] == pytest.approx(e, rel=1e-12)
    d = 10.0 ** np.linspace(-3.0, 2.0, 2001)
    exact = restitution(d, 1.0)
    off = np.abs(np.array([approximations_of(each, 1.0)[name] for each in d]) - exact)
    assert np.all(off[exact > near] <= 0.01)
    assert np.nanmax(off) <= worst
    assert math.isnan(approximations_of(-0.1, 1.0)[name])
