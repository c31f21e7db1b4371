"""An engine's force and rebound beside the law's and the measured ones."""

from dataclasses import dataclass

from palpate.exports.engine import Fragment
from palpate.exports.errors import Drop, drop_to, force_error
from palpate.exports.motion import MOST_SAMPLES, Motion
from palpate.exports.nearest import Nearest
from palpate.exports.source import Source
from palpate.force_laws import ForceLaw
from palpate.validation import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """The errors of an export, by replay where the engine is there, else as predicted.

    Attributes
    ----------
    how : str
        How it was replayed; empty where it was not.
    fails : str
        Why an engine that is installed was not replayed all the same.
    predicted_percent : float
        Of the force that was predicted of the engine, against the law's.
    replayed_percent : float, optional
        Of the real engine's.
    against_measured_percent : float, optional
        Of the engine's force, replayed or else predicted, against the measured one.
    law_leaves_percent : float, optional
        Of the law's own, against the measured one.
    drop : Drop
        To the greatest depth of the motion, by the exported law.
    predicted_rebound : float
        Restitution predicted of the engine in that drop.
    replayed_rebound : float, optional
        In the real engine.
    """

    how: str
    fails: str
    predicted_percent: float
    replayed_percent: float | None
    against_measured_percent: float | None
    law_leaves_percent: float | None
    drop: Drop
    predicted_rebound: float
    replayed_rebound: float | None

    @property
    def replayed(self) -> bool:
        """Whether the real engine was asked."""
        return self.replayed_percent is not None

    @property
    def percent(self) -> float:
        """Error of the engine's force against the law's: replayed, or else predicted."""
        if self.replayed_percent is None:
            return self.predicted_percent
        return self.replayed_percent

    @property
    def rebound(self) -> float:
        """Restitution by the engine in the drop: replayed, or else predicted."""
        return self.predicted_rebound if self.replayed_rebound is None else self.replayed_rebound

    @property
    def rebound_percent(self) -> float:
        """Error of that restitution, of the law's; NaN of a law by which nothing rebounds."""
        law = self.drop.restitution
        return 100.0 * (self.rebound / law - 1.0) if law > 0.0 else float("nan")


def compared(source: Source, nearest: Nearest, fragment: Fragment, *, replay: bool) -> Compared:
    """Return the errors of a fragment along the source's motion.

    Parameters
    ----------
    source : Source
        The law as identified: what the engine is compared with.
    nearest : Nearest
        What the fragment was made of.
    fragment : Fragment
        The law in the engine.
    replay : bool
        Whether the real engine is asked, where it is there.
    """
    whole = source.motion
    most = fragment.most_samples
    motion = whole.firm(most)
    law = law_along(source.law, whole, motion, most)
    predicted = fragment.predicted(motion)
    ran, fails = None, ""
    try:
        ran = fragment.replay(motion) if replay else None
    except ImportError as error:  # installed, and yet it does not load
        if _interrupted(error):
            raise KeyboardInterrupt from None
        fails = " ".join(str(error).split())
    drop = drop_to(nearest.law, fragment.asked.mass_or_one, whole.deepest)
    measured = motion.force
    force = predicted if ran is None else ran.force
    return Compared(
        how="" if ran is None else ran.how,
        fails=fails,
        predicted_percent=force_error(predicted, law, motion.judged),
        replayed_percent=None if ran is None else force_error(ran.force, law, motion.judged),
        against_measured_percent=_error(force, measured, motion),
        law_leaves_percent=_error(law, measured, motion),
        drop=drop,
        predicted_rebound=fragment.predicted_rebound(drop),
        replayed_rebound=fragment.rebound(drop) if ran is not None and _stable(fragment) else None,
    )


def _interrupted(error: BaseException | None) -> bool:
    """Whether somebody ended it: an extension says of that too that it cannot be imported."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return _interrupted(error.__cause__ or error.__context__)


def _stable(fragment: Fragment) -> bool:
    """Whether a simulation at the time step asked for does not run away; else it is refused."""
    limit = fragment.largest_step
    return limit is None or fragment.asked.time_step < limit


def law_along(law: ForceLaw, whole: Motion, motion: Motion, most: int = MOST_SAMPLES) -> Floats:
    """Force by a law at a motion's samples, N; what it remembers is that of the whole motion."""
    force = whole.force_by(law)
    return force if motion is whole else force[whole.firm_places(most)]


def _error(force: Floats, measured: Floats | None, motion: Motion) -> float | None:
    return None if measured is None else force_error(force, measured, motion.judged)
