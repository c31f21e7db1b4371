"""A late force: the skew that touches of a spring show, and what it does for materials that relax.

    python -m benchmarks.late_force --touches 40 --materials 60

The springs have friction to 1 % of the force and a loss factor to .001. Each material is recorded
by a rig whose force is 1 to 6 ms late or early, and identified without and with the skew of a touch
by that rig. The truth of B′, at the working depth and the motion's frequency, is the law's.
"""

import math

import numpy as np

import palpate
from benchmarks.bank.springs import imperfect, touch
from benchmarks.bank.trials import rise
from benchmarks.common.report import markdown_table, run_command, show
from palpate.force_laws import FlatSpectrum, GeneralisedHuntCrossley, SingleRelaxation

RATE = 1000.0  # Hz
NO_SPRING = {
    "rubber that relaxes": {"relaxing": [(0.1, 0.03), (0.1, 0.3), (0.1, 3.0)]},
    "one speed": {"slow": 2.0, "quick": 4.0},
    "friction of 5 %": {"friction": 0.05},
}


def relaxing_material(random: np.random.Generator) -> GeneralisedHuntCrossley:
    """Return a material of which 20 to 60 % of the stiffness relaxes."""
    n = random.uniform(1.0, 1.8)
    stiffness = 10 ** random.uniform(2.7, 3.7) * 5e-3 ** (1.0 - n)  # N/m at 5 mm: 500 to 5000
    part = random.uniform(0.25, 1.5)
    shortest = 10 ** random.uniform(-3.0, -1.5)
    spectrum = (
        SingleRelaxation(10 ** random.uniform(-1.5, 0.3))
        if random.random() < 0.4
        else FlatSpectrum(shortest, shortest * 10 ** random.uniform(1.5, 3.5))
    )
    return GeneralisedHuntCrossley(
        K=stiffness,
        n=n,
        B=stiffness * random.uniform(0.1, 1.0),
        p=n,
        M=part * stiffness,
        relaxation=spectrum,
    )


def record(
    law: GeneralisedHuntCrossley, late: float, random: np.random.Generator
) -> palpate.Contact:
    """Return ten seconds on a material: an approach and three sines of up to 5 Hz."""
    fine = np.arange(0.0, 12.0, 0.1 / RATE)
    frequencies = (random.uniform(0.4, 1.0), 2.0, random.uniform(3.0, 5.0))  # Hz
    waves = np.zeros_like(fine)
    for amplitude, frequency in zip((1.5e-3, 1e-3, 0.4e-3), frequencies, strict=True):
        phase = random.uniform(0.0, 6.0)
        waves += amplitude * np.sin(math.tau * frequency * fine + phase)
    depth = -1e-3 + rise((fine - 1.0) / 0.8) * (6e-3 + waves)
    force = law.force_along(depth, np.gradient(depth, fine), 0.1 / RATE)
    force = np.where(depth > 0.0, np.maximum(force, 0.0), 0.0)
    time, recorded = fine[::10], np.interp(fine - late, fine, force)[::10]
    recorded += 2e-3 * recorded.max() * random.normal(size=time.size)
    depth = depth[::10] + 2e-6 * random.normal(size=time.size)
    return palpate.prepare(time=time, penetration=depth, force=recorded)


def measure_touches(count: int) -> None:
    """Print how well the touches show the skew, and which ones are refused."""
    errors, bars = [], []
    for seed in range(count):
        contact, late = imperfect(seed)
        delay = palpate.skew(contact).delay
        errors.append(abs(delay.value - late) / delay.whole_error)
        bars.append(1e3 * delay.whole_error)
    within = f"{100.0 * np.mean(np.array(errors) <= 2.0):.0f} %"
    lines = [["springs", count, within, f"{max(bars):.3f}", 0]]
    for name, fault in NO_SPRING.items():
        refused = 0
        for seed in range(10):
            try:
                palpate.skew(touch(seed, **fault)[0])  # type: ignore[arg-type]  # its options
            except palpate.RecordingError:
                refused += 1
        lines.append([name, 10, "–", "–", refused])
    show(markdown_table(("touches", "count", "≤ 2 bars", "largest bar [ms]", "refused"), lines))


def measure_materials(count: int) -> None:
    """Print how the damping of materials that relax comes out without and with the touch."""
    lines = []
    for name in ("without", "with the touch"):
        found = []
        for seed in range(count):
            random = np.random.default_rng(7000 + seed)
            law = relaxing_material(random)
            late = random.choice([-1.0, 1.0]) * random.uniform(1e-3, 6e-3)
            contact = record(law, late, random)
            if name != "without":
                friction, loss = random.uniform(0.0, 0.01), random.uniform(0.0, 1e-3)
                spring, _ = touch(9000 + seed, late=late, friction=friction, loss=loss)
                delay = palpate.skew(spring).delay
                pair = delay.value, delay.whole_error
                contact = palpate.prepare(
                    time=contact.time,
                    penetration=contact.penetration,
                    force=contact.force,
                    delay=pair,
                )
            result = palpate.identify(contact, trace=False)
            there = result.working_depths[0]
            whole = law.dynamic_stiffness(there.depth, result.frequency)
            truth = whole.imag / result.frequency
            error = abs(there.damping.value - truth)
            trusted = result.diagnosis.verdict.damping == "trust"
            found.append((error / truth, error / there.damping.whole_error, trusted))
        off, in_bars, trusted = np.array(found, dtype=float).T
        lines.append(
            [
                name,
                f"{100 * np.median(off):.1f}, {100 * np.percentile(off, 90):.1f} %",
                f"{100 * np.mean(in_bars <= 2.0):.0f} %",
                int(trusted.sum()),
                int((trusted * (off > 0.2)).sum()),
            ]
        )
    headings = ("skew", "B′ off, median and 90 %", "≤ 2 bars", "*trust*", "of these off > 20 %")
    show(markdown_table((f"{count} materials, {headings[0]}", *headings[1:]), lines))


def main(*, touches: int = 40, materials: int = 60) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    touches
        Number of touches of springs; ten more of each kind that is none.
    materials
        Number of materials that relax.
    """
    measure_touches(touches)
    measure_materials(materials)


if __name__ == "__main__":
    run_command(main)
