"""Which motion, before touching anything? Ask for it, before the robot moves.

From a guess of the material and the sensor's noise palpate predicts the error of each number, and
proposes a better motion of the same length: how soon each of the two knows the stiffness.
"""

import matplotlib.pyplot as plt
import numpy as np

import palpate
from palpate.lab.design import PAPER_MOTION, design

plan = design(palpate.HuntCrossley(K=2e4, B=2e4, n=1.3), PAPER_MOTION, noise=0.05)
print(plan)
assert plan.better is not None

figure, axes = plt.subplots(figsize=(3.46, 2.4), layout="constrained")
times = np.geomspace(0.3, 20.0, 40)
for name, motion in (("planned", plan.planned.motion), ("better", plan.better.motion)):
    errors = [100.0 * plan.relative_errors(motion, time)[0] for time in times]
    axes.loglog(times, errors, label=name)
axes.set(xlabel="time in motion [s]", ylabel="standard error of K [%]")
axes.legend()
