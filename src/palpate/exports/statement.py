"""What an export states: where its law comes from, how far the engine is from it, and in words.

An :class:`ExportedLaw` is what was identified, or a law alone; :func:`compared` replays the engine
beside it, or predicts it; a :class:`Statement` judges that, and says it in words and numbers.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from palpate._core import __version__
from palpate.diagnosis import Diagnosis, Verdict
from palpate.digits import parameter, rounded
from palpate.errors import ExportRefusedError, InvalidParameterError, RecordingError
from palpate.exports.engine import (
    Drop,
    Engine,
    Fragment,
    Nearest,
    ProbeMotion,
    drop_to,
    force_error,
    length,
    numbers_of,
    one_power,
    percent,
    refused,
    warned,
    with_exponents,
    without_memory,
)
from palpate.findings import Finding
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.identifying import Identification
from palpate.quantities.elastic_modulus import Sphere
from palpate.results.saved import SavedResult
from palpate.validation import Floats, defined, shown

#: What can be exported.
Exportable: TypeAlias = Identification | SavedResult | ForceLaw


@dataclass(frozen=True, slots=True, eq=False)
class ExportedLaw:
    """A law, the motion that it has to be right on, and how far it is to be trusted.

    Attributes
    ----------
    law : ForceLaw
        As identified.
    motion : Motion
        The recorded one; the paper's of a law alone.
    name : str
        Of the recording; empty of a law alone.
    standard_errors : numpy.ndarray, shape (p,), optional
        Of the law's parameters.
    verdict : Verdict, optional
        None of a law alone: nothing is known of it.
    findings : tuple of Finding
        The gravest first.
    flags : tuple of str
        Of the identification.
    tip_radius : float, optional
        Of the tip that pressed, m, where it is known and round.
    """

    law: ForceLaw
    motion: ProbeMotion = field(repr=False)
    name: str = ""
    standard_errors: Floats | None = None
    verdict: Verdict | None = None
    findings: tuple[Finding, ...] = ()
    flags: tuple[str, ...] = ()
    tip_radius: float | None = None

    @classmethod
    def of(cls, result: Exportable) -> "ExportedLaw":
        """Return what an identification, a saved one, or a law alone is.

        Raises
        ------
        InvalidParameterError
            It is none of them.
        RecordingError
            A saved one is damaged.
        """
        if isinstance(result, ForceLaw):
            return cls(result, ProbeMotion.of_paper())
        if not isinstance(result, Identification | SavedResult):
            raise InvalidParameterError(
                "result must be an Identification, a SavedResult or a force law, not "
                f"{shown(result)}"
            )
        judged: Diagnosis | SavedResult
        try:
            if isinstance(result, Identification):
                judged, flags, tip = result.diagnosis, result.flags, result.query.tip
                radius = tip.radius if isinstance(tip, Sphere) else None
            else:
                judged, [found] = result, result.description["results"]
                saved = (found.get("elastic_modulus") or {}).get("tip") or {}
                radius = float(saved["radius"]) if saved.get("kind") == Sphere.kind else None
                flags = found.get("flags", ())
            return cls(
                law=result.law,
                motion=ProbeMotion.recorded(result),
                name=Path(result.contact.source).name or "a contact",
                standard_errors=result.standard_errors,
                verdict=judged.verdict,
                findings=tuple(judged.findings),
                flags=tuple(map(str, flags)),
                tip_radius=radius,
            )
        except (RecordingError, InvalidParameterError):
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            if isinstance(result, Identification):
                raise
            reason = f"{type(error).__name__}: {error}"
            raise RecordingError(
                f"{result.folder}: the result is damaged ({reason}); identify again"
            ) from None

    @property
    def reason(self) -> str:
        """Why the verdict is what it is: the gravest finding, and its remedy."""
        if self.verdict is None or self.verdict.overall == "trust":
            return ""
        return next((str(each) for each in self.findings if each.severity != "note"), "")

    def nearest(self) -> Nearest:
        """Return K xⁿ + B xᵖ v in its place, for engines: none of them remembers.

        Raises
        ------
        ExportRefusedError
            There is none with K > 0: nothing would push back.
        """
        if self.law.powers is None:
            found = one_power(self.law, self.motion)
        else:
            law = GeneralisedHuntCrossley.of(self.law)
            found = without_memory(law, self.motion)
            if found.law.damping < 0.0:
                undamped = with_exponents(law, self.motion, law.exponent, law.damping_exponent)
                found = Nearest.of(undamped, self.law, self.motion, "without its negative damping")
        if not found.law.stiffness > 0.0:
            raise ExportRefusedError(
                f"the law has a stiffness of {found.law.stiffness:.3g}, with which nothing pushes "
                "back: no engine is given that; palpate diagnose FILE says what is wrong"
            )
        return found


# An engine's force and rebound beside the law's and the measured ones.


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
    predicted_restitution: float
    replayed_restitution: float | None

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
    def drop_restitution(self) -> float:
        """Restitution by the engine in the drop: replayed, or else predicted."""
        return (
            self.predicted_restitution
            if self.replayed_restitution is None
            else self.replayed_restitution
        )

    @property
    def restitution_percent(self) -> float:
        """Error of that restitution, of the law's; NaN of a law by which nothing rebounds."""
        law = self.drop.restitution
        return 100.0 * (self.drop_restitution / law - 1.0) if law > 0.0 else float("nan")


