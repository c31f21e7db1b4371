"""Force control: proportional and integral, by motor forces."""

from collections.abc import Mapping
from dataclasses import replace
from math import tau
from typing import ClassVar, Self

from palpate.control_loops.loop import Complex, MotorForceLoop
from palpate.validation import check_field, frozen
from palpate.writing import MADE


@frozen(kw_only=True)
class ForceControl(MotorForceLoop):
    """Proportional and integral control of the force, with the wanted force as feedforward.

    u = wanted_force + proportional · (wanted_force − F) + integral · ∫ (wanted_force − F) dt

    A factor on the gain multiplies both.

    Parameters
    ----------
    mass, sample_rate, wanted_force, approach_speed, delay, tool_mass
        As in :class:`ControlLoop`.
    proportional, integral : float
        Without unit, and 1/s.
    force_filter : float
        Corner of the force's low-pass filter of order two, Hz.
    friction : float
        Viscous friction of the joints along the normal, N·s/m. Default: 0.

    Raises
    ------
    InvalidParameterError
        A number is outside its range.

    Examples
    --------
    >>> from palpate import control_loops
    >>> loop = control_loops.ForceControl(
    ...     proportional=0.5, integral=2.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
    ...     friction=40.0, force_filter=100.0, wanted_force=5.0, approach_speed=0.02,
    ... )
    >>> loop.scaled(0.5).integral
    1.0
    """

    proportional: float
    integral: float
    force_filter: float
    name: ClassVar[str] = "force"
    title: ClassVar[str] = "force control"
    number: ClassVar[int] = 2
    gains: ClassVar[Mapping[str, str]] = {"proportional": "", "integral": "1/s"}
    needs_frequency: ClassVar[bool] = True

    def __post_init__(self) -> None:
        MotorForceLoop.__post_init__(self)
        check_field(self, "proportional", 0.0, 1e6, open_low=True)
        check_field(self, "integral", 0.0, 1e6)
        check_field(self, "force_filter", 0.1, 1e4)

    @property
    def force_corner(self) -> float:
        """Corner of the filter of the force, rad/s."""
        return tau * self.force_filter

    def response(self, unit_delay: Complex) -> Complex:
        """Return −u/F."""
        return self.proportional + self.integral / self.sample_rate / (1.0 - unit_delay)

    def scaled(self, factor: float) -> Self:
        """Return the loop with this factor on both gains."""
        return replace(
            self, proportional=self.proportional * factor, integral=self.integral * factor
        )

    def parameters(self) -> str:
        """Return the gains as those of a PID of control_toolbox, YAML."""
        return f"""\
{MADE}
# Gains of a control_toolbox PID on the force; ros2_controllers 6 and crisp_controllers 2.3 have no
# controller of the force alone.
/**:
  ros__parameters:
    gains:
      normal_force: {{p: {self.proportional:.6g}, i: {self.integral:.6g}, d: 0.0}}
"""


LOOP = ForceControl
