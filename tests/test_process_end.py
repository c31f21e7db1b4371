"""A process that has used everything ends without a word: no compiled object is left over."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

USE = """
import copy, pickle, sys
import palpate
from cases import KINDS, MATERIALS, exciting

signals = exciting(MATERIALS["ball"], seconds=0.2, noise=0.02)
kept = sys.kept_to_the_end = []

class Unit(palpate.Scale):
    "Settings that know whose they are."

for kind in (*KINDS.values(), palpate.VariableProjection, palpate.DriftTracking):
    unit = Unit(1e-2, 2e-2, 1.0)
    estimator = kind(scale=unit, gate=palpate.ContactGate(1e-3), sample_time=1e-3,
                     change_detector=palpate.ChangeDetector())
    object.__setattr__(unit, "owner", estimator)  # a cycle through the settings
    kept += [estimator.replay(*signals.arrays), estimator.estimate(), estimator.estimate().law]

    class Own(kind):
        "A class that holds an instance of itself, which holds itself."

    Own.default = Own()
    Own.default.itself = Own.default

    plain = kind()
    for sample in signals.rows:
        kept.append(plain.update(*sample))
    kept += [plain, plain.copy(), plain.replace(), copy.deepcopy(plain)]
    kept += [pickle.loads(pickle.dumps(plain)), plain.estimate().flags]
    for wrong in ({"gate": 3}, {"no such setting": 1}, {"sample_time": float("nan")}):
        try:
            kind(**wrong)
        except (TypeError, ValueError) as error:
            kept.append(error)  # with its frames
    for arguments in (("a", 1.0, 2.0), (1.0,)):
        try:
            plain.update(*arguments)
        except TypeError as error:
            kept.append(error)

engine = palpate.LeastSquares(2)
engine.update([1.0, 2.0], 3.0)
kept += [engine, pickle.loads(pickle.dumps(engine))]
contact = palpate.Contact(signals.time, penetration=signals.penetration,
                          velocity=signals.velocity, force=signals.force)
kept += [palpate.identify(contact), palpate.compare(contact)]
"""

LEAK = """
import ctypes, palpate
ctypes.pythonapi.Py_IncRef(ctypes.py_object(palpate.VariableProjection()))
"""


def said_by(program: str) -> tuple[str, str]:
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=Path(__file__).parent, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    return done.stdout.strip(), done.stderr


def test_no_compiled_object_outlives_the_interpreter():
    assert said_by(USE) == ("", "")
    assert "nanobind: leaked 1 instances" in said_by(LEAK)[1]  # as it would be seen


OWN_LAW = """
from dataclasses import dataclass
import numpy as np
import palpate
from cases import MATERIALS, exciting

@palpate.force_laws.register
@dataclass(frozen=True, kw_only=True)
class Cubic(palpate.force_laws.ForceLaw):
    "F = K x³ + B v."
    kind, symbols, units = "cubic", ("K", "B"), ("N/m³", "N·s/m")
    K: float
    B: float

    def _force(self, x, v):
        return self.K * x**3 + self.B * v

    def penetration_gradient(self, x, v):
        return 3.0 * self.K * x**2 + 0.0 * v

    def parameter_gradient(self, x, v):
        return np.stack([x**3 + 0.0 * v, v + 0.0 * x], axis=-1)

signals = exciting(MATERIALS["ball"], seconds=0.5, noise=0.02)
contact = palpate.Contact(signals.time, penetration=signals.penetration,
                          velocity=signals.velocity, force=signals.force)
result = palpate.identify(contact, law="cubic")  # a global, to the end
"""


def test_a_result_of_a_custom_law_may_be_a_global():
    assert said_by(OWN_LAW) == ("", "")


IMPORTS = """
import gc, importlib, pkgutil
import palpate
for module in pkgutil.walk_packages(palpate.__path__, "palpate."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
gc.collect()
held = palpate.ContactEstimator, palpate.LeastSquares
print([each for each in gc.get_objects() if isinstance(each, held)])
"""


def test_no_module_holds_a_compiled_object():
    """It would outlive the compiled module wherever something else keeps the holder to the end."""
    assert said_by(IMPORTS) == ("[]", "")


FORK = """
import os, pickle, sys, threading, time
import numpy as np
import palpate

x = np.tile(np.sin(np.linspace(0.0, 3.0, 1000)) * 1e-2, 1000)
arrays = x, np.gradient(x, 1e-3), 1e3 * x
own = palpate.VariableProjection()
own.replay(*(each[:1000] for each in arrays))
replayed = palpate.VariableProjection()
worker = threading.Thread(target=replayed.replay, args=arrays, daemon=True)
worker.start()
time.sleep(0.1)
child = os.fork()
if child:
    assert worker.is_alive()  # it was in the midst of a replay
    os._exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
for call in (
    lambda: replayed.update(1e-3, 0.0, 1.0), lambda: replayed.predict(1e-3, 0.0),
    replayed.estimate, lambda: replayed.replay(x, x, x), lambda: pickle.dumps(replayed),
):
    try:
        call()
        os._exit(3)
    except RuntimeError as error:
        assert "forked while another thread replayed this estimator" in str(error)
replayed.replace().update(1e-3, 0.0, 1.0)
replayed.reset()
replayed.replay(*(each[:1000] for each in arrays))
os._exit(0 if replayed.estimate().law == own.estimate().law else 4)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process can be forked there")
def test_a_fork_during_a_replay_raises_and_does_not_deadlock():
    # Where the child hangs, both processes are ended, by their group.
    # From 3.12 on Python itself warns of such a fork.
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORK]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            _, error = process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            raise
    assert (process.returncode, error) == (0, "")
