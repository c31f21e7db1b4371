"""The statement of an export: the origin of its law, and the engine's error.

An :class:`ExportedLaw` is an identified law, or a law alone. :func:`compare_errors` replays the
motion in the engine or predicts its force, and :class:`Statement` decides from the errors whether
to export.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from palpate._core import __version__
from palpate.digits import format_hertz, parameter, rounded
from palpate.errors import (
    ExportRefusedError,
    InvalidParameterError,
    MissingExtraError,
    RecordingError,
)
from palpate.exports.engine import Engine, Fragment, make_refusals, make_warnings
from palpate.exports.motion import GRAVITY, ProbeMotion
from palpate.exports.nearest_law import (
    Nearest,
    fit_with_exponents,
    nearest_to_force,
    nearest_without_memory,
    one_power,
)
from palpate.exports.replay_errors import Drop, drop_to, force_error
from palpate.exports.texts import law_numbers, length, percent
from palpate.findings import Finding
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identification.diagnosis import Diagnosis, Verdict
from palpate.identification.quantities.elastic_modulus import Sphere
from palpate.identifying import Identification, identify
from palpate.method.estimators import VariableProjection
from palpate.output.results.saved import SavedResult
from palpate.validation import Floats, finite_or_none, frozen, shown

#: Types that can be exported.
Exportable: TypeAlias = Identification | SavedResult | ForceLaw


@frozen(eq=False)
class ExportedLaw:
    """A law to export, the motion on which its error is measured, and its verdict.

    Attributes
    ----------
    law : ForceLaw
        The law as identified.
    motion : ProbeMotion
        The recorded motion; for a law alone that of the paper.
    name : str
        Name of the recording; empty for a law alone.
    standard_errors : numpy.ndarray, shape (p,), optional
        Standard errors of the law's parameters.
    verdict : Verdict, optional
        Verdict of the diagnosis; None for a law alone.
    findings : tuple of Finding
        Findings of the diagnosis, most severe first.
    flags : tuple of str
        Flags of the identification.
    tip_radius : float, optional
        Radius of the recording's tip, m, if it is known and spherical.
    response : tuple of float, optional
        Of an identified law that relaxes: the working depth, m, the motion's frequency ω, rad/s,
        and K′, N/m, and B′, N·s/m, there. ``law`` is then the law without memory whose force along
        ``motion`` is nearest to ``answer``.
    answer : numpy.ndarray, shape (k,), optional
        Of an identified law that relaxes: its force along ``motion`` with its memory, N. It has
        the offset of ``law``, which a recording without free air does not tell from the force.
    """

    law: ForceLaw
    motion: ProbeMotion = field(repr=False)
    name: str = ""
    standard_errors: Floats | None = None
    verdict: Verdict | None = None
    findings: tuple[Finding, ...] = ()
    flags: tuple[str, ...] = ()
    tip_radius: float | None = None
    response: tuple[float, float, float, float] | None = None
    answer: Floats | None = field(default=None, repr=False)

    @classmethod
    def of(cls, result: Exportable, mass: float = 1.0) -> "ExportedLaw":
        """Return the exported law of an identification, a saved result, or a law alone.

        The motion of a law alone is at depths for a body of this mass, kg (default: 1).

        Raises
        ------
        InvalidParameterError
            The argument is none of these.
        RecordingError
            The saved result is damaged.
        """
        law = result if isinstance(result, ForceLaw) else getattr(result, "law", None)
        if isinstance(law, ForceLaw) and math.isnan(law.damping_at(1e-3)):
            raise ExportRefusedError(
                "the recording has no time, so its damping, which an engine needs, is unknown: "
                "record the time of each sample"
            )
        if isinstance(result, ForceLaw):
            return cls(result, ProbeMotion.for_law(result, mass))
        if not isinstance(result, Identification | SavedResult):
            raise InvalidParameterError(
                "result must be an Identification, a SavedResult or a force law, not "
                f"{shown(result)}"
            )
        judged: Diagnosis | SavedResult
        try:
            if isinstance(result, Identification):
                judged = result.diagnosis
                flags = result.flags
                tip = result.query.tip
                radius = tip.radius if isinstance(tip, Sphere) else None
            else:
                judged = result
                [found] = result.description["results"]
                saved = (found.get("elastic_modulus") or {}).get("tip") or {}
                radius = float(saved["radius"]) if saved.get("kind") == Sphere.kind else None
                flags = found["flags"]
            response = _response(result, judged)
            exported: ForceLaw = result.law
            motion = ProbeMotion.recorded(result)
            answer = None
            if response is not None:
                exported, motion, answer = _replace_relaxing_law(result, motion)
            return cls(
                law=exported,
                motion=motion,
                name=Path(result.contact.source).name or "a contact",
                standard_errors=None if response is not None else result.standard_errors,
                verdict=judged.verdict,
                findings=tuple(judged.findings),
                flags=tuple(map(str, flags)),
                tip_radius=radius,
                response=response,
                answer=answer,
            )
        except (RecordingError, InvalidParameterError):
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            if isinstance(result, Identification):
                raise
            reason = f"{type(error).__name__}: {error}"
            raise RecordingError(
                f"{result.folder}: the result is damaged ({reason}); run palpate identify again"
            ) from None

    @property
    def reason(self) -> str:
        """The most severe finding and its remedy; empty if the verdict is trust."""
        if self.verdict is None or self.verdict.overall == "trust":
            return ""
        return next((str(finding) for finding in self.findings if finding.severity != "note"), "")

    def nearest(self) -> Nearest:
        """Return the nearest law K xⁿ + B xᵖ v: engines have no laws with relaxation.

        Raises
        ------
        ExportRefusedError
            The nearest law has no K > 0.
        """
        if self.law.powers is None:
            found = one_power(self.law, self.motion)
        else:
            law = GeneralisedHuntCrossley.of(self.law)
            found = nearest_without_memory(law, self.motion)
            if found.law.B < 0.0:
                undamped = fit_with_exponents(law, self.motion, law.n, law.p)
                found = Nearest.of(undamped, self.law, self.motion, "without its negative damping")
        if not found.law.K > 0.0:
            raise ExportRefusedError(
                f"the law has a stiffness of {found.law.K:.3g}, not above 0; run palpate "
                "diagnose FILE to find the cause"
            )
        return found


# An engine's force and restitution compared with those of the law and of the measurement.

# Speed of the faster replay, in multiples of the recorded speed, and its most states.
_FASTER = 2.0
_FASTER_SAMPLES = 2000
# A resting body is compared at most at this part of the force at the greatest depth, and the
# engine's depth is sought within these multiples of the law's.
_REST_LOAD = 0.8
_REST_DEPTHS = np.linspace(0.6, 1.25, 66)


@frozen
class Rest:
    """The depths at which the law and the engine carry a weight at rest.

    Attributes
    ----------
    load : float
        Weight of the body, N, or less if the recording was not so deep.
    law, engine : float
        Depth, m, by the exported law and in the engine; NaN where the engine does not carry it.
    """

    load: float
    law: float
    engine: float


@frozen(eq=False)
class Compared:
    """The errors of an export, replayed if the engine is installed, else predicted.

    Attributes
    ----------
    how : str
        Method of the replay; empty without one.
    fails : str
        Why an installed engine was not replayed.
    predicted_percent : float
        Rms error of the engine's predicted force against the law's, %.
    replayed_percent : float, optional
        The same for the replayed force.
    against_measured_percent : float, optional
        The same for the engine's force, replayed or else predicted, against the measured force.
    law_leaves_percent : float, optional
        The same for the law's force against the measured force.
    drop : Drop
        Impact to the greatest depth of the motion, by the exported law.
    predicted_restitution : float
        Restitution predicted for the engine in that impact.
    replayed_restitution : float, optional
        Restitution of the real engine.
    rest : Rest
        Where a body of the mass rests.
    faster_percent : float
        Rms error of the engine's force, against the exported law that does not pull, at twice the
        recorded speed, %.
    """

    how: str
    fails: str
    predicted_percent: float
    replayed_percent: float | None
    against_measured_percent: float | None
    law_leaves_percent: float | None
    drop: Drop
    predicted_restitution: float
    replayed_restitution: float | None
    rest: Rest
    faster_percent: float

    @property
    def replayed(self) -> bool:
        """Whether the motion was replayed in the real engine."""
        return self.replayed_percent is not None

    @property
    def percent(self) -> float:
        """Error of the engine's force against the law's: replayed, or else predicted."""
        if self.replayed_percent is None:
            return self.predicted_percent
        return self.replayed_percent

    @property
    def drop_restitution(self) -> float:
        """Restitution of the engine in the impact: replayed, or else predicted."""
        return (
            self.predicted_restitution
            if self.replayed_restitution is None
            else self.replayed_restitution
        )

    @property
    def restitution_percent(self) -> float:
        """Error of that restitution relative to the law's, %; NaN if the law has no rebound."""
        law = self.drop.restitution
        return 100.0 * (self.drop_restitution / law - 1.0) if law > 0.0 else float("nan")


