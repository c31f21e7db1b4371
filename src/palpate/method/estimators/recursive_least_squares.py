"""The paper's recursive estimators: Python settings for the compiled recursion.

Their θ and P are in the units of the ``scale``.
"""

from typing import Any, ClassVar, Literal

from numpy.typing import ArrayLike

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.findings import Check, Finding
from palpate.force_laws import ExtendedKelvinVoigt, ForceLaw, HuntCrossley, KelvinVoigt
from palpate.method.estimators.contact_estimator import (
    CompiledEstimator,
    Rejection,
    check_exponent,
    loop_settings,
)
from palpate.method.estimators.estimate import Estimate
from palpate.method.settings import (
    SAMPLE_TIME,
    ChangeDetector,
    ContactGate,
    FadingForgetting,
    Forgetting,
    Scale,
    SelfPerturbation,
)
from palpate.validation import arguments, covariance_matrix, instance, number_in, shown


class RecursiveLeastSquaresEstimator(CompiledEstimator):
    """Base class of the paper's recursive estimators, with the settings that they share.

    Parameters
    ----------
    initial : force law, optional
        Initial estimate, SI. Default: small values.
    initial_covariance : float or array_like, optional
        P₀ of θ, in units of ``scale``: a scalar, p variances or a p × p matrix, variances in
        [1e-20, 1e20]. Larger values start faster and overshoot more. Default: the method's own.
    forgetting : ConstantForgetting or FadingForgetting, optional
        λ over time. Default: the paper's fading forgetting.
    perturbation : SelfPerturbation, optional
        Raises the covariance when the material changes (section VII). Default: none.
    change_detector : ChangeDetector, optional
        Restarts the estimate when the probe touches another material. Default: none.
    outlier_rejection : OutlierRejection or False, optional
        Rejects dropouts and spikes. Default (None): off, but on in :func:`identify`; False: off.
    gate : ContactGate, optional
        Selects the samples in contact. Default: those with x > 0 and F > 0; in :func:`identify`, a
        gate chosen from the data.
    sample_time : float
        Time between samples when ``update`` gets no ``dt``, s, in (0, 1e6]. Default: 1 ms.
    scale : Scale, optional
        Units of the arithmetic. Default: SI units; in :func:`identify` chosen from the data.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.KelvinVoigtRLS(initial=palpate.KelvinVoigt(K=1000.0, B=5.0))
    >>> isinstance(estimator, palpate.RecursiveLeastSquaresEstimator)
    True
    >>> estimator.predict(0.01, 0.0)
    10.0
    """

    __slots__ = ()
    minimises: ClassVar[Literal["force", "logarithm"] | None] = "force"
    default_initial: ClassVar[ForceLaw]
    default_covariance: ClassVar[ArrayLike]

    def __init__(
        self,
        *,
        initial: ForceLaw | None = None,
        initial_covariance: "ArrayLike | None" = None,
        forgetting: Forgetting | None = None,
        perturbation: SelfPerturbation | None = None,
        change_detector: ChangeDetector | None = None,
        outlier_rejection: Rejection = None,
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._begin(arguments(locals()))

    def _begin(self, settings: dict[str, Any]) -> None:
        """Fill in the method's defaults, keep the settings and make the recursion."""
        defaults = {"initial": self.default_initial, "forgetting": FadingForgetting()}
        defaults["initial_covariance"] = self.default_covariance
        self._settings = {  # type: ignore[misc]  # a slot of each subclass: two bases with slots would clash
            name: defaults.get(name) if value is None else value for name, value in settings.items()
        }
        super().__init__(*self._plain_settings())

    def _plain_settings(self) -> tuple[Any, ...]:
        """Check the settings and return them for the compiled constructor."""
        given = self._settings
        instance("initial", given["initial"], self.law_type)
        for name, value in given["initial"].as_dict().items():
            number_in(f"initial {name}", value, -1e100, 1e100)
        instance("perturbation", given["perturbation"], (SelfPerturbation, type(None)))
        perturbation = given["perturbation"] or SelfPerturbation(gain=0.0, sensitivity=0.0)
        start = given["initial"].parameters.tolist()
        covariance = covariance_matrix(
            "initial_covariance",
            given["initial_covariance"],
            len(start),
        )
        exponent = check_exponent(given.get("exponent"))  # only Hunt–Crossley estimators have it
        if exponent is not None:
            start[2] = exponent
        loop = loop_settings(given, Scale(), perturbation._plain())
        return start, covariance.tolist(), exponent is not None, loop


class HuntCrossleyRLS(RecursiveLeastSquaresEstimator):
    """Base class of the estimators for the Hunt–Crossley law: the exponent may be known.

    Parameters
    ----------
    exponent : float, optional
        Known n, in [0.1, 10], from the tip's shape: 1.5 for a sphere. It stays fixed, with a
        standard error of 0; the exponent of ``initial`` and its variance have no effect. Default:
        identified.
    initial, initial_covariance : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    forgetting, perturbation, change_detector, outlier_rejection, gate : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    sample_time, scale : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    """

    __slots__ = ()

    def __init__(
        self,
        *,
        exponent: float | None = None,
        initial: ForceLaw | None = None,
        initial_covariance: "ArrayLike | None" = None,
        forgetting: Forgetting | None = None,
        perturbation: SelfPerturbation | None = None,
        change_detector: ChangeDetector | None = None,
        outlier_rejection: Rejection = None,
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._begin(arguments(locals()))


# With white noise of 0.05 N and five seconds of three sines, the 95 % interval of the stiffness at
# working depth contains the truth in 55 of 100 cases on the ball and in none on the sponge.
TOO_SMALL = Check.STANDARD_ERRORS.finding(
    "the standard errors of this estimate are too small: they assume white noise of the logarithm "
    "of the force, and no offset",
    "use VariableProjection, or identify the whole recording, whose diagnosis has wider ones",
)


class SingleStageEstimate(Estimate):
    """An estimate from the logarithm of the force, with a finding on its standard errors."""

    __slots__ = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Parameters that the motion does not identify, and the too small standard errors."""
        return (*self.motion_findings, TOO_SMALL) if self.samples else self.motion_findings


class SingleStageRLS(HuntCrossleyRLS, _core.SingleStageRLS):
    """The paper's method: the Hunt–Crossley law by a regression of the logarithm of the force.

    y = ln F, φ = [1, v, ln x], θ = [ln K, B/K, n]   (eqs. 9, 12, 13)

    Valid while abs(v) < 0.1 K/B (eq. 10), which every estimate reports; beyond it K and B are
    biased low. Low-force samples weigh as much as high-force ones, so set the gate above the noise:
    an estimate has a flag if light contact makes its standard errors too small by 1.4 or more. They
    are too small in general, as a finding of each estimate says: like the paper's, they assume
    white noise of ln F and no force offset (``docs/reference/numerics.md``).

    With a known exponent, y = ln F − n ln x, φ = [1, v], θ = [ln K, B/K].

    Parameters
    ----------
    exponent : float, optional
        Known n, in [0.1, 10], from the tip's shape: 1.5 for a sphere. It stays fixed, with a
        standard error of 0. Default: identified.
    initial : HuntCrossley, optional
        Initial estimate, SI, with K > 0. Default: small values.
    initial_covariance : float or array_like, optional
        Covariance of θ. Default: variances of 1e3.
    forgetting, perturbation, change_detector, outlier_rejection, gate : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    sample_time, scale : optional
        As in :class:`RecursiveLeastSquaresEstimator`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.SingleStageRLS(exponent=1.0)
    >>> result = palpate.identify("examples/recordings/ball.csv", estimator)
    >>> print(result.stiffness.combined.format("N/m"))
    1997.0 ± 2.7 N/m
    """

    __slots__ = ("_settings",)
    method = "single-stage"
    estimate_type = SingleStageEstimate
    law_type = HuntCrossley
    minimises = "logarithm"
    needs_condition_10 = True
    default_initial = HuntCrossley.from_parameters(_core.defaults["SingleStageRLS"]["initial"])
    default_covariance = _core.defaults["SingleStageRLS"]["initial_covariance"]

    def _plain_settings(self) -> tuple[Any, ...]:
        plain = super()._plain_settings()
        coefficient = self._settings["initial"].K
        if not coefficient > 0.0:
            raise InvalidParameterError(
                f"initial.K must be above 0 (its logarithm is taken), not {coefficient!r}"
            )
        return plain


class DoubleStageRLS(HuntCrossleyRLS, _core.DoubleStageRLS):
    """The double-stage method of Diolaiti, Melchiorri & Stramigioli (2005).

    Stage 1: y = F, φ = [x^n̂, x^n̂ v] → K̂, B̂ (eq. 3).
    Stage 2: y = ln(F / (K̂ + B̂ v)), φ = ln x → n̂ (eq. 4), skipped while K̂ + B̂ v ≤ 0.

    Kept unchanged for comparison: where it ends depends on its start, because errors in K and n
    compensate each other. With the paper's fading λ, starts 1 % off the truth end 8 % apart. With a
    constant λ = 0.99 and variances of 10, starts 10 % off end 2 % apart after a minute.

    With a known exponent only stage 1 remains: linear least squares, which does not stall.

    Parameters
    ----------
    exponent : float, optional
        Known n, as in :class:`SingleStageRLS`. Default: identified.
    initial : HuntCrossley, optional
        Initial estimate, SI. Default: small values.
    initial_covariance : float or array_like, optional
        Covariance of [K, B] and n, zero between the stages. Default: variances of 1e8, 1e8, 1e3.
    forgetting, perturbation, change_detector, outlier_rejection, gate : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    sample_time, scale : optional
        As in :class:`RecursiveLeastSquaresEstimator`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range, or the stages covary.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv", palpate.DoubleStageRLS())
    >>> round(result.law.K, -1), round(result.law.n, 2)
    (2000.0, 1.0)
    """

    __slots__ = ("_settings",)
    method = "double-stage"
    law_type = HuntCrossley
    default_initial = HuntCrossley.from_parameters(_core.defaults["DoubleStageRLS"]["initial"])
    default_covariance = _core.defaults["DoubleStageRLS"]["initial_covariance"]

    def _plain_settings(self) -> tuple[Any, ...]:
        plain = super()._plain_settings()
        covariance = plain[1]
        if covariance[0][2] or covariance[1][2]:
            raise InvalidParameterError(
                "initial_covariance must be zero between [K, B] and n, because the two stages are "
                f"independent, not {shown(self._settings['initial_covariance'])}"
            )
        return plain


class KelvinVoigtRLS(RecursiveLeastSquaresEstimator, _core.KelvinVoigtRLS):
    """The linear contact model by recursive least squares.

    y = F, φ = [x, v], θ = [K, B] in eq. 13. The simplest method and the fastest to converge; its
    law is wrong where stiffness grows with depth.

    Parameters
    ----------
    initial : KelvinVoigt, optional
        Initial estimate, SI. Default: small values.
    initial_covariance : float or array_like, optional
        Covariance of θ. Default: variances of 1e8.
    forgetting, perturbation, change_detector, outlier_rejection, gate : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    sample_time, scale : optional
        As in :class:`RecursiveLeastSquaresEstimator`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv", palpate.KelvinVoigtRLS())
    >>> round(result.law.K, -1), round(result.law.B, 1)  # N/m and N·s/m
    (2000.0, 17.4)
    """

    __slots__ = ("_settings",)
    method = "kelvin-voigt"
    law_type = KelvinVoigt
    default_initial = KelvinVoigt.from_parameters(_core.defaults["KelvinVoigtRLS"]["initial"])
    default_covariance = _core.defaults["KelvinVoigtRLS"]["initial_covariance"]


class ExtendedKelvinVoigtRLS(RecursiveLeastSquaresEstimator, _core.ExtendedKelvinVoigtRLS):
    """The extended Kelvin–Voigt model by recursive least squares.

    y = F, φ = [x, x², v], θ = [K₁, K₂, B] in eq. 13, for the law of eq. 14.

    Parameters
    ----------
    initial : ExtendedKelvinVoigt, optional
        Initial estimate, SI. Default: small values.
    initial_covariance : float or array_like, optional
        Covariance of θ. Default: variances of 1e10; in SI x² is so small that under smaller ones
        K₂ stays at its start.
    forgetting, perturbation, change_detector, outlier_rejection, gate : optional
        As in :class:`RecursiveLeastSquaresEstimator`.
    sample_time, scale : optional
        As in :class:`RecursiveLeastSquaresEstimator`.

    Raises
    ------
    InvalidParameterError
        A setting is outside its range.

    Examples
    --------
    >>> import palpate
    >>> result = palpate.identify("examples/recordings/ball.csv", palpate.ExtendedKelvinVoigtRLS())
    >>> round(result.law.stiffness_at(5e-3), -1)  # N/m
    2000.0
    """

    __slots__ = ("_settings",)
    method = "extended-kelvin-voigt"
    law_type = ExtendedKelvinVoigt
    default_initial = ExtendedKelvinVoigt.from_parameters(
        _core.defaults["ExtendedKelvinVoigtRLS"]["initial"]
    )
    default_covariance = _core.defaults["ExtendedKelvinVoigtRLS"]["initial_covariance"]
