"""A material that relaxes: no law without memory follows its force.

palpate selects the law by itself. What plain Hunt–Crossley leaves of the force is drawn beside what
the selected law leaves.
"""

import palpate
from palpate import figures, lab

touch = lab.Bench(lab.TISSUE, lab.THREE_SINES, lab.IdealProbe()).run(seed=1).contact
relaxing = palpate.identify(touch)
plain = palpate.identify(touch, "variable-projection")
print(relaxing)
named = {"plain Hunt–Crossley": plain, "with relaxation": relaxing}
figure = figures.draw(named, ["residual"], width=88e-3)
