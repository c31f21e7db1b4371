"""Identifications as tables that a person reads, or as one JSON object."""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.text import Text

from palpate.cli.printing import Cell, Terminal, print_json, print_table, say, say_path
from palpate.diagnosis import Episode, Quantity, WorkingDepth
from palpate.diagnosis.data import in_words
from palpate.diagnosis.fit import DEEP
from palpate.digits import rounded, with_error
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identification.identified import rank
from palpate.identifying import Identification
from palpate.preparation.gates import touches_of
from palpate.recordings.recording import truth_of
from palpate.results.summary import (
    correlated,
    felt,
    felt_at,
    following,
    number,
    parameter_rows,
    with_prefix,
)

#: Beside a table that has such a distance.
LEGEND = "σ: distance from the truth that the file states, in standard errors"
# Of the logarithms of a spectrum's ends: 5 % of a time move M by less than 1 %.
_SAME_TIME = 0.05


def stated_truth(result: Identification) -> ForceLaw | None:
    """Return the force law that the recording says it was made with, if any."""
    return truth_of(result.contact.provenance)


def truth_at_rest(result: Identification) -> ForceLaw | None:
    """Return the stated truth where its force, stiffness and damping at rest mean the same.

    Where one of the two laws remembers what the other does not, they do not.
    """
    law, truth = result.law, stated_truth(result)
    if truth is None or not (law.remembers or truth.remembers):
        return truth
    return truth if comparable(law, truth) else None


def comparable(law: Any, truth: Any) -> set[str]:
    """Return the parameters of a law that mean what the truth's of the same names do.

    Those of a law of another kind do not; of two generalised laws they do where the same relaxes,
    the same kind of spectrum over the same times; but B is in N·s/mᵖ⁺¹.
    """
    names = set(law.names())
    if law.kind != truth.kind:
        return set()
    if not (law.relaxes and truth.relaxes):
        return names
    if not _same_memory(law, truth):
        return set()
    pair = (law, truth)
    dampers = {round(each.damping_exponent - each.exponent, 6) for each in pair if each.damping}
    return names if len(dampers) < 2 else names - {"damping", "damping_exponent"}


def felt_beside_truth(result: Identification) -> str:
    """Say what a small oscillation feels, and the truth of it; empty where nothing remembers."""
    truth = stated_truth(result)
    if truth is None or not (truth.remembers or result.law.remembers):
        return ""
    try:
        felt = result.dynamic_stiffness()
        real = GeneralisedHuntCrossley.of(truth).dynamic_stiffness(felt.depth, felt.frequency)
    except InvalidParameterError:  # a probe that never moved, or a truth of another form
        return ""
    stiffness = _felt_beside(felt.stiffness, real.real, "N/m")
    damping = _felt_beside(felt.damping, real.imag / felt.frequency, "N·s/m")
    same = comparable(result.law, truth) == set(result.law.names())
    other = "" if same else "the file's law is another; "
    return (
        f"{other}an oscillation of {rounded(felt.frequency, 3)} rad/s about "
        f"{rounded(1e3 * felt.depth, 3)} mm feels {stiffness} and {damping}"
    )


def beside_truth(value: float, truth: float, *errors: float) -> str:
    """Return the truth, and how many standard errors away from it a number is.

    Parameters
    ----------
    value, truth : float
        Of one unit.
    errors : float
        Of the value; all of them together count.
    """
    known = [error for error in errors if math.isfinite(error)]
    words, error = f"truth {rounded(truth, 5)}", math.hypot(*known)
    if not (error > 0.0 and math.isfinite(value)):
        return words
    return f"{words}, {_signed((value - truth) / error, 2)} σ"


def _felt_beside(found: Quantity, exact: float, unit: str) -> str:
    bars = found.standard_error, found.systematic
    words = with_error(found.value, *bars, unit=unit)
    return f"{words} ({beside_truth(found.value, exact, *bars)})"


def _same_memory(law: GeneralisedHuntCrossley, truth: GeneralisedHuntCrossley) -> bool:
    if not (law.remembers and truth.remembers):
        return law.remembers == truth.remembers
    if type(law.relaxation) is not type(truth.relaxation):
        return False
    ends = [[each.shortest_time, each.longest_time] for each in (law, truth)]
    # One relaxation time is identified, and so is its difference from the truth.
    return 0.0 in ends[0] or bool(np.ptp(np.log(ends), axis=0).max() < _SAME_TIME)


