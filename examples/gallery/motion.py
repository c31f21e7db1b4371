"""Which motion, before touching anything?

From a guess of the material and the sensor's noise palpate predicts the error of each number, and
proposes a better motion of the same length.
"""

import palpate
from palpate import figures
from palpate.design import PAPER_MOTION, design

plan = design(palpate.HuntCrossley(K=2e4, B=2e4, n=1.3), PAPER_MOTION, noise=0.05)
print(plan)
figure = figures.draw_design(plan, width=88e-3)
