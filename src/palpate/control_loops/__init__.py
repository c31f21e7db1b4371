"""Control loops that touch a material: whether their gains are safe, and those that are.

loop = control_loops.ImpedanceControl(stiffness=500.0, damping=60.0, mass=4.0, ...)
print(palpate.gains(palpate.load_result("ball"), loop))
"""

from palpate.control_loops.admittance import AdmittanceControl as AdmittanceControl
from palpate.control_loops.answer import GainMargin as GainMargin
from palpate.control_loops.answer import Gains as Gains
from palpate.control_loops.answer import Refusal as Refusal
from palpate.control_loops.choosing import contact_knowledge as contact_knowledge
from palpate.control_loops.following import Following as Following
from palpate.control_loops.following import measure_following as measure_following
from palpate.control_loops.force import ForceControl as ForceControl
from palpate.control_loops.impedance import ImpedanceControl as ImpedanceControl
from palpate.control_loops.laws import ContactKnowledge as ContactKnowledge
from palpate.control_loops.laws import KnownLaw as KnownLaw
from palpate.control_loops.loop import ControlLoop as ControlLoop
from palpate.control_loops.loop import loop_called as loop_called
from palpate.control_loops.margins import gains_for as gains_for
