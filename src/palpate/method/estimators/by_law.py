"""The choice of the method for a law, and least squares for laws without a compiled method.

A law without memory does not depend on the order of its samples. They are therefore summed in the
cells of a grid of penetration and velocity. The grid has a fixed size; when a sample lies outside,
pairs of cells merge. The fit uses the mean force and its two slopes in each cell.
"""

import atexit
import itertools
import math
from operator import itemgetter
from typing import Any, ClassVar, Literal

import numpy as np

from palpate._core import EstimateValue, Status
from palpate.errors import InvalidParameterError, PalpateError
from palpate.force_laws import FORCE_LAWS, ForceLaw, GeneralisedHuntCrossley
from palpate.method.estimators.contact_estimator import (
    ESTIMATORS,
    ContactEstimator,
    PythonEstimator,
    Rejection,
    estimator_named,
    register,
)
from palpate.method.estimators.estimate import Estimate
from palpate.method.estimators.least_squares import column_sizes, least_squares
from palpate.method.estimators.variable_projection import PROBING, VariableProjection
from palpate.method.estimators.viscoelastic import ViscoelasticContact
from palpate.method.settings import SAMPLE_TIME, ContactGate, Scale
from palpate.validation import Floats, arguments, check_choice

# Cells of penetration and of velocity; at least half are in use. For Fung's law over five times its
# length the optimum is then within 0.01 standard errors of the optimum over the samples.
CELLS = (64, 32)
# Each cell holds N, Σx, Σv, Σx², Σxv, Σv², ΣF, ΣFx, ΣFv.
_SUMS = 9
# Larger samples would overflow later products and squares.
LARGEST = 1e30
# Weights that convert forces at four nodes of a cell, √2 deviations from its middle, to a mean and
# slopes.
_NODES = math.sqrt(2.0) * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
_WEIGHTS = np.vstack([np.full(4, 0.25), _NODES / 4.0])
# A new fit follows after an eighth more samples, and one from many starts after twice as many.
FEWEST = 16
_GROWTH = 9 / 8
# Number of factors tried per nonlinear parameter, by the count of nonlinear parameters.
_STARTS = {1: 33, 2: 11, 3: 6}
_DECADES = 2.0
_SEARCHED = 64  # cells used to compare starts
_POLISHED = 3  # starts that are fitted to convergence
# Relative gain of Σr² at which a fit ends: 1e-5 standard errors for a thousand rows.
_ENOUGH = 1e-13
# A step longer than this, in standard errors, from a fit of an eighth fewer samples is discarded.
_NEAR = 3.0


