"""Where is the hard spot? One call identifies 315 places of a soft pad, and one more draws them."""

import numpy as np

import palpate
from palpate.fleet.figures import draw_map
from palpate.fleet.maps import map_of

x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 40e-3, 21), np.linspace(0, 28e-3, 15)))
spot = np.exp(-((x - 25e-3) ** 2 + (y - 12e-3) ** 2) / 7e-3**2)
time = np.arange(0.0, 2.0, 2e-3)
depth = 4e-3 - 6e-3 * np.cos(11.0 * time) * np.ones((x.size, 1))
velocity = 66e-3 * np.sin(11.0 * time) * np.ones((x.size, 1))
law = palpate.HuntCrossley(K=1.0, B=0.5, n=1.3)
force = 6e3 * (1.0 + 1.5 * spot[:, None]) * law.force(depth, velocity)
force += np.random.default_rng(1).normal(0.0, 0.05, force.shape)

places = {"x": x, "y": y, "z": 0.0 * x}
table = palpate.identify_many(penetration=depth, force=force, time=time, places=places)
figure = draw_map(map_of(table, ("x", "y"), depth=5e-3), width=88e-3)
