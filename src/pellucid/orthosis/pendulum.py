r"""A driven pendulum with friction and a spring, simulated with its exact derivatives over all samples at once.

.. math::
   I\ddot q = \tau - b\dot q - c\tanh(\dot q/w) - m\,\sin q - k\,q - \tau_0

Friction and gravity are the core's joint; the spring, a torque that goes straight from sample to sample, and an initial
state that is an unknown like the others are what the core's simulation has not. A test holds both to the same motion.

Steps are fourth-order Runge-Kutta's. The whole motion is found by Newton's method: linearised about a guess, all steps
are one linear recursion, solved by BLAS. From the measured motion it takes a handful of iterations, and what it finds
is what stepping through would give, at a hundredth of the time that takes in Python.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from .._errors import IdentificationError
from ..models.filtered_dynamics import march, regressor
from .transfer_function import INPUT_HOLDS, time_steps

NAMES = ("inertia", "damping", "coulomb", "gravity", "stiffness", "offset")
"""I, b, c, m (mass times g times distance), k and tau_0, in this order everywhere."""

UNITS = ("kg*m^2", "N*m*s/rad", "N*m", "N*m", "N*m/rad", "N*m")


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of the Newton search for a whole motion."""

    newton_tolerance: float = 1e-10  # largest change of the motion, over its size, at which Newton's iteration stops
    max_newton_iterations: int = 30
    piece_steps: int = 256  # number of steps that are solved together if Newton's method fails for the whole motion
    min_piece_steps: int = 4  # the motion counts as diverging if even this many steps cannot be solved


NEWTON_SETTINGS = NewtonSettings()


MAX_END_SHIFT_RAD = 1e4
"""Radians by which a motion's end would move, to first order, if a parameter or the start were twice what it is: beyond
that, as after turns over the top, nothing can be fitted to it."""


@dataclass(frozen=True)
class PendulumMotion:
    """A simulated motion and its derivatives at the samples."""

    position: np.ndarray  # position, velocity: (n,) [rad], [rad/s]
    velocity: np.ndarray
    jacobian: np.ndarray  # (n, 8) Of the position, by the six parameters, then by the initial position and velocity
    states: np.ndarray  # (m, 2) Position and velocity at every step, for the next simulation to start from


@dataclass(frozen=True)
class PendulumDrive:
    """A record's torque, ready for simulation."""

    steps: np.ndarray  # (m,) [s]
    torque: np.ndarray  # (m, 3) At the start, the middle and the end of every step [N*m]
    substeps: int  # Steps between samples
    width: float  # width of the smooth sign of velocity [rad/s]


def pendulum_drive(
    time: np.ndarray, torque: np.ndarray, *, hold: str, width: float, substeps: int = 1
) -> PendulumDrive:
    """Torque at the instants that the integration needs. `time`, `torque` (n,) [s], [N*m]; `width` [rad/s]."""
    if hold not in INPUT_HOLDS:
        raise IdentificationError(f"hold: found {hold!r}, expected one of {', '.join(INPUT_HOLDS)}")
    if not width > 0.0:
        raise IdentificationError(f"width: found {width:g} rad/s, expected more than 0")
    steps = time_steps(time)
    torque = np.asarray(torque, float)
    rise = np.diff(torque) if hold == "first" else np.zeros(len(steps))
    share = (np.arange(substeps)[:, None] + np.array([0.0, 0.5, 1.0])) / substeps
    made = torque[:-1, None, None] + rise[:, None, None] * share
    return PendulumDrive(np.repeat(steps / substeps, substeps), made.reshape(-1, 3), substeps, width)


def simulate_pendulum(
    values: np.ndarray, initial: np.ndarray, drive: PendulumDrive, guess: np.ndarray
) -> PendulumMotion:
    """Simulate a motion from its initial state. `values` (6,); `initial` (2,); `guess` (m + 1, 2)."""
    states = _solve_whole_motion(values, initial, drive, guess)
    if states is None:
        states = _solve_piecewise(values, initial, drive)
    if not np.isfinite(states).all():
        raise IdentificationError("the simulated pendulum diverges")
    _, slopes = _integrate_steps(values, states[:-1], drive, parameters=True)
    start = np.zeros((2, 8))
    start[:, 6:] = np.eye(2)
    forcing = np.concatenate([slopes[:, :, 2:], np.zeros((len(slopes), 2, 2))], axis=2)
    spread = march(slopes[:, :, :2], forcing, start)
    weight = np.maximum(np.abs(np.concatenate([values, initial])), 1e-3)
    if not np.abs(spread[-1, 0] * weight).max() < MAX_END_SHIFT_RAD:
        raise IdentificationError("the simulated pendulum diverges: its end follows no more from its start")
    samples = slice(None, None, drive.substeps)
    return PendulumMotion(states[samples, 0], states[samples, 1], spread[samples, 0], states)


