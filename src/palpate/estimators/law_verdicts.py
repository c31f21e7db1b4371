"""Which law it is, and the numbers that laws have in common: what a verdict says."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from palpate import _core
from palpate.digits import rounded
from palpate.validation import defined, or_nan

# By the values of the compiled enumerations.
DAMPINGS = ("none", "hunt-crossley", "half-space")
MEMORIES = ("none", "flat", "single", "power-law")


@dataclass(frozen=True, slots=True)
class Candidate:
    """A law that may be offered.

    Attributes
    ----------
    damping : "none", "hunt-crossley" or "half-space"
        Whether there is a damper, and its exponent: p = n, or p = n − 1.
    memory : "none", "flat", "single" or "power-law"
        How the material relaxes.
    linear : bool
        Whether n is 1: with p = n − 1 the Kelvin–Voigt law.
    """

    damping: str
    memory: str
    linear: bool = False

    def __str__(self) -> str:
        law = {
            "none": "spring",
            "hunt-crossley": "Hunt–Crossley",
            "half-space": "Kelvin–Voigt" if self.linear else "half-space",
        }[self.damping]
        memories = {
            "none": "",
            "flat": " with a flat spectrum",
            "single": " with one relaxation time",
            "power-law": " with power-law relaxation",
        }
        return law + memories[self.memory]

    @property
    def own(self) -> tuple[str, ...]:
        """Names of its own numbers: the law's others follow from these, or are none."""
        has = {
            "stiffness": True,
            "exponent": not self.linear,
            "damping": self.damping != "none",
            "relaxation_stiffness": self.memory != "none",
            "spectrum_exponent": self.memory == "power-law",
            "longest_time": self.memory == "single",
        }
        return tuple(name for name, own in has.items() if own)

    @property
    def parameters(self) -> int:
        """Numbers that are looked for, the offset among them."""
        found = 2 + (not self.linear) + (self.damping != "none")
        return found + {"none": 0, "flat": 1, "single": 2, "power-law": 2}[self.memory]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain words."""
        return {"damping": self.damping, "memory": self.memory, "linear": self.linear}


#: Every law that can be offered; the first five are distinguished by the everyday bank.
CANDIDATES: tuple[Candidate, ...] = tuple(
    Candidate(DAMPINGS[damping], MEMORIES[memory], linear)
    for damping, memory, linear in _core.defaults["ViscoelasticContact"]["candidates"]
)
#: How many of them are distinguished by the everyday bank, from the first on.
EVERYDAY = 5
#: Differences of the score, twice those of a logarithm of the odds: e and e⁵ to one (Kass &
#: Raftery, J. Am. Stat. Assoc. 90, 1995).
UNDECIDED, STRONG = 2.0, 10.0


@dataclass(frozen=True, slots=True)
class Standing:
    """How a law that was offered stood at the last verdict.

    Attributes
    ----------
    candidate : Candidate
        The law.
    score : float
        N_eff ln(RSS/N) + 2 p ln N_eff, less that of the law that was chosen: from 0 on, the more
        the worse. Ten are strong evidence.
    rms_error : float
        Root of RSS/N, N.
    """

    candidate: Candidate
    score: float
    rms_error: float

    @property
    def words(self) -> str:
        """What its score means."""
        if self.score == 0.0:
            return "chosen"
        if self.score < UNDECIDED:
            return "cannot be told from it"
        return "less likely" if self.score < STRONG else "strong evidence against it"

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words."""
        return {
            "law": str(self.candidate),
            **self.candidate.as_dict(),
            "parameters": self.candidate.parameters,
            "score": defined(self.score),
            "rms_error": defined(self.rms_error),
        }


_NUMBERS = ("samples", "effective_samples", "depth", "frequency")


def band_about(frequency: float) -> tuple[float, float]:
    """Frequencies that a motion contained, rad/s, by its own: half to twice; laws part beyond."""
    return 0.5 * frequency, 2.0 * frequency


@dataclass(frozen=True, slots=True)
class LawVerdict:
    """Which law it is, and by what.

    Attributes
    ----------
    candidate : Candidate
        The law that was chosen.
    standings : tuple of Standing
        Of the laws that were offered, the best first; empty before the first verdict.
    samples : float
        Samples that the evidence is of, less what was forgotten.
    effective_samples : float
        N_eff: so many samples of white noise would say as much.
    depth : float
        Where the motion was on average, m.
    frequency : float
        Of the motion, rad/s: root mean square speed over that of the way from its mean depth.
    flags : tuple of str
        What the samples leave open of the memory.
    """

    candidate: Candidate
    standings: tuple[Standing, ...]
    samples: float
    effective_samples: float
    depth: float
    frequency: float
    flags: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words; the standings in their order."""
        return {
            "law": str(self.candidate),
            **self.candidate.as_dict(),
            "standings": [each.as_dict() for each in self.standings],
            **{name: defined(getattr(self, name)) for name in _NUMBERS},
            "flags": list(self.flags),
        }

    def __str__(self) -> str:
        if not self.known:
            return f"law: {self.candidate}, for want of samples"
        words = f"law: {self.candidate}"
        if len(self.standings) > 1:
            next_best = self.standings[1]
            if next_best.score < UNDECIDED:
                words += f", which {next_best.candidate} cannot be told from"
            else:
                words += f", before {next_best.candidate} by {rounded(next_best.score, 3)}"
        else:
            words += ", the only one that was offered"
        return (
            f"{words}; evidence of {rounded(self.effective_samples, 3)} independent samples of "
            f"{rounded(self.samples, 4)}"
        )

    @classmethod
    def from_dict(cls, words: Mapping[str, Any]) -> "LawVerdict":
        """Return the verdict of its numbers and words, as :meth:`as_dict` has them."""

        def candidate(each: Mapping[str, Any]) -> Candidate:
            return Candidate(each["damping"], each["memory"], each["linear"])

        standings = (
            Standing(candidate(each), or_nan(each["score"]), or_nan(each["rms_error"]))
            for each in words["standings"]
        )
        samples, effective, depth, frequency = (or_nan(words[name]) for name in _NUMBERS)
        flags = tuple(map(str, words["flags"]))
        return cls(candidate(words), tuple(standings), samples, effective, depth, frequency, flags)

    def standing_of(self, damping: str, memory: str, *, linear: bool = False) -> Standing | None:
        """Return how a law stood; None where it was not offered."""
        wanted = Candidate(damping, memory, linear)
        return next((each for each in self.standings if each.candidate == wanted), None)

    @property
    def known(self) -> bool:
        """Whether it is of the samples that there are, and not of a lead-in that was given up."""
        return bool(self.standings) and 2.0 * self.samples >= self.effective_samples

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies that the motion contained, rad/s: half to twice its own."""
        return band_about(self.frequency)


@dataclass(frozen=True, slots=True)
class DynamicStiffness:
    """What a small oscillation feels: numbers that laws of any kind have in common.

    Attributes
    ----------
    depth, frequency : float
        m and rad/s.
    stiffness, stiffness_error : float
        K′ and its standard error, N/m.
    damping, damping_error : float
        B′ and its standard error, N·s/m.
    loss_tangent : float
        tan δ = ω B′/K′.
    """

    depth: float
    frequency: float
    stiffness: float
    stiffness_error: float
    damping: float
    damping_error: float

    @property
    def loss_tangent(self) -> float:
        """Tan δ = ω B′/K′."""
        return self.frequency * self.damping / self.stiffness if self.stiffness else math.nan
