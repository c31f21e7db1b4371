"""The laboratory: materials, motions, a robot and sensors, all with known truth.

bench = lab.Bench(lab.BALL, lab.THREE_SINES)
measurement = bench.run(seed=0)
palpate.identify(measurement.contact)
"""

from palpate.lab.bench import Bench, Measurement
from palpate.lab.materials import (
    BALL,
    INCLUSION,
    MATERIALS,
    PVC,
    RELAXING_SPONGE,
    SOFT_AND_HARD,
    SOFT_THEN_HARD,
    SPONGE,
    Episodes,
    Homogeneous,
    Material,
    Relaxing,
    Touch,
    Zones,
)
from palpate.lab.probes import Course, IdealProbe, Probe
from palpate.lab.robot import TwinPantograph
from palpate.lab.sensors import PERFECT, Sensors
from palpate.lab.trajectories import (
    NEAR_SURFACE,
    ONE_SINE,
    PALPATION,
    TAPPING,
    THREE_SINES,
    TRAJECTORIES,
    TWO_SINES,
    Command,
    Followed,
    Palpation,
    Probing,
    Tapping,
    Trajectory,
)

__all__ = [
    "BALL",
    "INCLUSION",
    "MATERIALS",
    "NEAR_SURFACE",
    "ONE_SINE",
    "PALPATION",
    "PERFECT",
    "PVC",
    "RELAXING_SPONGE",
    "SOFT_AND_HARD",
    "SOFT_THEN_HARD",
    "SPONGE",
    "TAPPING",
    "THREE_SINES",
    "TRAJECTORIES",
    "TWO_SINES",
    "Bench",
    "Command",
    "Course",
    "Episodes",
    "Followed",
    "Homogeneous",
    "IdealProbe",
    "Material",
    "Measurement",
    "Palpation",
    "Probe",
    "Probing",
    "Relaxing",
    "Sensors",
    "Tapping",
    "Touch",
    "Trajectory",
    "TwinPantograph",
    "Zones",
]
