"""A sphere on a half-space in OpenSim, by its ``HuntCrossleyForce``.

Simbody, which computes it, documents F = k x^(3/2) (1 + 3/2 c v) with k = 4/3 √R E, where R is the
radius, c the dissipation, and E the plane-strain moduli of the two bodies combined:
E^(2/3) = s E₁^(2/3), s = E₂^(2/3) / (E₁^(2/3) + E₂^(2/3)), c = s c₁ + (1 − s) c₂.
"""

import tempfile
from pathlib import Path

from palpate import HuntCrossley
from peers.carriage import FREE, MASS, SAMPLE_TIME
from peers.installed import installed

MODULUS = 1e5  # Pa: what OpenSim calls stiffness
DISSIPATION = 1.0  # s/m
RADIUS = 0.0225  # m, of which the root is 0.15
STIFFNESS = 4.0 / 3.0 * RADIUS**0.5 * MODULUS
HUNT_CROSSLEY = HuntCrossley(K=STIFFNESS, B=STIFFNESS * 1.5 * DISSIPATION, n=1.5)

# The two moduli combine by their 2/3rd powers: so stiff a tip changes the ninth digit.
RIGID = 1e18  # Pa


class OpenSimProbe:
    """A probe on an elastic half-space; its tip is of another material, rigid unless given."""

    engine = "OpenSim"

    def __init__(
        self, *, tip_modulus: float = RIGID, tip_dissipation: float = 0.0, accuracy: float = 1e-8
    ) -> None:
        opensim = _quiet_opensim()
        self._model = opensim.Model()
        self._model.setGravity(opensim.Vec3(0.0))
        self._coordinate, self._body = _build(opensim, self._model)
        self._tip = opensim.Vec3(RADIUS, 0.0, 0.0)
        self._contact = _contact_force(opensim, tip_modulus, tip_dissipation)
        self._model.addForce(self._contact)
        self._drive = opensim.CoordinateActuator("depth")
        self._drive.setOptimalForce(1.0)
        self._model.addForce(self._drive)
        self._state = self._model.initSystem()
        self._coordinate.setValue(self._state, -FREE)
        self._drive.overrideActuation(self._state, True)
        self._manager = opensim.Manager(self._model)
        self._manager.setIntegratorAccuracy(accuracy)
        self._manager.setIntegratorMaximumStepSize(SAMPLE_TIME)
        self._model.realizeDynamics(self._state)

    def advance(self, time: float, push: float) -> None:
        self._drive.setOverrideActuation(self._state, push)
        # The manager integrates a state of its own, which would not see the new push.
        self._manager.initialize(self._state)
        self._state = self._manager.integrate(time)
        self._model.realizeDynamics(self._state)

    def position(self) -> float:
        return self._coordinate.getValue(self._state)

    def penetration(self) -> float:
        # OpenSim reports none, but where the lowest point of the sphere is; the plane is at x = 0.
        return self._body.findStationLocationInGround(self._state, self._tip).get(0)

    def velocity(self) -> float:
        return self._body.findStationVelocityInGround(self._state, self._tip).get(0)

    def force(self) -> float:
        labels = self._contact.getRecordLabels()
        values = self._contact.getRecordValues(self._state)
        return -values.get(labels.findIndex("contact.probe.force.X"))


def _quiet_opensim():
    opensim = installed("opensim")
    # Or it leaves a log in whichever folder the tests are run from.
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("Off")
    return opensim


def _build(opensim, model):
    """The coordinate that slides the probe along x, 0 where it touches, and the probe's body."""
    zero = opensim.Vec3(0.0)
    probe = opensim.Body("probe", MASS, zero, opensim.Inertia(1.0))
    touching = opensim.Vec3(-RADIUS, 0.0, 0.0)
    joint = opensim.SliderJoint("slide", model.getGround(), touching, zero, probe, zero, zero)
    joint.updCoordinate().setName("depth")
    model.addBody(probe)
    model.addJoint(joint)
    model.addContactGeometry(opensim.ContactSphere(RADIUS, zero, probe, "tip"))
    model.addContactGeometry(opensim.ContactHalfSpace(zero, zero, model.getGround(), "surface"))
    return joint.getCoordinate(), probe


def _contact_force(opensim, tip_modulus: float, tip_dissipation: float):
    """From a file: from Python both bodies of a force can only be given the same material."""
    materials = _material("surface", MODULUS, DISSIPATION) + _material(
        "tip", tip_modulus, tip_dissipation
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "contact.xml")
        file.write_text(_DOCUMENT.format(materials=materials), encoding="utf-8")
        force = opensim.OpenSimObject.makeObjectFromFile(str(file))
    return opensim.HuntCrossleyForce.safeDownCast(force)


def _material(geometry: str, modulus: float, dissipation: float) -> str:
    return (
        f"<HuntCrossleyForce::ContactParameters><geometry>{geometry}</geometry>"
        f"<stiffness>{modulus!r}</stiffness><dissipation>{dissipation!r}</dissipation>"
        "</HuntCrossleyForce::ContactParameters>"
    )


_DOCUMENT = """<OpenSimDocument Version="40500"><HuntCrossleyForce name="contact">
<HuntCrossleyForce::ContactParametersSet name="contact_parameters"><objects>
{materials}
</objects></HuntCrossleyForce::ContactParametersSet></HuntCrossleyForce></OpenSimDocument>"""
