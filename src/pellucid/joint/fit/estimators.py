r"""Estimators that simulate the machine's own closed loop, and the choice among all estimators of a family.

Instrumental variables, DIDIM and output error compare the effort after the same filter, but differ in the origin of the
regressor:

- IDIM-IV [1]_: :math:`\beta \leftarrow \beta + (Z^T W)^{-1} Z^T \rho` with W on measured and Z on simulated states:
  consistent when the measured states carry noise;
- DIDIM [2]_: :math:`\beta \leftarrow \beta + (W_s^T W_s)^{-1} W_s^T (\tau - \tau_s)`, the inverse model on simulated
  states only: no measured velocity or acceleration enters;
- output error: least squares between measured and simulated signals, with the exact derivative of the simulated loop:
  the effort in closed loop (there the position hardly depends on the parameters), the position in open loop.

The estimator whose values are reported first is chosen by cross-validation over blocks of the fitted recordings.
The purpose is either to predict torque (the effort of a recorded motion) or to simulate (the motion of a recorded
command). Among the estimators whose error at the stated purpose is nearly the smallest, the plainest is chosen: least
squares, if it is among them. Another of these is chosen only if it does far better at the other purpose. No test of
significance decides: all estimators fit the same parameters, so that a smaller error needs no proof to be preferred.

Held-out recordings take no part. Each block of the fitted ones is predicted by what its estimator makes of the others.
Least squares with fixed weights are fitted anew; other estimators are linearised, with their own instruments, and so is
the simulated position.

.. [1] A. Janot, P.-O. Vandanjon, M. Gautier, "A generic instrumental variable approach for industrial robot
   identification", IEEE Trans. Control Syst. Technol. 22, 2014.
.. [2] M. Gautier, A. Janot, P.-O. Vandanjon, "A new closed-loop output error method for parameter identification of
   robot dynamics", IEEE Trans. Control Syst. Technol. 21, 2013.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...models.simulate import JointTrace
from ...numerics.block_test import MIN_IMPROVEMENT, HeldOutComparison, compare_held_out
from ...numerics.motion import Motion, differentiate
from ...numerics.regression import Solution, Stack, linearise, regression_rows, remember_last_call, snap_to_bounds
from .friction_solver import (
    MAX_REFITTED_ROWS,
    block_labels,
    residuals_without_blocks,
    solve_without_blocks,
    values_without_blocks,
)
from .replay import Machine, Prediction, is_bounded, replay

EFFORT_CHANGE_TOLERANCE = 1e-4
"""Iterations stop when no parameter's change alters the effort by more than this share of it (RMS)."""

MAX_ITERATIONS = 30
"""Largest number of iterations of IDIM-IV and DIDIM."""


def simulated_motions(
    model: JointModel, values: np.ndarray, motions: tuple[Motion, ...], machine: Machine
) -> tuple[Motion, ...]:
    """Simulate the motions in closed loop with a joint of these `values`, (p,), and filter and differentiate them."""
    made = []
    for motion in motions:
        trace = replay(model, values, motion, machine, closed=True)
        if not is_bounded(trace.position):
            raise IdentificationError(f"recording '{motion.recording}': the simulated closed loop diverges")
        position, velocity, acceleration = differentiate(trace.position, motion.fs, motion.filtering)
        made.append(replace(motion, position=position, velocity=velocity, acceleration=acceleration))
    return tuple(made)


def require_loop(machine: Machine, data: Stack[Motion]) -> None:
    """Refuse a closed-loop method without a controller and a reference."""
    for motion in data.motions:
        if not machine.can_close(motion):
            missing = (
                "[rig.loop]" if machine.loop is None else f"a channel 'reference' in recording '{motion.recording}'"
            )
            raise IdentificationError(f"a closed-loop method needs the machine's controller; missing: {missing}")


