"""What the paper says of its methods on the PVC phantom, section V-C-3."""

from palpate.paper.comparison.judges import (
    IN_CLASS,
    P0,
    SPEED,
    chosen,
    differs,
    finite,
    robust,
    said,
    single_stage_later,
    time_of,
)
from palpate.paper.experiment import Claim, Finding
from palpate.paper.judged import Judged, Numbers

EXTENDED = "extended-kelvin-voigt"


def first_small(numbers: Numbers) -> Finding:
    """Stiffness and damping of the single stage pass small values at first, from every start."""
    single = numbers["methods"]["single-stage"]
    shares = [
        single["least of the first"][start][row] / single["final"][start][row]
        for start in single["final"]
        for row in (0, 1)
    ]
    words = (
        f"in the first 20 ms of contact K and B come down to at most {max(shares):.2g} of their "
        "final values, from every start"
    )
    return Finding(max(shares) < 0.1, max(shares), words)


def extended_soonest(numbers: Numbers) -> Finding:
    """B of the extended model converges before that of the others."""
    extended = time_of(numbers, EXTENDED, (2,))
    others = {name: time_of(numbers, name, (1,)) for name in ("single-stage", "kelvin-voigt")}
    words = ", ".join(f"{name} {said(time)}" for name, time in others.items())
    return Finding(
        extended < min(others.values()),
        finite(extended),
        f"B: extended {said(extended)}, {words}. The laboratory's phantom has K₁ = 0, of which no "
        "share can be taken",
    )


def quadratic_never(numbers: Numbers) -> Finding:
    """The starts of K₂ never agree."""
    time = time_of(numbers, EXTENDED, (1,))
    same = numbers["methods"][EXTENDED]["same covariance"]
    never = [variance for variance, times in same.items() if times[1] != times[1]]
    words = (
        f"K₂ converges after {said(time)}; never with P₀ = {', '.join(never) or 'none of these'}"
    )
    return Finding(time == float("inf"), finite(time), words)


def best_error(numbers: Numbers) -> Finding:
    """The single stage has less error than both linear models."""
    rmse = {name: numbers["methods"][name]["rmse"].values() for name in numbers["methods"]}
    single = max(rmse["single-stage"])
    others = {name: min(rmse[name]) for name in ("kelvin-voigt", EXTENDED)}
    words = ", ".join(f"{name} {value:.3g} %" for name, value in others.items())
    least = min(others.values())
    return Finding(least > single, least / single, f"single stage {single:.3g} %, {words}")


def as_good(numbers: Numbers) -> Finding:
    """The extended model's error is that of the single stage, and less than Kelvin–Voigt's."""
    rmse = {name: min(numbers["methods"][name]["rmse"].values()) for name in numbers["methods"]}
    ratio = rmse[EXTENDED] / rmse["single-stage"]
    words = ", ".join(
        f"{name} {rmse[name]:.3g} %" for name in ("single-stage", EXTENDED, "kelvin-voigt")
    )
    return Finding(ratio < 1.1 and rmse[EXTENDED] < rmse["kelvin-voigt"], ratio, words)


PHANTOM_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "parameters",
            "V-C",
            "In this section, we study the distinct dynamic behavior of a PVC phantom, which is "
            "characterized by an n value close to 2.",
            "2",
        ),
        chosen("K = 1e5, B = 2e5, n = 2"),
    ),
    (
        Claim(
            "robust",
            "V-C-3, Fig. 16",
            "The single-stage method for the HC model and the KV model are robust to initial "
            "conditions in terms of consistency.",
            unit="%",
            assumption=P0,
            measured="starts apart at the end, the worst",
        ),
        robust("single-stage", "kelvin-voigt"),
    ),
    (
        Claim(
            "first-small",
            "V-C-3, Fig. 16",
            "The parameters Kc and Bc identified using the single-stage method converge to small "
            "values for all initial condition sets in the first few milliseconds after contact. "
            "Then, all the parameters converge to a constant higher value.",
            "the first few milliseconds",
            "",
            f"small: below a tenth of the final value at some time in the first 20 ms. {P0}",
            measured="K or B over its final value, at its least in 20 ms",
        ),
        first_small,
    ),
    (
        Claim(
            "inconsistent",
            "V-C-3, Fig. 16",
            "However, the double-stage method results in different estimated parameters for the "
            "selected large range of initial conditions.",
            unit="%",
            assumption=P0,
            measured="starts apart at the end",
        ),
        differs,
    ),
    (
        Claim(
            "kelvin-voigt-rate",
            "V-C-3, Fig. 16",
            "The KV model displays a larger convergence rate compared with the single-stage "
            "method.",
            unit="×",
            assumption=SPEED,
            measured="single stage over Kelvin–Voigt, time",
        ),
        single_stage_later,
    ),
    (
        Claim(
            "extended-rate",
            "V-C-3, Fig. 16",
            "The EKV model estimation results in the fastest convergence rate for Ke1 and Be.",
            unit="s",
            assumption=f"judged by B alone, for our K₁ is 0. {P0}",
            measured="time of B",
        ),
        extended_soonest,
    ),
    (
        Claim(
            "quadratic-never",
            "V-C-3, Fig. 16",
            "However, the parameter Ke2 does not converge to any consistent value for different "
            "initial conditions. This is primarily due to small penetration x and, as a result, "
            "small x² which naturally decreases the contribution of its coefficient Ke2 in the "
            "model-predicted force.",
            unit="s",
            assumption=f"{P0}. So small an x² moves K₂ only under a large P₀",
            measured="time of K₂",
        ),
        quadratic_never,
    ),
    (
        Claim(
            "best-error",
            "V-C-3, Table VI",
            "The HC model, on the other hand, better approximates the dynamic behavior of the PVC "
            "tissue with lower %RMSE compared with those of the KV and EKV models.",
            unit="×",
            assumption=IN_CLASS.format("phantom"),
            measured="better of the linear models over single stage",
        ),
        best_error,
    ),
    (
        Claim(
            "as-good",
            "V-C, of its reference [2]",
            "The second-order polynomial plus viscous friction predicts the contact force with the "
            "same accuracy as that of the HC model and is more accurate than the KV and other "
            "polynomial models.",
            unit="×",
            assumption="the same: within 10 %. " + IN_CLASS.format("phantom"),
            measured="extended Kelvin–Voigt over single stage",
        ),
        as_good,
    ),
)
