"""What a report holds: experiments, claims, and what was chosen where the paper says nothing."""

import os
import platform
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from palpate.estimators import SingleStageRLS
from palpate.lab import MATERIALS, TRAJECTORIES, Palpation, Probing, Sensors
from palpate.paper.experiment import Experiment, Outcome, Table
from palpate.paper.outcomes import versions
from palpate.paper.report.verdicts import Judgement, Verdict, judgements
from palpate.paper.sessions import GATE, START

TITLE = "Haddadi & Hashtrudi-Zaad (2012), run again"
ABOUT = (
    "Every experiment of “Real-Time Identification of Hunt–Crossley Dynamic Models of Contact "
    "Environments” (IEEE Transactions on Robotics 28(3), 2012), on a simulated twin pantograph "
    "that presses simulated materials. The paper's tables and the curves of its figures are lost "
    "to us; its words are not. Everything shown here is ours, and each sentence of the paper that "
    "can be held against it is. Each experiment also shows variable projection, which the paper "
    "does not have."
)


@dataclass(frozen=True, slots=True)
class Section:
    """An experiment of the report, with all its seeds."""

    experiment: Experiment
    outcomes: tuple[Outcome, ...]
    tables: tuple[Table, ...]
    judgements: tuple[Judgement, ...]
    drawn: bool

    @classmethod
    def of(
        cls, experiment: Experiment, outcomes: Sequence[Outcome], drawn: bool = True
    ) -> "Section":
        """Tabulate and judge what an experiment measured."""
        tables, judged = experiment.tabulated(outcomes), judgements(experiment, outcomes)
        return cls(experiment, tuple(outcomes), tables, judged, drawn)


@dataclass(frozen=True, slots=True)
class Report:
    """What is finished of the experiments asked for."""

    sections: tuple[Section, ...]
    seeds: int
    unfinished: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def judgements(self) -> tuple[Judgement, ...]:
        """Every claim of every section."""
        return tuple(each for section in self.sections for each in section.judgements)

    @property
    def counts(self) -> dict[Verdict, int]:
        """How many claims got which verdict."""
        found = Counter(judgement.verdict for judgement in self.judgements)
        return {verdict: found[verdict] for verdict in Verdict}

    @property
    def summary(self) -> str:
        """The counts in words."""
        parts = (f"{count} {verdict.value}" for verdict, count in self.counts.items())
        return f"{len(self.judgements)} claims: {', '.join(parts)}"


def circumstances() -> dict[str, str]:
    """Return when and on what this was made."""
    machine = f"{platform.system()} on {platform.machine()}, {os.cpu_count()} processors"
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    named = ", ".join(f"{name} {number}" for name, number in versions().items())
    return {"made": made, "machine": machine, "versions": named}


def settings() -> tuple[Table, ...]:
    """Return what the paper leaves open, and what was chosen."""
    single = SingleStageRLS()
    gate = (
        f"penetration > {1e3 * GATE.minimum_penetration:g} mm and force > {GATE.make_force:g} N, "
        f"until force ≤ {GATE.break_force:g} N"
    )
    chosen = (
        ("clock", f"the command leaves its pause at {START:g} s; identification starts there"),
        ("samples taken as contact", gate),
        ("units of the estimators", "SI, as in the paper"),
        ("P₀ of the single stage, of [ln K, B/K, n]", f"{single.settings['initial_covariance']:g}"),
        ("forgetting", "λ(t) = 1 − 0.01 exp(−5 (t − contact)), the paper's"),
        ("start, set I", "K = {:g}, B = {:g}, n = {:g}".format(*single.default_initial.parameters)),
        ("sensors", Sensors().describe()),
        ("variable projection", "same samples, no starts, no forgetting, offset estimated"),
    )
    laws = tuple((name, _in_words(material.describe())) for name, material in MATERIALS.items())
    motions = tuple(
        (name, _motion(trajectory))
        for name, trajectory in TRAJECTORIES.items()
        if isinstance(trajectory, Probing | Palpation)
    )
    ours = "Within the orders of magnitude that the paper's text gives; its tables are lost."
    return (
        Table("How the experiments are set", ("setting", "value"), chosen),
        Table("The materials, ours", ("material", "truth, SI"), laws, ours),
        Table("The motions", ("motion", "command"), motions),
    )


def _motion(trajectory: Probing | Palpation) -> str:
    if isinstance(trajectory, Palpation):
        return (
            f"{_motion(trajectory.probing)}; after {trajectory.dwell:g} s, and so on, "
            f"{1e3 * trajectory.distance:g} mm sideways in {trajectory.shift:g} s"
        )
    motion = trajectory.motion
    sines = zip(motion.amplitudes, motion.frequencies, strict=True)
    waves = " + ".join(f"{1e3 * size:g} sin {rate:g} t" for size, rate in sines)
    return (
        f"{1e3 * motion.depth:g} + {waves} mm, t from {trajectory.pause + trajectory.approach:g} s "
        f"on; a pause of {trajectory.pause:g} s, {1e3 * trajectory.clearance:g} mm above"
    )


def _in_words(truth: Any) -> str:
    """What a material says of itself: a number, words, or several by name."""
    if isinstance(truth, dict):
        named = {key.replace("_", " "): _in_words(value) for key, value in truth.items()}
        return ", ".join(v if key == "kind" else f"{key} {v}" for key, v in named.items())
    if isinstance(truth, list):
        return "; ".join(map(_in_words, truth))
    return f"{truth:g}" if isinstance(truth, float) else str(truth)
