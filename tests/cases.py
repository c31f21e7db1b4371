"""What the tests share: the laboratory's materials under its motions, and all estimators."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import palpate
from palpate import lab
from palpate.lab.design import Motion

Floats = NDArray[np.float64]

# The recursive least squares; variable projection has its own tests.
KINDS = {
    name: kind
    for name, kind in palpate.ESTIMATORS.items()
    if issubclass(kind, palpate.RecursiveLeastSquaresEstimator)
}

# The laboratory's truths, and one of each other law with forces of the same order.
MATERIALS = {
    **{name: lab.MATERIALS[name].law for name in ("ball", "sponge", "pvc")},
    "linear": palpate.KelvinVoigt(K=1500.0, B=8.0),
    "quadratic": palpate.ExtendedKelvinVoigt(K1=500.0, K2=4e4, B=5.0),
}
THREE_SINES = lab.THREE_SINES.motion
ONE_SINE = lab.ONE_SINE.motion

# For each method a material that its own law describes exactly.
OWN_MATERIAL = {
    "single-stage": MATERIALS["pvc"],
    "double-stage": MATERIALS["pvc"],
    "kelvin-voigt": MATERIALS["linear"],
    "extended-kelvin-voigt": MATERIALS["quadratic"],
}


@dataclass(frozen=True)
class Signals:
    """Penetration [m], velocity [m/s] and force [N] on one clock [s]."""

    time: Floats
    penetration: Floats
    velocity: Floats
    force: Floats

    def __len__(self) -> int:
        return self.time.size

    def __getitem__(self, window: slice) -> "Signals":
        return Signals(
            self.time[window], self.penetration[window], self.velocity[window], self.force[window]
        )

    @property
    def rows(self) -> list[tuple[float, float, float]]:
        """What ``update`` takes, a sample each."""
        return list(
            zip(self.penetration.tolist(), self.velocity.tolist(), self.force.tolist(), strict=True)
        )

    @property
    def arrays(self) -> tuple[Floats, Floats, Floats]:
        """What ``replay`` takes."""
        return self.penetration, self.velocity, self.force


Law = palpate.KelvinVoigt | palpate.ExtendedKelvinVoigt | palpate.HuntCrossley


def exciting(
    law: Law,
    *,
    seconds: float = 1.0,
    time: Floats | None = None,
    noise: float = 0.0,
    seed: int = 0,
    motion: Motion = THREE_SINES,
) -> Signals:
    """A material under the paper's three sines, at 1 kHz unless the times are given.

    ``noise`` is the standard deviation of white noise on the force, N.
    """
    if time is None:
        time = np.arange(round(seconds * 1e3)) * 1e-3
    penetration, velocity = motion.at(time)
    force = law.force(penetration, velocity)
    force = force + noise * np.random.default_rng(seed).standard_normal(time.size)
    return Signals(time, penetration, velocity, force)


def tapping(law: Law, *, seconds: float = 2.0, noise: float = 0.0, seed: int = 0) -> Signals:
    """The three sines about a depth so small that contact is lost and made again."""
    shallow = replace(THREE_SINES, depth=1.5e-3)
    return exciting(law, seconds=seconds, noise=noise, seed=seed, motion=shallow)


def contact_of(signals: Signals, **more) -> palpate.Contact:
    return palpate.Contact(**vars(signals), **more)


def knowledge(estimator) -> tuple:
    """Everything an estimator says that it knows, to be compared bit for bit."""
    estimate = estimator.estimate()
    return (
        estimate.parameters.tobytes(),
        estimate.covariance.tobytes(),
        estimate.standard_errors.tobytes(),
        float(estimate.validity_margin).hex(),
        estimate.status,
        estimate.samples,
        estimate.guarded,
    )


def bits(trace: palpate.Trace) -> tuple[bytes, ...]:
    """A trace, to be compared bit for bit."""
    columns = (getattr(trace, name) for name in trace.__dataclass_fields__)
    return tuple(None if column is None else column.tobytes() for column in columns)
