"""The command ``palpate design``."""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from palpate.cli.printing import AsJson, print_json

Several = Annotated[tuple[float, ...] | None, Parameter(consume_multiple=True, negative="")]


@Parameter(name="*")
@dataclass(frozen=True)
class Guess:
    """The material as guessed; an order of magnitude is a start."""

    stiffness: float
    "K, N/mⁿ."
    damping: float
    "B, N·s/mⁿ⁺¹."
    exponent: float
    "n, 1 to 2 for most materials."


@Parameter(name="*")
@dataclass(frozen=True)
class Sensor:
    """What the force is measured with."""

    noise: float
    "Standard deviation of the force, N."
    resolution: float = 0.0
    "Step that the force is rounded to, N."
    sample_time: float = 1e-3
    "Time between samples, s."


@Parameter(name="*")
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


def design(
    *,
    guess: Guess,
    sensor: Sensor,
    plan: Plan | None = None,
    offset: bool = True,
    surface: bool = False,
    as_json: AsJson = False,
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

    plan = plan or Plan()
    motion = Motion(
        plan.depth,
        PAPER_MOTION.amplitudes if plan.amplitudes is None else plan.amplitudes,
        PAPER_MOTION.frequencies if plan.frequencies is None else plan.frequencies,
    )
    result = run(
        HuntCrossley(guess.stiffness, guess.damping, guess.exponent),
        motion,
        noise=sensor.noise,
        resolution=sensor.resolution,
        sample_time=sensor.sample_time,
        offset=offset,
        surface=surface,
        max_depth=plan.max_depth,
        max_speed=plan.max_speed,
    )
    if as_json:
        print_json({**result.as_dict(), "command": command_line(result)})
    else:
        print_design(result)
