"""What the paper says of Figs. 5, 11 and 14."""

from palpate.paper.experiment import Claim

TITLES = {
    "fig05": "Rubber ball, three repetitions",
    "fig11": "Sponge, three repetitions",
    "fig14": "PVC phantom, three repetitions",
}

CHOSEN = "The lab's material was chosen so; what is seen is that the single stage finds it."
SPREAD = "largest spread of K, B or n"
BOTH_NEAR_ONE = "For both objects, the value of n was estimated to be approximately 1."

_AGREE = Claim(
    "agree",
    "V-A-2, Fig. 5",
    "The agreement of the estimated parameters verifies the experimental results and points at "
    "the consistency of the single-stage method.",
    unit="%",
    measured=SPREAD,
    assumption="Agreement is read as in the paper's footnote 3: within 5 %. Our repetitions "
    "differ in noise, bias and encoder phase only; a real material also recovers in between.",
)

CLAIMS: dict[str, tuple[Claim, ...]] = {
    "fig05": (
        _AGREE,
        Claim(
            "stiffness",
            "V-C",
            "the elastic rubber ball with K_c and B_c of relatively the same order (≈ 2000)",
            "about 2000",
            "N/m",
            CHOSEN,
            "K by the single stage",
        ),
        Claim("exponent", "V-C", BOTH_NEAR_ONE, "about 1", assumption=CHOSEN),
        Claim(
            "elastic",
            "V-A",
            "This type of contact, when compared with the other two, displays a dominant elastic "
            "behavior, which returns the probe quickly to its original state once the stress is "
            "removed.",
            unit="s/m",
            measured="B/K by the single stage",
            assumption=CHOSEN,
        ),
    ),
    "fig11": (
        Claim(
            "agree",
            "V-B-2, Fig. 11",
            "Fig. 11 shows the estimated HC parameters of the sponge using the single-stage "
            "identification method for three trials with the Set I initial conditions",
            unit="%",
            measured=SPREAD,
            assumption="Read as: the trials on the sponge agree, within 5 % (footnote 3).",
        ),
        Claim(
            "ratio",
            "V-B-2, Fig. 11",
            "the damping-related parameter B_c of the sponge, which is about ten times higher "
            "than its corresponding K_c value",
            "about 10",
            "s/m",
            CHOSEN,
            "B/K by the single stage",
        ),
        Claim("exponent", "V-C", BOTH_NEAR_ONE, "about 1", assumption=CHOSEN),
        Claim(
            "restitution",
            "V-B",
            "Because of the larger damping property of the sponge, it requires substantially "
            "larger time for restitution.",
            unit="ms",
            measured="to come back from 10 mm, by the law found",
            assumption="Follows from B/K, which the lab chose (ball: 10 ms); the probe never "
            "leaves the material, so nothing was seen.",
        ),
    ),
    "fig14": (
        Claim(
            "exponent",
            "V-C-2, Fig. 14",
            "For PVC phantom, the value of n is close to 2, which is in contrast with its "
            "corresponding value n ≈ 1 for the rubber ball and the sponge.",
            "close to 2",
            assumption=CHOSEN,
        ),
        Claim(
            "differ",
            "V-C-2, Fig. 14",
            "larger differences between the identified values of the PVC phantom for different "
            "trials, compared with those of the rubber ball and the sponge",
            unit="%",
            measured=SPREAD,
            assumption="Of three repetitions each; K takes its unit from n, so that a small "
            "difference in n is a large one in K.",
        ),
        Claim(
            "consistent",
            "V-C-2, Fig. 14",
            "Although there are differences between the estimated values in different repetitions "
            "of the experiment, we found that the results using the single-stage method are more "
            "consistent than the identified values using the double-stage method.",
            unit="×",
            measured="spread of the double stage over that of the single stage",
            assumption="The paper does not show its double-stage repetitions (footnote 5). "
            "From set I; a method that freezes always at one wrong place is consistent too.",
        ),
        Claim(
            "harder",
            "V-C-2",
            "it is more difficult for the robot to penetrate the PVC phantom; therefore, the "
            "excitation level of the identification input signal is affected accordingly",
            unit="×",
            measured="the ball's motion (standard deviation) is reached in PVC",
            assumption="Hinges on the phantom's stiffness and on the stiffness of the robot's "
            "control, of which the paper gives neither. Read as: 2 % less motion than in the ball.",
        ),
    ),
}
