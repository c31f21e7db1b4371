"""What section VI says of the excitation that each model needs."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from palpate.paper.experiment import Claim, Finding
from palpate.paper.judged import Judged, Numbers

P0 = (
    "P₀: the default, in SI 1e3 for the single stage and 1e8 for Kelvin–Voigt; the paper gives none"
)
SIMILAR = 5.0


def _slowest(times: Sequence[float]) -> float:
    return max(math.inf if math.isnan(time) else time for time in times)


def _said(time: float) -> str:
    return "not in the time" if math.isinf(time) else f"{time:.3g} s"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _apart(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """Largest difference of a final value between two motions, %."""
    differences: list[float] = [
        100.0 * abs(a / b - 1.0)
        for start in one["final"]
        for a, b in zip(one["final"][start], other["final"][start], strict=True)
    ]
    return max(differences)


def _by_covariance(numbers: Mapping[str, Any]) -> str:
    return ", ".join(f"{p0}: {_said(_slowest(t))}" for p0, t in numbers.items())


def two_enough(numbers: Numbers) -> Finding:
    """Two sines end where three do."""
    apart = _apart(numbers["two sines"], numbers["three sines"])
    time = _slowest(numbers["two sines"]["times"])
    words = f"final values differ by at most {apart:.2g} %; starts agree after {_said(time)}"
    return Finding(apart <= SIMILAR and math.isfinite(time), apart, words)


def one_converges(numbers: Numbers) -> Finding:
    """One sine makes the starts agree."""
    time = _slowest(numbers["one sine"]["times"])
    return Finding(math.isfinite(time), _finite(time), f"starts agree after {_said(time)}")


def one_slower(numbers: Numbers) -> Finding:
    """One sine takes much longer than three."""
    one, three = (_slowest(numbers[name]["times"]) for name in ("one sine", "three sines"))
    ratio = one / three
    words = (
        f"one sine {_said(one)}, three {_said(three)}; by P₀ on the rig, "
        f"{_by_covariance(numbers['one sine']['by covariance'])}"
    )
    return Finding(ratio >= 2.0, _finite(ratio), words)


def five_hundred(numbers: Numbers) -> Finding:
    """One sine takes 500 s."""
    time = _slowest(numbers["one sine"]["times"])
    projected = _slowest(numbers["one sine"]["projection"]["times"])
    words = (
        f"{_said(time)} with P₀ = 1e3; in 450 s of an ideal probe, by P₀, "
        f"{_by_covariance(numbers['long'])}: the time goes as 1/P₀, and 500 s take a P₀ below "
        f"0.1. Variable projection is within 5 % of the truth after {_said(projected)}"
    )
    return Finding(math.isfinite(time) and time > 100.0, _finite(time), words)


def one_consistent(numbers: Numbers) -> Finding:
    """One sine ends where three do."""
    apart = _apart(numbers["one sine"], numbers["three sines"])
    return Finding(apart <= SIMILAR, apart, f"final values differ by at most {apart:.2g} %")


def not_enough(numbers: Numbers) -> Finding:
    """One sine does not excite a linear system with three parameters."""
    condition = numbers["one sine"]["conditioning"]
    words = (
        "condition numbers of unit columns: "
        + ", ".join(f"[{name}] {value:.3g}" for name, value in condition.items())
        + ". A sine about a depth tells three linear parameters apart, and better than the "
        "logarithm's"
    )
    worst = max(condition["1, v, x"], condition["x, v, a"])
    return Finding(worst > 1e6, worst, words)


def richer(numbers: Numbers) -> Finding:
    """The logarithm makes the excitation richer."""
    condition = numbers["one sine"]["conditioning"]
    logarithm, linear = condition["1, v, ln x"], condition["1, v, x"]
    words = f"condition number [1, v, ln x] {logarithm:.3g}, [1, v, x] {linear:.3g}"
    return Finding(logarithm < linear / 2.0, logarithm / linear, words)


def linear_enough(numbers: Numbers) -> Finding:
    """One sine makes the starts of Kelvin–Voigt agree."""
    one, two = (_slowest(numbers[name]["times"]) for name in ("one sine", "two sines"))
    words = (
        f"one sine {_said(one)}, two {_said(two)}; one sine by P₀, "
        f"{_by_covariance(numbers['one sine']['by covariance'])}"
    )
    return Finding(math.isfinite(one), _finite(one), words)


def linear_sooner(numbers: Numbers) -> Finding:
    """On one sine Kelvin–Voigt converges before Hunt–Crossley."""
    linear = _slowest(numbers["one sine"]["times"])
    hunt = _slowest(numbers["one sine"]["other"][:2])
    words = f"one sine: Kelvin–Voigt {_said(linear)}, single stage {_said(hunt)}"
    return Finding(linear < hunt, _finite(linear / hunt), words)


HUNT_CROSSLEY_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "two-enough",
            "VI-A, Fig. 17",
            "The trajectory with two sine waves is rich enough and the parameters converge to "
            "similar values for the case where three sinusoidal waves were used, as reported in "
            "Fig. 8.",
            unit="%",
            assumption=f"similar: within {SIMILAR:g} %. {P0}",
            measured="final values apart from those of three sines",
        ),
        two_enough,
    ),
    (
        Claim(
            "one-converges",
            "VI-A, Fig. 17",
            "Using a single sine component to build the trajectory command, the parameters still "
            "converge",
            unit="s",
            assumption=P0,
            measured="time",
        ),
        one_converges,
    ),
    (
        Claim(
            "one-slower",
            "VI-A, Fig. 17",
            "but at a substantially slower rate,",
            unit="×",
            assumption=f"substantially: twice the time. {P0}",
            measured="time of one sine over three",
        ),
        one_slower,
    ),
    (
        Claim(
            "five-hundred",
            "VI-A, Fig. 17",
            "i.e., after 500 s (the figure only shows the first 120 s).",
            "500 s",
            "s",
            f"{P0}. It hangs on P₀ alone",
            measured="time",
        ),
        five_hundred,
    ),
    (
        Claim(
            "one-consistent",
            "VI-A, Fig. 17",
            "The results from the single sine input are consistent with the results reported in "
            "Section V-A,",
            unit="%",
            assumption=f"consistent: within {SIMILAR:g} %. {P0}",
            measured="final values apart from those of three sines",
        ),
        one_consistent,
    ),
    (
        Claim(
            "not-enough",
            "VI-A",
            "while the excitation level of the trajectory command is not high enough for a general "
            "linear system with three parameters.",
            assumption="not high enough: a condition number above 1e6, of [1, v, x] or of mass, "
            "damper and spring",
            measured="condition number",
        ),
        not_enough,
    ),
    (
        Claim(
            "richer",
            "VI-A",
            "This behavior can be related to the effect of nonlinearity of the ln(·) function in "
            "making the excitation richer.",
            unit="×",
            assumption="richer: half the condition number of [1, v, x], in SI",
            measured="condition number over that of [1, v, x]",
        ),
        richer,
    ),
)

KELVIN_VOIGT_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "one-enough",
            "VI-A, Fig. 18",
            "For the KV model, only two parameters need to be identified; even one sinusoidal "
            "component is rich enough for convergence, as shown in Fig. 18.",
            unit="s",
            assumption=P0,
            measured="time",
        ),
        linear_enough,
    ),
    (
        Claim(
            "sooner",
            "VI-A",
            "A linear KV model might serve as a better alternative, since fewer dynamic parameters "
            "need to be identified, the model parameters may converge faster.",
            unit="×",
            assumption=f"stiffness and damping, one sine. {P0}",
            measured="Kelvin–Voigt over single stage, time",
        ),
        linear_sooner,
    ),
)
