r"""Estimate the presliding travel of a joint: the distance over which friction builds up before the contacts slip.

While the contacts bend, friction is its level times s, and s depends on the path of the position alone
(``include/pellucid/presliding.hpp``). For a given travel s is known along a recording, and the model is linear:

.. math::
   \tau = J\ddot q + g_s\sin q + g_c\cos q + \tau_0 + F_v \dot q + (F_c + F_s e^{-(\dot q / v_s)^2} + \alpha |y|)\, s(q)

Both sides are filtered as in every regression. The load y and the Stribeck velocity are those of the model that slips
at once. The travel with the smallest squared residual is searched on a grid and refined by a parabola.

Its variance is the sum of two squares. The first is a factor times the spread of the same search on bootstrapped blocks
[1]_. The second is the change of the travel when the terms of the level are omitted one by one. An error in the level
biases the travel in the same way in every stroke, which the bootstrap does not show. The factor comes from simulated
benches with contacts of this law; for a joint with another law the interval is not valid. Slow samples, which other
regressions exclude, are all included, because they show the travel.

.. [1] H. R. Kuensch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17, 1989.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ...models.estimates import Parameter
from ...models.filtered_dynamics import SMOOTH_TERMS, regressor
from ...models.friction_terms import STRIBECK_FRICTION, STRIBECK_VELOCITY, grows_with_load
from ...models.joint import NAMES, PARAMETER_FIELDS, PARAMETER_INDEX, UNITS, JointModel
from ...numerics.block_test import SIGNIFICANCE_LEVEL, p_value_of_larger_loss
from ...numerics.distributions import normal_quantile
from ...numerics.filters import local_cubic
from ...numerics.motion import Motion


@dataclass(frozen=True)
class PreslidingSearch:
    """Settings of the search for the travel, and of its bootstrap."""

    grid_steps_per_decade: int = 8  # Number of travels per decade on the search grid
    max_travel: float = 0.1  # Largest travel in the search [rad or m]
    max_travel_range_share: float = 0.25  # Largest travel in the search, as a share of the range of motion
    # Number of samples in the cubic smoother that estimates the encoder's resolution.
    resolution_window_samples: int = 9
    # A travel is reported only if its interval lies above this many steps of the encoder.
    min_encoder_steps: float = 2.0
    bootstrap_draw_count: int = 400  # Number of bootstrap samples
    bootstrap_seed: int = 20261122  # Random seed of the bootstrap
    # Length of a bootstrap block [s]. It is about one stroke, over which unmodelled friction stays the same.
    block_length_s: float = 1.0
    min_blocks: int = 12  # Smallest number of blocks from which a travel is estimated
    # Factor on the bootstrap's standard error. On 48 recordings of 16 simulated benches the actual error was 1.6 times
    # that standard error.
    bootstrap_error_factor: float = 2.0


PRESLIDING_SEARCH = PreslidingSearch()


TRAVELS_AT_ONCE = 8
"""Number of travels whose friction is filtered at a time, in about the time of one."""


ALWAYS_FREE_TERMS = frozenset({"inertia", "offset", "viscous_positive", "viscous_negative"})
"""Terms of the smooth dynamics that are free in every fit."""


@dataclass(frozen=True)
class Presliding:
    """Estimate of a joint's presliding travel: a value, an upper bound, or the reason why there is neither."""

    travel: Parameter | None = None  # estimated travel; None if the recordings do not determine it
    below: float | None = None  # upper bound of the travel [rad or m]; None if there is a value, or no bound
    why: str = ""  # reason why there is no value
    resolution: float = float("nan")  # resolution of the recorded position [rad or m]
    slips: float = float("nan")  # RMS effort error, on held-out recordings if any, with friction that slips at once
    gives: float = float("nan")  # the same error with presliding friction
    p_value: float = 1.0  # p value of the hypothesis that presliding friction explains the fitted motions no better


