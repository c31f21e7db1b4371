"""What the paper says of its methods side by side on ball and sponge."""

from palpate.paper.comparison.judges import (
    IN_CLASS,
    P0,
    SAME,
    SPEED,
    chosen,
    consistency,
    differs,
    on_both,
    rate,
    robust,
    single_stage_as_soon,
    single_stage_sooner,
    smaller_error,
    wide_range,
    worse_than_single_stage,
)
from palpate.paper.experiment import Claim
from palpate.paper.judged import Judged

BALL_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "rate",
            "V-A-4, Fig. 8",
            "It is clear from the results that the single-stage method outperforms the "
            "double-stage method in terms of convergence rate, i.e., speed of convergence at the "
            "beginning of the identification process,",
            unit="s",
            assumption=P0,
            measured="time of the single stage",
        ),
        rate,
    ),
    (
        Claim(
            "error",
            "V-A-4, Fig. 8, Table II",
            "force prediction error,",
            unit="×",
            assumption=P0,
            measured="double stage over single stage, least of the starts",
        ),
        smaller_error,
    ),
    (
        Claim(
            "consistency",
            "V-A-4, Fig. 8",
            "and consistency of estimation.",
            unit="%",
            assumption=P0,
            measured="starts of the double stage apart at the end",
        ),
        consistency,
    ),
    (
        Claim(
            "wide-range",
            "V-A-4, Fig. 8",
            "The single-stage method is capable of identifying the environment dynamic parameters "
            "for a wide range of initial conditions, whereas the double-stage method lacks this "
            "capability.",
            unit="%",
            assumption=f"identified: every parameter within 5 % of the truth at the end. {P0}",
            measured="worst error of the single stage",
        ),
        wide_range,
    ),
    (
        Claim(
            "kelvin-voigt-error",
            "V-A-5, Fig. 8, Table II",
            "The larger prediction error for the KV model implies that the HC model better "
            "represents the physical properties of the object.",
            unit="×",
            assumption=IN_CLASS.format("ball")
            + ": the error is checked, the implication cannot be",
            measured="Kelvin–Voigt over single stage",
        ),
        worse_than_single_stage("kelvin-voigt"),
    ),
    (
        Claim(
            "kelvin-voigt-rate",
            "V-A-5, Fig. 8",
            "Although parameters converge for both models, the convergence time is shorter for the "
            "single-stage method.",
            unit="×",
            assumption=SPEED,
            measured="single stage over Kelvin–Voigt, time",
        ),
        single_stage_sooner,
    ),
    (
        Claim(
            "parameters",
            "V-C",
            "The elastic rubber ball with Kc and Bc of relatively the same order (about 2000)",
            "2000",
        ),
        chosen("K = B = 2000, n = 1"),
    ),
)

SPONGE_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "kelvin-voigt-rate",
            "V-B-3, Fig. 13",
            "The speed of parameter convergence for the EWRLS applied to the single-stage method "
            "for HC model is the same as that of the KV model",
            unit="×",
            assumption=f"{SPEED}. The same: within a factor of {SAME:g}",
            measured="single stage over Kelvin–Voigt, time",
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
            measured="starts apart at the end, the worst",
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
            measured="starts apart at the end",
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
            unit="×",
            assumption=IN_CLASS.format("sponge") + ", but not in the relaxing sponge",
            measured="Kelvin–Voigt over single stage",
        ),
        on_both(worse_than_single_stage("kelvin-voigt")),
    ),
    (
        Claim(
            "double-stage-error",
            "V-B-3, Table IV",
            "The double-stage method shows larger prediction errors for all sets of initial "
            "conditions.",
            unit="×",
            assumption=f"larger than the single stage's. {P0}",
            measured="double stage over single stage, least of the starts",
        ),
        on_both(smaller_error),
    ),
    (
        Claim(
            "parameters",
            "V-C",
            "and the sponge with a Bc that was about ten times larger than its Kc value. For both "
            "objects, the value of n was estimated to be approximately 1.",
            "10",
        ),
        chosen("K = 300, B = 3000, n = 1"),
    ),
)
