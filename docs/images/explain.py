"""The pictures of the pages that explain; ``make_pictures.py`` writes them with the others."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import palpate
from palpate import figures, lab

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORDINGS = Path(__file__).parents[2] / "examples" / "recordings"
WIDTH = 150e-3  # m


def draw_late_ball(*, dark: bool) -> "Figure":
    """Draw the loop of a ball whose force is 10 ms late, and with the delay removed."""
    ball = palpate.prepare(RECORDINGS / "ball.csv")
    time, penetration, force = ball.time[10:], ball.penetration[10:], ball.force[:-10]
    look = figures.choose_look(dark=dark, width=WIDTH)
    with figures.drawing(look, 4.0) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, delay, title in zip(
            panels, (0.0, 10e-3), ("as recorded", "delay removed"), strict=True
        ):
            contact = palpate.prepare(time=time, penetration=penetration, force=force, delay=delay)
            figures.draw(palpate.identify(contact), ["loop"], ax=axes, dark=dark)
            axes.set_title(title)
        panels[1].set_ylabel("")
        panels[1].get_legend().remove()
    return figure


def draw_relaxation(*, dark: bool) -> "Figure":
    """Draw the residual of a law without relaxation, and of one with it."""
    touch = lab.Bench(lab.TISSUE, lab.THREE_SINES, lab.IdealProbe()).run(seed=0).contact
    results = {
        "plain Hunt–Crossley": palpate.identify(touch, "variable-projection"),
        "with relaxation": palpate.identify(touch),
    }
    with figures.drawing(figures.choose_look(dark=dark, width=WIDTH), 3.0) as figure:
        figures.draw(results, ["residual"], ax=figure.subplots(), dark=dark)
    return figure


def draw_projection(*, dark: bool) -> "Figure":
    """Draw the smallest rms error of the force over the exponent, of two recordings."""
    look = figures.choose_look(dark=dark, width=WIDTH)
    exponents = np.linspace(0.5, 3.0, 126)
    with figures.drawing(look, 4.0) as figure:
        axes = figure.subplots()
        for name, colour in zip(("ball", "phantom"), look.theme.lines, strict=False):
            contact = palpate.prepare(RECORDINGS / f"{name}.csv")
            inside = contact.penetration > 0.0
            depth = contact.penetration[inside] / contact.penetration.max()
            force = contact.force[inside]
            errors = []
            for n in exponents:
                power = depth**n
                columns = (power, power * contact.velocity[inside], np.ones_like(depth))
                design = np.column_stack(columns)
                residual = force - design @ np.linalg.lstsq(design, force)[0]
                errors.append(np.sqrt(np.mean(residual**2)))
            best = int(np.argmin(errors))
            axes.semilogy(exponents, errors, color=colour, label=name)
            axes.semilogy(exponents[best], errors[best], "o", color=colour)
            axes.annotate(
                f"n = {exponents[best]:.2f}",
                (exponents[best], errors[best]),
                (0, -2.2 * look.font),
                textcoords="offset points",
                ha="center",
            )
        axes.set(xlabel="exponent n", ylabel="smallest rms error [N]", ylim=(0.02, 5.0))
        axes.legend()
    return figure


def draw_stiffness_or_k(*, dark: bool) -> "Figure":
    """Draw a law, and its slope at the working depth."""
    result = palpate.identify(RECORDINGS / "phantom.csv")
    at = result.working_depths[0]
    depth = np.linspace(0.0, 1.6 * at.depth, 200)
    slope = at.stiffness.value
    look = figures.choose_look(dark=dark, width=WIDTH)
    with figures.drawing(look, 4.0) as figure:
        axes = figure.subplots()
        force = result.law.force(depth, np.zeros_like(depth))
        axes.plot(1e3 * depth, force, color=look.theme.lines[0], label="law, at rest")
        tangent = np.array([0.55, 1.45]) * at.depth
        line = at.force.value + slope * (tangent - at.depth)
        axes.plot(1e3 * tangent, line, "--", color=look.theme.lines[1], label="slope K′")
        axes.plot(1e3 * at.depth, at.force.value, "o", color=look.theme.lines[1])
        axes.annotate(
            f"K′ = {slope:.0f} N/m\nat {1e3 * at.depth:.1f} mm",
            (1e3 * at.depth, at.force.value),
            (1.2 * look.font, -2.6 * look.font),
            textcoords="offset points",
        )
        axes.set(xlabel="penetration [mm]", ylabel="force [N]")
        axes.legend()
    return figure


def pictures() -> Iterator[tuple[str, "Figure"]]:
    """Yield each picture with its name, light and dark."""
    for dark, ending in ((False, ""), (True, "-dark")):
        yield f"late-ball{ending}", draw_late_ball(dark=dark)
        yield f"relaxation{ending}", draw_relaxation(dark=dark)
        yield f"projection{ending}", draw_projection(dark=dark)
        yield f"stiffness-or-k{ending}", draw_stiffness_or_k(dark=dark)
