"""Fig. 9: from how near the truth the double stage has to start."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.contact import Contact
from palpate.estimators import DoubleStageRLS, SingleStageRLS, VariableProjection
from palpate.force_laws import HuntCrossley
from palpate.identification import Identification
from palpate.paper.curves import median_and_range, plain, traced
from palpate.paper.experiment import Claim, Finding, Outcome, Table
from palpate.paper.identifying import identify
from palpate.paper.judged import Curves, Judged, JudgedExperiment, Numbers
from palpate.paper.near_truth.figure import draw_near_truth
from palpate.paper.sessions import GATE, SI, pressed
from palpate.paper.starts import AGREED, convergence_times, identified
from palpate.settings import Scale
from palpate.validation import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: How far from the final values the starts lie: all three parameters off by that, either way.
OFF = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
WAYS = {
    "all more": (1, 1, 1),
    "all less": (-1, -1, -1),
    "n less": (1, 1, -1),
    "n more": (-1, -1, 1),
}
DRAWN = (0.02, 0.1, 0.3)
OTHERWISE: dict[str, dict[str, Any]] = {
    "0.1, P₀ = 1e4": {"initial_covariance": (1e4, 1e4, 1e3)},
    "0.1, P₀ = 10": {"initial_covariance": (10.0, 10.0, 10.0)},
    "0.1, in cm": {"scale": Scale(10e-3, 10e-3, 1.0)},
}

Starts = Mapping[str, HuntCrossley]


class NearTruth(JudgedExperiment):
    """The double stage on ball and sponge, from starts ever farther from where it should end."""

    caption = (
        "K, B and n of the double stage from starts 2, 10 and 30 % off the truth, which "
        "stay apart. Below: how far apart they end over how far off they start, for ball "
        "and sponge."
    )

    def __init__(self) -> None:
        super().__init__(
            "fig09",
            "Rubber ball, double stage: starts in the vicinity of the final values",
            NEAR_TRUTH_CLAIMS,
        )

    def measure(self, seed: int) -> tuple[dict[str, Any], Curves]:
        """Identify one recording of each material from every start."""
        numbers: dict[str, Any] = {}
        curves: Curves = {}
        for material in ("ball", "sponge"):
            contact = pressed(material, "three-sines", seed)
            truth = json.loads(contact.provenance["truth"])
            law = np.array([truth[name] for name in ("stiffness", "damping", "exponent")])
            numbers[material] = {}
            for off in OFF:
                results = _from(contact, law, off, WAYS, DoubleStageRLS)
                numbers[material][f"{off:g}"] = _summary(results, law)
                if material == "ball" and off in DRAWN:
                    curves |= _curves(f"{off:g}", results)
            if material == "ball":
                projected = identified(contact, VariableProjection())
                curves |= traced("no start/projection", projected)
            # What it would be with a smaller P₀, and in units in which penetrations are near 1.
            for name, settings in OTHERWISE.items():
                results = _from(contact, law, 0.1, WAYS, DoubleStageRLS, **settings)
                numbers[material][name] = _summary(results, law)
            only = {"K and B more": (1, 1, 0), "K and B less": (-1, -1, 0)}
            results = _from(contact, law, 0.5, only, DoubleStageRLS)
            numbers[material]["0.5, n right"] = _summary(results, law)
            results = _from(contact, law, 0.5, WAYS, SingleStageRLS)
            numbers[material]["0.5, single stage"] = _summary(results, law)
        return numbers, curves

    def draw(self, outcomes: Sequence[Outcome], *, dark: bool = False) -> "Figure":
        """Draw the parameters over time, and how far off they end over how far off they start."""
        return draw_near_truth(self.title, DRAWN, OFF, WAYS, outcomes, dark=dark)

    def tables(self, outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
        """Return where the starts end."""
        rows = []
        for material in outcomes[0].numbers:
            for off in outcomes[0].numbers[material]:
                every = [outcome.numbers[material][off] for outcome in outcomes]
                rows.append(
                    (
                        material,
                        off,
                        *(
                            median_and_range((n["error"][i] for n in every), ".2g")
                            for i in range(3)
                        ),
                        median_and_range((max(n["apart"]) for n in every), ".2g"),
                        median_and_range((_slowest(n["times"]) for n in every), ".2g"),
                    )
                )
        header = ("material", "starts off by", "K off [%]", "B off [%]", "n off [%]")
        return (
            Table(
                "Double stage: starts near the truth",
                (*header, "ends apart [%]", "convergence [s]"),
                tuple(rows),
                "Each line is four starts, K and B and n off both ways, or two with n as it is; "
                "what is shown is the worst of them at the end.",
            ),
        )


def _from(
    contact: Contact,
    law: Floats,
    off: float,
    ways: Mapping[str, tuple[int, int, int]],
    kind: type[DoubleStageRLS] | type[SingleStageRLS],
    **settings: Any,
) -> dict[str, Identification]:
    return {
        way: identify(
            contact,
            kind(
                initial=HuntCrossley(*(law * (1.0 + off * np.array(signs))).tolist()),
                **{"gate": GATE, "scale": SI, **settings},
            ),
        )
        for way, signs in ways.items()
    }


def _summary(results: Mapping[str, Identification], law: Floats) -> dict[str, Any]:
    final = np.array([result.law.parameters for result in results.values()])
    return {
        "error": plain(100.0 * np.abs(final / law - 1.0).max(axis=0)),
        "apart": plain(100.0 * np.ptp(final, axis=0) / final.mean(axis=0)),
        "times": plain(convergence_times(list(results.values()))),
    }


def _curves(name: str, results: Mapping[str, Identification]) -> Curves:
    curves: Curves = {}
    for way, result in results.items():
        curves |= traced(f"{name}/{way}", result)
    return curves


def _slowest(times: Sequence[float]) -> float:
    return float("nan") if any(time != time for time in times) else max(times)


def _range(numbers: Mapping[str, Any]) -> float:
    """How far off, in percent, all starts up to there end within 5 % of each other."""
    reach = 0.0
    for off in OFF:
        if max(numbers[f"{off:g}"]["apart"]) > 100.0 * AGREED:
            break
        reach = 100.0 * off
    return reach


def _ends(numbers: Mapping[str, Any]) -> str:
    apart = ", ".join(f"{off:.0%}: {max(numbers[f'{off:g}']['apart']):.2g} %" for off in OFF)
    right = max(numbers["0.5, n right"]["apart"])
    words = f"off at the start and apart at the end: {apart}; 50 % with n right: {right:.2g} %"
    return words + _otherwise(numbers)


def _otherwise(numbers: Mapping[str, Any]) -> str:
    return "".join(f"; {name}: {max(numbers[name]['apart']):.2g} %" for name in OTHERWISE)


def small_range(numbers: Numbers) -> Finding:
    """On the ball starts agree at the end only if they are near each other at the start."""
    reach = _range(numbers["ball"])
    return Finding(0.0 < reach < 50.0, reach, _ends(numbers["ball"]))


def within_ten(numbers: Numbers) -> Finding:
    """On the sponge starts within 10 % agree at the end, and those beyond do not."""
    reach = _range(numbers["sponge"])
    return Finding(reach == 10.0, reach, _ends(numbers["sponge"]))


NEAR_TRUTH_CLAIMS: tuple[Judged, ...] = (
    (
        Claim(
            "small-range",
            "V-A-4, Fig. 9",
            "The double-stage method produces consistent and converging results only for a small "
            "range of initial conditions.",
            unit="%",
            assumption="consistent: within 5 % of each other at the end; P₀ = 1e8 for K and B, "
            "1e3 for n",
            measured="off at the start, to end within 5 %",
        ),
        small_range,
    ),
    (
        Claim(
            "within-ten",
            "V-B-3",
            "Our experiments show that the double-stage method can only converge when the initial "
            "conditions are within 10% of their final values.",
            "10 %",
            "%",
            "K, B and n all off by that; converged: within 5 % of each other at the end; P₀ = 1e8 "
            "for K and B, 1e3 for n",
            measured="off at the start, to end within 5 %",
        ),
        within_ten,
    ),
)
NEAR_TRUTH = (NearTruth(),)
