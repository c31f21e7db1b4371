"""What becomes of the claims over the seeds, as JSON and as a table; ``page.py`` has the page."""

import enum
import json
import math
import os
import platform
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import palpate
from palpate import lab
from palpate.paper.experiment import Claim, Experiment, Outcome, Table, claims_file
from palpate.paper.judging import Finding, said
from palpate.paper.rig import GATE, START
from palpate.writing import write_text

TITLE = "Haddadi & Hashtrudi-Zaad (2012), run again"
JSON, MARKDOWN = "report.json", "claims.md"


class Verdict(enum.Enum):
    """What the seeds say together."""

    REPRODUCED = "reproduced"
    PARTLY = "partly reproduced"
    NOT_REPRODUCED = "not reproduced"
    UNCHECKED = "cannot be checked"


#: Beside the words, so that no verdict is told by its colour alone.
SIGNS = dict(zip(Verdict, "✓◐✗–", strict=True))


def verdict_of(held: int, checked: int) -> Verdict:
    """Reproduced or not: in all seeds, or claims, that could tell; partly: in some of them."""
    if not checked:
        return Verdict.UNCHECKED
    if held == checked:
        return Verdict.REPRODUCED
    return Verdict.PARTLY if held else Verdict.NOT_REPRODUCED


@dataclass(frozen=True, slots=True)
class Judgement:
    """A claim of an experiment, a finding for each seed, and in words what else was seen."""

    experiment: str
    claim: Claim
    findings: tuple[Finding, ...]
    words: str = ""

    @property
    def checked(self) -> int:
        """Seeds that could tell."""
        return sum(finding.holds is not None for finding in self.findings)

    @property
    def held(self) -> int:
        """Seeds in which it holds."""
        return sum(finding.holds is True for finding in self.findings)

    @property
    def verdict(self) -> Verdict:
        """Of all seeds together."""
        return verdict_of(self.held, self.checked)

    @property
    def verdict_words(self) -> str:
        """The verdict, with the count of seeds where they differ."""
        if self.verdict is Verdict.PARTLY:
            return f"reproduced in {self.held} of {self.checked} seeds"
        if 0 < self.checked < len(self.findings):
            return f"{self.verdict.value} ({self.checked} of {len(self.findings)} seeds can tell)"
        return str(self.verdict.value)

    @property
    def ours(self) -> tuple[float, float, float] | None:
        """Median, least and largest of what was measured; None where nothing was."""
        every = (math.nan if each.ours is None else each.ours for each in self.findings)
        known = [each for each in every if math.isfinite(each)]
        return (statistics.median(known), min(known), max(known)) if known else None

    @property
    def ours_words(self) -> str:
        """What was measured, with its unit; the range over the seeds in brackets."""
        return "" if self.ours is None else said(self.ours, self.claim.unit)

    @property
    def remark(self) -> str:
        """What the words are taken to mean, and on what that depends."""
        parts = (part.removesuffix(".") for part in (self.claim.reading, self.claim.depends))
        return " ".join(f"{part[:1].upper()}{part[1:]}." for part in parts if part)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and words."""
        ours = dict(zip(("median", "least", "largest"), self.ours or (), strict=False))
        return {
            "experiment": self.experiment,
            **asdict(self.claim),
            "verdict": self.verdict.value,
            "seeds_checked": self.checked,
            "seeds_held": self.held,
            "ours": ours or None,
            "seen": self.words,
        }


@dataclass(frozen=True)
class Section:
    """An experiment of the report, with all its seeds; whether its figure is there."""

    experiment: Experiment
    outcomes: Sequence[Outcome]
    drawn: bool = True

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """The experiment's, filled in."""
        return self.experiment.tabulated(self.outcomes)

    @cached_property
    def judgements(self) -> tuple[Judgement, ...]:
        """What the outcomes say of each claim."""
        every = [outcome.numbers for outcome in self.outcomes]
        name, judges = self.experiment.name, self.experiment.judges
        return tuple(
            Judgement(name, claim, tuple(map(judge, every)), judge.words(every))
            for claim in self.experiment.claims
            for judge in (judges[claim.key],)
        )

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and words."""
        experiment = self.experiment
        outcomes = [
            {
                "seed": outcome.seed,
                "numbers": {name: _plain(value) for name, value in outcome.numbers.items()},
                "findings": {
                    key: {"holds": found.holds, "ours": _plain(found.ours)}
                    for key, found in experiment.findings(outcome).items()
                },
            }
            for outcome in self.outcomes
        ]
        return {
            "name": experiment.name,
            "title": experiment.title,
            "caption": experiment.caption,
            "figure": f"{experiment.name}.svg" if self.drawn else None,
            "tables": [asdict(table) for table in self.tables],
            "outcomes": outcomes,
        }


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
        found = [judgement.verdict for judgement in self.judgements]
        return {verdict: found.count(verdict) for verdict in Verdict}

    @property
    def summary(self) -> str:
        """The counts in words."""
        parts = (f"{count} {verdict.value}" for verdict, count in self.counts.items())
        return f"{len(self.judgements)} claims: {', '.join(parts)}"


def abstract(judgements: Sequence[Judgement]) -> Iterator[tuple[str, str, int, int]]:
    """Sum up judgements in ten lines; what was not run is left out.

    Each is several claims in one sentence, why some of them do not reproduce, and how many do in
    every seed, of how many that can be checked.
    """
    known = {f"{each.experiment}.{each.claim.key}": each.verdict for each in judgements}
    for line in claims_file()["abstract"].values():
        verdicts = [known[key] for key in line["claims"].split() if key in known]
        checked = [verdict for verdict in verdicts if verdict is not Verdict.UNCHECKED]
        if checked:
            held = checked.count(Verdict.REPRODUCED)
            yield line["words"], line["because"], held, len(checked)


def not_held() -> dict[str, list[list[str]]]:
    """Return section and words of each sentence that is not judged, by the reason why not."""
    groups = claims_file()["not-held"]
    return {each["why"]: [w.split(" ", 1) for w in each["words"].splitlines()] for each in groups}


def versions() -> dict[str, str]:
    """Return the versions of what the numbers depend on."""
    from importlib.metadata import version

    names = ("palpate", "numpy", "scipy", "mujoco", "matplotlib")
    return {"Python": platform.python_version()} | {name: version(name) for name in names}


def circumstances() -> dict[str, str]:
    """Return when and on what this was made."""
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "machine": f"{platform.system()} on {platform.machine()}, {os.cpu_count()} processors",
        "versions": ", ".join(f"{name} {number}" for name, number in versions().items()),
    }


def settings() -> tuple[Table, ...]:
    """Return what the paper leaves open, and what was chosen."""
    single = palpate.SingleStageRLS()
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
        ("sensors", lab.Sensors().describe()),
        ("variable projection", "same samples, no starts, no forgetting, offset estimated"),
    )
    laws = tuple((name, _in_words(each.describe())) for name, each in lab.MATERIALS.items())
    described = ((name, _motion(each)) for name, each in lab.TRAJECTORIES.items())
    ours = "Within the orders of magnitude that the paper's text gives; its tables are lost."
    return (
        Table("How the experiments are set", ("setting", "value"), chosen),
        Table("The materials, ours", ("material", "truth, SI"), laws, ours),
        Table("The motions", ("motion", "command"), tuple(each for each in described if each[1])),
    )


def _motion(trajectory: Any) -> str:
    if isinstance(trajectory, lab.Palpation):
        return (
            f"{_motion(trajectory.probing)}; after {trajectory.dwell:g} s, and so on, "
            f"{1e3 * trajectory.distance:g} mm sideways in {trajectory.shift:g} s"
        )
    if not isinstance(trajectory, lab.Probing):
        return ""
    motion = trajectory.motion
    sines = zip(motion.amplitudes, motion.frequencies, strict=True)
    waves = " + ".join(f"{1e3 * size:g} sin {rate:g} t" for size, rate in sines)
    return (
        f"{1e3 * motion.depth:g} + {waves} mm, t from {trajectory.pause + trajectory.approach:g} s "
        f"on; a pause of {trajectory.pause:g} s, {1e3 * trajectory.clearance:g} mm above"
    )


def _in_words(truth: Any) -> str:
    """What a material says of itself: a number, words, or several by name."""
    if isinstance(truth, Mapping):
        named = {key.replace("_", " "): _in_words(value) for key, value in truth.items()}
        return ", ".join(v if key == "kind" else f"{key} {v}" for key, v in named.items())
    if isinstance(truth, list):
        return "; ".join(map(_in_words, truth))
    return f"{truth:g}" if isinstance(truth, float) else str(truth)


def write_data(report: Report, folder: Path) -> None:
    """Write ``report.json`` and ``claims.md``, each whole or not at all."""
    whole = {
        "title": TITLE,
        **circumstances(),
        "seeds": report.seeds,
        "unfinished": report.unfinished,
        "failures": report.failures,
        "settings": [asdict(table) for table in settings()],
        "verdicts": {verdict.value: count for verdict, count in report.counts.items()},
        "claims": [judgement.as_dict() for judgement in report.judgements],
        "not_held": not_held(),
        "experiments": [section.as_dict() for section in report.sections],
    }
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1)
    write_text(folder / JSON, text + "\n")
    write_text(folder / MARKDOWN, _markdown(report))


def _plain(value: float | None) -> float | None:
    """A float to nine digits, None for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.9g}")


def _markdown(report: Report) -> str:
    """Return the table of claims, to paste into a document."""
    header = ("figure", "the paper's words", "its number", "ours", "verdict", "read as, depends on")
    rows = [header, ("---",) * len(header)]
    for each in report.judgements:
        claim, number = each.claim, each.ours_words
        if number and claim.measured:
            number = f"{claim.measured}: {number}"
        ours = ". ".join(filter(None, (number, each.words)))
        where, words = f"{each.experiment}; {claim.where}", f"“{claim.words}”"
        rows.append((where, words, claim.number, ours, each.verdict_words, each.remark))
    lines = ["| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |" for cells in rows]
    lines += ["", "Not held against anything:", ""]
    for why, sentences in not_held().items():
        lines.append(f"- **{why}** " + "; ".join(f"“{words}” ({at})" for at, words in sentences))
    return f"{report.summary}; {report.seeds} seeds.\n\n" + "\n".join(lines) + "\n"
