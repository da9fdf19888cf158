r"""Least squares on filtered data, with physical bounds.

The regressor is the exact Jacobian of the core's inverse dynamics, so that one procedure serves the families that are
linear in their parameters (one Gauss-Newton step is then ordinary least squares, IDIM-LS [1]_) and those that are not:

.. math::
   F\,\tau = F\,\tau_{model}(q, \dot q, \ddot q; \beta) + \rho, \qquad W = F\,\partial\tau_{model}/\partial\beta

with F the same zero-phase filter and decimation on both sides.

.. [1] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.joint import STRIBECK_SHARE, JointModel
from ...signals.motion import SMOOTH_TERMS, Motion

LOAD_START = 0.05


@dataclass(frozen=True)
class Stack:
    """Reduced samples of several motions, ready to be solved.

    Parameters
    ----------
    motions : tuple of Motion
    targets : tuple of ndarray
        Filtered effort of each motion, reduced, scored samples only; shape (m_i,).
    scored : tuple of ndarray
        Which reduced samples of each motion are used, bool, shapes (n_i,).
    """

    motions: tuple[Motion, ...]
    targets: tuple[np.ndarray, ...]
    scored: tuple[np.ndarray, ...]

    @property
    def target(self) -> np.ndarray:
        """All targets, shape (m,), in the effort's unit."""
        return np.concatenate(self.targets)

    @property
    def lengths(self) -> list[int]:
        """Samples of each motion."""
        return [len(t) for t in self.targets]

    def reduced(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Reduce one signal (n_i,) or (n_i, k) per motion, keep the scored samples, and stack."""
        parts = [m.reduce(x)[keep] for m, x, keep in zip(self.motions, signals, self.scored, strict=True)]
        return np.concatenate(parts)


def stack(motions: Sequence[Motion]) -> Stack:
    """Reduce the effort of every motion and mark the samples faster than the dead band.

    Parameters
    ----------
    motions : sequence of Motion

    Returns
    -------
    Stack

    Raises
    ------
    IdentificationError
        If there is no motion, or nothing in them is faster than the dead band.
    """
    if not motions:
        raise IdentificationError('no recording is marked use = "fit"; at least one must be')
    scored = tuple(m.moving for m in motions)
    if not any(s.any() for s in scored):
        top = max(float(np.abs(m.velocity).max()) for m in motions)
        raise IdentificationError(
            f"no sample is faster than the dead band of {motions[0].filtering.dead_band:g}: the fastest is {top:.3g}; "
            "lower [processing] dead_band or record a faster motion"
        )
    return Stack(tuple(motions), tuple(m.reduce(m.effort)[s] for m, s in zip(motions, scored, strict=True)), scored)


def predicted(model: JointModel, values: np.ndarray, motions: Sequence[Motion]) -> list[np.ndarray]:
    """The model's effort for each motion, with the true sign of the velocity, filtered as the measured effort was.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
    motions : sequence of Motion

    Returns
    -------
    list of ndarray, shapes (n_i,)
        At full rate.
    """
    bare = model.vector(values)
    efforts = []
    for m in motions:
        vector = model.loaded(bare, *m.payload)
        smooth = m.smooth_regressor @ vector[SMOOTH_TERMS]
        whole = _core.inverse_dynamics(vector, m.position, m.velocity, m.acceleration)
        efforts.append(smooth + m.smooth(whole - smooth))
    return efforts


def linearised(
    model: JointModel, values: np.ndarray, motions: Sequence[Motion]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Efforts and regressors of each motion, filtered as the measured effort was: terms that are smooth in filtered
    states are filtered already, those in the sign of velocity are not.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
        Where a family that is not linear is linearised.
    motions : sequence of Motion

    Returns
    -------
    efforts : list of ndarray, shapes (n_i,)
    regressors : list of ndarray, shapes (n_i, p)
    """
    bare, spread = model.vector(values), model.spread()
    active = np.flatnonzero(spread.any(axis=1))
    efforts, regressors = [], []
    for m in motions:
        vector = model.loaded(bare, *m.payload)
        effort, jacobian = _core.inverse_dynamics_jacobian(vector, m.position, m.velocity, m.acceleration, active)
        whole = np.column_stack([effort, jacobian @ spread[active]])
        smooth = m.smooth_regressor @ np.column_stack([vector, spread])[SMOOTH_TERMS]
        signs = whole - smooth
        kept = signs.any(axis=0)
        filtered = smooth.copy()
        filtered[:, kept] += m.smooth(signs[:, kept])
        efforts.append(filtered[:, 0])
        regressors.append(filtered[:, 1:])
    return efforts, regressors


def last_call(function: Callable[[np.ndarray], tuple]) -> Callable[[np.ndarray], tuple]:
    """Remember the last point: SciPy asks for residual and Jacobian of the same point in two calls.

    Parameters
    ----------
    function : callable
        Of one array, shape (p,).

    Returns
    -------
    callable
    """
    memory: dict[bytes, tuple] = {}

    def remembered(values: np.ndarray) -> tuple:
        key = values.tobytes()
        if key not in memory:
            memory.clear()
            memory[key] = function(values)
        return memory[key]

    return remembered


@dataclass(frozen=True)
class Solution:
    """Where a solver ended.

    `values` (p,), `jacobian` (m, p) and `residual` (m,) at the solution, on reduced scored samples; `weights` (m,)
    multiplied residuals; `at_bound` (p,) marks active bounds.
    """

    values: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    weights: np.ndarray
    at_bound: np.ndarray
    iterations: int
    converged: bool


def at_bounds(
    model: JointModel, values: np.ndarray, jacobian: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values closer to a physical bound than a thousandth of their noise are on it.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
    jacobian : ndarray, shape (m, p)
    residual : ndarray, shape (m,)

    Returns
    -------
    values : ndarray, shape (p,)
        With those exactly at their bounds.
    at_bound : ndarray of bool, shape (p,)
    """
    lower, upper = model.bounds()
    power = np.sum(jacobian**2, axis=0)
    noise = np.sqrt(np.mean(residual**2) / np.where(power > 0.0, power, np.inf))
    near = 1e-3 * noise + 1e-9 * np.abs(values)
    low, high = values - lower <= near, upper - values <= near
    return np.where(low, lower, np.where(high, upper, values)), low | high


def solve(
    model: JointModel,
    data: Stack,
    *,
    weights: np.ndarray | None = None,
    consistent: bool = True,
    after: Solution | None = None,
) -> Solution:
    """Minimise the weighted sum of squared effort residuals.

    Parameters
    ----------
    model : JointModel
    data : Stack
    weights : ndarray, shape (m,), optional
        Factors on residuals (1 / standard deviation); all 1 if left out.
    consistent : bool
        Keep inertia, friction levels and load coefficients physical.
    after : Solution, optional
        An earlier solution on the same data: a linear family reuses its regressor, a nonlinear one starts there
        (without it, at its own linear part).

    Returns
    -------
    Solution

    Raises
    ------
    IdentificationError
        If the regressor is singular: the message names the parameters that cannot be told apart.
    """
    w = np.ones(len(data.target)) if weights is None else np.asarray(weights, float)
    if "stribeck_velocity" in model.names:
        return _solve_stribeck(model, data, w, consistent, after)
    lower, upper = model.bounds()
    if not consistent:
        free = np.array([s.linear for s in model.symbols])
        lower, upper = np.where(free, -np.inf, lower), np.where(free, np.inf, upper)
    if model.linear:
        if after is None:
            jacobian, effort = _rows(model, np.zeros(len(model.symbols)), data)
            target = data.target - effort
        else:
            jacobian, target = after.jacobian, after.residual + after.jacobian @ after.values
        values = _solve_linear(model, jacobian * w[:, None], target * w, lower, upper)
        residual, iterations, converged = target - jacobian @ values, 1, True
    else:
        values, iterations, converged = _solve_nonlinear(model, data, w, lower, upper, after)
        jacobian, effort = _rows(model, values, data)
        residual = data.target - effort
    held = np.zeros(len(values), bool)
    if consistent:
        snapped, held = at_bounds(model, values, jacobian, residual)
        residual, values = residual - jacobian @ (snapped - values), snapped
    return Solution(values, jacobian, residual, w, held, iterations, converged)


def _rows(model: JointModel, values: np.ndarray, data: Stack) -> tuple[np.ndarray, np.ndarray]:
    """Reduced regressor (m, p) and effort (m,) at `values`."""
    efforts, regressors = linearised(model, values, data.motions)
    rows = data.reduced([np.column_stack(pair) for pair in zip(efforts, regressors, strict=True)])
    return rows[:, 1:], rows[:, 0]


def _solve_linear(
    model: JointModel, jacobian: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    require_full_rank(model, jacobian)
    values = np.linalg.lstsq(jacobian, target, rcond=None)[0]
    if np.all(values >= lower) and np.all(values <= upper):
        return values
    from scipy.optimize import lsq_linear  # only where a bound is crossed: a study is checked without

    scale = np.linalg.norm(jacobian, axis=0)
    found = lsq_linear(jacobian / scale, target, bounds=(lower * scale, upper * scale), tol=1e-12)
    return np.clip(found.x / scale, lower, upper)


def _solve_nonlinear(
    model: JointModel, data: Stack, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, after: Solution | None
) -> tuple[np.ndarray, int, bool]:
    """Bounded least squares over a family with load friction, from its linear part or from an earlier solution."""
    from scipy.optimize import least_squares

    if after is None:
        linear = replace(model, symbols=tuple(s for s in model.symbols if s.linear))
        base = dict(zip(linear.names, solve(linear, data, weights=w).values, strict=True))
        start = np.array([base.get(name, LOAD_START) for name in model.names])
    else:
        start = after.values
    # Parameters in units of the effort they make: tolerances then mean the same in newtons, volts and amperes.
    size = float(np.linalg.norm(data.target * w))
    scale = size / np.linalg.norm(_rows(model, start, data)[0] * w[:, None], axis=0)

    @last_call
    def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        jacobian, effort = _rows(model, x * scale, data)
        return (effort - data.target) * w / size, jacobian * scale * w[:, None] / size

    low, high = lower / scale, upper / scale
    inside = np.clip(start / scale, low + 1e-6, np.where(np.isfinite(high), high - 1e-6, high))
    found = least_squares(
        lambda x: both(x)[0],
        inside,
        jac=lambda x: both(x)[1],
        bounds=(low, high),
        xtol=1e-8,
        ftol=1e-12,
        gtol=1e-12,
        # Reweighting moves the minimum a little each time: a few steps follow it.
        max_nfev=60 if after is None else 8,
    )
    return found.x * scale, int(found.nfev), bool(found.success)


def with_known_stribeck_velocity(model: JointModel, velocity: float) -> JointModel:
    """The same family with its Stribeck velocity held: the rest is then linear, or as good as."""
    symbols = tuple(s for s in model.symbols if s.name != "stribeck_velocity")
    return replace(model, symbols=symbols, known={**model.known, "stribeck_velocity": velocity})


def _solve_stribeck(
    model: JointModel, data: Stack, w: np.ndarray, consistent: bool, after: Solution | None
) -> Solution:
    """Profile over the Stribeck velocity: given it, the others follow without a local minimum to fall into."""
    from scipy.optimize import minimize_scalar

    at = model.names.index("stribeck_velocity")
    top = float(model.bounds()[1][at])
    if not np.isfinite(top):
        top = STRIBECK_SHARE * max(float(np.abs(m.velocity).max()) for m in data.motions)
    previous = (
        None
        if after is None
        else replace(after, values=np.delete(after.values, at), jacobian=np.delete(after.jacobian, at, axis=1))
    )
    tried: dict[float, Solution] = {}

    def cost(log_velocity: float) -> float:
        velocity = float(np.exp(log_velocity))
        held = with_known_stribeck_velocity(model, velocity)
        # A nonlinear rest starts where the last velocity's ended; a linear one must not reuse its regressor.
        near = previous if held.linear else (list(tried.values()) or [previous])[-1]
        try:
            found = solve(held, data, weights=w, consistent=consistent, after=near)
        except IdentificationError:
            return np.inf  # no sample is slow enough to show so small a velocity
        tried[velocity] = found
        return float(np.sum((found.residual * w) ** 2))

    if after is not None:
        cost(np.log(after.values[at]))
    else:
        # Below the dead band the extra level would be an extrapolation.
        lowest = min(max(0.02 * top, 2.0 * max(m.filtering.dead_band for m in data.motions)), top)
        grid = np.log(np.geomspace(lowest, top, 6))
        costs = [cost(x) for x in grid]
        best = int(np.argmin(costs))
        if np.isfinite(costs[best]) and tried[float(np.exp(grid[best]))].values[_stribeck_at(model)] > 0.0:
            around = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
            minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 0.02, "maxiter": 12})
    if not tried:
        raise IdentificationError(
            f"stribeck cannot be identified: no sample is slower than {top:.3g} and outside the dead band "
            f"(family '{model.family}')"
        )
    velocity = min(tried, key=lambda v: float(np.sum((tried[v].residual * w) ** 2)))
    found = tried[velocity]
    values = np.insert(found.values, at, velocity)
    held = np.insert(found.at_bound, at, velocity >= 0.999 * top)
    jacobian, effort = _rows(model, values, data)
    residual = data.target - effort
    if after is None and found.values[_stribeck_at(model)] > 0.0 and not held[at]:
        values, jacobian, residual = _polished(model, data, w, values, jacobian, residual, ~held)
    return replace(found, values=values, jacobian=jacobian, residual=residual, at_bound=held, iterations=len(tried))


def _polished(
    model: JointModel,
    data: Stack,
    w: np.ndarray,
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    free: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss-Newton steps over all free parameters together, as long as they help and stay physical."""
    lower, upper = model.bounds()
    for _ in range(4):
        scale = np.linalg.norm(jacobian[:, free], axis=0)
        step = np.zeros(len(values))
        step[free] = np.linalg.lstsq(jacobian[:, free] / scale * w[:, None], residual * w, rcond=None)[0] / scale
        trial = values + step
        if np.any(trial < lower) or np.any(trial > upper):
            break
        trial_jacobian, effort = _rows(model, trial, data)
        if not np.sum(((data.target - effort) * w) ** 2) < np.sum((residual * w) ** 2):
            break
        values, jacobian, residual = trial, trial_jacobian, data.target - effort
    return values, jacobian, residual


def _stribeck_at(model: JointModel) -> int:
    names = [n for n in model.names if n != "stribeck_velocity"]
    return names.index("stribeck")


def require_full_rank(model: JointModel, jacobian: np.ndarray) -> None:
    """Refuse a regression that is singular to working precision.

    Parameters
    ----------
    model : JointModel
    jacobian : ndarray, shape (m, p)

    Raises
    ------
    IdentificationError
        Naming each parameter whose column is zero, or the parameters whose columns are collinear.
    """
    if len(jacobian) <= jacobian.shape[1]:
        raise IdentificationError(
            f"{len(jacobian)} usable samples for the {jacobian.shape[1]} parameters of family '{model.family}'; "
            "expected many more: lengthen the recording or lower [processing] decimate and dead_band"
        )
    norms = np.linalg.norm(jacobian, axis=0)
    top = norms.max()
    absent = [n for n, c in zip(model.names, norms, strict=True) if not c > 1e-12 * top]
    if absent:
        raise IdentificationError(
            f"{' and '.join(absent)} cannot be identified: nothing in the recordings excites "
            f"{'it' if len(absent) == 1 else 'them'} (family '{model.family}')"
        )
    _, singular, rows = np.linalg.svd(jacobian / norms, full_matrices=False)
    if singular[-1] < 1e-7 * singular[0]:
        tied = [n for n, c in zip(model.names, rows[-1], strict=True) if abs(c) > 0.2]
        raise IdentificationError(
            f"{' and '.join(tied)} cannot be told apart in these recordings: their effects are proportional "
            f"(family '{model.family}')"
        )
