"""The report of the paper's claims over all seeds: a self-contained HTML page, JSON, Markdown."""

import enum
import math
import os
import platform
import re
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import palpate
from palpate import __version__, lab
from palpate.output.reports import html
from palpate.output.reports.html import inline
from palpate.writing import as_json, write_text
from paper.choices import Share, shares
from paper.experiment import Claim, Experiment, Outcome, Seeds, Table, claims_file
from paper.judging import SeedAnswer, format_values
from paper.recordings import measured
from paper.rig import GATE, START

TITLE = "Haddadi & Hashtrudi-Zaad (2012), run again"
ABOUT = (
    "Every experiment of “Real-Time Identification of Hunt–Crossley Dynamic Models of Contact "
    "Environments” (IEEE Transactions on Robotics 28(3), 2012), on a simulated twin pantograph "
    "that presses simulated materials. Of the paper we have only the text, not the tables or the "
    "curves of the figures. All results shown here are ours; every sentence of the paper that can "
    "be tested against them is. Each experiment also shows variable projection, which the paper "
    "does not have."
)


class Reproduction(enum.Enum):
    """The verdict on a claim over all seeds."""

    REPRODUCED = "reproduced"
    PARTLY = "partly reproduced"
    ELSEWHERE = "holds for other values of what the paper leaves open"
    NOT_REPRODUCED = "not reproduced"
    UNCHECKED = "cannot be checked"


#: Signs next to the words, so that colour is not the only mark of a verdict.
SIGNS = dict(zip(Reproduction, "✓◐◇✗–", strict=True))
CLASSES = dict(zip(Reproduction, ("yes", "partly", "partly", "no", "open"), strict=True))


def verdict_of(held: int, checked: int) -> Reproduction:
    """Return whether a claim held in all, some, or none of the seeds that could check it."""
    if not checked:
        return Reproduction.UNCHECKED
    if held == checked:
        return Reproduction.REPRODUCED
    return Reproduction.PARTLY if held else Reproduction.NOT_REPRODUCED


@dataclass(frozen=True, slots=True)
class Judgement:
    """A claim of an experiment, its judgement for each seed, and the other numbers in words."""

    experiment: str
    claim: Claim
    findings: tuple[SeedAnswer, ...]
    text: str = ""
    counted: str = "seeds"  # what the findings are of: seeds or recordings
    share: Share | None = None

    @property
    def anchor(self) -> str:
        """Anchor on the page."""
        return f"{self.experiment}-{self.claim.key}"

    @property
    def checked(self) -> int:
        """Number of seeds that could check the claim."""
        return sum(finding.holds is not None for finding in self.findings)

    @property
    def held(self) -> int:
        """Number of seeds in which it holds."""
        return sum(finding.holds is True for finding in self.findings)

    @property
    def verdict(self) -> Reproduction:
        """Verdict over all seeds, or else over other values of what the paper leaves open."""
        found = verdict_of(self.held, self.checked)
        others = self.share is not None and self.share.enough
        return Reproduction.ELSEWHERE if others and found is Reproduction.NOT_REPRODUCED else found

    @property
    def verdict_text(self) -> str:
        """The verdict, with the number of seeds if they differ."""
        if self.verdict is Reproduction.PARTLY:
            return f"reproduced in {self.held} of {self.checked} {self.counted}"
        if 0 < self.checked < len(self.findings):
            every = f"{len(self.findings)} {self.counted}"
            return f"{self.verdict.value} (checked in {self.checked} of {every})"
        return str(self.verdict.value)

    @property
    def settings_text(self) -> str:
        """In how many draws of what is open it holds, and which setting separates them best."""
        if self.share is None:
            return ""
        return "; ".join(filter(None, (self.share.text, self.share.where)))

    @property
    def ours(self) -> tuple[float, float, float] | None:
        """Median, smallest and largest measured number; None without one."""
        every = (math.nan if each.ours is None else each.ours for each in self.findings)
        known = [each for each in every if math.isfinite(each)]
        return (statistics.median(known), min(known), max(known)) if known else None

    @property
    def ours_text(self) -> str:
        """The measured number with unit, and the range over the seeds in brackets."""
        return "" if self.ours is None else format_values(self.ours, self.claim.unit)

    @property
    def remark(self) -> str:
        """How the words are interpreted, and on what the result depends."""
        parts = (part.removesuffix(".") for part in (self.claim.reading, self.claim.depends))
        return " ".join(f"{part[:1].upper()}{part[1:]}." for part in parts if part)


