"""The identification of a whole contact: law, error bars, diagnosis."""

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from palpate._core import Status
from palpate.digits import format_quantity, rounded
from palpate.errors import InvalidParameterError, RecordingError
from palpate.findings import Check, Finding, NextStep, Remedy
from palpate.force_laws import steps_over_breaks
from palpate.identification.checks import check_approach, check_estimate, why_nothing
from palpate.identification.diagnosis import (
    Data,
    Diagnosis,
    Episode,
    ModelSelection,
    Quantity,
    WorkingDepth,
    diagnose_parts,
    stack_depths,
)
from palpate.identification.diagnosis.fit import DEEP, FitInput, force_along
from palpate.identification.quantities.derived import (
    QueryOptions,
    compression_modulus_from,
    compute_instantaneous_stiffness,
    compute_oscillation,
    compute_relaxation_time,
    compute_relaxed_stiffness,
    compute_stiffness_after,
    elastic_modulus_from,
    energy_from,
    passivity_from,
    restitution_from,
)
from palpate.identification.replaying import (
    defaults_from_data,
    joint_covariance,
    replay,
    resolve_estimator,
)
from palpate.identification.weak_prior import weak_prior
from palpate.input.preparation.gate import choose_gate
from palpate.method.contact import Contact
from palpate.method.estimators import (
    ContactEstimator,
    LawVerdict,
    VariableProjection,
    ViscoelasticContact,
)
from palpate.method.estimators.estimate import (
    Estimate,
    Trace,
    Traced,
    check_trace,
    prediction_rmse_percent,
    rmse_percent,
    samples_in_estimate,
    violated_fraction,
)
from palpate.method.estimators.law_verdicts import Candidate
from palpate.method.estimators.oscillation import Oscillation
from palpate.method.rows import rms
from palpate.method.settings import ChangeDetector, ContactGate, Scale
from palpate.validation import Floats, number_in, positive

if TYPE_CHECKING:
    from palpate.input.preparation.places import Place

_LOGGER = logging.getLogger(__name__)
_Placed: TypeAlias = "tuple[Place, Contact]"


