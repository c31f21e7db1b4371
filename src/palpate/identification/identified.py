"""What a whole contact gave: law, error bars, diagnosis; why there is none; which is best."""

import itertools
import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from itertools import pairwise
from typing import Any, Self, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate._core import Status
from palpate.contact import Contact
from palpate.diagnosis import (
    Data,
    Diagnosis,
    Episode,
    Laws,
    Quantity,
    WorkingDepth,
    diagnose_parts,
    stacked,
)
from palpate.diagnosis.diagnosing import outliers
from palpate.diagnosis.fit import DEEP, reference_scale
from palpate.diagnosis.marks import CARE, STOP_STIFFNESS, mark_of
from palpate.diagnosis.timeless import (
    SpringEstimate,
    diagnosis_without_time,
    findings_without_time,
    trace_without_time,
)
from palpate.digits import format_quantity, rounded, with_error
from palpate.errors import InvalidParameterError, RecordingError
from palpate.estimators import (
    ContactEstimator,
    LawVerdict,
    VariableProjection,
    ViscoelasticContact,
)
from palpate.estimators.estimate import (
    Estimate,
    Trace,
    Traced,
    checked_trace,
    prediction_rmse_percent,
    rmse_percent,
    violated_fraction,
)
from palpate.estimators.law_verdicts import Candidate
from palpate.estimators.oscillation import Oscillation
from palpate.estimators.variable_projection import EXPONENTS, constrained
from palpate.findings import MARKS, Finding
from palpate.force_laws import steps_over_breaks
from palpate.identification.replaying import (
    defaults_from_data,
    estimator_of,
    joint_covariance,
    predicted_force,
    replayed,
)
from palpate.preparation.along_penetration import Place, at_places
from palpate.preparation.gates import choose_gate
from palpate.preparation.velocity import window_samples
from palpate.quantities.derived import (
    QueryOptions,
    compression_modulus_from,
    elastic_modulus_from,
    energy_from,
    instantaneous_stiffness_of,
    oscillation_of,
    passivity_from,
    relaxation_time_of,
    relaxed_stiffness_of,
    restitution_from,
)
from palpate.settings import ChangeDetector, ContactGate, Scale
from palpate.validation import Floats, number_in, positive

# Of the peak force: a misfit of a law that relaxes beyond which its memory may have another form.
CLEAR_MISFIT = 0.01
# Samples above the surface that a search for it needs: the force out of contact is then known to a
# quarter of σ.
FEWEST_ABOVE = 20


def why_nothing(data: Data, gate: ContactGate) -> str:
    """Describe why no sample was taken: the most severe finding of the data, if any."""
    for finding in data.findings:
        if finding.severity == "do-not-trust":
            where = f"{data.contact.source}: " if data.contact.source else ""
            return f"{where}{finding}"
    return no_contact_message(data.contact, gate)


def no_contact_message(contact: Contact, gate: ContactGate) -> str:
    """Describe why no sample was taken."""
    where = f"{contact.source}: " if contact.source else ""
    if not len(contact):
        return f"{where}there are no samples"
    inside = gate.makes(contact.penetration, contact.force)
    if inside.any() and not np.isfinite(contact.velocity[inside]).any():
        return (
            f"{where}no sample in contact has a velocity: {not_finite(contact)}; pass "
            "--velocity none to differentiate the penetration instead"
        )
    return (
        f"{where}no contact found: no sample has penetration above "
        f"{rounded(gate.minimum_penetration, 3)} m and force above {rounded(gate.make_force, 3)} N "
        f"(the largest are {_largest(contact.penetration)} m and {_largest(contact.force)} N); "
        "check units and signs, or pass a smaller --min-penetration or --min-force"
    )


def not_finite(contact: Contact) -> str:
    """Describe which channels are not finite, where they come from, and how often."""
    penetration, force = ~np.isfinite(contact.penetration), ~np.isfinite(contact.force)
    velocity = ~np.isfinite(contact.velocity) & ~penetration  # beyond what follows from the depth
    words = []
    for name, wrong in {"penetration": penetration, "velocity": velocity, "force": force}.items():
        if wrong.any():
            origin = f" ({contact.provenance[name]})" if name in contact.provenance else ""
            words.append(f"{name}{origin} is NaN or infinite in {wrong.sum()}")
    return f"{', '.join(words)} of {len(contact)} samples"


