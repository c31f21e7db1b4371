"""How late a force is, from touches of a simulated spring: truth, bars and refusals."""

import json

import numpy as np
import pytest

import palpate
from benchmarks.bank.springs import imperfect, touch
from palpate.errors import InvalidParameterError, RecordingError


@pytest.mark.parametrize(
    "seeds", [range(4), pytest.param(range(100, 140), marks=pytest.mark.slow)], ids=len
)
def test_the_skew_of_springs_is_within_two_bars_of_a_tenth_of_a_millisecond(seeds):
    found = [(palpate.skew(contact), late) for contact, late in map(imperfect, seeds)]
    assert all(each.mark == "trust" and each.delay.whole_error <= 1e-4 for each, _ in found)
    within = [abs(each.delay.value - late) <= 2 * each.delay.whole_error for each, late in found]
    assert np.mean(within) >= 0.95


NO_SPRING = {
    "rubber that relaxes": ({"relaxing": [(0.1, 0.03), (0.1, 0.3), (0.1, 3.0)]}, "relaxes by"),
    "one relaxation time": ({"relaxing": [(0.1, 0.06)]}, "relaxes by"),
    "a loss factor of 2 %": ({"loss": 0.02}, "relaxes by"),
    "damping": ({"damping": 0.5}, "depends on the depth"),
    "friction of 5 %": ({"friction": 0.05}, "friction is 5"),
    "one speed": ({"slow": 2.0, "quick": 4.0}, "at least 3 times as high"),
    "constant speeds": ({"triangles": True}, "move as a sine does"),
    "two strokes": ({"cycles": 1, "slow": 1.0, "quick": 1.0}, "strokes within the contact"),
}


@pytest.mark.parametrize("name", NO_SPRING)
def test_a_touch_that_is_not_on_a_spring_is_refused(name):
    fault, reason = NO_SPRING[name]
    for seed in range(3):
        contact, _ = touch(seed, **fault)
        with pytest.raises(RecordingError, match=reason):
            palpate.skew(contact)


def test_a_slow_touch_asks_for_a_quicker_one():
    contact, late = touch(1, slow=0.3, quick=1.5)
    found = palpate.skew(contact)
    assert found.mark == "with-care"
    assert "at 3 Hz or more" in found.next_step
    assert abs(found.delay.value - late) <= 2 * found.delay.whole_error


def test_clocks_that_move_between_two_touches_widen_the_bar():
    first, last = touch(1, late=2e-3)[0], touch(2, late=3e-3)[0]
    found = palpate.skew(first, last)
    assert found.delay.value == pytest.approx(2.5e-3, abs=1e-4)
    assert found.delay.systematic == pytest.approx(0.5e-3, rel=0.1)
    assert found.mark == "with-care"
    with pytest.raises(InvalidParameterError, match="at least one touch"):
        palpate.skew()


def test_the_command_prints_the_option_that_identify_takes(tmp_path, run, printed):
    contact, late = touch(1)
    file = tmp_path / "spring.csv"
    palpate.write_contact(contact, file)
    option = json.loads(printed("skew", file, "--json"))["option"]
    assert option.removeprefix("--delay ") in printed("skew", file)
    printed("identify", file, "--json", *option.split())
    status, _, error = run("skew", file, *option.split())
    assert (status, error.count("\n")) == (2, 1)
    value, error = (float(each.removesuffix("ms")) for each in option[8:].split("+-"))
    assert abs(1e3 * late - value) <= 2 * error


def test_identify_and_the_loop_take_out_a_known_delay():
    time = np.arange(0.0, 6.0, 1e-3)
    law = palpate.HuntCrossley(K=2000.0, B=1500.0, n=1.2)

    def depth(t):
        return 4e-3 + 1e-3 * np.sin(12.0 * t) + 1e-3 * np.sin(25.0 * t)

    def speed(t):
        return 12e-3 * np.cos(12.0 * t) + 25e-3 * np.cos(25.0 * t)

    for late in (3.3e-3, -4.7e-3, 7e-3):
        force = law.force(depth(time - late), speed(time - late))
        online = palpate.OnlinePreparation(force_delay=(late, 5e-5)).replay(depth(time), force)
        assert (
            online.delay
            == palpate.prepare(
                time=time, penetration=depth(time), force=force, delay=(late, 5e-5)
            ).delay
        )
        offline = palpate.identify(
            time=time, penetration=depth(time), force=force, delay=(late, 5e-5), law="hunt-crossley"
        )
        for result in (offline, palpate.identify(online, law="hunt-crossley")):
            # The filter of 15 ms flattens the quicker sine by 0.1 % of its speed.
            assert result.law.B == pytest.approx(1500.0, rel=5e-3)
    with pytest.raises(InvalidParameterError, match="half of the velocity_window"):
        palpate.OnlinePreparation(force_delay=8e-3)
