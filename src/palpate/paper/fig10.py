"""Fig. 10: the loop of force over penetration, and the force that a linear model pulls with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.contact import Contact
from palpate.estimators import ContactEstimator, KelvinVoigtRLS, SingleStageRLS, VariableProjection
from palpate.figures.style import LIGHT as THEME
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, Bench, Homogeneous, IdealProbe, Probing
from palpate.lab.trajectories import NEAR_SURFACE
from palpate.paper.experiment import Curves, Experiment, Outcome, Say, Table
from palpate.paper.panels import Axes, Figure, draw_lines, draw_truth
from palpate.paper.quantities import Numbers, over_seeds
from palpate.paper.sessions import START, identified, pressed, session
from palpate.validation import Floats

#: From here on the approach is over, s.
SINES = 2.5
#: What is drawn of the loop, and of the motion, s.
DRAWN, MOTION = (2.5, 12.0), (4.0, 8.0)
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "Kelvin–Voigt": KelvinVoigtRLS,
    "single stage": SingleStageRLS,
    "variable projection": VariableProjection,
}
LINEAR = next(iter(METHODS))
LAW: HuntCrossley = BALL.law  # type: ignore[assignment]  # the ball is one
DAMPED = HuntCrossley(LAW.stiffness, 3.0 * LAW.damping, LAW.exponent)


@dataclass(frozen=True)
class Hysteresis(Experiment):
    """A motion that comes near the ball's surface, and the forces that models predict there."""

    name: str = "fig10"
    title: str = "Rubber ball, near the surface: force over penetration"
    caption = (
        "The motion; force over penetration; the same without its linear spring, which tapers to "
        "the surface as Hunt–Crossley does and Kelvin–Voigt does not; and the last millimetre, "
        "where Kelvin–Voigt pulls."
    )
    size: tuple[float, float] = (10.5, 7.6)

    def measure(self, seed: int) -> tuple[Numbers, Curves]:
        """Press near the surface, deep, slowly, and a ball of more damping."""
        contact = pressed("ball", "near-surface", seed)
        truth = session("ball", "near-surface", seed).truth.window(START)
        inside = _inside(contact)
        numbers = {
            "least force measured [N]": contact.force[inside].min(),
            "least force felt [N]": truth.force[inside].min(),
            "least force 10 mm deep [N]": _least(pressed("ball", "three-sines", seed)),
            "least force, ideal probe, as it is [N]": _ideal(LAW, 1.0, seed),
            "least force, ideal probe, half the speed [N]": _ideal(LAW, 0.5, seed),
            "least force, ideal probe, three times the damping [N]": _ideal(DAMPED, 1.0, seed),
        }
        keep = np.flatnonzero((contact.time > DRAWN[0]) & (contact.time < DRAWN[1]))[::3]
        curves = {
            "time": contact.time[keep],
            "penetration": contact.penetration[keep],
            "force": np.where(inside, contact.force, np.nan)[keep],
        }
        for name, estimator in METHODS.items():
            result = identified(contact, estimator())
            force = result.law.force(contact.penetration, contact.velocity)
            numbers |= _summary(name, result, force, inside)
            curves[f"predicted/{name}"] = np.where(inside, force, np.nan)[keep]
        return numbers, curves

    def draw(self, figure: Figure, outcomes: Sequence[Outcome]) -> None:
        """Draw the first outcome; the last panel's title gives the least force of all seeds."""
        first = outcomes[0]
        (motion, loop), (viscous, near) = figure.subplots(2, 2)
        depth = 1e3 * np.array(first.curves["penetration"])
        motion.plot(first.curves["time"], depth, color=THEME.measured)
        draw_truth(motion, 0.0)
        motion.set(xlabel="time [s]", ylabel="penetration [mm]", title="Motion", xlim=MOTION)
        _draw_loop(loop, first, (LINEAR,))
        loop.set(ylabel="force [N]", title="Force–penetration loop")
        loop.legend(loc="upper left")
        _draw_loop(viscous, first, tuple(METHODS), first.numbers[f"stiffness {LINEAR} [N/m]"])
        viscous.set(ylabel="force − K̂ x [N]", ylim=(-0.75, 0.75))
        viscous.set_title("Without the spring K̂ x: what is measured tapers to the surface")
        _draw_loop(near, first, tuple(METHODS))
        near.set(ylabel="force [N]", xlim=(-0.03, 0.8), ylim=(-0.35, 1.8))
        least = over_seeds([outcome.numbers for outcome in outcomes], f"least force {LINEAR}")
        near.set_title(f"Near the surface: {LINEAR} down to {least} N")
        near.legend(loc="upper left")

    def tables(self, say: Say) -> tuple[Table, ...]:
        """Return the least force of each model, and the work it would have the robot do."""
        columns = {
            "least force [N]": "least force {}",
            "time pulling [%]": "time pulling {}",
            "energy given [mJ]": "energy given {}",
            "RMSE%": "rmse {}",
        }
        rows = [(name,) for name in METHODS]
        note = "The final law along the measured motion, samples inside the material from 2.5 s on."
        return (Table.of(say, "Near the surface", ("model",), columns, rows, note),)


def _inside(contact: Contact) -> NDArray[np.bool_]:
    return np.asarray((contact.penetration > 0.0) & (contact.time > SINES), dtype=np.bool_)


def _summary(
    name: str, result: Identification, force: Floats, inside: NDArray[np.bool_]
) -> dict[str, float]:
    contact = result.contact
    pulls = inside & (force < 0.0)
    # Force and velocity both outward: the robot would have to pull the material along.
    power = np.where(pulls & (contact.velocity < 0.0), force * contact.velocity, 0.0)
    return {
        f"least force {name} [N]": force[inside].min(),
        f"time pulling {name} [%]": 100.0 * pulls.sum() / inside.sum(),
        f"energy given {name} [mJ]": 1e3 * np.dot(power, contact.time_steps),
        f"rmse {name} [%]": result.prediction_rmse_percent,
        f"stiffness {name} [N/m]": result.law.parameters[0],
    }


def _least(contact: Contact) -> float:
    """Least force of an identified Kelvin–Voigt law along a motion, N."""
    law = identified(contact, KelvinVoigtRLS()).law
    inside = _inside(contact)
    return float(law.force(contact.penetration, contact.velocity)[inside].min())


def _ideal(law: HuntCrossley, speed: float, seed: int) -> float:
    """The same of an ideal probe, with the near-surface motion at a share of its speed."""
    motion = NEAR_SURFACE.motion
    slower = tuple(speed * frequency for frequency in motion.frequencies)
    trajectory = Probing(type(motion)(motion.depth, motion.amplitudes, slower))
    bench = Bench(Homogeneous(law), trajectory, IdealProbe())
    return _least(bench.run(seed, seconds=START + 10.0 / speed).contact.window(START))


def _draw_loop(
    axes: Axes, outcome: Outcome, methods: Sequence[str], stiffness: float = 0.0
) -> None:
    """Force over penetration, less a spring's."""
    depth = np.array(outcome.curves["penetration"])
    spring = stiffness * depth
    measured = np.array(outcome.curves["force"]) - spring
    axes.plot(1e3 * depth, measured, color=THEME.measured, linewidth=1.6, label="measured")
    predicted = {name: np.array(outcome.curves[f"predicted/{name}"]) - spring for name in methods}
    draw_lines(axes, 1e3 * depth, predicted, linewidth=0.9)
    draw_truth(axes, 0.0, None)
    axes.set(xlabel="penetration [mm]")


EXPERIMENTS = (Hysteresis(),)
