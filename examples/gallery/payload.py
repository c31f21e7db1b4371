"""My force is not zero in the air: palpate finds the tool's weight in a free motion."""

import matplotlib.pyplot as plt
import numpy as np

import palpate

time = np.arange(0.0, 30.0, 4e-3)
free = np.clip(0.5 * (20.0 - time), 0.0, 1.0)  # the tool of 0.4 kg turns, then presses
tilt, lean = free * 0.25 * np.sin(0.8 * time), free * 0.2 * np.sin(1.1 * time)
x, y = np.sin(tilt) * np.cos(lean), np.cos(tilt) * np.sin(lean)
z, w = np.sin(tilt) * np.sin(lean), np.cos(tilt) * np.cos(lean)
depth = -1e-3 + 3e-3 * (1.0 - np.cos(2.0 * np.maximum(time - 22.0, 0.0)))
push = palpate.HuntCrossley(K=2e4, B=2e4, n=1.5).force(depth, np.gradient(depth, time))
down = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
noise = np.random.default_rng(1).normal(0.0, 1.0, (6, time.size))
force = (push - 0.4 * 9.81) * down + np.array([[3.0], [-5.0], [8.0]]) + 0.02 * noise[:3]
torque = np.cross([0.0, 0.0, 0.05], -0.4 * 9.81 * down.T).T + 1e-3 * noise[3:]

names = [f"pose.{name}" for name in ("position.x", "position.y", "position.z")]
names += [f"pose.orientation.{axis}" for axis in "xyzw"]
names += [f"wrench.{kind}.{axis}" for kind in ("force", "torque") for axis in "xyz"]
columns = [0.0 * time, 0.0 * time, 0.3 - depth, x, y, z, w, *force, *torque]
contact = palpate.prepare({"time_s": time} | dict(zip(names, columns, strict=True)))

figure, axes = plt.subplots(figsize=(3.46, 2.2), layout="constrained")
axes.plot(time, np.linalg.norm(force, axis=0), color="0.6", label="as the sensor reads it")
axes.plot(contact.time, contact.force, label="without the tool")
axes.set(xlabel="time [s]", ylabel="force [N]")
axes.legend(frameon=False)
