"""The marks of a payload, and the findings that give their reasons."""

import math
from dataclasses import replace

import numpy as np

from palpate.digits import percent
from palpate.findings import MARKS, Check, Finding, Mark, worst
from palpate.input.recordings.units import GRAVITY
from palpate.input.wrench.fit import PayloadFit

MASS_ERRORS = 0.01, 0.05  # relative standard errors: trust, with care
MOUNT_ERRORS = math.radians(0.5), math.radians(2.0)
DELAY_ERRORS = 0.5e-3, 2e-3  # s
SCATTERS = 1.0, 5.0  # residual in free air over what is tolerable: trust, with care
NO_TURN = math.radians(2.0)  # shifts 3 % of the weight from one axis to another
# Force that depends on gravity otherwise than a weight: least fraction of it that is reported,
# least spread of gravity over the largest, least size over the changes of the bias. 26 logs without
# a fault have at most 0.5 % or 0.1; a gain or crosstalk of 2 % or a cable gives 0.6 % and 0.14.
LEAST_DIFFERENCE = 5e-3
LEAST_SPREAD = 0.1
BY_DRIFT = 0.12
# kg of a tool at most; of the stiffness, without a word
UNKNOWN_MASS = 1.0
LARGEST_SHARE = 0.05
TURN_MORE = "turn the tool by 30° about two axes in free air, or pass --payload of a log that does"


def mark_payload(fit: PayloadFit, *, delay_given: bool) -> PayloadFit:
    """Return the fit with the marks of its payload, and findings that give the reasons."""
    payload = fit.payload
    mass = _mark(payload.mass_error / max(payload.mass, 1e-9), MASS_ERRORS)
    mount = _mark(float(payload.mount_error.max()), MOUNT_ERRORS)
    delay = _mark(payload.delay_error, DELAY_ERRORS)
    if not (delay_given or payload.axes):  # by its inertia alone
        delay = worst(delay, "with-care")
    findings = _report_unidentified(fit, mass, mount) + _report_misfit(fit)
    if payload.sign < 0.0:
        problem = "by the weight of the tool the sensor reads the force on the material: palpate "
        remedy = "pass --flip-force to confirm"
        findings.append(Check.PAYLOAD.finding(f"{problem}reversed its sign", remedy))
    if fit.sign_in_doubt and payload.mass > 0.0:
        mount = worst(mount, "with-care")
        problem = "the tool turns about one axis in free air, which leaves the sign of the force "
        remedy = "turn the tool about two axes, or pass --flip-force if the sensor reads the force "
        findings.append(Check.PAYLOAD.finding(f"{problem}open", f"{remedy}on the material"))
    if fit.zeroed:
        times = ", ".join(f"{zeroing.time:.2f} s" for zeroing in fit.zeroed)
        findings.append(
            Check.ZEROED.finding(
                f"the sensor was zeroed during the log, at {times}: palpate took the step out",
                "zero the sensor before the log begins",
            )
        )
    marked = replace(
        payload,
        mass_mark=mass,
        mount_mark=mount,
        delay_mark=delay,
        findings=tuple(findings),
    )
    return replace(fit, payload=marked)


def _report_unidentified(fit: PayloadFit, mass: Mark, mount: Mark) -> list[Finding]:
    """Report a mass or a mount that the log does not identify."""
    payload = fit.payload
    turn = f"the tool turns by {math.degrees(payload.turn):.0f}° in free air: palpate cannot "
    if mass == "do-not-trust" and payload.mass_error * GRAVITY < fit.blocks.floor:
        problem = (
            "the tool weighs less than the noise of the sensor: palpate takes the axes of the pose "
            "for those of the sensor"
        )
        return [Check.PAYLOAD.finding(problem)]
    if mass == "do-not-trust":
        problem = "identify its weight, and subtracts the mean force in the axes of the sensor"
        mark: Mark = "with-care" if payload.turn > NO_TURN else "trust"
        return [Check.PAYLOAD.finding(turn + problem, TURN_MORE, mark=mark)]
    if mount == "do-not-trust":
        problem = "identify the mount, and takes the axes of the pose for those of the sensor"
        return [Check.PAYLOAD.finding(turn + problem, TURN_MORE, mark="with-care")]
    return []


def _report_misfit(fit: PayloadFit) -> list[Finding]:
    """Report a force in free air that is not that of a weight."""
    findings = list[Finding]()
    if fit.scatter > SCATTERS[0]:
        problem = (
            f"the force in free air fits the weight of the tool {fit.scatter:.1f} times worse than "
            "its noise explains"
        )
        findings.append(
            Check.PAYLOAD.finding(
                problem,
                "move more slowly, or check that the z axis of the pose points up",
                severity="with-care",
            )
        )
    newtons, share = _difference_from_weight(fit)
    if share > LEAST_DIFFERENCE:
        problem = (
            f"as the tool turns, the force in free air differs from its weight by {newtons:.2g} N, "
            f"{percent(share)} of it: a cable, or the gain or crosstalk of the sensor"
        )
        findings.append(
            Check.PAYLOAD.finding(
                problem, "fix the cable to the tool, or calibrate the sensor", mark="with-care"
            )
        )
    return findings


def report_unknown_inertia(mass_error: float, share: float) -> list[Finding]:
    """Warn where the inertia of a tool whose mass is not known may be part of the stiffness.

    Parameters
    ----------
    mass_error : float
        kg.
    share : float
        Part of a kilogram in the stiffness, 1/kg.
    """
    share *= min(mass_error, UNKNOWN_MASS)
    if not share > LARGEST_SHARE:
        return []
    problem = "free air does not tell the mass of the tool, whose inertia may change the stiffness "
    return [Check.PAYLOAD.finding(f"{problem}by {percent(share)}", TURN_MORE, mark="with-care")]


def _difference_from_weight(fit: PayloadFit) -> tuple[float, float]:
    """Return by how much the force in free air depends on gravity otherwise than a weight, N and 1.

    Zero where the drift of the bias explains it, or the tool does not turn.
    """
    payload = fit.payload
    if not payload.axes or not payload.mass > 0.0:
        return 0.0, 0.0
    blocks = fit.blocks.taken(fit.free)
    motion = blocks.motion_before(payload.delay)
    residual = payload.unload(blocks.wrench[:, :3], blocks.time, motion)
    gravity = GRAVITY * motion[:, 17:] @ payload.mount
    gravity -= gravity.mean(axis=0)
    # Axes about which it hardly turns say nothing.
    slopes = np.linalg.lstsq(gravity, residual - residual.mean(axis=0), rcond=LEAST_SPREAD)[0]
    different = gravity @ slopes
    drift = payload.bias_changes[:, :3].std(axis=0).max(initial=0.0)
    if different.std(axis=0).max() < BY_DRIFT * drift:
        return 0.0, 0.0
    return float(np.abs(different).max()), float(np.linalg.norm(slopes, 2)) / payload.mass


def _mark(error: float, limits: tuple[float, float]) -> Mark:
    return MARKS[sum(not error <= limit for limit in limits)]
