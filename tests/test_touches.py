"""Touches are found and numbered."""

from dataclasses import replace

import numpy as np
import pytest
from probing import BALL, contact_of, felt, tapping

from palpate import Contact
from palpate.preparation.touches import touches_of


def tapped(seconds: float, seed: int = 0) -> Contact:
    motion = tapping(seconds)
    return contact_of(motion, felt(BALL, motion, seed))


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


def test_a_bounce_of_less_than_50_ms_is_no_touch_of_its_own_and_free_air_has_none():
    contact = tapped(3.0)
    force = contact.force.copy()
    middle = int(np.argmax(force))
    force[middle : middle + 30] = 0.0
    assert len(touches_of(replace(contact, force=force))) == len(touches_of(contact))
    free = replace(contact, penetration=np.full(len(contact), -1e-3), force=0.0 * force)
    assert touches_of(free) == []