def _largest(values: Floats) -> str:
    known = values[~np.isnan(values)]
    return rounded(known.max(), 3) if known.size else "no"


def check_approach(contact: Contact, trace: Trace, surface: float) -> None:
    """A surface is where the force begins: without samples before it, it is a guess from below."""
    above = int(np.count_nonzero(contact.penetration[trace.taken] < surface))
    if above < FEWEST_ABOVE:
        raise RecordingError.of(contact.source, no_approach(above, len(contact), surface))


def no_approach(above: int, samples: int, surface: float) -> str:
    """Describe that too few samples lie above the surface that was found."""
    return (
        f"cannot estimate the surface without a free approach: {above} of {samples} samples lie "
        f"above the best surface, {rounded(surface, 3)} m, and at least {FEWEST_ABOVE} must; "
        "start the recording before the touch, or pass the position of the surface"
    )


# What a reader should know before trusting the numbers of an identification.

NEGATIVE_STIFFNESS = Finding(
    "negative stiffness",
    "negative stiffness: in this law the force falls with depth",
    "check the signs of penetration and force",
)
NEGATIVE_DAMPING = Finding(
    "negative damping",
    "negative damping: this law creates energy, which no passive material does",
)


def findings_of(contact: Contact, trace: Trace, estimator: ContactEstimator) -> Iterator[Finding]:
    """Return what the last estimate does not determine, and what is special about the samples."""
    estimate = estimator.estimate()
    law = estimate.law
    yield from estimate.motion_findings
    if estimate.samples < 10 * len(law.symbols):
        yield Finding("excitation", f"only {estimate.samples} samples in contact")
    pulls = (law.power_law or law.relaxes) and not law.remembers
    if pulls and law.stiffness < 0.0:
        yield NEGATIVE_STIFFNESS
    if law.as_dict().get("damping", 0.0) < 0.0 and _creates_energy(contact, trace, estimate):
        yield NEGATIVE_DAMPING
    violated = violated_fraction(trace) if estimator.needs_condition_10 else 0.0
    if violated > 0.0:
        yield Finding(
            "condition 10",
            f"|v| ≥ 0.1 K/B in {violated:.1%} of the contact, where the method is biased",
        )
    if math.isnan(prediction_rmse_percent(trace, contact.force, contact.time_steps)):
        yield Finding("prediction", "less than 0.2 s of contact: no prediction error")
    if estimate.guarded:
        yield Finding("guard", f"the covariance was limited on {estimate.guarded} samples")
    if left_out := int(np.count_nonzero(trace.rejected)):
        taken = int(np.count_nonzero(trace.taken))
        yield outliers(left_out, left_out + taken)
    if (verdict := estimator.verdict()) is not None:
        yield from verdict.findings
    for refusal in (Status.NOT_FINITE, Status.INVALID_STEP, Status.OUT_OF_RANGE):
        if count := int(np.count_nonzero(trace.status == refusal)):
            words = refusal.name.lower().replace("_", " ")
            if refusal == Status.NOT_FINITE:
                words += f": {not_finite(contact)}"
            yield Finding("rows", f"{count} samples rejected: {words}")


def _creates_energy(contact: Contact, trace: Trace, estimate: Estimate) -> bool:
    taken = trace.taken
    depth = float(np.median(contact.penetration[taken])) - estimate.surface if taken.any() else 0.0
    if not depth > 0.0:
        return False
    with np.errstate(all="ignore"):
        (force, _, damping), errors = estimate.with_errors(lambda of: of.at_rest(depth))
        speed = np.sqrt(np.mean(contact.velocity[taken] ** 2))
        return bool(creates_energy(damping, errors[2], force, speed))