# Identifications as tables that a person reads, or as one JSON object.

_BARS = "± repeatable ± what the findings would move"
_RELAXED = "once the material has relaxed"
_ROWS = (("force", "N"), ("stiffness", "N/m"), ("damping", "N·s/m"))
_SCORE = (
    "score: N_eff ln(RSS/N) + 2 p ln N_eff over the best, p numbers; from 10 on strong evidence"
)
_NUMBERS = (">stiffness\nN/m", ">damping\nN·s/m")
_COLOURS = {"trust": "green", "with-care": "yellow", "do-not-trust": "red", "note": "dim"}
_QUALITY = (
    "predicted, fit: RMSE% of force, a priori after 0.2 s and of the final law; "
    "cond. 10: contact in which |v| < 0.1 K/B does not hold"
)


def print_identifications(
    files: Sequence[Path],
    results: Sequence[Identification],
    figure: Path | None,
    *,
    as_json: bool,
    folder: Path | None = None,
) -> None:
    """Print what a file gave: its identifications side by side, and what to know about them."""
    if as_json:
        from palpate.results.saved import described

        print_json(described(files, results))
        return
    console = Terminal()
    say_path(console, results[0].contact.source or "contact", "bold")
    if len(results) > 1:
        print_comparison(results, console)
    else:
        _print_result(results[0], console)
    console.print()
    say(console, _samples(results[0]))
    _print_remarks(results[0], console)
    for result in results:
        # One law for two materials is not identifiable by any motion: its flags would mislead.
        for flag in () if result.diagnosis.episodes else result.flags:
            say(console, f"{result.method}: {flag}", "yellow")
    if figure is not None:
        say_path(console, f"figure: {figure}")
    if folder is not None:
        say_path(console, f"report: {folder / 'report.html'}")


def _print_result(result: Identification, console: Terminal) -> None:
    """One method: the verdict and what is at working depth, the law, and then all else."""
    print_verdict(result, console)
    for part in stretches_of(result):
        print_verdict(part, console, name=when(part))
    console.print()
    print_working_depths(result, console)
    if stretches_of(result):
        console.print()
        print_stretches(result, console)
    console.print()
    print_law(result, console)
    if words := verdict_on_laws(result):
        say(console, words)
    say(console, _quality(result))
    print_places(result, console)
    for finding in result.diagnosis.findings:  # an assumption, and no fault of the stiffness
        if finding.check == "surface" and finding.severity == "note":
            say(console, f"note: {finding.message}")
    for line in following(result):
        say(console, str(line))
    if result.noticed is not None:  # when a control loop would have known of the changes
        times = ", ".join(f"{rounded(time, 4)} s" for time in result.changes.tolist())
        say(console, f"the change detector, in a control loop, alarms at {times or 'no time'}")


def _quality(result: Identification) -> str:
    fit = "fit by the laws of each part" if result.stretches else "fit"
    words = (
        f"by {result.method}; RMSE of force: {fit} {percent(result.fit_rmse_percent)}, "
        f"predicted a priori {percent(result.prediction_rmse_percent)}"
    )
    if result.law.has_condition_10:
        words += f"; |v| < 0.1 K/B (eq. 10) fails in {share(result.violated_fraction)} of contact"
    return words


def _samples(first: Identification) -> str:
    contact, gate, scale = first.contact, first.gate, first.scale
    touches = len(touches_of(contact))
    force = f"force > {rounded(gate.make_force, 3)} N"
    if first.estimator.chooses_samples and not gate.make_force:
        force = "chosen by the force around each"
    units = ((scale.penetration, "m"), (scale.velocity, "m/s"), (scale.force, "N"))
    return (
        f"{len(contact)} samples, {touches} {'touch' if touches == 1 else 'touches'}, "
        f"{first.estimate.samples} in contact "
        f"(penetration > {rounded(gate.minimum_penetration, 3)} m, {force}); "
        f"computed in units of {', '.join(f'{rounded(size, 3)} {unit}' for size, unit in units)}"
    )


def _print_remarks(first: Identification, console: Terminal) -> None:
    """What was assumed on the way from the recording, but for what the verdict says again."""
    for finding in first.contact.findings:
        if finding.severity != "note" and finding.message in first.diagnosis.reason:
            continue
        words = Text(f"{finding.check}: {finding.message}")
        if finding.remedy:
            words.append(f" ({finding.remedy})", "dim")
        say(console, words)


