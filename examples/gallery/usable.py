"""In the loop: a controller acts on the estimate where it is usable, and holds where not.

After seven seconds the material becomes harder. The stiffness at the present depth is drawn where
it is usable; the gap after the change is where a controller holds or backs off.
"""

import matplotlib.pyplot as plt
import numpy as np

import palpate
from palpate import lab

bench = lab.Bench(lab.SOFT_THEN_HARD, lab.THREE_SINES, lab.IdealProbe())
contact = bench.run(seed=1, seconds=12.0).contact
estimator = palpate.VariableProjection(change_detector=palpate.ChangeDetector())
usable = np.full(len(contact), np.nan)
for k in range(len(contact)):
    sample = contact.penetration[k], contact.velocity[k], contact.force[k]
    estimator.update(*sample)
    stiffness = estimator.estimate().stiffness
    if stiffness.usable:
        usable[k] = stiffness.value

figure, axes = plt.subplots(figsize=(3.46, 2.2), layout="constrained")
axes.plot(contact.time, 1e-3 * usable)
axes.set(xlabel="time [s]", ylabel="usable stiffness [kN/m]")
