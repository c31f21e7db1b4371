"""A material that relaxes: its force decays while the probe rests, which no law without memory follows.

palpate selects the law by itself, and states two stiffnesses: at once, and relaxed.
"""

import palpate
from palpate import figures, lab

touch = lab.Bench(lab.TISSUE, lab.THREE_SINES, lab.IdealProbe()).run(seed=1).contact
relaxing = palpate.identify(touch)
plain = palpate.identify(touch, "variable-projection")
print(relaxing)
named = {"Hunt–Crossley": plain, "with relaxation": relaxing}
figure = figures.draw(named, ["residual"], width=88e-3)
