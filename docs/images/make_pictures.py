"""Write the pictures of the docs that show a result: the README's, one a panel, and the gallery.

python docs/images/make_pictures.py
"""

import runpy
from pathlib import Path

import matplotlib
import numpy as np

import palpate
from palpate import InvalidParameterError, figures, lab
from palpate.findings import Check
from palpate.output.figures.style import choose_look, drawing

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples"
THUMBNAIL = 60e-3  # m


def write(figure: "matplotlib.figure.Figure", name: str) -> None:
    """Write a figure, with the folder that it stands in."""
    path = IMAGES / f"{name}.svg"
    path.parent.mkdir(exist_ok=True)
    figures.save(figure, path)


def write_findings() -> None:
    """Write a picture of each of some findings: a press of a sponge, and the same with a fault."""
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
            look = choose_look(dark=dark, width=THUMBNAIL)
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
                write(figure, f"findings/{check.anchor}{ending}")


def main() -> None:
    """Write all of them."""
    matplotlib.use("agg")
    write_findings()
    ball = palpate.identify(EXAMPLES / "recordings" / "ball.csv")
    for dark, ending in ((False, ""), (True, "-dark")):
        write(figures.draw(ball, dark=dark), f"ball{ending}")
    single = palpate.identify(EXAMPLES / "recordings" / "ball.csv", "single-stage")
    touch = lab.Bench(lab.TISSUE, lab.THREE_SINES, lab.IdealProbe()).run(seed=1).contact
    relaxing = palpate.identify(touch)
    for name in (*figures.PANELS, "n"):
        for result in (ball, single, relaxing):
            try:
                write(figures.draw(result, [name], width=THUMBNAIL), f"panels/{name}")
            except InvalidParameterError:  # not a panel of this result
                continue
            break
    for script in sorted((EXAMPLES / "gallery").glob("*.py")):
        write(runpy.run_path(str(script))["figure"], f"gallery/{script.stem}")


if __name__ == "__main__":
    main()
