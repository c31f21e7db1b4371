"""Drake's text: a surface and a tip on a slide, in SDFormat and in URDF."""

from collections.abc import Mapping
from dataclasses import dataclass

from palpate.exports.text import digits

SDF = """\
<?xml version="1.0"?>
{comment}
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="contact">
    <!-- The surface: paste its proximity properties into yours. -->
    <link name="surface">
      <collision name="surface">
        <pose>0 0 {middle} 0 0 0</pose>
        <geometry><box><size>{width} {width} {height}</size></box></geometry>
        {surface}
      </collision>
    </link>
    <joint name="fixed" type="fixed">
      <parent>world</parent>
      <child>surface</child>
    </joint>
    <!-- The tip: its collisions belong into the link that touches. -->
    <link name="tip">
      <pose>0 0 {radius} 0 0 0</pose>
      <inertial>
        <mass>{mass}</mass>
        <inertia><ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{inertia}</izz></inertia>
      </inertial>
{tips}
    </link>
    <joint name="slide" type="prismatic">
      <parent>world</parent>
      <child>tip</child>
      <axis><xyz>0 0 -1</xyz><limit><effort>0</effort></limit></axis>
    </joint>
  </model>
</sdf>
"""

SDF_TIP = """\
      <collision name="{name}">
        <pose>0 0 {lift} 0 0 0</pose>
        <geometry><sphere><radius>{radius}</radius></sphere></geometry>
        {material}
      </collision>"""

URDF = """\
<?xml version="1.0"?>
{comment}
<robot name="contact" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <!-- The surface: paste its proximity properties into yours. -->
  <link name="surface">
    <collision name="surface">
      <origin xyz="0 0 {middle}"/>
      <geometry><box size="{width} {width} {height}"/></geometry>
      {surface}
    </collision>
  </link>
  <joint name="fixed" type="fixed">
    <parent link="world"/>
    <child link="surface"/>
  </joint>
  <!-- The tip: its collisions belong into the link that touches. -->
  <link name="tip">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
{tips}
  </link>
  <joint name="slide" type="prismatic">
    <origin xyz="0 0 {radius}"/>
    <parent link="world"/>
    <child link="tip"/>
    <axis xyz="0 0 -1"/>
    <limit effort="0"/>
  </joint>
</robot>
"""

URDF_TIP = """\
    <collision name="{name}">
      <origin xyz="0 0 {lift}"/>
      <geometry><sphere radius="{radius}"/></geometry>
      {material}
    </collision>"""

SCENE = '''\
"""The smallest scene with this contact: a tip meets the surface, and rebounds.

pip install drake
"""
{comment}

from pathlib import Path

from pydrake.all import (
    AddMultibodyPlant,
    DiagramBuilder,
    MultibodyPlantConfig,
    Parser,
    Simulator,
)

SPEED = {speed}  # m/s, at first touch
CONFIGURATION = MultibodyPlantConfig(
    time_step={time_step},
    contact_model="{contact_model}",
    discrete_contact_approximation="{approximation}",
)

builder = DiagramBuilder()
plant, _ = AddMultibodyPlant(CONFIGURATION, builder)
Parser(plant).AddModels(str(Path(__file__).with_name("contact.sdf")))
plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
plant.Finalize()
simulator = Simulator(builder.Build())
context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
slide = plant.GetJointByName("slide")
slide.set_translation_rate(context, SPEED)

deepest, time = 0.0, 0.0
while time < 10.0:
    time += CONFIGURATION.time_step or 1e-3
    simulator.AdvanceTo(time)
    depth, speed = slide.get_translation(context), slide.get_translation_rate(context)
    deepest = max(deepest, depth)
    if depth <= 0.0 and speed < 0.0:
        print(f"{{1e3 * deepest:.3g}} mm deep, back at {{-speed / SPEED:.3f}} of the speed")
        break
else:
    print(f"{{1e3 * deepest:.3g}} mm deep, and it stays")
'''


@dataclass(frozen=True, slots=True)
class Tip:
    """One sphere of the tip: radius, and how far its centre is above the tip's, m."""

    name: str
    radius: float
    lift: float
    material: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Parts:
    """What the text is made of; a material's property without a number is a flag.

    Attributes
    ----------
    surface : mapping of str to float or None
        The surface's proximity properties.
    tips : tuple of Tip
        The tip's spheres.
    radius, mass : float
        Of the tip, m and kg.
    width, height : float
        Of the box whose top is the surface, m.
    """

    surface: Mapping[str, float | None]
    tips: tuple[Tip, ...]
    radius: float
    mass: float
    width: float
    height: float


def sdf(parts: Parts, comment: str) -> str:
    """Return both bodies in SDFormat."""
    return _written(parts, comment, SDF, SDF_TIP, "        ", "<drake:{0}>{1}</drake:{0}>")


def urdf(parts: Parts, comment: str) -> str:
    """Return the same in URDF."""
    return _written(parts, comment, URDF, URDF_TIP, "      ", '<drake:{0} value="{1}"/>')


def _written(parts: Parts, comment: str, whole: str, one: str, indent: str, line: str) -> str:
    tips = [
        one.format(
            name=tip.name,
            lift=digits(tip.lift),
            radius=digits(tip.radius),
            material=_properties(tip.material, indent, line),
        )
        for tip in parts.tips
    ]
    surface = _properties(parts.surface, indent, line)
    return whole.format(comment=comment, surface=surface, tips="\n".join(tips), **_sizes(parts))


def _sizes(parts: Parts) -> dict[str, str]:
    return {
        "width": digits(parts.width),
        "height": digits(parts.height),
        "middle": digits(-0.5 * parts.height),
        "radius": digits(parts.radius),
        "mass": digits(parts.mass),
        # Of a solid sphere; on its slide the tip does not turn.
        "inertia": digits(0.4 * parts.mass * parts.radius**2),
    }


def _properties(material: Mapping[str, float | None], indent: str, line: str) -> str:
    """Proximity properties, one to a line."""
    lines = [
        f"<drake:{name}/>" if value is None else line.format(name, digits(value))
        for name, value in material.items()
    ]
    inside = "".join(f"\n{indent}  {each}" for each in lines)
    return f"<drake:proximity_properties>{inside}\n{indent}</drake:proximity_properties>"
