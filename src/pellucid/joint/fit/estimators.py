r"""Estimators that simulate the machine's own closed loop.

Instrumental variables, DIDIM and output error compare the effort after the same filter, but differ in the origin of the
regressor:

- IDIM-IV [1]_: :math:`\beta \leftarrow \beta + (Z^T W)^{-1} Z^T \rho` with W on measured and Z on simulated states:
  consistent when the measured states carry noise;
- DIDIM [2]_: :math:`\beta \leftarrow \beta + (W_s^T W_s)^{-1} W_s^T (\tau - \tau_s)`, the inverse model on simulated
  states only: no measured velocity or acceleration enters;
- output error: least squares between measured and simulated signals, with the exact derivative of the simulated loop:
  the effort in closed loop (there the position hardly depends on the parameters), the position in open loop.

.. [1] A. Janot, P.-O. Vandanjon, M. Gautier, "A generic instrumental variable approach for industrial robot
   identification", IEEE Trans. Control Syst. Technol. 22, 2014.
.. [2] M. Gautier, A. Janot, P.-O. Vandanjon, "A new closed-loop output error method for parameter identification of
   robot dynamics", IEEE Trans. Control Syst. Technol. 21, 2013.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...models.simulate import JointTrace
from ...numerics.motion import Motion, differentiate, friction_signals
from ...numerics.regression import Solution, Stack, regression_rows, remember_last_call, snap_to_bounds
from ...numerics.searches.bounded_least_squares import bounded_least_squares
from .friction_solver import values_without_blocks_of_cuts
from .replay import Machine, is_bounded, replay

EFFORT_CHANGE_TOLERANCE = 1e-4
"""Iterations stop when no parameter's change alters the effort by more than this share of it (RMS)."""

MAX_ITERATIONS = 30
"""Largest number of iterations of IDIM-IV and DIDIM."""


def simulated_motions(motions: Sequence[Motion], traces: Iterable[JointTrace]) -> tuple[Motion, ...]:
    """Filter and differentiate the simulations of motions in closed loop."""
    made = []
    for motion, trace in zip(motions, traces, strict=True):
        if not is_bounded(trace.position):
            raise IdentificationError(
                f"recording '{motion.recording}': the simulated closed loop diverges, so that methods in closed loop "
                "do not apply; check the gains in [rig.loop] and the unit of the reference"
            )
        position, velocity, acceleration = differentiate(trace.position, motion.fs, motion.filtering)
        slip, direction = friction_signals(trace.position, velocity, motion.fs, motion.filtering)
        simulated = replace(
            motion, position=position, velocity=velocity, acceleration=acceleration, slip_velocity=slip,
            direction=direction,
        )  # fmt: skip
        vars(simulated)["moving"] = motion.moving  # a regression uses the same rows of both
        made.append(simulated)
    return tuple(made)


SimulatedRows = Callable[[], tuple[np.ndarray, np.ndarray]]
"""What gives the regressor, (m, p), and the effort, (m,), in the simulated closed loop."""


