"""What the exports to engines are tried with: laws, and what is asked."""

import numpy as np

from palpate.exports import ExportRequest, ProbeMotion, engine_called
from palpate.exports.replay_errors import force_error
from palpate.force_laws import GeneralisedHuntCrossley
from palpate.lab import BALL, PVC, SPONGE

BALL_LAW = GeneralisedHuntCrossley.of(BALL.law)
SPONGE_LAW = GeneralisedHuntCrossley.of(SPONGE.law)
PVC_LAW = GeneralisedHuntCrossley.of(PVC.law)
HERTZ_LAW = GeneralisedHuntCrossley(K=2e4, n=1.5, B=3e4, p=1.5)
KELVIN_VOIGT_LAW = GeneralisedHuntCrossley(K=2000.0, n=1.0, B=16.6, p=0.0)
# Of a sphere on a Kelvin–Voigt half-space: p = n − 1.
HALF_SPACE_LAW = GeneralisedHuntCrossley(K=2e4, n=1.5, B=300.0, p=0.5)


def asked(law, **further):
    return ExportRequest(law=law, motion=ProbeMotion.of_paper(), **further)


def fitted(engine, law, **further):
    return engine_called(engine).fit(asked(law, **further))


def apart_percent(motion, law, other):
    """Error of the force of a law, by another, along a motion."""
    return force_error(motion.force_by(law), motion.force_by(other), motion.judged)


def predicted_percent(fragment, law=None):
    """Error of the force predicted, along the motion that it was made for."""
    motion = fragment.request.motion
    reference = motion.force_by(fragment.request.law if law is None else law)
    return force_error(fragment.predict_force(motion), reference, motion.judged)


def replayed_percent(fragment, most=500):
    """Errors of the force replayed and predicted at some of the states of the motion."""
    motion = fragment.request.motion.firm(most)
    reference = motion.force_by(fragment.request.law)
    ran = fragment.replay(motion)
    assert np.isfinite(ran.force).all()
    return (
        force_error(ran.force, reference, motion.judged),
        force_error(fragment.predict_force(motion), reference, motion.judged),
    )
