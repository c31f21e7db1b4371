"""Laws of engines and of the literature: the same force as by their own formulas."""

import math

import mujoco
import numpy as np
import pytest

from palpate import (
    ExtendedKelvinVoigt,
    GeneralisedHuntCrossley,
    HuntCrossley,
    InvalidParameterError,
    KelvinVoigt,
    SingleRelaxation,
    restitution,
)
from palpate.force_laws import engines, literature

X = np.array([1e-4, 2e-3, 7e-3])
V = np.array([0.03, -0.05, 0.2])


def hertz_by_chrono(x, v, modulus=2e5, radius=0.01, mass=0.3, e=0.7):
    """As ChContactForceSMC and LIGGGHTS work it out, step by step."""
    root = np.sqrt(radius * x)
    slope = 2.0 * modulus * root
    beta = math.log(e) / math.sqrt(math.log(e) ** 2 + math.pi**2)
    damping = -2.0 * math.sqrt(5.0 / 6.0) * beta * np.sqrt(slope * mass)
    return 2.0 / 3.0 * slope * x + damping * v


ELASTIC = {"K": 3e4, "n": 1.5}
IMPACT = {**ELASTIC, "restitution": 0.8, "speed": 0.5}
# A law by its source's numbers, and the source's own formula.
LAWS = {
    "drake point": (
        engines.drake_point(stiffness=1e3, dissipation=2.0),
        lambda x, v: 1e3 * x * (1.0 + 2.0 * v),
    ),
    "drake sap": (
        engines.drake_sap(stiffness=1e3, relaxation_time=0.02),
        lambda x, v: 1e3 * (x + 0.02 * v),
    ),
    "drake hydroelastic": (
        engines.drake_hydroelastic(modulus=1e5, thickness=0.02, radius=0.03, dissipation=0.5),
        # The volume of the cap, by E/H, of a sphere that is far larger than it is deep.
        lambda x, v: (
            1e5 / 0.02 * math.pi * x**2 * (3.0 * 0.03 - x) / 3.0 * (1.0 + 0.5 * v)
            / (1.0 - x / (3.0 * 0.03))
        ),
    ),
    "pybullet": (
        engines.kelvin_voigt(K=2e3, B=17.0),
        lambda x, v: 2e3 * x + 17.0 * v,
    ),
    "simbody": (
        engines.simbody(modulus=1e5, radius=0.0225, dissipation=1.0),
        lambda x, v: 4.0 / 3.0 * 0.15 * 1e5 * x**1.5 * (1.0 + 1.5 * v),
    ),
    "chrono, material": (
        engines.hertz_tsuji(modulus=2e5, radius=0.01, mass=0.3, restitution=0.7),
        hertz_by_chrono,
    ),
    "chrono, coefficients": (
        engines.chrono_hertz(stiffness=1e6, damping=4e4, radius=0.01, mass=0.3),
        lambda x, v: 0.01 * np.sqrt(x) * (1e6 * x + 0.3 * 4e4 * v),
    ),
    "kuwabara–kono": (
        literature.half_space(K=1e4, n=1.5, retardation_time=0.02),
        lambda x, v: 1e4 * (x**1.5 + 1.5 * 0.02 * np.sqrt(x) * v),
    ),
    "hunt–crossley": (
        literature.hunt_crossley_1975(**IMPACT),
        lambda x, v: 3e4 * x**1.5 * (1.0 + 3.0 * (1.0 - 0.8) / (2.0 * 0.5) * v),
    ),
    "lankarani–nikravesh": (
        literature.lankarani_nikravesh(**IMPACT),
        lambda x, v: 3e4 * x**1.5 * (1.0 + 3.0 * (1.0 - 0.8**2) / (4.0 * 0.5) * v),
    ),
    "flores": (
        literature.flores(**IMPACT),
        lambda x, v: 3e4 * x**1.5 * (1.0 + 8.0 * (1.0 - 0.8) / (5.0 * 0.8 * 0.5) * v),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_a_named_law_is_its_sources_formula(name):
    law, formula = LAWS[name]
    np.testing.assert_allclose(law.force(X, V), formula(X, V), rtol=1e-12)  # roundings


@pytest.mark.parametrize("speed", [0.01, 1.0])
def test_tsujis_damper_gives_the_requested_restitution(speed):
    """As Antypov and Elliott, 2011, proved: e at the depth 0, however the force then pulls."""
    mass, law = 0.3, LAWS["chrono, material"][0]
    # Of an elastic impact, to scale the time step: 3.2 (m²/(K² v))^(1/5).
    duration = 3.2 * (mass**2 / (law.K**2 * speed)) ** 0.2
    x, v, dt = 0.0, speed, duration / 4000.0

    def push(x, v):
        return -law.force(x, v) / mass

    while x >= 0.0:
        half = x + 0.5 * dt * v, v + 0.5 * dt * push(x, v)
        x, v = x + dt * half[1], v + dt * push(*half)
    # Of the midpoint rule in 4000 steps, at x^¼ near the surface: seen, 3e-5.
    assert -v / speed == pytest.approx(0.7, abs=3e-4)


def test_restitution_formulas_agree_for_small_loss():
    given = {**ELASTIC, "restitution": 0.95, "speed": 0.4}
    for law_of in (literature.hunt_crossley_1975, literature.lankarani_nikravesh):
        law = law_of(**given).simplest()
        assert restitution(law.dissipation, 0.4) == pytest.approx(0.95, abs=0.01)


def test_zeners_two_forms_are_one_solid_and_maxwells_fluid_flows():
    series, parallel, viscosity = 900.0, 600.0, 40.0
    law = literature.standard_linear_solid(
        K=series * parallel / (series + parallel),
        branch_stiffness=series**2 / (series + parallel),
        branch_damping=viscosity * series**2 / (series + parallel) ** 2,
    )
    omega = np.array([0.5, 10.0, 300.0])
    # A spring in series with a spring and a damper side by side.
    whole = 1.0 / (1.0 / series + 1.0 / (parallel + 1j * omega * viscosity))
    np.testing.assert_allclose(law.dynamic_stiffness(1e-3, omega), whole, rtol=1e-12)
    branch = {"branch_stiffness": 500.0, "branch_damping": 25.0}
    law = literature.standard_linear_solid(K=0.0, **branch)
    assert law.relaxation == SingleRelaxation(0.05)
    force = law.force_along(np.full(3, 1e-3), np.zeros(3), [1e-6, 0.05, 10.0], law.rest())
    # The step takes a microsecond, of a twentieth of a second.
    np.testing.assert_allclose(force, [0.5, 0.5 / math.e, 0.0], atol=2e-5)


def test_fungs_tissue_relaxes_as_it_is_published():
    from scipy.special import exp1

    c, low, high = 0.2, 0.01, 100.0
    law = literature.fung(instantaneous=1e3, n=1.0, c=c, shortest=low, longest=high)
    whole = 1.0 + c * math.log(high / low)
    state = law.step(law.rest(), 1e-3, 1e-9)
    for time in (0.1, 1.0, 10.0):
        held = law.step(state, 1e-3, time)
        expected = (1.0 + c * (exp1(time / high) - exp1(time / low))) / whole
        # Two branches to an octave stand for the spectrum: within 1e-3 of it near its ends.
        assert law.force(1e-3, 0.0, held) == pytest.approx(expected, rel=1e-3)
    assert law.instantaneous().force(1e-3, 0.0) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("power", [0.0, 1.0, 2.0])
def test_a_contact_of_mujocos_has_the_law_of_its_solref(power):
    solref, width = (-9e4, -300.0), 0.02
    solimp = (1e-3, 1e-3, width, 0.5, 2.0) if not power else (1e-4, 1e-2, width, 0.999, power)
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><option gravity="0 0 0" timestep="1e-4" cone="elliptic"/><worldbody>
          <geom name="ground" type="plane" size="1 1 1"/>
          <body pos="0 0 0.1"><joint name="slide" type="slide" axis="0 0 -1"/>
            <geom name="tip" type="sphere" size="0.1" mass="2"/></body>
        </worldbody><contact><pair geom1="tip" geom2="ground" condim="1"
          solref="{solref[0]} {solref[1]}" solimp="{" ".join(map(str, solimp))}"/></contact>
        </mujoco>""")
    mobility = float(model.body_invweight0[:, 0].sum())
    law = engines.mujoco(solref=solref, solimp=solimp, inverse_mass=mobility)
    data = mujoco.MjData(model)
    for x, v in ((2e-3, 0.05), (8e-3, 0.1), (1.5e-2, -0.02)):
        data.qpos[0], data.qvel[0] = x, v
        mujoco.mj_forward(model, data)
        d = float(data.efc_KBIP[0, 2])
        added = d / ((1.0 - d) * mobility) * data.qacc[0]
        expected = law.force(x, v)
        if power:
            # What the law leaves out: 1 − d, and that d begins at 1e-4 and not at 0.
            more = d / (solimp[1] * (x / width) ** power / 0.999 ** (power - 1.0))
            elastic = law.force(x, 0.0)
            expected = more * (more * elastic + expected - elastic) / (1.0 - d)
        assert data.efc_force[0] - added == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        KelvinVoigt(K=300.0, B=4.0),
        HuntCrossley(K=3e4, B=2e4, n=1.4),
        HuntCrossley(K=3e4, B=0.0, n=1.4),
        GeneralisedHuntCrossley(K=3e4, n=1.5, B=50.0, p=0.5),
        GeneralisedHuntCrossley(
            K=3e4, n=1.5, B=50.0, p=1.5, M=1e4, relaxation=SingleRelaxation(0.1)
        ),
    ],
    ids=repr,
)
def test_a_law_goes_to_the_family_and_back(law):
    general = GeneralisedHuntCrossley.of(law)
    assert general.simplest() == law
    np.testing.assert_allclose(general.force(X, V), law.force(X, V), rtol=1e-14)


def test_an_extended_law_goes_where_one_power_is_left():
    linear, quadratic = (
        ExtendedKelvinVoigt(K1=300.0, K2=0.0, B=4.0),
        ExtendedKelvinVoigt(K1=0.0, K2=9e4, B=4.0),
    )
    assert GeneralisedHuntCrossley.of(linear).simplest() == KelvinVoigt(K=300.0, B=4.0)
    law = GeneralisedHuntCrossley.of(quadratic)
    np.testing.assert_allclose(law.force(X, V), quadratic.force(X, V), rtol=1e-14)
    with pytest.raises(InvalidParameterError, match="a single power of depth"):
        GeneralisedHuntCrossley.of(ExtendedKelvinVoigt(K1=300.0, K2=9e4, B=4.0))


def test_an_engine_has_a_law_exactly_by_its_exponents():
    def named(law):
        return {engine.name.split(",")[0] for engine in engines.exact_in(law)}

    assert named(LAWS["drake point"][0]) == {"Drake"}
    assert "PyBullet" in named(LAWS["drake sap"][0])
    assert named(LAWS["simbody"][0]) == {"Simbody and OpenSim"}
    assert named(LAWS["kuwabara–kono"][0]) == {"Chrono SMC", "LAMMPS"}
    assert not named(GeneralisedHuntCrossley(K=1e4, n=1.4, B=1e2, p=1.4))
    assert not named(
        GeneralisedHuntCrossley(K=1e3, n=1.0, B=1e2, p=1.0, M=1e2, relaxation=SingleRelaxation(0.1))
    )
    # Without a damper its exponent does not matter.
    assert {"Drake", "PyBullet"} <= named(GeneralisedHuntCrossley(K=1e3, n=1.0, B=0.0, p=0.3))