@dataclass(frozen=True)
class _Stroke:
    """A motion with its slow samples, and the parts of its regression that do not depend on the travel."""

    motion: Motion
    fixed: np.ndarray  # columns that do not depend on the travel, (m, k)
    target: np.ndarray  # effort without the payload's, (m,)
    levels: np.ndarray  # terms of the friction level, (n, 1 to 3): 1, |y|, the rise towards rest

    def at(self, travels: Sequence[float]) -> list[np.ndarray]:
        """Return the regressor, (m, k + 1 to 3), for each of a few `travels`; friction slips at once if one is 0."""
        m = self.motion
        directions = [_core.presliding(travel, m.position) if travel else np.sign(m.velocity) for travel in travels]
        levels = m.rows(m.smooth(np.hstack([direction[:, None] * self.levels for direction in directions])))
        return [np.hstack([self.fixed, own]) for own in np.split(levels, len(travels), axis=1)]


def with_slow_samples(motion: Motion) -> Motion:
    """Return the motion with its slow samples."""
    return replace(motion, filtering=replace(motion.filtering, dead_band=0.0))


def with_presliding(motion: Motion, travel: float) -> Motion:
    """Return the motion, with its slow samples, whose friction builds up over a `travel` [rad or m].

    Friction families that are fitted to it, and their predictions of it, have presliding friction.
    """
    return replace(with_slow_samples(motion), direction=_core.presliding(travel, motion.position))


def position_resolution(motions: Sequence[Motion]) -> float:
    """Estimate the resolution of recorded positions [rad or m].

    It is the step of an encoder whose readings deviate as much from a local cubic as these do.
    """
    found = [0.0]
    for m in motions:
        assert m.raw_position is not None  # motions of recordings keep it
        beside = m.raw_position - local_cubic(m.raw_position, PRESLIDING_SEARCH.resolution_window_samples)
        found.append(2.0 * float(np.quantile(np.abs(beside[m.inner]), 0.99)))
    return max(found)


