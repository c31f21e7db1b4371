"""The compiled recursion of palpate."""

from collections.abc import Sequence
import enum
import types
from typing import Annotated

import numpy
import numpy.typing
from numpy.typing import NDArray

import palpate.force_laws


def kelvin_voigt_force(arg0: float, arg1: float, arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

def extended_kelvin_voigt_force(arg0: float, arg1: float, arg2: float, arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg4: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

def hunt_crossley_force(arg0: float, arg1: float, arg2: float, arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg4: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], /) -> None: ...

class Status(enum.IntEnum):
    """What one ``update`` did with its sample."""

    WAITING = 0
    """No contact so far; nothing was learned."""

    UPDATED = 1
    """In contact; the sample was taken."""

    GUARDED = 2
    """Taken, but forgetting was withheld so that the covariance stays sound."""

    HELD = 3
    """Contact is lost; the estimate is held."""

    RESTARTED = 4
    """
    Taken; the material has changed, and the estimate began anew with the latest samples.
    """

    NOT_FINITE = 5
    """Refused: penetration, velocity or force is NaN or infinite."""

    INVALID_STEP = 6
    """Refused: ``dt`` is not a positive, finite time."""

    OUT_OF_RANGE = 7
    """Refused: finite, but too large for the arithmetic."""

class Estimate:
    """
    What an estimator knows now.

    Attributes
    ----------
    law : KelvinVoigt, ExtendedKelvinVoigt or HuntCrossley
        The contact model, in SI.
    covariance : numpy.ndarray, shape (p, p)
        Joint covariance of the law's parameters, in their order and in SI: the recursion's P times
        the variance of its residual, taken from θ to the law by the delta method.
    standard_errors : numpy.ndarray, shape (p,)
        Square roots of its diagonal.
    offset, offset_standard_error : float
        Force that the sensor shows without contact, N, by methods that estimate it; else 0.
    surface, surface_standard_error : float
        Where the material begins, in the coordinate of the penetration, m, by methods that search for
        it; else 0.
    joint_covariance : numpy.ndarray, shape (p + 1, p + 1)
        Covariance of the law's parameters and, last, the offset.
    flags : tuple of str
        What this motion left undetermined, and what motion would help.
    valid : bool
        Condition 10, |v| < 0.1 K/B, at the last sample taken. Always true for laws without a
        logarithm.
    validity_margin : float
        1 − |v B/K| / 0.1: 1 at rest, 0 at the limit, negative beyond it.
    status : Status
        Of the last sample that was not refused.
    samples : int
        Samples taken.
    guarded : int
        Of them, how many the covariance guard touched (``docs/numerics.md``).
    restarts : int
        How often a change of the material was detected and the estimate began anew.
    """

    @property
    def law(self) -> palpate.force_laws.KelvinVoigt | palpate.force_laws.ExtendedKelvinVoigt | palpate.force_laws.HuntCrossley:
        """The contact model, SI."""

    @property
    def parameters(self) -> numpy.typing.NDArray[numpy.float64]:
        """The law's parameters in its own order, SI."""

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
        """Its standard error, N; 0 where it is not estimated."""

    @property
    def surface(self) -> float:
        """Where the material begins, m."""

    @property
    def surface_standard_error(self) -> float:
        """Its standard error, m; 0 where it is not searched for."""

    @property
    def flags(self) -> tuple[str, ...]:
        """What this motion left undetermined, and what motion would help."""

    @property
    def valid(self) -> bool:
        """Whether condition 10 held at the last sample taken."""

    @property
    def validity_margin(self) -> float:
        """
        Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it.
        """

    @property
    def status(self) -> Status:
        """Of the last sample that was not refused."""

    @property
    def samples(self) -> int:
        """Samples taken."""

    @property
    def guarded(self) -> int:
        """Of them, those that the guard touched."""

    @property
    def restarts(self) -> int:
        """How often the estimate began anew."""

    def __repr__(self) -> str: ...

class LeastSquares:
    def __init__(self, arg0: int, arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], /) -> None: ...

    def update(self, regressor: Sequence[float] | numpy.typing.NDArray[numpy.float64], output: float, forgetting_factor: float = 1.0, perturbation: float = 0.0) -> Status:
        """
        Take one row y = φᵀθ (eq. 13): the regressor φ, a sequence of ``order`` numbers, the
        output y, the forgetting factor λ in (0, 1] of this sample and what is added to the diagonal of P
        before it is divided by λ. Numbers out of their range are refused with a :class:`Status`.
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
        """Rows taken."""

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class KelvinVoigtRLS:
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: Sequence[float], arg3: Sequence[float], arg4: Sequence[float], arg5: Sequence[float], arg6: Sequence[float], arg7: float, /) -> None: ...

    def update(self, penetration: float, velocity: float, force: float, dt: float | None = None) -> Status:
        """
        Take one sample, and say with a :class:`Status` what was done with it.

        Never raises on data and never allocates; the sample is taken whole or not at all.

        Parameters
        ----------
        penetration : float
            m, positive inside the material.
        velocity : float
            m/s, positive while penetrating.
        force : float
            N, compression positive.
        dt : float, optional
            Time since the previous sample, s; ``sample_time`` unless given.
        """

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class ExtendedKelvinVoigtRLS:
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: Sequence[float], arg3: Sequence[float], arg4: Sequence[float], arg5: Sequence[float], arg6: Sequence[float], arg7: float, /) -> None: ...

    def update(self, penetration: float, velocity: float, force: float, dt: float | None = None) -> Status:
        """
        Take one sample, and say with a :class:`Status` what was done with it.

        Never raises on data and never allocates; the sample is taken whole or not at all.

        Parameters
        ----------
        penetration : float
            m, positive inside the material.
        velocity : float
            m/s, positive while penetrating.
        force : float
            N, compression positive.
        dt : float, optional
            Time since the previous sample, s; ``sample_time`` unless given.
        """

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class SingleStageRLS:
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: Sequence[float], arg3: Sequence[float], arg4: Sequence[float], arg5: Sequence[float], arg6: Sequence[float], arg7: float, /) -> None: ...

    def update(self, penetration: float, velocity: float, force: float, dt: float | None = None) -> Status:
        """
        Take one sample, and say with a :class:`Status` what was done with it.

        Never raises on data and never allocates; the sample is taken whole or not at all.

        Parameters
        ----------
        penetration : float
            m, positive inside the material.
        velocity : float
            m/s, positive while penetrating.
        force : float
            N, compression positive.
        dt : float, optional
            Time since the previous sample, s; ``sample_time`` unless given.
        """

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class DoubleStageRLS:
    def __init__(self, arg0: Sequence[float], arg1: Sequence[Sequence[float]], arg2: Sequence[float], arg3: Sequence[float], arg4: Sequence[float], arg5: Sequence[float], arg6: Sequence[float], arg7: float, /) -> None: ...

    def update(self, penetration: float, velocity: float, force: float, dt: float | None = None) -> Status:
        """
        Take one sample, and say with a :class:`Status` what was done with it.

        Never raises on data and never allocates; the sample is taken whole or not at all.

        Parameters
        ----------
        penetration : float
            m, positive inside the material.
        velocity : float
            m/s, positive while penetrating.
        force : float
            N, compression positive.
        dt : float, optional
            Time since the previous sample, s; ``sample_time`` unless given.
        """

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class VariableProjection:
    def __init__(self, arg0: float, arg1: Sequence[float], arg2: bool, arg3: float, arg4: Sequence[float] | None, arg5: Sequence[float], arg6: Sequence[float], arg7: Sequence[float], arg8: Sequence[float], arg9: float, /) -> None: ...

    update: types.MethodDescriptorType = ...

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...

class DriftTracking:
    def __init__(self, arg0: float, arg1: Sequence[float], arg2: bool, arg3: float, arg4: Sequence[float], arg5: Sequence[float], arg6: Sequence[float], arg7: Sequence[float], arg8: float, /) -> None: ...

    update: types.MethodDescriptorType = ...

    def predict(self, penetration: float, velocity: float) -> float:
        """
        Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the present estimate; no law acts out of contact.
        """

    def estimate(self) -> Estimate:
        """What is known now, as an :class:`Estimate`."""

    def reset(self) -> None:
        """Forget everything but the settings."""

    def _replay(self, arg0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg2: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], arg3: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None, arg4: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg5: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg6: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg7: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu')], arg8: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu')], /) -> None: ...

    def _state(self) -> bytes: ...

    def _restore(self, arg: bytes, /) -> None: ...