def creates_energy(damping: Any, error: Any, force: Any, speed: Any) -> Any:
    """Whether a damping at a depth is negative, by two standard errors and by the diagnosis's rule.

    Parameters
    ----------
    damping, error : float or numpy.ndarray
        N·s/m.
    force : float or numpy.ndarray
        At that depth and at rest, N.
    speed : float or numpy.ndarray
        Root mean square in contact, m/s.
    """
    size = reference_scale(damping, force, speed)
    return damping < -np.maximum(2.0 * error, CARE * size)


def prior_finding(own: Estimate, bounded: Estimate, depth: float) -> Finding:
    """Describe that the answer is under the weak prior, and what the least squares gives."""
    moved = bounded.law.stiffness_at(depth) / own.law.stiffness_at(depth) - 1.0
    sign = "negative" if own.law.damping < 0.0 else "positive"
    return Finding(
        "weak prior",
        "the probe moves one way at nearly one speed, which leaves n and B open: the answer is the "
        f"least squares with B ≥ 0 and n from {EXPONENTS[0]:g} to {EXPONENTS[1]:g}; without this "
        f"prior n is {own.law.exponent:.2f} and B {sign}",
        "press and release, at several speeds; without the prior: --no-weak-prior",
        stiffness=mark_of(abs(moved), STOP_STIFFNESS),
        damping="do-not-trust",
        moves_stiffness_percent=100.0 * moved,
    )


# What a whole contact gave.

_Derived = TypeVar("_Derived", bound=Callable[..., Any])


def _with_time(derived: _Derived) -> _Derived:
    """The same function of an identification, which refuses one of a recording without time."""

    @wraps(derived)
    def refusing(result: "Identified", *query: Any, **named: Any) -> Any:
        if result.contact.timeless:
            raise InvalidParameterError(
                "the recording has no time, and without it there is no damping and nothing that "
                "follows from it: record the time of each sample"
            )
        return derived(result, *query, **named)

    return refusing  # type: ignore[return-value]  # it has the same arguments


_LOGGER = logging.getLogger(__name__)

_Placed: TypeAlias = tuple[Place, Contact]


