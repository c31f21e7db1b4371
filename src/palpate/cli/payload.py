"""The command ``palpate payload``."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import cyclopts

from palpate.cli.options import (
    OUTPUT,
    READ,
    Channel,
    Channels,
    FigureOptions,
    MaxSize,
    Unit,
    parse_units,
)
from palpate.cli.printing import (
    STYLES,
    AsJson,
    Cell,
    Terminal,
    is_verbose,
    open_with_progress,
    print_json,
    print_table,
    say,
    say_path,
)
from palpate.cli.reading import negative_number_parameter, parse_delay
from palpate.digits import percent

if TYPE_CHECKING:
    from palpate.input.wrench import Payload

_READ = cyclopts.Parameter(group=READ)
_UNKNOWN_TORQUE = 10.0  # N·m: standard error of the bias without a torque


@cyclopts.Parameter(name="*")
@dataclass(frozen=True)
class LogOptions:
    """How to read the log."""

    time: Annotated[Channel, _READ] = "time_s"
    "Time channel (auto-detected if absent)."
    position: Annotated[Channels | None, _READ] = None
    "Position of the flange, x,y,z channels, or a topic (default: auto-detect)."
    orientation: Annotated[Channels | None, _READ] = None
    "Orientation of the flange, quaternion x,y,z,w or three angles; or a topic."
    orientation_form: Annotated[Literal["rpy", "rotation-vector"] | None, _READ] = None
    "Three angles: rpy (about the fixed axes x, y, z) or rotation-vector (default: by the names)."
    force: Annotated[Channels | None, _READ] = None
    "Force in the axes of the sensor, x,y,z channels, or a topic (default: auto-detect)."
    torque: Annotated[Channels | None, _READ] = None
    "Torque of the sensor, x,y,z channels, or a topic (default: that of the force's sensor)."
    unit: Annotated[tuple[Unit, ...], _READ] = ()
    "Units, such as position=mm,force=mN (default: from the file or channel names, else SI)."
    force_frame: Annotated[Literal["tool", "base"] | None, _READ] = None
    "Frame of the force, which must be that of the tool (default: tool if free air fits it)."
    flip_force: Annotated[bool, cyclopts.Parameter(group=READ, negative="")] = False
    "Reverse the sign of the force, which the sensor reads on the material."
    delay: Annotated[str | None, negative_number_parameter("DURATION")] = None
    "Delay of the force, as palpate skew measures it: 3ms+-0.05ms (default: found in free air)."
    start: Annotated[float | None, _READ] = None
    "Use samples from this time on, s."
    stop: Annotated[float | None, _READ] = None
    "Use samples up to this time, s."
    max_size: MaxSize = None
    "Largest size of the data in memory, such as 8GB (default: 4 GiB)."

    @property
    def preparation(self) -> dict[str, Any]:
        """Return the settings of the preparation."""
        from palpate.input.channels import Columns

        names = ("time", "position", "orientation", "orientation_form", "force", "torque")
        named = {name: getattr(self, name) for name in names}
        return {
            "columns": Columns(**{name: each for name, each in named.items() if each}),
            "units": parse_units("--unit", self.unit),
            "window": (self.start, self.stop),
            "force_frame": self.force_frame,
            "flip": ("force",) if self.flip_force else (),
            "delay": 0.0 if self.delay is None else parse_delay(self.delay),
        }


def payload(
    log: Path,
    /,
    *,
    save_config: Annotated[Path | None, cyclopts.Parameter(group=OUTPUT)] = None,
    ros_parameters: Annotated[Path | None, cyclopts.Parameter(group=OUTPUT)] = None,
    as_json: AsJson = False,
    drawing: FigureOptions = FigureOptions(),
    reading: LogOptions = LogOptions(),
) -> None:
    """Find the tool on a force-torque sensor: mass, centre of mass, mount, bias and clock.

    It needs a log of pose and wrench in which the tool turns in free air, best by 30° about two
    axes. The log may also hold contacts.

    For example:

        palpate payload turns.mcap --save-config tool.toml
        palpate payload turns.csv --ros-parameters tool.yaml --figure tool.svg

    Parameters
    ----------
    log
        Recording of pose and wrench, of any format; - is standard input.
    save_config
        Write the payload to this TOML file, for --payload of palpate identify and live.
    ros_parameters
        Write the weight to this YAML file, as parameters of control_toolbox's gravity compensation
        and of mujoco_ros2_control's force-torque sensor.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.exports.ros_parameters import ros_parameters as parameters
    from palpate.input.preparation.force_frame import measure_payload
    from palpate.input.preparation.settings import Preparation
    from palpate.validation import plain
    from palpate.writing import check_marked, check_outputs, write_text

    outputs = [path for path in (save_config, ros_parameters) if path is not None]
    for output in outputs:
        check_marked(output)
    drawing.check()
    check_outputs([*outputs, *filter(None, [drawing.figure])])
    recording = open_with_progress(log, None, max_size=reading.max_size)
    measured = measure_payload(recording, Preparation(**reading.preparation))
    found = measured.payload
    if save_config is not None:
        found.save(save_config, [f"of {log}: {verdict_on(found)}"])
    if ros_parameters is not None:
        frame = measured.sensor_frame or "ft_sensor"
        write_text(ros_parameters, parameters(found, sensor_frame=frame))
    drawing.save("palpate.output.figures.payload.draw_payload", measured)
    if as_json:
        fields = plain(found.as_dict())
        print_json({"file": str(log), "mark": found.mark, "verdict": verdict_on(found), **fields})
        return
    _print(log, found)
    console = Terminal()
    for path in (*outputs, drawing.figure):
        if path is not None:
            say_path(console, f"written: {path}")


