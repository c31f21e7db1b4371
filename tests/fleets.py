"""Recordings, arrays and rows that the tests of fleets are about."""

import numpy as np

from palpate import Contact, HuntCrossley, write_contact
from palpate.fleet.rows import table_of_rows
from palpate.fleet.tasks import Settings

LAW = HuntCrossley(K=4000.0, B=60.0, n=1.3)
STEP = 1e-3


def curves(count, *, law=LAW, noise=0.01, seed=5, samples=600):
    """Penetration, velocity and force of so many touches, half of each in free air."""
    random = np.random.default_rng(seed)
    time = STEP * np.arange(samples)
    rate = 2.0 * np.pi * 2.0
    depth = np.tile(6e-3 * np.sin(rate * time) - 1e-3, (count, 1))
    velocity = np.tile(6e-3 * rate * np.cos(rate * time), (count, 1))
    force = law.force(depth, velocity) + random.normal(0.0, noise, depth.shape)
    return depth, velocity, force


def contact(**options):
    x, v, f = (rows[0] for rows in curves(1, **options))
    time = STEP * np.arange(x.size)
    return Contact(time, penetration=x, velocity=v, force=f, source="touch")


def write_recordings(folder, count, seed=7):
    folder.mkdir(exist_ok=True)
    for k in range(count):
        write_contact(contact(seed=seed + k), folder / f"touch-{k:03d}.csv")


def write_zarr(path, count, **options):
    import zarr

    x, v, f = curves(count, **options)
    group = zarr.open_group(str(path), mode="w")
    group.attrs["sample_time"] = STEP
    for name, values in (("penetration", x), ("velocity", v), ("force", f)):
        group.create_array(name, data=values, chunks=(4, values.shape[1]))
    return x, v, f


def rows(values, errors, *, quantity="stiffness", **others):
    """A table of results with these numbers at working depth."""
    made = [
        {
            "source": f"touch-{k:03d}.csv",
            quantity: float(value),
            f"{quantity}_standard_error": float(error),
            "depth": 3e-3,
            **{name: each[k] for name, each in others.items()},
        }
        for k, (value, error) in enumerate(zip(values, errors, strict=True))
    ]
    return table_of_rows(made, Settings())
