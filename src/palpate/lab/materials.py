"""The laboratory's materials: one force law, one with relaxation, or several laws."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from palpate.errors import InvalidParameterError
from palpate.force_laws import FlatSpectrum, ForceLaw, GeneralisedHuntCrossley, HuntCrossley
from palpate.validation import Floats, frozen, instance, number, number_in

#: Force [N] at a time [s], lateral position [m], penetration [m] and velocity [m/s]; call it in
#: the order of time, as a material may have memory.
Touch = Callable[[float, float, float, float], float]


def force_of_touch(
    touch: Touch,
    time: Floats,
    lateral_position: Floats,
    penetration: Floats,
    velocity: Floats,
) -> Floats:
    """Force [N] along a whole motion, one sample after the other."""
    columns = (array.tolist() for array in (time, lateral_position, penetration, velocity))
    return np.array([touch(*sample) for sample in zip(*columns, strict=True)], dtype=np.float64)


@runtime_checkable
class Material(Protocol):
    """A material of the laboratory."""

    @property
    def name(self) -> str:
        """Name of the material in tables and figures."""

    def touch(self) -> Touch:
        """Return the force function of an untouched, fully relaxed material."""

    def describe(self) -> dict[str, Any]:
        """Return the true parameters as plain numbers and text, SI."""

    def force(
        self,
        time: Floats,
        lateral_position: Floats,
        penetration: Floats,
        velocity: Floats,
    ) -> Floats:
        """Force [N] along a whole motion, shapes (k,), by :meth:`touch` sample by sample."""
        return force_of_touch(self.touch(), time, lateral_position, penetration, velocity)


@frozen
class Homogeneous:
    """A homogeneous, time-invariant material: one force law.

    Parameters
    ----------
    law : force law
        The true law, which identification should return: stiffness > 0, damping ≥ 0, exponent in
        (0, 10]. A law with memory starts fully relaxed at its first penetration.
    name : str
        Name of the material in tables and figures.
    """

    law: ForceLaw
    name: str = "material"

    def __post_init__(self) -> None:
        instance("law", self.law, ForceLaw)
        _check_real(self.law)

    def touch(self) -> Touch:
        """Return the law as a function of time, lateral position, penetration and velocity."""
        law: Any = self.law
        if law.remembers:
            force_of = law.force_in_order()
            return lambda time, _, penetration, velocity: force_of(time, penetration, velocity)
        felt = law.in_a_loop()
        return lambda time, lateral_position, penetration, velocity: felt(penetration, velocity)

    def force(
        self,
        time: Floats,
        lateral_position: Floats,
        penetration: Floats,
        velocity: Floats,
    ) -> Floats:
        """Force [N] along a whole motion, shapes (k,)."""
        if not time.size:
            return np.empty(0)
        steps = np.diff(time, prepend=time[0] - 1.0)  # fully relaxed before the first
        return self.law.force_along(penetration, velocity, steps)

    def describe(self) -> dict[str, Any]:
        """Return the law's kind and parameters, SI."""
        return self.law.description()


@frozen
class Relaxing(Material):
    """A Hunt–Crossley law and a Maxwell branch in parallel: the force relaxes when held.

    F = K xⁿ + B xⁿ v + s,   ds/dt = E v − s/τ  for x ≥ 0, else 0;  F ≥ 0

    No estimator has this law, as no two-parameter damper describes a sponge.

    Parameters
    ----------
    law : HuntCrossley
        The part without memory.
    branch_stiffness : float
        E, N/m, ≥ 0.
    relaxation_time : float
        τ, s, in (0, 1e6].
    name : str
        Name of the material in tables and figures.
    """

    law: HuntCrossley
    branch_stiffness: float
    relaxation_time: float
    name: str = "relaxing material"

    def __post_init__(self) -> None:
        instance("law", self.law, HuntCrossley)
        _check_real(self.law)
        number_in("branch_stiffness", self.branch_stiffness, 0.0, 1e12)
        number_in("relaxation_time", self.relaxation_time, 0.0, 1e6, open_low=True)

    def touch(self) -> Touch:
        """Return the force function of the fully relaxed material."""
        branch = _MaxwellBranch(self.branch_stiffness, self.relaxation_time)
        felt = self.law.in_a_loop()

        def force(
            time: float,
            lateral_position: float,
            penetration: float,
            velocity: float,
        ) -> float:
            relaxing = branch.force(time, penetration)
            return max(felt(penetration, velocity) + relaxing, 0.0)

        return force

    def describe(self) -> dict[str, Any]:
        """Return the parameters of the law and of the branch, SI."""
        return {
            "kind": "hunt-crossley with a Maxwell branch",
            **self.law.as_dict(),
            "branch_stiffness": self.branch_stiffness,
            "relaxation_time": self.relaxation_time,
        }


