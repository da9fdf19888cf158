r"""Bounded least squares on filtered data, for every model whose effort the core can compute.

.. math::
   F\,\tau = F\,\tau_{model}(q, \dot q, \ddot q; \beta) + \rho, \qquad W = F\,\partial\tau_{model}/\partial\beta

with F the same zero-phase filter and decimation on both sides. The regressor is the exact Jacobian of the core's
inverse dynamics, so linear and nonlinear models share one procedure. For a model that is linear in its parameters one
Gauss-Newton step is ordinary least squares (IDIM-LS [1]_).

Euclidean norms of the columns of a regressor.

Weights of robust least squares.

.. [1] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Generic, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from .._errors import IdentificationError
from ..models.estimates import Parameter
from .motion import require_fitted
from .searches.bounded_least_squares import bounded_least_squares


class FittedMotion(Protocol):
    """A motion that may enter a regression. A model reads further states of the motions that it can be fitted to."""

    @property
    def effort(self) -> np.ndarray:
        """Measured effort, (n,)."""

    @property
    def velocity(self) -> np.ndarray:
        """Velocity, (n,) or already (m,) in the rows of the regression [rad/s or m/s]."""

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """Reduce samples, (n,) or (n, k), to the regression rows: trimmed, thinned, without those at rest."""


MotionT = TypeVar("MotionT", bound=FittedMotion)
"""Kind of motion that a model is fitted to, for instance one of a joint or of a joint with a carriage."""

MotionT_co = TypeVar("MotionT_co", bound=FittedMotion, covariant=True)
MotionT_contra = TypeVar("MotionT_contra", bound=FittedMotion, contravariant=True)


class ForceModel(Protocol[MotionT_contra]):
    """A model that can be fitted: names and bounds of its free parameters, and its effort along a motion."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in the order of every array."""

    @property
    def label(self) -> str:
        """Name of the model in messages."""

    @property
    def linear(self) -> bool:
        """Whether the effort is linear in the free parameters."""

    def unit(self, name: str) -> str:
        """Return the SI unit of a parameter, as plain text."""

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the physical lower and upper bounds, each (p,), SI."""

    def effort(self, values: np.ndarray, motion: MotionT_contra) -> np.ndarray:
        """Return the effort, (n,), along a motion, filtered as the measured effort was."""

    def jacobian(self, values: np.ndarray, motion: MotionT_contra) -> tuple[np.ndarray, np.ndarray]:
        """Return the effort, (n,), and its derivative by the parameters, (n, p)."""


@runtime_checkable
class RowModel(Protocol[MotionT_contra]):
    """A model that can compute the regression rows of a motion without its full-rate regressor."""

    def rows(self, values: np.ndarray, motion: MotionT_contra) -> tuple[np.ndarray, np.ndarray]:
        """Return the effort, (m,), and its derivative by the parameters, (m, p), in the regression rows."""


@dataclass(frozen=True)
class Stack(Generic[MotionT_co]):
    """Several motions and their measured efforts, (m_i,), reduced to the rows that are fitted."""

    motions: tuple[MotionT_co, ...]
    targets: tuple[np.ndarray, ...]

    @property
    def target(self) -> np.ndarray:
        """All targets, shape (m,), in the effort's unit."""
        return np.concatenate(self.targets)

    @property
    def lengths(self) -> list[int]:
        """Number of rows of each motion."""
        return [len(t) for t in self.targets]

    def rows_by_motion(self, rows: np.ndarray) -> list[np.ndarray]:
        """Split rows, (k,) in rising order, by their motions, and count them from the first row of each motion."""
        ends = np.cumsum(self.lengths)
        owned = np.split(rows, np.searchsorted(rows, ends[:-1]))
        return [own - (end - length) for own, end, length in zip(owned, ends, self.lengths, strict=True)]

    def reduced(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Reduce one signal per motion, (n_i,) or (n_i, k), to its regression rows, and stack them."""
        return np.concatenate([m.rows(x) for m, x in zip(self.motions, signals, strict=True)])


def stack(motions: Sequence[MotionT]) -> Stack[MotionT]:
    """Stack motions for a regression; refuse them if one is held out, or if no sample is left."""
    require_fitted(motions, "stack")
    if not motions:
        raise IdentificationError('no recording is marked use = "fit"; at least one must be')
    targets = tuple(m.rows(m.effort) for m in motions)
    if not any(len(t) for t in targets):
        top = max(float(np.abs(m.velocity).max()) for m in motions)
        raise IdentificationError(
            f"no sample is left to fit: none is faster than the dead band, and the fastest moves at {top:.3g}; "
            "lower the dead band or record a faster motion"
        )
    return Stack(tuple(motions), targets)


def reduce_motions(motions: Sequence[MotionT]) -> Stack[MotionT]:
    """Reduce motions, fitted or held out, to rows that are compared with a fit and never fitted."""
    return Stack(tuple(motions), tuple(m.rows(m.effort) for m in motions))


def predict_efforts(model: ForceModel[MotionT], values: np.ndarray, motions: Sequence[MotionT]) -> list[np.ndarray]:
    """Return the model's effort for each motion, (n_i,), at full rate, filtered as the measured effort was."""
    return [model.effort(values, m) for m in motions]


def regression_rows(
    model: ForceModel[MotionT], values: np.ndarray, data: Stack[MotionT], kept: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the regressor, (m, p), and the modelled effort, (m,), at `values`, (p,).

    The regressor has only the rows `kept`, (k,) in rising order, if they are given.
    """
    # Each motion is reduced in turn: the full-rate regressor of hours of data would not fit in memory.
    wanted: Sequence[slice | np.ndarray]
    wanted = [slice(None)] * len(data.motions) if kept is None else data.rows_by_motion(kept)
    count = sum(data.lengths)
    effort, rows = np.empty(count), np.empty((count if kept is None else len(kept), len(model.names)))
    end = last = 0
    for motion, length, some in zip(data.motions, data.lengths, wanted, strict=True):
        effort[end : end + length], made = _rows(model, values, motion)
        own = made[some]
        rows[last : last + len(own)] = own
        end, last = end + length, last + len(own)
    return rows, effort


def predict_effort_rows(model: ForceModel[MotionT], values: np.ndarray, motion: MotionT) -> np.ndarray:
    """Return the modelled effort, (m,), in the regression rows of one motion at `values`, (p,)."""
    if has_rows(type(model)):
        return cast(RowModel, model).rows(values, motion)[0]
    return motion.rows(model.effort(values, motion))


def _rows(model: ForceModel[MotionT], values: np.ndarray, motion: MotionT) -> tuple[np.ndarray, np.ndarray]:
    """Return the effort, (m,), and regressor, (m, p), in the regression rows of one motion at `values`, (p,)."""
    if has_rows(type(model)):
        return cast(RowModel, model).rows(values, motion)
    rows = motion.rows(np.column_stack(model.jacobian(values, motion)))
    return rows[:, 0], rows[:, 1:]


@cache
def has_rows(model: type) -> bool:
    """Return whether a class of models computes the rows of a motion directly; it is asked for every motion."""
    return issubclass(model, RowModel)


@dataclass(frozen=True)
class Solution:
    """Result of a solver."""

    values: np.ndarray  # parameters, (p,)
    jacobian: np.ndarray  # regressor at the solution, (m, p)
    residual: np.ndarray  # unweighted residual at the solution, (m,)
    weights: np.ndarray  # weights by which residuals were multiplied, (m,)
    at_bound: np.ndarray  # mask of the parameters on an active bound, (p,)
    iterations: int
    converged: bool
    is_exact: bool = False  # whether regressor and residual are known to be those at the values, without linearising


def solve(
    model: ForceModel[MotionT],
    data: Stack[MotionT],
    *,
    weights: np.ndarray | None = None,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    start: np.ndarray | None = None,
    after: Solution | None = None,
) -> Solution:
    """Minimise the weighted sum of squared effort residuals within bounds, by default the model's.

    `weights` has shape (m,), `bounds` and `start` (p,). `after` is an earlier solution on the same data.
    """
    w = np.ones(len(data.target)) if weights is None else np.asarray(weights, float)
    lower, upper = model.bounds() if bounds is None else bounds
    if model.linear:
        if after is None:
            jacobian, effort = regression_rows(model, np.zeros(len(model.names)), data)
            target = data.target - effort
        else:
            jacobian, target = after.jacobian, after.residual + after.jacobian @ after.values
        weighted = jacobian if weights is None else jacobian * w[:, None]
        factor = triangular_factor(weighted, target * w)
        require_full_rank(model.names, weighted, model.label, factor[:, :-1])
        values = least_squares_within(factor[:, :-1], factor[:, -1], lower, upper)
        residual, iterations, converged = target - jacobian @ values, 1, True
    else:
        first = after.values if after is not None else start
        if first is None:
            raise ValueError(
                f"{model.label}: found neither `start` nor `after`, expected one of them for a nonlinear model"
            )
        known = None
        if after is not None and after.is_exact and len(after.jacobian) == len(data.target):
            known = after.jacobian, data.target - after.residual
        # Reweighting moves the minimum only a little, so a few steps suffice.
        most = 60 if after is None else 8
        bounds = lower, upper
        values, (jacobian, effort), iterations, converged = _gauss_newton(model, data, w, bounds, first, most, known)
        residual = data.target - effort
    snapped, held = snap_to_bounds(values, lower, upper, jacobian, residual)
    left = residual - jacobian @ (snapped - values)
    is_exact = model.linear or not held.any()
    return Solution(snapped, jacobian, left, w, held, iterations, converged, is_exact)


ROWS_AT_ONCE = 1 << 13
"""Rows of a regressor that are factored at a time: they stay in the cache, where all rows of hours of data take three
times as long and hundreds of megabytes."""


def triangular_factor(columns: np.ndarray, *beside: np.ndarray) -> np.ndarray:
    """Return the triangular factor of `columns`, (m, p), with k further columns, (m,); at most (p + k, p + k).

    Least squares on it has the same solution and the same sum of squares as on all rows.
    """
    factor = np.empty((0, columns.shape[1] + len(beside)))
    for first in range(0, max(len(columns), 1), ROWS_AT_ONCE):
        some = slice(first, first + ROWS_AT_ONCE)
        part = np.column_stack([columns[some], *(x[some] for x in beside)])
        factor = np.asarray(np.linalg.qr(np.vstack([factor, part]) if len(factor) else part, mode="r"))
    return factor


def least_squares_within(w: np.ndarray, y: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the x, (p,), that minimises ||W x - y|| within bounds, with `w`, (m, p), and `y`, (m,).

    The solution is exact but for rounding: parameters on a bound lie on it, and the others solve the problem without
    them (active sets [1]_).

    References
    ----------
    .. [1] P. B. Stark, R. L. Parker, "Bounded-variable least-squares: an algorithm and applications", Computational
       Statistics 10, 1995.
    """
    factor = triangular_factor(w, y) if len(w) > w.shape[1] + 1 else np.column_stack([w, y])
    scale = column_norms(factor[:, :-1])
    scale[scale == 0.0] = 1.0
    r, c = factor[:, :-1] / scale, factor[:, -1]
    low, high = lower * scale, upper * scale
    x = _free_minimum(r, c, np.zeros(len(scale)), np.ones(len(scale), bool))
    if np.any(x < low) or np.any(x > high):
        x = _bounded_minimum(r, c, low, high, np.clip(x, low, high))
    return np.where(x <= low, lower, np.where(x >= high, upper, x / scale))


def _bounded_minimum(r: np.ndarray, c: np.ndarray, low: np.ndarray, high: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the x, (p,), that minimises ||R x - c|| within bounds, from a start within them."""
    free = (x > low) & (x < high)
    least, best = np.inf, x
    while True:
        x, free = _minimum_of_face(r, c, low, high, x, free)
        left = c - r @ x
        cost = float(left @ left)
        # Rounding may let a parameter leave its bound for no smaller sum of squares.
        if not cost < least:
            return best
        least, best = cost, x
        slope = r.T @ left
        inwards = np.where(x <= low, slope, -slope)
        inwards[free | (low == high)] = 0.0
        leaves = int(np.argmax(inwards))
        if inwards[leaves] <= 0.0:
            return x
        free[leaves] = True


def _minimum_of_face(
    r: np.ndarray, c: np.ndarray, low: np.ndarray, high: np.ndarray, x: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Move the `free` parameters of x, (p,), to their minimum; those that meet a bound on the way stay on it.

    Returns x and the parameters that are still free.
    """
    x, free = x.copy(), free.copy()
    while free.any():
        goal = _free_minimum(r, c, x, free)
        bound = np.where(goal < low, low, np.where(goal > high, high, np.nan))
        beyond = np.flatnonzero(free & ~np.isnan(bound))
        if not len(beyond):
            return goal, free
        share = (bound[beyond] - x[beyond]) / (goal[beyond] - x[beyond])
        first = beyond[np.argmin(share)]
        x += np.min(share) * (goal - x)
        x[first], free[first] = bound[first], False
    return x, free


def _free_minimum(r: np.ndarray, c: np.ndarray, x: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return x, (p,), with the `free` parameters where they minimise ||R x - c||."""
    goal = x.copy()
    goal[free] = np.linalg.lstsq(r[:, free], c - r[:, ~free] @ x[~free], rcond=None)[0]
    return goal


def _gauss_newton(
    model: ForceModel[MotionT],
    data: Stack[MotionT],
    w: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    start: np.ndarray,
    most: int,
    known: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], int, bool]:
    """Fit a nonlinear model by bounded least squares with `most` evaluations at most.

    `known` are the regressor and the effort at the start, where they are known. Returns the values, (p,), the
    regressor, (m, p), and the effort, (m,), there, the number of evaluations, and whether the search converged.
    """
    # Parameters are scaled by the effort they make, so that tolerances mean the same in newtons, volts and amperes.
    size = float(np.linalg.norm(data.target * w))
    rows = regression_rows(model, start, data) if known is None else known
    weighted = rows[0] * w[:, None]
    require_full_rank(model.names, weighted, model.label)
    scale = size / np.linalg.norm(weighted, axis=0)
    low, high = (bound / scale for bound in bounds)
    inside = np.clip(start / scale, low + 1e-6, np.where(np.isfinite(high), high - 1e-6, high))
    if not np.allclose(inside * scale, start, rtol=1e-15, atol=0.0):  # no more than rounding
        rows = regression_rows(model, inside * scale, data)
    # Regressors may be large: only the one with the least cost is kept, where the search ends.
    least, best = np.inf, (inside, rows)
    del rows, weighted

    def equations(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        nonlocal least, best
        jacobian, effort = best[1] if np.array_equal(x, best[0]) else regression_rows(model, x * scale, data)
        residual = (effort - data.target) * w / size
        slopes = jacobian * scale * (w / size)[:, None]
        cost = 0.5 * float(residual @ residual)
        if cost <= least:
            least, best = cost, (x, (jacobian, effort))
        return cost, slopes.T @ residual, slopes.T @ slopes

    found = bounded_least_squares(equations, inside, low, high, iterations=most, tolerance=1e-14, damping=1e-6)
    values = found.x * scale
    # The search may reject values whose cost is lower by rounding alone.
    rows = best[1] if np.array_equal(found.x, best[0]) else regression_rows(model, values, data)
    return values, rows, found.evaluations, found.converged


def nearest_feasible(
    jacobian: np.ndarray,
    residual: np.ndarray,
    values: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    room: Callable[[np.ndarray], np.ndarray | float],
    start: np.ndarray,
) -> tuple[np.ndarray, str]:
    """Return the feasible values, (p,), with the smallest residual, and the message of the search.

    The residual is linearised at `values`, (p,), with `jacobian`, (m, p), and `residual`, (m,), there. Feasible values
    lie within `bounds` and have `room` >= 0. The search begins at `start`, (p,).
    """
    from scipy.optimize import minimize

    size = float(np.linalg.norm(residual + jacobian @ values))
    scale = size / np.linalg.norm(jacobian, axis=0)
    scaled = jacobian * (scale / size)
    gram, moment, origin = scaled.T @ scaled, scaled.T @ (residual / size), values / scale

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        d = x - origin
        return float(0.5 * d @ gram @ d - moment @ d), gram @ d - moment

    found = minimize(
        cost,
        start / scale,
        jac=True,
        method="SLSQP",
        bounds=list(zip(bounds[0] / scale, bounds[1] / scale, strict=True)),
        constraints={"type": "ineq", "fun": lambda x: room(x * scale)},
        options={"maxiter": 500, "ftol": 1e-15},
    )
    return found.x * scale, str(found.message)


def snap_to_bounds(
    values: np.ndarray, lower: np.ndarray, upper: np.ndarray, jacobian: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Move values close to a bound onto it; return all values, (p,), and a mask of those that were moved, (p,).

    Close means nearer than a thousandth of the parameter's noise, from `jacobian`, (m, p), and `residual`, (m,).
    """
    power = column_squares(jacobian)
    noise = np.sqrt(np.mean(residual**2) / np.where(power > 0.0, power, np.inf))
    near = 1e-3 * noise + 1e-9 * np.abs(values)
    low, high = values - lower <= near, upper - values <= near
    return np.where(low, lower, np.where(high, upper, values)), low | high


def require_full_rank(
    names: Sequence[str], jacobian: np.ndarray, where: str, factor: np.ndarray | None = None
) -> None:
    """Refuse a regressor `jacobian`, (m, p), that is singular to working precision, naming the parameters concerned.

    `names` are the parameters. `where` begins the messages. `factor` is the triangular factor, if it is known.
    """
    if len(jacobian) <= jacobian.shape[1]:
        raise IdentificationError(
            f"{where}: {len(jacobian)} usable samples for {jacobian.shape[1]} parameters; expected many more: lengthen "
            "the recording, or lower decimate and dead_band"
        )
    norms = column_norms(jacobian)
    absent = [n for n, c in zip(names, norms, strict=True) if not c > 1e-12 * norms.max()]
    if absent:
        raise IdentificationError(
            f"{where}: {' and '.join(absent)} cannot be identified: nothing in the recordings excites "
            f"{'it' if len(absent) == 1 else 'them'}; record a motion that does"
        )
    _, singular, rows = np.linalg.svd((triangular_factor(jacobian) if factor is None else factor) / norms)
    if singular[-1] < 1e-7 * singular[0]:
        tied = [n for n, c in zip(names, rows[-1], strict=True) if abs(c) > 0.2]
        raise IdentificationError(
            f"{where}: {' and '.join(tied)} are not identifiable separately: their effects are proportional in "
            "these recordings; record a motion in which they differ"
        )


def make_parameters(
    names: Sequence[str],
    units: Sequence[str],
    values: np.ndarray,
    covariance: np.ndarray,
    held: np.ndarray | None = None,
    idle: np.ndarray | None = None,
    statistical: np.ndarray | None = None,
    causes: Sequence[str] = (),
) -> tuple[Parameter, ...]:
    """Build parameters from `values`, (p,), and their `covariance`, (p, p).

    `held`, (p,), marks values on a bound. A parameter is identifiable if its 95 % interval excludes 0 and it is not
    marked in `idle`, (p,). If the interval from coloured residuals alone, `statistical` (p, p), excludes 0 but the full
    one does not, a neglected effect may explain the whole value. The parameter then has no interval, for the reason
    from `causes`, (p,).
    """
    made = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        value, error = float(values[i]), float(np.sqrt(max(covariance[i, i], 0.0)))
        bound = held is not None and bool(held[i])
        shown = not bound and abs(value) > 1.959964 * error and not (idle is not None and idle[i])
        coloured = error if statistical is None else float(np.sqrt(max(statistical[i, i], 0.0)))
        hidden = not bound and 1.959964 * coloured < abs(value) <= 1.959964 * error
        why = f"{causes[i]} or other effects that the model lacks may explain all of it" if causes else ""
        refused = why if hidden else ""
        made.append(Parameter(name, unit, value, error, bound, shown, statistical_error=coloured, refused=refused))
    return tuple(made)


def remember_last_call(function: Callable[[np.ndarray], tuple]) -> Callable[[np.ndarray], tuple]:
    """Remember the last result of a `function` of one array: a search evaluates its start and its end again."""
    memory: dict[bytes, tuple] = {}

    def remembered(values: np.ndarray) -> tuple:
        key = values.tobytes()
        if key not in memory:
            memory.clear()
            memory[key] = function(values)
        return memory[key]

    return remembered


def some_columns(columns: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return the columns of (m, p) that a mask, (p,), selects; the array itself if these are all."""
    return columns if some.all() else columns[:, some]


def column_norms(columns: np.ndarray) -> np.ndarray:
    """Return the norm of each of `columns`, (m, p), shape (p,), as `numpy.linalg.norm` gives it.

    It keeps no squares in memory, and takes a quarter of the time.
    """
    return np.sqrt(column_squares(columns))


def column_squares(columns: np.ndarray) -> np.ndarray:
    """Return the sum of the squares of each of `columns`, (m, p), shape (p,)."""
    return np.einsum("ij,ij->j", columns, columns)


HUBER_THRESHOLD = 1.345
"""Huber's threshold in robust standard deviations. The estimate then has 95 % efficiency on Gaussian residuals."""


MAX_REWEIGHTINGS = 30
"""Largest number of iterations of robust reweighting."""


def robust_weights(residual: np.ndarray) -> np.ndarray:
    """Return the square roots of Huber's weights, (m,), for residuals scaled by their median absolute deviation."""
    scale = 1.4826 * np.median(np.abs(residual - np.median(residual))) + np.finfo(float).tiny
    return np.sqrt(np.minimum(1.0, HUBER_THRESHOLD * scale / np.maximum(np.abs(residual), np.finfo(float).tiny)))
