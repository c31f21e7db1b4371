"""Subtraction of the tool's weight and inertia from a wrench in a control loop."""

from typing import Any, Literal

import palpate._core as _core
from palpate.errors import InvalidParameterError
from palpate.settings import Configured
from palpate.validation import arguments, check_choice, instance, number_in
from palpate.wrench.payload import TENSOR, Payload

MOTION_WINDOW = 0.1  # s
FEWEST_SAMPLES, MOST_SAMPLES = 7, 151  # a quartic needs five; the filter holds the larger number


class PayloadCompensation(Configured, _core.PayloadCompensation):
    """Subtracts weight, inertia and bias of a tool from its sensor's wrench, sample by sample.

    Acceleration and angular velocity are derivatives of the pose: of a quartic through the poses of
    a window, at its middle. Each output is therefore half a window old, force and position alike,
    which does not affect an estimate. :class:`palpate.OnlinePreparation` takes the outputs.

    Parameters
    ----------
    payload : Payload
        Mass, centre of mass, mount, bias and delay, such as ``Payload.load("tool.toml")``. A drift
        of its bias is not continued; :meth:`start_tare` and :meth:`finish_tare` update the bias.
    sample_time : float
        Time between samples, s, in [1e-6, 1e3]. palpate interpolates samples of another clock to
        these steps.
    motion_window : float
        Length of the window of poses, s, of 7 to 151 samples. Default: 0.1. With 0, palpate
        subtracts the weight but no inertia, without delay.
    frame : str
        Axes of force and torque: ``"base"`` (default), those of the pose's position, or
        ``"sensor"``.

    Raises
    ------
    InvalidParameterError
        A setting is out of its range.
    """

    __slots__ = ("_settings",)

    def __init__(
        self,
        *,
        payload: Payload,
        sample_time: float = 1e-3,
        motion_window: float = MOTION_WINDOW,
        frame: Literal["base", "sensor"] = "base",
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        instance("payload", payload, Payload)
        step = number_in("sample_time", sample_time, 1e-6, 1e3)
        length = number_in("motion_window", motion_window, 0.0, 1e6)
        check_choice("frame", frame, ("base", "sensor"))
        samples = min(max(round(length / step), FEWEST_SAMPLES), MOST_SAMPLES) | 1
        try:
            super().__init__(
                step,
                samples if length > 0.0 else 1,
                frame == "base",
                payload.delay,
                payload.sign,
                payload.mass,
                payload.centre.tolist(),
                payload.lever.tolist(),
                payload.parameters[4:10][TENSOR].tolist(),
                payload.mount.tolist(),
                payload.bias.tolist(),
            )
        except ValueError as fault:
            raise InvalidParameterError(f"payload: {fault}") from None
