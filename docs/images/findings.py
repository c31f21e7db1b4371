"""The pictures of findings; ``make_pictures.py`` writes them with the others."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

import palpate
from palpate import lab
from palpate.findings import Check
from palpate.output.figures.style import choose_look, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 60e-3  # m


def pictures() -> Iterator[tuple[str, "Figure"]]:
    """Yield some findings, light and dark: a press of a sponge, and the same with a fault."""
    clean = lab.Bench(lab.SPONGE, lab.PALPATION, lab.IdealProbe()).run(seed=1).contact
    time = clean.time
    force = clean.force
    peak = force.max()
    spikes = np.random.default_rng(1).random(time.size) < 0.01
    #: The recorded force, and the times that the picture shows, s.
    faulty = {
        Check.SATURATION: (np.minimum(force, 0.7 * peak), 2.0, 4.5),
        Check.DEAD_BAND: (np.where(force < 0.15 * peak, 0.0, force), 2.05, 2.4),
        Check.FORCE_JUMP: (force - 0.3 * peak * (time > 3.5), 2.0, 4.5),
        Check.SPIKES: (force + 0.4 * peak * spikes, 2.0, 4.5),
        Check.DELAY: (np.interp(time - 20e-3, time, force), 2.5, 3.5),
    }
    for check, (recorded, start, stop) in faulty.items():
        contact = palpate.prepare(time=time, penetration=clean.penetration, force=recorded)
        found = palpate.identify(contact).diagnosis.findings
        assert check in [finding.check for finding in found], f"the picture shows no {check}"
        chosen = (time > start) & (time < stop)
        over_time = check is not Check.DELAY
        place = (time if over_time else 1e3 * clean.penetration)[chosen]
        for dark, ending in ((False, ""), (True, "-dark")):
            look = choose_look(dark=dark, width=WIDTH)
            with drawing(look, 3.4) as figure:
                axes = figure.add_subplot()
                grey = look.theme.measured
                axes.plot(place, force[chosen], color=grey, label="without the fault")
                axes.plot(place, recorded[chosen], color=look.colour(1), label="recorded")
                axes.set_xlabel("time [s]" if over_time else "penetration [mm]")
                axes.set_ylabel("force [N]")
                axes.set_ylim(
                    top=1.35 * max(recorded[chosen].max(), force[chosen].max())
                )  # room for the legend
                axes.legend(loc="upper left")
                yield f"findings/{check.anchor}{ending}", figure