def compare_errors(
    source: ExportedLaw,
    nearest: Nearest,
    fragment: Fragment,
    *,
    replay: bool,
) -> Compared:
    """Return the errors of a fragment along the source's motion.

    Parameters
    ----------
    source : ExportedLaw
        The law as identified, which the engine is compared with.
    nearest : Nearest
        The law that the fragment contains.
    fragment : Fragment
        The law in the engine's parameters.
    replay : bool
        Whether to replay the motion in the real engine, if it is installed.
    """
    whole = source.motion
    motion = whole.firm(fragment.most_samples)
    # A law with relaxation depends on the whole motion, not only on the firm samples.
    reference = whole.force_by(source.law) if source.answer is None else source.answer
    law = reference[whole.firm_places(fragment.most_samples)]
    predicted = fragment.predict_force(motion)
    ran = None
    fails = ""
    try:
        ran = fragment.replay(motion) if replay else None
    except ImportError as error:  # installed, but it does not load
        if _is_interrupt(error):
            raise KeyboardInterrupt from None
        fails = " ".join(str(error).split())
    mass = fragment.request.mass_or_one
    drop = drop_to(nearest.law, mass, whole.deepest)

    def engine_force(states: ProbeMotion) -> Floats:
        again = None if ran is None else fragment.replay(states)
        return fragment.predict_force(states) if again is None else again.force

    fast = whole.firm(min(fragment.most_samples, _FASTER_SAMPLES)).faster(_FASTER)
    fast_law = np.maximum(fast.force_by(nearest.law), 0.0)

    def off(force: Floats, reference: Floats | None) -> float | None:
        return None if reference is None else force_error(force, reference, motion.judged)

    # A simulation that is unstable at this time step is refused, so its drop need not be simulated.
    limit = fragment.largest_step
    stable = limit is None or fragment.request.time_step < limit
    return Compared(
        how="" if ran is None else ran.how,
        fails=fails,
        predicted_percent=force_error(predicted, law, motion.judged),
        replayed_percent=None if ran is None else force_error(ran.force, law, motion.judged),
        against_measured_percent=off(predicted if ran is None else ran.force, motion.force),
        law_leaves_percent=off(law, motion.force),
        drop=drop,
        predicted_restitution=fragment.predict_restitution(drop),
        replayed_restitution=fragment.drop_restitution(drop)
        if ran is not None and stable
        else None,
        rest=_rest(nearest.law, mass, whole.deepest, engine_force),
        faster_percent=force_error(engine_force(fast), fast_law, fast.judged),
    )


