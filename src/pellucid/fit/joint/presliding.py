r"""The way over which a joint's friction builds up before it slips, from recorded motion and effort.

While contacts are bent, friction is its level times s, and s follows from the way gone alone
(``include/pellucid/presliding.hpp``). For a travel given it is known along a recording, and what is left is linear:

.. math::
   \tau = J\ddot q + g_s\sin q + g_c\cos q + \tau_0 + F_v \dot q + (F_c + F_s e^{-(\dot q / v_s)^2} + \alpha |y|)\, s(q)

filtered on both sides as every regression is, with load y and Stribeck velocity of the model that slips at once. One
number is searched: the travel with the smallest squared residual on a grid, a parabola through its neighbours
between them. Its standard error is `MISFIT` times that of the same search on blocks of the recordings drawn anew [1]_,
and, squared and added, how far the travel moves as the level's terms are left out one by one: a level that is not quite
the joint's bends what is read off it, alike in every stroke at an angle, and blocks do not see that. The factor is from
drawn benches with contacts such as these; a joint that obeys another law has no travel that an interval could hold.
Slow samples, which other regressions leave out, are what shows a travel, and all are taken.

.. [1] H. R. Kuensch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17, 1989.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ...models.filtered_dynamics import SMOOTH_TERMS, regressor
from ...models.joint import NAMES, PARAMETER_FIELDS, PARAMETER_INDEX, UNITS, JointModel
from ...signals.motion import Motion
from ..block_test import LEVEL, p_of_worse
from ..parameter import Parameter

STEPS = 8  # of the grid, a decade
LONGEST, LONGEST_SHARE = 0.1, 0.25  # travels looked for [rad or m], and that of a motion's range
NEIGHBOURS = 9
RESOLVED = 2.0  # steps of the encoder that an interval must lie above
DRAWS, SEED = 400, 20261122
BLOCK = 1.0  # s: about a stroke, over which friction that the model misses stays what it is
FEWEST_BLOCKS = 12
MISFIT = 2.0  # times the bootstrap's standard error; on 48 recordings of 16 drawn benches the error was 1.6 times it
ALWAYS = frozenset({"inertia", "offset", "viscous_positive", "viscous_negative"})


@dataclass(frozen=True)
class Presliding:
    """What recordings say of a joint's `travel` before it slips: a value where they show one; else a bound that it is
    `below`, where they show that; else neither; and `why` not."""

    travel: Parameter | None = None
    below: float | None = None  # rad or m
    why: str = ""
    resolution: float = float("nan")  # Of the recorded position [rad or m]
    # RMS error of the effort, on what was held out where anything was, with friction that slips at once and that gives
    slips: float = float("nan")
    gives: float = float("nan")
    p_value: float = 1.0  # Of a travel being no better than none


@dataclass(frozen=True)
class _Stroke:
    """A motion, its slow samples among them, with what no travel changes at its rows: (m, k), (m,)."""

    motion: Motion
    fixed: np.ndarray
    target: np.ndarray
    levels: np.ndarray  # (n, 1 to 3) What the level is made of: 1, |y|, the rise towards rest

    def at(self, travel: float) -> np.ndarray:
        """Regressor, (m, k + 1 to 3), with friction that gives over a `travel`, or slips at once with 0."""
        m = self.motion
        direction = _core.presliding(travel, m.position) if travel else np.sign(m.velocity)
        return np.column_stack([self.fixed, m.rows(m.smooth(direction[:, None] * self.levels))])


def whole(motion: Motion) -> Motion:
    """The motion with its slow samples."""
    return replace(motion, filtering=replace(motion.filtering, dead_band=0.0))


def bent(motion: Motion, travel: float) -> Motion:
    """The motion, slow samples and all, of a joint that gives over a `travel` [rad or m] before it slips: families
    fitted to it, and what they predict of it, have that friction."""
    return replace(whole(motion), direction=_core.presliding(travel, motion.position))


def resolution_of(motions: Sequence[Motion]) -> float:
    """What recorded positions can tell apart [rad or m]: the step of an encoder whose readings lie as far from a cubic
    through their neighbours as these do."""
    from scipy.signal import savgol_filter

    found = [0.0]
    for m in motions:
        beside = m.raw_position - savgol_filter(m.raw_position, NEIGHBOURS, 3)
        found.append(2.0 * float(np.quantile(np.abs(beside[m.inner]), 0.99)))
    return max(found)


def presliding(
    model: JointModel, values: np.ndarray, fitted: Sequence[Motion], held: Sequence[Motion], level: float = 0.95
) -> Presliding:
    """The travel that `fitted` motions show, judged on `held` ones, or on themselves where there are none; the level's
    terms and payloads by a `model` that slips at once, with `values`, (p,); the interval at `level`."""
    from scipy.special import ndtri

    resolution = resolution_of(fitted)
    top = min(LONGEST, LONGEST_SHARE * max(float(np.ptp(m.position[m.inner])) for m in fitted))
    bottom = max(0.25 * resolution, 1e-5 * top)
    if not 2.0 * RESOLVED * resolution < top:
        return Presliding(why="the joint moves by little more than its encoder tells", resolution=resolution)
    strokes = [_stroke(model, values, m) for m in fitted]
    grid = np.geomspace(bottom, top, int(np.ceil(STEPS * np.log10(top / bottom))) + 1)
    fewest, most = strokes[0].fixed.shape[1] + 1, strokes[0].fixed.shape[1] + strokes[0].levels.shape[1]
    profiles = {terms: [] for terms in range(fewest, most + 1)}
    for travel in grid:
        jacobian, target = _columns(strokes, travel)
        for terms, losses in profiles.items():
            some = jacobian[:, :terms]
            losses.append(np.square(target - some @ _least_squares(some, target, terms - fewest + 1)))
    profile = np.array(profiles[most])
    starts, ends = _blocks(strokes), np.cumsum([len(s.target) for s in strokes])[:-1]
    sums = np.add.reduceat(profile, starts, axis=1)
    found, nearest = _lowest(grid, sums.sum(axis=1)), int(np.argmin(sums.sum(axis=1)))
    simpler = [_lowest(grid, np.sum(losses, axis=1)) for losses in profiles.values()]
    drawn = np.random.default_rng(SEED).multinomial(len(starts), np.full(len(starts), 1.0 / len(starts)), DRAWS)
    draws = [_lowest(grid, sums @ count) for count in drawn]
    low, high = (float(x) for x in np.quantile(draws, [0.5 - 0.5 * level, 0.5 + 0.5 * level]))
    # Of two kinds of slip at once the better: by the sign of velocity, or by that of the way, which standstill keeps.
    others = [_stroke(model, values, m) for m in held]
    losses = []
    for travel in (0.0, float(grid[0]), found):
        solved = _least_squares(*_columns(strokes, travel), most - fewest + 1)
        losses.append([np.square(s.target - s.at(travel) @ solved) for s in (*others, *strokes)])
    judged = len(others) or len(strokes)
    *none, best = losses
    none = min(none, key=lambda loss: _mean(loss[:judged]))
    slips, gives = _mean(none[:judged]) ** 0.5, _mean(best[:judged]) ** 0.5
    # One number was searched on thousands of samples: the fitted ones may count too, for few recordings are held out.
    p_value = p_of_worse(none, best)[0] if slips > gives else 1.0
    told = {"resolution": resolution, "slips": slips, "gives": gives, "p_value": p_value}
    farthest = p_of_worse(np.split(profile[-1], ends), np.split(profile[nearest], ends))[0]
    if len(starts) < FEWEST_BLOCKS or farthest > LEVEL or high > grid[-2]:
        return Presliding(why="no reversal shows it, for travels of any length explain the recordings as well", **told)
    if low <= RESOLVED * resolution:
        return Presliding(below=max(high, RESOLVED * resolution), why="the encoder's steps hide shorter ones", **told)
    if p_value > LEVEL:
        return Presliding(why="a joint that slips at once predicts effort as well", **told)
    drawn_anew = max(high - found, found - low) / float(ndtri(0.5 + 0.5 * level))
    error = float(np.hypot(MISFIT * drawn_anew, max(abs(x - found) for x in simpler)))
    return Presliding(Parameter("presliding_travel", UNITS[model.motion]["position"], found, error), **told)


def _stroke(model: JointModel, values: np.ndarray, motion: Motion) -> _Stroke:
    motion = whole(motion)
    every = regressor(motion.position, motion.velocity, motion.acceleration, SMOOTH_TERMS)
    payload = model.loaded(np.zeros(len(PARAMETER_INDEX)), *motion.payload)[list(SMOOTH_TERMS)]
    targets = ALWAYS | {t for s in model.symbols for t in s.targets} | ({"gravity_sine"} & set(model.known))
    used = [i for i, term in enumerate(SMOOTH_TERMS) if NAMES[term] in targets]
    vector = model.loaded(model.vector(values), *motion.payload)
    levels, velocity = [np.ones(len(motion.position))], vector[PARAMETER_INDEX["stribeck_velocity"]]
    if any(name.startswith("load_") for name in model.names):
        levels.append(np.abs(_core.load(vector, motion.position, motion.acceleration)))
    if "stribeck" in model.names and velocity > 0.0:
        levels.append(np.exp(-np.square(motion.velocity / velocity)))
    levels = np.column_stack(levels)
    fixed = np.hstack([motion.rows(every[:, used]), _drag(model, motion)])
    return _Stroke(motion, fixed, motion.rows(motion.effort - every @ payload), levels)


def _drag(model: JointModel, motion: Motion) -> np.ndarray:
    """Friction per unit of each coefficient that grows with the speed otherwise than in proportion, (m, k)."""
    curved = [
        target
        for target in dict.fromkeys(target for symbol in model.symbols for target in symbol.targets)
        if PARAMETER_FIELDS[target].resists is not None and PARAMETER_FIELDS[target].resists.speed not in (0.0, 1.0)
    ]
    still, columns = np.zeros(len(motion.velocity)), [np.zeros((len(motion.rows(motion.velocity)), 0))]
    for target in curved:
        vector = np.zeros(len(PARAMETER_INDEX))
        vector[PARAMETER_INDEX[target]] = 1.0
        friction = _core.inverse_dynamics(vector, still, motion.velocity, still)
        columns.append(motion.rows(motion.smooth(friction))[:, None])
    return np.hstack(columns)


def _columns(strokes: Sequence[_Stroke], travel: float) -> tuple[np.ndarray, np.ndarray]:
    """Regressor and target of all strokes with a `travel`."""
    return np.concatenate([s.at(travel) for s in strokes]), np.concatenate([s.target for s in strokes])


def _least_squares(jacobian: np.ndarray, target: np.ndarray, levels: int) -> np.ndarray:
    """Values, (p,), of which the last, of the friction's `levels`, are not below nothing: the lowest is left out until
    none is. So is what nothing tells apart."""
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    # Squared: the columns are few and tell each other apart well, and a grid of travels is soon done.
    gram, moment = (jacobian / scale).T @ (jacobian / scale), (jacobian / scale).T @ target
    kept = list(range(len(scale)))
    while True:
        values = np.zeros(len(scale))
        values[kept] = np.linalg.lstsq(gram[np.ix_(kept, kept)], moment[kept], rcond=1e-12)[0]
        lowest = int(np.argmin(values[len(scale) - levels :])) + len(scale) - levels
        if values[lowest] >= 0.0:
            return values / scale
        kept.remove(lowest)


def _mean(losses: Sequence[np.ndarray]) -> float:
    return float(np.mean(np.concatenate(losses)))


def _blocks(strokes: Sequence[_Stroke]) -> np.ndarray:
    """First rows of blocks of about `BLOCK`, none across two motions."""
    starts, first = [], 0
    for s in strokes:
        n = len(s.target)
        count = max(1, round(n * s.motion.filtering.decimate / s.motion.fs / BLOCK))
        starts.append(first + np.arange(count) * n // count)
        first += n
    return np.concatenate(starts)


def _lowest(grid: np.ndarray, loss: np.ndarray) -> float:
    """Where a loss, (k,), over a geometric grid is least: on it at its ends, between neighbours within."""
    i = int(np.argmin(loss))
    if i in (0, len(grid) - 1):
        return float(grid[i])
    below, at, above = loss[i - 1 : i + 2]
    bend = below - 2.0 * at + above
    shift = 0.5 * (below - above) / bend if bend > 0.0 else 0.0
    return float(grid[i] * (grid[i + 1] / grid[i]) ** shift)
