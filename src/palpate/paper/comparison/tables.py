"""The tables of a comparison: starts, prediction errors, convergence times."""

from collections.abc import Sequence

from palpate.estimators import RecursiveLeastSquaresEstimator, VariableProjection
from palpate.paper.curves import median_and_range
from palpate.paper.experiment import Outcome, Table

NUMBERS = {"ball": ("I", "II"), "sponge": ("III", "IV"), "pvc": ("V", "VI")}


def comparison_tables(
    material: str,
    kinds: Sequence[type[RecursiveLeastSquaresEstimator]],
    outcomes: Sequence[Outcome],
    beside: str,
) -> tuple[Table, ...]:
    """Return our Tables I and II, III and IV or V and VI, and the convergence times."""
    starts, errors = NUMBERS[material]
    tables = [
        _starts(f"Table {starts}: initial values, {material}", kinds, outcomes),
        _errors(f"Table {errors}: RMSE%, {material}", kinds, outcomes),
        _times(f"Convergence, {material}", kinds, outcomes),
    ]
    if beside:
        second = [Outcome(outcome.seed, outcome.numbers["beside"], {}, {}) for outcome in outcomes]
        tables += [
            _errors(f"RMSE%, {beside}", kinds, second),
            _times(f"Convergence, {beside}", kinds, second),
        ]
    return tuple(tables)


def _starts(
    title: str,
    kinds: Sequence[type[RecursiveLeastSquaresEstimator]],
    outcomes: Sequence[Outcome],
) -> Table:
    rows = []
    for kind in kinds:
        every = [outcome.numbers["methods"][kind.method]["starts"] for outcome in outcomes]
        for start in every[0]:
            values = [
                f"{symbol} = {median_and_range(starts[start][i] for starts in every)}"
                for i, symbol in enumerate(kind.law_type.symbols)
            ]
            rows.append((kind.method, start, ", ".join(values)))
    return Table(title, ("method", "start", "initial values, SI"), tuple(rows), _over(outcomes))


def _errors(
    title: str,
    kinds: Sequence[type[RecursiveLeastSquaresEstimator]],
    outcomes: Sequence[Outcome],
) -> Table:
    rows = []
    for method in [*(kind.method for kind in kinds), VariableProjection.method]:
        every = [outcome.numbers["methods"][method] for outcome in outcomes]
        symbols = every[0]["symbols"]
        for start in every[0]["rmse"]:
            final = [
                f"{symbol} = {median_and_range(numbers['final'][start][i] for numbers in every)}"
                for i, symbol in enumerate(symbols)
            ]
            rmse = median_and_range(numbers["rmse"][start] for numbers in every)
            rows.append((method, start, rmse, ", ".join(final)))
    note = f"A-priori force error after 0.2 s of contact, 100 √(Σe²/ΣF²). {_over(outcomes)}"
    return Table(title, ("method", "start", "RMSE%", "final values, SI"), tuple(rows), note)


def _times(
    title: str,
    kinds: Sequence[type[RecursiveLeastSquaresEstimator]],
    outcomes: Sequence[Outcome],
) -> Table:
    rows = []
    for kind in kinds:
        every = [outcome.numbers["methods"][kind.method] for outcome in outcomes]
        for i, symbol in enumerate(kind.law_type.symbols):
            same = [
                median_and_range(
                    (numbers["same covariance"][variance][i] for numbers in every), ".2g"
                )
                for variance in every[0]["same covariance"]
            ]
            rows.append(
                (
                    kind.method,
                    symbol,
                    median_and_range((numbers["times"][i] for numbers in every), ".2g"),
                    median_and_range((numbers["spread"][i] for numbers in every), ".2g"),
                    median_and_range((numbers["settled"][i] for numbers in every), ".2g"),
                    *same,
                )
            )
    variances = outcomes[0].numbers["methods"][kinds[0].method]["same covariance"]
    header = ("method", "parameter", "time [s]", "starts apart at the end [%]", "own end [s]")
    note = (
        "Seconds of contact until the estimates from all starts agree within 5 % and stay so; own "
        "end: until each is within 5 % of its own final value. "
        "First with each method's default P₀ (1e3 single stage, 1e8 Kelvin–Voigt and double stage, "
        f"1e10 extended Kelvin–Voigt, in SI), then with the same P₀ for all. {_over(outcomes)}"
    )
    return Table(title, (*header, *(f"P₀ = {v}: time [s]" for v in variances)), tuple(rows), note)


def _over(outcomes: Sequence[Outcome]) -> str:
    return f"Median, and range over {len(outcomes)} seeds." if len(outcomes) > 1 else "One seed."
