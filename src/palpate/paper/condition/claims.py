"""What the paper says of Figs. 6, 12 and 15, and when that is taken to hold."""

import math
from typing import Any

from palpate.paper.experiment import Claim, Finding
from palpate.paper.report.verdicts import readable

TITLES = {
    "fig06": "Rubber ball, condition 10",
    "fig12": "Sponge, condition 10",
    "fig15": "PVC phantom, condition 10",
}

FROM = "after the first sample taken"
OPEN = (
    "Hinges on P₀ and on the force from which samples are taken, of which the paper gives neither "
    "(see the table). “Approximately” is read as a factor of two."
)
HOLDS = "until it holds for 2 s"
FASTEST = "the highest speed after 5 s"
# "Approximately" and "5 s" are read as a factor of two either way.
FACTOR = 2.0
# A small margin is read as under a quarter of the limit.
SMALL = 0.25
# "A few samples" may be broken where the condition is said to be met: this share of the contact.
FEW = 0.005

_LINEAR = "For the sponge with B = 10 K, as section V-B says: its limit is 10 mm/s for ever."
_RELAXING = (
    "For a sponge that relaxes (B = K and a slow branch beside): one of the shapes in which the "
    "paper's B = 10 K and its Fig. 12 could agree."
)
_FIVE = "The figure shows that condition (10) is violated for the first 5 s of contact."
_SMALL = "However, from that point on, condition (10) is met with a small margin."

CLAIMS: dict[str, tuple[Claim, ...]] = {
    "fig06": (
        Claim(
            "holds",
            "V-A-2, Fig. 6",
            "The figure shows that the condition |ẋ| < 0.1 K̂_c/B̂_c is satisfied and the "
            "identification results are valid",
            unit="% of the contact",
            measured="in which it is broken",
            assumption="From the time on that is claimed next.",
        ),
        Claim(
            "from",
            "V-A-2, Fig. 6",
            "after approximately 90 ms from the start of the experiment",
            "about 90 ms",
            "ms",
            OPEN,
            FROM,
        ),
    ),
    "fig12": (
        Claim("violated", "V-B-2, Fig. 12", _FIVE, "5 s", "s", _LINEAR, HOLDS),
        Claim(
            "margin", "V-B-2, Fig. 12", _SMALL, "", "× the limit",
            _LINEAR + " Small is read as under a quarter.", FASTEST,
        ),
        Claim("violated-relaxing", "V-B-2, Fig. 12", _FIVE, "5 s", "s", _RELAXING, HOLDS),
        Claim(
            "margin-relaxing", "V-B-2, Fig. 12", _SMALL, "", "× the limit",
            _RELAXING + " Small is read as under a quarter.", FASTEST,
        ),
        Claim(
            "speed",
            "V-B-2",
            "for faster operations, i.e., higher velocity, the identification results lose their "
            "accuracy and consistency … a lower speed of operation is recommended",
            unit="%",
            measured="largest error of K, B or n",
            assumption="B = 10 K; held against the same sines ten times slower, 5 mm/s at most. "
            "Slower, the logarithm's bias goes; but the encoders' steps then are more of the "
            "velocity, which makes B too small. In between there is a best speed: see the table.",
        ),
        Claim(
            "shortcoming",
            "V-B-2",
            "one of the main shortcomings of the single-stage method is that the convergence "
            "conditions may not be met for a highly damped environment",
            unit="% of the contact",
            assumption="B = 10 K, at the speed of the three sines.",
            measured="in which it is broken",
        ),
        Claim(
            "limit",
            "V-B-2",
            "The sponge is less elastic and more damped than the rubber ball, resulting in "
            "substantially lower value for K_c/B_c or a lower boundary on the velocity.",
            unit="mm/s",
            assumption="The lab's materials were chosen so: 100 mm/s for the ball.",
            measured="the limit by the final law",
        ),
        Claim(
            "conservative",
            "III-B",
            "being marginally close to this value, or even slightly violating this condition, does "
            "not necessarily mean that the identification is not valid",
            unit="%",
            measured="largest error of K, B or n",
            assumption="B = 10 K, where the speed is up to five times what is allowed. Valid is "
            "read as within 5 % of the truth.",
        ),
    ),
    "fig15": (
        Claim(
            "final",
            "V-C-2, Fig. 15",
            "Fig. 15 suggests that the final values for K̂_c and B̂_c satisfy the convergence "
            "condition (10)",
            unit="% of the contact",
            measured="faster than the final limit",
            assumption="Up to 0.5 % are taken as the “few samples” that the paper allows for.",
        ),
        Claim(
            "from",
            "V-C-2, Fig. 15",
            "the estimation is valid after approximately 300 ms from the contact moment t = 2 s",
            "about 300 ms",
            "ms",
            OPEN,
            FROM,
        ),
        Claim(
            "moment",
            "V-C-2, Fig. 15",
            "However, the condition is violated for a few samples at t = 8.7 s.",
            "8.7 s",
            "× the limit",
            "Hinges on B/K to 2 %, ours 2 s/m, and on how closely the robot follows: at the "
            "commanded 50.8 mm/s the limit of 50 mm/s would be broken.",
            "the speed at 8.7 s",
        ),
    ),
}  # fmt: skip


