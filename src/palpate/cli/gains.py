"""The command ``palpate gains``."""

import math
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import App, Group, Parameter

from palpate.cli.options import (
    OUTPUT,
    READ,
    UNTRUSTED,
    Channel,
    FigureOptions,
    si_parameter,
)
from palpate.cli.printing import AsJson, Terminal, print_json, say, say_path
from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.control_loops import ControlLoop, Following, Gains

Controller: TypeAlias = Literal["admittance", "impedance", "force"]
_GAINS = Group("Gains", sort_key=0.5)
_ROBOT = Group("Robot and contact", sort_key=0.6)
_CORNER = si_parameter({"Hz": 1.0, "kHz": 1e3, "rad/s": 1.0 / math.tau}, "FREQUENCY", _ROBOT)
_BANDWIDTH = si_parameter({"rad/s": 1.0, "Hz": math.tau}, "FREQUENCY", _ROBOT)
_SPEED = si_parameter("velocity", "SPEED", _ROBOT)
_FORCE = si_parameter("force", "FORCE", _ROBOT)
_DURATION = si_parameter("time", "DURATION", _ROBOT)


@Parameter(name="*", group=_GAINS)
@dataclass(frozen=True)
class GainOptions:
    """The gains of the controller: those of one controller."""

    virtual_mass: float | None = None
    "Virtual mass of admittance control, kg."
    virtual_damping: float | None = None
    "Virtual damping of admittance control, N·s/m."
    stiffness: float | None = None
    "Stiffness of impedance control, N/m."
    damping: float | None = None
    "Damping of impedance control, N·s/m."
    proportional: float | None = None
    "Proportional gain of force control."
    integral: float | None = None
    "Integral gain of force control, 1/s."


@Parameter(name="*", group=_ROBOT)
@dataclass(frozen=True)
class RobotOptions:
    """The robot, and how it touches."""

    mass: float | None = None
    "Effective mass of robot and tool along the normal, kg."
    tool_mass: float | None = None
    "Mass beyond the force sensor, kg (default: 0)."
    rate: float | None = None
    "Rate of the control loop, Hz."
    delay: Annotated[float | None, _DURATION] = None
    "Delay from the measurement to the effect of the command, such as 4ms."
    bandwidth: Annotated[float | None, _BANDWIDTH] = None
    "Natural frequency of the position loop, such as 60rad/s or 10Hz."
    filter: Annotated[float | None, _CORNER] = None
    "Corner of the force's low-pass filter, such as 100Hz."
    friction: float | None = None
    "Viscous friction of the joints along the normal, N·s/m (default: 0)."
    wanted_force: Annotated[float | None, _FORCE] = None
    "Force in contact, such as 5N."
    speed: Annotated[float | None, _SPEED] = None
    "Speed at first touch, such as 20mm/s."


@Parameter(name="*", group=READ)
@dataclass(frozen=True)
class FollowingOptions:
    """A recording of commanded beside measured position."""

    command: Channel | None = None
    """Channel of the commanded position, from which delay and bandwidth of the position loop are
    measured."""
    motion: Annotated[Path | None, Parameter(metavar="FILE")] = None
    "Recording of a motion in free air with this channel (default: that of the result)."
    position: Channel = "position"
    "Channel of the measured position in it."
    time: Channel = "time_s"
    "Time channel in it."

    def measure(self, recorded: str) -> "Following | None":
        """Return delay and bandwidth, if a channel of the command was passed."""
        from palpate.control_loops import measure_following
        from palpate.input.recordings import open_recording

        if self.command is None:
            if self.motion is not None:
                raise InvalidParameterError("--motion needs --command CHANNEL")
            return None
        file = Path(recorded) if self.motion is None else self.motion
        recording = open_recording(file)
        channels = (recording.numbers(name) for name in (self.time, self.command, self.position))
        return measure_following(*channels)


#: Options whose name is not that of the loop's field.
_FIELDS = {
    "rate": "sample_rate",
    "filter": "force_filter",
    "speed": "approach_speed",
}


