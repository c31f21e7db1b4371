"""The base class of control loops, and their registry."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from palpate.validation import Floats, check_choice, check_field, finite_or_none, frozen

#: A frequency response, on a grid.
Complex = NDArray[np.complex128]


@frozen
class FreePlant:
    """What the controller acts on, besides the material: a mass with a spring and a damper.

    mass · ẍ = input · u − stiffness · x − damping · ẋ − F

    Attributes
    ----------
    stiffness, damping : float
        N/m and N·s/m.
    input : float
        Force for a command of 1: 1 for a force, N/m for the motion of a position loop.
    """

    stiffness: float
    damping: float
    input: float


@frozen(kw_only=True)
class ControlLoop(ABC):
    """A sampled control loop of a robot along the normal of a surface; see its subclasses.

    Parameters
    ----------
    mass : float
        Effective mass of the robot and the tool along the normal, kg.
    sample_rate : float
        Hz.
    delay : float, optional
        From the measurement to the effect of the command, s, in [0, 0.1], without the sample's
        hold. Without it no gain is recommended.
    wanted_force : float
        Force in contact, N.
    approach_speed : float
        At first touch, m/s.
    tool_mass : float
        Mass beyond the force sensor, kg. Default: 0.

    Raises
    ------
    InvalidParameterError
        A number is outside its range.
    """

    mass: float
    sample_rate: float
    wanted_force: float
    approach_speed: float
    delay: float | None = None
    tool_mass: float = 0.0
    #: Name on the command line, name in a sentence, and number in ``touching_loop.hpp``.
    name: ClassVar[str]
    title: ClassVar[str]
    number: ClassVar[int]
    #: Fields that are the gains, and the unit of each.
    gains: ClassVar[Mapping[str, str]]
    #: Whether it controls the force alone: a frequency far beyond the recorded ones refuses it.
    needs_frequency: ClassVar[bool] = False
    #: Whether it measures the force, else the position.
    measures_force: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_field(self, "mass", 0.0, 1e5, open_low=True)
        check_field(self, "sample_rate", 1.0, 1e5)
        check_field(self, "wanted_force", 0.0, 1e6, open_low=True)
        check_field(self, "approach_speed", 0.0, 10.0, open_low=True)
        check_field(self, "tool_mass", 0.0, self.mass)
        if self.delay is not None:
            check_field(self, "delay", 0.0, 0.1)

    @property
    def known_delay(self) -> float:
        """The delay, s; 0 if none is known."""
        return self.delay or 0.0

    @property
    def force_corner(self) -> float:
        """Corner of the filter of the force, rad/s; any one if the loop measures no force."""
        return 2.0 * np.pi * 20.0

    @property
    def position_bandwidth(self) -> float:
        """Bandwidth of the position loop, rad/s; 1 without one."""
        return 1.0

    @property
    def viscous_friction(self) -> float:
        """Viscous friction of the joints along the normal, N·s/m."""
        return 0.0

    @property
    @abstractmethod
    def plant(self) -> FreePlant:
        """What the controller acts on, without the material."""

    @abstractmethod
    def response(self, unit_delay: Complex) -> Complex:
        """Return −command/measurement as a function of z⁻¹."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return the loop with this factor on its gain."""

    @abstractmethod
    def parameters(self) -> str:
        """Return the gains as parameters of a ROS 2 controller, YAML."""

    def with_delay(self, delay: float) -> Self:
        """Return the loop with this delay, s."""
        return replace(self, delay=delay)

    def gain_values(self) -> dict[str, float]:
        """Return the gains by name, SI."""
        return {name: getattr(self, name) for name in self.gains}

    def as_dict(self) -> dict[str, float | None]:
        """Return the gains and the approach speed as plain numbers."""
        numbers = {**self.gain_values(), "approach_speed": self.approach_speed}
        return {name: finite_or_none(value) for name, value in numbers.items()}

    def numbers(self, factor: Floats) -> list[float | Floats]:
        """Return the columns of ``touching_loop.hpp`` from the controller to the speed."""
        first, second = self.gain_values().values()
        return [
            self.number, factor, first, second, self.mass, self.tool_mass, self.viscous_friction,
            1.0 / self.sample_rate, self.known_delay, self.force_corner, self.position_bandwidth,
            self.wanted_force, self.approach_speed,
        ]  # fmt: skip


@frozen(kw_only=True)
class MotorForceLoop(ControlLoop):
    """A control loop that commands a motor force, on a robot whose joints have friction.

    Parameters
    ----------
    friction : float
        Viscous friction of the joints along the normal, N·s/m. Default: 0.
    """

    friction: float = 0.0

    def __post_init__(self) -> None:
        ControlLoop.__post_init__(self)
        check_field(self, "friction", 0.0, 1e6)

    @property
    def viscous_friction(self) -> float:
        """Viscous friction of the joints along the normal, N·s/m."""
        return self.friction

    @property
    def plant(self) -> FreePlant:
        """The mass, with its friction."""
        return FreePlant(0.0, self.friction, 1.0)


#: Module of each loop, whose ``LOOP`` is its class.
LOOPS: Mapping[str, str] = MappingProxyType(
    {
        "admittance": "palpate.control_loops.admittance",
        "impedance": "palpate.control_loops.impedance",
        "force": "palpate.control_loops.force",
    }
)


def loop_called(name: str) -> type[ControlLoop]:
    """Return the class of a control loop.

    Parameters
    ----------
    name : str
        "admittance", "impedance" or "force".

    Returns
    -------
    type of ControlLoop
        Its class.

    Raises
    ------
    InvalidParameterError
        There is no such loop.

    Examples
    --------
    >>> from palpate import control_loops
    >>> control_loops.loop_called("impedance").__name__
    'ImpedanceControl'
    """
    check_choice("controller", name, LOOPS)
    loop: type[ControlLoop] = import_module(LOOPS[name]).LOOP
    return loop
