"""Methods side by side as a person reads them: which to take first, then the numbers."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from palpate.cli.laws import parameters
from palpate.cli.layout import Column, print_table, say
from palpate.cli.standings import print_standings
from palpate.cli.truths import stated_truth
from palpate.cli.verdicts import COLOURS, percent, print_verdict, share
from palpate.cli.working_depths import at_rest, whole_error
from palpate.digits import rounded, with_error
from palpate.identifying import Identification
from palpate.ranking import rank
from palpate.results.summary import felt, felt_at

QUALITY = (
    "predicted, fit: RMSE% of force, a priori after 0.2 s and of the final law; "
    "cond. 10: contact in which |v| < 0.1 K/B does not hold"
)


def print_comparison(results: Sequence[Identification], console: Console) -> None:
    """Print the recommended method, and all of them, the best first."""
    ranking = rank({result.method: result for result in results})
    by_name = {result.method: result for result in results}
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
    columns = [
        Column("method", hyphens=True),
        Column("verdict", hyphens=True),
        Column("depth\nmm", right=True),
        Column("stiffness\nN/m", right=True),
        Column("damping\nN·s/m", right=True),
    ]
    rows: list[list[str | Text]] = []
    for result in results:
        there, verdict = result.diagnosis.working_depth, result.diagnosis.verdict.overall
        rows.append(
            [
                result.method,
                Text(verdict, style=COLOURS[verdict]),
                rounded(1e3 * there.depth, 4),
                *(with_error(each.value, whole_error(each)) for each in felt(result)),
            ]
        )
    if truth := stated_truth(results[0]):
        depth = results[0].diagnosis.working_depth.depth
        real = at_rest(truth, depth)
        numbers = [1e3 * depth, real["stiffness"], real["damping"]]
        rows.append(["truth", "", *(rounded(each, 4) for each in numbers)])
    print_table(console, columns, rows)
    say(console, "± all of the error: what repeats, and what the findings would move", "dim")
    if words := felt_at(results):
        say(console, words, "dim")


def _print_laws(results: Sequence[Identification], console: Console) -> None:
    quality = ("predicted", "fit", "cond. 10")
    columns = [Column("method", hyphens=True), Column("contact model")]
    columns += [Column(heading, right=True) for heading in quality]
    rows = [
        [
            result.method,
            "\n".join(parameters(result)),
            percent(result.prediction_rmse_percent),
            percent(result.fit_rmse_percent),
            share(result.violated_fraction),
        ]
        for result in results
    ]
    if truth := stated_truth(results[0]):
        named = zip(truth.symbols, truth.parameters, truth.units, strict=True)
        lines = [f"{name} = {rounded(value, 5)} {unit}".rstrip() for name, value, unit in named]
        rows.append(["truth", "\n".join(lines), "", "", ""])
    print_table(console, columns, rows)
    say(console, QUALITY, "dim")