@dataclass(frozen=True, eq=False, repr=False)  # no slots: the diagnosis is kept in the instance
class Identified:
    """What a whole contact gave, in numbers; :class:`palpate.Identification` shows them.

    That class says what each field is.
    """

    contact: Contact
    estimator: ContactEstimator
    trace: Trace
    findings: tuple[Finding, ...] = ()
    data: Data | None = field(default=None, repr=False)
    depth: float | None = None
    segments: tuple["Identified", ...] = ()
    noticed: Trace | None = field(default=None, repr=False)
    place: Place | None = field(default=None, repr=False)
    chosen: tuple[str, ...] = ()
    query: QueryOptions = field(default_factory=QueryOptions)
    traced: Traced = 2000
    #: The estimate under a weak prior, where the motion leaves the estimator's own open.
    bounded: Estimate | None = None
    #: The identification that selected this one's law.
    selected: "Identified | None" = None

    @classmethod
    def of(
        cls,
        data: Data,
        estimator: ContactEstimator | str | None = None,
        *,
        trace: Traced = 2000,
    ) -> Self:
        """Identify a contact that is prepared; :func:`palpate.identify` says the rest.

        Parameters
        ----------
        data : Data
            The contact with the checks of its channels. Where the load goes elsewhere, its samples
            are excluded, unless the estimator keeps outliers.
        estimator : ContactEstimator or str, optional
            Method and settings. Default: variable projection.
        trace : int, float, "full" or False
            Which estimates are written down.
        """
        timeless = data.contact.timeless
        given, traced = estimator_of(estimator, timeless=timeless), checked_trace(trace)
        data = data.samples(rejecting=given.rejects_outliers)
        contact = data.contact
        if contact.timeless and type(given) is not VariableProjection:
            raise InvalidParameterError(
                f"without time only variable-projection identifies a stiffness, not {given.method}"
            )
        chosen = defaults_from_data(contact, given)
        fresh = given.replace(**chosen)
        written = replayed(contact, fresh, traced)
        if type(fresh) is VariableProjection and not any(
            fresh.settings[name] for name in ("forgetting", "change_detector")
        ):
            again = fresh.replace()
            if again._unround_as(fresh):
                fresh, written = again, replayed(contact, again, traced)
        if _LOGGER.isEnabledFor(logging.INFO):
            words = (f"{name}={value}" for name, value in chosen.items() if value is not None)
            known = ", ".join(words) or "nothing"
            _LOGGER.info("%s: chosen from the data: %s", fresh.method, known)
        found = tuple(findings_of(contact, written, fresh))
        if contact.timeless:
            found, written = findings_without_time(found), trace_without_time(written)
        taken = np.count_nonzero(written.taken)
        _LOGGER.info("%s: took %d of %d samples", fresh.method, taken, len(contact))
        result = cls(contact, fresh, written, found, data, chosen=tuple(chosen), traced=traced)
        if not (written.taken & ~(contact.force <= 0.0)).any():
            raise RecordingError(why_nothing(data, result.gate))
        if fresh.settings.get("surface") == "estimate":
            check_approach(contact, written, result.estimate.surface)
        return result._under_prior() if fresh.settings.get("weak_prior") else result

    @classmethod
    def selected_law(
        cls,
        data: Data,
        estimator: ContactEstimator | str | None = None,
        *,
        trace: Traced = 2000,
    ) -> Self:
        """Identify a contact; where Hunt and Crossley's law is selected, by variable projection.

        That has the smaller error of K, B and n. It also answers where the material pulls or
        changes, which a law with memory would take for its own.
        """
        found = cls.of(data, estimator, trace=trace)
        if not found.estimator.chooses_law or not found._takes_hunt_crossley():
            return found
        given, plain = found.estimator.settings, VariableProjection()
        shared = {name for name in plain.settings if name in given}.difference(found.chosen)
        plain = plain.replace(**{name: given[name] for name in shared})
        answer = cls.of(found.data or data, plain, trace=trace)
        return replace(answer, selected=found)

    def _takes_hunt_crossley(self) -> bool:
        own, selected = Candidate("hunt-crossley", "none"), self.estimator.candidate
        if selected == own:
            return True
        if own not in self.estimator.offered:
            return False
        if selected is None:  # too few samples to compare laws: nothing is estimated
            return True
        return any(f.check in ("change", "adhesion") for f in self.diagnosis.findings)

    def _under_prior(self) -> Self:
        """Return it with the estimate under the weak prior, if its own is outside of that."""
        own, settings = self.estimator.estimate(), self.estimator.settings
        given = ("exponent", "forgetting", "change_detector", "surface")
        if not self.depths or any(settings[name] is not None for name in given):
            return self
        bounded = constrained(self.contact, self.trace, own)
        if bounded is None:
            return self
        found = [prior_finding(own, bounded, self.depths[0])]
        said = findings_without_time(found) if self.contact.timeless else found
        return replace(self, bounded=bounded, findings=(*self.findings, *said))

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """What may be wrong, and how far to trust it; worked out when it is first needed."""
        found = self._diagnosed_at(self.depths)
        if not self.segments:
            return found
        parts = (replace(f, remedy=None) if f.check == "change" else f for f in found.findings)
        return replace(found, findings=tuple(parts))  # each segment is identified already

    @cached_property
    def oscillation(self) -> Oscillation | None:
        """What the samples say of small oscillations where a law was selected; otherwise None."""
        if self.selected is not None:
            return self.selected.oscillation
        if not isinstance(self.estimator, ViscoelasticContact):
            return None
        contact, taken = self.contact, self.trace.taken.copy()
        if (restarts := np.flatnonzero(self.trace.status == Status.RESTARTED)).size:
            taken[: restarts[-1]] = False
        channels = contact.penetration, contact.velocity, contact.force
        steps = steps_over_breaks(contact.time, contact.penetration, contact.sample_time)
        return Oscillation.of(self.estimator, *channels, steps, taken)

    def _late(self) -> Iterator[Finding]:
        """A damper that gives energy back, beside a spectrum that may take it."""
        found = self.oscillation
        if found is None or not found.delay > 0.0:
            return
        words = f"the force is at least {format_quantity(found.delay, 's')} late"
        if found.misfit > CLEAR_MISFIT:
            words += ", or the material's memory has another form"
        yield Finding(
            "late force",
            f"the damper beside the relaxation is negative: {words}",
            "run again with --delay find",
            damping="with-care",
        )

    def _diagnosed_at(self, depths: Sequence[float]) -> Diagnosis:
        data = self.data or Data(self.contact)
        timeless = self.contact.timeless
        by = self.selected or self
        laws = Laws.of(by.estimator) if by.estimator.chooses_law else None
        found = diagnose_parts(
            data,
            self.trace,
            self._whole_estimate,
            depths=depths,
            laws=laws,
            notes=(*self.findings, *self._late()),
            method=self.method,
            response=self.oscillation,
            frequency=self.frequency,
        )
        return diagnosis_without_time(found) if timeless else found

    @cached_property
    def depths(self) -> tuple[float, ...]:
        """Working depth, and the 90th percentile of the penetration, m; none without firm contact.

        Of the samples taken that a gate would take: a method that chooses its samples takes light
        ones too, and a probe that rests at the surface would leave its working depth there. The
        diagnosis is made at these; asking for them does not make it.
        """
        penetration = self._firm_penetration
        depths = np.percentile(penetration, (50.0, DEEP)).tolist() if penetration.size else []
        if depths and not depths[0] > 0.0:
            depths = []
        if self.depth is not None:
            depths[:1] = [self.depth]
        return tuple(depths)

    @property
    def largest_depth(self) -> float:
        """The largest penetration below the surface in firm contact, m; NaN without any.

        Beyond it the law is extrapolated.
        """
        largest = float(np.max(self._firm_penetration, initial=0.0))
        return largest if largest > 0.0 else math.nan

    @cached_property
    def _firm_penetration(self) -> Floats:
        contact = self.contact
        firm = choose_gate(contact).makes(contact.penetration, contact.force)
        inside = self.trace.taken & firm
        penetration: Floats = contact.penetration[inside] - self.estimate.surface
        return penetration

    @cached_property
    def frequency(self) -> float:
        """ω of the motion, rad/s: rms speed over rms distance from the mean depth, in contact.

        NaN if the probe is held still.
        """
        contact = self.contact
        inside = (contact.penetration > self.estimate.surface) & ~self.trace.rejected
        inside &= np.isfinite(contact.velocity)
        way = float(np.std(contact.penetration[inside])) if inside.any() else 0.0
        speed = float(np.sqrt(np.mean(contact.velocity[inside] ** 2))) if inside.any() else 0.0
        return speed / way if way > 0.0 and speed > 0.0 else math.nan

    @property
    def working_depths(self) -> tuple[WorkingDepth, ...]:
        """Force, stiffness and damping at the working depth and at the 90th percentile, SI."""
        return self.diagnosis.working_depths

    def at(self, depth: "ArrayLike") -> WorkingDepth:
        """Force, stiffness and damping at other depths, each with both standard errors, SI.

        The diagnosis is run again, so request many depths at once.

        Parameters
        ----------
        depth : float or array_like
            Below the surface, m, > 0. Beyond the depths in contact the law is extrapolated, and
            the error bars hold only if the law does.

        Returns
        -------
        WorkingDepth
            Its numbers are arrays of the shape of ``depth``, or floats for a float.

        Raises
        ------
        InvalidParameterError
            A depth is not a finite number > 0.
        """
        query = positive("depth", depth)
        first = self.diagnosis.working_depth.depth
        depths = (first, *query.reshape(-1).tolist())
        found = self._diagnosed_at(depths).working_depths[1:]
        return stacked(found, query.shape)

    def force_at(self, depth: "ArrayLike") -> Quantity:
        """Force at depths [m] and at rest, N, with both error bars; see :meth:`at`."""
        return self.at(depth).force

    def stiffness_at(self, depth: "ArrayLike") -> Quantity:
        """∂F/∂x at depths [m] and at rest, N/m, with both error bars; see :meth:`at`."""
        return self.at(depth).stiffness

    def damping_at(self, depth: "ArrayLike") -> Quantity:
        """∂F/∂v at depths [m], N·s/m, with both error bars; see :meth:`at`."""
        return self.at(depth).damping

    # What follows from the law: each is documented where it is worked out.
    dynamic_stiffness = _with_time(oscillation_of)
    relaxed_stiffness = relaxed_stiffness_of
    instantaneous_stiffness = instantaneous_stiffness_of
    relaxation_time = property(relaxation_time_of)
    restitution = _with_time(restitution_from)
    energy = cached_property(_with_time(energy_from))
    passivity = cached_property(_with_time(passivity_from))
    elastic_modulus = elastic_modulus_from
    compression_modulus = compression_modulus_from

    def at_depth(self, depth: float) -> Self:
        """Return the same with another working depth, m, for its diagnosis."""
        return replace(self, depth=number_in("depth", depth, 0.0, 1e100, open_low=True))

    def with_query(self, query: QueryOptions) -> Self:
        """Return the same with derived numbers for an impact and a tip or specimen."""
        other = replace(self, query=query)
        if "diagnosis" in vars(self):  # which no query changes
            vars(other)["diagnosis"] = self.diagnosis
        return other

    def by_segment(self) -> Self:
        """Return a copy with ``segments``: each segment between changes identified separately.

        With the same settings and working depth. Segments that cannot be identified are omitted,
        and so are samples at a border within the velocity filter. Without a change there are none.
        ``noticed`` is a replay with a change detector: when a control loop would have noticed.
        """
        parts = (self.segment_of(episode) for episode in self.diagnosis.episodes)
        found = tuple(part for part in parts if part is not None)
        return replace(self, segments=found, noticed=self._watched())

    def by_place(self, watch: "Callable[[Sequence[_Placed]], Iterable[_Placed]]" = iter) -> Self:
        """Return a copy with ``segments``: each place of a travelling probe identified separately.

        With the same settings, each at its own working depth. Places that cannot be identified are
        omitted. A probe that stays at one place has none.

        Parameters
        ----------
        watch : callable
            Iterates over the places, such as with a progress bar.
        """
        # Of the same settings, but for those that were chosen from these data.
        own = self.selected or self
        found, fresh = [], own.estimator.replace(**dict.fromkeys(own.chosen))
        for place, contact in watch(
            list(at_places(self.contact, rejecting=fresh.rejects_outliers))
        ):
            with suppress(RecordingError):
                part = self.selected_law(Data(contact), fresh, trace=self.traced)
                found.append(replace(part, place=place, query=self.query))
        return replace(self, segments=tuple(found))

    def answers(self, estimator: ContactEstimator, trace: Traced) -> bool:
        """Whether it is what :meth:`of` would make of its contact by an estimator, as a whole."""
        if self.segments or self.depth is not None or self.traced != trace:
            return False
        own, asked = self.estimator.settings, estimator.settings
        left = {name: own[name] for name in self.chosen if asked.get(name) is None}
        return self.method == estimator.method and repr(own) == repr({**asked, **left})

    def segment_of(self, episode: Episode) -> Self | None:
        """Identify an episode of the diagnosis by itself; None where that cannot be."""
        step, used = self.contact.sample_time, self.contact.velocity_filter
        smear = step * (window_samples(step) if used is None else used.samples)
        with suppress(RecordingError):
            part = self.contact.window(episode.start + smear, episode.stop - smear)
            found = self.of(Data(part), self.estimator.replace(), trace=self.traced)
            there = self.diagnosis.working_depth
            return replace(found.at_depth(there.depth), query=self.query)
        return None

    def _watched(self) -> Trace:
        """The trace with a change detector, where the estimator can have one."""
        settings = self.estimator.settings
        if settings.get("change_detector", self) is not None:
            return self.trace
        watched = self.estimator.replace(change_detector=ChangeDetector())
        return replayed(self.contact, watched, self.traced)

    @property
    def flags(self) -> tuple[str, ...]:
        """The findings in words."""
        return tuple(map(str, self.findings))

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.estimator.method

    @property
    def estimate(self) -> Estimate:
        """What the estimator knew at the end; under the weak prior, where that applies."""
        return self.reported(self._whole_estimate)

    def reported(self, estimate: Estimate) -> Estimate:
        """Return an estimate of its estimator as it is reported: without time its spring alone."""
        return SpringEstimate(estimate) if self.contact.timeless else estimate

    @property
    def _whole_estimate(self) -> Estimate:
        """The same; without time the damper in units of the samples too."""
        return self.estimator.estimate() if self.bounded is None else self.bounded

    @property
    def law(self) -> Any:
        """The contact model, SI."""
        return self.estimate.law

    @property
    def fixed(self) -> tuple[str, ...]:
        """The law's parameters that were given, such as a known exponent, and not identified."""
        return self.estimate.fixed

    @property
    def law_verdict(self) -> LawVerdict | None:
        """Model selection: the preferred law, and the evidence.

        The choice of a method that selects a law. For another method's Hunt–Crossley or
        Kelvin–Voigt law, model selection among the common laws; None for other laws.
        """
        return self.diagnosis.law_verdict

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the law's parameters, SI: square roots of the variances.

        0 of a parameter that is :attr:`fixed`.
        """
        errors: Floats = np.sqrt(np.diag(self.covariance))
        return errors

    @cached_property
    def covariance(self) -> Floats:
        """Joint covariance of the law's parameters, SI, as wide as a correlated residual asks for.

        That of the estimate, but for methods that take their residual for white, the paper's:
        there as much wider as its correlation makes the least squares of the samples that they took
        since their last restart. Where the preparation found the surface, with what the parameters
        are elsewhere when that is off by its deviation.
        """
        if self.bounded is not None:
            return self.estimate.covariance
        whole = joint_covariance(self.contact, self.trace, self.estimator)
        if self.contact.timeless:
            names = self.estimator.law_type.names()
            kept = [names.index(name) for name in self.law.names()]
            whole = whole[np.ix_(kept, kept)]
        return whole

    @property
    def correlations(self) -> Floats:
        """Correlations of the law's parameters, shape (p, p); NaN beside one without an error."""
        errors = self.standard_errors
        with np.errstate(invalid="ignore", divide="ignore"):
            found: Floats = self.covariance / np.outer(errors, errors)
        return found

    @property
    def gate(self) -> ContactGate:
        """The gate that chose the samples."""
        return self.estimator.settings.get("gate") or ContactGate()

    @property
    def scale(self) -> Scale:
        """The units of the arithmetic."""
        return self.estimator.settings.get("scale") or Scale()

    @property
    def prediction_rmse_percent(self) -> float:
        """RMSE% of the a-priori force after 0.2 s of contact."""
        return prediction_rmse_percent(self.trace, self.contact.force, self.contact.time_steps)

    @property
    def fit_rmse_percent(self) -> float:
        """RMSE% of the final law, and offset where one is estimated, over every sample taken."""
        taken = self.trace.taken
        return rmse_percent(self.contact.force[taken], self.fitted_force[taken])

    @property
    def fitted_force(self) -> Floats:
        """Force by the final law, and offset where one is estimated, at every sample, N.

        With segments, the law of the one that began last.
        """
        contact, parts = self.contact, self.segments
        fitted = (parts[0] if parts else self).predicted_force(contact)
        for before, part in pairwise(parts):
            border = 0.5 * (before.contact.time[-1] + part.contact.time[0])
            begun = contact.time >= border
            fitted[begun] = part.predicted_force(contact)[begun]
        return fitted

    def predicted_force(self, contact: Contact) -> Floats:
        """Force by the final law, and offset, at every sample of a contact, N.

        A contact that begins with the samples that were identified begins in their state.
        """
        own = self.contact
        same = len(contact) and len(own) and contact.time[0] == own.time[0]
        begins = bool(same and contact.penetration[0] == own.penetration[0])
        return predicted_force(self.estimate, contact, begins=begins)

    @property
    def violated_fraction(self) -> float:
        """Fraction of contact without condition 10; NaN for laws that it does not concern."""
        if not self.law.has_condition_10:
            return math.nan
        return violated_fraction(self.trace)

    @property
    def changes(self) -> Floats:
        """Times at which a change detector alarmed, s."""
        trace = self.noticed or self.trace
        times: Floats = self.contact.time[trace.status == Status.RESTARTED]
        return times


