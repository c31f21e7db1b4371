"""The face that every estimator of a contact shows."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.errors import InvalidParameterError
from palpate.force_laws import ForceLaw
from palpate.settings import ChangeDetector, ContactGate, Scale
from palpate.trace import Trace
from palpate.validation import Floats, instance, number_in, signal, signals


class ContactEstimator:
    """What every estimator shares: samples one at a time, or arrays by the same recursion.

    Its subclasses are the methods.
    """

    __slots__ = ()
    method: ClassVar[str]
    law_type: ClassVar[type[ForceLaw]]

    if TYPE_CHECKING:  # the compiled class brings these
        _settings: dict[str, Any]
        _replay: Callable[..., None]
        _state: Callable[[], bytes]
        _restore: Callable[[bytes], None]

        def update(
            self, penetration: float, velocity: float, force: float, dt: float | None = None
        ) -> _core.Status:
            """Take one sample; the compiled method says how."""

        def predict(self, penetration: float, velocity: float) -> float:
            """Force [N] of the present law."""

        def estimate(self) -> _core.Estimate:
            """What is known now."""

        def reset(self) -> None:
            """Forget everything but the settings."""

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments."""
        return dict(self._settings)

    def replay(
        self,
        penetration: ArrayLike,
        velocity: ArrayLike,
        force: ArrayLike,
        dt: ArrayLike | None = None,
    ) -> Trace:
        """Take arrays sample by sample, as ``update`` would, and write everything down.

        Parameters
        ----------
        penetration, velocity, force : array_like, shape (k,)
            m, m/s and N.
        dt : float or array_like, shape (k,), optional
            Time since the previous sample, s; ``sample_time`` unless given.

        Raises
        ------
        InvalidParameterError
            Arrays of different length, of the wrong type or not one-dimensional.
        """
        x, v, f = signals(penetration=penetration, velocity=velocity, force=force)
        steps: Floats | None = None
        if dt is not None:
            one = np.isscalar(dt) or (isinstance(dt, np.ndarray) and dt.ndim == 0)
            steps = signal("dt", np.array([dt]) if one else dt)
            if not one and steps.size != x.size:
                raise InvalidParameterError(
                    "arrays must have the same length: "
                    f"penetration has {x.size}, dt has {steps.size}"
                )
        trace = Trace.empty(x.size, len(self.law_type.symbols))
        self._replay(
            x,
            v,
            f,
            steps,
            trace.parameters,
            trace.standard_errors,
            trace.predicted_force,
            trace.validity_margin,
            trace.status,
        )
        return trace

    def replace(self, **changes: Any) -> Self:
        """Return a fresh estimator with these settings changed, which has learned nothing."""
        return type(self)(**{**self._settings, **changes})

    def copy(self) -> Self:
        """Return an estimator with the same settings and state, from here on independent."""
        return _restored(type(self), self._settings, self._state())

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self._settings, self._state())

    def __repr__(self) -> str:
        arguments = ", ".join(f"{name}={value!r}" for name, value in self._settings.items())
        return f"{type(self).__name__}({arguments})"


Estimator = TypeVar("Estimator", bound=ContactEstimator)


def _restored(kind: type[Estimator], settings: dict[str, Any], state: bytes) -> Estimator:
    estimator = kind(**settings)
    estimator._restore(state)
    return estimator


def loop_settings(
    change_detector: ChangeDetector | None,
    gate: ContactGate | None,
    scale: Scale | None,
    sample_time: float,
    default_scale: Scale,
) -> tuple[Any, ...]:
    """Check what every estimator's loop is set by, as the compiled constructors take it."""
    instance("change_detector", change_detector, (ChangeDetector, type(None)))
    instance("gate", gate, (ContactGate, type(None)))
    instance("scale", scale, (Scale, type(None)))
    return (
        NO_DETECTION if change_detector is None else change_detector._plain(),
        (gate or ContactGate())._plain(),
        (scale or default_scale)._plain(),
        number_in("sample_time", sample_time, 0.0, 1e6, open_low=True),
    )


# Drift 0 switches the detector off.
NO_DETECTION = (0.0, 60.0, 0.0, 5e-4, 200.0, 0.0)
