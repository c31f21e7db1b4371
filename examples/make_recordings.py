"""Write the small recordings in ``examples/recordings``: from the laboratory, with known truth.

    python examples/make_recordings.py [FOLDER]

Each file is a probe on a soft material, as a 1 kHz controller would log it: a pause for measuring
the force sensor's bias, a smooth approach, then a motion. The notes above the header hold the law
that generated the force, and the sensors' resolution and noise. Needs the extra ``lab``.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np

from palpate import Contact, HuntCrossley, prepare, write_contact
from palpate.lab import (
    BALL,
    PVC,
    SPONGE,
    THREE_SINES,
    Bench,
    Homogeneous,
    IdealProbe,
    Probing,
    Sensors,
    Tapping,
)
from palpate.lab.design import PAPER_MOTION, Motion

HERE = Path(__file__).parent
GEL = Homogeneous(HuntCrossley(K=40.0, B=4e5, n=1.5), "gel under a bead")


def robot_on(material: Homogeneous, seed: int) -> Contact:
    """The twin pantograph on a material, under the paper's three sines."""
    return Bench(material, THREE_SINES).run(seed, seconds=7.0).contact


def with_tachometer(seed: int) -> Contact:
    """A phantom under a probe whose velocity is measured too, with 0.2 mm/s of noise."""
    run = Bench(PVC, THREE_SINES).run(seed, seconds=7.0)
    noise = 2e-4 * np.random.default_rng(seed).standard_normal(len(run.truth))
    velocity = run.truth.velocity + noise
    seen = run.contact
    measured = {"velocity": "measured by a tachometer, noise 0.0002 m/s rms"}
    provenance = {**seen.provenance, **measured}
    return dataclasses.replace(seen, velocity=velocity, provenance=provenance)


def in_segments(seed: int) -> Contact:
    """Four contacts with a phantom, each a separate recording."""
    sensors = Sensors(penetration_resolution=20e-6)
    parts = []
    for k, depth in enumerate((12e-3, 8e-3, 10e-3, 6e-3)):
        touch = Tapping((depth,), rate=0.9, pause=0.4)
        parts.append(Bench(PVC, touch, IdealProbe(), sensors).run(seed + k, seconds=1.5).contact)
    return prepare(
        time=np.concatenate([part.time + 3.0 * k for k, part in enumerate(parts)]),
        penetration=np.concatenate([part.penetration for part in parts]),
        force=np.concatenate([part.force for part in parts]),
        segment=np.repeat(np.arange(1, 5), [len(part) for part in parts]),
        provenance=parts[0].provenance,
    )


def under_a_bead(seed: int) -> Contact:
    """A contact at the scale of an atomic force microscope: nanonewtons and micrometres."""
    motion = Motion(
        1e-4 * PAPER_MOTION.depth,
        tuple(1e-4 * a for a in PAPER_MOTION.amplitudes),
        PAPER_MOTION.frequencies,
    )
    fine = Sensors(1e-10, 2e-11, force_bias=0.0, penetration_resolution=1e-9)
    trajectory = Probing(motion, clearance=2e-7, pause=0.5)
    return Bench(GEL, trajectory, IdealProbe(), fine).run(seed, seconds=5.0).contact


def main() -> None:
    """Write them all."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    maker = {"made by": "examples/make_recordings.py"}
    write_contact(robot_on(BALL, seed=1), folder / "ball.csv", maker)
    write_contact(robot_on(SPONGE, seed=2), folder / "sponge.csv", maker)
    write_contact(with_tachometer(seed=3), folder / "phantom.csv", maker, velocity=True)
    write_contact(in_segments(seed=4), folder / "tapping.csv", maker)
    write_contact(under_a_bead(seed=5), folder / "microscale.csv", maker)


if __name__ == "__main__":
    main()