def _rest(
    law: GeneralisedHuntCrossley,
    mass: float,
    deepest: float,
    engine_force: Callable[[ProbeMotion], Floats],
) -> Rest:
    """Return the depths at which a body [kg] rests on the law and in the engine."""
    load = min(mass * GRAVITY, _REST_LOAD * float(law.force(deepest, 0.0)))
    depth = (load / law.K) ** (1.0 / law.n)
    x = depth * _REST_DEPTHS
    still = np.zeros_like(x)
    states = ProbeMotion(np.arange(float(x.size)), x, still, still, x > 0.0)
    force = engine_force(states)
    inside = np.isfinite(force).all() and force[0] <= load <= force[-1]
    return Rest(load, depth, float(np.interp(load, force, x)) if inside else math.nan)


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an ImportError: extensions raise one when interrupted on import."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return _is_interrupt(error.__cause__ or error.__context__)


# The refusals, warnings and content of a statement, in words and as plain numbers.

#: Largest force error, %, with which an export is not refused.
MOST_PERCENT = 5.0
#: Largest difference of the stiffness of a law without memory from K′ that is not refused.
STIFFNESS_OFF = 0.25
#: Largest error of restitution, %, without a warning; a small force error does not bound it.
REBOUND_PERCENT = 5.0
#: Largest error of restitution, %, that is not refused, if it is also larger than _REBOUND_SMALL.
REBOUND_REFUSED = 50.0
_REBOUND_SMALL = 0.02
# Largest restitution that is not refused. Time steps leave an undamped impact within 1 % of 1.
_MOST_REBOUND = 1.01
# A mark of *with care* means a standard error above this, %.
_CARE_PERCENT = 10.0
# Rounding changes an error by less than this, percentage points.
_AS_PREDICTED = 1.0
#: Below this, %, an error is numerical: single precision in an engine leaves 10⁻⁵.
EXACT = 1e-3


