"""Fig. 7: how the past is forgotten, and how large the first covariance is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.estimators import SingleStageRLS, VariableProjection
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.lab import BALL, THREE_SINES, Bench, Command, IdealProbe, Trajectory
from palpate.paper.curves import median_and_range, plain, traced
from palpate.paper.experiment import Outcome, Table
from palpate.paper.forgetting.claims import FORGETTING_CLAIMS
from palpate.paper.forgetting.figure import draw_forgetting
from palpate.paper.judged import Curves, JudgedExperiment
from palpate.paper.sessions import START, pressed
from palpate.paper.starts import identified, starts_of, times_to
from palpate.settings import ConstantForgetting, FadingForgetting, Forgetting
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROFILES: dict[str, Forgetting] = {
    "λ = 1": ConstantForgetting(1.0),
    "α = 0.1": FadingForgetting(0.99, 0.1),
    "α = 1": FadingForgetting(0.99, 1.0),
    "α = 5": FadingForgetting(0.99, 5.0),
    "α = 6": FadingForgetting(0.99, 6.0),
    "α = 7": FadingForgetting(0.99, 7.0),
    "α = 8": FadingForgetting(0.99, 8.0),
    "α = 20": FadingForgetting(0.99, 20.0),
    "λ = 0.99": ConstantForgetting(0.99),
    "λ = 0.95": ConstantForgetting(0.95),
    "λ = 0.9": ConstantForgetting(0.9),
}
COVARIANCES = (1.0, 10.0, 20.0, 1e2, 1e3, 1e4, 1e6)
HELD = ("α = 5", "α = 0.1", "λ = 0.99", "λ = 0.9")
HOLD_FROM, HELD_SECONDS = 8.0, 60.0
LAW: HuntCrossley = BALL.law  # type: ignore[assignment]  # the ball is one


@dataclass(frozen=True, slots=True)
class Held:
    """A trajectory that stops where its speed is next zero, and stays there.

    Parameters
    ----------
    trajectory : Trajectory
        What is followed until then.
    after : float
        s.
    """

    trajectory: Trajectory
    after: float

    @property
    def pause(self) -> float:
        """Time at rest before anything moves, s."""
        return self.trajectory.pause

    @property
    def stop(self) -> float:
        """When the probe stops, s."""
        time = self.after + 1e-4 * np.arange(20_000, dtype=np.float64)
        turns = np.flatnonzero(np.diff(np.sign(self.trajectory.at(time).velocity)))
        return float(time[turns[0]])

    def at(self, time: Floats) -> Command:
        """Return the command at times [s], shape (k,)."""
        stop = self.stop
        command = self.trajectory.at(np.minimum(time, stop))
        moving = time < stop
        return Command(
            command.penetration,
            np.where(moving, command.velocity, 0.0),
            command.lateral_position,
            np.where(moving, command.lateral_velocity, 0.0),
        )


class ForgettingFactors(JudgedExperiment):
    """The single stage on the ball under several forgetting factors and initial covariances."""

    caption = (
        "Left: K, B and n over time for several forgetting factors. Right: the same for "
        "several initial covariances. Below: a probe held at one depth, and convergence "
        "and overshoot of every seed over the initial covariance."
    )

    def __init__(self) -> None:
        super().__init__(
            "fig07",
            "Rubber ball, single stage: forgetting factor and initial covariance",
            FORGETTING_CLAIMS,
        )

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Identify one recording again and again, and a probe that is held."""
        contact = pressed("ball", "three-sines", seed)
        numbers: dict[str, Any] = {"profiles": {}, "covariances": {}, "starts": {}, "held": {}}
        curves: Curves = {}
        for name, forgetting in PROFILES.items():
            result = identified(contact, SingleStageRLS(forgetting=forgetting))
            numbers["profiles"][name] = _summary(result)
            curves |= traced(f"profile/{name}", result)
        result = identified(contact, VariableProjection())
        numbers["profiles"]["variable projection"] = _summary(result)
        curves |= traced("profile/variable projection", result)
        for variance in COVARIANCES:
            result = identified(contact, SingleStageRLS(initial_covariance=variance))
            numbers["covariances"][f"{variance:g}"] = _summary(result)
            curves |= traced(f"covariance/{variance:g}", result)
        for name, law in starts_of(contact, SingleStageRLS).items():
            result = identified(contact, SingleStageRLS(initial=law))
            numbers["starts"][name] = _summary(result)
        held, more = _held(seed)
        numbers["held"] = held
        return numbers, curves | more

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw parameters over time: by forgetting, by initial covariance, and held."""
        return draw_forgetting(self.title, outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return times and fluctuations by forgetting factor, and by initial covariance."""
        header = ("", "K [s]", "B [s]", "n [s]", "late scatter of B [%]", "overshoot of B", "RMSE%")
        note = (
            "Seconds of contact until each parameter is within 5 % of the truth for good; scatter: "
            "standard deviation over the second half; overshoot: largest excursion beyond start "
            "and truth, in units of the truth."
        )
        return (
            Table("Forgetting factor", header, _rows("profiles", outcomes), note),
            Table("Initial covariance, α = 5", header, _rows("covariances", outcomes), note),
        )


