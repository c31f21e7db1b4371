"""The contact normal: given, or found from forces or motion; projections on it, and its checks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.errors import InvalidParameterError, NoContactError, RecordingError
from palpate.findings import Check, Finding, Mark
from palpate.input.preparation.resolution import noise_of
from palpate.input.preparation.touch import depends_on_position
from palpate.method.rows import finite_rows, norm, row_norms
from palpate.validation import Floats, frozen, shown

AXES = {
    f"{sign}{axis}": float(f"{sign}1") * row
    for axis, row in zip("xyz", np.eye(3), strict=True)
    for sign in ("", "+", "-")
}
NOISES = 10.0  # σ of the norm of the force; the direction of smaller forces is not used


@frozen(eq=False)
class Normal:
    """The contact normal: the direction in which the material pushes the probe.

    Attributes
    ----------
    vector : numpy.ndarray, shape (3,)
        Unit vector out of the material, in the frame of the position.
    spread : float
        Angle between forces and normal, rad, rms weighted by force; 0 for a given normal.
    turned : bool
        Whether the forces act on the material, so that their sign must be reversed.
    """

    vector: Floats
    spread: float = 0.0
    turned: bool = False

    def __str__(self) -> str:
        x, y, z = self.vector
        text = f"({x:.4g}, {y:.4g}, {z:.4g})"
        return f"{text} ± {math.degrees(self.spread):.1f}°" if self.spread else text


def parse_normal(direction: str | Sequence[float]) -> Normal:
    """Parse a given normal: ``"z"``, ``"-z"``, ``"0.8,0.25,0.54"`` or three numbers.

    Raises
    ------
    InvalidParameterError
        The value has another form, or is zero.
    """
    if isinstance(direction, str) and (axis := AXES.get(direction.strip().lower())) is not None:
        return Normal(axis)
    try:
        numbers = direction.split(",") if isinstance(direction, str) else direction
        vector = np.array([float(number) for number in numbers])
        if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
            raise ValueError
    except (TypeError, ValueError):
        allowed = "x, y, z, -x, -y, -z or three numbers such as 0.8,0.25,0.54"
        raise InvalidParameterError(f"normal must be {allowed}, not {shown(direction)}") from None
    vector = vector / np.abs(vector).max()  # the norm of large numbers overflows
    return Normal(vector / norm(vector))


def normal_from_forces(force: Floats, position: Floats, source: str = "") -> Normal:
    """Find the contact normal: the mean direction of the force, weighted by magnitude.

    n = Σ |F| F / |Σ |F| F|,  spread² = Σ |F|² ∠(F, n)² / Σ |F|²

    A force that grows as the probe moves *against* n acts on the probe, as it should; one that
    grows as the probe moves *along* n acts on the material.

    Parameters
    ----------
    force : numpy.ndarray, shape (k, 3)
        N, in the frame of the position, tared if possible.
    position : numpy.ndarray, shape (k, 3)
        m; zeros if it is not in space.
    source : str
        Name of the file for messages.

    Raises
    ------
    NoContactError
        No force exceeds the noise.
    RecordingError
        The forces have no common direction, or too few samples.
    """
    finite = finite_rows(force, position)
    if not finite.any():
        remedy = "if the rows join several topics, name the column of their times with --time"
        raise RecordingError.of(source, f"no sample has both a position and a force; {remedy}")
    f = force[finite]
    p = position[finite]
    size = row_norms(f)
    noise = math.sqrt(sum(noise_of(component) ** 2 for component in f.T))
    firm = size > NOISES * noise
    if not firm.any():
        if depends_on_position(f, p):
            raise no_normal(source, f"no force is {NOISES:g} times its noise")
        remedy = "if the probe touches, pass the normal, such as --normal z"
        raise NoContactError.of(source, f"no contact found: no force exceeds the noise; {remedy}")
    total = (f[firm] * size[firm, None]).sum(axis=0)
    length = norm(total)
    if not 0.0 < length < math.inf:
        raise no_normal(source, "the forces have no common direction")
    n = total / length
    across = row_norms(np.cross(f[firm], n))
    angle = np.arctan2(across, f[firm] @ n)
    weight = size[firm] ** 2
    spread = math.sqrt(float((weight * angle**2).sum() / weight.sum()))
    if grows(p @ n, f @ n):
        return Normal(-n, spread, turned=True)
    return Normal(n, spread)


def no_normal(source: str, reason: str) -> RecordingError:
    """Return the error for a recording whose contact normal cannot be found."""
    remedy = "pass it, such as --normal z"
    problem = f"{reason}, so palpate cannot find the contact normal"
    return RecordingError.of(source, f"{problem}; {remedy}")


def normal_from_motion(position: Floats, force: Floats, source: str) -> Normal:
    """Find the normal, opposite to the motion in which the force grows: −Σ ΔF Δp."""
    finite = finite_rows(position, force)
    size = np.abs(force[finite])
    stride = min(STRIDE, max(len(size) // 4, 1))
    total = -_products(position[finite], size, stride).sum(axis=0)
    length = norm(total)
    if not length > 0.0:
        raise no_normal(source, "the force does not change with the position")
    return Normal(total / length)


def grows(position: Floats, force: Floats) -> bool:
    """Whether the force grows with the position.

    It compares changes over five samples, not values: a probe that travels over a hill moves up and
    down without pressing.
    """
    lag = 1
    if len(force) >= 20:
        lag = 5
        mean = np.ones(lag) / lag
        position = np.convolve(position, mean, "valid")
        force = np.convolve(force, mean, "valid")
    changes = (position[lag:] - position[:-lag]) * (force[lag:] - force[:-lag])
    return float(np.sum(changes)) > 0.0


# Projection of a position and a force on the contact normal.


@dataclass(slots=True, eq=False)
class AlongNormal:
    """Depth and compression along one normal.

    Attributes
    ----------
    depth : numpy.ndarray, shape (k,)
        m, increasing into the material, from an arbitrary origin.
    force : numpy.ndarray, shape (k,)
        N, compression positive.
    normal : Normal or None
        None if both were already along one axis.
    findings : list of Finding
        Assumptions.
    """

    depth: Floats
    force: Floats
    normal: Normal | None = None
    findings: list[Finding] = field(default_factory=list)


def project_on_normal(
    position: Floats,
    force: Floats,
    source: str,
    *,
    normal: Normal | None = None,
    flip: Sequence[str] = (),
) -> AlongNormal:
    """Project position and force on the contact normal.

    Either may already be along one axis. If not given, the normal is found by
    :func:`normal_from_forces`, or for a force along one axis as the direction in which the probe
    moves when the force grows. Signs are chosen so that compression is positive and grows with the
    depth.

    Parameters
    ----------
    position, force : numpy.ndarray, shape (k,) or (k, 3)
        m, and the tared force, N.
    source : str
        Name of the file for messages.
    normal : Normal, optional
        A given normal.
    flip : sequence of str
        Channels whose sign is requested.
    """
    if force.ndim == position.ndim == 2:
        return _project_vectors(position, force, normal, source, flip)
    if force.ndim == 2:
        if normal is None:
            normal = normal_from_forces(force, np.zeros_like(force) * position[:, None], source)
        return _align_signs(position, force @ normal.vector, normal, flip)
    if position.ndim == 1:
        return _align_signs(position, force, None, flip)
    if normal is not None:
        return _align_signs(-(position @ normal.vector), force, normal, ("penetration", *flip))
    normal = normal_from_motion(position, force, source)
    result = _align_signs(-(position @ normal.vector), force, normal, ("penetration", *flip))
    remedy = "pass it if known, such as --normal z"
    result.findings.append(
        Check.DIRECTION.finding(
            "palpate found the contact normal from the motion in which the force grows", remedy
        )
    )
    return result


def _project_vectors(
    position: Floats, force: Floats, given_normal: Normal | None, source: str, flip: Sequence[str]
) -> AlongNormal:
    normal = given_normal or normal_from_forces(force, position, source)
    findings = list[Finding]()
    compression = force @ normal.vector
    if normal.turned:
        compression = -compression
        if "force" in flip:  # a requested sign takes precedence
            normal = Normal(-normal.vector, normal.spread)
        else:
            findings.append(
                Check.DIRECTION.finding(
                    "the recorded force acts on the material: palpate reversed its sign",
                    "pass --flip-force to confirm",
                )
            )
    depth = -(position @ normal.vector)
    if given_normal is not None:
        findings += _check_given_normal(depth, compression)
    given = given_normal is not None
    findings += check_force_direction(position, force, normal.vector, given=given)
    return AlongNormal(depth, compression, normal, findings)


def _check_given_normal(depth: Floats, force: Floats) -> list[Finding]:
    """Report a force along a given normal that is no compression."""
    finite = np.isfinite(force)
    if _is_negative(force):
        symptom = "is mostly negative"
    elif not grows(depth[finite], force[finite]):
        symptom = "decreases as the probe goes in"
    else:
        return []
    return [
        Check.DIRECTION.finding(
            f"along the given normal the force {symptom}",
            "reverse the sign of --normal, or pass --flip-force",
            mark="do-not-trust",
        )
    ]


def _is_negative(force: Floats) -> bool:
    """Whether a force is mostly negative, weighted by magnitude."""
    return float(np.nansum(force * np.abs(force))) < 0.0


def _align_signs(
    depth: Floats, force: Floats, normal: Normal | None, requested: Sequence[str]
) -> AlongNormal:
    """Choose the signs of a position and a force along one axis that are not requested."""
    findings = list[Finding]()
    if "force" not in requested and _is_negative(force):
        force = -force
        findings.append(
            Check.DIRECTION.finding(
                "the force is mostly negative: palpate reversed its sign, compression is positive",
                "pass --flip-force to confirm",
            )
        )
    finite = finite_rows(force, depth)
    if "penetration" not in requested and not grows(depth[finite], force[finite]):
        depth = -depth
        findings.append(
            Check.DIRECTION.finding(
                "the force grows as the position decreases: palpate reversed the position's sign",
                "pass --flip-penetration to confirm",
            )
        )
    return AlongNormal(depth, force, normal, findings)


# Agreement of the direction of the force with the motion.

# An error of 5° shortens the depth by 0.4 % and changes the stiffness of a law with exponent 2 by
# 1 %; 20° give 6 % and 13 %. A tool is aligned with its sensor to better than 3°, and friction of
# 0.3 inclines the force by 17°.
LARGE_ANGLE = math.radians(5.0)
TOO_LARGE_ANGLE = math.radians(20.0)
BLOCKS_OF_DIRECTION = 8  # blocks whose scatter gives the uncertainty of the direction
ERRORS_OF_DIRECTION = 3.0  # standard errors of the direction
STRIDE = 5  # samples over which changes are computed; over fewer, noise dominates


def check_force_direction(
    position: Floats, force: Floats, normal: Floats, *, given: bool
) -> list[Finding]:
    """Report forces that do not point along the motion in which they grow.

    The motion, −Σ ΔF Δp, does not depend on the axes of the force. The two differ if an axis is
    reversed or swapped, the frame is wrong, the force is not tared, or there is friction; also if
    the probe slides down a slope without friction, although the normal is then right.

    Parameters
    ----------
    position, force : numpy.ndarray, shape (k, 3)
        m and N, nominally in one frame.
    normal : numpy.ndarray, shape (3,)
        The contact normal.
    given : bool
        Whether the user gave the normal: then it must agree with the motion or with the forces.
    """
    motion, error = direction_of_growth(position, force @ normal)
    if motion is None:
        return []
    angle = angle_between_axes(motion, normal)
    subject = "the force points"
    reference = "motion in which it grows"
    if given:
        subject = "the given normal points"
        reference = "force and from the motion in which it grows"
        try:
            forces = normal_from_forces(force, 0.0 * position).vector
        except RecordingError:
            return []
        angle = min(angle, angle_between_axes(forces, normal))
    if angle <= LARGE_ANGLE + ERRORS_OF_DIRECTION * error:
        return []
    problem = (
        f"{subject} {math.degrees(angle):.0f}° away from the {reference}: a wrong frame, a "
        "reversed or swapped axis, a force offset, friction, or a probe that slides down a slope"
    )
    mark: Mark = "do-not-trust" if angle > TOO_LARGE_ANGLE else "with-care"
    return [
        Check.DIRECTION.finding(
            problem,
            "compare the axes of force and position, then pass --force-frame tool or --normal z",
            mark=mark,
        )
    ]


def direction_of_growth(position: Floats, force: Floats) -> tuple[Floats | None, float]:
    """Return the direction of the motion in which the force grows, and its standard error, rad."""
    finite = finite_rows(position, force)
    f = force[finite]
    if len(f) < 2 * BLOCKS_OF_DIRECTION * STRIDE:
        return None, math.inf
    blocks = np.array_split(_products(position[finite], f, STRIDE), BLOCKS_OF_DIRECTION)
    sums = np.array([block.sum(axis=0) for block in blocks])
    total = sums.sum(axis=0)
    length = norm(total)
    if not 0.0 < length < math.inf:
        return None, math.inf
    direction: Floats = total / length
    across = sums - np.outer(sums @ direction, direction)
    # Across the direction, the sums of the blocks add to zero; their scatter is the error.
    scatter = float((across**2).sum()) * BLOCKS_OF_DIRECTION / (BLOCKS_OF_DIRECTION - 1)
    return direction, math.sqrt(scatter) / length


def _products(position: Floats, force: Floats, stride: int) -> Floats:
    """ΔF Δp over a stride, which points along the motion in which the force grows."""
    return (force[stride:] - force[:-stride])[:, None] * (position[stride:] - position[:-stride])


def angle_between_axes(a: Floats, b: Floats) -> float:
    """Return the angle between two axes, regardless of their signs, rad."""
    across = norm(np.cross(a, b))
    return math.atan2(across, abs(float(a @ b)))
