"""Fig. 10: the loop of force over penetration, and the force that a linear model pulls with."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import ContactEstimator, KelvinVoigtRLS, SingleStageRLS, VariableProjection
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, Bench, Homogeneous, IdealProbe, Probing
from palpate.lab.trajectories import NEAR_SURFACE
from palpate.paper.curves import median_and_range, plain
from palpate.paper.experiment import Claim, Finding, Outcome, Table
from palpate.paper.hysteresis.figure import draw_hysteresis
from palpate.paper.judged import Curves, Judged, JudgedExperiment, Numbers
from palpate.paper.sessions import START, pressed, session
from palpate.paper.starts import identified
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: From here on the approach is over, s.
SINES = 2.5
#: What is drawn of the loop, s.
DRAWN = (2.5, 12.0)
# Made when they are wanted: what a module holds may outlive the compiled module at the end.
METHODS: dict[str, Callable[[], ContactEstimator]] = {
    "Kelvin–Voigt": KelvinVoigtRLS,
    "single stage": SingleStageRLS,
    "variable projection": VariableProjection,
}
LAW: HuntCrossley = BALL.law  # type: ignore[assignment]  # the ball is one
DAMPED = HuntCrossley(LAW.stiffness, 3.0 * LAW.damping, LAW.exponent)


class Hysteresis(JudgedExperiment):
    """A motion that comes near the ball's surface, and the forces that models predict there."""

    caption = (
        "The motion; force over penetration; the same without its linear spring, which "
        "tapers to the surface as Hunt–Crossley does and Kelvin–Voigt does not; and the "
        "last millimetre, where Kelvin–Voigt pulls."
    )

    def __init__(self) -> None:
        super().__init__(
            "fig10",
            "Rubber ball, near the surface: force over penetration",
            HYSTERESIS_CLAIMS,
        )

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Press near the surface, deep, slowly, and a ball of more damping."""
        contact = pressed("ball", "near-surface", seed)
        truth = session("ball", "near-surface", seed).truth.window(START)
        inside = _inside(contact)
        numbers: dict[str, Any] = {
            "least measured": float(contact.force[inside].min()),
            "least true": float(truth.force[inside].min()),
            "methods": {},
        }
        keep = np.flatnonzero((contact.time > DRAWN[0]) & (contact.time < DRAWN[1]))[::3]
        curves: Curves = {
            "time": plain(contact.time[keep]),
            "penetration": plain(contact.penetration[keep]),
            "velocity": plain(contact.velocity[keep]),
            "force": plain(np.where(inside, contact.force, np.nan)[keep]),
        }
        for name, estimator in METHODS.items():
            result = identified(contact, estimator())
            force = result.law.force(contact.penetration, contact.velocity)
            numbers["methods"][name] = _summary(result, contact, force, inside)
            curves[f"predicted/{name}"] = plain(np.where(inside, force, np.nan)[keep])
        numbers["deep"] = _least(pressed("ball", "three-sines", seed))
        numbers["half the speed"] = _ideal(LAW, 0.5, seed)
        numbers["as it is"] = _ideal(LAW, 1.0, seed)
        numbers["three times the damping"] = _ideal(DAMPED, 1.0, seed)
        return numbers, curves

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the penetration, and the loops measured and predicted."""
        return draw_hysteresis(self.title, tuple(METHODS), outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return the least force of each model, and the work it would have the robot do."""
        rows = []
        for name in METHODS:
            every = [outcome.numbers["methods"][name] for outcome in outcomes]
            rows.append(
                (
                    name,
                    median_and_range(n["least"] for n in every),
                    median_and_range((n["negative"] for n in every), ".2g"),
                    median_and_range((n["given"] for n in every), ".2g"),
                    median_and_range((n["fit"] for n in every), ".2g"),
                )
            )
        header = ("model", "least force [N]", "time pulling [%]", "energy given [mJ]", "RMSE%")
        note = "The final law along the measured motion, samples inside the material from 2.5 s on."
        return (Table("Near the surface", header, tuple(rows), note),)


def _inside(contact: Contact) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return np.asarray((contact.penetration > 0.0) & (contact.time > SINES), dtype=np.bool_)


def _summary(
    result: Identification, contact: Contact, force: Floats, inside: Any
) -> dict[str, float]:
    pulls = inside & (force < 0.0)
    # Force and velocity both outward: the robot would have to pull the material along.
    power = np.where(pulls & (contact.velocity < 0.0), force * contact.velocity, 0.0)
    return {
        "least": float(force[inside].min()),
        "negative": float(100.0 * pulls.sum() / inside.sum()),
        "given": float(1e3 * np.dot(power, contact.time_steps)),
        "fit": result.prediction_rmse_percent,
        "stiffness": float(result.law.parameters[0]),
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


def negative_force(numbers: Numbers) -> Finding:
    """Kelvin–Voigt pulls near the surface."""
    least = numbers["methods"]["Kelvin–Voigt"]["least"]
    others = ", ".join(
        f"{name} {numbers['methods'][name]['least']:.2g} N"
        for name in ("single stage", "variable projection")
    )
    return Finding(least < 0.0, least, f"least predicted force {least:.2g} N; {others}")


def always_positive(numbers: Numbers) -> Finding:
    """The true force never pulls."""
    true, measured = numbers["least true"], numbers["least measured"]
    words = f"least force felt {true:.2g} N; as the noisy sensor shows it {measured:.2g} N"
    return Finding(true >= 0.0, true, words)


def power(numbers: Numbers) -> Finding:
    """While it pulls, the model takes power from the robot."""
    given = numbers["methods"]["Kelvin–Voigt"]["given"]
    hunt = numbers["methods"]["single stage"]["given"]
    words = f"Kelvin–Voigt {given:.2g} mJ in 10 s, Hunt–Crossley {hunt:.2g} mJ"
    return Finding(given > 0.0 >= hunt, given, words)


def damping_and_speed(numbers: Numbers) -> Finding:
    """Less speed lessens the pull, more damping strengthens it."""
    slow, base = numbers["half the speed"], numbers["as it is"]
    damped = numbers["three times the damping"]
    words = (
        f"least force, ideal probe: {base:.2g} N; at half the speed {slow:.2g} N; with three times "
        f"the damping {damped:.2g} N"
    )
    return Finding(damped < base < slow, damped, words)


def deep_enough(numbers: Numbers) -> Finding:
    """About 10 mm deep the model does not pull."""
    least = numbers["deep"]
    return Finding(least > 0.0, least, f"least predicted force about 10 mm deep: {least:.3g} N")


HYSTERESIS_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "negative-force",
            "V-A-5, Fig. 10",
            "One potential shortcoming of KV models is the negative predicted force when the probe "
            "reaches close to the environment surface as it moves in the outward direction at a "
            "high velocity.",
            unit="N",
            assumption="x₀ = 3.8 mm, ours; the final law along the measured motion",
            measured="least force of the law",
        ),
        negative_force,
    ),
    (
        Claim(
            "always-positive",
            "V-A-5, Fig. 10",
            "However, in reality, the force exerted on any environment is always positive during "
            "the compression and rebound phases.",
            unit="N",
            assumption="the laboratory's materials do not stick, by construction",
            measured="least force felt",
        ),
        always_positive,
    ),
    (
        Claim(
            "power",
            "V-A-5",
            "Such behavior leads to power transfer from the robot to the environment during the "
            "restitution phase, which is in contrast with human intuition.",
            unit="mJ",
            assumption="∫ F v dt where the predicted force and the velocity both point outward",
            measured="energy given in 10 s",
        ),
        power,
    ),
    (
        Claim(
            "damping-and-speed",
            "V-A-5",
            "This problem primarily occurs in systems with higher damping at high speeds.",
            unit="N",
            assumption="half the speed, and three times the damping, of the same motion and ball",
            measured="least force with three times the damping",
        ),
        damping_and_speed,
    ),
    (
        Claim(
            "deep-enough",
            "V-A-5",
            "To avoid the negative force effect in all experiments described throughout the paper, "
            "with the exception of the aforementioned results, we have considered a sufficiently "
            "large x₀.",
            "10 mm",
            "N",
            measured="least force of the law",
        ),
        deep_enough,
    ),
)


HYSTERESIS = (Hysteresis(),)