def _rows(what: str, outcomes: Sequence[Outcome]) -> tuple[tuple[str, ...], ...]:
    rows = []
    for name in outcomes[0].numbers[what]:
        every = [outcome.numbers[what][name] for outcome in outcomes]
        times = [median_and_range((n["times"][i] for n in every), ".2g") for i in range(3)]
        scatter = median_and_range((n["scatter"][1] for n in every), ".2g")
        overshoot = median_and_range((n["overshoot"][1] for n in every), ".2g")
        rmse = median_and_range((n["rmse"] for n in every), ".2g")
        label = f"P₀ = {name}" if what == "covariances" else name
        rows.append((label, *times, scatter, overshoot, rmse))
    return tuple(rows)


def _summary(result: Identification) -> dict[str, Any]:
    known = result.trace.parameters[result.trace.taken]
    truth = LAW.parameters
    start = result.estimator.settings.get("initial", LAW).parameters
    low, high = np.minimum(start, truth), np.maximum(start, truth)
    beyond = np.maximum(known.max(axis=0) - high, low - known.min(axis=0)).clip(min=0.0)
    late = known[len(known) // 2 :] / truth - 1.0
    return {
        "times": plain(times_to(result, truth)),
        "scatter": plain(100.0 * late.std(axis=0)),
        "largest": plain(100.0 * np.abs(late).max(axis=0)),
        "overshoot": plain(beyond / truth),
        "rmse": result.prediction_rmse_percent,
    }


def _held(seed: int) -> tuple[dict[str, Any], Curves]:
    """Largest relative error of a parameter while the probe is held, and how many were guarded."""
    trajectory = Held(THREE_SINES, HOLD_FROM)
    measurement = Bench(BALL, trajectory, IdealProbe()).run(seed, seconds=HOLD_FROM + HELD_SECONDS)
    contact = measurement.contact.window(START)
    late = contact.time > trajectory.stop
    keep = np.flatnonzero(late)[::60]
    curves: Curves = {"held/time": plain(contact.time[keep] - trajectory.stop)}
    numbers = {}
    for name in HELD:
        result = identified(contact, SingleStageRLS(forgetting=PROFILES[name]))
        error = np.abs(result.trace.parameters / LAW.parameters - 1.0)
        numbers[name] = {
            "largest": plain(100.0 * error[late].max(axis=0)),
            "at the end": plain(100.0 * error[-1]),
            "guarded": int(result.estimate.guarded),
        }
        curves[f"held/{name}"] = plain(100.0 * error[keep].max(axis=1))
    return numbers, curves


FORGETTING = (ForgettingFactors(),)
