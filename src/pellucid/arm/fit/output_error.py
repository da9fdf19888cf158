r"""Output-error identification of a robot: fit the motion that recorded efforts produce, instead of the efforts.

A simulation from one recorded state diverges from the recording within a second, because errors of the effort are
integrated twice and no controller corrects them. The recording is therefore cut into short windows, and each is
simulated from a state of its own [1]_. With x_w the state at its start,

.. math::
   \min_{\beta,\,x_w} \sum_w \sum_{t,j} \frac{1}{\sigma_j^2}\big(q_{jt} - q_{jt}(\beta, x_w)\big)^2 .

The plant is the core's and includes stiction, so samples at rest and at reversals count like all others. Derivatives
are finite differences, and the states are eliminated window by window. Accelerations are not used, and velocities only
as starting values.

.. [1] H. G. Bock, "Recent advances in parameter identification techniques for ODE", Birkhauser, 1983: multiple
   shooting.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ... import _core
from ...models.estimates import Parameter
from .tree_estimate import TreeEstimate
from .tree_regression import LinearisedModel, TreeModel, TreeRows, TreeSolution, compute_loads, fit_rows, linearise_rows

WINDOW_LENGTH_S = 0.2
"""Length of a window [s]. In this time a tenth of the effort's error moves a joint by about the residual position noise
after filtering."""

MAX_STEPS = 8
"""Largest number of Gauss-Newton steps."""

DIFFERENCE_EFFORT_SHARE = 1e-3
"""Step of a finite difference: a parameter changes a joint's effort by this share of the RMS effort."""

STEP_TOLERANCE = 1e-3
"""Steps stop when no parameter changes the effort, or the step does not change the cost, by more than this share."""

PLANT_SUBSTEP_COUNT = 4
"""Number of integration steps of the plant in a sampling period."""

STATE_DIFFERENCE_STEP = 1e-4
"""Step of a finite difference of a position [rad or m]. That of a velocity is ten times as large [rad/s or m/s]."""


def solve_output_error(model: TreeModel, rows: TreeRows, rate: float) -> tuple[TreeSolution, LinearisedModel]:
    """Fit a model's motion under the recorded efforts, from a start at weighted least squares; `rate` is that of the
    rows [Hz]."""
    found, at = fit_rows(model, rows)
    windows = list(_windows(rows, max(4, round(WINDOW_LENGTH_S * rate))))
    free = np.flatnonzero(found.seen & ~found.held)
    step_of = DIFFERENCE_EFFORT_SHARE / _effort_shares(at)
    values, sd, converged, iterations = found.values.copy(), np.ones(rows.effort.shape[1]), False, 0
    gram, pull, cost, sd = _normal_equations(model, rows, rate, windows, values, free, step_of, sd, measure=True)
    while not converged and iterations < MAX_STEPS:
        iterations += 1
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        step = np.zeros(len(values))
        step[free] = np.linalg.solve(gram / np.outer(size, size) + 1e-9 * np.eye(len(free)), pull / size) / size
        lower, upper = model.bounds
        share, better = 1.0, False
        while share > 0.05 and not better:
            after = np.clip(values + share * step, lower, upper)
            tried = _normal_equations(model, rows, rate, windows, after, free, step_of, sd, jacobian=False)[2]
            better, share = tried < cost, 0.5 * share
        if not better:  # stiction is not smooth, so near the minimum no step need lower the cost
            break
        moved = float(np.max(np.abs(after - values) / step_of)) * DIFFERENCE_EFFORT_SHARE
        converged, values = moved < STEP_TOLERANCE or tried > (1.0 - STEP_TOLERANCE) * cost, after
        if not converged:
            gram, pull, cost, _ = _normal_equations(model, rows, rate, windows, values, free, step_of, sd)
    at = linearise_rows(model, rows, compute_loads(rows, model, values), model.alpha(values))
    spread = np.array([np.sqrt(np.mean(r**2)) for r in at.residuals(values)])
    held = found.seen & ((values <= model.bounds[0]) | (values >= model.bounds[1]))
    return TreeSolution(values, spread, found.seen, held, iterations, converged), at


