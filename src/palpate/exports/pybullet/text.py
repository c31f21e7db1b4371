"""PyBullet's text: a surface and a tip in URDF, and a script that drops the one on the other."""

SURFACE = """\
<?xml version="1.0"?>
{comment}
<robot name="surface">
  <link name="surface">
    <!-- Paste this contact into the surface's link, and none into the tip's. -->
    <contact>
      <stiffness value="{stiffness}"/>
      <damping value="{damping}"/>
    </contact>
    <inertial>
      <mass value="0"/>
      <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <geometry><plane normal="0 0 1"/></geometry>
    </collision>
  </link>
</robot>
"""

TIP = """\
<?xml version="1.0"?>
{comment}
<robot name="tip">
  <link name="tip">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <geometry><sphere radius="{radius}"/></geometry>
    </collision>
  </link>
</robot>
"""

SCENE = '''\
"""The smallest scene with this contact: a tip meets the surface, and rebounds.

pip install pybullet
"""
{comment}

from pathlib import Path

import pybullet

SPEED = {speed}  # m/s, at first touch
RADIUS = {radius}  # m
TIME_STEP = {time_step}  # s: the damping was written for this one

pybullet.connect(pybullet.DIRECT)
# Files are cached by their names: a new surface.urdf would be read as the old one.
# Without a slop of 0 the contact begins 0.01 mm deep.
pybullet.setPhysicsEngineParameter(
    fixedTimeStep=TIME_STEP, numSubSteps=0, contactSlop=0.0, enableFileCaching=0
)
folder = Path(__file__).parent
pybullet.loadURDF(str(folder / "surface.urdf"), useFixedBase=True)
tip = pybullet.loadURDF(str(folder / "tip.urdf"), basePosition=[0.0, 0.0, RADIUS])
pybullet.changeDynamics(tip, -1, linearDamping=0.0, angularDamping=0.0)
pybullet.resetBaseVelocity(tip, linearVelocity=[0.0, 0.0, -SPEED])

deepest, time = 0.0, 0.0
while time < 10.0:
    time += TIME_STEP
    pybullet.stepSimulation()
    depth = RADIUS - pybullet.getBasePositionAndOrientation(tip)[0][2]
    speed = -pybullet.getBaseVelocity(tip)[0][2]
    deepest = max(deepest, depth)
    if depth <= 0.0 and speed < 0.0:
        print(f"{{1e3 * deepest:.3g}} mm deep, back at {{-speed / SPEED:.3f}} of the speed")
        break
else:
    print(f"{{1e3 * deepest:.3g}} mm deep, and it stays")
'''
