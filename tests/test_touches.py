"""Touches are found and numbered."""

import numpy as np
import pytest
from probing import BALL, NOISE, tapping

from palpate import Contact
from palpate.preparation.touches import touches_of


def tapped(seconds: float, seed: int = 0) -> Contact:
    motion = tapping(seconds)
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(motion))
    force = BALL.force(motion.x, motion.v) + noise
    return Contact(motion.time, penetration=motion.x, velocity=motion.v, force=force)


@pytest.mark.parametrize("seed", range(3))
def test_every_stroke_is_one_touch(seed):
    contact = tapped(6.0, seed)
    inside = contact.penetration > 0.0
    strokes = int(np.count_nonzero(inside[1:] & ~inside[:-1]) + inside[0])
    found = touches_of(contact)
    assert [touch.number for touch in found] == list(range(1, strokes + 1))
    for touch in found:
        during = (contact.time >= touch.start) & (contact.time <= touch.stop)
        assert touch.peak_force == contact.force[during].max()
        assert touch.peak_penetration == contact.penetration[during].max()


def test_a_bounce_of_less_than_50_ms_is_no_touch_of_its_own():
    contact = tapped(3.0)
    force = contact.force.copy()
    middle = int(np.argmax(force))
    force[middle : middle + 30] = 0.0
    lost = Contact(
        contact.time, penetration=contact.penetration, velocity=contact.velocity, force=force
    )
    assert len(touches_of(lost)) == len(touches_of(contact))


def test_free_air_has_no_touch():
    time = 1e-3 * np.arange(500)
    zero = np.zeros(500)
    assert touches_of(Contact(time, penetration=zero - 1e-3, velocity=zero, force=zero)) == []
