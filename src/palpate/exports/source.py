"""Where an exported law comes from: what was identified, or a law alone."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, Union, cast

from palpate.diagnosis import MARKS, Finding, Verdict
from palpate.errors import ExportRefusedError, InvalidParameterError, RecordingError
from palpate.exports.motion import Motion
from palpate.exports.nearest import Nearest, one_power, with_exponents, without_memory
from palpate.force_laws import ExtendedKelvinVoigt, ForceLaw, GeneralisedHuntCrossley
from palpate.tips import Sphere
from palpate.validation import Floats, shown

if TYPE_CHECKING:
    from palpate.identifying import Identification
    from palpate.results.loading import SavedResult

#: What can be exported.
Exportable: TypeAlias = Union["Identification", "SavedResult", ForceLaw]


@dataclass(frozen=True, slots=True, eq=False)
class Source:
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
    motion: Motion = field(repr=False)
    name: str = ""
    standard_errors: Floats | None = None
    verdict: Verdict | None = None
    findings: tuple[Finding, ...] = ()
    flags: tuple[str, ...] = ()
    tip_radius: float | None = None

    @classmethod
    def of(cls, result: Exportable) -> "Source":
        """Return what an identification, a saved one, or a law alone is.

        Raises
        ------
        InvalidParameterError
            It is none of them.
        RecordingError
            A saved one is damaged.
        """
        if isinstance(result, ForceLaw):
            return cls(result, Motion.of_paper())
        known = ("law", "contact", "trace", "standard_errors")
        if not all(hasattr(result, name) for name in known):
            raise InvalidParameterError(
                "result must be an Identification, a SavedResult or a force law, not "
                f"{shown(result)}"
            )
        if not hasattr(result, "description"):
            return cls._identified(result, cast(Any, result).diagnosis)
        try:
            return cls._identified(result, result)
        except (RecordingError, InvalidParameterError):
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            reason = f"{type(error).__name__}: {error}"
            folder = cast("SavedResult", result).folder
            raise RecordingError(
                f"{folder}: the result is damaged ({reason}); identify again"
            ) from None

    @classmethod
    def _identified(cls, result: "Identification | SavedResult", judged: Any) -> "Source":
        return cls(
            law=result.law,
            motion=Motion.recorded(result),
            name=Path(result.contact.source).name or "a contact",
            standard_errors=result.standard_errors,
            verdict=judged.verdict,
            findings=tuple(judged.findings),
            flags=_flags(result),
            tip_radius=_tip_radius(result),
        )

    @property
    def reason(self) -> str:
        """Why the verdict is what it is: the gravest finding, and its remedy."""
        graver = [each for each in self.findings if each.severity != MARKS[0]]
        if not graver or self.verdict is None or self.verdict.overall == MARKS[0]:
            return ""
        first = graver[0]
        return first.sentence + (f" ({first.remedy})" if first.remedy else "")

    def nearest(self) -> Nearest:
        """Return K xⁿ + B xᵖ v in its place, for engines: none of them remembers.

        Raises
        ------
        ExportRefusedError
            There is none with K > 0: nothing would push back.
        """
        if isinstance(self.law, ExtendedKelvinVoigt) and all(self.law.parameters[:2] != 0.0):
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


def _flags(result: Any) -> tuple[str, ...]:
    if hasattr(result, "description"):
        [found] = result.description["results"]
        return tuple(map(str, found.get("flags", ())))
    return tuple(result.flags)


def _tip_radius(result: Any) -> float | None:
    """Of a round tip that was named with the identification."""
    if hasattr(result, "description"):
        [found] = result.description["results"]
        tip = (found.get("elastic_modulus") or {}).get("tip") or {}
        return float(tip["radius"]) if tip.get("kind") == Sphere.kind else None
    tip = result.wanted.tip
    return tip.radius if isinstance(tip, Sphere) else None
