"""Least-squares solver for friction families.

Linear families are solved in one step. Load friction starts from the solution of its linear part. The Stribeck velocity
is found by profiling. Cross-validation is over blocks of time. Weighted and robust fits start from least squares.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.friction_terms import STRIBECK_VELOCITY
from ...models.joint import MAX_STRIBECK_SHARE, JointModel
from ...numerics.motion import Motion
from ...numerics.regression import (
    MAX_REWEIGHTINGS,
    Solution,
    Stack,
    column_norms,
    least_squares_within,
    regression_rows,
    require_full_rank,
    robust_weights,
    snap_to_bounds,
    solve,
    some_columns,
    triangular_factor,
)
from ...numerics.searches.scalar_search import minimise_on_interval

BLOCK_COUNT = 10
"""Number of blocks into which all data are cut; a block never spans two recordings."""


@dataclass(frozen=True)
class SolverSettings:
    """Steps and tolerances of the fits of a family, and where approximations do."""

    # Starting value of load coefficients, and of any other parameter outside the linear part.
    initial_load_coefficient: float = 0.05
    motion_subsampling: int = 8  # First steps over much data use one motion in this many
    min_subsampled_motions: int = 4  # First steps use part of the motions only if that part has at least this many
    max_steps: int = 8  # Largest number of Gauss-Newton steps over much data
    step_tolerance: float = 5e-4  # Gauss-Newton steps stop when one changes the effort by less than this share of it
    refining_step_tolerance: float = 2e-3  # The same tolerance for steps over all motions after steps over part of them
    equal_cost_share: float = 1e-9  # Costs that differ by at most this share are equal but for rounding
    speed_bins: int = 8  # Number of speed bands, each with a weight of its own in every recording


SOLVER_SETTINGS = SolverSettings()


def block_labels(lengths: Sequence[int]) -> list[np.ndarray]:
    """Return the block of each sample, (n_i,) per stretch of `lengths`; blocks are numbered over all stretches."""
    total, first, made = sum(lengths), 0, []
    for length in lengths:
        parts = max(1, round(BLOCK_COUNT * length / total))
        made.append(first + np.arange(length) * parts // max(length, 1))
        first += parts
    return made


def rows_of_blocks(labels: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Yield each block of `labels`, (m,), with its rows: a slice where they follow each other, else a mask, (m,)."""
    edges = np.flatnonzero(np.diff(labels)) + 1
    first, last = [0, *edges.tolist()], [*edges.tolist(), len(labels)]
    blocks = np.unique(labels)
    if len(blocks) == len(first):
        yield from sorted((int(labels[a]), slice(a, b)) for a, b in zip(first, last, strict=True))
    else:
        for block in blocks:
            yield int(block), labels == block


def values_without_blocks(
    found: Solution, labels: np.ndarray, instruments: np.ndarray | None = None
) -> dict[int, np.ndarray]:
    """Return the parameters, (p,), that a solution has without each block, by the block's number.

    `labels`, (m,), are the blocks of the solution's rows. The model is linearised at the solution, whose own weights
    and `instruments`, (m, p), are used. Parameters on a bound stay there.
    """
    return values_without_blocks_of_cuts(found, [labels], instruments)[0]