def solve_instrumental(
    model: JointModel, data: Stack[Motion], machine: Machine, first: Solution
) -> tuple[Solution, np.ndarray]:
    """Solve IDIM-IV with instruments from the simulated closed loop; return the solution and instruments, (m, p)."""
    require_loop(machine, data)
    return _iterate(model, data, first, lambda values: _instruments(model, values, data, machine))


def _instruments(
    model: JointModel, values: np.ndarray, data: Stack[Motion], machine: Machine
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    efforts, regressors = linearise(model, values, data.motions)
    simulated = simulated_motions(model, values, data.motions, machine)
    z = data.reduced(linearise(model, values, simulated)[1])
    return z, data.reduced(regressors), data.target - data.reduced(efforts)


def solve_didim(model: JointModel, data: Stack[Motion], machine: Machine, first: Solution) -> Solution:
    """Solve DIDIM: fit the inverse model on simulated states alone."""
    require_loop(machine, data)
    return _iterate(model, data, first, lambda values: _simulated_rows(model, values, data, machine))[0]


def _simulated_rows(
    model: JointModel, values: np.ndarray, data: Stack[Motion], machine: Machine
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    simulated = simulated_motions(model, values, data.motions, machine)
    efforts, regressors = linearise(model, values, simulated)
    w = data.reduced(regressors)
    return w, w, data.target - data.reduced(efforts)


def _iterate(
    model: JointModel,
    data: Stack[Motion],
    first: Solution,
    rows: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> tuple[Solution, np.ndarray]:
    """Repeat values += (Z^T W)^-1 Z^T rho, with Z, W and rho from `rows` at each step, until the effort settles."""
    values, converged, iterations = first.values, False, 0
    while not converged and iterations < MAX_ITERATIONS:
        iterations += 1
        z, w, residual = rows(values)
        step = np.linalg.lstsq(z.T @ w, z.T @ residual, rcond=None)[0]
        values, change = _bounded_step(model, values, step, w, data)
        converged = change < EFFORT_CHANGE_TOLERANCE
    z, w, residual = rows(values)
    return _solution(model, values, w, residual, iterations, converged), z


def solve_output_error(model: JointModel, data: Stack[Motion], machine: Machine, first: Solution) -> Solution:
    """Fit the simulated response, with its exact Jacobian, to the measured one.

    The response is the effort if the loop can be closed [N*m, N, A or V], otherwise the position [rad or m].
    """
    from scipy.optimize import least_squares

    closed = all(machine.can_close(m) for m in data.motions)
    signal = "effort" if closed else "position"
    measured = [getattr(m, signal) for m in data.motions]
    size = sum(len(m.reduce(x)) for m, x in zip(data.motions, measured, strict=True))

    @remember_last_call
    def at(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        traces = [replay(model, values, m, machine, closed=closed, differentiate=signal) for m in data.motions]
        # A trial step that diverges returns a large residual, so that the solver rejects it and no filter fails.
        slopes = [_derivative(t, signal) for t in traces]
        if not all(is_bounded(getattr(t, signal)) and is_bounded(d) for t, d in zip(traces, slopes, strict=True)):
            return np.full(size, 1e6), np.zeros((size, len(values)))
        # A simulation covers every sample, including those at rest.
        off = [m.reduce(getattr(t, signal) - x) for m, t, x in zip(data.motions, traces, measured, strict=True)]
        residual = np.concatenate(off)
        jacobian = np.concatenate([m.reduce(d) for m, d in zip(data.motions, slopes, strict=True)])
        return residual, jacobian

    lower, upper = model.bounds()
    start = np.clip(first.values, lower + 1e-9, np.where(np.isfinite(upper), upper * (1.0 - 1e-9), upper))
    if not np.any(at(start)[1]):
        raise IdentificationError("the simulated response diverges at the least-squares estimate")
    found = least_squares(
        lambda v: at(v)[0], start, jac=lambda v: at(v)[1], bounds=(lower, upper), x_scale="jac", max_nfev=40, xtol=1e-6
    )
    residual, jacobian = at(found.x)
    return _solution(model, found.x, jacobian, -residual, int(found.nfev), bool(found.success))


def _derivative(trace: JointTrace, signal: str) -> np.ndarray:
    """Return the derivative of a simulated signal by the free values, (n, p)."""
    if trace.jacobians is None:
        raise ValueError(f"found a simulation without derivatives, expected that of the {signal}")
    return trace.jacobians[signal]


def _bounded_step(
    model: JointModel, values: np.ndarray, step: np.ndarray, w: np.ndarray, data: Stack[Motion]
) -> tuple[np.ndarray, float]:
    """Return the next values, (p,), within their bounds, and the largest relative change in effort of any one."""
    lower, upper = model.bounds()
    after = np.clip(values + step, lower, upper)
    change = np.abs(after - values) * np.linalg.norm(w, axis=0)
    return after, float(change.max() / np.linalg.norm(data.target))


def _solution(
    model: JointModel, values: np.ndarray, jacobian: np.ndarray, residual: np.ndarray, iterations: int, converged: bool
) -> Solution:
    values, held = snap_to_bounds(values, *model.bounds(), jacobian, residual)
    return Solution(values, jacobian, residual, np.ones(len(residual)), held, iterations, converged)


ESTIMATION_METHODS = ("ls", "wls", "irls", "iv", "didim", "output_error")
"""Estimation methods, the plainest first."""

DECISIVE_ERROR_RATIO = 1.5
"""The other purpose decides if the plainest method's error there exceeds this multiple of the smallest error. Chosen by
judgement; no measurement is recorded."""


@dataclass(frozen=True)
class EstimatorChoice:
    """The estimation method chosen for a purpose, with the comparisons behind the choice."""

    method: str = "ls"
    purpose: str = "torque"  # "torque" or "simulation"
    torque: HeldOutComparison | None = None  # effort errors on left-out blocks [the effort's unit]
    simulation: HeldOutComparison | None = None  # simulated position's errors there [rad or m]; None if there are none
    predictions: tuple[Prediction, ...] = ()  # predictions of every recording by the chosen method
    crossed: tuple[np.ndarray, ...] = ()  # its simulated position's errors on left-out blocks, (n_i,) per stretch


@dataclass(frozen=True)
class SolvedMethod:
    """What a method found on the fitted recordings, in the form in which blocks can be left out of it."""

    model: JointModel
    found: Solution
    weighs_rows: bool = False  # whether it is least squares with fixed weights, so that blocks can get no weight
    every_row: bool = False  # whether the solution's rows include samples at rest
    instruments: np.ndarray | None = None  # instruments of an instrumental-variable estimate, (m, p)


Residuals = Mapping[str, Sequence[np.ndarray]]  # residuals of each method on each stretch, (n_i,)


def choose_method(first: Residuals, second: Residuals) -> str:
    """Return the plainest method whose error by `first` the best improves by no more than `MIN_IMPROVEMENT`.

    Another of these methods is returned if it does far better by `second`.
    """
    errors = _rms(first)
    left = _nearly_best(errors)
    other = {name: error for name, error in _rms(second).items() if name in left}
    if left[0] in other and other[left[0]] > DECISIVE_ERROR_RATIO * min(other.values()):
        return _nearly_best(other)[0]
    return left[0]


def _rms(residuals: Residuals) -> dict[str, float]:
    """Return the error of each method over all stretches."""
    return {name: float(np.sqrt(np.mean(np.square(np.concatenate(each))))) for name, each in residuals.items()}


def _nearly_best(errors: Mapping[str, float]) -> list[str]:
    """Return the methods whose error is within `MIN_IMPROVEMENT` of the smallest, the plainest first."""
    smallest = min(errors.values())
    return [name for name in ESTIMATION_METHODS if name in errors and is_nearly(errors[name], smallest)]


def is_nearly(error: float, smallest: float, min_improvement: float = MIN_IMPROVEMENT) -> bool:
    """Return whether the `smallest` error saves at most the share `min_improvement` of an `error`."""
    return smallest >= (1.0 - min_improvement) * error


def choose_estimator(
    purpose: str, solved: Mapping[str, SolvedMethod], data: Stack[Motion], machine: Machine
) -> EstimatorChoice:
    """Choose for a `purpose` among methods that were `solved` on `data`, of one family; they include "ls".

    Positions are simulated from the commands that a `machine` recorded.
    """
    if len(solved) == 1:
        return EstimatorChoice(purpose=purpose)
    labels = _blocks_of_rows(data)
    without = {name: _values_without(each, data, labels) for name, each in solved.items()}
    torque = {name: _effort_errors(each, without[name], data, labels) for name, each in solved.items()}
    tried = {name: _position_errors(each, without[name], data, labels, machine) for name, each in solved.items()}
    simulated = {name: errors for name, errors in tried.items() if errors is not None}
    orders = {"torque": (torque, simulated), "simulation": (simulated or torque, torque)}
    method = choose_method(*orders[purpose])
    return EstimatorChoice(
        method=method,
        purpose=purpose,
        torque=compare_held_out(torque),
        simulation=compare_held_out(simulated) if simulated else None,
        crossed=tuple(simulated.get(method, ())),
    )


def _blocks_of_rows(data: Stack[Motion]) -> list[np.ndarray]:
    """Return the block of each reduced sample, those at rest included, (n_i,) per stretch."""
    return block_labels([len(m.moving) for m in data.motions])


def _values_without(solved: SolvedMethod, data: Stack[Motion], labels: Sequence[np.ndarray]) -> dict[int, np.ndarray]:
    """Return a method's parameters, (p,), without each block."""
    rows = [x if solved.every_row else x[m.moving] for x, m in zip(labels, data.motions, strict=True)]
    if solved.weighs_rows:
        return solve_without_blocks(solved.model, data, solved.found, np.concatenate(rows))
    return values_without_blocks(solved.found, np.concatenate(rows), solved.instruments)


def _effort_errors(
    solved: SolvedMethod, without: dict[int, np.ndarray], data: Stack[Motion], labels: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Return the effort's errors on left-out blocks, (n_i,) per stretch."""
    values = solved.found.values
    jacobian, effort = regression_rows(solved.model, values, data)
    rows = np.concatenate([x[m.moving] for x, m in zip(labels, data.motions, strict=True)])
    errors = residuals_without_blocks(data.target - effort, jacobian, values, without, rows)
    for block in without if not solved.model.linear and len(rows) <= MAX_REFITTED_ROWS else ():
        own = rows == block
        errors[own] = (data.target - regression_rows(solved.model, without[block], data)[1])[own]
    return np.split(errors, np.cumsum(data.lengths)[:-1])


def _position_errors(
    solved: SolvedMethod,
    without: dict[int, np.ndarray],
    data: Stack[Motion],
    labels: Sequence[np.ndarray],
    machine: Machine,
) -> list[np.ndarray] | None:
    """Return measured minus simulated position on left-out blocks, (n_i,) per stretch, simulated from its command.

    Returns None if a simulation diverges, or if the errors are at least as large as the motion itself.
    """
    values, errors, spread = solved.found.values, [], []
    for motion, label in zip(data.motions, labels, strict=True):
        try:
            still = replay(solved.model, values, motion, machine, closed=False).position
            smooth = replay(solved.model, values, motion, machine, closed=False, differentiate="position")
        except IdentificationError:
            return None
        slopes = None if smooth.jacobians is None else smooth.jacobians["position"]
        if not is_bounded(still):
            return None
        difference = motion.reduce(motion.position - motion.smooth(still))
        if slopes is not None and is_bounded(slopes):
            difference = residuals_without_blocks(difference, motion.reduce(slopes), values, without, label)
        errors.append(difference)
        measured = motion.reduce(motion.position)
        spread.append(measured - measured.mean())
    small = float(np.linalg.norm(np.concatenate(errors))) < float(np.linalg.norm(np.concatenate(spread)))
    return errors if small else None
