"""Which gains? Those that neither swing nor bounce: the given ones do, the recommended ones settle.

Admittance control of a robot of 10 kg, 4 ms late, touches the rubber ball that was identified from
a recording. The recommended gain has a margin of 6 dB, whatever the recording leaves open.
"""

from pathlib import Path

import palpate
from palpate import control_loops
from palpate.control_loops.figures import draw_gains

ball = Path(__file__).parents[1] / "recordings" / "ball.csv"
loop = control_loops.AdmittanceControl(
    virtual_mass=2.0,
    virtual_damping=30.0,
    mass=10.0,
    sample_rate=500.0,
    delay=4e-3,
    bandwidth=60.0,
    force_filter=100.0,
    wanted_force=10.0,
    approach_speed=0.02,
)
gains = palpate.gains(palpate.identify(ball), loop)
print(gains)
figure = draw_gains(gains, width=88e-3)
