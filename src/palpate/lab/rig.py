"""The twin pantograph as MuJoCo's model: bodies, closed chains, motors."""

import math

from palpate.lab.kinematics import ELBOW, Geometry
from palpate.validation import Floats

# kg and m; ours, of the size of a desktop haptic device with a force sensor at its handle.
LINK_MASS, HANDLE_MASS = 0.02, 0.12
LINK_WIDTH, THICKNESS = 0.005, 0.004
# Of each motor, seen at its joint: kg·m², N·m·s/rad and N·m.
ROTOR_INERTIA, BEARING_DAMPING, DRY_FRICTION = 6e-5, 2e-3, 2e-3


def rig_xml(geometry: Geometry, home: Floats, *, time_step: float) -> str:
    """Return the model with every joint at zero at home.

    Parameters
    ----------
    geometry : Geometry
        Lengths.
    home : numpy.ndarray, shape (4,)
        Angles of the motors, rad.
    time_step : float
        s.
    """
    elbows = geometry.elbows(home)
    wrists = geometry.wrists(*geometry.tip(home))
    chains = "\n".join(
        _chain(i, geometry, float(home[i]), elbows[i], wrists[i // 2], _handle(geometry, i))
        for i in range(4)
    )
    motors = "\n".join(f'    <motor name="motor_{i}" joint="motor_{i}"/>' for i in range(4))
    # The stiffest constraint that the step allows: linkages on bearings, not on springs.
    stiff = f'solref="{2.0 * time_step:g} 1" solimp="0.999 0.9999 0.0001"'
    return f"""
<mujoco model="twin pantograph">
  <option timestep="{time_step:.9g}" gravity="0 0 0" integrator="implicitfast"
          tolerance="1e-12" iterations="50"/>
  <compiler angle="radian" autolimits="true"/>
  <visual>
    <global offwidth="1600" offheight="1000"/>
    <quality offsamples="8" shadowsize="4096"/>
    <headlight ambient="0.4 0.4 0.4" diffuse="0.25 0.25 0.25" specular="0 0 0"/>
  </visual>
  <statistic extent="0.4" center="0 -0.07 0"/>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.97 0.98 0.99" rgb2="0.86 0.89 0.93"
             width="256" height="256"/>
  </asset>
  <default>
    <geom contype="0" conaffinity="0"/>
    <default class="motor">
      <joint armature="{ROTOR_INERTIA}" damping="{BEARING_DAMPING}" frictionloss="{DRY_FRICTION}"/>
    </default>
  </default>
  <worldbody>
    <light directional="true" castshadow="false" dir="0.3 0.35 -1" diffuse="0.45 0.45 0.45"/>
{_scenery(geometry)}
{chains}
  </worldbody>
  <equality>
    <connect body1="distal_0" body2="distal_1" anchor="{geometry.distal} 0 0" {stiff}/>
    <connect body1="distal_2" body2="distal_3" anchor="{geometry.distal} 0 0" {stiff}/>
    <connect body1="handle" body2="distal_2" anchor="{geometry.handle} 0 0" {stiff}/>
  </equality>
  <actuator>
{motors}
  </actuator>
  <sensor>
    <framelinvel name="tip_velocity" objtype="site" objname="tip"/>
  </sensor>
</mujoco>"""


def _scenery(geometry: Geometry) -> str:
    """What only the eye meets: the table, the motors, the material below its surface at y = 0."""
    motors = "\n".join(
        f'    <geom type="cylinder" pos="{x:.9g} {y:.9g} -0.03" size="0.017 0.022" '
        'rgba="0.2 0.21 0.23 1"/>'
        for x, y in geometry.motors
    )
    back = -geometry.poker - geometry.reach
    return f"""
    <geom type="box" pos="0 {0.5 * back:.9g} -0.057" size="0.24 0.19 0.005" rgba="0.78 0.8 0.82 1"/>
    <geom type="box" pos="0 0.032 -0.012" size="0.09 0.032 0.04" rgba="0.93 0.68 0.55 0.6"/>
{motors}"""


def _chain(
    i: int, geometry: Geometry, angle: float, elbow: Floats, wrist: Floats, carried: str
) -> str:
    """One motor, its proximal and its distal link, at home."""
    motor = geometry.motors[i]
    # The two chains of a pantograph lie one above the other.
    level = THICKNESS * (1.2 if ELBOW[i] > 0.0 else -1.2)
    distal = math.atan2(wrist[1] - elbow[1], wrist[0] - elbow[0])
    return f"""
    <body name="proximal_{i}" pos="{motor[0]:.9g} {motor[1]:.9g} 0" euler="0 0 {angle:.12g}">
      <joint name="motor_{i}" type="hinge" axis="0 0 1" class="motor"/>
      {_link(geometry.proximal, level, "0.16 0.38 0.62 1")}
      <body name="distal_{i}" pos="{geometry.proximal} 0 0" euler="0 0 {distal - angle:.12g}">
        <joint name="elbow_{i}" type="hinge" axis="0 0 1" damping="1e-5"/>
        {_link(geometry.distal, level, "0.45 0.62 0.78 1")}
{carried.replace("ANGLE", f"{-distal:.12g}")}
      </body>
    </body>"""


def _link(length: float, level: float, colour: str) -> str:
    pin = f'size="0.0058 {1.25 * THICKNESS:.9g}" mass="0" rgba="0.15 0.16 0.18 1"'
    return (
        f'<geom type="cylinder" pos="{length:.9g} 0 0" {pin}/>'
        f'<geom type="box" mass="{LINK_MASS}" pos="{length / 2:.9g} 0 {level:.9g}" '
        f'size="{length / 2:.9g} {LINK_WIDTH} {THICKNESS / 2}" rgba="{colour}"/>'
    )


def _handle(geometry: Geometry, i: int) -> str:
    """The handle with sensor and poking device, carried by the first chain."""
    if i != 0:
        return ""
    half, end = geometry.handle / 2, geometry.poker - 0.004
    return f"""
        <body name="handle" pos="{geometry.distal} 0 0" euler="0 0 ANGLE">
          <joint name="wrist" type="hinge" axis="0 0 1" damping="1e-5"/>
          <geom type="box" mass="{HANDLE_MASS}" pos="{half:.9g} 0 0"
                size="{half:.9g} 0.007 0.004" rgba="0.25 0.27 0.3 1"/>
          <geom type="cylinder" mass="0.06" pos="{half:.9g} 0.014 0" zaxis="0 1 0"
                size="0.0125 0.009" rgba="0.75 0.76 0.78 1"/>
          <geom type="capsule" mass="0.01" size="0.004"
                fromto="{half:.9g} 0.023 0 {half:.9g} {end:.9g} 0" rgba="0.85 0.37 0 1"/>
          <site name="tip" pos="{half:.9g} {geometry.poker:.9g} 0" size="0.001"/>
        </body>"""
