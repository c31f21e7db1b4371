"""A whole trace of variable projection, eight answers at a time, is the recursion's own."""

import numpy as np
import pytest
from cases import MATERIALS, exciting, knowledge, tapping

from palpate import (
    ChangeDetector,
    ConstantForgetting,
    HuntCrossley,
    OutlierRejection,
    Scale,
    Status,
    VariableProjection,
)

# Answers that are worked out abreast end Newton's method and the interpolation of sums a little
# elsewhere: by 4e-3 standard errors at most in what is tried here, and by 1e-3 but for the first
# few hundred samples.
TOLERANCE = 1e-2


def spiked(signals):
    signals.force[::97] += 3.0
    signals.force[5] = np.nan
    signals.force[700:706] = np.nanmax(signals.force)
    return signals


def changed(signals):
    harder = HuntCrossley(6000.0, 3000.0, 1.2).force(signals.penetration, signals.velocity)
    signals.force[900:] = harder[900:] + 0.02 * np.random.default_rng(2).standard_normal(1100)
    return signals


def gone(signals):
    """Held at the surface and above it for a while, and lost to nonsense."""
    signals.penetration[400:600] = -1e-3
    signals.penetration[600:640] = 1e-5
    signals.force[400:640] = 0.0
    signals.force[1200], signals.penetration[1201] = 1e300, -1e300
    return signals


MOTIONS = {
    "pressing": exciting(MATERIALS["ball"], seconds=2.0, noise=0.02),
    "tapping": tapping(MATERIALS["pvc"], noise=0.01, seed=2),
    "noisy": exciting(MATERIALS["sponge"], seconds=2.0, noise=0.5, seed=3),
    "clean": exciting(MATERIALS["pvc"], seconds=2.0),
    "spiked": spiked(tapping(MATERIALS["ball"], noise=0.02)),
    "changed": changed(exciting(MATERIALS["ball"], seconds=2.0, noise=0.02)),
    "gone": gone(exciting(MATERIALS["ball"], seconds=2.0, noise=0.02)),
    "long": exciting(MATERIALS["ball"], seconds=20.0, noise=0.02),
}
SETTINGS = {
    "plain": {},
    "watched": {"change_detector": ChangeDetector(), "outlier_rejection": OutlierRejection()},
    "forgetting": {"forgetting": ConstantForgetting(0.999)},
    "without an offset": {"offset": False},
    "with a tare": {"offset_deviation": 0.01, "noise": 0.02},
    "known exponent": {"exponent": 1.5},
    "narrow": {"exponent_range": (0.8, 1.3)},
    "other units": {"scale": Scale(1e-3, 1.0, 30.0)},
}


def near(found, wanted, *, within, of_it=0.0):
    """As pytest.approx, which takes a second for each of these traces: NaN is near to nothing."""
    with np.errstate(invalid="ignore"):  # of infinities, which have to be the same
        off = np.abs(found - wanted)
    return np.all((found == wanted) | (off <= np.maximum(within, of_it * np.abs(wanted))))


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("settings", SETTINGS)
def test_it_agrees_with_estimates_asked_for_one_by_one(motion, settings):
    signals = MOTIONS[motion]
    estimator, asked = (VariableProjection(**SETTINGS[settings]) for _ in range(2))
    trace = estimator.replay(*signals.arrays)
    each = asked.replay(*signals.arrays, at=np.arange(len(signals)))
    assert knowledge(estimator) == knowledge(asked)
    assert trace.status.tobytes() == each.status.tobytes()
    off = np.abs(trace.parameters - each.parameters)
    assert np.all((off <= TOLERANCE * each.standard_errors) | (off == 0.0))
    # Of clean data the residual, and so the errors, are what rounding left of the sums.
    wide = 0.05 if motion == "clean" else TOLERANCE
    assert near(trace.standard_errors, each.standard_errors, within=1e-12, of_it=wide)
    assert near(trace.validity_margin, each.validity_margin, within=5e-3, of_it=5e-3)
    # A prediction is off by what the law is, a hundredth of its error, which is far below this.
    looped = VariableProjection(**SETTINGS[settings])
    expected = []
    for x, v, force in signals.rows:
        expected.append(looped.predict(x, v) if np.isfinite((x, v, force)).all() else np.nan)
        status = looped.update(x, v, force)
        if status == Status.REJECTED:  # after what was left out with it
            expected[-1] = looped.predict(x, v)
    sane = np.abs(signals.force[np.isfinite(signals.force)])
    largest = sane[sane < 1e100].max()
    expected = np.array(expected)
    known = ~np.isnan(expected)
    assert np.isnan(trace.predicted_force[~known]).all()
    assert near(trace.predicted_force[known], expected[known], within=1e-3 * largest, of_it=1e-6)


def test_traces_in_pieces_teach_the_same():
    signals = MOTIONS["tapping"]
    whole, pieces = VariableProjection(), VariableProjection()
    whole.replay(*signals.arrays)
    for start in range(0, len(signals), 333):
        pieces.replay(*signals[start : start + 333].arrays)
    assert knowledge(whole) == knowledge(pieces)
