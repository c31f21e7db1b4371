"""The compiled recursion of palpate."""

from collections.abc import Sequence
import enum
from typing import Annotated, Any, overload

import numpy
import numpy.typing
from numpy.typing import NDArray


__version__: str

defaults: dict[str, dict[str, Any]]

def kelvin_voigt_force(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

def extended_kelvin_voigt_force(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

def hunt_crossley_force(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

def generalised_hunt_crossley_force(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

class Status(enum.IntEnum):
    """
    Result of one ``update``.

    Examples
    --------
    >>> import palpate
    >>> estimator = palpate.KelvinVoigtRLS()
    >>> estimator.update(0.001, 0.1, 2.0)
    Status.UPDATED
    >>> estimator.update(0.001, 0.1, float("nan")) is palpate.Status.NOT_FINITE
    True
    """

    WAITING = 0
    """No contact so far."""

    UPDATED = 1
    """In contact; the sample was taken."""

    GUARDED = 2
    """
    Taken, but without forgetting, to keep the covariance positive definite.
    """

    HELD = 3
    """Contact is lost; the estimate is held."""

    RESTARTED = 4
    """
    Taken; the material has changed, and the estimate restarted from the latest samples.
    """

    NOT_FINITE = 5
    """Refused: penetration, velocity or force is NaN or infinite."""

    INVALID_STEP = 6
    """Refused: ``dt`` is not a positive, finite time."""

    OUT_OF_RANGE = 7
    """Refused: finite, but too large for the arithmetic."""

    REJECTED = 8
    """Rejected as an outlier."""

class ResponseNumber:
    """A number that a controller may act on while it is usable."""

    @property
    def value(self) -> float:
        """SI; within physical bounds if not usable."""

    @property
    def standard_error(self) -> float:
        """SI."""

    @property
    def usable(self) -> bool:
        """Whether the samples determine it."""

class EstimateValue:
    """The numbers of an estimate, SI."""

    @overload
    def __init__(self, arg: EstimateValue, /) -> None: ...

    @overload
    def __init__(self, parameters: numpy.typing.NDArray[numpy.float64], covariance: numpy.typing.NDArray[numpy.float64], status: Status, samples: int, validity_margin: float = 1.0, guarded: int = 0, restarts: int = 0, rejected: int = 0, offset: float = 0.0) -> None: ...

    @property
    def parameters(self) -> numpy.typing.NDArray[numpy.float64]:
        """The law's parameters, in the law's order, SI."""

    @property
    def covariance(self) -> numpy.typing.NDArray[numpy.float64]:
        """Joint covariance of the law's parameters, SI."""

    @property
    def standard_errors(self) -> numpy.typing.NDArray[numpy.float64]:
        """Standard errors of the law's parameters, SI."""

    @property
    def joint_covariance(self) -> numpy.typing.NDArray[numpy.float64]:
        """Covariance of the law's parameters and, last, the offset, SI."""

    @property
    def offset(self) -> float:
        """Force without contact, N."""

    @property
    def offset_standard_error(self) -> float:
        """Its standard error, N; 0 if not estimated."""

    @property
    def surface(self) -> float:
        """Surface position, m."""

    @property
    def surface_standard_error(self) -> float:
        """Its standard error, m; 0 if not estimated."""

    @property
    def stiffness(self) -> ResponseNumber:
        """
        Stiffness K′ = ∂F/∂x of small oscillations at ``depth`` and ``frequency``, N/m.
        """

    @property
    def damping(self) -> ResponseNumber:
        """
        Damping B′ = ∂F/∂v of small oscillations at ``depth`` and ``frequency``, N·s/m.
        """

    @property
    def depth(self) -> float:
        """Penetration of ``stiffness`` and ``damping``, m."""

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion so far, rad/s."""

    @property
    def age(self) -> float:
        """
        Time since the latest sample that ``stiffness`` and ``damping`` contain, s.
        """

    @property
    def _checks(self) -> int: ...

    @property
    def _flags(self) -> int: ...

    @property
    def validity_margin(self) -> float:
        """
        Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it.
        """

    @property
    def status(self) -> Status:
        """Status of the last sample that was neither refused nor rejected."""

    @property
    def samples(self) -> int:
        """Number of samples taken."""

    @property
    def guarded(self) -> int:
        """Number of samples at which the covariance guard acted."""

    @property
    def restarts(self) -> int:
        """Number of restarts after a change of the material."""

    @property
    def rejected(self) -> int:
        """Number of samples rejected as outliers."""

class LeastSquares:
    def __init__(self, arg0: int, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], /) -> None: ...

    def update(self, regressor: Sequence[float] | numpy.typing.NDArray[numpy.float64], output: float, forgetting_factor: float = 1.0, perturbation: float = 0.0) -> Status:
        """
        Take one row y = φᵀθ (eq. 13): the regressor φ, a sequence of ``order`` numbers, the
        output y, the forgetting factor λ in (0, 1] of this sample, and a perturbation that is added to the
        diagonal of P before division by λ. Returns a :class:`Status`, which names numbers out of range.
        """

    def predict(self, regressor: Sequence[float] | numpy.typing.NDArray[numpy.float64]) -> float:
        """φᵀθ."""

    @property
    def parameters(self) -> numpy.typing.NDArray[numpy.float64]:
        """θ."""

    @property
    def covariance(self) -> numpy.typing.NDArray[numpy.float64]:
        """P. The covariance of θ is ``noise_variance`` times it."""

    @property
    def noise_variance(self) -> float:
        """
        Variance of y about φᵀθ; 1 until there are more samples than coefficients.
        """

    @property
    def samples(self) -> int:
        """Number of rows taken."""

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

def long_run_covariance(scores: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], residual: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], shares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], fitted: float, result: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')]) -> None:
    """
    Fills the covariance of Σ u e for scores u by rows and a correlated residual e.
    """

def fit_curves(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg3: Sequence[float], arg4: bool, arg5: float, arg6: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg7: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg8: Sequence[float] | None, arg9: Sequence[float], arg10: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg11: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg12: Annotated[NDArray[numpy.int64], dict(order='C', device='cpu')], arg13: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], arg14: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')] | None, arg15: int, arg16: str = '', /) -> None:
    """
    The core of palpate.method.estimators.batch_fit.fit_curves, one row per curve.
    """

def fit_samples(arg0: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], arg2: Sequence[float], arg3: Sequence[float], /) -> list[float]:
    """(k, c, n, F₀, d) of the least squares of samples, rows of x, v and F."""

class RecursiveEstimator:
    def update(self, penetration: float, velocity: float, force: float, dt: float | None = None) -> Status:
        """
        Take one sample and return its :class:`Status`.

        Never raises on data, never allocates; a refused sample changes nothing.

        Parameters
        ----------
        penetration : float
            m, positive inside the material.
        velocity : float
            m/s, positive while penetrating.
        force : float
            N, compression positive.
        dt : float, optional
            Time since the previous sample, s. Default: ``sample_time``.
        """

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the present estimate predicts for the sensor at a penetration [m] and velocity [m/s]; out of contact only the offset.
        """

    def _estimate(self, kind: type, depth: float, bounds: Sequence[float]) -> Any: ...

    def reset(self) -> None:
        """Forget everything but the settings."""

    def leave_contact(self) -> None:
        """
        End the contact, as at the end of a recording: the estimate is held until the next contact.
        """

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], arg9: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class KelvinVoigtRLS(RecursiveEstimator):
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: bool, arg3: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

class ExtendedKelvinVoigtRLS(RecursiveEstimator):
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: bool, arg3: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

class SingleStageRLS(RecursiveEstimator):
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: bool, arg3: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

class DoubleStageRLS(RecursiveEstimator):
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: bool, arg3: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

class VariableProjection(RecursiveEstimator):
    def __init__(self, arg0: tuple[float, Sequence[float], float, bool, float], arg1: tuple[Sequence[float] | None, float], arg2: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

    def _unround_as(self, earlier: VariableProjection) -> bool:
        """
        Take the rounding of the force by the law that an earlier one has found in the same samples; false if there is none.
        """

class DriftTracking(RecursiveEstimator):
    def __init__(self, arg0: tuple[float, Sequence[float], float, bool, float], arg1: Sequence[float], arg2: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

class SpectrumValue:
    """A spectrum of relaxation times."""

    def numbers(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], list[tuple[float, float]]]: ...

def relaxation_branches(alpha: float, shortest_time: float, longest_time: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]: ...

def generalised_force_along(elastic: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], stiffnesses: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], time_steps: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], penetration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], state: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], force: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')]) -> None: ...

