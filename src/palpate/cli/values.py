"""Kinds of words that options take; help shows their names in place of a value."""

from typing import Literal, NewType, TypeAlias

Channel = NewType("Channel", str)
TIME, VELOCITY = Channel("time_s"), Channel("velocity_m_s")
PENETRATION, FORCE = Channel("penetration_m"), Channel("force_N")

Channels = NewType("Channels", str)
Unit = NewType("Unit", str)
Depth = NewType("Depth", str)
Duration = NewType("Duration", str)
Span = NewType("Span", str)
Weight = NewType("Weight", str)
Direction = NewType("Direction", str)
Address = NewType("Address", str)
Method = NewType("Method", str)

SurfaceWord: TypeAlias = Literal["threshold", "baseline", "fit", "estimate"]
Axis: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]
