"""Fig. 3: what the probe is told to do, and what it does in each material."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.estimators import VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.lab import THREE_SINES, Measurement
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table
from palpate.paper.panels import LABELS, Figure, draw_truth, thinned
from palpate.paper.quantities import Numbers
from palpate.paper.sessions import START, identified, session
from palpate.validation import Floats

MATERIALS = ("ball", "sponge", "pvc")


@dataclass(frozen=True)
class TrajectoryFollowed(Experiment):
    """The paper's trajectory, commanded and followed by the rig in each material."""

    name: str = "fig03"
    title: str = "The trajectory, and how the rig follows it"
    caption = (
        "Penetration over time: commanded, and reached in the ball, the sponge and the PVC "
        "phantom; below, how far each lags behind the command, with the range over the seeds."
    )
    size: tuple[float, float] = (9.5, 6.0)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Press each material once, and measure how the command was followed."""
        numbers = {"peak speed commanded [mm/s]": 1e3 * _commanded_speed()}
        curves: dict[str, Floats] = {}
        for name in MATERIALS:
            measurement = session(name, "three-sines", seed)
            numbers |= _numbers(name, measurement)
            time = measurement.truth.time
            drawn = np.flatnonzero(time >= START - 0.2)
            drawn = drawn[thinned(time[drawn])]
            curves["time"] = time[drawn]
            curves["command"] = 1e3 * measurement.command.penetration[drawn]
            curves[name] = 1e3 * measurement.truth.penetration[drawn]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first seed, and the range of the lag over all."""
        first = outcomes[0].curves
        time = np.array(first["time"])
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
        upper.plot(time, first["command"], color=THEME.ink, linewidth=2.2, label="command")
        for name, colour in zip(MATERIALS, THEME.lines, strict=False):
            upper.plot(time, first[name], color=colour, linewidth=0.9, label=LABELS[name])
            lags = np.array([np.subtract(o.curves["command"], o.curves[name]) for o in outcomes])
            low, high = lags.min(axis=0), lags.max(axis=0)
            lower.fill_between(time, low, high, color=colour, alpha=0.35, linewidth=0)
            lower.plot(time, lags[0], color=colour, linewidth=0.9)
        draw_truth(upper, 0.0, label=None)
        upper.set(ylabel="penetration [mm]", title="Into the material", ylim=(-1.5, 18.5))
        upper.legend(loc="upper right", ncols=4)
        lower.set(xlabel="time [s]", ylabel="lag [mm]", title="Command minus what was reached")
        lower.set_xlim(time[0], time[-1])

    def tables(self, say: Say) -> tuple[Table, ...]:
        """How each material is penetrated."""
        columns = {
            "mean depth, mm": "mean depth {}",
            "least depth, mm": "least depth {}",
            "peak speed, mm/s": "peak speed {}",
            "lag, rms, mm": "rms lag {}",
            "peak force, N": "peak force {}",
            "force bias left, mN": "bias left {}",
            "largest s.e. of VP, %": "largest error {}",
        }
        rows = {(LABELS[name],): (name,) for name in MATERIALS}
        note = (
            "Median over the seeds, range in brackets. Peak speed commanded: "
            f"{1e3 * _commanded_speed():.1f} mm/s. VP is variable projection, after 10 s."
        )
        title = "How the trajectory is followed"
        return (Table.of(say, title, ("material",), columns, rows, note),)


def _numbers(name: str, measurement: Measurement) -> dict[str, float]:
    truth, command, contact = measurement.truth, measurement.command, measurement.contact
    whole = truth.time >= THREE_SINES.pause + THREE_SINES.approach
    depth = truth.penetration[whole]
    lag = command.penetration[whole] - depth
    found = identified(contact.window(START), VariableProjection())
    relative = found.estimate.standard_errors / found.law.parameters
    return {
        f"mean depth {name} [mm]": 1e3 * depth.mean(),
        f"least depth {name} [mm]": 1e3 * depth.min(),
        f"peak speed {name} [mm/s]": 1e3 * np.abs(truth.velocity[whole]).max(),
        f"rms lag {name} [mm]": 1e3 * np.sqrt(np.mean(lag**2)),
        f"peak force {name} [N]": truth.force.max(),
        f"bias left {name} [mN]": 1e3 * np.mean(contact.force[whole] - truth.force[whole]),
        f"largest error {name} [%]": 100.0 * relative.max(),
    }


def _commanded_speed() -> float:
    """m/s, over one period of the sines."""
    time: Floats = np.arange(0.0, 2.0 * np.pi, 1e-4)
    return float(np.abs(THREE_SINES.motion.at(time)[1]).max())


EXPERIMENTS = (TrajectoryFollowed(),)
