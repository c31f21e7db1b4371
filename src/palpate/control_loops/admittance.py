"""Admittance control: the measured force moves a virtual mass, which a position loop follows."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Self

from palpate.control_loops.loop import Complex, ControlLoop, FreePlant
from palpate.validation import check_field, frozen
from palpate.writing import MADE


@frozen(kw_only=True)
class AdmittanceControl(ControlLoop):
    """Admittance control on a robot with a position loop, without a virtual spring.

    virtual_mass · ẍ_c + virtual_damping · ẋ_c = wanted_force − F

    The position loop follows x_c as a critically damped system of order two. A factor α on the gain
    divides virtual mass and damping by α.

    Parameters
    ----------
    mass, sample_rate, wanted_force, approach_speed, delay, tool_mass
        As in :class:`ControlLoop`.
    virtual_mass, virtual_damping : float
        kg and N·s/m.
    bandwidth : float
        Natural frequency of the position loop, rad/s.
    force_filter : float
        Corner of the force's low-pass filter of order two, Hz.

    Raises
    ------
    InvalidParameterError
        A number is outside its range.

    Examples
    --------
    >>> from palpate import control_loops
    >>> loop = control_loops.AdmittanceControl(
    ...     virtual_mass=2.0, virtual_damping=80.0, mass=10.0, sample_rate=500.0, delay=4e-3,
    ...     bandwidth=60.0, force_filter=100.0, wanted_force=5.0, approach_speed=0.02,
    ... )
    >>> loop.scaled(0.5).virtual_damping
    160.0
    """

    virtual_mass: float
    virtual_damping: float
    bandwidth: float
    force_filter: float
    name: ClassVar[str] = "admittance"
    title: ClassVar[str] = "admittance control"
    number: ClassVar[int] = 0
    gains: ClassVar[Mapping[str, str]] = {"virtual_mass": "kg", "virtual_damping": "N·s/m"}

    def __post_init__(self) -> None:
        ControlLoop.__post_init__(self)
        check_field(self, "virtual_mass", 0.0, 1e6, open_low=True)
        check_field(self, "virtual_damping", 0.0, 1e9)
        check_field(self, "bandwidth", 0.0, 1e4, open_low=True)
        check_field(self, "force_filter", 0.1, 1e4)

    @property
    def force_corner(self) -> float:
        """Corner of the filter of the force, rad/s."""
        return math.tau * self.force_filter

    @property
    def position_bandwidth(self) -> float:
        """Natural frequency of the position loop, rad/s."""
        return self.bandwidth

    @property
    def plant(self) -> FreePlant:
        """The mass on the spring and damper of its position loop."""
        spring = self.mass * self.bandwidth**2
        return FreePlant(spring, 2.0 * self.mass * self.bandwidth, spring)

    def response(self, unit_delay: Complex) -> Complex:
        """Return −x_c/F: the virtual mass as ros2_controllers integrates it."""
        step = 1.0 / self.sample_rate
        kept = 1.0 - step * self.virtual_damping / self.virtual_mass
        speed = step / self.virtual_mass / (1.0 - kept * unit_delay)
        return speed * step / (1.0 - unit_delay)

    def scaled(self, factor: float) -> Self:
        """Return the loop with virtual mass and damping divided by the factor."""
        mass = self.virtual_mass / factor
        return replace(self, virtual_mass=mass, virtual_damping=self.virtual_damping / factor)

    def parameters(self) -> str:
        """Return the parameters of two admittance controllers, for the axis of the normal, YAML.

        The names are those of ``admittance_controller`` in ros2_controllers 4 to 6, which takes the
        damping as a ratio and needs a stiffness for it, and of ``cartesian_admittance_controller``
        in crisp_controllers 2.3.
        """
        mass = f"{self.virtual_mass:.6g}"
        damping = f"{self.virtual_damping:.6g}"
        ratio = f"{self.virtual_damping / (2.0 * math.sqrt(self.virtual_mass)):.6g}"
        return f"""\
{MADE}
# z is the normal of the surface; take the other axes from your own file.

# admittance_controller of ros2_controllers 4 to 6: {damping} N s/m as a ratio of
# 2 sqrt(mass * stiffness), with a stiffness of 1 N/m, since with none it has no damping.
/**:
  ros__parameters:
    admittance:
      selected_axes: [false, false, true, false, false, false]
      mass: [{mass}, {mass}, {mass}, 1.0, 1.0, 1.0]
      damping_ratio: [{ratio}, {ratio}, {ratio}, 1.0, 1.0, 1.0]
      stiffness: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]

      # cartesian_admittance_controller of crisp_controllers 2.3.
      mass_z: {mass}
      damping_z: {damping}
      stiffness_z: 0.0
"""


LOOP = AdmittanceControl