def estimate_presliding(
    model: JointModel, values: np.ndarray, fitted: Sequence[Motion], held: Sequence[Motion], level: float = 0.95
) -> Presliding:
    """Estimate the travel from `fitted` motions, and test it on these; tell the errors on `held` ones.

    A `model` that slips at once, with `values`, (p,), gives the terms of the friction level and the payloads' effort.
    The interval is at `level`.
    """
    resolution = position_resolution(fitted)
    top = min(
        PRESLIDING_SEARCH.max_travel,
        PRESLIDING_SEARCH.max_travel_range_share * max(float(np.ptp(m.position[m.inner])) for m in fitted),
    )
    bottom = max(0.25 * resolution, 1e-5 * top)
    if not 2.0 * PRESLIDING_SEARCH.min_encoder_steps * resolution < top:
        return Presliding(why="the joint moves by little more than its encoder's resolution", resolution=resolution)
    strokes = [_make_stroke(model, values, m) for m in fitted]
    grid = np.geomspace(bottom, top, int(np.ceil(PRESLIDING_SEARCH.grid_steps_per_decade * np.log10(top / bottom))) + 1)
    fewest, most = strokes[0].fixed.shape[1] + 1, strokes[0].fixed.shape[1] + strokes[0].levels.shape[1]
    profiles: dict[int, list[np.ndarray]] = {terms: [] for terms in range(fewest, most + 1)}
    target = np.concatenate([s.target for s in strokes])
    for first in range(0, len(grid), TRAVELS_AT_ONCE):
        for jacobian in _regressors(strokes, grid[first : first + TRAVELS_AT_ONCE]):
            for terms, profile_of_terms in profiles.items():
                some = jacobian[:, :terms]
                profile_of_terms.append(np.square(target - some @ _least_squares(some, target, terms - fewest + 1)))
    profile = np.array(profiles[most])
    starts, ends = _block_starts(strokes), np.cumsum([len(s.target) for s in strokes])[:-1]
    sums = np.add.reduceat(profile, starts, axis=1)
    found, nearest = float(_grid_minimum(grid, sums.sum(axis=1))), int(np.argmin(sums.sum(axis=1)))
    simpler = [float(_grid_minimum(grid, np.sum(each, axis=1))) for each in profiles.values()]
    drawn = np.random.default_rng(PRESLIDING_SEARCH.bootstrap_seed).multinomial(
        len(starts), np.full(len(starts), 1.0 / len(starts)), PRESLIDING_SEARCH.bootstrap_draw_count
    )
    draws = _grid_minimum(grid, sums @ drawn.T)
    low, high = (float(x) for x in np.quantile(draws, [0.5 - 0.5 * level, 0.5 + 0.5 * level]))
    # The alternative is the better of two models that slip at once. The first takes the sign of velocity, the second
    # that of the last displacement, which standstill keeps.
    others = [_make_stroke(model, values, m) for m in held]
    every, compared = (*others, *strokes), (0.0, float(grid[0]), found)
    regressors = zip(*(s.at(compared) for s in every), strict=True)  # of each stroke, by the travel
    losses = []
    for each in regressors:
        solved = _least_squares(np.concatenate(each[len(others) :]), target, most - fewest + 1)
        losses.append([np.square(s.target - w @ solved) for s, w in zip(every, each, strict=True)])
    judged = len(others) or len(strokes)
    *slipping, best = losses
    none = min(slipping, key=lambda loss: _mean_loss(loss[:judged]))
    slips, gives = _mean_loss(none[:judged]) ** 0.5, _mean_loss(best[:judged]) ** 0.5
    # Only the fitted motions enter the test: one parameter was fitted to thousands of samples. Held-out motions must
    # not decide whether the travel is on the card.
    none_fitted = min((loss[len(others) :] for loss in slipping), key=_mean_loss)
    best_fitted = best[len(others) :]
    improved = _mean_loss(none_fitted) > _mean_loss(best_fitted)
    p_value = p_value_of_larger_loss(none_fitted, best_fitted)[0] if improved else 1.0
    told = {"resolution": resolution, "slips": slips, "gives": gives, "p_value": p_value}
    farthest = p_value_of_larger_loss(np.split(profile[-1], ends), np.split(profile[nearest], ends))[0]
    if len(starts) < PRESLIDING_SEARCH.min_blocks or farthest > SIGNIFICANCE_LEVEL or high > grid[-2]:
        return Presliding(why="no reversal shows it: all displacements explain the recordings equally well", **told)
    if low <= PRESLIDING_SEARCH.min_encoder_steps * resolution:
        return Presliding(
            below=max(high, PRESLIDING_SEARCH.min_encoder_steps * resolution),
            why="limited by the encoder's resolution",
            **told,
        )
    if p_value > SIGNIFICANCE_LEVEL:
        return Presliding(why="a model without presliding predicts the effort equally well", **told)
    drawn_anew = max(high - found, found - low) / normal_quantile(0.5 + 0.5 * level)
    error = float(np.hypot(PRESLIDING_SEARCH.bootstrap_error_factor * drawn_anew, max(abs(x - found) for x in simpler)))
    return Presliding(Parameter("presliding_travel", UNITS[model.motion]["position"], found, error), **told)


def _make_stroke(model: JointModel, values: np.ndarray, motion: Motion) -> _Stroke:
    """Compute the parts of a motion's regression that do not depend on the travel."""
    motion = with_slow_samples(motion)
    every = regressor(motion.position, motion.velocity, motion.acceleration, SMOOTH_TERMS)
    payload = model.loaded(np.zeros(len(PARAMETER_INDEX)), *motion.payload)[list(SMOOTH_TERMS)]
    targets = ALWAYS_FREE_TERMS | {t for s in model.symbols for t in s.targets} | ({"gravity_sine"} & set(model.known))
    used = [i for i, term in enumerate(SMOOTH_TERMS) if NAMES[term] in targets]
    vector = model.loaded(model.vector(values), *motion.payload)
    levels, velocity = [np.ones(len(motion.position))], vector[PARAMETER_INDEX[STRIBECK_VELOCITY.name]]
    if any(map(grows_with_load, model.names)):
        levels.append(np.abs(_core.load(vector, motion.position, motion.acceleration)))
    if STRIBECK_FRICTION.name in model.names and velocity > 0.0:
        levels.append(np.exp(-np.square(motion.velocity / velocity)))
    fixed = np.hstack([motion.rows(every[:, used]), _nonlinear_speed_columns(model, motion)])
    return _Stroke(motion, fixed, motion.rows(motion.effort - every @ payload), np.column_stack(levels))