class LeastSquaresOfLaw(PythonEstimator):
    """Any registered law without memory, by nonlinear least squares of force.

    min over (θ, F₀) of Σ (F − F(x, v; θ) − F₀)²

    A :class:`VariableProjection` runs next to it: it decides which samples are contact and which
    are outliers, and predicts until the first fit. Levenberg–Marquardt continues from the last fit
    after an eighth more samples, and from many starts (around :meth:`ForceLaw.sizes`) after twice
    as many. Parameters in which the force is linear need no start.

    Parameters
    ----------
    offset : bool
        Estimate a constant force offset together with the law. Default: True.
    offset_deviation : float, optional
        Standard deviation of the force offset after the tare, N, > 0: a prior
        F₀ ~ N(0, offset_deviation²). Default: no prior; in :func:`identify` the contact's
        ``tare_deviation``, if any.
    surface_deviation : float, optional
        Standard deviation of the surface position, m, > 0. Multiplied by F/x of the ``scale``, it
        widens the prior, as in :class:`VariableProjection`.
    gate, outlier_rejection, sample_time, scale
        As in :class:`SingleStageRLS`.
    """

    minimises: ClassVar[Literal["force", "logarithm"] | None] = "force"
    knows_offset = True
    gives_way = True

    def __init__(
        self,
        *,
        offset: bool = True,
        offset_deviation: float | None = None,
        surface_deviation: float | None = None,
        outlier_rejection: Rejection = None,
        gate: ContactGate | None = None,
        sample_time: float = SAMPLE_TIME,
        scale: Scale | None = None,
    ) -> None:
        self._settings: dict[str, Any] = arguments(locals())
        self._linear = linear_in(self.law_type)
        self.reset()

    def reset(self) -> None:
        """Forget every sample."""
        self._guide = VariableProjection(**self._settings)
        self._cells = np.zeros((*CELLS, _SUMS))
        self._range: tuple[float, float] | None = None  # of penetration and of speed
        self._energy = 0.0
        self._samples = 0
        self._rejected = 0
        self._status = Status.WAITING
        self._due = FEWEST
        self._search = FEWEST
        self._found: Floats | None = None  # parameters and offset
        self._noise = 0.0
        self._fitted = 0

    def leave_contact(self) -> None:
        """End the contact; the estimate is held until the next contact."""
        self._guide.leave_contact()
        if self._samples:
            self._status = Status.HELD

    def update(
        self,
        penetration: float,
        velocity: float,
        force: float,
        dt: float | None = None,
    ) -> Status:
        """Take one sample and return its status; never raises on data."""
        size = max(abs(penetration), abs(velocity), abs(force))
        if LARGEST < size < math.inf and penetration > 0.0:
            return Status.OUT_OF_RANGE
        status = self._guide.update(penetration, velocity, force, dt)
        if status == Status.REJECTED:
            self._rejected += 1
        elif status < Status.NOT_FINITE:
            self._status = status
        if status in (Status.UPDATED, Status.GUARDED):
            self._add(float(penetration), float(velocity), float(force))
            if self._samples >= self._due:
                self._due = math.ceil(self._samples * _GROWTH)
                self._commit(search=self._samples >= self._search)
        return status

    def finish_pending(self) -> None:
        """Fit all samples so far, from many starts."""
        if self._samples >= FEWEST:
            self._commit(search=True)

    def predict(self, penetration: float, velocity: float) -> float:
        """Force [N] that the last fit predicts for the sensor, offset included."""
        if self._found is None:
            return self._guide.predict(penetration, velocity)
        law = self.law_type.from_parameters(self._found[:-1])
        with np.errstate(all="ignore"):
            force = law.force(penetration, velocity) if penetration > 0.0 else 0.0
        return float(np.nan_to_num(force + self._found[-1]))

    def estimate(self) -> Estimate:
        """Return the last fit, updated by one step with the samples since."""
        if self._found is None:
            scale = self._settings["scale"] or PROBING
            sizes = self.law_type.sizes(scale.penetration, scale.velocity, scale.force)
            found = np.append(sizes, 0.0)
            joint = _wide_covariance(found)
        else:
            found, joint = self._one_step_update(_Rows(self))
        counts = self._status, self._samples, 1.0, 0, 0, self._rejected
        value = EstimateValue(found[:-1], joint.reshape(-1), *counts, offset=float(found[-1]))
        return Estimate(value, self.law_type)

    def _one_step_update(self, rows: "_Rows") -> tuple[Floats, Floats]:
        """The last fit after one step on all samples, and its covariance; the fit itself stays."""
        found = self._found
        assert found is not None
        residual, jacobian = rows.at(found, self._noise)
        joint = rows.covariance(found, residual, jacobian)
        if self._samples == self._fitted or not np.isfinite(residual).all():
            return found, joint
        step = _step(jacobian, residual)
        try:
            self.law_type.from_parameters(found[:-1] + step[:-1])
        except PalpateError:
            return found, joint
        is_small = bool((np.abs(step) <= _NEAR * np.sqrt(np.diag(joint))).all())
        return found + step if is_small else found, joint

    def _commit(self, *, search: bool) -> None:
        start = self._found
        if search:
            self._search = 2 * self._samples
            start = _Rows(self, most=_SEARCHED).best_start(start, self._noise)
        if start is not None:
            rows = _Rows(self)
            energy, found = rows.minimise(start, self._noise)
            if math.isfinite(energy):
                self._found = found
                self._noise = rows.noise(energy)
                self._fitted = self._samples

    def _add(self, x: float, v: float, force: float) -> None:
        deep, fast = self._range or (math.ldexp(1.0, math.frexp(x)[1]),) * 2
        while x >= deep:  # all samples move to the lower half
            pairs = self._cells[::2] + self._cells[1::2]
            self._cells[:] = 0.0
            self._cells[: CELLS[0] // 2] = pairs
            deep = 2.0 * deep
        while abs(v) >= fast:  # all samples move to the middle
            pairs = self._cells[:, ::2] + self._cells[:, 1::2]
            self._cells[:] = 0.0
            quarter = CELLS[1] // 4
            fast = 2.0 * fast
            self._cells[:, quarter : 3 * quarter] = pairs
        self._range = deep, fast
        cell = int(x / deep * CELLS[0]), int((v / fast + 1.0) / 2.0 * CELLS[1])
        row = 1.0, x, v, x * x, x * v, v * v, force, force * x, force * v
        self._cells[cell] += row
        self._energy += force * force
        self._samples += 1

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (self.law_type, self._settings, self._state())


def _rebuild(law: type[ForceLaw], settings: dict[str, Any], state: Any) -> LeastSquaresOfLaw:
    estimator = least_squares_class(law)(**settings)
    estimator._restore(state)
    return estimator


class _Rows:
    """The cells as rows of a least squares: the force in each cell, and its two slopes."""

    def __init__(self, estimator: LeastSquaresOfLaw, most: int | None = None) -> None:
        self.law = estimator.law_type
        settings = estimator.settings
        self.with_offset = settings["offset"]
        tare = settings["offset_deviation"]
        scale = settings["scale"] or PROBING
        off = settings["surface_deviation"] or 0.0
        self.deviation = tare and math.hypot(tare, off * scale.force / scale.penetration)
        self.linear = estimator._linear
        self.samples = estimator._samples
        self.energy = estimator._energy
        sums = estimator._cells.reshape(-1, _SUMS)
        sums = sums[sums[:, 0] > 0.0]
        sums = sums[:: 1 if most is None else max(len(sums) // most, 1)]
        count, *means = sums.T
        x, v, xx, xv, vv, force, fx, fv = np.array(means) / count
        with np.errstate(all="ignore"):
            along = _deviation(xx - x * x, xx)
            both = np.where(along > 0.0, (xv - x * v) / along, 0.0)
            across = _deviation(vv - v * v - both * both, vv)
            by_depth = np.where(along > 0.0, (fx - force * x) / along, 0.0)
            by_speed = (fv - force * v - both * by_depth) / across
            by_speed = np.where(across > 0.0, by_speed, 0.0)
        self.weight = np.sqrt(count)
        rows = np.stack([force, by_depth, by_speed]) * self.weight
        self.force = np.append(rows.reshape(-1), 0.0)  # the last row is the prior of the offset
        one, other = _NODES[:, :, None]
        # Near the surface a node may lie above it.
        self.x = np.maximum(x + one * along, 1e-3 * x).reshape(-1)
        self.v = (v + one * both + other * across).reshape(-1)
        rms = np.sqrt(np.average([xx, vv, force * force], axis=1, weights=count))
        self.sizes = self.law.sizes(*rms.tolist())

    def at(self, found: Floats, noise: float) -> tuple[Floats, Floats]:
        """Residual and Jacobian; the residual is ∞ if the law is not finite."""
        with np.errstate(all="ignore"):
            force, gradient = self.law.force_and_gradient(found[:-1], self.x, self.v)
            zero = np.full_like(self.x, float(self.with_offset))
            wide = np.stack([force, *gradient.T, zero]).reshape(len(found) + 1, 4, -1)
            rows = (_WEIGHTS @ wide * self.weight).reshape(len(found) + 1, -1)
            prior = np.zeros((len(found) + 1, 1))
            prior[-1] = noise / self.deviation if self.with_offset and self.deviation else 0.0
            rows = np.hstack([rows, prior])
            residual = self.force - rows[0] - found[-1] * rows[-1]
            known = np.isfinite(rows).all() and np.isfinite(residual @ residual)
        if not known:
            return np.full_like(residual, np.inf), np.zeros_like(rows[1:].T)
        return residual, rows[1:].T

    def solve_linear_part(self, found: Floats, noise: float) -> tuple[float, Floats]:
        """Σr² and parameters after solving for the linear parameters."""
        residual, jacobian = self.at(found, noise)
        better = found.copy()
        linear = [*self.linear, len(found) - 1]
        if np.isfinite(residual).all():
            better[linear] += _step(jacobian[:, linear], residual)
            residual -= jacobian[:, linear] @ (better - found)[linear]
        return float(residual @ residual), better

    def minimise(self, found: Floats, noise: float) -> tuple[float, Floats]:
        """Σr² and parameters of the least squares from a start."""
        with np.errstate(all="ignore"):
            best = least_squares(lambda trial: self.at(trial, noise), found, enough=_ENOUGH)
            return float(best.residual @ best.residual), best.parameters

    def best_start(self, before: Floats | None, noise: float) -> Floats | None:
        """The best fit from the last fit and many starts; None if the law has no finite force."""
        free = [k for k in range(len(self.sizes)) if k not in self.linear]
        count = _STARTS.get(len(free), 3)
        decades = [_DECADES if self.law.units[k] else 0.5 * _DECADES for k in free]
        starts = []
        for factors in itertools.product(*(np.logspace(-each, each, count) for each in decades)):
            start = np.append(self.sizes, 0.0)
            start[free] *= factors
            starts.append(self.solve_linear_part(start, noise))
        starts.sort(key=itemgetter(0))
        tried = [] if before is None else [before]
        tried += [start for _, start in starts[:_POLISHED]]
        energy, found = min((self.minimise(each, noise) for each in tried), key=itemgetter(0))
        return found if math.isfinite(energy) else None

    def noise(self, energy: float) -> float:
        """Standard deviation of the force, N, from the Σr² of the rows."""
        within = max(self.energy - float(self.force @ self.force), 0.0)
        return math.sqrt((within + energy) / max(self.samples - len(self.sizes) - 1, 1))

    def covariance(self, found: Floats, residual: Floats, jacobian: Floats) -> Floats:
        """Covariance of parameters and offset for white noise; large if not identifiable."""
        if not np.isfinite(residual).all():
            return _wide_covariance(found)
        size = column_sizes(jacobian)
        energy = float(residual @ residual)
        values, vectors = np.linalg.eigh((jacobian / size).T @ (jacobian / size))
        scaled = vectors * (self.noise(energy) / np.sqrt(np.maximum(values, 1e-13)))
        joint: Floats = scaled @ scaled.T / np.outer(size, size)
        if not self.with_offset:
            joint[-1] = 0.0
            joint[:, -1] = 0.0
        joint = 0.5 * (joint + joint.T)
        return joint if np.isfinite(joint).all() else _wide_covariance(found)


def _wide_covariance(found: Floats) -> Floats:
    """A covariance of unknown parameters: standard errors of a hundred times their values."""
    return np.diag(np.append((100.0 * found[:-1]) ** 2, 0.0))


def _deviation(variance: Floats, square: Floats) -> Floats:
    """Standard deviation within a cell; 0 if it is only rounding error."""
    return np.sqrt(np.where(variance > 1e-12 * square, variance, 0.0))


def _step(jacobian: Floats, residual: Floats) -> Floats:
    """A step of the normal equations, with columns scaled to length one."""
    size = column_sizes(jacobian)
    unit = jacobian / size
    step: Floats = np.linalg.lstsq(unit.T @ unit, unit.T @ residual, rcond=1e-13)[0] / size
    return step


def linear_in(law: type[ForceLaw]) -> tuple[int, ...]:
    """Return the indices of the parameters in which the force is jointly linear.

    The force is linear in a set of parameters if its gradient with respect to them does not depend
    on them. The test uses two depths and speeds, and parameters typical of a probing hand.
    """
    x = np.array([3e-3, 9e-3])
    v = np.array([-15e-3, 10e-3])
    sizes = law.sizes(10e-3, 20e-3, 1.0)

    def gradient(k: int | None = None) -> Floats:
        moved = sizes.copy()
        if k is not None:
            moved[k] *= 1.3
        return law.from_parameters(moved).parameter_gradient(x, v)

    linear: list[int] = []
    before = gradient()
    for k in range(len(sizes)):
        after = gradient(k)
        both = [*linear, k]
        same = np.allclose(after[:, both], before[:, both], rtol=1e-9, atol=0.0)
        others = (np.allclose(gradient(j)[:, k], before[:, k], rtol=1e-9, atol=0.0) for j in linear)
        if same and all(others):
            linear = both
    return tuple(linear)


# One class for each registered law that no other method identifies.


_CLASSES: dict[type[ForceLaw], type[LeastSquaresOfLaw]] = {}


def least_squares_class(law: type[ForceLaw]) -> type[LeastSquaresOfLaw]:
    """Return the least-squares estimator class of a law."""
    attributes = {
        "law_type": law,
        "method": law.kind,
        "__doc__": f"Least squares of {law.__name__}.",
    }
    if law not in _CLASSES:
        _CLASSES[law] = type(f"{law.__name__}LeastSquares", (LeastSquaresOfLaw,), attributes)
    return _CLASSES[law]


def watch(law: type[ForceLaw]) -> None:
    """Register the least squares of a law, unless it has memory or another method."""
    if not law.relaxes and all(each.law_type is not law for each in ESTIMATORS.values()):
        register(least_squares_class(law))


@atexit.register
def forget_laws() -> None:
    """Empty the registries when the interpreter ends.

    A law that a script registers refers to the script's globals, and to a result among them: its
    compiled objects would outlive the compiled module.
    """
    for registry in (FORCE_LAWS, ESTIMATORS, _CLASSES):
        registry.clear()


# The estimators for each name of a law that ``identify(law=…)`` and ``--law`` accept.

USUAL = "hunt-crossley"
# Settings of :class:`ViscoelasticContact` for each requested law.
_SETTINGS: dict[str, dict[str, str]] = {
    "auto": {},
    "half-space": {"damping": "half-space", "memory": "none"},
}


def law_names() -> tuple[str, ...]:
    """Return the names that ``law`` accepts: kinds of law, and ways to select one."""
    plain = [kind for kind in FORCE_LAWS if kind != GeneralisedHuntCrossley.kind]
    able = {estimator.law_type.kind for estimator in ESTIMATORS.values()}
    return tuple(dict.fromkeys([USUAL, *_SETTINGS, *(kind for kind in plain if kind in able)]))


def estimator_by_law(
    law: str | None = None,
    method: str | None = None,
) -> tuple[type[ContactEstimator], dict[str, Any]]:
    """Return the estimator that identifies a law, and its settings.

    Parameters
    ----------
    law : str, optional
        ``"hunt-crossley"``, ``"kelvin-voigt"`` or another law that one method identifies;
        ``"auto"``, which selects the damping form that fits best and adds a spectrum of relaxation
        times if the material relaxes; or ``"half-space"``.
    method : str, optional
        Name of a method for this law.

    Raises
    ------
    InvalidParameterError
        The law or the method does not exist, or the method does not identify the law.
    """
    requested = None if method is None else estimator_named(method)
    if law is None:
        return requested or VariableProjection, {}
    if law not in law_names():
        FORCE_LAWS.get(law)  # loads the laws of other packages
    check_choice("law", law, law_names())
    settings = _SETTINGS.get(law)
    if requested is ViscoelasticContact and law == USUAL:
        settings = {"damping": law, "memory": "none"}
    able = [each for each in ESTIMATORS.values() if each.law_type.kind == law]
    if settings is not None:
        able = [ViscoelasticContact]
    chosen = requested or able[0]  # the default method comes first
    if chosen not in able:
        laws = f"the {chosen.law_type.kind} law"
        if chosen is ViscoelasticContact:
            laws = ", ".join((USUAL, *_SETTINGS))
        raise InvalidParameterError(
            f"method {chosen.method} does not identify law {law}, only {laws}: pass one of the two"
        )
    return chosen, dict(settings or {})
