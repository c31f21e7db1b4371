"""What section V-A-3 says of forgetting factor and covariance."""

import itertools
import math
from collections.abc import Mapping
from typing import Any

from palpate.paper.experiment import Claim, Finding
from palpate.paper.judged import Judged, Numbers

# Convergence is "similar", and fluctuation "severe", beyond these; ours.
SIMILAR, SEVERE = 1.5, 3.0
TIMED = (
    "timed until K, B and n are within 5 % of the truth for good, from K = 0.1, B = 0, n = 1, with "
    "P₀ = 1e3 where P₀ is not the question"
)


def _time(summary: Mapping[str, Any]) -> float:
    return max(math.inf if math.isnan(time) else time for time in summary["times"])


def _said(time: float) -> str:
    return "never" if math.isinf(time) else f"{time:.2f} s"


def slow(numbers: Numbers) -> Finding:
    """Λ = 1 takes longer than α = 5."""
    plain, fading = (_time(numbers["profiles"][name]) for name in ("λ = 1", "α = 5"))
    return Finding(plain > fading, plain, f"λ = 1: {_said(plain)}, α = 5: {_said(fading)}")


def constant_unstable(numbers: Numbers) -> Finding:
    """A constant λ < 1 leaves the truth by 5 % again and again; held, it is lost."""
    names = [name for name in numbers["profiles"] if name.startswith("λ = 0")]
    largest = {name: max(numbers["profiles"][name]["largest"]) for name in names}
    held = {
        name: max(numbers["held"][name]["largest"]) for name in names if name in numbers["held"]
    }
    guarded = max(numbers["held"][name]["guarded"] for name in held)
    words = "largest error in the second half: " + ", ".join(
        f"{name} {value:.3g} %" for name, value in largest.items()
    )
    words += "; held for a minute: " + ", ".join(f"{n} {v:.3g} %" for n, v in held.items())
    words += f"; our covariance guard acted on up to {guarded} samples of it"
    return Finding(min(largest.values()) > 5.0, min(largest.values()), words)


def fluctuates(numbers: Numbers) -> Finding:
    """Under α = 0.1 the parameters scatter more than under α = 5."""
    long, five = (max(numbers["profiles"][name]["scatter"]) for name in ("α = 0.1", "α = 5"))
    words = f"scatter of the worst parameter over the second half: {long:.2g} % and {five:.2g} %"
    return Finding(long > SEVERE * five, long / five, words)


def slowly_unstable(numbers: Numbers) -> Finding:
    """Under α = 0.1 a parameter leaves the truth by more than 5 %."""
    error = max(numbers["profiles"]["α = 0.1"]["largest"])
    held = max(numbers["held"]["α = 0.1"]["largest"])
    words = f"largest error in the second half {error:.3g} %; held for a minute {held:.3g} %"
    return Finding(error > 5.0, error, words)


def best(numbers: Numbers) -> Finding:
    """Of λ = 1, α = 0.1 and α = 5, the last is soonest and steadiest."""
    three = {name: numbers["profiles"][name] for name in ("λ = 1", "α = 0.1", "α = 5")}
    times = {name: _time(summary) for name, summary in three.items()}
    scatter = {name: max(summary["scatter"]) for name, summary in three.items()}
    words = "; ".join(f"{name}: {_said(times[name])}, {scatter[name]:.2g} %" for name in three)
    holds = min(times, key=times.__getitem__) == min(scatter, key=scatter.__getitem__) == "α = 5"
    return Finding(holds, times["α = 5"], f"time and scatter, {words}")


def balance(numbers: Numbers) -> Finding:
    """All of 5 ≤ α ≤ 8 are sooner than λ = 1 and steadier than α = 0.1."""
    names = [f"α = {rate}" for rate in (5, 6, 7, 8)]
    profiles = numbers["profiles"]
    times = [_time(profiles[name]) for name in names]
    scatter = [max(profiles[name]["scatter"]) for name in names]
    sooner = max(times) < _time(profiles["λ = 1"])
    steadier = max(scatter) < max(profiles["α = 0.1"]["scatter"])
    outside = "; ".join(
        f"{name}: {_said(_time(profiles[name]))}, {max(profiles[name]['scatter']):.2g} %"
        for name in ("α = 1", "α = 20")
    )
    words = (
        f"5 to 8: {min(times):.2f} to {max(times):.2f} s, scatter {min(scatter):.2g} to "
        f"{max(scatter):.2g} %; beside it {outside}"
    )
    return Finding(sooner and steadier, max(times), words)


def unity(numbers: Numbers) -> Finding:
    """Λ after a second."""
    factor = 1.0 - 0.01 * math.exp(-5.0)
    return Finding(1.0 - factor < 1e-3, factor, "by the formula")


