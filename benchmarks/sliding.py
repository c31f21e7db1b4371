"""A body pressed on an exported contact and pulled along it: how fast it slides in the engine.

The scene of each export is changed so that its tip can move sideways but not roll, and the load is
that of gravity, or a force on the tip.
"""

from collections.abc import Callable

from palpate import exports
from palpate.exports.drake.engine import DrakeContact
from palpate.exports.drake.running import Plant
from palpate.exports.mujoco.engine import InRows
from palpate.exports.newton import NewtonScene
from palpate.exports.opensim import SphereOnHalfSpace, quiet_opensim
from palpate.exports.usd import UsdMaterial
from palpate.writing import temporary_file

# s, of pressing before the load, and of the load; the speed is that of the last tenth.
SETTLE = 1.0
PULL = 0.5
#: s, of the load at the middle of that tenth: a body that slides has accelerated for so long.
FALL = 0.95 * PULL
# kg m². So large that friction does not make the tip roll.
INERTIA = "1000"

#: Speed [m/s] of a body pressed with a force [N], under a load along the surface [N].
Sliding = Callable[[float, float], float]


def in_mujoco(fragment: InRows) -> Sliding:
    """Return the sliding of MuJoCo."""
    import mujoco

    across = '<joint type="slide" axis="1 0 0"/><geom name="tip"'
    text = fragment.scene(0.0).replace('<geom name="tip"', across)
    text = text.replace('qpos="0"', 'qpos="0 0"').replace('qvel="0"', 'qvel="0 0"')
    model = mujoco.MjModel.from_xml_string(text)

    def speed(press: float, load: float) -> float:
        data = mujoco.MjData(model)
        for seconds, pull in ((SETTLE, 0.0), (0.9 * PULL, load), (0.1 * PULL, load)):
            start = data.qpos[1]
            data.qfrc_applied[:] = -press, pull
            for _ in range(round(seconds / model.opt.timestep)):
                mujoco.mj_step(model, data)
        return float(data.qpos[1] - start) / (0.1 * PULL)

    return speed


def in_drake(fragment: DrakeContact) -> Sliding:
    """Return the sliding of Drake."""
    text = fragment.files(())["contact.sdf"]
    first, _, rest = text.partition('<joint name="slide"')
    inertia = text.partition("<ixx>")[2].partition("<")[0]
    text = first.replace(f">{inertia}<", f">{INERTIA}<") + rest.partition("</joint>")[2]
    radius = fragment.parts.radius

    def speed(press: float, load: float) -> float:
        plant = Plant(text, fragment.setting)
        gravity = plant.plant.mutable_gravity_field()
        tip = plant.plant.GetBodyByName("tip")
        tip_height = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, radius] + [0.0] * 6
        plant.plant.SetPositionsAndVelocities(plant.context, tip.model_instance(), tip_height)
        mass = fragment.parts.mass
        time = 0.0
        for seconds, pull in ((SETTLE, 0.0), (0.9 * PULL, load), (0.1 * PULL, load)):
            start = plant.plant.EvalBodyPoseInWorld(plant.context, tip).translation()[0]
            gravity.set_gravity_vector([pull / mass, 0.0, -press / mass])
            time += seconds
            plant.simulator.AdvanceTo(time)
        end = plant.plant.EvalBodyPoseInWorld(plant.context, tip).translation()[0]
        return float(end - start) / (0.1 * PULL)

    return speed


def in_opensim(fragment: SphereOnHalfSpace) -> Sliding:
    """Return the sliding of OpenSim."""
    slide = '<Coordinate name="penetration"/>'
    plane = f'<Coordinate name="turn"><locked>true</locked></Coordinate>{slide}'
    text = fragment.files(())["contact.osim"].replace("SliderJoint", "PlanarJoint")
    text = text.replace(slide, f'{plane}<Coordinate name="across"/>')

    opensim = quiet_opensim()

    def speed(press: float, load: float) -> float:
        with temporary_file("contact.osim", [text.encode()]) as path:
            model = opensim.Model(str(path))
        mass = fragment.request.mass_or_one
        across = model.getCoordinateSet().get("across")
        state = model.initSystem()
        for seconds, pull in ((SETTLE, 0.0), (0.9 * PULL, load), (0.1 * PULL, load)):
            place = [c.getValue(state) for c in model.getCoordinateSet()]
            velocity = [c.getSpeedValue(state) for c in model.getCoordinateSet()]
            start = across.getValue(state)
            model.setGravity(opensim.Vec3(press / mass, pull / mass, 0.0))
            state = model.initSystem()
            for coordinate, x, v in zip(model.getCoordinateSet(), place, velocity, strict=True):
                coordinate.setValue(state, x, False)
                coordinate.setSpeedValue(state, v)
            manager = opensim.Manager(model)
            manager.setIntegratorAccuracy(1e-4)
            manager.initialize(state)
            state = manager.integrate(seconds)
        return float(across.getValue(state) - start) / (0.1 * PULL)

    return speed


def in_newton(fragment: UsdMaterial, solver: str = "SolverMuJoCo") -> Sliding:
    """Return the sliding of a solver of Newton."""
    files = dict(fragment.files(()))
    mass = "float physics:mass"
    inertia = f"float3 physics:diagonalInertia = ({INERTIA}, {INERTIA}, {INERTIA})"
    files["scene.usda"] = files["scene.usda"].replace(mass, f"{inertia}\n        {mass}")
    step = fragment.request.time_step

    def speed(press: float, load: float) -> float:
        scene = NewtonScene(files, solver)
        scene.put(0.0, 0.0)
        for seconds, pull in ((SETTLE, 0.0), (FALL, load)):
            for _ in range(round(seconds / step)):
                scene.step(step, (pull, 0.0, -press, 0.0, 0.0, 0.0))
        return float(scene.velocity()[0])

    return speed


def sliding(fragment: exports.Fragment) -> Sliding:
    """Return the sliding of a fragment in its engine."""
    if isinstance(fragment, InRows):
        return in_mujoco(fragment)
    if isinstance(fragment, DrakeContact):
        return in_drake(fragment)
    if isinstance(fragment, SphereOnHalfSpace):
        return in_opensim(fragment)
    assert isinstance(fragment, UsdMaterial)
    return in_newton(fragment)
