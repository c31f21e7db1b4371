"""Kinds of words that options take; help shows their names in place of a value."""

from pathlib import Path
from typing import Annotated, Literal, NewType, TypeAlias

from cyclopts import Parameter

from palpate.cli.groups import OUTPUT

Channel = NewType("Channel", str)
TIME, VELOCITY = Channel("time_s"), Channel("velocity_m_s")
PENETRATION, FORCE = Channel("penetration_m"), Channel("force_N")

Channels = NewType("Channels", str)
Unit = NewType("Unit", str)
Depth = NewType("Depth", str)
Speed = NewType("Speed", str)
Frequency = NewType("Frequency", str)
Shape = NewType("Shape", str)
Duration = NewType("Duration", str)
Span = NewType("Span", str)
Weight = NewType("Weight", str)
Direction = NewType("Direction", str)
Width = NewType("Width", str)
Folder = NewType("Folder", Path)
SourceName = NewType("SourceName", str)
Address = NewType("Address", str)
Method = NewType("Method", str)

SurfaceWord: TypeAlias = Literal["threshold", "baseline", "fit", "estimate"]
Axis: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]

#: Where a figure, or all of a result, goes.
FigureFile: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT)]
Dark: TypeAlias = Annotated[bool, Parameter(group=OUTPUT)]
ResultFolder: TypeAlias = Annotated[Folder | None, Parameter(name=["--output", "-o"], group=OUTPUT)]