def values_without_blocks_of_cuts(
    found: Solution, cuts: Sequence[np.ndarray], instruments: np.ndarray | None = None
) -> list[dict[int, np.ndarray]]:
    """Return what `values_without_blocks` does for each of several `cuts` into blocks, labels of shape (m,)."""
    free = ~found.at_bound
    jacobian = some_columns(found.jacobian, free)
    scale = np.maximum(column_norms(jacobian), np.finfo(float).tiny)
    instrument = None if instruments is None else some_columns(instruments, free)
    # The cells between the borders of all cuts give the blocks of every cut. One at a time is scaled, to save memory.
    borders = np.flatnonzero(np.any([np.diff(labels) != 0 for labels in cuts], axis=0)) + 1
    edges = [0, *borders.tolist(), len(found.residual)]
    grams, moments = np.empty((len(edges) - 1, len(scale), len(scale))), np.empty((len(edges) - 1, len(scale)))
    for i, cell in enumerate(map(slice, edges[:-1], edges[1:])):
        weights = found.weights[cell, None]
        w = jacobian[cell] / scale * weights
        z = w if instrument is None else instrument[cell] / scale * weights
        grams[i], moments[i] = z.T @ w, z.T @ (found.residual[cell] * found.weights[cell])
    numbered = [np.unique(labels[edges[:-1]], return_inverse=True) for labels in cuts]
    kept = np.concatenate([owner != np.arange(len(blocks))[:, None] for blocks, owner in numbered]).astype(float)
    # The systems are small: those of all cuts are solved in one call.
    inverses = np.linalg.pinv(np.tensordot(kept, grams, 1), rcond=1e-10)
    values = np.tile(found.values, (len(kept), 1))
    values[:, free] += (inverses @ (kept @ moments)[:, :, None])[:, :, 0] / scale
    ends = np.cumsum([len(blocks) for blocks, _ in numbered])[:-1]
    parts = zip(numbered, np.split(values, ends), strict=True)
    return [dict(zip(blocks.tolist(), part, strict=True)) for (blocks, _), part in parts]


def residuals_without_blocks(
    residual: np.ndarray, jacobian: np.ndarray, values: np.ndarray, without: dict[int, np.ndarray], labels: np.ndarray
) -> np.ndarray:
    """Return residuals, (m,), in which each block is predicted by the parameters that were found without it.

    `residual`, (m,), and the model's `jacobian`, (m, p), are those at `values`, (p,).
    """
    steps = np.zeros((int(labels.max()) + 1, len(values)))
    for block, other in without.items():
        if block < len(steps):
            steps[block] = other - values
    left = residual.copy()
    for first in range(0, len(labels), MAX_REFITTED_ROWS):  # some rows at a time, to save memory
        some = slice(first, first + MAX_REFITTED_ROWS)
        left[some] -= np.einsum("ij,ij->i", jacobian[some], steps[labels[some]])
    return left