# Methods side by side: which to take, which fail, and whose error bars exclude each other.

EXCLUDED = 3.0  # standard errors of the difference


@dataclass(frozen=True, slots=True)
class Ranking:
    """What a comparison comes to.

    Attributes
    ----------
    recommended : str or None
        The method to take; None where none is to be trusted.
    order : tuple of str
        The methods, the best first: by verdict, without those of a law that another is clearly
        better than, then by what their law leaves unexplained.
    failing : tuple of str
        Methods whose answer is not the least squares of their own law, or that found none.
    exclusions : tuple of str
        A sentence for each pair whose error bars exclude each other.
    """

    recommended: str | None
    order: tuple[str, ...]
    failing: tuple[str, ...]
    exclusions: tuple[str, ...]


def rank(results: "Mapping[str, Identified]") -> Ranking:
    """Rank what :func:`palpate.compare` returned.

    Parameters
    ----------
    results : mapping
        An identification by the name of its method.
    """
    common = np.logical_and.reduce([result.trace.taken for result in results.values()])
    left = {name: _left(result, common) for name, result in results.items()}
    outdone = _outdone(results, left)
    order = tuple(
        sorted(results, key=lambda name: _badness(results[name], left[name], name in outdone))
    )
    failing = tuple(name for name in order if fails(results[name]))
    pairs = itertools.combinations(order, 2)
    words = (_exclusion(results[a], results[b]) for a, b in pairs)
    hopeless = all(r.diagnosis.verdict.overall == "do-not-trust" for r in results.values())
    best = None if hopeless else order[0]
    return Ranking(best, order, failing, tuple(each for each in words if each))


