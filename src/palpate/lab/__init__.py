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
    TISSUE,
    Homogeneous,
    Material,
    Relaxing,
    SpaceVaryingMaterial,
    TimeVaryingMaterial,
    Touch,
)
from palpate.lab.ongoing import OngoingBench
from palpate.lab.probes import IdealProbe, Probe, SimulatedMotion
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
    Palpation,
    Probing,
    SplineTrajectory,
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
    "TISSUE",
    "TRAJECTORIES",
    "TWO_SINES",
    "Bench",
    "Command",
    "Homogeneous",
    "IdealProbe",
    "Material",
    "Measurement",
    "OngoingBench",
    "Palpation",
    "Probe",
    "Probing",
    "Relaxing",
    "Sensors",
    "SimulatedMotion",
    "SpaceVaryingMaterial",
    "SplineTrajectory",
    "Tapping",
    "TimeVaryingMaterial",
    "Touch",
    "Trajectory",
    "TwinPantograph",
]
