"""Fig. 3: what the probe is told to do, and what it does in each material."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.estimators import VariableProjection
from palpate.figures.style import DARK, LIGHT, style
from palpate.lab import THREE_SINES, Measurement, Sensors
from palpate.paper.experiment import Claim, Experiment, Finding, Outcome, Table
from palpate.paper.identifying import identify
from palpate.paper.panels import LABELS
from palpate.paper.report.verdicts import readable
from palpate.paper.sessions import GATE, START, session, thinned
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MATERIALS = ("ball", "sponge", "pvc")
# Fig. 3 shows the first 10 s, as the experiments last.
END = 12.0

CLAIMS = (
    Claim(
        "formula",
        "IV-A, Fig. 3",
        "the following combination of three sinusoidal signals is chosen as the desired "
        "trajectory … x(t) = 1 sin(4t) + 1.8 sin(11t) + 1.8 sin(15t) + x₀ (mm)",
        unit="mm/s",
        measured="peak speed commanded",
        assumption="Read as rad/s. In Hz the speed would reach 319 mm/s, and condition (10) "
        "could hold on none of the materials; the curve of Fig. 3 that would tell is lost.",
    ),
    Claim(
        "depth",
        "IV-A, Fig. 3",
        "The bias x₀ is added to push the robot smoothly inside the environment about 10 mm",
        "about 10 mm",
        "mm",
        "Checked on what the rig does, not on its command of 10 mm: within 1 mm in every material. "
        "Hinges on the stiffness of the robot's control, which the paper does not give.",
        "mean depth, where farthest from 10 mm",
    ),
    Claim(
        "inside",
        "IV-A, Fig. 3",
        "such that the robot remains inside the object during the entire contact task",
        unit="mm",
        measured="least depth once the sines are whole",
    ),
    Claim(
        "pause",
        "IV-A",
        "A 2-s delay in the position command is implemented to measure and remove any bias in "
        "the force sensor measurements before the actual experiment starts.",
        "2 s",
        "mN",
        "Removed where what is left is under half a step of the sensor, 1/16 N.",
        "largest bias left",
    ),
    Claim(
        "rich",
        "IV-A",
        "The frequency and coefficients are chosen to ensure suitable penetration inside the "
        "environment as well as the richness of the excitation input.",
        unit="%",
        measured="largest standard error of K, B or n after 10 s, variable projection",
        assumption="Rich is read as: variable projection tells K, B and n to 5 % in every "
        "material.",
    ),
)


class TrajectoryFollowed(Experiment):
    """The paper's trajectory, commanded and followed by the rig in each material."""

    name = "fig03"
    title = "The trajectory, and how the rig follows it"
    caption = (
        "Penetration over time: commanded, and reached in the ball, the sponge and the PVC "
        "phantom; below, how far each lags behind the command, with the range over the seeds."
    )
    claims = CLAIMS

    def run(self, seed: int) -> Outcome:
        """Press each material once, and measure how the command was followed."""
        numbers: dict[str, dict[str, float]] = {}
        curves: dict[str, list[float]] = {}
        for name in MATERIALS:
            measurement = session(name, "three-sines", seed, END)
            numbers[name] = _numbers(measurement)
            time = measurement.truth.time
            drawn = np.flatnonzero(time >= START - 0.2)
            drawn = drawn[thinned(time[drawn])]
            curves["time"] = time[drawn].tolist()
            curves["command"] = (1e3 * measurement.command.penetration[drawn]).tolist()
            curves[name] = (1e3 * measurement.truth.penetration[drawn]).tolist()
        return Outcome(seed, numbers, curves, _findings(numbers))

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the first seed, and the range of the lag over all."""
        theme = DARK if dark else LIGHT
        first = outcomes[0].curves
        time = np.array(first["time"])
        with style(theme) as new_figure:
            figure = new_figure(figsize=(9.5, 6.0), layout="constrained")
            above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
            above.plot(time, first["command"], color=theme.ink, linewidth=2.2, label="command")
            for name, colour in zip(MATERIALS, theme.lines, strict=False):
                above.plot(time, first[name], color=colour, linewidth=0.9, label=LABELS[name])
                lags = np.array(
                    [np.subtract(o.curves["command"], o.curves[name]) for o in outcomes]
                )
                below.fill_between(
                    time, lags.min(axis=0), lags.max(axis=0), color=colour, alpha=0.35, linewidth=0
                )
                below.plot(time, lags[0], color=colour, linewidth=0.9)
            above.axhline(0.0, color=theme.ink, linewidth=0.8, linestyle=":")
            above.set(ylabel="penetration [mm]", title="Into the material", ylim=(-1.5, 18.5))
            above.legend(loc="upper right", ncols=4)
            below.set(xlabel="time [s]", ylabel="lag [mm]", title="Command minus what was reached")
            below.set_xlim(time[0], time[-1])
        return figure

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """How each material is penetrated."""
        shown = (
            ("mean_depth", "mean depth, mm"),
            ("least_depth", "least depth, mm"),
            ("peak_speed", "peak speed, mm/s"),
            ("rms_lag", "lag, rms, mm"),
            ("peak_force", "peak force, N"),
            ("bias_left", "force bias left, mN"),
            ("largest_error", "largest s.e. of VP, %"),
        )
        rows = tuple(
            (LABELS[name], *(_span([o.numbers[name][key] for o in outcomes]) for key, _ in shown))
            for name in MATERIALS
        )
        header = ("material", *(words for _, words in shown))
        note = (
            "Median over the seeds, range in brackets. Peak speed commanded: "
            f"{1e3 * _commanded_speed():.1f} mm/s. VP is variable projection, after 10 s."
        )
        return (Table("How the trajectory is followed", header, rows, note),)


def _numbers(measurement: Measurement) -> dict[str, float]:
    truth, command, contact = measurement.truth, measurement.command, measurement.contact
    whole = truth.time >= THREE_SINES.pause + THREE_SINES.approach
    depth = truth.penetration[whole]
    lag = command.penetration[whole] - depth
    found = identify(contact.window(START), VariableProjection(gate=GATE))
    relative = found.estimate.standard_errors / found.law.parameters
    return {
        "mean_depth": 1e3 * float(depth.mean()),
        "least_depth": 1e3 * float(depth.min()),
        "peak_speed": 1e3 * float(np.abs(truth.velocity[whole]).max()),
        "rms_lag": 1e3 * float(np.sqrt(np.mean(lag**2))),
        "peak_force": float(truth.force.max()),
        "bias_left": 1e3 * float(np.mean(contact.force[whole] - truth.force[whole])),
        "largest_error": 100.0 * float(relative.max()),
    }


def _commanded_speed() -> float:
    """m/s, over one period of the sines."""
    time: Floats = np.arange(0.0, 2.0 * np.pi, 1e-4)
    return float(np.abs(THREE_SINES.motion.at(time)[1]).max())


def _findings(numbers: dict[str, dict[str, float]]) -> dict[str, Finding]:
    depth = max((n["mean_depth"] for n in numbers.values()), key=lambda mean: abs(mean - 10.0))
    least = min(n["least_depth"] for n in numbers.values())
    bias = max((n["bias_left"] for n in numbers.values()), key=abs)
    error = max(n["largest_error"] for n in numbers.values())
    return {
        "formula": Finding(None, 1e3 * _commanded_speed()),
        "depth": Finding(abs(depth - 10.0) <= 1.0, depth),
        "inside": Finding(least > 0.0, least),
        "pause": Finding(1e-3 * abs(bias) <= 0.5 * Sensors().force_resolution, bias),
        "rich": Finding(error <= 5.0, error),
    }


def _span(values: list[float]) -> str:
    middle, low, high = (readable(float(f(values))) for f in (np.median, np.min, np.max))
    return middle if low == high else f"{middle} ({low} to {high})"