def findings_of(name: str, numbers: dict[str, Any]) -> dict[str, Finding]:
    """Hold what was measured against the claims of a figure."""
    return {"fig06": _ball, "fig12": _sponge, "fig15": _phantom}[name](numbers)


def _ball(numbers: dict[str, Any]) -> dict[str, Finding]:
    seen = numbers["ball"]
    return {
        "holds": Finding(seen["violated_after"] == 0.0, 100.0 * seen["violated_after"]),
        "from": _from(seen, 90.0),
    }


def _sponge(numbers: dict[str, Any]) -> dict[str, Finding]:
    found: dict[str, Finding] = {}
    for name, ending in (("sponge", ""), ("relaxing-sponge", "-relaxing")):
        seen = numbers[name]
        seconds, margin = 1e-3 * seen["holds_from"], seen["margin_after_5"]
        never = math.isnan(seconds)
        found[f"violated{ending}"] = Finding(
            not never and _about(seconds, 5.0),
            None if never else seconds,
            f"Broken in {100.0 * seen['violated']:.1f} % of the contact"
            + (", and it never holds for 2 s." if never else "."),
        )
        found[f"margin{ending}"] = Finding(0.0 < margin < SMALL, 1.0 - margin)
    errors = {slower: max(map(abs, each)) for slower, each in numbers["errors"].items()}
    fast, half, slow = errors["1"], errors["2"], errors["10"]
    words = f"{readable(half)} % at half the speed, {readable(slow)} % at a tenth."
    found["speed"] = Finding(fast > slow, fast, words)
    found["conservative"] = Finding(fast <= 5.0, fast)
    linear = numbers["sponge"]
    found["shortcoming"] = Finding(linear["violated"] > 0.0, 100.0 * linear["violated"])
    found["limit"] = Finding(None, linear["final_limit"])
    return found


def _phantom(numbers: dict[str, Any]) -> dict[str, Finding]:
    seen = numbers["pvc"]
    count = int(seen["violated_at_8_7"])
    return {
        "final": Finding(seen["violated_by_final"] <= FEW, 100.0 * seen["violated_by_final"]),
        "from": _from(seen, 300.0),
        "moment": Finding(
            count > 0,
            1.0 - seen["margin_at_8_7"],
            f"{count} samples; after the first 2 s of contact the margin is least at "
            f"{seen['least_margin_at']:.2f} s; fastest {seen['peak_speed']:.1f} mm/s, final limit "
            f"{seen['final_limit']:.1f} mm/s.",
        ),
    }


def _from(seen: dict[str, Any], claimed: float) -> Finding:
    ours = seen["holds_from"]
    loose = seen["variants"]["100000; every positive force"]["holds_from"]
    small = seen["variants"]["10; ours"]["holds_from"]
    words = (
        f"{readable(small)} ms with P₀ = 10; {readable(loose)} ms with P₀ = 10⁵ and every "
        "positive force taken."
    )
    if math.isnan(ours):
        return Finding(False, None, words)
    return Finding(_about(ours, claimed), ours, words)


def _about(ours: float, claimed: float) -> bool:
    return claimed / FACTOR <= ours <= claimed * FACTOR