def print_working_depths(result: Identification, console: Console) -> None:
    """Print the three with both error bars, and with the truth where the file states it."""
    truth, depths = truth_at_rest(result), result.working_depths
    names = ["median" if result.depth is None else "as asked", f"{DEEP:.0f}th percentile"]
    headings = [
        f"at {in_words(there.depth, 'm', digits=4)}\n{name}"
        for there, name in zip(depths, names, strict=False)
    ]
    rows = [[name, *(_cell(there, name, unit, truth) for there in depths)] for name, unit in _ROWS]
    print_table(console, ["", *headings], rows)
    words = [_BARS, *([_RELAXED] if result.law.remembers else []), *([LEGEND] if truth else [])]
    say(console, "; ".join(words), "dim")


def _cell(there: WorkingDepth, name: str, unit: str, truth: ForceLaw | None) -> str:
    found: Quantity = getattr(there, name)
    words = with_error(found.value, found.standard_error, found.systematic, unit=unit)
    if truth is None:
        return words
    real = at_rest(truth, there.depth)[name]
    return f"{words}\n{beside_truth(found.value, real, found.whole_error)}"


def at_rest(law: ForceLaw, depth: float) -> dict[str, float]:
    """Return force, stiffness and damping of a law at a depth, SI."""
    values = law.force(depth, 0.0), law.stiffness_at(depth), law.damping_at(depth)
    return {name: float(value) for (name, _), value in zip(_ROWS, values, strict=True)}


def print_law(result: Identification, console: Console) -> None:
    """Print each parameter with its standard error, what correlates, and what is known beside."""
    rows = zip(parameters(result), _truths(result), strict=True)
    print_table(console, ["contact model", ""], [*rows])
    if words := _correlations(result):
        say(console, f"correlation {words}")
    for line in _beside(result):
        say(console, line)


def parameters(result: Identification) -> list[str]:
    """Return a line for each parameter: ``K = 2002.0 ± 1.9 N/mⁿ``."""
    return [str(row) for row in parameter_rows(result)]


def _truths(result: Identification) -> list[str]:
    """The truth beside each parameter, where it is a law of the same kind."""
    law, truth, rows = result.law, stated_truth(result), parameter_rows(result)
    if truth is not None:
        alike = law.simplest()
        law = alike if alike.kind == truth.kind else law
    if truth is None or truth.kind != law.kind:
        return [""] * len(rows)
    # How far it is from the truth only where the two mean the same.
    same = comparable(law, truth)
    values, real, errors = law.as_dict(), truth.as_dict(), result.standard_errors
    return [
        beside_truth(
            values[row.name],
            real[row.name],
            float(errors[row.index]) if row.name in same else 0.0,
        )
        if row.name in real and row.estimated
        else ""
        for row in rows
    ]


def _correlations(result: Identification) -> str:
    found, pairs = result.correlations, itertools.combinations(correlated(result), 2)
    return ", ".join(
        f"{one}–{other} {_correlation(found[i, j])}"
        for (i, one), (j, other) in pairs
        if math.isfinite(found[i, j])
    )


def _correlation(value: float) -> str:
    """With as many digits as keep it apart from one, up to four."""
    words = [f"{value:.{digits}f}" for digits in (2, 3, 4)]
    return next((each for each in words if abs(float(each)) < 1.0), words[-1])


def _beside(result: Identification) -> list[str]:
    """What was estimated beside the law."""
    estimate, lines = result.estimate, []
    if estimate.offset_standard_error > 0.0:
        words = with_error(estimate.offset, estimate.offset_standard_error, unit="N")
        lines.append(f"force offset {words}")
    if estimate.surface_standard_error > 0.0:
        error = 1e3 * estimate.surface_standard_error
        lines.append(f"surface at {with_error(1e3 * estimate.surface, error, unit='mm')}")
    if felt := felt_beside_truth(result):
        lines.append(felt)
    return lines


def verdict_on_laws(result: Identification) -> str:
    """Return the verdict in a line; nothing where there is none."""
    verdict = result.law_verdict
    if verdict is None or not verdict.known:
        return ""
    if result.estimator.chooses_law:
        return str(verdict)
    return f"of the everyday laws, by the same samples: {str(verdict).removeprefix('law: ')}"