@frozen
class Layered(Material):
    """A soft layer over a rigid body: its stiffness rises smoothly as the probe nears the body.

    F = (K xⁿ + B xⁿ v) / (1 − e^(−α d / x))

    The factor is King's for a film on a substrate (Int. J. Solids Struct. 23, 1657–1664, 1987),
    1/E = (1 − w)/E₁ + w/E₂ with w = e^(−α d / a), for a rigid substrate, E₂ → ∞, and a sharp
    probe, whose contact radius a grows with its depth x. It is 1 at the surface, and x/(α d) deep
    inside. Damping grows with the stiffness, so B/K is the layer's.

    Parameters
    ----------
    law : HuntCrossley
        The law of a layer without end.
    depth : float
        d, the depth of the body below the surface, m, in (0, 10].
    influence : float
        α, in (0, 100], which depends on the probe: the smaller, the sooner the body is felt.
    name : str
        Name of the material in tables and figures.
    """

    law: HuntCrossley
    depth: float
    influence: float
    name: str = "layered material"

    def __post_init__(self) -> None:
        instance("law", self.law, HuntCrossley)
        _check_real(self.law)
        number_in("depth", self.depth, 0.0, 10.0, open_low=True)
        number_in("influence", self.influence, 0.0, 100.0, open_low=True)

    def touch(self) -> Touch:
        """Return the law as a function of time, lateral position, penetration and velocity."""
        felt = self.law.in_a_loop()
        reach = self.influence * self.depth

        def force(
            time: float,
            lateral_position: float,
            penetration: float,
            velocity: float,
        ) -> float:
            soft = felt(penetration, velocity)
            return soft / -math.expm1(-reach / penetration) if penetration > 0.0 else soft

        return force

    def describe(self) -> dict[str, Any]:
        """Return the parameters of the layer, and where the body lies, SI."""
        return {
            "kind": "hunt-crossley layer over a rigid body",
            **self.law.as_dict(),
            "depth": self.depth,
            "influence": self.influence,
        }


@dataclass(slots=True)
class _MaxwellBranch:
    """A spring E and a damper E τ in series; exact for a penetration linear between samples."""

    stiffness: float
    relaxation_time: float
    _force: float = 0.0
    _time: float = math.nan
    _depth: float = 0.0

    def force(self, time: float, penetration: float) -> float:
        depth = max(penetration, 0.0)
        elapsed = time - self._time
        if elapsed > 0.0:
            rest = elapsed / self.relaxation_time
            kept = math.exp(-rest)
            stretched = self.stiffness * (depth - self._depth)
            self._force = self._force * kept + stretched * (1.0 - kept) / rest
        self._time = time
        self._depth = depth
        return self._force if penetration > 0.0 else 0.0


@frozen
class SpaceVaryingMaterial(Material):
    """Materials side by side: the lateral position selects the touched one.

    Parameters
    ----------
    materials : tuple of Material, shape (m,)
        In the order of the lateral position.
    borders : tuple of float, shape (m − 1,)
        Lateral positions between them, m, increasing.
    name : str
        Name of the whole in tables and figures.
    """

    materials: tuple[Material, ...]
    borders: tuple[float, ...]
    name: str = "space-varying material"

    def __post_init__(self) -> None:
        _check_sequence("borders", self.materials, self.borders)

    def touch(self) -> Touch:
        """Return the force function of the fully relaxed materials."""
        return _select_material(self.materials, self.borders, by_time=False)

    def describe(self) -> dict[str, Any]:
        """Return the true parameters of every zone, and the borders [m]."""
        zones = [material.describe() for material in self.materials]
        return {"kind": "space-varying", "borders": list(self.borders), "zones": zones}