@dataclass(frozen=True, eq=False, repr=False)  # no slots: the instance caches the diagnosis
class Identified:
    """Identification of a whole contact as numbers; :class:`palpate.Identification` shows them.

    There are two classes because tables, figures, reports and files are packages above this one,
    which take these numbers, and no import runs upward. The public class is above them and adds
    only the methods that call them; it documents the fields.
    """

    contact: Contact
    estimator: ContactEstimator
    trace: Trace
    findings: tuple[Finding, ...] = ()
    data: Data | None = field(default=None, repr=False)
    depth: float | None = None
    segments: tuple["Identified", ...] = ()
    noticed: Trace | None = field(default=None, repr=False)
    place: "Place | None" = field(default=None, repr=False)
    chosen: tuple[str, ...] = ()
    query: QueryOptions = field(default_factory=QueryOptions)
    traced: Traced = 2000
    #: The estimate under a weak prior, if the motion does not determine the estimator's own.
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
        """Identify a prepared contact; see :func:`palpate.identify`.

        Parameters
        ----------
        data : Data
            The contact with the checks of its channels. Samples in which another place carries
            the load are excluded, unless the estimator keeps outliers.
        estimator : ContactEstimator or str, optional
            Method and settings. Default: variable projection.
        trace : int, float, "full" or False
            Which estimates are recorded.
        """
        timeless = data.contact.timeless
        given = resolve_estimator(estimator, timeless=timeless)
        traced = check_trace(trace)
        data = data.samples(rejecting=given.rejects_outliers)
        contact = data.contact
        if contact.timeless and not given.works_without_time:
            raise InvalidParameterError(
                f"without time only variable-projection identifies a stiffness, not {given.method}"
            )
        chosen = defaults_from_data(contact, given)
        fresh = given.replace(**chosen)
        recorded = replay(contact, fresh, traced)
        if (with_known_sensor := fresh.second_pass()) is not None:
            fresh = with_known_sensor
            recorded = replay(contact, fresh, traced)
        phrases = (f"{name}={value}" for name, value in chosen.items() if value is not None)
        _LOGGER.info("%s: chosen from the data: %s", fresh.method, ", ".join(phrases) or "nothing")
        findings = tuple(check_estimate(contact, recorded, fresh))
        if contact.timeless:
            from palpate.identification.diagnosis.timeless import (
                findings_without_time,
                trace_without_time,
            )

            findings = findings_without_time(findings)
            recorded = trace_without_time(recorded)
        taken = np.count_nonzero(recorded.taken)
        _LOGGER.info("%s: took %d of %d samples", fresh.method, taken, len(contact))
        result = cls(contact, fresh, recorded, findings, data, chosen=tuple(chosen), traced=traced)
        if not (recorded.taken & ~(contact.force <= 0.0)).any():
            raise why_nothing(data, result.gate)
        if fresh.settings.get("surface") == "estimate":
            check_approach(contact, recorded, result.estimate.surface)
        return result._apply_weak_prior() if fresh.settings.get("weak_prior") else result

    @classmethod
    def selected_law(
        cls,
        data: Data,
        estimator: ContactEstimator | str | None = None,
        *,
        trace: Traced = 2000,
    ) -> Self:
        """Identify a contact; if Hunt–Crossley is selected, identify it by variable projection.

        Variable projection has smaller errors of K, B and n. It is also used if the contact is
        adhesive or changes, which a relaxing law would absorb, or if no relaxation can be seen.
        """
        selection = cls.of(data, estimator, trace=trace)
        if not selection.estimator.chooses_law or not selection._prefers_hunt_crossley():
            return selection
        settings = selection.estimator.settings
        plain = VariableProjection()
        shared = {name for name in plain.settings if name in settings}.difference(selection.chosen)
        plain = plain.replace(**{name: settings[name] for name in shared})
        answer = cls.of(selection.data or data, plain, trace=trace)
        return replace(answer, selected=selection)

    def _prefers_hunt_crossley(self) -> bool:
        candidate = Candidate("hunt-crossley", "none")
        selected = self.estimator.candidate
        if selected == candidate or candidate not in self.estimator.offered:
            return selected == candidate
        absorbed = (Check.CHANGE, Check.ADHESION, Check.LOADING_ALONE)
        # With too few samples no law is selected, and nothing is estimated.
        return selected is None or any(f.check in absorbed for f in self.diagnosis.findings)

    def _apply_weak_prior(self) -> Self:
        """Return it with an estimate under the weak prior, if its own violates the prior."""
        answer = weak_prior(self.contact, self.trace, self.estimator, next(iter(self.depths), None))
        if answer is None:
            return self
        bounded, finding = answer
        return replace(self, bounded=bounded, findings=(*self.findings, finding))

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Findings, marks and error bars; computed when first needed."""
        found = self._diagnose_depths(self.depths)
        if not self.segments:
            return found.marked(self.frequency, relaxes=self.law.remembers)
        # No mark of numbers of all parts together: each part has its own.
        parts = (replace(f, remedy=None) if f.check == Check.CHANGE else f for f in found.findings)
        return replace(found, findings=tuple(parts))  # the segments are identified already

    @cached_property
    def oscillation(self) -> Oscillation | None:
        """Small oscillations if a law was selected, otherwise None."""
        if self.selected is not None:
            return self.selected.oscillation
        if not isinstance(self.estimator, ViscoelasticContact):
            return None
        contact = self.contact
        channels = contact.penetration, contact.velocity, contact.force
        steps = steps_over_breaks(contact.time, contact.penetration, contact.sample_time)
        return Oscillation.of(self.estimator, *channels, steps, samples_in_estimate(self.trace))

    def _check_late_force(self) -> Iterator[Finding]:
        """Report a negative damper next to a relaxation spectrum, which may compensate it."""
        oscillation = self.oscillation
        if oscillation is None or not oscillation.delay > 0.0:
            return
        late = format_quantity(oscillation.delay, "s")
        yield Check.LATE_FORCE.finding(
            f"the damper beside the relaxation is negative: the force is at least {late} late, or "
            "the material's memory has another form",
            Remedy(NextStep.FIND_DELAY),
            damping="with-care",
        )

    def _diagnose_depths(self, depths: Sequence[float]) -> Diagnosis:
        by = self.selected or self
        fit_input = FitInput(
            self.data or Data(self.contact),
            self.trace,
            self._whole_estimate,
            ModelSelection.of(by.estimator) if by.estimator.chooses_law else None,
            self.method,
            self.oscillation,
            self.frequency,
        )
        found = diagnose_parts(fit_input, depths, (*self.findings, *self._check_late_force()))
        if not self.contact.timeless:
            return found
        from palpate.identification.diagnosis.timeless import diagnosis_without_time

        return diagnosis_without_time(found)

    @cached_property
    def depths(self) -> tuple[float, ...]:
        """Working depth, and the 90th percentile of the penetration, m; empty without firm contact.

        They are percentiles of the taken samples that a gate would also take. A method that selects
        its samples takes shallow ones too, and for a probe that rests at the surface these would
        give a working depth at the surface. The depths are computed without a diagnosis.
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
        speed = rms(contact.velocity[inside]) if inside.any() else 0.0
        return speed / way if way > 0.0 and speed > 0.0 else math.nan

    @property
    def stiffness(self) -> Quantity:
        """K′ at the working depth, N/m, with both standard errors.

        Raises
        ------
        InvalidParameterError
            Each of several segments or places has its own.
        """
        return self._of_one("stiffness")

    @property
    def damping(self) -> Quantity:
        """B′ at the working depth and the motion's frequency, N·s/m; see :attr:`stiffness`."""
        return self._of_one("damping")

    def _of_one(self, name: str) -> Quantity:
        if self.segments:
            times = (segment.contact.time[[0, -1]].tolist() for segment in self.segments)
            spans = ", ".join(
                f"{rounded(first, 4)} to {rounded(last, 4)} s" for first, last in times
            )
            raise InvalidParameterError(
                f"each of {len(self.segments)} segments ({spans}) has its own {name}: use "
                f"segments[0].{name}, or numbers of all"
            )
        quantity: Quantity = getattr(self.diagnosis.working_depth, name)
        return quantity

    @property
    def working_depths(self) -> tuple[WorkingDepth, ...]:
        """Force, stiffness and damping at the working depth and at the 90th percentile, SI."""
        return self.diagnosis.working_depths

    def at(self, depth: "ArrayLike") -> WorkingDepth:
        """Force, stiffness and damping at other depths, each with both standard errors, SI.

        Each call runs the diagnosis again, so request many depths at once.

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
        found = self._diagnose_depths(depths).working_depths[1:]
        return stack_depths(found, query.shape)

    def force_at(self, depth: "ArrayLike") -> Quantity:
        """Force at depths [m] and at rest, N, with both error bars; see :meth:`at`."""
        return self.at(depth).force

    def stiffness_at(self, depth: "ArrayLike") -> Quantity:
        """∂F/∂x at depths [m] and at rest, N/m, with both error bars; see :meth:`at`."""
        return self.at(depth).stiffness

    def damping_at(self, depth: "ArrayLike") -> Quantity:
        """∂F/∂v at depths [m], N·s/m, with both error bars; see :meth:`at`."""
        return self.at(depth).damping

    # Quantities derived from the law; each is documented where it is computed.
    dynamic_stiffness = compute_oscillation
    relaxed_stiffness = compute_relaxed_stiffness
    instantaneous_stiffness = compute_instantaneous_stiffness
    stiffness_after = compute_stiffness_after
    relaxation_time = property(compute_relaxation_time)
    restitution = restitution_from
    energy = cached_property(energy_from)
    passivity = cached_property(passivity_from)
    elastic_modulus = elastic_modulus_from
    compression_modulus = compression_modulus_from

    def at_depth(self, depth: float) -> Self:
        """Return the same with another working depth, m, for its diagnosis."""
        return replace(self, depth=number_in("depth", depth, 0.0, 1e100, open_low=True))

    def with_query(self, query: QueryOptions) -> Self:
        """Return the same with derived numbers for an impact and a tip or specimen."""
        other = replace(self, query=query)
        if "diagnosis" in vars(self):  # a query does not change it
            vars(other)["diagnosis"] = self.diagnosis
        return other

    def by_segment(self) -> Self:
        """Return a copy with ``segments``: each segment between changes identified separately.

        The settings and the working depth are the same. Segments that cannot be identified are
        omitted, and so are samples nearer to a border than the velocity filter's window. Without a
        change there are no segments. ``noticed`` is a replay with a change detector: it shows when
        a control loop would have noticed.
        """
        parts = (self.segment_of(episode) for episode in self.diagnosis.episodes)
        segments = tuple(part for part in parts if part is not None)
        return replace(self, segments=segments, noticed=self._detect_changes())

    def by_place(self, watch: "Callable[[Sequence[_Placed]], Iterable[_Placed]]" = iter) -> Self:
        """Return a copy with ``segments``: each place of a travelling probe identified separately.

        The settings are the same; each place has its own working depth. Places that cannot be
        identified are omitted. A probe that stays at one place has no segments.

        Parameters
        ----------
        watch : callable
            Iterates over the places, for example with a progress bar.
        """
        from palpate.input.preparation.places import divide_by_place

        # Keep the settings, except those that were chosen from these data.
        selection = self.selected or self
        segments = []
        fresh = selection.estimator.replace(**dict.fromkeys(selection.chosen))
        places = list(divide_by_place(self.contact, rejecting=fresh.rejects_outliers))
        for place, contact in watch(places):
            with suppress(RecordingError):
                part = self.selected_law(Data(contact), fresh, trace=self.traced)
                segments.append(replace(part, place=place, query=self.query))
        return replace(self, segments=tuple(segments))

    def hold_out(self) -> Self:
        """Return a copy with a finding: how well the first half predicts the second.

        The law of the first half, selected as this one was, is compared with plain Hunt–Crossley;
        if it predicts worse, it is not to be trusted.
        """
        from palpate.identification.hold_out import check_prediction

        selection = self.selected or self
        fresh = selection.estimator.replace(**dict.fromkeys(selection.chosen))

        def selected(first: Contact, whole: Contact) -> Floats:
            return self.selected_law(Data(first), fresh, trace=False).predicted_force(whole)

        def plain(first: Contact, whole: Contact) -> Floats:
            return self.of(Data(first), VariableProjection(), trace=False).predicted_force(whole)

        finding = check_prediction(self.contact, self.trace.taken, selected, plain)
        return replace(self, findings=(*self.findings, finding))

    def answers(self, estimator: ContactEstimator, trace: Traced) -> bool:
        """Whether :meth:`of` would give the same for its whole contact with an estimator."""
        if self.segments or self.depth is not None or self.traced != trace:
            return False
        settings = self.estimator.settings
        requested = estimator.settings
        chosen = {name: settings[name] for name in self.chosen if requested.get(name) is None}
        return self.method == estimator.method and repr(settings) == repr({**requested, **chosen})

    def segment_of(self, episode: Episode) -> Self | None:
        """Identify an episode of the diagnosis separately; None if that is not possible."""
        smear = self.contact.sample_time * (self.data or Data(self.contact)).filter_samples
        with suppress(RecordingError):
            part = self.contact.window(episode.start + smear, episode.stop - smear)
            result = self.of(Data(part), self.estimator.replace(), trace=self.traced)
            working_depth = self.diagnosis.working_depth
            return replace(result.at_depth(working_depth.depth), query=self.query)
        return None

    def _detect_changes(self) -> Trace:
        """Return the trace with a change detector, if the estimator supports one."""
        settings = self.estimator.settings
        if settings.get("change_detector", self) is not None:
            return self.trace
        watched = self.estimator.replace(change_detector=ChangeDetector())
        return replay(self.contact, watched, self.traced)

    @property
    def flags(self) -> tuple[str, ...]:
        """The findings as text."""
        return tuple(map(str, self.findings))

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.estimator.method

    @property
    def estimate(self) -> Estimate:
        """The final estimate; under the weak prior if it applies."""
        return self.reported(self._whole_estimate)

    def reported(self, estimate: Estimate) -> Estimate:
        """Return an estimate as it is reported: without time only its spring."""
        if not self.contact.timeless:
            return estimate
        from palpate.identification.diagnosis.timeless import SpringEstimate

        return SpringEstimate(estimate)

    @property
    def _whole_estimate(self) -> Estimate:
        """The final estimate; without time it still includes the damper in units of the samples."""
        return self.estimator.estimate() if self.bounded is None else self.bounded

    @property
    def law(self) -> Any:
        """The contact model, SI."""
        return self.estimate.law

    @property
    def fixed(self) -> tuple[str, ...]:
        """Parameters of the law that were fixed, such as a known exponent, and not identified."""
        return self.estimate.fixed

    @property
    def law_verdict(self) -> LawVerdict | None:
        """Model selection: the preferred law, and the evidence.

        For a method that selects a law, its selection. For Hunt–Crossley or Kelvin–Voigt laws of
        other methods, model selection among the common laws; None for other laws.
        """
        return self.diagnosis.law_verdict

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the law's parameters, SI: square roots of the variances.

        0 for a :attr:`fixed` parameter.
        """
        errors: Floats = np.sqrt(np.diag(self.covariance))
        return errors

    @cached_property
    def covariance(self) -> Floats:
        """Joint covariance of the law's parameters, SI, for a correlated residual.

        For methods that assume a white residual (the paper's) it is the covariance of the estimate,
        widened for the correlation of the residual of the samples taken since the last restart. For
        others it is the covariance of the estimate. If the preparation found the surface, the
        change of the parameters when the surface moves one standard deviation is added.
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
        """Correlations of the law's parameters, shape (p, p); NaN without a standard error."""
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
        """RMSE% of the one-step prediction of the force after 0.2 s of contact."""
        return prediction_rmse_percent(self.trace, self.contact.force, self.contact.time_steps)

    @property
    def fit_rmse_percent(self) -> float:
        """RMSE% of the final law, and offset if estimated, over every sample taken.

        With segments, it is that of the law of each segment over the samples it was taken from.
        """
        parts = self.segments or (self,)
        measured = [part.contact.force[part.trace.taken] for part in parts]
        fitted = [part.fitted_force[part.trace.taken] for part in parts]
        return rmse_percent(np.concatenate(measured), np.concatenate(fitted))

    @property
    def fitted_force(self) -> Floats:
        """Force of the final law, and offset if estimated, at every sample, N.

        With segments, it is the force of each segment along its own samples, with its own
        relaxation state, and NaN at samples between them.
        """
        if not self.segments:
            return self.predicted_force(self.contact)
        time = self.contact.time
        fitted = np.full(len(self.contact), np.nan)
        order = np.argsort(time, kind="stable")  # joined recordings may begin at one time
        for segment in self.segments:
            samples = order[np.searchsorted(time, segment.contact.time, sorter=order)]
            fitted[samples] = segment.fitted_force
        return fitted

    def predicted_force(self, contact: Contact) -> Floats:
        """Force of the final law, with its offset, at every sample of a contact, N.

        If the contact begins with the identified samples, it begins in their relaxation state.
        """
        own = self.contact
        same = len(contact) and len(own) and contact.time[0] == own.time[0]
        begins = bool(same and contact.penetration[0] == own.penetration[0])
        return force_along(contact, self.estimate, begins=begins) + self.estimate.offset

    @property
    def violated_fraction(self) -> float:
        """Fraction of contact that violates condition 10; NaN for laws without this condition."""
        if not self.law.has_condition_10:
            return math.nan
        return violated_fraction(self.trace)

    @property
    def changes(self) -> Floats:
        """Times at which a change detector alarmed, s."""
        trace = self.noticed or self.trace
        times: Floats = self.contact.time[trace.status == Status.RESTARTED]
        return times
