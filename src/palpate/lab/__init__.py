"""The simulated laboratory: materials, motions, a robot and sensors, with known parameters.

bench = lab.Bench(lab.BALL, lab.THREE_SINES)
measurement = bench.run(seed=0)
palpate.identify(measurement.contact)
"""

from palpate.lab.bench import Bench as Bench
from palpate.lab.bench import Measurement as Measurement
from palpate.lab.bench import OngoingBench as OngoingBench
from palpate.lab.materials import BALL as BALL
from palpate.lab.materials import INCLUSION as INCLUSION
from palpate.lab.materials import MATERIALS as MATERIALS
from palpate.lab.materials import OVER_BAR as OVER_BAR
from palpate.lab.materials import PVC as PVC
from palpate.lab.materials import RELAXING_SPONGE as RELAXING_SPONGE
from palpate.lab.materials import SOFT_AND_BAR as SOFT_AND_BAR
from palpate.lab.materials import SOFT_AND_HARD as SOFT_AND_HARD
from palpate.lab.materials import SOFT_THEN_HARD as SOFT_THEN_HARD
from palpate.lab.materials import SPONGE as SPONGE
from palpate.lab.materials import TISSUE as TISSUE
from palpate.lab.materials import Homogeneous as Homogeneous
from palpate.lab.materials import Layered as Layered
from palpate.lab.materials import Material as Material
from palpate.lab.materials import Relaxing as Relaxing
from palpate.lab.materials import SpaceVaryingMaterial as SpaceVaryingMaterial
from palpate.lab.materials import TimeVaryingMaterial as TimeVaryingMaterial
from palpate.lab.materials import Touch as Touch
from palpate.lab.rig import PERFECT as PERFECT
from palpate.lab.rig import IdealProbe as IdealProbe
from palpate.lab.rig import Probe as Probe
from palpate.lab.rig import Sensors as Sensors
from palpate.lab.rig import SimulatedMotion as SimulatedMotion
from palpate.lab.rig import TwinPantograph as TwinPantograph
from palpate.lab.trajectories import NEAR_SURFACE as NEAR_SURFACE
from palpate.lab.trajectories import ONE_SINE as ONE_SINE
from palpate.lab.trajectories import PALPATION as PALPATION
from palpate.lab.trajectories import TAPPING as TAPPING
from palpate.lab.trajectories import THREE_SINES as THREE_SINES
from palpate.lab.trajectories import TRAJECTORIES as TRAJECTORIES
from palpate.lab.trajectories import TWO_SINES as TWO_SINES
from palpate.lab.trajectories import Command as Command
from palpate.lab.trajectories import Palpation as Palpation
from palpate.lab.trajectories import Probing as Probing
from palpate.lab.trajectories import SplineTrajectory as SplineTrajectory
from palpate.lab.trajectories import Tapping as Tapping
from palpate.lab.trajectories import Trajectory as Trajectory