def gains(
    result: Path,
    /,
    *,
    controller: Controller,
    ros_parameters: Annotated[Path | None, Parameter(group=OUTPUT)] = None,
    as_json: AsJson = False,
    own: GainOptions = GainOptions(),
    robot: RobotOptions = RobotOptions(),
    following: FollowingOptions = FollowingOptions(),
    drawing: FigureOptions = FigureOptions(),
) -> int:
    """Say whether the gains of a controller are safe on an identified contact, and which are.

    Safe: the gain margin is at least 6 dB with 95 % confidence, and the loop does not bounce at
    first touch. palpate refuses, with exit status 3, where the delay is unknown, the stiffness is
    not to be trusted, or the loop is far beyond the recorded forces or frequencies.

    For example:

        palpate identify ball.csv -o ball
        palpate gains ball --controller impedance --stiffness 500 --damping 60 --mass 4 --rate 1000
          --delay 2ms --wanted-force 10N --speed 20mm/s
        palpate gains ball --controller admittance --virtual-mass 2 --virtual-damping 80 --mass 10
          --rate 500 --filter 100Hz --wanted-force 10N --speed 20mm/s --command command
          --motion free.csv --ros-parameters gains.yaml

    Parameters
    ----------
    result
        Folder written by palpate identify FILE -o FOLDER, or its result.json.
    controller
        What the controller does: admittance (force to motion), impedance (position to force) or
        force (force to force).
    ros_parameters
        Write the recommended gains to this YAML file, as parameters of ros2_controllers'
        admittance_controller or of crisp_controllers.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.control_loops.choosing import gains as choose
    from palpate.output.results.saved import load_result
    from palpate.writing import check_marked, check_outputs, write_text

    if ros_parameters is not None:
        check_marked(ros_parameters)
    drawing.check()
    check_outputs([path for path in (ros_parameters, drawing.figure) if path is not None])
    options = {**vars(own), **vars(robot)}
    loop_type = _check_options(controller, options, measured=following.command is not None)
    saved = load_result(result)
    measured = following.measure(saved.description["file"])
    if measured is not None:
        measurable = {"delay": measured.delay, "bandwidth": measured.bandwidth}
        names = {each.name for each in fields(loop_type)}
        options |= {
            name: value
            for name, value in measurable.items()
            if name in names and options[name] is None
        }
    answer = choose(saved, loop_type(**_fields(options)))
    refused = answer.recommended is None
    if ros_parameters is not None and not refused:
        write_text(ros_parameters, answer.parameters())
    if not refused:
        drawing.save("palpate.control_loops.figures.draw_gains", answer)
    if as_json:
        print_json({**answer.as_dict(), "following": measured and _following(measured)})
    else:
        written = [] if refused else [ros_parameters, drawing.figure]
        _print(answer, measured, [path for path in written if path is not None])
    return UNTRUSTED if refused else 0


def read_loop(file: Path) -> "ControlLoop":
    """Return the control loop of a TOML file with options of ``palpate gains``."""
    from palpate.cli.application import OptionsFile

    parser = App(
        config=OptionsFile(file, source=str(file), must_exist=True),
        exit_on_error=False,
        print_error=False,
    )
    parser.command(_build_loop, name="gains")
    build, bound, _ = parser.parse_args(["gains"])
    loop: ControlLoop = build(*bound.args, **bound.kwargs)
    return loop


def _build_loop(
    *,
    controller: Controller,
    own: GainOptions = GainOptions(),
    robot: RobotOptions = RobotOptions(),
) -> Any:
    options = {**vars(own), **vars(robot)}
    return _check_options(controller, options, measured=False)(**_fields(options))


def _fields(options: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a loop that are given, by the loop's names."""
    return {_FIELDS.get(name, name): value for name, value in options.items() if value is not None}


def _check_options(
    controller: Controller,
    options: dict[str, Any],
    *,
    measured: bool,
) -> "type[ControlLoop]":
    """Return the class of the loop; raise for options that it lacks or does not take."""
    from palpate.control_loops import loop_called

    loop_type = loop_called(controller)
    known = {each.name: each for each in fields(loop_type)}
    for name, value in options.items():
        field = known.get(_FIELDS.get(name, name))
        option = f"--{name.replace('_', '-')}"
        if field is None and value is not None:
            raise InvalidParameterError(f"{loop_type.title} does not use {option}: omit it")
        needed = field is not None and value is None and field.default is MISSING
        if needed and not (measured and name == "bandwidth"):
            raise InvalidParameterError(f"{loop_type.title} needs {option}")
    return loop_type


def _following(measured: "Following") -> dict[str, float]:
    return {
        "delay": measured.delay,
        "delay_error": measured.delay_error,
        "bandwidth": measured.bandwidth,
        "bandwidth_error": measured.bandwidth_error,
    }


_STYLES = {"safe": "bold green", "little-margin": "bold yellow"}


def _print(answer: "Gains", measured: "Following | None", written: list[Path]) -> None:
    from palpate.digits import with_error

    console = Terminal()
    sentence, *lines = answer.describe()
    say(console, sentence, _STYLES.get(answer.verdict, "bold red"))
    for line in lines:
        say(console, line)
    if measured is not None:
        delay = with_error(1e3 * measured.delay, 1e3 * measured.delay_error, unit="ms")
        bandwidth = with_error(measured.bandwidth, measured.bandwidth_error, unit="rad/s")
        say(console, f"measured: delay {delay}, bandwidth {bandwidth}")
    for path in written:
        say_path(console, f"written: {path}", "dim")
