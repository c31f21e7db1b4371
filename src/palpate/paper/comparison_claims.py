"""What the paper says of its methods side by side, and who judges it."""

import math
from collections.abc import Sequence

from palpate.paper.experiment import Claim, Finding
from palpate.paper.judged import Judge, Judged, Numbers

#: Two convergence times are "the same" within this factor; ours.
SAME = 1.5
P0 = (
    "P₀: the defaults, 1e3 for the single stage, 1e8 for Kelvin–Voigt and the double stage, 1e10 "
    "for the extended Kelvin–Voigt, in SI; the paper gives none"
)
SPEED = f"{P0}. The time is that of the slowest of stiffness and damping"
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
    return f"single stage {said(single)}, Kelvin–Voigt {said(linear)}; {more}"


def on_both(judge: Judge) -> Judge:
    """Add what a second material would say."""

    def both(numbers: Numbers) -> Finding:
        first, second = judge(numbers), judge(numbers["beside"])
        verdict = "holds" if second.holds else "does not hold"
        words = f"{first.words}. On the relaxing sponge it {verdict}: {second.words}"
        return Finding(first.holds, first.ours, words)

    return both


_BETTER = (
    "It is clear from the results that the single-stage method outperforms the double-stage method "
    "in terms of convergence rate, i.e., speed of convergence at the beginning of the "
    "identification process, force prediction error, and consistency of estimation."
)

BALL_CLAIMS: tuple[Judged, ...] = (
    (Claim("rate", "V-A-4, Fig. 8", _BETTER, "convergence rate", "s", P0), rate),
    (
        Claim("error", "V-A-4, Fig. 8, Table II", _BETTER, "force prediction error", "× ours", P0),
        smaller_error,
    ),
    (Claim("consistency", "V-A-4, Fig. 8", _BETTER, "consistency", "%", P0), consistency),
    (
        Claim(
            "wide-range",
            "V-A-4, Fig. 8",
            "The single-stage method is capable of identifying the environment dynamic parameters "
            "for a wide range of initial conditions, whereas the double-stage method lacks this "
            "capability.",
            unit="%",
            assumption=f"identified: every parameter within 5 % of the truth at the end. {P0}",
        ),
        wide_range,
    ),
    (
        Claim(
            "kelvin-voigt-error",
            "V-A-5, Fig. 8, Table II",
            "The larger prediction error for the KV model implies that the HC model better "
            "represents the physical properties of the object.",
            unit="× single stage",
            assumption=IN_CLASS.format("ball")
            + ": the error is checked, the implication cannot be",
        ),
        worse_than_single_stage("kelvin-voigt"),
    ),
    (
        Claim(
            "kelvin-voigt-rate",
            "V-A-5, Fig. 8",
            "Although parameters converge for both models, the convergence time is shorter for the "
            "single-stage method.",
            unit="× Kelvin–Voigt",
            assumption=SPEED,
        ),
        single_stage_sooner,
    ),
)

SPONGE_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "kelvin-voigt-rate",
            "V-B-3, Fig. 13",
            "The speed of parameter convergence for the EWRLS applied to the single-stage method "
            "for HC model is the same as that of the KV model",
            unit="× Kelvin–Voigt",
            assumption=f"{SPEED}. The same: within a factor of {SAME:g}",
        ),
        on_both(single_stage_as_soon),
    ),
    (
        Claim(
            "insensitive",
            "V-B-3, Fig. 13",
            "and is not sensitive to the large changes in the initial conditions.",
            unit="%",
            assumption=P0,
        ),
        on_both(robust("single-stage", "kelvin-voigt")),
    ),
    (
        Claim(
            "inconsistent",
            "V-B-3, Fig. 13",
            "In contrast, the double-stage method shows inconsistent results for such a large "
            "range of initial conditions.",
            unit="%",
            assumption=P0,
        ),
        on_both(differs),
    ),
    (
        Claim(
            "kelvin-voigt-error",
            "V-B-3, Table IV",
            "In terms of model force prediction, a larger force prediction error is observed for "
            "the identified KV model of the sponge than the HC model that uses the single-stage "
            "method.",
            unit="× single stage",
            assumption=IN_CLASS.format("sponge") + ", but not in the relaxing sponge",
        ),
        on_both(worse_than_single_stage("kelvin-voigt")),
    ),
    (
        Claim(
            "double-stage-error",
            "V-B-3, Table IV",
            "The double-stage method shows larger prediction errors for all sets of initial "
            "conditions.",
            unit="× single stage, least of the starts",
            assumption=f"larger than the single stage's. {P0}",
        ),
        on_both(smaller_error),
    ),
)
