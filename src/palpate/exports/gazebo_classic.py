"""Gazebo Classic with ODE: <kp> and <kd>, which are Kelvin–Voigt. Text, not replayed here.

ODE is given soft_erp = h kp/(h kp + kd) and soft_cfm = 1/(h kp + kd) of the time step h, by which

    F = kp x + kd ẋ   at the end of the step,

implicit and stable at any step. Of both bodies the stiffnesses are in series and the dampings add
up; unless set kp is 10¹² N/m, but kd is 1 N·s/m and max_vel, beyond which the spring is cut off,
0.01 m/s. So the other body gets kd = 0 here, and this one a max_vel that never cuts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from palpate.errors import ExportRefusedError
from palpate.exports.asked import Asked
from palpate.exports.engine import Engine, Fragment
from palpate.exports.errors import Drop
from palpate.exports.implicit import rebound_by_steps
from palpate.exports.kelvin_voigt import is_kelvin_voigt
from palpate.exports.nearest import kelvin_voigt
from palpate.exports.text import digits, xml_comment
from palpate.force_laws import GeneralisedHuntCrossley

#: Why modern Gazebo is given nothing (gz-physics issues 82 and 636, gz-sim issue 1961).
DART = (
    "Gazebo with DART reads friction and restitution of a surface, and ignores <kp> and <kd>: "
    "nothing of the law would arrive, and nothing would say so. gazebo-classic is Gazebo 11 with "
    "ODE; of engines that have a compliant contact, mujoco and drake can be replayed"
)

SURFACE = """\
<?xml version="1.0"?>
{comment}
<!-- Into the <collision> of what is pressed. -->
<surface>
  <contact>
    <ode>
      <kp>{stiffness}</kp>
      <kd>{damping}</kd>
      <max_vel>{max_vel}</max_vel>
      <min_depth>0</min_depth>
    </ode>
  </contact>
</surface>
"""

URDF = """\
<?xml version="1.0"?>
{comment}
<!-- Into a <robot>; the name is that of the link that is pressed. -->
<gazebo reference="pressed">
  <kp>{stiffness}</kp>
  <kd>{damping}</kd>
  <maxVel>{max_vel}</maxVel>
  <minDepth>0</minDepth>
</gazebo>
"""

WORLD = """\
<?xml version="1.0"?>
{comment}
<sdf version="1.6">
  <world name="contact">
    <gravity>0 0 0</gravity>
    <physics type="ode">
      <max_step_size>{time_step}</max_step_size>
      <real_time_update_rate>0</real_time_update_rate>
    </physics>
    <model name="pressed">
      <static>true</static>
      <link name="link">
        <collision name="collision">
          <geometry><plane><normal>0 0 1</normal></plane></geometry>
          <surface>
            <contact>
              <ode>
                <kp>{stiffness}</kp>
                <kd>{damping}</kd>
                <max_vel>{max_vel}</max_vel>
                <min_depth>0</min_depth>
              </ode>
            </contact>
          </surface>
        </collision>
      </link>
    </model>
    <model name="probe">
      <pose>0 0 {radius} 0 0 0</pose>
      <link name="tip">
        <inertial><mass>{mass}</mass></inertial>
        <collision name="collision">
          <geometry><sphere><radius>{radius}</radius></sphere></geometry>
          <surface>
            <contact>
              <ode>
                <kp>1e12</kp>
                <kd>0</kd>
                <max_vel>{max_vel}</max_vel>
                <min_depth>0</min_depth>
              </ode>
            </contact>
          </surface>
        </collision>
      </link>
    </model>
  </world>
</sdf>
"""

_OTHER_BODY = (
    "the damping of both bodies adds up, and is 1 N·s/m unless set: write <kd>0</kd> to the other"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Surface(Fragment):
    """The surface of one collision, of two numbers."""

    law: GeneralisedHuntCrossley
    max_vel: float

    def predicted_rebound(self, drop: Drop) -> float:
        """Restitution by implicit steps, which damp by K h beside the law."""

        def force(penetration: float, velocity: float) -> float:
            return max(self.law.force(penetration, velocity), 0.0)

        return rebound_by_steps(force, drop, self.asked.time_step)

    def files(self, notes: Sequence[str]) -> Mapping[str, str]:
        asked = self.asked
        radius = asked.tip_radius or max(0.01, 2.0 * asked.motion.deepest)
        values = {
            "comment": xml_comment(notes),
            "stiffness": digits(self.law.stiffness),
            "damping": digits(self.law.damping),
            "max_vel": digits(self.max_vel),
            "time_step": digits(asked.time_step),
            "radius": digits(radius),
            "mass": digits(asked.mass_or_one),
        }
        return {
            "surface.sdf": SURFACE.format_map(values),
            "surface.urdf": URDF.format_map(values),
            "scene.world": WORLD.format_map(values),
        }


class GazeboClassic(Engine):
    """A surface in SDF and in URDF, for Gazebo Classic with ODE."""

    name: ClassVar[str] = "gazebo-classic"
    title: ClassVar[str] = "Gazebo Classic (ODE)"
    forms: ClassVar[Mapping[str, str]] = {
        "ode": "F = K x + B v, in <kp> and <kd>",
        "dart": "refused: it ignores both",
    }
    takes: ClassVar[frozenset[str]] = frozenset({"tip_radius"})

    def fit(self, asked: Asked) -> Fragment:
        """Return the nearest Kelvin–Voigt law as a surface; DART is refused."""
        if asked.form == "dart":
            raise ExportRefusedError(DART)
        law = kelvin_voigt(asked.law, asked.motion)
        # The spring corrects erp x/h = K x/(h K + B) a second: ten times that at the deepest.
        correcting = law.stiffness / (asked.time_step * law.stiffness + law.damping)
        return _Surface(
            form="ode",
            asked=asked,
            numbers={"kp": law.stiffness, "kd": law.damping},
            engine_law=law,
            exact=is_kelvin_voigt(asked.law),
            warnings=(_OTHER_BODY,),
            law=law,
            max_vel=float(f"{10.0 * correcting * asked.motion.deepest:.1g}"),
        )


ENGINE = GazeboClassic()
