"""Force curves of known truth, as arrays by Zarr: approach and retract, half of it in free air."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SEED = 13
SAMPLES = 1000
SAMPLE_TIME = 1e-3
#: Curves that are generated and stored together: 8 MB an array.
BLOCK = 1000
# Of a cell indenter, scaled to a robot's millimetres: the arithmetic has no scale.
DEPTH = 2e-3  # m
NOISE = (1e-3, 3e-2)  # of the peak force


def curves(first: int, count: int, samples: int = SAMPLES) -> tuple[NDArray[np.float64], ...]:
    """Return penetration, velocity and force of some curves, always the same."""
    random = np.random.default_rng([SEED, first])
    time = np.arange(samples) * SAMPLE_TIME
    sweep = np.sin(np.pi * time / time[-1])  # in and out
    rate = np.pi / time[-1] * np.cos(np.pi * time / time[-1])
    surface = random.uniform(-0.15, 0.15, (count, 1)) * DEPTH
    exponent = random.uniform(1.3, 2.2, (count, 1))
    stiffness = random.uniform(0.5, 2.0, (count, 1)) / DEPTH**exponent
    dissipation = random.uniform(0.05, 0.4, (count, 1)) / (DEPTH * np.pi / time[-1])
    penetration = DEPTH * (2.0 * sweep - 1.0) + np.zeros((count, 1))
    velocity = DEPTH * 2.0 * rate + np.zeros((count, 1))
    below = np.maximum(penetration - surface, 0.0)
    force = stiffness * below**exponent * (1.0 + dissipation * velocity)
    offset = random.normal(0.0, 0.01, (count, 1))
    noise = np.exp(random.uniform(np.log(NOISE[0]), np.log(NOISE[1]), (count, 1))) * force.max(
        axis=1, keepdims=True
    )
    return penetration, velocity, force + offset + noise * random.normal(size=force.shape)


def write_array(path: Path, count: int, *, velocity: bool = True, samples: int = SAMPLES) -> None:
    """Write so many curves as a Zarr group, one block a chunk."""
    import zarr

    group = zarr.open_group(str(path), mode="w")
    group.attrs["sample_time"] = SAMPLE_TIME
    shape, chunks = (count, samples), (min(BLOCK, count), samples)
    names = ["penetration", *(["velocity"] if velocity else []), "force"]
    units = {"penetration": "m", "velocity": "m/s", "force": "N"}
    arrays = {
        name: group.create_array(name, shape=shape, chunks=chunks, dtype="float64")
        for name in names
    }
    for name, array in arrays.items():
        array.attrs["units"] = units[name]
    side = int(np.ceil(np.sqrt(count)))
    place = np.arange(count)
    for name, values in (("x", place % side), ("y", place // side)):
        array = group.create_array(name, shape=(count,), dtype="float64")
        array[:] = 1e-6 * values
    for first in range(0, count, BLOCK):
        made = dict(
            zip(
                ("penetration", "velocity", "force"),
                curves(first, min(BLOCK, count - first), samples),
                strict=True,
            )
        )
        for name, array in arrays.items():
            array[first : first + BLOCK] = made[name]