_CORE_SELECTION = np.zeros((len(_core.PARAMETER_NAMES), 5))
"""Core parameters of a unit of damping, Coulomb friction, gravity and offset, and of cos q, the slope of sin q."""
for _column, _targets in enumerate(
    (
        ("viscous_positive", "viscous_negative"),
        ("coulomb_positive", "coulomb_negative"),
        ("gravity_sine",),
        ("offset",),
        ("gravity_cosine",),
    )
):
    for _target in _targets:
        _CORE_SELECTION[_core.PARAMETER_NAMES.index(_target), _column] = 1.0
_ACTIVE_PARAMETERS = tuple(np.flatnonzero(_CORE_SELECTION.any(axis=1)).tolist())


def resistance(q: np.ndarray, v: np.ndarray, width: float) -> np.ndarray:
    """Torque that a unit of damping, Coulomb friction, gravity and offset takes, and cos q, shape (m, 5)."""
    return regressor(q, v, np.zeros(len(q)), _ACTIVE_PARAMETERS, width) @ _CORE_SELECTION[list(_ACTIVE_PARAMETERS)]


def _acceleration(
    values: np.ndarray, q: np.ndarray, v: np.ndarray, torque: np.ndarray, width: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Acceleration, its derivatives by q and v, and the torque of a unit of each parameter, shape (m, 5)."""
    inertia, damping, coulomb, gravity, stiffness, offset = values
    columns = resistance(q, v, width)
    resisting = columns[:, :4] @ np.array([damping, coulomb, gravity, offset])
    a = (torque - resisting - stiffness * q) / inertia
    by_q = -(gravity * columns[:, 4] + stiffness) / inertia
    by_v = -(damping + coulomb * (1.0 - columns[:, 1] ** 2) / width) / inertia
    return a, by_q, by_v, columns


def _integrate_steps(
    values: np.ndarray, states: np.ndarray, drive: PendulumDrive, *, parameters: bool
) -> tuple[np.ndarray, np.ndarray]:
    """All steps at once: states after, shape (m, 2), and their derivatives by the states before and by parameters."""
    h = drive.steps
    m = len(h)
    width = 8 if parameters else 2
    seed = np.zeros((2, m, width))
    seed[0, :, 0] = seed[1, :, 1] = 1.0
    q0, v0 = states.T
    q, v, tangent = q0, v0, seed
    total_q, total_v, total = np.zeros(m), np.zeros(m), np.zeros((2, m, width))
    for stage, (weight, reach) in enumerate(((1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0))):
        torque = drive.torque[:, (0, 1, 1, 2)[stage]]
        a, by_q, by_v, columns = _acceleration(values, q, v, torque, drive.width)
        slope = np.empty((2, m, width))
        slope[0] = tangent[1]
        slope[1] = by_q[:, None] * tangent[0] + by_v[:, None] * tangent[1]
        if parameters:
            damped, rubbed, hung, constant, _ = columns.T
            slope[1, :, 2:] -= np.column_stack([a, damped, rubbed, hung, q, constant]) / values[0]
        total_q, total_v, total = total_q + weight * v, total_v + weight * a, total + weight * slope
        if reach:
            q, v, tangent = q0 + reach * h * v, v0 + reach * h * a, seed + (reach * h)[:, None] * slope
    sixth = h / 6.0
    after = np.column_stack([q0 + sixth * total_q, v0 + sixth * total_v])
    return after, np.moveaxis(seed + sixth[:, None] * total, 0, 1)


def _solve_whole_motion(
    values: np.ndarray, initial: np.ndarray, drive: PendulumDrive, guess: np.ndarray
) -> np.ndarray | None:
    """States at every step, shape (m + 1, 2); None where the iteration does not settle."""
    states = np.array(guess, float)
    states[0] = initial
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(NEWTON_SETTINGS.max_newton_iterations):
            after, slopes = _integrate_steps(values, states[:-1], drive, parameters=False)
            if not (np.isfinite(after).all() and np.isfinite(slopes).all()):
                return None
            change = march(slopes, (after - states[1:])[:, :, None], np.zeros((2, 1)))[:, :, 0]
            states = states + change
            if not np.isfinite(states).all():
                return None
            if np.abs(change).max() <= NEWTON_SETTINGS.newton_tolerance * (1.0 + np.abs(states).max()):
                return states
    return None


def _solve_piecewise(values: np.ndarray, initial: np.ndarray, drive: PendulumDrive) -> np.ndarray:
    """The same from no guess: piece after piece, each started at rest where the last one ended."""
    states = np.empty((len(drive.steps) + 1, 2))
    states[0] = initial
    begin, length = 0, NEWTON_SETTINGS.piece_steps
    while begin < len(drive.steps):
        end = min(begin + length, len(drive.steps))
        part = PendulumDrive(drive.steps[begin:end], drive.torque[begin:end], 1, drive.width)
        found = _solve_whole_motion(values, states[begin], part, np.tile(states[begin], (end - begin + 1, 1)))
        if found is None and length <= NEWTON_SETTINGS.min_piece_steps:
            states[begin:] = np.nan
            break
        if found is None:
            length //= 4
            continue
        states[begin : end + 1] = found
        begin, length = end, NEWTON_SETTINGS.piece_steps
    return states
