"""OpenSim's text: a model with a sphere on a slide above a half-space, and a script."""

MODEL = """\
<?xml version="1.0" encoding="UTF-8"?>
{comment}
<OpenSimDocument Version="40500">
  <Model name="contact">
    <gravity>0 0 0</gravity>
    <BodySet name="bodyset">
      <objects>
        <Body name="tip">
          <mass>{mass}</mass>
          <mass_center>0 0 0</mass_center>
          <inertia>{inertia} {inertia} {inertia} 0 0 0</inertia>
        </Body>
      </objects>
    </BodySet>
    <JointSet name="jointset">
      <objects>
        <!-- x is into the surface; the coordinate is the penetration. -->
        <SliderJoint name="slide">
          <socket_parent_frame>touching</socket_parent_frame>
          <socket_child_frame>centre</socket_child_frame>
          <coordinates>
            <Coordinate name="penetration"/>
          </coordinates>
          <frames>
            <PhysicalOffsetFrame name="touching">
              <socket_parent>/ground</socket_parent>
              <translation>{above} 0 0</translation>
            </PhysicalOffsetFrame>
            <PhysicalOffsetFrame name="centre">
              <socket_parent>/bodyset/tip</socket_parent>
              <translation>0 0 0</translation>
            </PhysicalOffsetFrame>
          </frames>
        </SliderJoint>
      </objects>
    </JointSet>
    <ForceSet name="forceset">
      <objects>
        <!-- Paste this force, and give both geometries its names. -->
        <HuntCrossleyForce name="contact">
          <HuntCrossleyForce::ContactParametersSet name="contact_parameters">
            <objects>
              <HuntCrossleyForce::ContactParameters>
                <geometry>surface</geometry>
                <stiffness>{stiffness}</stiffness>
                <dissipation>{dissipation}</dissipation>
              </HuntCrossleyForce::ContactParameters>
              <HuntCrossleyForce::ContactParameters>
                <geometry>sphere</geometry>
                <stiffness>{rigid}</stiffness>
                <dissipation>0</dissipation>
              </HuntCrossleyForce::ContactParameters>
            </objects>
          </HuntCrossleyForce::ContactParametersSet>
        </HuntCrossleyForce>
      </objects>
    </ForceSet>
    <ContactGeometrySet name="contactgeometryset">
      <objects>
        <ContactSphere name="sphere">
          <socket_frame>/bodyset/tip</socket_frame>
          <location>0 0 0</location>
          <radius>{radius}</radius>
        </ContactSphere>
        <ContactHalfSpace name="surface">
          <socket_frame>/ground</socket_frame>
          <location>0 0 0</location>
        </ContactHalfSpace>
      </objects>
    </ContactGeometrySet>
  </Model>
</OpenSimDocument>
"""

SCENE = '''\
"""The smallest scene with this contact: a tip meets the surface, and rebounds.

pip install opensim
"""
{comment}

from pathlib import Path

import opensim

SPEED = {speed}  # m/s, at first touch

model = opensim.Model(str(Path(__file__).with_name("contact.osim")))
state = model.initSystem()
slide = model.getCoordinateSet().get("penetration")
slide.setSpeedValue(state, SPEED)
manager = opensim.Manager(model)
manager.setIntegratorAccuracy(1e-7)
manager.setIntegratorMaximumStepSize({time_step})
manager.initialize(state)

deepest, time = 0.0, 0.0
while time < 10.0:
    time += {time_step}
    state = manager.integrate(time)
    depth, speed = slide.getValue(state), slide.getSpeedValue(state)
    deepest = max(deepest, depth)
    if depth <= 0.0 and speed < 0.0:
        print(f"{{1e3 * deepest:.3g}} mm deep, back at {{-speed / SPEED:.3f}} of the speed")
        break
else:
    print(f"{{1e3 * deepest:.3g}} mm deep, and it stays")
'''