def relaxation_states(exponent: float, times: numpy.typing.NDArray[numpy.float64], time_steps: numpy.typing.NDArray[numpy.float64], penetration: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]: ...

class ViscoelasticContact(RecursiveEstimator):
    def __init__(self, arg0: int, arg1: float, arg2: bool, arg3: float, arg4: float, arg5: float, arg6: tuple[Sequence[float], Sequence[float], Sequence[float] | None, float | None, Sequence[float], Sequence[float], float], /) -> None: ...

    def finish_pending(self) -> None:
        """
        Compute verdict and estimate from all samples so far, immediately, in about 1 ms. Otherwise this work is spread over the next samples.
        """

    def _evidence(self) -> tuple[list[tuple[int, float, float]], float, float, int, float, float, bool, float]: ...

    def _spectrum(self) -> SpectrumValue: ...

    def _beside(self, candidate: int, without: int, free_damping: bool) -> tuple[float, numpy.typing.NDArray[numpy.float64], float]: ...

class PreparedSample(tuple[float, float, float, float]):
    """A sample of a while ago: ``estimator.update(*sample)`` takes it."""

    @property
    def penetration(self) -> float:
        """m, as it was measured."""

    @property
    def velocity(self) -> float:
        """m/s, positive while penetrating."""

    @property
    def force(self) -> float:
        """N, as it was measured, less the tare."""

    @property
    def dt(self) -> float:
        """s, since the sample given before."""

    @property
    def time(self) -> float:
        """s, when it was: by the times that were given, else since the first call."""