def cross_validated_residuals(found: Solution, lengths: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Return residuals of shape (n_i,) per stretch of `lengths`, each block predicted by a fit to the other blocks.

    The model is linearised at the solution. Parameters on a bound stay there.
    """
    labels = np.concatenate(block_labels(lengths))
    without = values_without_blocks(found, labels)
    crossed = residuals_without_blocks(found.residual, found.jacobian, found.values, without, labels)
    return tuple(np.split(crossed, np.cumsum(lengths)[:-1]))


MAX_REFITTED_ROWS = 50_000
"""Up to this many rows a family is fitted anew without each block. With more, a block hardly moves the solution, and
one linear step gives the same."""


def solve_family(
    model: JointModel,
    data: Stack[Motion],
    *,
    weights: np.ndarray | None = None,
    consistent: bool = True,
    after: Solution | None = None,
) -> Solution:
    """Minimise the squared effort residuals of a `model` on `data`, multiplied by `weights`, (m,).

    `consistent` keeps inertia, friction levels and load coefficients physical. `after` is an earlier solution on the
    same data, from which the search starts.
    """
    if model.shape_index is not None:
        w = np.ones(len(data.target)) if weights is None else np.asarray(weights, float)
        return _profile_stribeck_velocity(model, data, w, consistent, after)
    lower, upper = model.bounds()
    if not consistent:
        free = np.array([s.linear for s in model.symbols])
        lower, upper = np.where(free, -np.inf, lower), np.where(free, np.inf, upper)
    start = None if model.linear or after is not None else _from_linear_part(model, data, weights)
    return solve(model, data, weights=weights, bounds=(lower, upper), start=start, after=after)


def cross_validate_family(model: JointModel, data: Stack[Motion], found: Solution) -> tuple[np.ndarray, ...]:
    """Return effort residuals, (n_i,) per stretch, each block predicted by a fit to the other blocks.

    `found` is the solution by `solve_family` on all of `data`. For the fit without a block its rows get no weight, and
    the search starts at the solution. Above `MAX_REFITTED_ROWS` rows, and where a block alone shows a parameter, the
    model is linearised instead.
    """
    labels = np.concatenate(block_labels(data.lengths))
    without, left = values_without_blocks(found, labels), dict[int, np.ndarray]()
    if len(labels) <= MAX_REFITTED_ROWS:
        start = found if model.linear else _with_exact_rows(model, data, found)
        for block in without:
            weights = np.where(labels == block, 0.0, found.weights)
            try:
                other = solve_family(model, data, weights=weights, after=start)
            except IdentificationError:
                continue
            without[block] = other.values
            if other.is_exact:
                left[block] = other.residual
    if len(labels) > MAX_REFITTED_ROWS or model.linear:
        crossed = residuals_without_blocks(found.residual, found.jacobian, found.values, without, labels)
    else:
        crossed = np.empty(len(labels))
        for block, values in without.items():
            own = labels == block
            residual = left[block] if block in left else data.target - regression_rows(model, values, data)[1]
            crossed[own] = residual[own]
    return tuple(np.split(crossed, np.cumsum(data.lengths)[:-1]))


def _with_exact_rows(model: JointModel, data: Stack[Motion], found: Solution) -> Solution:
    """Return a solution with the regressor and the residual at its values, which many searches start from."""
    if found.is_exact:
        return found
    jacobian, effort = regression_rows(model, found.values, data)
    return replace(found, jacobian=jacobian, residual=data.target - effort, is_exact=True)


def solve_from_part(model: JointModel, data: Stack[Motion], found: Solution) -> Solution:
    """Minimise over much `data` from the solution `found` on a part of it.

    Linear families take one step. Others take Gauss-Newton steps, first on part of the motions (`motion_subsampling`).
    """
    if model.linear:
        return solve_family(model, data)
    some = slice(None, None, SOLVER_SETTINGS.motion_subsampling)
    values, fewer = found.values, Stack(data.motions[some], data.targets[some])
    if len(fewer.motions) >= SOLVER_SETTINGS.min_subsampled_motions:
        values = _gauss_newton_steps(model, fewer, values, SOLVER_SETTINGS.step_tolerance).values
        return _gauss_newton_steps(model, data, values, SOLVER_SETTINGS.refining_step_tolerance)
    return _gauss_newton_steps(model, data, values, SOLVER_SETTINGS.step_tolerance)


def _gauss_newton_steps(model: JointModel, data: Stack[Motion], values: np.ndarray, close: float) -> Solution:
    """Take bounded Gauss-Newton steps from `values`, (p,), until one changes the effort by less than a share `close`.

    The remaining error is of the order of its square. The solution's Jacobian is from before the last step, its
    residual from after it.
    """
    lower, upper = model.bounds()
    for iteration in range(1, SOLVER_SETTINGS.max_steps + 1):  # noqa: B007
        jacobian, effort = regression_rows(model, values, data)
        residual = data.target - effort
        # A Stribeck velocity without a Stribeck level has no effect at all.
        norms = column_norms(jacobian)
        free = norms > 1e-12 * norms.max()
        triangle = triangular_factor(some_columns(jacobian, free), residual)
        require_full_rank([n for n, f in zip(model.names, free, strict=True) if f], triangle[:, :-1], model.label)
        low, high = lower.copy(), upper.copy()
        if model.shape_index is not None:
            # A step changes the Stribeck velocity by at most a factor of two, because it may be poorly determined.
            at = model.shape_index
            slowest = min(_min_stribeck_velocity(data, upper[at]), values[at])
            low[at], high[at] = max(0.5 * values[at], slowest), min(2.0 * values[at], upper[at])
        room = (low - values)[free], (high - values)[free]
        step = np.zeros(len(values))
        step[free] = least_squares_within(triangle[:, :-1], triangle[:, -1], *room)
        values, moved = values + step, jacobian @ step
        residual = residual - moved
        near = bool(np.linalg.norm(moved) < close * np.linalg.norm(data.target))
        if near:
            break
    snapped, held = snap_to_bounds(values, lower, upper, jacobian, residual)
    if model.shape_index is not None:
        free[model.shape_index] = False  # a Stribeck velocity of 0 is none, however little it may matter
    snapped, held = np.where(free, snapped, values), held & free
    residual = residual - jacobian @ (snapped - values)
    return Solution(snapped, jacobian, residual, np.ones(len(residual)), held, iteration, near)


def _from_linear_part(model: JointModel, data: Stack[Motion], weights: np.ndarray | None) -> np.ndarray:
    """Return starting values, (p,), from the fit of the model's linear part."""
    linear = replace(model, symbols=tuple(s for s in model.symbols if s.linear))
    base = dict(zip(linear.names, solve(linear, data, weights=weights).values, strict=True))
    return np.array([base.get(name, SOLVER_SETTINGS.initial_load_coefficient) for name in model.names])


def with_known_stribeck_velocity(model: JointModel, velocity: float) -> JointModel:
    """Return the model with its Stribeck velocity fixed. The other parameters are then linear, or nearly so."""
    symbols = tuple(s for s in model.symbols if s.name != STRIBECK_VELOCITY.name)
    return replace(model, symbols=symbols, known={**model.known, STRIBECK_VELOCITY.name: velocity})


def _profile_stribeck_velocity(
    model: JointModel, data: Stack[Motion], w: np.ndarray, consistent: bool, after: Solution | None
) -> Solution:
    """Profile over the Stribeck velocity. With it fixed, the other parameters have no local minima."""
    at = model.names.index(STRIBECK_VELOCITY.name)
    top = float(model.bounds()[1][at])
    if not np.isfinite(top):
        top = MAX_STRIBECK_SHARE * max(float(np.abs(m.velocity).max()) for m in data.motions)
    previous = (
        None
        if after is None
        else replace(after, values=np.delete(after.values, at), jacobian=np.delete(after.jacobian, at, axis=1))
    )
    tried: dict[float, Solution] = {}

    def cost(log_velocity: float) -> float:
        velocity = float(np.exp(log_velocity))
        held = with_known_stribeck_velocity(model, velocity)
        # A nonlinear problem starts from the last velocity's solution; a linear one must not reuse that regressor.
        near = previous if held.linear else next(reversed(tried.values()), previous)
        try:
            found = solve_family(held, data, weights=w, consistent=consistent, after=near)
        except IdentificationError:
            return np.inf  # no sample is slow enough for so small a Stribeck velocity
        tried[velocity] = replace(found, jacobian=np.empty((0, len(held.names))))  # regressors may be large
        return float(np.sum((found.residual * w) ** 2))

    if after is not None:
        cost(np.log(after.values[at]))
    else:
        grid = np.log(np.geomspace(_min_stribeck_velocity(data, top), top, 6))
        costs = [cost(x) for x in grid]
        best = int(np.argmin(costs))
        if np.isfinite(costs[best]) and tried[float(np.exp(grid[best]))].values[_stribeck_index(model)] > 0.0:
            low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
            minimise_on_interval(cost, low, high, tolerance=0.02, evaluations=12)
    if not tried:
        raise IdentificationError(
            f"stribeck cannot be identified (family '{model.family}'): found no sample between the dead band and "
            f"{top:.3g} {'rad/s' if model.motion == 'rotary' else 'm/s'}, expected some: record slow motion, or lower "
            "dead_band"
        )
    cost_of = {v: float(np.sum((each.residual * w) ** 2)) for v, each in tried.items()}
    velocity = min(cost_of, key=lambda v: cost_of[v])
    if tried[velocity].values[_stribeck_index(model)] <= 0.0:
        # Without a Stribeck level all velocities are alike but for rounding. The largest is hardest to tell from
        # viscous friction, so the other intervals are the widest that any velocity would give them.
        lowest = cost_of[velocity]
        velocity = max(v for v, each in cost_of.items() if each <= (1.0 + SOLVER_SETTINGS.equal_cost_share) * lowest)
    found = tried[velocity]
    values = np.insert(found.values, at, velocity)
    held = np.insert(found.at_bound, at, velocity >= 0.999 * top)
    jacobian, effort = regression_rows(model, values, data)
    residual = data.target - effort
    if after is None and found.values[_stribeck_index(model)] > 0.0 and not held[at]:
        values, jacobian, residual = _polish(model, data, w, values, jacobian, residual, ~held)
    return replace(
        found, values=values, jacobian=jacobian, residual=residual, at_bound=held, iterations=len(tried), is_exact=True
    )


def _min_stribeck_velocity(data: Stack[Motion], top: float) -> float:
    """Return the smallest Stribeck velocity in the search up to `top` [rad/s or m/s].

    Below the dead band the Stribeck level would be an extrapolation.
    """
    return min(max(0.02 * top, 2.0 * max(m.filtering.dead_band for m in data.motions)), top)


def _polish(
    model: JointModel,
    data: Stack[Motion],
    w: np.ndarray,
    values: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    free: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Take Gauss-Newton steps over all free parameters together while they reduce the cost and stay within bounds."""
    lower, upper = model.bounds()
    for _ in range(4):
        scale = np.linalg.norm(jacobian[:, free], axis=0)
        step = np.zeros(len(values))
        step[free] = np.linalg.lstsq(jacobian[:, free] / scale * w[:, None], residual * w, rcond=None)[0] / scale
        trial = values + step
        if np.any(trial < lower) or np.any(trial > upper):
            break
        trial_jacobian, effort = regression_rows(model, trial, data)
        if not np.sum(((data.target - effort) * w) ** 2) < np.sum((residual * w) ** 2):
            break
        values, jacobian, residual = trial, trial_jacobian, data.target - effort
    return values, jacobian, residual


def _stribeck_index(model: JointModel) -> int:
    """Return the index of the Stribeck level among the parameters without the Stribeck velocity."""
    names = [n for n in model.names if n != STRIBECK_VELOCITY.name]
    return names.index(STRIBECK_VELOCITY.shapes)


def speed_weights(model: JointModel, data: Stack[Motion], residual: np.ndarray) -> np.ndarray:
    """Return weights, (m,): 1 / standard deviation of the residual, per recording and per band of speed.

    Friction models err most at low speed, so those samples get less weight. `residual` has shape (m,).
    """
    speed = data.reduced([np.abs(m.velocity) for m in data.motions])
    edges = np.quantile(speed, np.linspace(0.0, 1.0, SOLVER_SETTINGS.speed_bins + 1)[1:-1])
    band = np.searchsorted(edges, speed)
    owner = np.repeat(np.arange(len(data.motions)), data.lengths)
    group = owner * SOLVER_SETTINGS.speed_bins + band
    power = np.bincount(group, residual**2)
    count = np.bincount(group)
    free = 1.0 - len(model.symbols) / len(residual)
    sd = np.sqrt(power[group] / np.maximum(count[group], 1) / free)
    floor = 0.05 * np.sqrt(np.mean(residual**2)) + np.finfo(float).tiny
    return 1.0 / np.maximum(sd, floor)


def solve_weighted(model: JointModel, data: Stack[Motion], first: Solution) -> Solution:
    """Solve weighted least squares with weights from the residuals of `first`, refined twice."""
    found = first
    for _ in range(3):
        w = speed_weights(model, data, found.residual)
        found = solve_family(model, data, weights=w, after=found)
    return found


def solve_robust(model: JointModel, data: Stack[Motion], first: Solution) -> Solution:
    """Solve iteratively reweighted least squares with Huber's weights.

    Iterations end when no parameter changes by more than 1e-4 of its value.
    """
    found = first
    for iteration in range(MAX_REWEIGHTINGS):
        w = robust_weights(found.residual)
        before, found = found, solve_family(model, data, weights=w, after=found)
        step = np.max(np.abs(found.values - before.values) / np.maximum(np.abs(before.values), 1e-9))
        if step < 1e-4:
            return replace(found, iterations=iteration + 1, converged=True)
    return replace(found, iterations=MAX_REWEIGHTINGS, converged=False)
