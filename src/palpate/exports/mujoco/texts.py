"""MJCF: the pads and pairs to paste, and the smallest scene that runs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from palpate.exports.mujoco.rows import Row, Rows
from palpate.exports.text import digits, xml_comment

#: One surface for each row, at the same place; what both are called in the user's model.
PADS = ("palpate_pad", "palpate_pad_damper")
TIP = "tip"

SCENE = """\
{comment}
<mujoco model="palpate contact">
  <option timestep="{time_step}" gravity="0 0 0"/>
  <worldbody>
    <light pos="0 -1 2" dir="0 0.4 -1"/>
{pads}
    <body name="probe" pos="0 0 {radius}">
      <joint name="approach" type="slide" axis="0 0 1"/>
      <geom name="tip" type="sphere" size="{radius}" mass="{mass}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
{contact}
  <keyframe>
    <!-- Free flight from first touch to the deepest that was recorded. -->
    <key name="drop" qpos="0" qvel="{velocity}"/>
  </keyframe>
</mujoco>
"""

FRAGMENT = """\
{comment}
<mujoco>
  <worldbody>
    <!-- The surface. Place it where yours is; it stops nothing but the geom of the pairs. -->
{pads}
  </worldbody>
{contact}
</mujoco>
"""

ROBOT = """\
{comment}
<mujoco>
  {model}
  <!-- Assets are looked for from this file on: after the model, so that its own are overridden. -->
  {assets}
  <include file="contact.xml"/>
</mujoco>
"""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a surface is, and which way it faces.

    Attributes
    ----------
    position, normal : tuple of float
        m, and of length 1, out of the material.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)


def pads(count: int, place: Place) -> str:
    """The surfaces, one a row: massless, static, and met by the pairs alone."""
    # To a picometre: what is beyond is rounding.
    position, normal = _numbers(np.round(place.position, 12).tolist()), _numbers(place.normal)
    turned = "" if place.normal == (0.0, 0.0, 1.0) else f' zaxis="{normal}"'
    return "\n".join(
        f'    <geom name="{name}" type="plane" pos="{position}"{turned} size="0.1 0.1 0.01" '
        'contype="0" conaffinity="0"/>'
        for name in PADS[:count]
    )


def pair_attributes(row: Row) -> dict[str, str]:
    """What ``<pair>`` has of a row, in MJCF's words."""
    attributes = {
        "condim": "1",
        # Not "0": a solref that is not negative means something else.
        "solref": _numbers((-row.spring, -row.damper)),
        "solimp": _numbers(row.solimp),
        # Or a model's own <default> for pairs would move the surface.
        "margin": _numbers([-row.inset]),
        "gap": "0",
    }
    if row.adhesion:
        attributes["adhesion"] = digits(row.adhesion)
    return attributes


def contact(rows: Rows, tip: str) -> str:
    """The ``<contact>`` section."""
    lines = ["  <contact>"]
    what = ("spring", "damper") if len(rows.rows) > 1 else ("spring and damper",)
    for row, pad, name in zip(rows.rows, PADS, what, strict=False):
        pair = ElementTree.Element("pair", {"geom1": pad, "geom2": tip, **pair_attributes(row)})
        lines.append(f"    <!-- The {name}. -->")
        lines.append(f"    {ElementTree.tostring(pair, encoding='unicode')}")
    return "\n".join([*lines, "  </contact>"])


def fragment(rows: Rows | None, tip: str, place: Place, notes: Sequence[str]) -> str:
    """What is to be pasted into a model, or included by it; without rows the surface alone."""
    return FRAGMENT.format(
        comment=xml_comment(notes),
        pads=pads(1 if rows is None else len(rows.rows), place),
        contact="" if rows is None else contact(rows, tip),
    )


def scene(
    rows: Rows | None, *, mass: float, time_step: float, speed: float, depth: float,
    notes: Sequence[str],
) -> str:  # fmt: skip
    """A ball on a slide that meets the surface at a speed; without rows it is the callback's."""
    return SCENE.format(
        comment=xml_comment(notes),
        time_step=digits(time_step),
        pads=pads(1 if rows is None else len(rows.rows), Place()),
        radius=digits(max(0.03, 2.0 * depth)),
        mass=digits(mass),
        velocity=digits(-speed),
        contact="" if rows is None else contact(rows, TIP),
    )


def robot(model: Path, meshes: str, textures: str, notes: Sequence[str]) -> str:
    """A scene of the user's model, wherever that is, with the fragment beside this file."""
    whole = model.absolute()
    folders = {"meshdir": str(whole.parent / meshes), "texturedir": str(whole.parent / textures)}
    include = ElementTree.Element("include", file=str(whole))
    parts = (include, ElementTree.Element("compiler", folders))
    both = [ElementTree.tostring(part, encoding="unicode") for part in parts]
    return ROBOT.format(comment=xml_comment(notes), model=both[0], assets=both[1])


def as_one_contact(rows: Rows) -> Rows:
    """Rows as strong altogether where the two geoms have one contact."""
    n = rows.contacts
    each = [
        replace(
            row, spring=n * row.spring, damper=n * row.damper, adhesion=n * row.adhesion
        )
        for row in rows.rows
    ]  # fmt: skip
    return Rows(tuple(each), rows.mobility)


def _numbers(values: Sequence[float]) -> str:
    # + 0.0: a negative zero reads as a minus sign that means nothing.
    return " ".join(digits(value + 0.0) for value in values)