@dataclass(frozen=True)
class Section:
    """An experiment of the report with all its seeds, and whether its figure exists."""

    experiment: Experiment
    outcomes: Sequence[Outcome]
    rendered: bool = True

    @cached_property
    def say(self) -> Seeds:
        """Numbers of all seeds."""
        return Seeds([outcome.numbers for outcome in self.outcomes])

    @cached_property
    def judgements(self) -> tuple[Judgement, ...]:
        """Judgements of all claims."""
        return tuple(map(self._judged, self.experiment.claims))

    def _judged(self, claim: Claim) -> Judgement:
        name, judge, every = self.experiment.name, self.experiment.judges[claim.key], self.say.every
        if judge.recorded is not None:
            every = [each for each in measured().values() if judge.recorded.of(each)]
            if not every:
                return Judgement(name, claim, ())
            findings = tuple(map(judge, every))
            return Judgement(name, claim, findings, judge.describe(every), "recordings")
        share = shares().get(f"{name}.{claim.key}") if judge.searched else None
        findings = tuple(map(judge, every))
        return Judgement(name, claim, findings, judge.describe(every), share=share)


@dataclass
class Report:
    """The finished outcomes and figures of some experiments in a folder; it grows during a run."""

    experiments: Sequence[Experiment]
    seeds: int
    folder: Path
    outcomes: dict[tuple[str, int], Outcome] = field(default_factory=dict)
    rendered: set[str] = field(default_factory=set)
    failures: list[str] = field(default_factory=list)

    def outcomes_of(self, experiment: Experiment) -> list[Outcome]:
        """Return the finished outcomes of an experiment, in the order of the seeds."""
        every = (self.outcomes.get((experiment.name, seed)) for seed in range(self.seeds))
        return [outcome for outcome in every if outcome]

    def is_complete(self, experiment: Experiment) -> bool:
        """Whether all seeds of an experiment are finished."""
        return len(self.outcomes_of(experiment)) == self.seeds

    @property
    def unfinished(self) -> list[str]:
        """Experiments with missing seeds or figures."""
        counted = {each.name: len(self.outcomes_of(each)) for each in self.experiments}
        words = {n: f"{n} ({count} of {self.seeds} seeds)" for n, count in counted.items()}
        words |= {n: f"{n} (no figure)" for n, count in counted.items() if count == self.seeds}
        return [words[n] for n in words if counted[n] < self.seeds or n not in self.rendered]

    @cached_property
    def sections(self) -> list[Section]:
        """Sections of the finished experiments; computed once, at the end."""
        finished = filter(self.is_complete, self.experiments)
        return [Section(e, self.outcomes_of(e), e.name in self.rendered) for e in finished]

    @property
    def judgements(self) -> tuple[Judgement, ...]:
        """Judgements of all sections."""
        return tuple(each for section in self.sections for each in section.judgements)

    @property
    def counts(self) -> dict[Reproduction, int]:
        """Number of claims by verdict."""
        found = [judgement.verdict for judgement in self.judgements]
        return {verdict: found.count(verdict) for verdict in Reproduction}

    @property
    def summary(self) -> str:
        """The counts in words."""
        parts = (f"{count} {verdict.value}" for verdict, count in self.counts.items())
        return f"{len(self.judgements)} claims: {', '.join(parts)}"


def abstract(judgements: Sequence[Judgement]) -> Iterator[tuple[str, str, int, int]]:
    """Summarise judgements in ten lines, without experiments that were not run.

    Each line has a sentence for several claims, why some do not reproduce, the number that do in
    every seed, and the number that can be checked.
    """
    known = {f"{each.experiment}.{each.claim.key}": each.verdict for each in judgements}
    for line in claims_file()["abstract"].values():
        verdicts = [known[key] for key in line["claims"].split() if key in known]
        checked = [verdict for verdict in verdicts if verdict is not Reproduction.UNCHECKED]
        if checked:
            held = checked.count(Reproduction.REPRODUCED)
            yield line["words"], line["because"], held, len(checked)