def _windows(rows: TreeRows, length: int) -> Iterator[slice]:
    """Yield windows of `length` rows within one segment each; windows shorter than half of it are dropped."""
    key = np.where(rows.segment >= 0, rows.segment, -1)
    edges = np.flatnonzero(np.diff(key, prepend=key[0] - 1, append=key[-1] - 1))
    for first, last in pairwise(edges.tolist()):
        if key[first] < 0:
            continue
        for start in range(first, last, length):
            stop = min(start + length, last)
            if stop - start > length // 2:
                yield slice(start, stop)


def _effort_shares(at: LinearisedModel) -> np.ndarray:
    """Return the largest share of any joint's RMS effort that one unit of each parameter makes, (p,)."""
    most = np.full(len(at.model.names), 1e-12)
    for place, x, size in zip(at.places, at.columns, at.rows.size, strict=True):
        most[place] = np.maximum(most[place], np.sqrt(np.mean(x**2, axis=0)) / size)
    return most


def _make_plant(model: TreeModel, rows: TreeRows, rate: float, values: np.ndarray) -> _core.DrivenTree:
    """Return the core's plant with these parameters, (p,)."""
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
        numbers.links(),
        np.array(model.robot.tree.gravity),
        numbers.joints(),
        period=1.0 / rate,
        substeps=PLANT_SUBSTEP_COUNT,
        **shared,
    )


def _motor_efforts(model: TreeModel, rows: TreeRows, values: np.ndarray) -> np.ndarray:
    """Return the motors' efforts during each row's period, (N, m), without ripple, which the plant does not model."""
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


def _normal_equations(
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
    """Return the normal equations of the `free` parameters, the cost, and the position noise of each joint, (m,).

    The states of all windows are eliminated. Positions are weighted by the noise `sd`, which is estimated if `measure`.
    """
    m = rows.effort.shape[1]
    effort = _motor_efforts(model, rows, values)

    def run(plant: _core.DrivenTree, window: slice, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        plant.reset(q, v)
        return plant.run(effort[window])[0]

    plant = _make_plant(model, rows, rate, values)
    made, states = [], []
    for window in windows:
        q, v = rows.position[window.start], rows.velocity[window.start]
        made.append(run(plant, window, q, v))
        ways = []
        for k in range(2 * m):
            by = np.zeros(2 * m)
            by[k] = STATE_DIFFERENCE_STEP * (1.0 if k < m else 10.0)
            ways.append((run(plant, window, q + by[:m], v + by[m:]) - made[-1]) / by[k])
        states.append(np.stack(ways, axis=-1))
    off = [rows.position[window] - x for window, x in zip(windows, made, strict=True)]
    if not all(np.all(np.isfinite(x)) for x in off):
        return np.eye(len(free)), np.zeros(len(free)), np.inf, sd
    if measure:
        free_of_state = [_remove_state(s, x[..., None], np.ones(m))[1] for s, x in zip(states, off, strict=True)]
        left = np.concatenate([x.reshape(-1, m) for x in free_of_state])
        sd = np.sqrt(np.mean(left**2, axis=0)) + 1e-12
    by_parameter = []
    if jacobian:
        for i in free:
            moved = values.copy()
            moved[i] += step_of[i]
            other = _make_plant(model, rows, rate, moved)
            by_parameter.append(
                [
                    (run(other, w, rows.position[w.start], rows.velocity[w.start]) - x) / step_of[i]
                    for w, x in zip(windows, made, strict=True)
                ]
            )
    gram, pull, cost = np.zeros((len(free), len(free))), np.zeros(len(free)), 0.0
    for n, (state, x) in enumerate(zip(states, off, strict=True)):
        columns = [x, *(each[n] for each in by_parameter)]
        left = _remove_state(state, np.stack(columns, axis=-1), sd)[0]
        cost += float(left[:, 0] @ left[:, 0])
        if jacobian:
            gram += left[:, 1:].T @ left[:, 1:]
            pull += left[:, 1:].T @ left[:, 0]
    return gram, pull, cost, sd


def _remove_state(state: np.ndarray, columns: np.ndarray, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Remove from `columns`, (n, m, k), their projection on a window's `state` derivatives, (n, m, 2 m).

    Joints are weighted by 1 / `sd`. Returns the weighted remainder, (n m, k), and the unweighted one, (n, m, k).
    """
    n, m, k = columns.shape
    way = np.linalg.qr((state / sd[:, None]).reshape(n * m, -1))[0]
    flat = (columns / sd[:, None]).reshape(n * m, k)
    left = flat - way @ (way.T @ flat)
    return left, left.reshape(n, m, k) * sd[:, None]