def alike(numbers: Numbers) -> Finding:
    """Norms above 10 converge alike."""
    times = {name: _time(summary) for name, summary in numbers["covariances"].items()}
    above = {name: time for name, time in times.items() if float(name) > 10.0}
    ratio = max(above.values()) / min(above.values())
    words = ", ".join(f"{name}: {_said(time)}" for name, time in times.items())
    return Finding(ratio <= SIMILAR, ratio if math.isfinite(ratio) else None, words)


def overshoot(numbers: Numbers) -> Finding:
    """The larger P₀, the larger the first overshoot."""
    beyond = {name: max(s["overshoot"][:2]) for name, s in numbers["covariances"].items()}
    above = [value for name, value in beyond.items() if float(name) >= 100.0]
    growing = all(a < b for a, b in itertools.pairwise(above))
    words = ", ".join(f"{name}: {value:.2g}" for name, value in beyond.items())
    return Finding(growing, above[-1], f"in units of the truth, {words}")


def by_start(numbers: Numbers) -> Finding:
    """The overshoot differs more between starts than between covariances."""
    starts = {name: max(s["overshoot"][:2]) for name, s in numbers["starts"].items()}
    sizes = [
        max(numbers["covariances"][name]["overshoot"][:2]) for name in ("100", "1000", "10000")
    ]
    over_starts = max(starts.values()) / max(min(starts.values()), 1e-3)
    over_sizes = max(sizes) / max(min(sizes), 1e-3)
    words = "by start, " + ", ".join(f"{name}: {value:.2g}" for name, value in starts.items())
    words += f"; between P₀ of 100 and 1e4 a factor of {over_sizes:.2g}"
    return Finding(over_starts > over_sizes, over_starts, words)


FORGETTING_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "unity",
            "V-A-3",
            "The initial forgetting factor 0.99 nearly reaches unity in one second according to "
            "the exponential relationship λ = 1 − 0.01 exp(−5(t − 2)).",
            "1 s",
            measured="λ after a second",
        ),
        unity,
    ),
    (
        Claim(
            "slow",
            "V-A-3, Fig. 7",
            "By using the RLS method, i.e., λ = 1, the estimation becomes very slow.",
            unit="s",
            assumption=TIMED,
            measured="time with λ = 1",
        ),
        slow,
    ),
    (
        Claim(
            "constant-unstable",
            "V-A-3",
            "For a constant λ below unity, instability occurs.",
            unit="%",
            assumption="unstable: some parameter is off by more than 5 % in the second half, for "
            "each of λ = 0.99, 0.95 and 0.9; the paper names no λ and its P may overflow, which "
            "our guard prevents",
            measured="largest error late, of the calmest λ",
        ),
        constant_unstable,
    ),
    (
        Claim(
            "fluctuates",
            "V-A-3, Fig. 7",
            "The time constant of 10 s, i.e., α = 0.1, results in severe fluctuations",
            unit="×",
            assumption=f"severe: {SEVERE:g} times as much scatter",
            measured="scatter over that of α = 5",
        ),
        fluctuates,
    ),
    (
        Claim(
            "slowly-unstable",
            "V-A-3, Fig. 7",
            "and instability,",
            unit="%",
            assumption="unstable: as for a constant λ, off by more than 5 % in the second half",
            measured="largest error late",
        ),
        slowly_unstable,
    ),
    (
        Claim(
            "best",
            "V-A-3, Fig. 7",
            "whereas α = 5 provides the best performance.",
            unit="s",
            assumption=f"the soonest and steadiest of the three; {TIMED}",
            measured="time with α = 5",
        ),
        best,
    ),
    (
        Claim(
            "balance",
            "V-A-3",
            "Using λ = 1 − 0.01 exp(−α(t − 2)), with 5 ≤ α ≤ 8, creates a balance between the "
            "convergence rate, sensitivity to noise, and estimation stability.",
            unit="s",
            assumption=f"balance: sooner than λ = 1 and steadier than α = 0.1; {TIMED}",
            measured="time with 5 ≤ α ≤ 8, the longest",
        ),
        balance,
    ),
    (
        Claim(
            "alike",
            "V-A-3",
            "Matrices with norms larger than 10 result in similar convergence rates.",
            "10",
            "×",
            f"similar: within a factor of {SIMILAR:g} from P₀ = 20 to 1e6; {TIMED}",
            measured="slowest over fastest",
        ),
        alike,
    ),
    (
        Claim(
            "overshoot",
            "V-A-3",
            "The larger the norm of P, the larger the magnitude of the initial overshoots of the "
            "estimated parameters.",
            assumption="of stiffness or damping, in units of the truth, from P₀ = 100 on",
            measured="overshoot over the truth at P₀ = 1e6",
        ),
        overshoot,
    ),
    (
        Claim(
            "by-start",
            "V-A-3",
            "The extent of these jumps mainly depends on the initial values of the estimated "
            "parameters.",
            unit="×",
            assumption="mainly: more than on P₀ between 100 and 1e4; of stiffness or damping",
            measured="largest over least overshoot, of the starts",
        ),
        by_start,
    ),
)