def not_held() -> dict[str, list[list[str]]]:
    """Return the sentences that are not judged, with their sections, by reason."""
    groups = claims_file()["not-held"]
    return {each["why"]: [w.split(" ", 1) for w in each["words"].splitlines()] for each in groups}


def versions() -> dict[str, str]:
    """Return the versions of the packages on which the numbers depend."""
    names = ("numpy", "scipy", "mujoco", "matplotlib")
    ours = {"Python": platform.python_version(), "palpate": __version__}
    return ours | {name: version(name) for name in names}


def circumstances() -> dict[str, str]:
    """Return date, machine and versions."""
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "machine": f"{platform.system()} on {platform.machine()}, {os.cpu_count()} processors",
        "versions": ", ".join(f"{name} {number}" for name, number in versions().items()),
    }


def settings() -> tuple[Table, ...]:
    """Return tables of the settings that we chose where the paper gives none."""
    single = palpate.SingleStageRLS()
    gate = (
        f"penetration > {1e3 * GATE.minimum_penetration:g} mm and force > {GATE.make_force:g} N, "
        f"until force ≤ {GATE.break_force:g} N"
    )
    chosen = (
        ("time", f"the motion and the identification begin at {START:g} s"),
        ("samples in contact", gate),
        ("units of the estimators", "SI, as in the paper"),
        ("P₀ of the single stage for [ln K, B/K, n]", f"{single.settings['initial_covariance']:g}"),
        ("forgetting factor", "as in the paper: λ(t) = 1 − 0.01 exp(−5 (t − time of contact))"),
        (
            "initial values, set I",
            "K = {:g}, B = {:g}, n = {:g}".format(*single.default_initial.parameters),
        ),
        ("sensors", lab.Sensors().describe()),
        ("variable projection", "same samples, no initial values or forgetting, offset estimated"),
    )
    laws = tuple((name, _describe_truth(each.describe())) for name, each in lab.MATERIALS.items())
    commands: dict[str, Any] = {**lab.TRAJECTORIES}
    motions = tuple((name, _describe_truth(asdict(each))) for name, each in commands.items())
    ours = "Chosen within the orders of magnitude in the paper's text; we do not have its tables."
    return (
        Table("Settings", ("setting", "value"), chosen),
        Table("Our materials", ("material", "true parameters, SI"), laws, ours),
        Table("Motions", ("motion", "command, SI"), motions),
    )


def _describe_truth(truth: Any) -> str:
    """Format the description of a material or motion."""
    if isinstance(truth, Mapping):
        named = {key.replace("_", " "): _describe_truth(value) for key, value in truth.items()}
        return ", ".join(v if key == "kind" else f"{key} {v}" for key, v in named.items())
    if isinstance(truth, list | tuple):
        return "; ".join(map(_describe_truth, truth))
    return f"{truth:g}" if isinstance(truth, float) else str(truth)


def write_report(report: Report) -> None:
    """Write ``report.html``, ``report.json`` and ``claims.md``, each completely or not at all.

    The page includes the figures in the folder.
    """
    folder = report.folder
    chapters = [
        ("claims", "Every claim of the paper", _claims(report)),
        ("not-held", "Not tested", _folded("Sentences that are not tested", _not_held())),
        ("settings", "Settings and materials", _folded("Our choices", _tables(settings()))),
        *(
            (s.experiment.name, _heading(s.experiment), _section(s, folder))
            for s in report.sections
        ),
    ]
    sections = (line for chapter in chapters for line in html.section(*chapter))
    parts = [*_head(report), "<main>", *sections, "</main>"]
    whole = {
        "title": TITLE,
        **circumstances(),
        "seeds": report.seeds,
        "unfinished": report.unfinished,
        "failures": report.failures,
        "settings": [asdict(table) for table in settings()],
        "verdicts": {verdict.value: count for verdict, count in report.counts.items()},
        "claims": [_claim_as_dict(each) for each in report.judgements],
        "not_held": not_held(),
        "experiments": [_section_as_dict(each) for each in report.sections],
    }
    style = Path(__file__).with_name("report.css").read_text(encoding="utf-8")
    write_text(folder / "report.html", html.document(TITLE, style, parts))
    write_text(folder / "report.json", as_json(whole))
    write_text(folder / "claims.md", _markdown(report))


