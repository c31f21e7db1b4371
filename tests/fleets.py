"""Recordings, arrays and rows that the tests of fleets are about."""

import numpy as np

from palpate import Contact, HuntCrossley, write_contact
from palpate.fleet.columns import table_of_rows
from palpate.fleet.settings import Settings

LAW = HuntCrossley(4000.0, 60.0, 1.3)
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
    """One of them."""
    x, v, f = (rows[0] for rows in curves(1, **options))
    time = STEP * np.arange(x.size)
    return Contact(time, penetration=x, velocity=v, force=f, source="touch")


def write_recordings(folder, count, seed=7):
    """Write so many recordings of touches as text."""
    folder.mkdir(exist_ok=True)
    for k in range(count):
        write_contact(contact(seed=seed + k), folder / f"touch-{k:03d}.csv")


def write_zarr(path, count, **options):
    """Write so many touches as arrays."""
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
            f"{quantity}_at_depth": float(value),
            f"{quantity}_at_depth_standard_error": float(error),
            "depth": 3e-3,
            **{name: each[k] for name, each in others.items()},
        }
        for k, (value, error) in enumerate(zip(values, errors, strict=True))
    ]
    return table_of_rows(made, Settings())


def mixed_touches(samples=400, seed=11):
    """Touches of equal length, good and bad, as penetration, velocity and force; and their names.

    Motions all leave stiffness, damping and exponent determined: a probe that is held still leaves
    a direction to the last bits, which any two ways of adding up differ in.
    """
    random = np.random.default_rng(seed)
    rate, time = 4.0 * np.pi, STEP * np.arange(samples)
    deep = 6e-3 * np.sin(rate * time) - 1e-3, 6e-3 * rate * np.cos(rate * time)
    inside = (
        4e-3 + 1e-3 * np.sin(rate * time) + 5e-4 * np.sin(5.3 * rate * time),
        1e-3 * rate * np.cos(rate * time) + 2.65e-3 * rate * np.cos(5.3 * rate * time),
    )
    made = {}

    def touch(name, motion=inside, law=LAW, noise=0.01):
        force = law.force(*motion) + random.normal(0.0, noise, samples)
        made[name] = [motion[0].copy(), motion[1].copy(), force]
        return made[name]

    for k in range(17):
        law = HuntCrossley(*(np.array([4000.0, 100.0, 1.2]) * random.uniform(0.6, 1.6, 3)))
        touch(f"good {k}", inside if k % 2 else deep, law)
    touch("never touches", (deep[0] - 1.0, deep[1]))
    touch("a hole", deep)[2][150:160] = np.nan
    touch("ends early", deep)[0][350:] = np.nan
    touch("few samples")[2][25:] = np.nan
    touch("too short")[2][3:] = np.nan
    touch("nothing")[0][:] = np.nan
    touch("infinite")[2][100] = np.inf
    touch("absurd")[2][100] = 1e200
    touch("no velocity")[1][100] = np.nan
    touch("spiked")[2][200] *= 3.0
    touch("lost")[0][200] += 0.02
    ends = touch("out of range")[2]
    np.minimum(ends, 0.9 * ends.max(), out=ends)
    rounded = touch("rounded")[2]
    rounded[:] = np.round(rounded, 1)
    touch("negative damping", inside, HuntCrossley(4000.0, -60.0, 1.3))
    touch("wrong sign of the velocity", (inside[0], -inside[1]))
    touch("light", tuple(0.05 * each for each in deep), noise=3e-3)
    touch("nothing but noise", noise=100.0)
    touch("brief")[0][100:] = -1e-3
    return *(np.array(channel) for channel in zip(*made.values(), strict=True)), list(made)