def print_standings(results: Sequence[Identification], console: Console) -> None:
    """Print how the laws stand that the samples were asked about, the best first."""
    # That of the method which chooses a law, else of any.
    ordered = sorted(results, key=lambda each: not each.estimator.chooses_law)
    verdict = next(filter(None, (each.law_verdict for each in ordered)), None)
    if verdict is None or not verdict.known:
        return
    headings = ["which law", ">score", ">rms error", ">numbers", "which means"]
    rows: list[list[Cell]] = []
    for each in verdict.standings:
        name = Text(str(each.candidate), style="" if rows else "bold")
        numbers = rounded(each.score, 3), in_words(each.rms_error, "N")
        rows.append([name, *numbers, str(each.candidate.parameters), each.words])
    print_table(console, headings, rows)
    samples = rounded(verdict.effective_samples, 3), rounded(verdict.samples, 4)
    say(console, "{}; {} independent samples of {}".format(_SCORE, *samples), "dim")
    for flag in verdict.flags:
        say(console, f"{verdict.candidate}: {flag}", "dim")


def stretches_of(result: Identification) -> list[Identification]:
    """Return those between changes of the material."""
    return [part for part in result.stretches if part.place is None]


def when(part: Identification) -> str:
    """Return the times of a stretch."""
    time = part.contact.time
    return f"{rounded(float(time[0]), 4)} s to {rounded(float(time[-1]), 4)} s"


def print_stretches(result: Identification, console: Console) -> None:
    """Print what was identified between changes, each with its law, at one working depth."""
    headings = ["time\ns", *_NUMBERS, "contact model", ">fit"]
    rows = []
    for part in stretches_of(result):
        there = part.diagnosis.working_depth
        times = when(part).replace(" s to ", "\nto ").removesuffix(" s")
        law, fit = "\n".join(parameters(part)), percent(part.fit_rmse_percent)
        rows.append([times, number(there.stiffness), number(there.damping), law, fit])
    print_table(console, headings, rows)


def print_places(result: Identification, console: Console) -> None:
    """Print what was identified at each place: stiffness and damping at its own working depth."""
    headings = [">time\ns", ">at x, y, z\nmm", ">depth\nmm", *_NUMBERS]
    headings += [*([">Young's\nmodulus"] if result.wanted.tip else []), "verdict"]
    rows: list[list[Cell]] = []
    for part in result.stretches:
        if part.place is not None:
            found, time = part.diagnosis, part.contact.time
            there, verdict = found.working_depth, found.verdict.overall
            place = ", ".join(f"{1e3 * each:.1f}" for each in part.place.position)
            numbers = [number(there.stiffness), number(there.damping)]
            numbers += [_modulus(part)] if part.wanted.tip else []
            times, depth = f"{time[0]:.1f}–{time[-1]:.1f}", _depth(1e3 * there.depth)
            rows.append([times, place, depth, *numbers, Text(verdict, style=_COLOURS[verdict])])
    if rows:
        console.print()
        print_table(console, headings, rows)


def _depth(millimetres: float) -> str:
    """Three digits, with a zero at their end where there is one: they stand in a column."""
    plain = 0.01 <= millimetres < 1000.0
    return f"{millimetres:#.3g}".rstrip(".") if plain else rounded(millimetres, 3)


def _modulus(part: Identification) -> str:
    """With its whole error; the JSON says why there is none."""
    found = part.elastic_modulus()
    whole = Quantity(found.value.value, found.value.whole_error, 0.0)
    return "refused" if found.refused else with_prefix(whole, "Pa")


def print_verdict(result: Identification, console: Console, *, name: str = "") -> None:
    """Print the verdict of an identification, its reason, and what to do about it."""
    found = result.diagnosis
    verdict = found.verdict
    words = Text(f"{name}: " if name else "")
    words.append(verdict.overall, f"bold {_COLOURS[verdict.overall]}")
    words.append(f" (stiffness: {verdict.stiffness}, damping: {verdict.damping}): {found.reason}")
    if found.remedy:
        words.append(f" ({found.remedy})", "dim")
    say(console, words)