@frozen
class TimeVaryingMaterial(Material):
    """Materials one after the other: the time selects the touched one.

    Parameters
    ----------
    materials : tuple of Material, shape (m,)
        In the order of time.
    times : tuple of float, shape (m − 1,)
        Start times of the second and later materials, s, increasing.
    name : str
        Name of the whole in tables and figures.
    """

    materials: tuple[Material, ...]
    times: tuple[float, ...]
    name: str = "time-varying material"

    def __post_init__(self) -> None:
        _check_sequence("times", self.materials, self.times)

    def touch(self) -> Touch:
        """Return the force function of the fully relaxed materials."""
        return _select_material(self.materials, self.times, by_time=True)

    def describe(self) -> dict[str, Any]:
        """Return the true parameters of every episode, and the times [s]."""
        episodes = [material.describe() for material in self.materials]
        return {"kind": "time-varying", "times": list(self.times), "episodes": episodes}


def _select_material(
    materials: tuple[Material, ...],
    edges: tuple[float, ...],
    *,
    by_time: bool,
) -> Touch:
    touches = [material.touch() for material in materials]

    def force(time: float, lateral_position: float, penetration: float, velocity: float) -> float:
        where = time if by_time else lateral_position
        index = sum(where >= edge for edge in edges)
        return touches[index](time, lateral_position, penetration, velocity)

    return force


def _check_real(law: ForceLaw) -> None:
    """Refuse unphysical laws: negative stiffness, or damping that generates energy."""
    positive = ("n",) if law.remembers else ("K", "n")  # a fluid has K = 0
    for name, value in law.as_dict().items():
        highest = 10.0 if name in ("n", "p") else 1e30
        number_in(name, value, 0.0, highest, open_low=name in positive)


def _check_sequence(name: str, materials: tuple[Material, ...], edges: tuple[float, ...]) -> None:
    for material in materials:
        instance("materials", material, Material)
    if not materials or len(edges) != len(materials) - 1:
        raise InvalidParameterError(
            f"{name} must have length {len(materials) - 1}, one below materials, not {len(edges)}"
        )
    known = [number(name, edge) for edge in edges]
    if any(after <= before for before, after in itertools.pairwise(known)):
        raise InvalidParameterError(f"{name} must increase, not {edges!r}")


# Chosen within the orders of magnitude in the paper's text (section V): ball K ≈ B ≈ 2000, n ≈ 1;
# sponge B ≈ 10 K, n ≈ 1; phantom n ≈ 2.
BALL = Homogeneous(HuntCrossley(K=2000.0, B=2000.0, n=1.0), "rubber ball")
SPONGE = Homogeneous(HuntCrossley(K=300.0, B=3000.0, n=1.0), "sponge")
PVC = Homogeneous(HuntCrossley(K=1e5, B=2e5, n=2.0), "PVC phantom")
INCLUSION = Homogeneous(HuntCrossley(K=3e5, B=3e5, n=2.0), "PVC phantom with a hard inclusion")
# The paper's bar lies 7 mm deep; α is ours: the force at 4 mm is 1.5 times the layer's.
OVER_BAR = Layered(HuntCrossley(K=1e5, B=2e5, n=2.0), 7e-3, 0.63, "PVC phantom over a bar")
RELAXING_SPONGE = Relaxing(HuntCrossley(K=300.0, B=300.0, n=1.0), 150.0, 1.0, "relaxing sponge")
# Half of its stiffness relaxes, equally in each decade of time, as Fung found for tissue.
TISSUE = Homogeneous(
    GeneralisedHuntCrossley(
        K=8000.0,
        n=1.5,
        B=2000.0,
        p=1.5,
        M=8000.0,
        relaxation=FlatSpectrum(1e-3, 4.0),
    ),
    "tissue",
)
SOFT_AND_HARD = SpaceVaryingMaterial((PVC, INCLUSION), (0.0,), "PVC phantom with a hard zone")
SOFT_AND_BAR = SpaceVaryingMaterial((PVC, OVER_BAR), (0.0,), "PVC phantom with a bar in it")
SOFT_THEN_HARD = TimeVaryingMaterial((PVC, INCLUSION), (7.0,), "PVC phantom that hardens at 7 s")

#: The laboratory's materials by their names on the command line.
MATERIALS: Mapping[str, Material] = {
    "ball": BALL,
    "sponge": SPONGE,
    "pvc": PVC,
    "inclusion": INCLUSION,
    "tissue": TISSUE,
    "relaxing-sponge": RELAXING_SPONGE,
    "soft-and-hard": SOFT_AND_HARD,
    "soft-and-bar": SOFT_AND_BAR,
    "soft-then-hard": SOFT_THEN_HARD,
}