def _nonlinear_speed_columns(model: JointModel, motion: Motion) -> np.ndarray:
    """Return the friction per unit of each coefficient that is nonlinear in the speed, (m, k)."""
    curved = [
        target
        for target in dict.fromkeys(target for symbol in model.symbols for target in symbol.targets)
        if (resists := PARAMETER_FIELDS[target].resists) is not None and resists.speed not in (0.0, 1.0)
    ]
    still, columns = np.zeros(len(motion.velocity)), [np.zeros((len(motion.rows(motion.velocity)), 0))]
    for target in curved:
        vector = np.zeros(len(PARAMETER_INDEX))
        vector[PARAMETER_INDEX[target]] = 1.0
        friction = _core.inverse_dynamics(vector, still, motion.velocity, still)
        columns.append(motion.rows(motion.smooth(friction))[:, None])
    return np.hstack(columns)


def _regressors(strokes: Sequence[_Stroke], travels: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the regressor of all strokes for each of a few `travels`."""
    return map(np.concatenate, zip(*(s.at(travels) for s in strokes), strict=True))


def _least_squares(jacobian: np.ndarray, target: np.ndarray, levels: int) -> np.ndarray:
    """Solve for values, (p,), of which the last `levels`, the friction levels, are not negative.

    The most negative one is set to 0 until none is left. Columns that cannot be told apart share the least-norm
    solution.
    """
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    # Normal equations are accurate enough for these few, well-separated columns, and fast over the grid.
    gram, moment = (jacobian / scale).T @ (jacobian / scale), (jacobian / scale).T @ target
    kept = list(range(len(scale)))
    while True:
        values = np.zeros(len(scale))
        values[kept] = np.linalg.lstsq(gram[np.ix_(kept, kept)], moment[kept], rcond=1e-12)[0]
        lowest = int(np.argmin(values[len(scale) - levels :])) + len(scale) - levels
        if values[lowest] >= 0.0:
            return values / scale
        kept.remove(lowest)


def _mean_loss(losses: Sequence[np.ndarray]) -> float:
    return float(np.mean(np.concatenate(losses)))


def _block_starts(strokes: Sequence[_Stroke]) -> np.ndarray:
    """Return the first rows of blocks of about `PRESLIDING_SEARCH.block_length_s`, none of which spans two motions."""
    starts, first = [], 0
    for s in strokes:
        n = len(s.target)
        count = max(1, round(n * s.motion.filtering.decimate / s.motion.fs / PRESLIDING_SEARCH.block_length_s))
        starts.append(first + np.arange(count) * n // count)
        first += n
    return np.concatenate(starts)


def _grid_minimum(grid: np.ndarray, loss: np.ndarray) -> np.ndarray:
    """Return the minimum of each loss, (k,) or (k, r), over a geometric grid, by a parabola unless it is at an end."""
    i = np.argmin(loss, axis=0)
    middle = np.clip(i, 1, len(grid) - 2)
    below, at, above = (np.take_along_axis(loss, np.expand_dims(middle + k, 0), 0)[0] for k in (-1, 0, 1))
    bend = below - 2.0 * at + above
    bends = (i == middle) & (bend > 0.0)
    shift = np.where(bends, 0.5 * (below - above) / np.where(bends, bend, 1.0), 0.0)
    return grid[i] * (grid[middle + 1] / grid[middle]) ** shift
