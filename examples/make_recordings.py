"""Makes the small recordings in ``examples/recordings``: simulated, seeded, with known truth.

    python examples/make_recordings.py [FOLDER]

Each file is a probe on a soft material, as a 1 kHz controller would have logged it: a smooth
approach from the free, then the three sines of the paper (Haddadi & Hashtrudi-Zaad 2012). The
notes at the top of a file say which law made the force, and how coarse and noisy the sensors were.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate import HuntCrossley

Floats = NDArray[np.float64]

SAMPLE_TIME = 1e-3  # s
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Sensors:
    """What stands between the contact and the file."""

    force_noise: float = 0.05  # N, standard deviation, before rounding
    force_step: float = 0.125  # N, the paper's 1/8 N
    penetration_step: float = 20e-6  # m, an encoder of 20 000 counts a turn on a 64 mm arm
    velocity_noise: float | None = None  # m/s; None: velocity was not recorded

    def note(self) -> str:
        """Say it in words."""
        velocity = (
            "not recorded" if self.velocity_noise is None else f"noise {self.velocity_noise:g} m/s"
        )
        return (
            f"sensors: force noise {self.force_noise:g} N rms, then steps of {self.force_step:g} N;"
            f" penetration in steps of {self.penetration_step:g} m; velocity {velocity}"
        )


@dataclass(frozen=True)
class Recording:
    """One file: a material, how it is moved on, and what measures it."""

    name: str
    title: str
    law: HuntCrossley
    sensors: Sensors
    seed: int
    seconds: float = 5.0  # of one segment
    size: float = 1.0  # of the motion; 1 is 10 mm deep, peaks of 50 mm/s
    taps: int = 0  # segments that lift off again; 0: one contact that stays


def smooth_step(u: Floats) -> Floats:
    """From 0 to 1 while u goes from 0 to 1, without a jump in speed or acceleration."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def path(t: Floats, recording: Recording, segment: int) -> Floats:
    """Position of the probe [m] below the surface at the times ``t`` [s] of a segment."""
    deep = smooth_step((t - 0.1) / 0.8)  # goes down within 0.8 s
    if recording.taps:
        deep = deep * (1.0 - smooth_step((t - recording.seconds + 0.6) / 0.5))  # and up again
    since = t - 0.5 + 0.3 * segment  # each tap meets another part of the sines
    sines = np.sin(4.0 * since) + 1.8 * np.sin(11.0 * since) + 1.8 * np.sin(15.0 * since)
    return recording.size * 1e-3 * (12.0 * deep - 2.0 + sines * deep)


def measure(recording: Recording) -> list[Floats]:
    """Columns of the file: time, penetration, (velocity,) force, (segment)."""
    random = np.random.default_rng(recording.seed)
    sensors = recording.sensors
    parts = []
    for segment in range(max(recording.taps, 1)):
        t = np.arange(0.0, recording.seconds, SAMPLE_TIME)
        x = path(t, recording, segment)
        h = 1e-6
        v = (path(t + h, recording, segment) - path(t - h, recording, segment)) / (2.0 * h)
        noisy = recording.law.force(x, v) + sensors.force_noise * random.standard_normal(t.size)
        columns = [t + segment * (recording.seconds + 1.5), rounded(x, sensors.penetration_step)]
        if sensors.velocity_noise is not None:
            columns.append(v + sensors.velocity_noise * random.standard_normal(t.size))
        columns.append(rounded(noisy, sensors.force_step))
        if recording.taps:
            columns.append(np.full(t.size, segment + 1.0))
        parts.append(columns)
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def rounded(values: Floats, step: float) -> Floats:
    """To the nearest step; adding zero turns −0 into 0."""
    return step * np.round(values / step) + 0.0


def write(recording: Recording, folder: Path) -> None:
    """Write one recording as CSV, with notes above the header."""
    law, sensors = recording.law, recording.sensors
    names = ["time_s", "penetration_m", "force_N"]
    if sensors.velocity_noise is not None:
        names.insert(2, "velocity_m_s")
    if recording.taps:
        names.append("segment")
    notes = (
        f"# {recording.title}: simulated by examples/make_recordings.py, seed {recording.seed}\n"
        f"# truth: F = K x^n (1 + (B/K) v) with K = {law.stiffness:g} N/m^n, "
        f"B = {law.damping:g} N s/m^(n+1), n = {law.exponent:g}\n"
        f"# {sensors.note()}\n"
    )
    np.savetxt(
        folder / f"{recording.name}.csv",
        np.column_stack(measure(recording)),
        fmt="%.7g",
        delimiter=",",
        header=notes + ",".join(names),
        comments="",
        encoding="utf-8",
        newline="\n",
    )


RUBBER = HuntCrossley(stiffness=2000.0, damping=2000.0, exponent=1.0)
FOAM = HuntCrossley(stiffness=300.0, damping=3000.0, exponent=1.0)
PVC = HuntCrossley(stiffness=1e5, damping=2e5, exponent=2.0)
GEL = HuntCrossley(stiffness=40.0, damping=4e5, exponent=1.5)

# Nanonewtons and micrometres, as an atomic force microscope has them.
FINE = Sensors(force_noise=1e-10, force_step=2e-11, penetration_step=1e-9)
TACHOMETER = Sensors(velocity_noise=2e-4)

RECORDINGS = (
    Recording("ball", "rubber ball", RUBBER, Sensors(), seed=1),
    Recording("sponge", "sponge", FOAM, Sensors(), seed=2),
    Recording("phantom", "PVC phantom", PVC, TACHOMETER, seed=3),
    Recording("tapping", "PVC phantom, tapped", PVC, Sensors(), seed=4, seconds=1.6, taps=4),
    Recording("microscale", "gel under a bead", GEL, FINE, seed=5, size=1e-4),
)


def main() -> None:
    """Write them all."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    for recording in RECORDINGS:
        write(recording, folder)


if __name__ == "__main__":
    main()