def simulated_rows(
    model: JointModel, values: np.ndarray, data: Stack[Motion], machine: Machine,
    simulate: Callable[[Motion], JointTrace] | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the regressor, (m, p), and the effort, (m,), in the closed loop that is simulated with `values`, (p,).

    `simulate` returns the simulation of a motion with these values, if another step uses it too.
    """
    if simulate is None:
        simulate = partial(replay, model, values, machine=machine, closed=True)
    simulated = simulated_motions(data.motions, map(simulate, data.motions))
    return regression_rows(model, values, Stack(simulated, data.targets))


def require_loop(machine: Machine, data: Stack[Motion]) -> None:
    """Refuse a closed-loop method without a controller and a reference."""
    for motion in data.motions:
        if not machine.can_close(motion):
            missing = (
                "[rig.loop]" if machine.loop is None else f"a channel 'reference' in recording '{motion.recording}'"
            )
            raise IdentificationError(f"a closed-loop method needs the machine's controller; missing: {missing}")


def solve_instrumental(
    model: JointModel, data: Stack[Motion], machine: Machine, first: Solution, begun: SimulatedRows | None = None
) -> tuple[Solution, np.ndarray]:
    """Solve IDIM-IV with instruments from the simulated closed loop; return the solution and instruments, (m, p).

    `begun` gives the rows by the values of `first`, if they are known.
    """
    require_loop(machine, data)

    def rows(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        at_start = begun if values is first.values else None
        instruments, _ = simulated_rows(model, values, data, machine) if at_start is None else at_start()
        regressor, effort = regression_rows(model, values, data)
        return instruments, regressor, data.target - effort

    return _iterate(model, data, first, rows)


def solve_didim(
    model: JointModel, data: Stack[Motion], machine: Machine, first: Solution, begun: SimulatedRows | None = None
) -> Solution:
    """Solve DIDIM: fit the inverse model on simulated states alone; `begun` is as in `solve_instrumental`."""
    require_loop(machine, data)

    def rows(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        at_start = begun if values is first.values else None
        regressor, effort = simulated_rows(model, values, data, machine) if at_start is None else at_start()
        return regressor, regressor, data.target - effort

    return _iterate(model, data, first, rows)[0]


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
    closed = all(machine.can_close(m) for m in data.motions)
    signal = "effort" if closed else "position"
    measured = [getattr(m, signal) for m in data.motions]
    size = sum(len(m.moving) for m in data.motions)

    @remember_last_call
    def at(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        traces = [replay(model, values, m, machine, closed=closed, differentiate=signal) for m in data.motions]
        # A trial step that diverges returns a large residual, so that the solver rejects it and no filter fails.
        slopes = [_derivative(t, signal) for t in traces]
        if not all(is_bounded(getattr(t, signal)) and is_bounded(d) for t, d in zip(traces, slopes, strict=True)):
            return np.full(size, 1e6), np.zeros((size, len(values)))
        # A simulation covers every sample, including those at rest.
        reduced = np.concatenate(
            [
                m.reduce(np.column_stack([getattr(t, signal) - x, d]))
                for m, t, d, x in zip(data.motions, traces, slopes, measured, strict=True)
            ]
        )
        return reduced[:, 0], reduced[:, 1:]

    lower, upper = model.bounds()
    start = np.clip(first.values, lower + 1e-9, np.where(np.isfinite(upper), upper * (1.0 - 1e-9), upper))
    scale = np.linalg.norm(at(start)[1], axis=0)
    if not scale.any():
        raise IdentificationError(
            "the simulated response diverges at the least-squares estimate, so that no fit to simulations can start "
            "there; use the least-squares estimate, or check the sign and unit of the effort"
        )
    # Powers of two round nothing: the search begins with the values that were simulated.
    scale = np.exp2(-np.round(np.log2(np.where(scale > 0.0, scale, 1.0))))

    def equations(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        residual, jacobian = at(x * scale)
        slopes = jacobian * scale
        return 0.5 * float(residual @ residual), slopes.T @ residual, slopes.T @ slopes

    # Without inertia the response is so sensitive that squares of its derivative overflow: such steps are rejected.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        found = bounded_least_squares(
            equations, start / scale, lower / scale, upper / scale, iterations=40, tolerance=1e-10, damping=1e-6
        )
    values = found.x * scale
    residual, jacobian = at(values)
    return _solution(model, values, jacobian, -residual, found.evaluations, found.converged)


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


@dataclass(frozen=True)
class SolvedMethod:
    """Solution of a method on the fitted recordings, in a form that allows cross-validation over blocks."""

    model: JointModel
    found: Solution
    every_row: bool = False  # whether the solution's rows include samples at rest
    instruments: np.ndarray | None = None  # instruments of an instrumental-variable estimate, (m, p)

    def without_blocks(self, cuts: Sequence[np.ndarray], moving: np.ndarray) -> list[dict[int, np.ndarray]]:
        """Return the parameters, (p,), without each block of several cuts, by the block's number.

        The cuts are the blocks of all reduced samples, (n,), of which a mask marks those that are `moving`, (n,). The
        model is linearised at the solution, with the method's own weights and instruments, and stays within its bounds.
        """
        rows = [labels if self.every_row else labels[moving] for labels in cuts]
        made = values_without_blocks_of_cuts(self.found, rows, self.instruments)
        lower, upper = self.model.bounds()
        return [{block: np.clip(values, lower, upper) for block, values in each.items()} for each in made]
