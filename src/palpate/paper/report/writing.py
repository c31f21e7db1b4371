"""The report as files: a page, JSON and a table of claims."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from palpate.paper.report.contents import TITLE, Report, Section, circumstances, settings
from palpate.paper.report.not_held import not_held
from palpate.paper.report.page import page
from palpate.writing import write_text


def write_report(report: Report, folder: Path) -> None:
    """Write ``report.html``, ``report.json`` and ``claims.md``, each whole or not at all."""
    write_text(folder / "report.html", page(report, folder))
    text = json.dumps(as_dict(report), ensure_ascii=False, allow_nan=False, indent=1)
    write_text(folder / "report.json", text + "\n")
    write_text(folder / "claims.md", claims_as_markdown(report))


def as_dict(report: Report) -> dict[str, Any]:
    """Return the report as plain numbers and words; what is not finite is None."""
    return {
        "title": TITLE,
        **circumstances(),
        "seeds": report.seeds,
        "unfinished": list(report.unfinished),
        "failures": list(report.failures),
        "settings": [asdict(table) for table in settings()],
        "verdicts": {verdict.value: count for verdict, count in report.counts.items()},
        "claims": [judgement.as_dict() for judgement in report.judgements],
        "not_held": not_held(),
        "experiments": [_section_as_dict(section) for section in report.sections],
    }


def _section_as_dict(section: Section) -> dict[str, Any]:
    experiment = section.experiment
    return {
        "name": experiment.name,
        "title": experiment.title,
        "caption": experiment.caption,
        "figure": f"{experiment.name}.svg" if section.drawn else None,
        "tables": [asdict(table) for table in section.tables],
        "outcomes": [
            {
                "seed": outcome.seed,
                "numbers": {name: _plain(value) for name, value in outcome.numbers.items()},
                "findings": {
                    key: {**asdict(found), "ours": _plain(found.ours)}
                    for key, found in experiment.findings(outcome).items()
                },
            }
            for outcome in section.outcomes
        ],
    }


def _plain(value: float | None) -> float | None:
    """A float to nine digits, None for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.9g}")


def claims_as_markdown(report: Report) -> str:
    """Return the table of claims, to paste into a document."""
    rows = [
        "| figure | the paper's words | its number | ours | verdict | read as, depends on |",
        "|---|---|---|---|---|---|",
    ]
    for each in report.judgements:
        named = f"{each.claim.measured}: " if each.claim.measured else ""
        number = f"{named}{each.ours_words}" if each.ours_words else ""
        ours = ". ".join(filter(None, (number, each.words)))
        cells = (
            f"{each.experiment}; {each.claim.where}",
            f"“{each.claim.words}”",
            each.claim.number,
            ours,
            each.verdict_words,
            each.remark,
        )
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    rows += ["", "Not held against anything:", ""]
    for why, sentences in not_held().items():
        said = "; ".join(f"“{words}” ({where})" for where, words in sentences)
        rows += [f"- **{why}** {said}"]
    return f"{report.summary}; {report.seeds} seeds.\n\n" + "\n".join(rows) + "\n"