def _claim_as_dict(each: Judgement) -> dict[str, Any]:
    ours = dict(zip(("median", "least", "largest"), each.ours or (), strict=False)) or None
    seeds = {"seeds_checked": each.checked, "seeds_held": each.held}
    found = {"verdict": each.verdict.value, **seeds, "ours": ours, "seen": each.text}
    found |= {"counted": each.counted, "settings": each.settings_text}
    return {"experiment": each.experiment, **asdict(each.claim), **found}


def _section_as_dict(section: Section) -> dict[str, Any]:
    experiment, name = section.experiment, section.experiment.name
    outcomes = []
    for each in section.outcomes:
        numbers = {key: _plain(value) for key, value in each.numbers.items()}
        findings = {
            key: {"holds": found.holds, "ours": _plain(found.ours)}
            for key, found in experiment.findings(each).items()
        }
        outcomes.append({"seed": each.seed, "numbers": numbers, "findings": findings})
    return {
        **{"name": name, "title": experiment.title, "caption": experiment.caption},
        "figure": f"{name}.svg" if section.rendered else None,
        "tables": [asdict(table) for table in experiment.tables(section.say)],
        "outcomes": outcomes,
    }


def _plain(value: float | None) -> float | None:
    """Return a float to nine digits, or None if it is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.9g}")


def _markdown(report: Report) -> str:
    """Return the table of claims, to paste into a document."""
    known = ("figure", "claim", "the paper's number", "ours", "verdict")
    header = (*known, "settings that hold", "read as, depends on")
    rows: list[tuple[str, ...]] = [header]
    for each in report.judgements:
        claim, number = each.claim, each.ours_text
        if number and claim.measured:
            number = f"{claim.measured}: {number}"
        ours = ". ".join(filter(None, (number, each.text)))
        where, words = f"{each.experiment}; {claim.where}", f"“{claim.words}”"
        verdicts = (each.verdict_text, each.settings_text)
        rows.append((where, words, claim.number, ours, *verdicts, each.remark))
    lines = ["| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |" for cells in rows]
    lines[1:1] = ["|---" * len(header) + "|"]
    lines += ["", "Not tested:", ""]
    for why, sentences in not_held().items():
        lines.append(f"- **{why}** " + "; ".join(f"“{words}” ({at})" for at, words in sentences))
    return f"{report.summary}; {report.seeds} seeds.\n\n" + "\n".join(lines) + "\n"


def figures_of(folder: Path, name: str) -> tuple[Path, Path]:
    """Return the paths of an experiment's figure for light and dark backgrounds."""
    return folder / f"{name}.svg", folder / f"{name}-dark.svg"


def _head(report: Report) -> Iterator[str]:
    yield f"<header><h1>{escape(TITLE)}</h1>"
    yield f"<p>{escape(ABOUT)}</p>"
    for words, left in {"Not finished": report.unfinished, "Failed": report.failures}.items():
        if left:
            yield f'<p class="note"><strong>{words}:</strong> {escape("; ".join(left))}.</p>'
    lines = []
    for sentence, because, held, checked in abstract(report.judgements):
        verdict = verdict_of(held, checked)
        why = "" if verdict is Reproduction.REPRODUCED else f" {escape(because)}"
        counted = f"({held} of {checked} claims reproduced in all seeds)"
        sign = f'<span class="badge {CLASSES[verdict]}">{SIGNS[verdict]}</span>'
        summary = f"{sign}<strong>{escape(sentence)}.</strong>{why}"
        lines.append(f'{summary} <span class="soft">{counted}</span>')
    if lines:
        yield "<h2>Summary</h2>"
        yield _list(lines, "abstract")
    yield from html.definitions({**circumstances(), "seeds": f"{report.seeds}, from 0 on"})
    yield "</header>"
    places = {"claims": "Every claim", "not-held": "Not tested"}
    places |= {"settings": "Settings and materials"}
    places |= {each.experiment.name: _heading(each.experiment) for each in report.sections}
    yield '<nav aria-label="Contents"><h2>Contents</h2>'
    yield _list(f'<a href="#{name}">{escape(words)}</a>' for name, words in places.items())
    yield "</nav>"


