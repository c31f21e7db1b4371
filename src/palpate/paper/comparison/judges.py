"""How the claims of a comparison are judged."""

import math
from collections.abc import Sequence

from palpate.paper.experiment import Finding
from palpate.paper.judged import Judge, Numbers, unchecked

#: Two convergence times are "the same" within this factor; ours.
SAME = 1.5
P0 = (
    "P₀: the defaults, 1e3 for the single stage, 1e8 for Kelvin–Voigt and the double stage, 1e10 "
    "for the extended Kelvin–Voigt, in SI; the paper gives none"
)
SPEED = (
    "the time is footnote 3's, of the slower of stiffness and damping: until all starts agree "
    f"within 5 %, right or wrong. {P0}"
)
IN_CLASS = "the laboratory's {} is a Hunt–Crossley material, so a better fit is built in"


def time_of(numbers: Numbers, method: str, rows: Sequence[int] = (0, 1)) -> float:
    """Seconds until the slowest of the parameters has converged; infinite for never."""
    return _slowest([numbers["methods"][method]["times"][row] for row in rows])


def _slowest(times: Sequence[float]) -> float:
    return max(math.inf if math.isnan(time) else time for time in times)


def said(time: float) -> str:
    """A time in words."""
    return "never" if math.isinf(time) else f"{time:.3f} s"


def finite(value: float) -> float | None:
    """None for what never happened."""
    return value if math.isfinite(value) else None


def _times_beside(numbers: Numbers, one: str, other: str) -> str:
    """How the verdict depends on P₀."""
    words = []
    ours, theirs = (numbers["methods"][method]["same covariance"] for method in (one, other))
    for variance in ours:
        pair = said(_slowest(ours[variance][:2])), said(_slowest(theirs[variance][:2]))
        words.append(f"{variance}: {pair[0]} and {pair[1]}")
    return "with the same P₀ for both, " + "; ".join(words)


def rate(numbers: Numbers) -> Finding:
    """The single stage converges sooner than the double stage."""
    single = time_of(numbers, "single-stage", (0, 1, 2))
    double = time_of(numbers, "double-stage", (0, 1, 2))
    words = f"single stage {said(single)}, double stage {said(double)}"
    return Finding(single < double, finite(single), words)


def smaller_error(numbers: Numbers) -> Finding:
    """The single stage predicts the force better than the double stage, start by start."""
    single, double = (numbers["methods"][m]["rmse"] for m in ("single-stage", "double-stage"))
    ratios = [double[start] / single[start] for start in single]
    words = "; ".join(f"{s}: {single[s]:.2g} % and {double[s]:.2g} %" for s in single)
    return Finding(min(ratios) > 1.0, min(ratios), words)


def consistency(numbers: Numbers) -> Finding:
    """The starts of the single stage end together, those of the double stage apart."""
    single, double = (numbers["methods"][m]["spread"] for m in ("single-stage", "double-stage"))
    words = f"apart at the end: single stage {max(single):.2g} %, double stage {max(double):.2g} %"
    return Finding(max(single) <= 5.0 < max(double), max(double), words)


def wide_range(numbers: Numbers) -> Finding:
    """From every start the single stage ends near the truth; the double stage does not."""
    truth = [numbers["truth"][name] for name in ("stiffness", "damping", "exponent")]
    worst = {
        method: max(
            100.0 * abs(value / true - 1.0)
            for final in numbers["methods"][method]["final"].values()
            for value, true in zip(final, truth, strict=True)
        )
        for method in ("single-stage", "double-stage")
    }
    words = ", ".join(f"{method} within {value:.2g} %" for method, value in worst.items())
    holds = worst["single-stage"] <= 5.0 < worst["double-stage"]
    return Finding(holds, worst["single-stage"], f"of the truth at the end: {words}")


def robust(*methods: str) -> Judge:
    """All starts of these methods end together."""

    def judge(numbers: Numbers) -> Finding:
        apart = {method: max(numbers["methods"][method]["spread"]) for method in methods}
        words = ", ".join(f"{method} {value:.2g} %" for method, value in apart.items())
        worst = max(apart.values())
        return Finding(worst <= 5.0, worst, f"starts apart at the end: {words}")

    return judge


def differs(numbers: Numbers) -> Finding:
    """The starts of the double stage end apart."""
    apart = max(numbers["methods"]["double-stage"]["spread"])
    return Finding(apart > 5.0, apart, f"starts apart at the end: {apart:.2g} %")


def worse_than_single_stage(method: str) -> Judge:
    """Return a judge whether another method's error is larger, from its best start."""

    def judge(numbers: Numbers) -> Finding:
        single = max(numbers["methods"]["single-stage"]["rmse"].values())
        other = min(numbers["methods"][method]["rmse"].values())
        words = f"single stage {single:.3g} %, {method} {other:.3g} %"
        return Finding(other > single, other / single, words)

    return judge


def single_stage_sooner(numbers: Numbers) -> Finding:
    """The single stage converges sooner than Kelvin–Voigt."""
    single, linear = time_of(numbers, "single-stage"), time_of(numbers, "kelvin-voigt")
    return Finding(single < linear, single / linear, _both(numbers, single, linear))


def single_stage_as_soon(numbers: Numbers) -> Finding:
    """The single stage takes as long as Kelvin–Voigt."""
    single, linear = time_of(numbers, "single-stage"), time_of(numbers, "kelvin-voigt")
    ratio = single / linear
    return Finding(1.0 / SAME <= ratio <= SAME, ratio, _both(numbers, single, linear))


def single_stage_later(numbers: Numbers) -> Finding:
    """Kelvin–Voigt converges sooner than the single stage."""
    single, linear = time_of(numbers, "single-stage"), time_of(numbers, "kelvin-voigt")
    return Finding(linear < single, single / linear, _both(numbers, single, linear))


def _both(numbers: Numbers, single: float, linear: float) -> str:
    more = _times_beside(numbers, "single-stage", "kelvin-voigt")
    settled = [
        said(_slowest(numbers["methods"][method]["settled"][:2]))
        for method in ("single-stage", "kelvin-voigt")
    ]
    more += f". Until within 5 % of its own final values: {settled[0]} and {settled[1]}"
    return f"single stage {said(single)}, Kelvin–Voigt {said(linear)}; {more}"


def chosen(parameters: str) -> Judge:
    """Return a judge for what the laboratory's material was made to have."""
    return unchecked(f"the laboratory's material was chosen to have it: {parameters} in SI")


def on_both(judge: Judge) -> Judge:
    """Add what a second material would say."""

    def both(numbers: Numbers) -> Finding:
        first, second = judge(numbers), judge(numbers["beside"])
        verdict = "holds" if second.holds else "does not hold"
        words = f"{first.words}. On the relaxing sponge it {verdict}: {second.words}"
        return Finding(first.holds, first.ours, words)

    return both