def compared(
    source: ExportedLaw, nearest: Nearest, fragment: Fragment, *, replay: bool
) -> Compared:
    """Return the errors of a fragment along the source's motion.

    Parameters
    ----------
    source : ExportedLaw
        The law as identified: what the engine is compared with.
    nearest : Nearest
        What the fragment was made of.
    fragment : Fragment
        The law in the engine.
    replay : bool
        Whether the real engine is asked, where it is there.
    """
    whole = source.motion
    motion = whole.firm(fragment.most_samples)
    # What the law remembers is that of the whole motion.
    law = whole.force_by(source.law)[whole.firm_places(fragment.most_samples)]
    predicted = fragment.predicted(motion)
    ran, fails = None, ""
    try:
        ran = fragment.replay(motion) if replay else None
    except ImportError as error:  # installed, and yet it does not load
        if _interrupted(error):
            raise KeyboardInterrupt from None
        fails = " ".join(str(error).split())
    drop = drop_to(nearest.law, fragment.request.mass_or_one, whole.deepest)

    def off(force: Floats, reference: Floats | None) -> float | None:
        return None if reference is None else force_error(force, reference, motion.judged)

    # A simulation that runs away at the time step asked for is refused, and not dropped.
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
        predicted_restitution=fragment.predicted_restitution(drop),
        replayed_restitution=fragment.drop_restitution(drop)
        if ran is not None and stable
        else None,
    )


