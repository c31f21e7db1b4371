"""The same regression by other packages: y = ln F, φ = [1, v, ln x], without forgetting.

Each starts at θ = 0 with P = 1e3 I, takes every sample (penetration, velocity, force) as it comes,
converts it for its package, and returns the last θ.
"""

import warnings
from collections.abc import Callable
from math import log

import numpy as np

from benchmarks.motion import Floats, Samples
from palpate import ConstantForgetting, HuntCrossley, LeastSquares, SingleStageRLS

Peer = Callable[[Samples], Floats]

START = 1e3  # P₀


def palpate_single_stage(samples: Samples) -> Floats:
    """Run our estimator, with its gate and its checks; the law ln K = B/K = n = 0 is θ = 0."""
    estimator = SingleStageRLS(
        initial=HuntCrossley(stiffness=1.0, damping=0.0, exponent=0.0),
        initial_covariance=START,
        forgetting=ConstantForgetting(1.0),
    )
    update = estimator.update
    for penetration, velocity, force in samples:
        update(penetration, velocity, force)
    law = estimator.estimate().law
    assert isinstance(law, HuntCrossley)
    return np.array([log(law.stiffness), law.dissipation, law.exponent])


def palpate_least_squares(samples: Samples) -> Floats:
    """Run our plain engine, with rows created in Python."""
    engine = LeastSquares(3, initial_covariance=START)
    update = engine.update
    for penetration, velocity, force in samples:
        update((1.0, velocity, log(penetration)), log(force))
    return engine.parameters


def plain_numpy(samples: Samples) -> Floats:
    """Eq. 13 in NumPy, with its faster functions: dot() for @, += for +."""
    theta, p, row = np.zeros(3), START * np.eye(3), np.ones(3)
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        g = p.dot(row)
        gain = g / (1.0 + row.dot(g))
        theta += gain * (log(force) - row.dot(theta))
        p -= gain[:, None] * g
    return theta


def numpy_without_temporaries(samples: Samples) -> Floats:
    """The same with every array allocated in advance, our fastest version."""
    theta, p, row = np.zeros(3), START * np.eye(3), np.ones(3)
    g, gain, move, fall = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    column = gain[:, None]
    add, subtract, multiply, divide = np.add, np.subtract, np.multiply, np.divide
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        p.dot(row, g)
        divide(g, 1.0 + row.dot(g), gain)
        multiply(gain, log(force) - row.dot(theta), move)
        add(theta, move, theta)
        multiply(column, g, fall)
        subtract(p, fall, p)
    return theta


def padasip_rls(samples: Samples) -> Floats:
    """FilterRLS: P₀ = I/eps, and zero weights instead of random ones, its default."""
    from padasip.filters import FilterRLS

    rls = FilterRLS(3, mu=1.0, eps=1.0 / START, w="zeros")
    adapt, row = rls.adapt, np.ones(3)
    for penetration, velocity, force in samples:
        row[1], row[2] = velocity, log(penetration)
        adapt(log(force), row)
    return np.asarray(rls.w)


def filterpy_kalman(samples: Samples) -> Floats:
    """KalmanFilter as RLS: F = I and Q = 0, so predict() is not called; R = 1."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=3, dim_z=1)
    kalman.P = START * np.eye(3)
    kalman.R = np.eye(1)
    update, row, output = kalman.update, np.ones((1, 3)), np.ones((1, 1))
    for penetration, velocity, force in samples:
        row[0, 1], row[0, 2] = velocity, log(penetration)
        output[0, 0] = log(force)
        update(output, H=row)
    return np.asarray(kalman.x[:, 0])


def statsmodels_whole(samples: Samples) -> Floats:
    """RecursiveLS.filter() over the whole record: it cannot add one sample."""
    from statsmodels.regression.recursive_ls import RecursiveLS

    x, v, force = np.array(samples).T
    rows = np.column_stack([np.ones_like(v), v, np.log(x)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = RecursiveLS(
            np.log(force), rows, initialization="approximate_diffuse", initial_variance=START
        )
        return np.asarray(model.filter().params)


SINGLE_STAGE, ENGINE = "palpate SingleStageRLS", "palpate LeastSquares"
OURS: dict[str, Peer] = {SINGLE_STAGE: palpate_single_stage, ENGINE: palpate_least_squares}
ONLINE: dict[str, Peer] = {
    "plain NumPy": plain_numpy,
    "padasip FilterRLS": padasip_rls,
    "filterpy KalmanFilter": filterpy_kalman,
}
BESIDES: dict[str, Peer] = {
    "NumPy without temporaries": numpy_without_temporaries,
    "statsmodels RecursiveLS, whole record": statsmodels_whole,
}
NOTES = (
    "Ratios: the other package's time over palpate's. θ starts at 0 and P at 1e3 I for all: "
    "padasip with w='zeros' and eps=1e-3; filterpy with F = I, Q = 0, R = 1 and no predict(); "
    "statsmodels with initialization='approximate_diffuse' and initial_variance=1e3 (its default "
    "is exactly diffuse).",
    "statsmodels is not online: append() and extend() are not implemented for RecursiveLS, so "
    "each new sample needs the whole record again.",
)