def _badge(verdict: Reproduction, words: str) -> str:
    sign = f'<span aria-hidden="true">{SIGNS[verdict]}</span>'
    return f'<span class="badge {CLASSES[verdict]}">{sign} {escape(words)}</span>'


def _list(items: Iterable[str], kind: str = "") -> str:
    named = f' class="{kind}"' if kind else ""
    return f"<ul{named}>\n" + "\n".join(f"<li>{item}</li>" for item in items) + "\n</ul>"


def _heading(experiment: Experiment) -> str:
    figure, title = _figure(experiment.name), experiment.title
    return title if figure == experiment.name else f"{figure}: {title}"


def _figure(name: str) -> str:
    """Return "Fig. 5" of "fig05"."""
    return re.sub(r"^fig0*(?=\d)", "Fig. ", name)


def _claims(report: Report) -> Iterator[str]:
    counts = report.counts.items()
    yield _list((_badge(verdict, f"{n} {verdict.value}") for verdict, n in counts), "counts")
    yield (
        "<p>Our number is the median over the seeds, with the range in brackets. A claim is "
        "reproduced if it holds in all seeds. If it holds in none, but in a fifth or more of the "
        "draws of what the paper leaves open, the verdict says so. Below its figure, each claim "
        "states how its words are interpreted, the other numbers, and on what the result "
        "depends.</p>"
    )
    header = ("figure", "claim", "the paper's number", "ours", "verdict", "settings that hold")
    rows = (
        (
            f'<a href="#{each.anchor}">{escape(_figure(each.experiment))}</a>',
            f"<q>{escape(each.claim.words)}</q>",
            escape(each.claim.number or "–"),
            escape(each.ours_text or "–"),
            _badge(each.verdict, each.verdict_text),
            escape(each.share.text if each.share else "–"),
        )
        for each in report.judgements
    )
    yield from html.table("Every claim", header, rows)


def _not_held() -> Iterator[str]:
    """Yield the sentences of the paper that are not tested, by reason."""
    yield "<p>Other sentences of sections II to VIII, and why they are not tested.</p>"
    for why, sentences in not_held().items():
        yield f"<h3>{escape(why)}</h3>"
        every = (f"<q>{escape(words)}</q> <small>{escape(at)}</small>" for at, words in sentences)
        yield _list(every)


def _folded(summary: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield lines that a click shows."""
    yield f"<details><summary>{escape(summary)}</summary>"
    yield from lines
    yield "</details>"


def _tables(tables: Iterable[Table]) -> Iterator[str]:
    for table in tables:
        rows = ([escape(cell) for cell in row] for row in table.rows)
        yield from html.table(table.title, table.header, rows)
        if table.note:
            yield f'<p class="soft">{escape(table.note)}</p>'


def _section(section: Section, folder: Path) -> Iterator[str]:
    name, words = section.experiment.name, section.experiment.caption
    if section.rendered:
        drawing = figures_of(folder, name)[0].read_text(encoding="utf-8")
        inside = inline(drawing, f"{name}-drawing", words)
        yield f'<figure><div class="wide" tabindex="0">{inside}</div>'
        yield f"<figcaption>{escape(words)}</figcaption></figure>"
    for each in section.judgements:  # with the numbers behind the verdict
        claim = each.claim
        yield f'<div class="claim" id="{each.anchor}">'
        yield f"<p><q>{escape(claim.words)}</q> <small>{escape(claim.where)}</small></p>"
        yield f"<p>{_badge(each.verdict, each.verdict_text)}</p>"
        numbers = {"the paper": claim.number, claim.measured or "ours": each.ours_text}
        if format_values := "; ".join(
            f"{name}: {value}" for name, value in numbers.items() if value
        ):
            yield f"<p>{escape(format_values)}</p>"
        settings = f"Settings that hold: {each.settings_text}" if each.share else ""
        remarks = (each.text, settings, each.remark)
        yield from (f'<p class="soft">{escape(w)}</p>' for w in remarks if w)
        yield "</div>"
    yield from _tables(section.experiment.tables(section.say))
    yield from _folded("All measured numbers", _tables([section.say.every_number()]))
