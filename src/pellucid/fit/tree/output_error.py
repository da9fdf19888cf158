r"""Output error of a robot: its numbers by the motion that recorded efforts make, not by the efforts of a motion.

Efforts alone, simulated from one recorded state, leave the recording within a second: what an effort misses is summed
twice. A controller that was not recorded cannot bring the simulation back. So the recording is cut into short windows,
and each is simulated from a state of its own [1]_: with x_w the state at its start,

.. math::
   \min_{\beta,\,x_w} \sum_w \sum_{t,j} \frac{1}{\sigma_j^2}\big(q_{jt} - q_{jt}(\beta, x_w)\big)^2 .

The plant is the core's, stiction of several joints with it, so that rest and reversals count like all else. Derivatives
are differences; the states are eliminated window by window. No acceleration is used, and no velocity but as a start.

.. [1] H. G. Bock, "Recent advances in parameter identification techniques for ODE", Birkhauser, 1983: multiple
   shooting.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ... import _core
from ..parameter import Parameter
from .tree_estimate import TreeEstimate
from .tree_regression import Linearised, TreeModel, TreeRows, TreeSolution, fit_rows, linearised, loads_of

WINDOW = 0.2
"""Length of a window [s]: a tenth of an effort's misfit is then about what filters leave of a position."""
STEPS = 8  # of Gauss and Newton, at most
DIFFERENCE = 1e-3  # of the RMS effort, by which one parameter changes a joint's effort in a difference
SETTLED = 1e-3  # of the RMS effort, the change at which steps stop
SUBSTEPS = 4
STATE_DIFFERENCE = 1e-4  # rad, m; per second ten times that


def solve_output_error(model: TreeModel, rows: TreeRows, rate: float) -> tuple[TreeSolution, Linearised]:
    """A model's numbers from its motion under recorded efforts, rows at `rate` [Hz]; starts at weighted least
    squares."""
    found, at = fit_rows(model, rows)
    windows = list(_windows(rows, max(4, round(WINDOW * rate))))
    free = np.flatnonzero(found.seen & ~found.held)
    step_of = DIFFERENCE / _strength(at)
    values, sd, converged, iterations = found.values.copy(), np.ones(rows.effort.shape[1]), False, 0
    gram, pull, cost, sd = _normal(model, rows, rate, windows, values, free, step_of, sd, measure=True)
    while not converged and iterations < STEPS:
        iterations += 1
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        step = np.zeros(len(values))
        step[free] = np.linalg.solve(gram / np.outer(size, size) + 1e-9 * np.eye(len(free)), pull / size) / size
        lower, upper = model.bounds
        share, better = 1.0, False
        while share > 0.05 and not better:
            after = np.clip(values + share * step, lower, upper)
            tried = _normal(model, rows, rate, windows, after, free, step_of, sd, jacobian=False)[2]
            better, share = tried < cost, 0.5 * share
        if not better:  # stiction has corners: near the least cost no step need lower it
            break
        moved = float(np.max(np.abs(after - values) / step_of)) * DIFFERENCE
        converged, values = moved < SETTLED or tried > (1.0 - SETTLED) * cost, after
        if not converged:
            gram, pull, cost, _ = _normal(model, rows, rate, windows, values, free, step_of, sd)
    at = linearised(model, rows, loads_of(rows, model, values), model.alpha(values))
    spread = np.array([np.sqrt(np.mean(r**2)) for r in at.residuals(values)])
    held = found.seen & ((values <= model.bounds[0]) | (values >= model.bounds[1]))
    return TreeSolution(values, spread, found.seen, held, iterations, converged), at


def _windows(rows: TreeRows, length: int) -> Iterator[slice]:
    """Windows of `length` rows of one segment each, none shorter than half of it."""
    key = np.where(rows.segment >= 0, rows.segment, -1)
    edges = np.flatnonzero(np.diff(key, prepend=key[0] - 1, append=key[-1] - 1))
    for first, last in pairwise(edges):
        if key[first] < 0:
            continue
        for start in range(first, last, length):
            stop = min(start + length, last)
            if stop - start > length // 2:
                yield slice(start, stop)


def _strength(at: Linearised) -> np.ndarray:
    """Largest share of a joint's RMS effort that one unit of each parameter makes, (p,)."""
    most = np.full(len(at.model.names), 1e-12)
    for place, x, size in zip(at.places, at.columns, at.rows.size, strict=True):
        most[place] = np.maximum(most[place], np.sqrt(np.mean(x**2, axis=0)) / size)
    return most


