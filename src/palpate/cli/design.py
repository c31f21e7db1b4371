"""The command ``palpate design``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from palpate.cli.options import OUTPUT, FigureOptions, OutputFile
from palpate.cli.printing import AsJson, Terminal, print_json, say_command, say_path
from palpate.errors import InvalidParameterError
from palpate.writing import check_outputs, is_standard_output

if TYPE_CHECKING:
    from palpate.design import Design, MotionCommand

Several = Annotated[tuple[float, ...] | None, Parameter(consume_multiple=True)]


@Parameter(name="*", group=Group("The material, as guessed", sort_key=0.5))
@dataclass(frozen=True)
class ModelOptions:
    """The material as guessed; an order of magnitude is a start."""

    stiffness: float
    "K, N/mⁿ."
    damping: float
    "B, N·s/mⁿ⁺¹."
    exponent: float
    "n, 1 to 2 for most materials."


@Parameter(name="*", group=Group("The sensor", sort_key=0.6))
@dataclass(frozen=True)
class Sensor:
    """What the force is measured with."""

    noise: float
    "Standard deviation of the force, N."
    resolution: float = 0.0
    "Step that the force is rounded to, N."
    sample_time: float = 1e-3
    "Time between samples, s."


@Parameter(name="*", group=Group("The motion", sort_key=0.7))
@dataclass(frozen=True)
class Plan:
    """The motion, and what a better one has to keep to."""

    depth: float = 10e-3
    "Mean depth, m."
    amplitudes: Several = None
    "Amplitude of each sine, m; 1e-3 1.8e-3 1.8e-3 unless given."
    frequencies: Several = None
    "Frequency of each sine, rad/s (not Hz); 4 11 15 unless given."
    max_depth: float | None = None
    "Peak penetration of the better motion, m; that of the planned motion unless given."
    max_speed: float | None = None
    "Highest speed of the better motion, m/s; that of the planned motion unless given."


@Parameter(name="*", group=OUTPUT)
@dataclass(frozen=True)
class Written:
    """The file that the motion to play is written to."""

    output: OutputFile | None = None
    "CSV of the better motion, time_s, penetration_m, velocity_m_s: for a robot, or palpate lab."
    seconds: float | None = None
    "How long its sines last at least, s; 20 unless given."
    rate: float | None = None
    "Its samples a second; those of the sensor unless given."

    def check(self, figure: Path | None, *, as_json: bool) -> None:
        """Say before the work what could not be written after it."""
        for name, value in (("seconds", self.seconds), ("rate", self.rate)):
            if value is not None and self.output is None:
                raise InvalidParameterError(f"--{name} is of the motion's file: name it with -o")
        if as_json and self.output is not None and is_standard_output(self.output):
            raise InvalidParameterError("--json and the motion cannot both go to standard output")
        check_outputs([each for each in (self.output, figure) if each is not None])


def design(
    *,
    guess: ModelOptions,
    sensor: Sensor,
    plan: Plan = Plan(),
    offset: bool = True,
    surface: bool = False,
    as_json: AsJson = False,
    written: Written = Written(),
    drawing: FigureOptions = FigureOptions(),
) -> None:
    """Tell what a planned motion would identify, how soon, and find a better motion.

    The motion is depth + Σ amplitude · sin(frequency · t); the paper's three sines unless given.

    For example:

        palpate design --stiffness 2000 --damping 2000 --exponent 1 --noise 0.05
        palpate design --stiffness 300 --damping 3000 --exponent 1.2 --noise 0.1 --depth 0.005

    Parameters
    ----------
    offset
        A force offset is unknown too.
    surface
        The position of the surface is unknown too.
    as_json
        Print one JSON object instead of a table; what is infinite is null.
    """
    from palpate.cli.design_tables import command_line, print_design
    from palpate.design import PAPER_MOTION, Motion
    from palpate.design import design as run
    from palpate.force_laws import HuntCrossley

    drawing.check()
    written.check(drawing.figure, as_json=as_json)
    motion = Motion(
        plan.depth,
        PAPER_MOTION.amplitudes if plan.amplitudes is None else plan.amplitudes,
        PAPER_MOTION.frequencies if plan.frequencies is None else plan.frequencies,
    )
    result = run(
        HuntCrossley(**vars(guess)),
        motion,
        **vars(sensor),
        offset=offset,
        surface=surface,
        max_depth=plan.max_depth,
        max_speed=plan.max_speed,
    )
    played = _write_motion(result, written)
    drawing.save("palpate.design.figures.draw_design", result)
    if as_json:
        print_json({**result.as_dict(), "command": command_line(result)})
        return
    # A motion that goes on into a pipe is not mixed with words about it.
    console = Terminal(stderr=written.output is not None and is_standard_output(written.output))
    print_design(result, console)
    if played is not None:
        say_path(console, f"motion, the {result.chosen[0]} one: {written.output}")
        seconds = f"--seconds {played.duration:.4g}"
        command = f"palpate lab MATERIAL -o FILE --trajectory {written.output} {seconds}"
        say_command(console, command)
    if drawing.figure is not None:
        say_path(console, f"figure: {drawing.figure}")


def _write_motion(result: "Design", written: Written) -> "MotionCommand | None":
    """Write the motion to play, where that is asked for, and return it."""
    from palpate.cli.design_tables import notes_of
    from palpate.design import MotionCommand, write_motion
    from palpate.validation import number_in

    if written.output is None:
        return None
    rate = written.rate
    step = result.sample_time if rate is None else 1.0 / number_in("--rate", rate, 1.0, 1e5)
    seconds = {} if written.seconds is None else {"seconds": written.seconds}
    command = MotionCommand(result.chosen[1].motion, **seconds)
    write_motion(command, written.output, sample_time=step, notes=notes_of(result))
    return command