@frozen(eq=False)
class Statement:
    """The origin of an exported law, the engine's error with it, warnings and refusals.

    Attributes
    ----------
    source : ExportedLaw
        The law and its motion.
    nearest : Nearest
        The law K xⁿ + B xᵖ v exported in its place; the law itself if it has this form.
    engine : Engine
        The engine.
    fragment : Fragment
        The law in the engine's parameters.
    compared : Compared
        The errors.
    allowed : bool
        Whether the user allows the export despite refusals. Default: False.
    """

    source: ExportedLaw
    nearest: Nearest
    engine: Engine
    fragment: Fragment = field(repr=False)
    compared: Compared
    allowed: bool = False

    def __repr__(self) -> str:
        return "\n".join(self.describe())

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Refusals, of severity do-not-trust, and warnings."""
        return (
            *self._check_verdict(),
            *self._check_nearest_law(),
            *self._relaxation(),
            *self.fragment.findings,
            *self._check_errors(),
            *self._check_time_step(),
            *self._check_prediction(),
        )

    def _check_verdict(self) -> Iterator[Finding]:
        """Yield what the verdict and the flags of the identification say of the law."""
        verdict = self.source.verdict
        if verdict is None:
            yield from make_warnings("a law without a recording: palpate cannot judge its accuracy")
        elif verdict.overall == "do-not-trust":
            yield from make_refusals(f"the verdict is do-not-trust{_because(self.source)}")
        elif verdict.overall == "with-care":
            text = f"the verdict is with-care{_because(self.source)}"
            yield from make_warnings(text, effect=_CARE_PERCENT)
        elif verdict.damping != "trust":
            yield from make_warnings(
                f"the verdict on damping, and thus impacts, is {verdict.damping}"
            )
        yield from make_warnings(*(f"flag: {flag}" for flag in self.source.flags))

    def _check_nearest_law(self) -> Iterator[Finding]:
        """Yield how the exported law differs from the identified one."""
        law = self.source.law
        which = self.nearest.which
        difference = percent(self.nearest.error_percent)
        values = law.as_dict()
        # With two springs one may be negative.
        strengths = ("B",) if "K2" in values else ("K", "B")
        if not law.remembers and any(values.get(name, 0.0) < 0.0 for name in strengths):
            yield from make_refusals(
                "the law has a negative stiffness or damping, so it generates energy; the exported "
                f"law ({which}) differs by {difference} of force"
            )
        if which and law.remembers:
            yield from make_warnings(
                f"engines have no stress relaxation: exported is {which}; it differs by "
                f"{difference} of force on this motion and by more at other speeds, and "
                "restitution is that of the exported law",
                effect=self.nearest.error_percent,
            )
        elif which:
            yield from make_warnings(
                f"engines do not have this law: exported is {which}; it differs by {difference} of "
                "force",
                effect=self.nearest.error_percent,
            )

    def _check_errors(self) -> Iterator[Finding]:
        """Yield what the errors of force and restitution say against the engine."""
        compared = self.compared
        fastest = self.source.motion.fastest
        if not compared.percent <= MOST_PERCENT:  # also refuses NaN
            how = "replayed" if compared.replayed else "predicted"
            yield from make_refusals(
                f"the force error of the engine is {percent(compared.percent)} ({how}), more than "
                f"{MOST_PERCENT:g} %"
                f"{self._describe_shares()}"
            )
        yield from self._check_rebound()
        if compared.faster_percent > MOST_PERCENT:
            yield from make_warnings(
                f"at twice the recorded speed, {length(_FASTER * fastest, 2)}/s, the engine's "
                f"force is {percent(compared.faster_percent)} off the law",
                effect=compared.faster_percent,
            )
        if compared.drop.speed > fastest and self.source.verdict is not None:
            yield from make_warnings(
                f"the law was identified at speeds up to {length(fastest, 2)}/s; an impact at "
                f"{rounded(compared.drop.speed, 2)} m/s extrapolates it"
            )

    def _check_rebound(self) -> Iterator[Finding]:
        """Yield what the engine's restitution says against it."""
        compared = self.compared
        engine = compared.drop_restitution
        law = compared.drop.restitution
        off = abs(compared.restitution_percent)
        text = (
            f"the engine's restitution is {rounded(engine, 3)}, that of the law {rounded(law, 3)}"
        )
        wrong = off > REBOUND_REFUSED and abs(engine - law) > _REBOUND_SMALL
        if not self.stable:
            return
        if engine > _MOST_REBOUND:
            yield from make_refusals(f"impacts gain energy: {text}")
        elif wrong:
            yield from make_refusals(f"{text}, more than {REBOUND_REFUSED:g} % off")
        elif off > REBOUND_PERCENT:
            yield from make_warnings(f"impacts will be wrong: {text}", effect=off)

    def _check_time_step(self) -> Iterator[Finding]:
        """Yield what the time step says against the simulation."""
        limit = self.fragment.largest_step
        step = self.fragment.request.time_step
        if limit is None:
            return
        if not self.stable:
            yield from make_refusals(
                f"the simulation is unstable at a time step of {_ms(step)}; choose one below "
                f"{_ms(limit)}"
            )
        elif step > 0.5 * limit:
            yield from make_warnings(
                f"a time step of {_ms(step)} is more than half of the stability limit of "
                f"{_ms(limit)}"
            )

    def _check_prediction(self) -> Iterator[Finding]:
        """Yield whether a replay differs from the prediction."""
        compared = self.compared
        if compared.replayed and abs(compared.percent - compared.predicted_percent) > _AS_PREDICTED:
            yield from make_warnings(
                f"the replayed error is {percent(compared.percent)} but the predicted one "
                f"{percent(compared.predicted_percent)}: this version of the engine may be "
                "different"
            )

    @property
    def stable(self) -> bool:
        """Whether the time step is below the stability limit."""
        limit = self.fragment.largest_step
        return limit is None or self.fragment.request.time_step < limit

    @property
    def engine_fails(self) -> bool:
        """Whether the engine's form of contact, not the law or its verdict, is refused."""
        found = (*self.fragment.findings, *self._check_errors())
        return any(finding.severity == "do-not-trust" for finding in found)

    @property
    def main_warning(self) -> str:
        """The warning of the largest effect on this export, else the first; empty if none."""
        warned = [each for each in self.findings if each.severity != "do-not-trust"]
        effects = [each.moves_stiffness_percent for each in warned]
        return warned[int(np.argmax(effects))].message if warned else ""

    @property
    def refusals(self) -> tuple[str, ...]:
        """Reasons to refuse the export; empty if there are none."""
        return tuple(
            finding.message for finding in self.findings if finding.severity == "do-not-trust"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user."""
        return tuple(
            finding.message for finding in self.findings if finding.severity != "do-not-trust"
        )

    @property
    def refused(self) -> bool:
        """Whether the export is refused and not allowed by the user."""
        return bool(self.refusals) and not self.allowed

    @property
    def exact(self) -> bool:
        """Whether the engine reproduces the identified law exactly."""
        itself = not self.nearest.which and self.fragment.exact
        return itself and self.compared.percent <= EXACT

    @property
    def claim(self) -> str:
        """The claim in one line: exact, within a force error, or refused."""
        if self.refused:
            return f"refused: {'; '.join(self.refusals)}"
        measured = dict(self._measured())
        text = f"{measured['force']}, on {measured['motion']}; restitution {measured['rebound']}"
        if not self.refusals:
            return text
        return f"{text}; allowed by the user although {'; '.join(self.refusals)}"

    @property
    def _title(self) -> str:
        return " ".join(filter(None, (self.engine.title, self.engine.version())))

    def _measured(self) -> list[tuple[str, str]]:
        """Return what was measured in the engine, each with its label."""
        compared = self.compared
        motion = self.source.motion
        rest = compared.rest
        error = self._force()
        measured = compared.against_measured_percent
        if measured is not None and compared.law_leaves_percent is not None:
            error += f"; {percent(measured)} off the recording"
            error += f" (the law itself: {percent(compared.law_leaves_percent)})"
        depths = f"{length(motion.shallowest, 2)} to {length(motion.deepest, 3)}"
        if self.source.response is not None:  # the exported law is for this frequency
            depths = f"{format_hertz(self.source.response[1])}, {depths}"
        faster = f"at twice the speed {percent(compared.faster_percent)}"
        at_rest = length(rest.engine, 3) if math.isfinite(rest.engine) else "elsewhere"
        return [
            ("force", error),
            ("motion", f"{motion.source}, {depths}, up to {length(motion.fastest, 2)}/s; {faster}"),
            ("rest", f"{at_rest}; law {length(rest.law, 3)}, under {rounded(rest.load, 3)} N"),
            ("rebound", self._describe_restitution()),
        ]

    def short_answer(self) -> list[tuple[str, str]]:
        """Return the answer in lines, each with its label: what a user needs to go on."""
        refusals = self.refusals
        title = f"{self.source.name or 'a law'} in {self._title} ({self.fragment.form})"
        lines = [(title, "")]
        if refusals:
            lines.append(("allowed" if self.allowed else "refused", refusals[0]))
        if refusals[1:]:
            lines.append(("", f"and {len(refusals) - 1} more reasons: -v"))
        if self.refused:
            return [*lines, ("next", "add --allow to export despite that; -v prints all numbers")]
        more = {"paste": self.fragment.snippet, "warning": self.main_warning}
        return [*lines, *self._measured(), *((name, text) for name, text in more.items() if text)]

    def describe(self) -> list[str]:
        """Return the statement as lines: claim, replay, law, engine parameters, warnings."""
        rest = dict(self._measured())["rest"]
        form = f"{self.fragment.form}, {self.fragment.describe_friction()}"
        lines = [
            f"{self._title}, {form}: {self.claim}.",
            self.describe_replay(),
            f"Depth at rest: {rest}.",
            *self.law_lines(),
        ]
        if numbers := _list_numbers(self.fragment.numbers, 6):
            lines.append(f"Engine parameters: {numbers}.")
        if snippet := self.fragment.snippet:
            lines.append(f"To paste: {snippet}.")
        return [*lines, *(f"Warning: {warning}." for warning in self.warnings)]

    def describe_replay(self) -> str:
        """Return how the errors were obtained."""
        compared = self.compared
        title = self.engine.title
        if compared.replayed:
            predicted = f"predicted error {percent(compared.predicted_percent)}"
            return f"Replayed in {self._title}, {compared.how} ({predicted})."
        why = f"palpate cannot run {title}"
        if self.engine.distribution is not None:
            why = f"it does not load: {compared.fails}" if compared.fails else "not requested"
            if not self.engine.version():
                why = f"{title} is not installed: {MissingExtraError.remedy(self.engine.extra)}"
        return f"Not replayed ({why}): the errors of the engine are predicted."

    def _relaxation(self) -> tuple[Finding, ...]:
        """Say what stands in the place of a law that relaxes; refuse another stiffness."""
        if self.source.response is None:
            return ()
        depth, omega, stiffness, damping = self.source.response
        law = self.nearest.law
        given = law.stiffness_at(depth)
        text = (
            "the material relaxes, and engines do not: exported is the law nearest on this motion "
            f"of {format_hertz(omega)}: at {length(depth, 3)} {rounded(given, 3)} N/m and "
            f"{rounded(law.damping_at(depth), 3)} N·s/m, for K′ = {rounded(stiffness, 3)} N/m and "
            f"B′ = {rounded(damping, 3)} N·s/m; at other frequencies it is off by more"
        )
        apart = abs(given / stiffness - 1.0) if stiffness else math.inf
        if not apart <= STIFFNESS_OFF:
            return make_refusals(text)
        return make_warnings(text, effect=max(100.0 * apart, self.compared.percent))

    def law_lines(self) -> list[str]:
        """Return lines with the identified law, its standard errors, and the exported law."""
        law = self.source.law
        errors = self.source.standard_errors
        values = law.as_dict()
        known = [math.nan] * len(values) if errors is None else [float(each) for each in errors]
        shown = [
            f"{symbol} = {rounded(value, 6) if errors is None else parameter(value, error)} {unit}"
            for symbol, value, error, unit in zip(
                law.symbols,
                values.values(),
                known,
                law.units,
                strict=True,
            )
        ]
        origin = f"of {self.source.name}" if self.source.name else "without a recording"
        if isinstance(law, GeneralisedHuntCrossley) and law.remembers:
            shown.append(f"τ = {law.describe_relaxation()}")
        lines = [f"Law {origin}: {law.kind}, {', '.join(map(str.rstrip, shown))}."]
        if self.nearest.which:
            inside = _list_numbers(law_numbers(self.nearest.law), 4)
            lines.append(f"Exported: {self.nearest.which}: {inside}.")
        return lines

    def notes(self) -> list[str]:
        """Return the lines of the comment in a fragment."""
        return [f"palpate {__version__}", *self.describe()]

    def as_dict(self) -> dict[str, Any]:
        """Return the statement as plain numbers and text, SI; None for undefined numbers."""
        source = self.source
        compared = self.compared
        request = self.fragment.request
        errors = source.standard_errors
        drop = compared.drop
        return {
            "palpate_version": __version__,
            "engine": self.engine.name,
            "engine_version": self.engine.version(),
            "form": self.fragment.form,
            "claim": self.claim,
            "exact": self.exact,
            "refused": self.refused,
            "refusals": list(self.refusals),
            "allowed": bool(self.refusals) and self.allowed,
            "warnings": list(self.warnings),
            "main_warning": self.main_warning or None,
            "next_step": self.fragment.paste,
            "replayed": compared.replayed,
            "how": compared.how or None,
            "error_percent": {
                "against_law": finite_or_none(compared.percent),
                "predicted": finite_or_none(compared.predicted_percent),
                "against_measured": finite_or_none(compared.against_measured_percent),
                "law_leaves": finite_or_none(compared.law_leaves_percent),
                "nearest": finite_or_none(self.nearest.error_percent),
                "at_twice_the_speed": finite_or_none(compared.faster_percent),
            },
            "rest": {
                "load": finite_or_none(compared.rest.load),
                "depth_of_law": finite_or_none(compared.rest.law),
                "depth": finite_or_none(compared.rest.engine),
            },
            "depths": [source.motion.shallowest, source.motion.deepest],
            "fastest": source.motion.fastest,
            "frequency": finite_or_none(source.motion.frequency),
            "drop": {
                "mass": drop.mass,
                "speed": finite_or_none(drop.speed),
                "depth": drop.depth,
                "restitution_of_law": finite_or_none(drop.restitution),
                "restitution": finite_or_none(compared.drop_restitution),
                "error_percent": finite_or_none(compared.restitution_percent),
                "replayed": compared.replayed_restitution is not None,
            },
            "law": source.law.description(),
            "standard_errors": (
                None
                if errors is None
                else dict(
                    zip(source.law.names(), map(finite_or_none, errors.tolist()), strict=True)
                )
            ),
            "exported_law": {
                "which": self.nearest.which or None,
                **self.nearest.law.simplest().description(),
            },
            "numbers": {
                name: finite_or_none(value) for name, value in self.fragment.numbers.items()
            },
            "mass": request.mass,
            "time_step": request.time_step,
            "friction": request.friction,
            "largest_time_step": finite_or_none(self.fragment.largest_step),
            "source": source.name or None,
            "motion": source.motion.source,
            "verdict": None if source.verdict is None else source.verdict.as_dict(),
        }

    def _force(self) -> str:
        if self.exact and self.compared.replayed:
            return "exact (replayed)"
        if self.exact:
            return "exact according to the engine's documentation (not replayed)"
        how = "replayed" if self.compared.replayed else "predicted, not replayed"
        force = "the law's force"
        if self.source.answer is not None:
            force = f"the force of {self._reference}"
        return f"within {percent(self.compared.percent)} of {force} ({how})"

    @property
    def _reference(self) -> str:
        """Name of the force that the engine's force is compared with."""
        return "the law" if self.source.answer is None else "the identified law with its memory"

    def _describe_shares(self) -> str:
        """Describe what a law without memory leaves of the recording, and what to do."""
        compared = self.compared
        leaves = compared.against_measured_percent
        law_leaves_percent = compared.law_leaves_percent
        if self.source.answer is None or leaves is None or law_leaves_percent is None:
            return ""
        return (
            ": the material relaxes, and no engine has its memory. The engine leaves "
            f"{percent(leaves)} of the recorded force, {self._reference} "
            f"{percent(law_leaves_percent)}. Simulate it by palpate lab or "
            "GeneralisedHuntCrossley.step, which have the memory"
        )

    def _describe_restitution(self) -> str:
        compared = self.compared
        drop = compared.drop
        if not math.isfinite(compared.restitution_percent):
            return "none: a free body does not rebound with this law"
        how = "" if compared.replayed_restitution is not None else ", predicted"
        assumed = "" if self.fragment.request.mass is not None else " (assumed)"
        return (
            f"{rounded(compared.drop_restitution, 3)}, law {rounded(drop.restitution, 3)}{how}, "
            f"for an impact of {rounded(drop.mass, 3)} kg{assumed} at {rounded(drop.speed, 2)} m/s"
        )


def _list_numbers(numbers: Mapping[str, float], figures: int) -> str:
    return ", ".join(f"{name} = {rounded(value, figures)}" for name, value in numbers.items())


def _response(
    result: "Identification | SavedResult",
    judged: "Diagnosis | SavedResult",
) -> tuple[float, float, float, float] | None:
    there = judged.working_depths[0]
    omega = getattr(result, "frequency", math.nan)
    if not (result.law.remembers and omega > 0.0 and there.depth > 0.0):
        return None
    whole = complex(result.law.dynamic_stiffness(there.depth, omega))
    return there.depth, omega, whole.real, whole.imag / omega


def _replace_relaxing_law(
    result: "Identification | SavedResult",
    recorded: ProbeMotion,
) -> tuple[ForceLaw, ProbeMotion, Floats]:
    """Return the nearest law without memory, its motion, and the identified law's force there, N.

    It is nearest to the identified law, not to the measured force. A recording without free air
    does not determine surface and offset, so those of the law without memory are tried too.
    """
    exponent = result.law.n if "n" in result.fixed else None
    plain = identify(result.contact, VariableProjection(exponent=exponent), trace=False)
    tried = []
    for motion in (ProbeMotion.recorded(plain), recorded):
        answer = _force_of_answer(motion, result)
        law = nearest_to_force(answer, motion, exponent)
        error = force_error(motion.force_by(law), answer, motion.judged)
        tried.append((law.K <= 0.0, error, law.simplest(), motion, answer))
    return min(tried, key=lambda each: each[:2])[2:]


def _force_of_answer(motion: ProbeMotion, result: "Identification | SavedResult") -> Floats:
    """Return the force that a result fits to the measured force of a motion, N."""
    contact = result.contact
    order = np.argsort(contact.time, kind="stable")  # joined recordings may begin at one time
    same = order[np.searchsorted(contact.time, motion.time, sorter=order)]
    assert motion.force is not None
    fitted: Floats = motion.force - (contact.force - result.fitted_force)[same]
    return fitted


def _because(source: ExportedLaw) -> str:
    return f": {source.reason}" if source.reason else ""


def _ms(seconds: float) -> str:
    return f"{rounded(1e3 * seconds, 2)} ms" if math.isfinite(seconds) else "any"
