"""The same contact in MuJoCo: the force that was measured, and that of the engine's own contact."""

import matplotlib.pyplot as plt

import palpate
from palpate import exports, figures, lab

touch = lab.Bench(lab.PVC, lab.THREE_SINES, lab.IdealProbe()).run(seed=1, seconds=5.0).contact
result = palpate.identify(touch, "variable-projection")
made = exports.export(result, to="mujoco", mass=1.0)
print(made.statement.claim)

figure, axes = plt.subplots(figsize=(3.46, 2.4), layout="constrained")
figures.draw(result, ["loop"], ax=axes)
motion = exports.ProbeMotion.recorded(result).firm()
engine = made.fragment.predict_force(motion)
axes.plot(1e3 * motion.penetration, engine, ":", color="tab:red", label="MuJoCo's contact")
axes.legend(frameon=False)
