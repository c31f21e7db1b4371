"""Units of the messages whose definition says them: ROS is in SI, by its REP 103."""

_UNITS = {
    ("Wrench", "force"): "N",
    ("Wrench", "torque"): "N·m",
    ("Pose", "position"): "m",
    ("PointStamped", "point"): "m",
    ("Transform", "translation"): "m",
    ("FrameTransform", "translation"): "m",
    ("Twist", "linear"): "m/s",
    ("Twist", "angular"): "rad/s",
    ("Accel", "linear"): "m/s²",
    ("Accel", "angular"): "rad/s²",
    ("Imu", "angular_velocity"): "rad/s",
    ("Imu", "linear_acceleration"): "m/s²",
    ("Range", "range"): "m",
    ("FluidPressure", "fluid_pressure"): "Pa",
}
_PACKAGES = ("geometry_msgs", "sensor_msgs", "foxglove")


def unit_of(type_name: str, field: str) -> str | None:
    """Return the unit of a field of a type of messages; None where the type does not say it."""
    package, _, rest = type_name.replace(".", "/").partition("/")
    if package not in _PACKAGES:
        return None
    return _UNITS.get((rest.rpartition("/")[2], field))