class PayloadCompensation:
    def __init__(self, arg0: float, arg1: int, arg2: bool, arg3: float, arg4: float, arg5: float, arg6: Sequence[float], arg7: Sequence[float], arg8: Sequence[Sequence[float]], arg9: Sequence[Sequence[float]], arg10: Sequence[float], /) -> None: ...

    def update(self, position: Sequence[float] | NDArray[numpy.float64], orientation: Sequence[float] | Sequence[Sequence[float]] | NDArray[numpy.float64], wrench: Sequence[float] | NDArray[numpy.float64], time: float) -> Status:
        """
        Take one measured sample. If the result is ``UPDATED``, :attr:`position`, :attr:`force`,
        :attr:`torque` and :attr:`time` are those of :attr:`delay` ago.

        Never raises on data; a refused sample changes nothing.

        Parameters
        ----------
        position : sequence of 3 floats
            Origin of the pose in the base, m.
        orientation : sequence of 4 floats or of 3 rows
            Unit quaternion x, y, z, w, or rotation matrix, of the pose in the base.
        wrench : sequence of 6 or 3 floats
            Force, N, and torque, N·m, as the sensor reads them, in its axes; the torque may be missing.
        time : float
            s, by any clock.

        Returns
        -------
        Status
            ``UPDATED``; ``WAITING`` (no sample is ready); ``RESTARTED`` (the first sample of a new window,
            after a gap of ten ``sample_time`` or a jump of the clock); ``NOT_FINITE``, ``INVALID_STEP`` or
            ``OUT_OF_RANGE`` (refused).
        """

    def start_tare(self) -> None:
        """Begin a tare: keep the tool in free air."""

    def finish_tare(self) -> bool:
        """
        Add the mean wrench since :meth:`start_tare` to the bias; return whether there is one.
        """

    def reset(self) -> None:
        """Forget everything but the settings."""

    @property
    def delay(self) -> float:
        """Delay of the output, s."""

    @property
    def force(self) -> tuple[float, float, float]:
        """Force of the environment on the tool, N."""

    @property
    def torque(self) -> tuple[float, float, float]:
        """Torque about the origin of the sensor, N·m."""

    @property
    def position(self) -> tuple[float, float, float]:
        """Origin of the pose, m."""

    @property
    def time(self) -> float:
        """Time of the output, s."""

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class OnlinePreparation:
    def __init__(self, arg0: float, arg1: int, arg2: float, arg3: bool, arg4: float, arg5: float, arg6: float, arg7: bool, arg8: bool, arg9: Sequence[float], arg10: float, /) -> None: ...

    def update(self, position: float | Sequence[float] | NDArray[numpy.float64], force: float | Sequence[float] | NDArray[numpy.float64], time: float | None = None) -> PreparedSample | None:
        """
        Take one measured sample, and return the one that is now ready, of :attr:`delay` ago.

        Returns None if none is ready; :attr:`status` has the reason. Never raises on data; a refused
        sample changes nothing.

        Parameters
        ----------
        position : float or sequence of 3 floats
            m, along the contact normal and growing into the material; with a ``direction`` a vector.
        force : float or sequence of 3 floats
            N, compression positive; with a ``direction`` a vector.
        time : float, optional
            s, by any clock. Default: ``sample_time`` after the previous call.
        """

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg3: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.int64], dict(order='C', device='cpu')], /) -> int: ...

    def interrupt(self) -> None:
        """Start a new window: the next sample does not continue the latest one."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    @property
    def status(self) -> Status:
        """Status of the latest sample."""

    @property
    def delay(self) -> float:
        """Delay of the returned samples, s, if none is missing."""

    @property
    def tare(self) -> float:
        """
        The mean force of the first ``tare_time``, N, which is subtracted; NaN until it is known.
        """

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

def noise_of(values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> float:
    """
    Standard deviation of white noise on a smooth signal, from its fourth differences.
    """

def step_of(values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> float:
    """
    Median gap between the distinct values of a channel; 0 for a constant one.
    """

def resolutions(penetration: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], result: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], threads: int) -> None:
    """
    Fills, for contacts as rows, twice the noise of the penetration including its rounding, m; NaN without noise and rounding.
    """

def largest_of(values: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> float:
    """99.9th percentile of the absolute values; 0 if there are none."""

def mark_spikes(values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], screened: bool, marks: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], threads: int) -> None:
    """
    Marks the spikes of each row; with screening, only in rows where a sample differs from its two neighbours as a spike does.
    """

def simulate_touches(loops: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], weights: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], outcomes: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], forces: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], threads: int) -> None:
    """
    Runs a control loop that touches a material, one a row of the numbers of TouchingLoop; fills the five numbers of TouchOutcome, and the force at each sample.
    """

SPLINE_WINDOW: float = 5.1398

SPLINE_PAIRS: int = 9

def add_spline_changes(time: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], position: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], step: float, sums: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')]) -> None:
    """
    Adds how much the velocities of a smoothing spline change from each penalty of the ladder to the next, and then their own size, as sums of squares per usual step.
    """

def choose_spline(sums: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], longest: float) -> float:
    """
    Penalty, over the cube of the usual step, by these sums; as smooth at most as a parabola through so many samples.
    """

def spline_velocity(time: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], position: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], step: float, penalty: float, velocity: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')]) -> None:
    """
    Fills the slopes, m/s, at the samples of the cubic smoothing spline of a penalty over the cube of the usual step, s.
    """

def spline_rows(time: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], position: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], step: float, longest: float, velocity: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], penalty: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], threads: int) -> None:
    """
    Chooses the spline of each row, and fills velocities and penalties; NaN for a row that is interpolated.
    """

def find_knots(position: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> list[int]:
    """
    Every how many samples a position was measured, 1 unless it is interpolated linearly between; and the first such sample.
    """

def end_of_range(time: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], penetration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], force: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], parameters: Sequence[float]) -> float:
    """
    Force at which the sensor saturates, infinite if it does not, from a contact below its surface and the parameters of its Hunt-Crossley law.
    """

def gate_of(penetration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], force: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> list[float]:
    """The three settings of a contact gate for a contact, SI."""

def working_depths(penetration: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], force: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], surfaces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], result: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], threads: int) -> None:
    """
    Fills, for contacts as rows, median and largest penetration below the surface in firm contact by each one's gate, m; NaN if there is none.
    """
