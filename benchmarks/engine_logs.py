"""What engines log of a body that is pressed on an exported contact, and the law read back from it.

The body falls gently on the surface, and then a load of three sines presses it. Every log has the
columns that users of the engine write: MuJoCo's and PyBullet's contacts, and Isaac Lab's position
and net force of a body.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import palpate
from palpate.exports.mujoco.engine import InRows
from palpate.exports.newton import NewtonScene
from palpate.exports.usd import UsdMaterial
from palpate.force_laws import ForceLaw
from palpate.validation import Floats

Log = Mapping[str, Floats]
# s, of the descent and of the whole.
DESCENT, WHOLE = 0.5, 6.0
ABOVE = 2e-3  # m, where the body starts


def load(time: float, speed: float) -> float:
    """Return the load at a time [s] and a speed into the surface [m/s], N."""
    if time < DESCENT:
        return 0.2 - 5.0 * speed
    sines = ((2.0, 1.0), (2.0, 2.7), (1.5, 4.1))  # N, Hz
    return 8.0 + sum(size * math.sin(2.0 * math.pi * rate * time) for size, rate in sines)


def log_mujoco(fragment: InRows, *, contacts: bool = False) -> Log:
    """Return the depth and the summed force of MuJoCo's contacts, or a row for each contact."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(fragment.scene(0.0))
    data = mujoco.MjData(model)
    data.qpos[0] = ABOVE
    felt = np.zeros(6)
    rows = []
    while data.time < WHOLE:
        data.qfrc_applied[0] = -load(data.time, -data.qvel[0])
        mujoco.mj_forward(model, data)
        forces = []
        for k in range(data.ncon):
            mujoco.mj_contactForce(model, data, k, felt)
            forces.append(felt[0])
            contact = data.contact[k]
            if contacts:
                bodies = contact.geom1, contact.geom2
                rows.append((data.time, *bodies, contact.dist, *contact.pos, felt[0]))
        if not contacts:
            rows.append((data.time, -data.qpos[0], sum(forces)))
        mujoco.mj_step(model, data)
    places = ("pos_x", "pos_y", "pos_z")
    names = ("time", "geom1", "geom2", "dist", *places, "force_n")
    return _table(names if contacts else ("time", "penetration", "force"), rows)


def log_mjx(fragment: InRows) -> Log:
    """Return the depth and the force of MJX's constraints."""
    import jax
    import mujoco
    from mujoco import mjx

    model = mujoco.MjModel.from_xml_string(fragment.scene(0.0))
    simulated = mjx.put_model(model)
    start = mjx.make_data(model).replace(qpos=jax.numpy.array([ABOVE]))
    times = np.arange(0.0, WHOLE, model.opt.timestep)
    pressed = np.array([load(time, 0.0) for time in times])
    descending = times < DESCENT

    def step(state: Any, now: Any) -> Any:
        press, descends = now
        applied = -press - jax.numpy.where(descends, 5.0, 0.0) * state.qvel
        after = mjx.step(simulated, state.replace(qfrc_applied=applied))
        return after, (-state.qpos[0], after.qfrc_constraint[0])

    _, (depth, force) = jax.lax.scan(step, start, (pressed, descending))
    rows = zip(times.tolist(), np.asarray(depth).tolist(), np.asarray(force).tolist(), strict=True)
    return _table(("time", "penetration", "force"), list(rows))


def log_newton(fragment: UsdMaterial) -> Log:
    """Return the height of the body and its net force in Newton, named as in Isaac Lab."""
    scene = NewtonScene(fragment.files(()), "SolverMuJoCo")
    mass = fragment.request.mass_or_one
    step = fragment.request.time_step
    scene.put(-ABOVE, 0.0)
    rows = []
    for time in np.arange(0.0, WHOLE, step).tolist():
        speed = float(scene.velocity()[2])
        depth = scene.penetration()
        press = load(time, -speed)
        scene.step(step, (0.0, 0.0, -press, 0.0, 0.0, 0.0))
        force = press + mass * (float(scene.velocity()[2]) - speed) / step
        rows.append((time, -depth, force))
    return _table(("time", "pos_w_z", "net_forces_w_z"), rows)


def log_pybullet(stiffness: float, damping: float, step: float = 1e-3) -> Log:
    """Return PyBullet's contact points of a sphere of 1 kg on a plane."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setPhysicsEngineParameter(fixedTimeStep=step, numSubSteps=1)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
        pybullet.createMultiBody(0.0, plane)
        sphere = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.03)
        tip = pybullet.createMultiBody(1.0, sphere, basePosition=[0.0, 0.0, 0.03 + ABOVE])
        pybullet.changeDynamics(
            tip,
            -1,
            contactStiffness=stiffness,
            contactDamping=damping,
            linearDamping=0.0,
            angularDamping=0.0,
        )
        rows = []
        for time in np.arange(0.0, WHOLE, step).tolist():
            place, _ = pybullet.getBasePositionAndOrientation(tip)
            speed = -pybullet.getBaseVelocity(tip)[0][2]
            force = [0.0, 0.0, -load(time, speed)]
            pybullet.applyExternalForce(tip, -1, force, place, pybullet.WORLD_FRAME)
            pybullet.stepSimulation()
            rows += [
                (time, *point[5], *point[7], point[8], point[9])
                for point in pybullet.getContactPoints(tip)
            ]
    finally:
        pybullet.disconnect(client)
    axes = [f"{name}_{axis}" for name in ("positionOnA", "contactNormalOnB") for axis in "xyz"]
    return _table(("time", *axes, "contactDistance", "normalForce"), rows)


#: The log of each engine that palpate runs and that steps in time.
LOGS: Mapping[str, Callable[[Any], Log]] = {
    "mujoco": log_mujoco,
    "mjx": log_mjx,
    "newton": log_newton,
}


def read_back(log: Log, law: ForceLaw) -> tuple[float, float]:
    """Return the errors of stiffness and damping identified from a log, at its depth, %."""
    found = palpate.identify(palpate.Recording(dict(log)), trace=False).working_depths[0]
    stiffness = found.stiffness.value / law.stiffness_at(found.depth)
    damping = found.damping.value / law.damping_at(found.depth)
    return 100.0 * abs(stiffness - 1.0), 100.0 * abs(damping - 1.0)


def _table(names: tuple[str, ...], rows: Sequence[Sequence[float]]) -> Log:
    return dict(zip(names, np.array(rows, dtype=np.float64).T, strict=True))
