"""The command ``palpate design``."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from palpate.cli.options import OUTPUT, FigureOptions, OutputFile, si_parameter
from palpate.cli.printing import AsJson, Terminal, print_json, say_command, say_path
from palpate.errors import InvalidParameterError
from palpate.writing import check_outputs, is_standard_output

if TYPE_CHECKING:
    from palpate.force_laws import HuntCrossley
    from palpate.lab.design import Design, MotionCommand

Several = Annotated[tuple[float, ...] | None, Parameter(consume_multiple=True)]


@Parameter(name="*", group=Group("Guess of the material", sort_key=0.5))
@dataclass(frozen=True)
class ModelOptions:
    """A guess of the material; an order of magnitude is enough to start."""

    K: Annotated[float | None, Parameter(name="--K")] = None
    "Coefficient of the spring, N/mⁿ."
    B: Annotated[float | None, Parameter(name="--B")] = None
    "Coefficient of the damper, N·s/mⁿ⁺¹."
    n: Annotated[float | None, Parameter(name="--n")] = None
    "Exponent, 1 to 2 for most materials."

    def law(self, recording: Path | None) -> "HuntCrossley":
        """Return the guess, or the Hunt–Crossley law of a recording."""
        from palpate.force_laws import HuntCrossley

        given = {name: value for name, value in vars(self).items() if value is not None}
        if recording is not None and not given:
            from palpate.identifying import identify

            law = identify(recording, law="hunt-crossley").law
            assert isinstance(law, HuntCrossley)
            return law
        if recording is not None or len(given) < len(vars(self)):
            raise InvalidParameterError("pass --K, --B and --n, or a recording in place of them")
        return HuntCrossley(**given)


@Parameter(name="*", group=Group("The sensor", sort_key=0.6))
@dataclass(frozen=True)
class Sensor:
    """The force sensor."""

    noise: float
    "Standard deviation of the force noise, N."
    resolution: float = 0.0
    "Quantisation step of the force, N."
    sample_time: float = 1e-3
    "Time between samples, s."


_MOTION = Group("The motion", sort_key=0.7)
_LENGTH = si_parameter("penetration", "LENGTH", _MOTION)
_SPEED = si_parameter("velocity", "SPEED", _MOTION)
_FREQUENCY = si_parameter({"rad/s": 1.0, "Hz": math.tau}, "FREQUENCY", _MOTION)


@Parameter(name="*", group=_MOTION)
@dataclass(frozen=True)
class Plan:
    """The planned motion, and the limits of a better one."""

    depth: Annotated[float, _LENGTH] = 10e-3
    "Mean depth, such as 5mm."
    amplitudes: Annotated[Several, _LENGTH] = None
    "Amplitude of each sine (default: 1mm 1.8mm 1.8mm)."
    frequencies: Annotated[Several, _FREQUENCY] = None
    "Frequency of each sine, such as 2Hz; without a unit in rad/s (default: 4 11 15)."
    max_depth: Annotated[float | None, _LENGTH] = None
    "Largest penetration of the better motion (default: that of the planned motion)."
    max_speed: Annotated[float | None, _SPEED] = None
    "Highest speed of the better motion (default: that of the planned motion)."


@Parameter(name="*", group=OUTPUT)
@dataclass(frozen=True)
class Written:
    """The CSV file of the motion."""

    output: OutputFile | None = None
    "CSV file for the better motion (time_s, penetration_m, velocity_m_s), for a robot or the lab."
    seconds: float | None = None
    "Minimum duration of the written sines, s (default: 20)."
    rate: float | None = None
    "Written samples per second (default: those of the sensor)."

    def check(self, figure: Path | None, *, as_json: bool) -> None:
        """Check before the computation that the files can be written after it."""
        for name, value in (("seconds", self.seconds), ("rate", self.rate)):
            if value is not None and self.output is None:
                raise InvalidParameterError(f"--{name} needs a file for the motion: add -o FILE")
        if as_json and self.output is not None and is_standard_output(self.output):
            raise InvalidParameterError("--json and -o cannot both write to standard output")
        check_outputs([each for each in (self.output, figure) if each is not None])


def design(
    recording: Path | None = None,
    /,
    *,
    guess: ModelOptions = ModelOptions(),
    sensor: Sensor,
    plan: Plan = Plan(),
    offset: bool = True,
    surface: bool = False,
    as_json: AsJson = False,
    written: Written = Written(),
    drawing: FigureOptions = FigureOptions(),
) -> None:
    """Predict the precision of a planned motion on a guessed material, and find a better motion.

    The motion is depth + Σ amplitude · sin(frequency · t) (default: the paper's three sines).

    For example:

        palpate design --K 2000 --B 2000 --n 1 --noise 0.05
        palpate design --K 300 --B 3000 --n 1.2 --noise 0.1 --depth 5mm --frequencies 1Hz 2Hz
        palpate design recording.csv --noise 0.05

    Parameters
    ----------
    recording
        A touch of the material, in place of --K, --B and --n.
    offset
        Also estimate a force offset.
    surface
        Also estimate the surface position.
    as_json
        Print one JSON object instead of a table; infinite numbers are null.
    """
    from palpate.cli.design_tables import command_line, print_design
    from palpate.lab.design import PAPER_MOTION, Motion
    from palpate.lab.design import design as run

    drawing.check()
    written.check(drawing.figure, as_json=as_json)
    motion = Motion(
        plan.depth,
        PAPER_MOTION.amplitudes if plan.amplitudes is None else plan.amplitudes,
        PAPER_MOTION.frequencies if plan.frequencies is None else plan.frequencies,
    )
    result = run(
        guess.law(recording),
        motion,
        **vars(sensor),
        offset=offset,
        surface=surface,
        max_depth=plan.max_depth,
        max_speed=plan.max_speed,
    )
    played = _write_motion(result, written)
    drawing.save("palpate.lab.design.figures.draw_design", result)
    if as_json:
        print_json({**result.as_dict(), "command": command_line(result)})
        return
    # The tables must not mix with a motion that goes to standard output.
    console = Terminal(stderr=written.output is not None and is_standard_output(written.output))
    print_design(result, console)
    if played is not None:
        say_path(console, f"{result.chosen[0]} motion: {written.output}")
        seconds = f"--seconds {played.duration:.4g}"
        command = f"palpate lab MATERIAL -o FILE --trajectory {written.output} {seconds}"
        say_command(console, command)
    if drawing.figure is not None:
        say_path(console, f"figure: {drawing.figure}")


def _write_motion(result: "Design", written: Written) -> "MotionCommand | None":
    """Write the motion if -o names a file, and return it."""
    from palpate.cli.design_tables import comment_lines
    from palpate.lab.design import MotionCommand, write_motion
    from palpate.validation import number_in

    if written.output is None:
        return None
    rate = written.rate
    step = result.sample_time if rate is None else 1.0 / number_in("--rate", rate, 1.0, 1e5)
    seconds = {} if written.seconds is None else {"seconds": written.seconds}
    command = MotionCommand(result.chosen[1].motion, **seconds)
    write_motion(command, written.output, sample_time=step, notes=comment_lines(result))
    return command
