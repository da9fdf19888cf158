"""Choose the estimator whose values are reported first, by cross-validation over blocks of the fitted recordings.

The purpose is either to predict torque (the effort of a recorded motion) or to simulate (the motion of a recorded
command). Among the estimators whose error at the stated purpose is nearly the smallest, the plainest is chosen: least
squares, if it is among them. Another of these is chosen only if it does far better at the other purpose. No test of
significance decides: all estimators fit the same parameters, so that a smaller error needs no proof to be preferred.

Held-out recordings take no part. Each block of the fitted ones is predicted by what its estimator makes of the others.
Least squares with fixed weights are fitted anew; other estimators are linearised, with their own instruments, and so is
the simulated position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...numerics.block_test import MIN_IMPROVEMENT, HeldOutComparison, compare_held_out
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, regression_rows
from .friction_solver import (
    MAX_REFITTED_ROWS,
    block_labels,
    residuals_without_blocks,
    solve_without_blocks,
    values_without_blocks,
)
from .replay import Machine, Prediction, is_bounded, replay

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