def _interrupted(error: BaseException | None) -> bool:
    """Whether somebody ended it: an extension says of that too that it cannot be imported."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return error is not None
    return _interrupted(error.__cause__ or error.__context__)


# When an export is refused, what it warns of, and what it carries, in words and as plain numbers.

#: Beyond it, %, an engine has another contact than the one that was identified.
MOST_PERCENT = 5.0
#: Beyond it, %, a rebound is another too, which a force that is right does not show.
REBOUND_PERCENT = 5.0
# The same number in another arithmetic differs by less, percentage points.
_AS_PREDICTED = 1.0
#: Below it, %, an error is the arithmetic's: single precision in an engine leaves 10⁻⁵.
EXACT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Statement:
    """How far an engine with these numbers is from the law, and how that is known.

    Attributes
    ----------
    source : ExportedLaw
        The law and its motion.
    nearest : Nearest
        What stands for the law where no engine has it.
    engine : Engine
        Which one.
    fragment : Fragment
        The law in its numbers.
    compared : Compared
        The errors.
    allowed : bool
        Whether it was asked for in spite of refusals.
    """

    source: ExportedLaw
    nearest: Nearest
    engine: Engine
    fragment: Fragment = field(repr=False)
    compared: Compared
    allowed: bool = False

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Why it should not be used, as *do not trust*; and what a user should know."""
        source, nearest, found = self.source, self.nearest, self.compared
        verdict, result = source.verdict, list[Finding]()
        if verdict is None:
            result += warned("a law alone: no recording says how far it is to be trusted")
        elif verdict.overall == "do-not-trust":
            result += refused(f"the diagnosis says do not trust{_because(source)}")
        elif verdict.overall == "with-care":
            result += warned(f"the diagnosis says with care{_because(source)}")
        elif verdict.damping != "trust":
            result += warned(f"the damping alone is {verdict.damping}: so are impacts")
        result += warned(*(f"flagged: {flag}" for flag in source.flags))
        values = source.law.as_dict()
        # Of two springs one may pull.
        strengths = ("damping",) if "quadratic_stiffness" in values else ("stiffness", "damping")
        if not source.law.remembers and any(values.get(each, 0.0) < 0.0 for each in strengths):
            result += refused(
                "the law has a negative stiffness or damping, and makes energy: "
                f"{nearest.which} it is another, by {percent(nearest.error_percent)} of force"
            )
        if nearest.which and source.law.remembers:
            result += warned(
                f"the law remembers, which no engine does: this is {nearest.which}, "
                f"{percent(nearest.error_percent)} of force from it on this motion, and more at "
                "other speeds; restitution is that of this one"
            )
        elif nearest.which:
            result += warned(
                f"the law is none that engines have: this is {nearest.which}, "
                f"{percent(nearest.error_percent)} of force from it"
            )
        result += self.fragment.findings
        if not found.percent <= MOST_PERCENT:  # which NaN is not either
            result += refused(
                f"the force of the engine is off by {percent(found.percent)}, more than "
                f"{MOST_PERCENT:g} %, {'replayed' if found.replayed else 'as predicted'}"
            )
        if abs(found.restitution_percent) > REBOUND_PERCENT:
            result += warned(
                "impacts will be wrong: a restitution of "
                f"{rounded(found.drop_restitution, 3)}, where the law has "
                f"{rounded(found.drop.restitution, 3)}"
            )
        if found.drop.speed > source.motion.fastest and verdict is not None:
            result += warned(
                f"the law was identified at speeds to {length(source.motion.fastest, 2)}/s: an "
                f"impact at {rounded(found.drop.speed, 2)} m/s is beyond the recording"
            )
        limit, step = self.fragment.largest_step, self.fragment.request.time_step
        if limit is not None and step >= limit:
            result += refused(
                f"the simulation is unstable at a time step of {_ms(step)}: it has to be below "
                f"{_ms(limit)}"
            )
        elif limit is not None and step > 0.5 * limit:
            result += warned(
                f"a time step of {_ms(step)} is above half of the {_ms(limit)} from which on the "
                "simulation is unstable"
            )
        if found.replayed and abs(found.percent - found.predicted_percent) > _AS_PREDICTED:
            result += warned(
                f"the engine was off by {percent(found.percent)}, and predicted was "
                f"{percent(found.predicted_percent)}: its version may differ from those known"
            )
        return tuple(result)

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why it should not be used; nothing where it may be."""
        return tuple(each.message for each in self.findings if each.severity == "do-not-trust")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know."""
        return tuple(each.message for each in self.findings if each.severity != "do-not-trust")

    @property
    def refused(self) -> bool:
        """Whether nothing is exported."""
        return bool(self.refusals) and not self.allowed

    @property
    def exact(self) -> bool:
        """Whether the engine has the identified law itself."""
        itself = not self.nearest.which and self.fragment.exact
        return itself and self.compared.percent <= EXACT

    @property
    def claim(self) -> str:
        """The statement itself: exact, within so much of force, or refused."""
        if self.refused:
            return f"refused, because {'; and because '.join(self.refusals)}"
        motion = self.source.motion
        depths = f"{length(motion.shallowest, 2)} to {length(motion.deepest, 3)}"
        where = f"depths {depths} at speeds to {length(motion.fastest, 2)}/s"
        said = f"{self._force()} on {motion.source}, {where}; {self._describe_restitution()}"
        if not self.refusals:
            return said
        return f"{said}; allowed although {'; and although '.join(self.refusals)}"

    def describe(self) -> list[str]:
        """Return the statement as lines: claim, origin, the three numbers, numbers, warnings."""
        title = " ".join(filter(None, (self.engine.title, self.engine.version())))
        lines = [f"{title}, {self.fragment.form}: {self.claim}.", *self.basis(), *self.law_lines()]
        if numbers := _listed(self.fragment.numbers, 6):
            lines.append(f"In the engine's numbers: {numbers}.")
        return [*lines, *(f"Warning: {each}." for each in self.warnings)]

    def basis(self) -> list[str]:
        """Return how the errors are known, and the three of them."""
        found, title = self.compared, self.engine.title
        measured, leaves = found.against_measured_percent, found.law_leaves_percent
        if found.replayed:
            how = f"Replayed in {title} {self.engine.version() or ''}, {found.how}".rstrip()
            how += f"; {percent(found.predicted_percent)} was predicted."
        else:
            why = f"{title} is not run here"
            if self.engine.distribution is not None:
                why = f"it does not load: {found.fails}" if found.fails else "not asked for"
                if not self.engine.version():
                    why = f"{title} is not installed: pip install 'palpate[{self.engine.extra}]'"
            how = f"Not replayed here ({why}): every error of the engine is a predicted one."
        three = f"Error of force against the law {percent(found.percent)}"
        if measured is not None and leaves is not None:
            three += f", against the measured force {percent(measured)}"
            three += f"; the law itself leaves {percent(leaves)}"
        return [how, three + "."]

    def law_lines(self) -> list[str]:
        """Return the law that was exported, with the error bars of the identified one."""
        law, errors = self.source.law, self.source.standard_errors
        values = law.as_dict()
        known = [math.nan] * len(values) if errors is None else [float(each) for each in errors]
        shown = [
            f"{symbol} = {rounded(value, 6) if errors is None else parameter(value, error)} {unit}"
            for symbol, value, error, unit in zip(
                law.symbols, values.values(), known, law.units, strict=True
            )
        ]
        origin = f"of {self.source.name}" if self.source.name else "given"
        lines = [f"Law {origin}: {law.kind}, {', '.join(map(str.rstrip, shown))}."]
        if self.nearest.which:
            inside = _listed(numbers_of(self.nearest.law), 4)
            lines.append(f"Exported: {self.nearest.which}: {inside}.")
        return lines

    def notes(self) -> list[str]:
        """Return the lines that a fragment carries as a comment."""
        return [f"palpate {__version__}", *self.describe()]

    def as_dict(self) -> dict[str, Any]:
        """Return the statement as plain numbers and words, SI; what is not defined is None."""
        source, found, request = self.source, self.compared, self.fragment.request
        errors, drop = source.standard_errors, found.drop
        law, exported = source.law.as_dict(), self.nearest.law.simplest()
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
            "replayed": found.replayed,
            "how": found.how or None,
            "error_percent": {
                "against_law": defined(found.percent),
                "predicted": defined(found.predicted_percent),
                "against_measured": defined(found.against_measured_percent),
                "law_leaves": defined(found.law_leaves_percent),
                "nearest": defined(self.nearest.error_percent),
            },
            "depths": [source.motion.shallowest, source.motion.deepest],
            "fastest": source.motion.fastest,
            "drop": {
                "mass": drop.mass,
                "speed": defined(drop.speed),
                "depth": drop.depth,
                "restitution_of_law": defined(drop.restitution),
                "restitution": defined(found.drop_restitution),
                "error_percent": defined(found.restitution_percent),
                "replayed": found.replayed_restitution is not None,
            },
            "law": {"kind": source.law.kind, **law},
            "standard_errors": (
                None
                if errors is None
                else {name: defined(float(e)) for name, e in zip(law, errors, strict=True)}
            ),
            "exported_law": {
                "which": self.nearest.which or None,
                "kind": exported.kind,
                **exported.as_dict(),
            },
            "numbers": {name: defined(value) for name, value in self.fragment.numbers.items()},
            "mass": request.mass,
            "time_step": request.time_step,
            "largest_time_step": defined(self.fragment.largest_step),
            "source": source.name or None,
            "motion": source.motion.source,
            "verdict": None if source.verdict is None else source.verdict.as_dict(),
        }

    def _force(self) -> str:
        if self.exact and self.compared.replayed:
            return "exact: the engine has this law"
        if self.exact:
            return "exact, as the engine is documented (not replayed here)"
        how = "replayed" if self.compared.replayed else "predicted, not replayed here"
        return f"within {percent(self.compared.percent)} of the law's force ({how})"

    def _describe_restitution(self) -> str:
        found = self.compared
        how = "" if found.replayed_restitution is not None else ", predicted"
        drop, mass = found.drop, rounded(found.drop.mass, 3)
        if not math.isfinite(found.restitution_percent):
            return "no restitution: by the law a free body does not rebound"
        assumed = "" if self.fragment.request.mass is not None else " (assumed)"
        numbers = f"{rounded(found.drop_restitution, 3)} for {rounded(drop.restitution, 3)}"
        return (
            f"restitution within {percent(abs(found.restitution_percent))} "
            f"({numbers}{how}) where {mass} kg{assumed} meets it at "
            f"{rounded(drop.speed, 2)} m/s, to {length(drop.depth, 3)}"
        )


def _listed(numbers: Mapping[str, float], figures: int) -> str:
    return ", ".join(f"{name} = {rounded(value, figures)}" for name, value in numbers.items())


def _because(source: ExportedLaw) -> str:
    return f": {source.reason}" if source.reason else ""


def _ms(seconds: float) -> str:
    return f"{rounded(1e3 * seconds, 2)} ms" if math.isfinite(seconds) else "any"