def _plant(model: TreeModel, rows: TreeRows, rate: float, values: np.ndarray) -> _core.DrivenTree:
    parameters = {n: Parameter(n, "", float(v), 0.0) for n, v in zip(model.names, values, strict=True)}
    for k, speed in (model.speeds or {}).items():
        name = f"{model.robot.names[k]}.stribeck_velocity"
        parameters[name] = Parameter(name, "", speed, 0.0)
    numbers = TreeEstimate(
        name="trial",
        robot=model.robot,
        families=model.families,
        parameters=parameters,
        covariance=np.zeros((0, 0)),
        velocity_width=rows.width,
    )
    shared = {"turns": np.asarray(model.robot.turns), "motors": numbers.motors()} if model.robot.shared else {}
    return _core.DrivenTree(
        numbers.links(), np.array(model.robot.tree.gravity), numbers.joints(), period=1.0 / rate, substeps=SUBSTEPS,
        **shared,
    )  # fmt: skip


def _efforts(model: TreeModel, rows: TreeRows, values: np.ndarray) -> np.ndarray:
    """Of motors while a row's period lasts, without the ripple, which the core's plant does not have, (N, m)."""
    turns = np.asarray(rows.robot.turns)
    effort = rows.effort.copy()
    first = len(model.base.names) + len(model.parts)
    for i, ripple in enumerate(model.ripples):
        phase = ripple.order * rows.turned[:, ripple.motor]
        sine, cosine = values[first + 2 * i : first + 2 * i + 2]
        effort -= np.outer(sine * np.sin(phase) + cosine * np.cos(phase), turns[ripple.motor])
    of_motors = effort @ np.linalg.inv(turns)
    of_motors[:-1] = 0.5 * (of_motors[:-1] + of_motors[1:])
    return of_motors


def _normal(
    model: TreeModel,
    rows: TreeRows,
    rate: float,
    windows: list[slice],
    values: np.ndarray,
    free: np.ndarray,
    step_of: np.ndarray,
    sd: np.ndarray,
    *,
    jacobian: bool = True,
    measure: bool = False,
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Normal equations of the `free` parameters with every window's state eliminated, the cost, and the spread of each
    joint's position, (m,), by which positions are weighed; `measure` it here."""
    m = rows.effort.shape[1]
    effort = _efforts(model, rows, values)

    def run(plant: _core.DrivenTree, window: slice, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        plant.reset(q, v)
        return plant.run(effort[window])[0]

    plant = _plant(model, rows, rate, values)
    made, states = [], []
    for window in windows:
        q, v = rows.position[window.start], rows.velocity[window.start]
        made.append(run(plant, window, q, v))
        ways = []
        for k in range(2 * m):
            by = np.zeros(2 * m)
            by[k] = STATE_DIFFERENCE * (1.0 if k < m else 10.0)
            ways.append((run(plant, window, q + by[:m], v + by[m:]) - made[-1]) / by[k])
        states.append(np.stack(ways, axis=-1))
    off = [rows.position[window] - x for window, x in zip(windows, made, strict=True)]
    if not all(np.all(np.isfinite(x)) for x in off):
        return np.eye(len(free)), np.zeros(len(free)), np.inf, sd
    if measure:
        free_of_state = [_without(s, x[..., None], np.ones(m))[1] for s, x in zip(states, off, strict=True)]
        left = np.concatenate([x.reshape(-1, m) for x in free_of_state])
        sd = np.sqrt(np.mean(left**2, axis=0)) + 1e-12
    by_parameter = []
    if jacobian:
        for i in free:
            moved = values.copy()
            moved[i] += step_of[i]
            other = _plant(model, rows, rate, moved)
            by_parameter.append(
                [
                    (run(other, w, rows.position[w.start], rows.velocity[w.start]) - x) / step_of[i]
                    for w, x in zip(windows, made, strict=True)
                ]
            )
    gram, pull, cost = np.zeros((len(free), len(free))), np.zeros(len(free)), 0.0
    for n, (state, x) in enumerate(zip(states, off, strict=True)):
        columns = [x, *(each[n] for each in by_parameter)]
        left = _without(state, np.stack(columns, axis=-1), sd)[0]
        cost += float(left[:, 0] @ left[:, 0])
        if jacobian:
            gram += left[:, 1:].T @ left[:, 1:]
            pull += left[:, 1:].T @ left[:, 0]
    return gram, pull, cost, sd


def _without(state: np.ndarray, columns: np.ndarray, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`columns` (n, m, k) over each joint's `sd`, less what a window's `state` (n, m, 2 m) can make of them: rows under
    one another, and as they were."""
    n, m, k = columns.shape
    way = np.linalg.qr((state / sd[:, None]).reshape(n * m, -1))[0]
    flat = (columns / sd[:, None]).reshape(n * m, k)
    left = flat - way @ (way.T @ flat)
    return left, left.reshape(n, m, k) * sd[:, None]
