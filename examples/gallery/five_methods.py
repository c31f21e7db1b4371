"""One probe, five methods: the paper's comparison (Fig. 19) on the laboratory's rubber ball."""

import palpate
from palpate import figures, lab

touch = lab.Bench(lab.BALL, lab.THREE_SINES, lab.IdealProbe()).run(seed=1).contact
methods = (
    "single-stage",
    "double-stage",
    "kelvin-voigt",
    "extended-kelvin-voigt",
    "variable-projection",
)
results = {name: palpate.identify(touch, name) for name in methods}
figure = figures.draw(results, ["stiffness"], width=88e-3)
