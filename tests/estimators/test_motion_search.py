"""The better motion: within its limits, and never worse than the planned one."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from palpate import HuntCrossley, lab
from palpate.lab.design import Motion, design

BALL, SPONGE, PHANTOM = lab.BALL.law, lab.SPONGE.law, lab.PVC.law
MATERIALS = [BALL, SPONGE, PHANTOM]
materials = st.builds(
    HuntCrossley, K=st.floats(1e2, 1e6), B=st.floats(1e2, 1e6), n=st.floats(0.8, 2.5)
)
motions = st.integers(1, 3).flatmap(
    lambda count: st.builds(
        Motion,
        st.floats(1e-3, 2e-2),
        st.tuples(*[st.floats(1e-4, 3e-3)] * count),
        st.tuples(*[st.floats(1.0, 30.0)] * count),
    )
)
limits = st.none() | st.floats(2e-3, 3e-2)


@pytest.mark.long
@settings(max_examples=15, deadline=None, derandomize=True)
@given(materials, motions, limits, limits, st.booleans())
def test_the_better_motion_keeps_to_its_limits_and_is_never_worse(
    law, motion, depth, speed, offset
):
    asked = {"offset": offset, "max_depth": depth, "max_speed": speed}
    result = design(law, motion, noise=0.01, durations=(5.0,), **asked)
    assert result.reason
    if result.better is None:
        return
    found = result.better.motion
    assert result.limits.allow(found)
    assert found.peak_penetration <= (motion.peak_penetration if depth is None else depth)
    assert found.top_speed <= (motion.top_speed if speed is None else speed)
    assert found.least_penetration > 0.0
    assert not result.better.leaves_contact
    if result.limits.allow(motion):
        assert result.better.worst < result.planned.worst


@pytest.mark.parametrize("law", MATERIALS, ids=repr)
def test_a_better_motion_than_the_papers_exists(law):
    first = design(law, noise=0.05)
    assert first.better.worst < first.planned.worst / 2.5
    assert "wider range of depths" in first.reason
    assert "identifies the damping" in first.reason
    own = {"max_depth": first.limits.peak_penetration, "max_speed": first.limits.speed}
    again = design(law, first.better.motion, noise=0.05, **own)
    assert again.better is None
    assert "better by 2 %" in again.reason


OTHERS = [pytest.param(law, marks=pytest.mark.slow) for law in (SPONGE, PHANTOM)]


@pytest.mark.parametrize("law", [BALL, *OTHERS], ids=repr)
def test_a_coarse_sensor_gets_a_motion_that_varies_the_rounding(law):
    result = design(law, noise=0.02, resolution=0.1)
    assert len(result.better.motion.frequencies) == 2
    assert result.better.worst < result.planned.worst / 2.0
    assert result.better.worst < 1.2 * result.better.relative_errors[-1].max()


def test_the_better_motion_stays_where_the_force_is_clear_of_the_noise():
    law = HuntCrossley(K=1e5, B=2e5, n=2.0)
    found = design(law, noise=0.05).better.motion
    assert law.force(found.least_penetration, 0.0) >= 0.5
    weak = design(law, noise=1.0).better.motion
    assert law.force(weak.least_penetration, 0.0) >= 0.099 * law.force(weak.peak_penetration, 0.0)


def test_a_motion_out_of_its_limits_is_replaced_by_one_within():
    result = design(BALL, noise=0.05, max_speed=0.01)
    assert result.better.motion.top_speed <= 0.01
    assert "it keeps the limits" in result.reason
    deeper = design(BALL, noise=0.05, max_depth=0.03)
    assert deeper.better.motion.peak_penetration > 0.029
    assert "it goes deeper" in deeper.reason
    again = design(BALL, noise=0.05, max_depth=0.03)
    assert again.as_dict() == deeper.as_dict()
