"""An unknown contact point, off by up to 2 mm."""

from functools import partial

import numpy as np

from benchmarks.accuracy.campaign import Campaign
from benchmarks.accuracy.probing import MATERIALS, NOISE, approach_and_probe, feed, noise
from benchmarks.accuracy.table import Group, Limit, Line
from palpate import VariableProjection
from palpate.design.precision import cramer_rao_bound

DURATION = 20.0  # s, including the approach
UNKNOWN = 2e-3  # m


def contact_point(campaign: Campaign) -> list[Group]:
    lines, notes = [], [f"{campaign.seeds} seeds."]
    for material, law in MATERIALS.items():
        runs = campaign.map(material, partial(_run, material), range(campaign.seeds))
        errors = np.array([error for error, _ in runs])
        lost = sum(bool(flags) for _, flags in runs)
        if lost:
            notes.append(f"{material}: {lost} of {len(runs)} estimates carry a flag.")
        motion = approach_and_probe(DURATION)
        x, v = motion.penetration, motion.velocity
        bound = cramer_rao_bound(law, x, v, NOISE, offset=True, surface=True)
        bounds = (100.0 * bound[0] / law.stiffness, 1e6 * bound[-1])
        for i, (what, highest) in enumerate((("K, %", 1.5), ("surface, µm", 40.0))):
            worst, late = np.percentile(np.abs(errors[:, i]), [100.0, 95.0])
            rms = float(np.sqrt(np.mean(errors[:, i] ** 2)))
            limits = (Limit(highest),) if material == "PVC" else ()
            beside = (rms, bounds[i], rms / bounds[i])
            figure = f"{material}, error of {what}"
            lines.append(Line(figure, (float(late), float(worst)), limits, beside))
    return [
        Group(
            "Unknown contact point",
            "True x and v, shifted by up to ±2 mm, 0.05 N of noise; one second of approach "
            "from 3 mm above the surface, then three sines to 20 s; `VariableProjection("
            'surface="estimate")`. The bound treats offset and surface as nuisance parameters.',
            ("95th percentile", "worst"),
            lines,
            ("rms", "bound", "rms / bound"),
            precision=".3f",
            notes=notes,
        )
    ]


def _run(material: str, seed: int) -> tuple[tuple[float, float], tuple[str, ...]]:
    """Return errors of K [%] and of the surface [µm], and the flags."""
    law, rng = MATERIALS[material], np.random.default_rng(seed)
    motion = approach_and_probe(DURATION)
    x, v = motion.penetration, motion.velocity
    shift = rng.uniform(-UNKNOWN, UNKNOWN)
    f = law.force(x, v) + noise(rng, len(x))
    estimator = VariableProjection(surface="estimate")
    (estimate,) = feed(estimator, x + shift, v, f, [len(x)])
    stiffness = 100.0 * (float(estimate.parameters[0]) / law.stiffness - 1.0)
    return (stiffness, 1e6 * (estimate.surface - shift)), estimate.flags