def fails(result: "Identified") -> bool:
    """Whether the method's answer is not the least squares of its own law on these samples."""
    moves = (
        max(abs(f.moves_stiffness_percent), abs(f.moves_damping_percent))
        for f in result.diagnosis.findings
        if f.check == "method"
    )
    return any(each > 100.0 * CARE for each in moves)


def _left(result: "Identified", common: NDArray[np.bool_]) -> float:
    """RMSE% on the samples that every method took: variable projection takes light ones too."""
    fit = rmse_percent(result.contact.force[common], result.fitted_force[common])
    return fit if math.isfinite(fit) else math.inf


# Of what another law leaves: a selected law that relaxes has clearly less.
CLEARLY = 0.9


def _outdone(results: "Mapping[str, Identified]", left: Mapping[str, float]) -> set[str]:
    """Methods that leave clearly more than the one that chooses a law, where one was named."""
    method = ViscoelasticContact.method
    if method not in results or not results[method].law.remembers:
        return set()
    return {name for name, fit in left.items() if left[method] <= CLEARLY * fit}


def _badness(result: "Identified", left: float, outdone: bool) -> tuple[float, ...]:
    verdict = result.diagnosis.verdict
    overall, *others = (
        MARKS.index(mark) for mark in (verdict.overall, verdict.stiffness, verdict.damping)
    )
    # To a tenth: methods of one law that fit alike stay in the order of the registry.
    return overall, outdone, *others, round(left, 1)


def _exclusion(one: "Identified", other: "Identified") -> str | None:
    if one.law.remembers or other.law.remembers:
        return None  # the stiffness of a relaxed material is no other's
    first, second = one.diagnosis.working_depth, other.diagnosis.working_depth
    words = []
    for name, a, b in (
        ("stiffness", first.stiffness, second.stiffness),
        ("damping", first.damping, second.damping),
    ):
        apart = abs(a.value - b.value) / math.hypot(_bar(a), _bar(b))
        if apart > EXCLUDED:
            both = f"{with_error(a.value, _bar(a))} and {with_error(b.value, _bar(b))}"
            words.append(f"{name} {both} ({rounded(apart, 2)} standard errors)")
    if not words:
        return None
    return f"{one.method} and {other.method} exclude each other: {', '.join(words)}"


def _bar(quantity: Quantity) -> float:
    """Both error bars together; infinite where the repeatable one is not known."""
    bar = quantity.whole_error
    return bar if math.isfinite(bar) and bar > 0.0 else math.inf
