"""What was set in an engine that nobody here wrote is what identification returns."""

import numpy as np
import pytest

from palpate import (
    ConstantForgetting,
    Contact,
    DoubleStageRLS,
    DriftTracking,
    ExtendedKelvinVoigtRLS,
    HuntCrossley,
    KelvinVoigtRLS,
    SingleStageRLS,
    VariableProjection,
    identify,
)
from palpate.force_laws import engines
from peers import drake_probe, opensim_probe
from peers.installed import installed
from peers.reference_simulators import (
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    NOISE,
    REFERENCE_SIMULATORS,
    beside,
    sensed,
    shown_by,
)

pytestmark = pytest.mark.peers

# Exact methods, but for the tip: as rigid as it is, it changes the law in the tenth (Drake) or the
# ninth digit (OpenSim), which a fit can amplify a hundredfold.
EXACT = 1e-6

hunt_crossley = pytest.mark.parametrize("name", HUNT_CROSSLEY)


def relative_error(returned, law) -> np.ndarray:
    return returned.parameters / law.parameters - 1.0


def test_an_absent_engine_is_a_skip_that_says_how_to_get_it() -> None:
    with pytest.raises(pytest.skip.Exception, match=r"no_such_engine.*palpate\[peers\]"):
        installed("no_such_engine")


def by_its_numbers(name):
    """The law of an engine's own numbers."""
    if name == "opensim":
        return engines.simbody(
            modulus=opensim_probe.MODULUS,
            radius=opensim_probe.RADIUS,
            dissipation=opensim_probe.DISSIPATION,
        )
    stiffness = drake_probe.STIFFNESS
    if name == "drake-sap":
        return engines.drake_sap(stiffness=stiffness, relaxation_time=drake_probe.RELAXATION)
    return engines.drake_point(stiffness=stiffness, dissipation=drake_probe.DISSIPATION)


@pytest.mark.parametrize("name", REFERENCE_SIMULATORS)
def test_an_engine_shows_the_force_of_the_law_that_it_documents(name) -> None:
    # With the penetration and velocity of the same row: wrong by a step it is wrong by 5e-3.
    for law in (REFERENCE_SIMULATORS[name].law, by_its_numbers(name)):
        assert beside(shown_by(name), law) < 1e-7


@hunt_crossley
@pytest.mark.parametrize(
    "estimator, most",
    [
        # 1e-3 is what was promised; an offset of 25 µN, estimated beside the law, leaves some 1e-5.
        (lambda law: VariableProjection(), 1e-3),
        # Started at what was set: from most other starts it freezes, as the paper found.
        (lambda law: DoubleStageRLS(initial=law), EXACT),
        # The sensor's noise is given: a Kalman filter that finds none at all trusts its start in
        # the first 0.1 s of light touch, and is then off by 0.5 % in K and 7 % in B
        # (docs/reference-simulators.md).
        (lambda law: DriftTracking(noise=NOISE), 1e-3),
    ],
    ids=["variable projection", "double stage", "drift tracking"],
)
def test_what_was_set_is_returned(name, estimator, most) -> None:
    law = HUNT_CROSSLEY[name].law
    result = identify(shown_by(name), estimator(law))
    assert not result.flags
    assert np.abs(relative_error(result.law, law)).max() < most
    if most == 1e-3:
        off = np.abs(result.law.parameters - law.parameters)
        assert (off < 3.0 * result.standard_errors).all()


@pytest.mark.parametrize("name", REFERENCE_SIMULATORS)
def test_through_a_noisy_sensor_what_was_set_lies_within_the_error_bars(name) -> None:
    law, unforgetting = REFERENCE_SIMULATORS[name].law, ConstantForgetting(1.0)
    kelvin_voigt = KelvinVoigtRLS(forgetting=unforgetting) if name in KELVIN_VOIGT else None
    for seed in range(5):
        estimate = identify(sensed(shown_by(name), seed), kelvin_voigt).estimate
        # Four standard errors: once in 16 000 for each number of a right estimator.
        assert (np.abs(estimate.parameters - law.parameters) < 4.0 * estimate.standard_errors).all()
        # Error bars that would hold anything prove nothing.
        assert (estimate.standard_errors < 0.01 * law.parameters).all()


@hunt_crossley
def test_the_single_stage_returns_what_was_set_but_for_the_bias_of_its_logarithm(name) -> None:
    law, contact = HUNT_CROSSLEY[name].law, shown_by(name)
    # Nothing forgotten and next to no weight on the start: plain least squares of ln F.
    estimator = SingleStageRLS(initial_covariance=1e8, forgetting=ConstantForgetting(1.0))
    result = identify(contact, estimator)
    biased = with_bias_of_logarithm(law, contact, result.trace.taken)
    assert np.abs(relative_error(result.law, biased)).max() < EXACT


def with_bias_of_logarithm(law: HuntCrossley, contact: Contact, taken: np.ndarray) -> HuntCrossley:
    """The law that least squares makes of ln F where ln(1 + bv) is not bv (after eq. 9)."""
    x, v = contact.penetration[taken], contact.velocity[taken]
    rows = np.column_stack([np.ones_like(v), v, np.log(x)])
    left_out = np.log1p(law.dissipation * v) - law.dissipation * v
    bias = np.linalg.lstsq(rows, left_out, rcond=None)[0]
    stiffness = law.stiffness * np.exp(bias[0])
    return HuntCrossley(stiffness, stiffness * (law.dissipation + bias[1]), law.exponent + bias[2])


@hunt_crossley
def test_with_its_defaults_the_single_stage_is_low_by_no_more_than_condition_10_lets_it(
    name,
) -> None:
    law, contact = HUNT_CROSSLEY[name].law, shown_by(name)
    stiffness, damping, _ = relative_error(identify(contact, SingleStageRLS()).law, law)
    assert np.abs(law.dissipation * contact.velocity).max() < 0.1
    # The paper's own motion at |bv| up to 0.1 costs 0.12 % of K and 0.54 % of B: twice that.
    assert -0.0024 < stiffness < 0.0
    assert -0.0108 < damping < 0.0


def test_kelvin_voigt_returns_what_was_set_extended_or_not_and_no_quadratic_stiffness() -> None:
    law, contact = KELVIN_VOIGT["drake-sap"].law, shown_by("drake-sap")
    found = identify(contact, KelvinVoigtRLS()).law
    assert np.abs(relative_error(found, law)).max() < EXACT
    extended = identify(contact, ExtendedKelvinVoigtRLS()).law
    assert extended.stiffness == pytest.approx(law.stiffness, rel=EXACT)
    assert extended.damping == pytest.approx(law.damping, rel=EXACT)
    quadratic = extended.quadratic_stiffness * contact.penetration.max()
    assert abs(quadratic) < EXACT * law.stiffness


@pytest.mark.parametrize("name", REFERENCE_SIMULATORS)
def test_a_law_that_was_not_set_does_not_fit(name) -> None:
    fits = [
        identify(shown_by(name), estimator).fit_rmse_percent
        for estimator in (VariableProjection(), KelvinVoigtRLS())
    ]
    right, wrong = fits if name in HUNT_CROSSLEY else fits[::-1]
    assert right < 1e-3  # % of the force
    assert wrong > 0.5
