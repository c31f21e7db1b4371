"""Impedance control: a virtual spring and damper between the target and the measured position."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Self

from palpate.control_loops.loop import Complex, MotorForceLoop
from palpate.validation import check_field, frozen
from palpate.writing import MADE

_MOST = 5000.0  # of crisp_controllers


@frozen(kw_only=True)
class ImpedanceControl(MotorForceLoop):
    """Impedance control by motor forces, with the wanted force as feedforward.

    u = stiffness · (x_d − x) + damping · (ẋ_d − ẋ) + wanted_force

    The velocity is the difference of the last two positions. A factor on the gain multiplies
    stiffness and damping.

    Parameters
    ----------
    mass, sample_rate, wanted_force, approach_speed, delay, tool_mass
        As in :class:`ControlLoop`.
    stiffness, damping : float
        N/m and N·s/m.
    friction : float
        Viscous friction of the joints along the normal, N·s/m. Default: 0.

    Raises
    ------
    InvalidParameterError
        A number is outside its range.

    Examples
    --------
    >>> from palpate import control_loops
    >>> loop = control_loops.ImpedanceControl(
    ...     stiffness=500.0, damping=60.0, mass=4.0, sample_rate=1000.0, delay=2e-3,
    ...     wanted_force=5.0, approach_speed=0.02,
    ... )
    >>> loop.scaled(2.0).stiffness
    1000.0
    """

    stiffness: float
    damping: float
    name: ClassVar[str] = "impedance"
    title: ClassVar[str] = "impedance control"
    number: ClassVar[int] = 1
    gains: ClassVar[Mapping[str, str]] = {"stiffness": "N/m", "damping": "N·s/m"}
    measures_force: ClassVar[bool] = False

    def __post_init__(self) -> None:
        MotorForceLoop.__post_init__(self)
        check_field(self, "stiffness", 0.0, 1e9, open_low=True)
        check_field(self, "damping", 0.0, 1e9)

    def response(self, unit_delay: Complex) -> Complex:
        """Return −u/x."""
        return self.stiffness + self.damping * self.sample_rate * (1.0 - unit_delay)

    def scaled(self, factor: float) -> Self:
        """Return the loop with this factor on stiffness and damping."""
        return replace(self, stiffness=self.stiffness * factor, damping=self.damping * factor)

    def parameters(self) -> str:
        """Return the parameters of ``cartesian_controller`` in crisp_controllers 2.3, YAML.

        It takes neither number above 5000: both are lowered together, which leaves more margin.
        """
        allowed = self.scaled(min(1.0, _MOST / max(self.stiffness, self.damping)))
        return f"""\
{MADE}
# cartesian_controller of crisp_controllers 2.3, which takes numbers up to {_MOST:g}.
# z is the normal of the surface; take the other axes from your own file.
/**:
  ros__parameters:
    task:
      k_pos_z: {float(f"{allowed.stiffness:.6g}")!r}
      d_pos_z: {float(f"{allowed.damping:.6g}")!r}
"""


LOOP = ImpedanceControl