def verdict_on(found: "Payload") -> str:
    """Return what the log is good for: *turns 43° about 2 axes, 20 s of free air: enough*."""
    axes = f"{found.axes} axis" if found.axes == 1 else f"{found.axes} axes"
    turns = f"turns {math.degrees(found.turn):.0f}° about {axes}" if found.axes else "does not turn"
    text = f"{turns}, {found.free_time:.0f} s of free air ({percent(found.free_share)})"
    marks = {
        "mass": found.mass_mark, "mount": found.mount_mark, "clock": found.delay_mark,
    }  # fmt: skip
    poor = [name for name, mark in marks.items() if mark == "do-not-trust"]
    fair = [name for name, mark in marks.items() if mark == "with-care"]
    if poor:
        return f"{text}: not enough for {' and '.join(poor)}"
    return f"{text}: enough, with care for {' and '.join(fair)}" if fair else f"{text}: enough"


def _print(log: Path, found: "Payload") -> None:
    """Print the values with their standard errors, the verdict and what to do, in 12 lines."""
    import numpy as np
    from rich.text import Text

    from palpate.digits import with_error
    from palpate.exports.ros_parameters import roll_pitch_yaw
    from palpate.findings import spoken

    def three(values: Any, errors: Any, factor: float, unit: str) -> str:
        pairs = zip(values, errors, strict=True)
        return ", ".join(with_error(factor * a, factor * b) for a, b in pairs) + f" {unit}"

    cosine = float(np.clip(0.5 * (np.trace(found.mount) - 1.0), -1.0, 1.0))
    turned = math.degrees(math.acos(cosine))
    off = math.degrees(float(found.mount_error.max()))
    angle = with_error(turned, off, unit="°").replace(" °", "°")
    roll, pitch, yaw = map(math.degrees, roll_pitch_yaw(found.mount))
    bias = found.sign * found.bias
    error = found.bias_error
    torque = float(error[3:].max()) < _UNKNOWN_TORQUE
    centre = three(found.centre, found.centre_error, 1e3, "mm")
    late = "late" if found.delay >= 0.0 else "early"
    clock = with_error(1e3 * abs(found.delay), 1e3 * found.delay_error, unit="ms")
    rows: list[tuple[str, str, str]] = [
        ("mass", with_error(found.mass, found.mass_error, unit="kg"), found.mass_mark),
        ("centre of mass", centre if torque else "unknown: the log has no torque", ""),
        ("mount", f"turned by {angle}; rpy {roll:.2f}, {pitch:.2f}, {yaw:.2f}°", found.mount_mark),
        ("bias", three(bias[:3], error[:3], 1.0, "N"), ""),
        *([("", three(bias[3:], error[3:], 1e3, "mN·m"), "")] if torque else []),
        ("clock", f"force {clock} {late}", found.delay_mark),
    ]
    console = Terminal()
    say_path(console, log.name, "bold")
    cells: list[list[Cell]] = [
        [f"  {name}", words, Text(spoken(mark), STYLES.get(mark, ""))] for name, words, mark in rows
    ]
    print_table(console, ["", "", ""], cells)
    say(console, f"  {verdict_on(found)}", "bold")
    shown = found.findings if is_verbose() else found.findings[:1]
    for each in shown:
        # The remedies are options of identify.
        say(console, f"  {each.message}", STYLES[each.severity])
    if len(shown) < len(found.findings):
        say(console, f"  {len(found.findings) - 1} more with -v", "dim")
    if found.mark != "trust":
        say(console, "  next: turn the tool by 30° about two axes in free air")