def print_diagnosis(result: Identification) -> None:
    """Print the verdict, the numbers that it is about, and every finding with its remedy."""
    console, found = Terminal(), result.diagnosis
    say_path(console, result.contact.source or "contact", "bold")
    print_verdict(result, console)
    console.print()
    print_working_depths(result, console)
    console.print()
    headings = ["check", "what was found", ">z", ">moves S, C"]
    rows: list[list[Cell]] = []
    for finding in found.findings:
        check = Text(finding.check, style=_COLOURS[finding.severity])
        words = "\n→ ".join(filter(None, (finding.message, finding.remedy)))
        z = "–" if math.isnan(finding.z) else rounded(finding.z, 3)
        moves = _moves(finding.moves_stiffness_percent, finding.moves_damping_percent)
        rows.append([check, words, z, moves])
    print_table(console, headings, rows, prose=headings[1:2])
    say(console, "z: standard errors; S, C: stiffness and damping at working depth", "dim")
    for episode in found.episodes:
        say(console, _episode(episode))


def percent(value: float) -> str:
    """Return a percentage of the force; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.2f} %"


def share(value: float) -> str:
    """Return a fraction as a percentage; a dash where it is not defined."""
    return "–" if math.isnan(value) else f"{value:.1%}"


def _episode(episode: Episode) -> str:
    law = ", ".join(f"{name} = {rounded(v, 4)}" for name, v in episode.law.as_dict().items())
    stiffness = rounded(episode.working_depth.stiffness.value, 4)
    times = f"{rounded(episode.start, 4)} to {rounded(episode.stop, 4)} s"
    return f"{times}: {law}; stiffness {stiffness} N/m"


def _moves(stiffness: float, damping: float) -> str:
    if math.isnan(stiffness) or math.isnan(damping):
        return "–"
    return ", ".join(
        f"{value:+.1f} %" if abs(value) < 1000.0 else f"{_signed(value, 3)} %"
        for value in (stiffness, damping)
    )


def _signed(value: float, digits: int) -> str:
    return f"{'-' if value < 0.0 else '+'}{rounded(abs(value), digits)}"


def print_comparison(results: Sequence[Identification], console: Console) -> None:
    """Print the recommended method, and all of them, the best first."""
    by_name = {result.method: result for result in results}
    ranking = rank(by_name)
    ordered = [by_name[name] for name in ranking.order]
    say(console, f"recommended: {ranking.recommended or 'none of them'}", "bold")
    _print_numbers(ordered, console)
    for result in ordered:
        if result.diagnosis.verdict.overall != "trust":
            print_verdict(result, console, name=result.method)
    for words in ranking.exclusions:
        say(console, words, "yellow")
    console.print()
    print_standings(results, console)
    console.print()
    _print_laws(ordered, console)


def _print_numbers(results: Sequence[Identification], console: Console) -> None:
    """Stiffness and damping at each method's working depth, with the whole error."""
    headings = ["method", "verdict", ">depth\nmm", *_NUMBERS]
    rows: list[list[str | Text]] = []
    for result in results:
        there, verdict = result.diagnosis.working_depth, result.diagnosis.verdict.overall
        depth, coloured = rounded(1e3 * there.depth, 4), Text(verdict, style=_COLOURS[verdict])
        rows.append([result.method, coloured, depth, *map(number, felt(result))])
    if truth := stated_truth(results[0]):
        at = results[0].diagnosis.working_depth.depth
        _, *real = at_rest(truth, at).values()
        rows.append(["truth", "", *(rounded(each, 4) for each in (1e3 * at, *real))])
    print_table(console, headings, rows)
    say(console, "± all of the error: what repeats, and what the findings would move", "dim")
    if words := felt_at(results):
        say(console, words, "dim")


def _print_laws(results: Sequence[Identification], console: Console) -> None:
    headings = ["method", "contact model", ">predicted", ">fit", ">cond. 10"]
    rows = []
    for result in results:
        errors = result.prediction_rmse_percent, result.fit_rmse_percent
        law, violated = "\n".join(parameters(result)), share(result.violated_fraction)
        rows.append([result.method, law, *map(percent, errors), violated])
    if truth := stated_truth(results[0]):
        named = zip(truth.symbols, truth.parameters, truth.units, strict=True)
        lines = [f"{name} = {rounded(value, 5)} {unit}".rstrip() for name, value, unit in named]
        rows.append(["truth", "\n".join(lines), "", "", ""])
    print_table(console, headings, rows)
    say(console, _QUALITY, "dim")
