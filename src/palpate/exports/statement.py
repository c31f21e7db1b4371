"""What an export carries, in words and as plain numbers."""

import math
from dataclasses import dataclass, field
from typing import Any

from palpate.digits import parameter, rounded
from palpate.exports.comparing import Compared
from palpate.exports.engine import Engine, Fragment
from palpate.exports.nearest import Nearest
from palpate.exports.source import Source
from palpate.exports.text import length, percent
from palpate.validation import defined

#: Below it, %, an error is the arithmetic's: single precision in an engine leaves 10⁻⁵.
EXACT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Statement:
    """How far an engine with these numbers is from the law, and how that is known.

    Attributes
    ----------
    source : Source
        The law and its motion.
    nearest : Nearest
        What stands for the law where no engine has it.
    engine : Engine
        Which one.
    fragment : Fragment
        The law in its numbers.
    compared : Compared
        The errors.
    refusals, warnings : tuple of str
        Why it should not be used, and what a user should know.
    allowed : bool
        Whether it was asked for in spite of refusals.
    """

    source: Source
    nearest: Nearest
    engine: Engine
    fragment: Fragment = field(repr=False)
    compared: Compared
    refusals: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    allowed: bool = False

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
        said = f"{self._force()} {self._where()}; {self._rebound()}"
        if not self.refusals:
            return said
        return f"{said}; allowed although {'; and although '.join(self.refusals)}"

    def words(self) -> list[str]:
        """Return the statement as lines: claim, origin, the three numbers, numbers, warnings."""
        lines = [f"{self._title()}: {self.claim}.", *self.basis(), *self.law_lines()]
        numbers = ", ".join(
            f"{name} = {rounded(v, 6)}" for name, v in self.fragment.numbers.items()
        )
        lines += [f"In the engine's numbers: {numbers}."] if numbers else []
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
            f"{symbol} = {_parameter(value, error, unit, bare=errors is None)}"
            for symbol, value, error, unit in zip(
                law.symbols, values.values(), known, law.units, strict=True
            )
        ]
        origin = f"of {self.source.name}" if self.source.name else "given"
        lines = [f"Law {origin}: {law.kind}, {', '.join(shown)}."]
        if self.nearest.which:
            inside = ", ".join(f"{k} = {rounded(v, 4)}" for k, v in self._own().items())
            lines.append(f"Exported: {self.nearest.which}: {inside}.")
        return lines

    def notes(self) -> list[str]:
        """Return the lines that a fragment carries as a comment."""
        from palpate._core import __version__

        return [f"palpate {__version__}", *self.words()]

    def as_dict(self) -> dict[str, Any]:
        """Return the statement as plain numbers and words, SI; what is not defined is None."""
        from palpate._core import __version__

        source, found, asked = self.source, self.compared, self.fragment.asked
        errors = source.standard_errors
        law = source.law.as_dict()
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
            "error_percent": self._errors(),
            "depths": [source.motion.shallowest, source.motion.deepest],
            "fastest": source.motion.fastest,
            "drop": self._drop(),
            "law": {"kind": source.law.kind, **law},
            "standard_errors": (
                None
                if errors is None
                else {name: defined(float(e)) for name, e in zip(law, errors, strict=True)}
            ),
            "exported_law": self._exported(),
            "numbers": {name: defined(value) for name, value in self.fragment.numbers.items()},
            "mass": asked.mass,
            "time_step": asked.time_step,
            "largest_time_step": defined(self.fragment.largest_step),
            "source": source.name or None,
            "motion": source.motion.source,
            "verdict": None if source.verdict is None else source.verdict.as_dict(),
        }

    def _exported(self) -> dict[str, Any]:
        law = self.nearest.law.simplest()
        return {"which": self.nearest.which or None, "kind": law.kind, **law.as_dict()}

    def _errors(self) -> dict[str, float | None]:
        found = self.compared
        return {
            "against_law": defined(found.percent),
            "predicted": defined(found.predicted_percent),
            "against_measured": defined(found.against_measured_percent),
            "law_leaves": defined(found.law_leaves_percent),
            "nearest": defined(self.nearest.error_percent),
        }

    def _drop(self) -> dict[str, Any]:
        found, drop = self.compared, self.compared.drop
        return {
            "mass": drop.mass,
            "speed": defined(drop.speed),
            "depth": drop.depth,
            "restitution_of_law": defined(drop.restitution),
            "restitution": defined(found.rebound),
            "error_percent": defined(found.rebound_percent),
            "replayed": found.replayed_rebound is not None,
        }

    def _own(self) -> dict[str, float]:
        law = self.nearest.law
        return {name: float(getattr(law, name)) for name in _OWN}

    def _title(self) -> str:
        version = self.engine.version()
        named = f"{self.engine.title} {version}" if version else self.engine.title
        return f"{named}, {self.fragment.form}"

    def _force(self) -> str:
        if self.exact and self.compared.replayed:
            return "exact: the engine has this law"
        if self.exact:
            return "exact, as the engine is documented (not replayed here)"
        how = "replayed" if self.compared.replayed else "predicted, not replayed here"
        return f"within {percent(self.compared.percent)} of the law's force ({how})"

    def _where(self) -> str:
        motion = self.source.motion
        depths = f"{length(motion.shallowest, 2)} to {length(motion.deepest, 3)}"
        return f"on {motion.source}, depths {depths} at speeds to {length(motion.fastest, 2)}/s"

    def _rebound(self) -> str:
        found = self.compared
        how = "" if found.replayed_rebound is not None else ", predicted"
        drop, mass = found.drop, rounded(found.drop.mass, 3)
        if not math.isfinite(found.rebound_percent):
            return "no restitution: by the law a free body does not rebound"
        assumed = "" if self.fragment.asked.mass is not None else " (assumed)"
        numbers = f"{rounded(found.rebound, 3)} for {rounded(drop.restitution, 3)}"
        return (
            f"restitution within {percent(abs(found.rebound_percent))} "
            f"({numbers}{how}) where {mass} kg{assumed} meets it at "
            f"{rounded(drop.speed, 2)} m/s, to {length(drop.depth, 3)}"
        )


_OWN = ("stiffness", "exponent", "damping", "damping_exponent")


def _parameter(value: float, error: float, unit: str, *, bare: bool) -> str:
    words = rounded(value, 6) if bare else parameter(value, error)
    return f"{words} {unit}".rstrip()
