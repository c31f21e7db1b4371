"""The same faults on the laboratory's robot, whose encoders, friction and control are not ideal."""

import numpy as np

from benchmarks.diagnosis.faults import FAULTS, Fault
from benchmarks.diagnosis.outcome import Outcome, judged, refused
from benchmarks.diagnosis.probing import Probing
from palpate import HuntCrossley, RecordingError, identify, lab

PROBED = ("ball", "sponge", "pvc")


def outcomes(job: tuple[str, int]) -> list[tuple[Fault, Outcome]]:
    """Press a material once with the robot, and put each fault on the recording."""
    name, seed = job
    material = lab.MATERIALS[name]
    run = lab.Bench(material, lab.THREE_SINES).run(seed)
    law = material.law  # type: ignore[attr-defined]  # of a homogeneous one
    return [(fault, _outcome(fault, run, law, seed)) for fault in FAULTS]


def _outcome(fault: Fault, run: lab.Measurement, law: HuntCrossley, seed: int) -> Outcome:
    made = _probing(run, law, seed)
    if fault.before is not None:
        fault.before(made)
    sensed = lab.Sensors().force(made.force, made.random)
    made.force = sensed - float(sensed[made.time < lab.THREE_SINES.pause].mean())
    made.penetration = np.array(run.contact.penetration)
    if fault.after is not None:
        fault.after(made)
    try:
        return judged(made, identify(made.contact), fault)
    except RecordingError as error:
        return refused(error)


def _probing(run: lab.Measurement, law: HuntCrossley, seed: int) -> Probing:
    truth = run.truth
    made = Probing(
        truth.time,
        truth.penetration,
        truth.velocity,
        truth.force,
        law,
        np.random.default_rng([seed, 7]),
        0.0,
        0.0,
    )
    made.stiffness, made.damping = law.stiffness_at(made.depth), law.damping_at(made.depth)
    return made


def pair(job: tuple[str, str, int]) -> str:
    """Return the verdict on one material under one motion; ``"refused"`` if there is none."""
    material, motion, seed = job
    bench = lab.Bench(lab.MATERIALS[material], lab.TRAJECTORIES[motion])
    try:
        return identify(bench.run(seed).contact).diagnosis.verdict.overall
    except RecordingError:
        return "refused"
