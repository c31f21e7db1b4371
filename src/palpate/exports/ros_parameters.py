"""Parameters of ROS 2 nodes that subtract the weight of a tool, in YAML."""

import math
from typing import Any

from palpate.input.wrench.payload import Payload
from palpate.writing import MADE, quote


def ros_parameters(
    payload: Payload,
    *,
    world_frame: str = "world",
    sensor_frame: str = "ft_sensor",
) -> str:
    """Return the weight as parameters of control_toolbox and of mujoco_ros2_control, in YAML.

    The names are those in the public sources of ``control_filters/GravityCompensationWrench``,
    control_toolbox 5.2.0 and later (its documentation has names from before that release), and of
    ``FtsGravCompPlugin``, in the development version of mujoco_ros2_control_plugins after 0.1.0.
    Both subtract the weight alone: neither bias nor inertia.
    """
    centre = _yaml_list(payload.centre)
    world = quote(world_frame)
    sensor = quote(sensor_frame)
    roll, pitch, yaw = roll_pitch_yaw(payload.mount)
    errors = ", ".join(f"{each:.2g}" for each in payload.centre_error)
    bias = ", ".join(f"{each:.6g}" for each in payload.sign * payload.bias)
    return f"""\
{MADE}
# Tool of {payload.mass:.6g} kg. The filters subtract its weight, but neither inertia nor bias.
# Standard errors: {payload.mass_error:.2g} kg; of the centre of mass {errors} m.
# Bias of the sensor: {bias} N and N m.
# Sensor in the flange, as in URDF: rpy="{roll:.6g} {pitch:.6g} {yaw:.6g}".

# control_toolbox 5.2.0 and later.
/**:
  ros__parameters:
    sensor_filter_chain:
      filter1:
        name: gravity_compensation
        type: control_filters/GravityCompensationWrench
        params:
          world_frame: {world}
          sensor_frame: {sensor}
          tool:
            CoG: {centre}
            mass: {float(payload.mass)!r}
            gravity_field: [0.0, 0.0, {-payload.sign * payload.gravity!r}]

    # mujoco_ros2_control_plugins: the development version after 0.1.0.
    mujoco_plugins:
      fts_grav_comp_plugin:
        type: mujoco_ros2_control_plugins/FtsGravCompPlugin
        {sensor}:
          frame_id: {sensor}
          CoG:
            pos: {centre}
            mass: {float(payload.mass)!r}
"""


def _yaml_list(values: Any) -> str:
    return f"[{', '.join(repr(float(each)) for each in values)}]"


def roll_pitch_yaw(rotation: Any) -> tuple[float, float, float]:
    """Return the angles of URDF of a rotation, rad: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    r = rotation
    return (
        math.atan2(r[2, 1], r[2, 2]),
        math.asin(min(max(-r[2, 0], -1.0), 1.0)),
        math.atan2(r[1, 0], r[0, 0]),
    )
