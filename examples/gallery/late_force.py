"""A force that is late opens the loop of a spring: the same touch, before and after.

A force-torque sensor filters its reading, so it arrives 3 ms after the position. A spring has no
damping: one touch of it shows the delay, and palpate takes it out of every later recording.
"""

import matplotlib.pyplot as plt
import numpy as np

import palpate
from palpate import figures

time = np.arange(0.0, 8.0, 1e-3)
depth = 4e-3 * np.clip(time - 1.0, 0.0, 1.0) - 1e-3
depth += 1.5e-3 * np.sin(2.0 * np.pi * np.where(time < 5.0, 1.0, 4.0) * (time - 2.0)) * (time > 2.0)
late = 3000.0 * np.maximum(np.interp(time - 3e-3, time, depth), 0.0)
late += np.random.default_rng(1).normal(0.0, 0.01, time.size)

delay = palpate.skew(palpate.prepare(time=time, penetration=depth, force=late)).delay
print(f"the force is {1e3 * delay.value:.2f} ± {1e3 * delay.whole_error:.2f} ms late")
figure, panels = plt.subplots(1, 2, figsize=(3.46, 2.0), layout="constrained", sharey=True)
for axes, seconds, name in zip(
    panels, (0.0, delay.value), ("as recorded", "delay removed"), strict=True
):
    contact = palpate.prepare(time=time, penetration=depth, force=late, delay=seconds)
    result = palpate.identify(contact)
    figures.draw(result, ["loop"], ax=axes)
    axes.set_title(name)
panels[0].get_legend().remove()
