"""Causes of what a robot's model misses at each joint, decided as those of a single joint are (`joint.fit.causes`).

The rows of a joint, and the columns that reach it, are its regression: bodies, its own friction, and all friction that
the model may lack. Bodies are free at each joint, so that no other joint's error decides. An effort that is late by a
short time is less its own derivative times that time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...joint.fit import causes, discrepancy, left_out_stretches, recording_agreement, turning_friction
from ...models.causes import DELAY, DRIFT, POSITION_FRICTION, SATURATION, Cause, ParallelSpring
from ...models.friction_terms import COULOMB_FRICTION
from ...models.joint import PARALLEL_STIFFNESS
from ...models.robot import Robot
from ...numerics.motion import SLOW_SHARE
from ..tree_motion import TreeMotion
from .tree_estimate import TreeEstimate
from .tree_regression import FrictionPart, LinearisedModel, TreeRows, TreeSolution, compute_loads

NO_FRICTION = ("offset", PARALLEL_STIFFNESS)
"""Coefficients of a joint that are no friction."""

SLOW_SPEED_SHARES = (causes.SPRING_SETTINGS.slow_speed_share, causes.CAUSE_THRESHOLDS.slow_speed_share)
"""Shares of the usual speed below which samples are excluded in the search for springs, and for other causes."""

MIN_WEIGHT_SHARE = 1e-6
"""Gravity acts on a joint if its largest effort exceeds this share of the largest at any joint."""


def find_parallel_springs(at: LinearisedModel, found: TreeSolution) -> dict[int, ParallelSpring]:
    """Return the springs that act in parallel to the drives, by joint.

    `found` is the solution of the linearised model. Joints with a spring in the model are not searched.
    """
    made: dict[int, ParallelSpring] = {}
    joints = [k for k in _unexplained(at, found) if PARALLEL_STIFFNESS not in at.model.families[k]]
    if not joints:
        return made
    weights = _weights(at.rows.robot, at.rows)
    for k in joints:
        stretches = _stretches(at, found, k, causes.SPRING_SETTINGS.slow_speed_share)
        turning, gap = _turning_columns(at.rows, k), _gap_pulses(at.rows, k, stretches.states.load)
        spring = causes.decide_parallel_spring(
            stretches, turning, gap, stretches.own_error, bool(weights[k] > MIN_WEIGHT_SHARE * weights.max()),
            causes.CAUSE_THRESHOLDS.min_effort_share,
        )  # fmt: skip
        if spring.is_found:
            made[k] = spring
    return made


def find_joint_causes(
    at: LinearisedModel, found: TreeSolution, estimate: TreeEstimate, springs: Mapping[int, ParallelSpring]
) -> tuple[Cause, ...]:
    """Return the causes of what a solution misses at each joint, the one that explains most first.

    `estimate` has the parameters of the solution. `springs` are those that `find_parallel_springs` found, by joint.
    """
    made, names = [], at.rows.robot.names
    for k in _unexplained(at, found):
        stretches = _stretches(at, found, k, causes.CAUSE_THRESHOLDS.slow_speed_share)
        stretches.add(_turning_columns(at.rows, k))
        candidates = {
            POSITION_FRICTION: causes.travel_columns(stretches),
            SATURATION: causes.excess_columns(stretches),
            DRIFT: causes.drift_columns(stretches),
            DELAY: [_by_recording(at.rows, k, stretches.effort, lambda x, t: -np.gradient(x, t))],
        }
        told = causes.explain_residual(stretches, candidates, stretches.own_error)
        made += [replace(cause, joint=names[k]) for cause in told]
    for k, spring in springs.items():
        stiffness = estimate[f"{names[k]}.{PARALLEL_STIFFNESS}"]
        made.append(causes.spring_cause(spring, stiffness, estimate.confidence, names[k]))
    return tuple(sorted(made, key=lambda cause: -cause.share))


def _unexplained(at: LinearisedModel, found: TreeSolution) -> list[int]:
    """Return the joints whose residual is large enough for a cause: no cause explains more than all of it."""
    left = [float(np.mean(r**2)) if len(r) else 0.0 for r in at.residuals(found.values)]
    least = causes.CAUSE_THRESHOLDS.min_effort_share**2 * at.rows.size**2
    return [k for k, (own, needed) in enumerate(zip(left, least.tolist(), strict=True)) if own > needed]


def _weights(robot: Robot, rows: TreeRows) -> np.ndarray:
    """Return the largest effort that gravity asks of each joint in these rows with the stated bodies, (m,)."""
    rest = np.zeros_like(rows.position)
    return np.abs(robot.tree.core.inverse_dynamics(rows.position, rest, rest)).max(axis=0)


def _stretches(
    at: LinearisedModel, found: TreeSolution, k: int, slow_speed_share: float
) -> left_out_stretches.LeftOutColumns:
    """Return the rows of joint k for cross-validation, without samples below a share of its usual speed."""
    rows, model, lines = at.rows, at.model, at.rows.lines[k]
    measured = rows.effort[lines, k]
    slow = _turning(rows, k)[lines, SLOW_SPEED_SHARES.index(slow_speed_share) - len(SLOW_SPEED_SHARES)]
    counted = left_out_stretches.counted_rows(np.abs(slow) < SLOW_SHARE)
    numbers = [""] * len(model.base.names) + [part.number for part in model.parts] + [""] * (2 * len(model.ripples))
    return left_out_stretches.LeftOutColumns(
        at.columns[k][counted],
        measured,
        measured - at.residuals(found.values)[k],
        _states(rows, k, compute_loads(rows, model, found.values)[lines, k]),
        jacobian=lambda: at.columns[k],
        friction=np.array([numbers[i] not in ("", *NO_FRICTION) for i in at.places[k].tolist()]),
        time=_times(rows, k)[lines],
        labels=left_out_stretches.segments_of([len(m) for m in rows.motions])[lines],
        rows=counted,
        effort_unit=rows.robot.units[k][1],
    )


def _states(rows: TreeRows, k: int, load: np.ndarray) -> discrepancy.States:
    """Return the states of joint k, whose `load` is (n_k,). Base parameters contain an error of its angle's zero."""
    lines = rows.lines[k]
    acceleration = np.concatenate([m.acceleration[:, k] for m in rows.motions])[lines]
    return discrepancy.States(
        position=rows.position[lines, k],
        velocity=rows.velocity[lines, k],
        acceleration=acceleration,
        load=load,
        cosine=np.zeros(len(lines)),
        snap=_by_recording(rows, k, acceleration, lambda x, t: np.gradient(np.gradient(x, t), t)),
        standstill=np.zeros(len(lines)),
        heading=rows.friction(FrictionPart(k, False, COULOMB_FRICTION.name))[lines],
    )


def _by_recording(
    rows: TreeRows, k: int, values: np.ndarray, make: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return a function of the `values` of joint k, (n_k,), and of their times, of each stretch alone; (n_k,)."""
    made, stretch = np.zeros(len(values)), rows.stretch[rows.lines[k]]
    time = np.concatenate([m.time for m in rows.motions])[rows.lines[k]]
    for i in range(len(rows.motions)):
        own = stretch == i
        if np.count_nonzero(own) > 2:
            made[own] = make(values[own], time[own])
    return made


def _gap_pulses(rows: TreeRows, k: int, load: np.ndarray) -> list[np.ndarray]:
    """Return pulses at times from every change of the sign of the `load` of joint k, (n_k,); each has that shape."""

    def pulse(shift: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        return lambda x, t: np.gradient(np.interp(t - shift, t, x), t)

    return [_by_recording(rows, k, np.sign(load), pulse(shift)) for shift in turning_friction.REVERSAL_TIMES_S]


def _turning_columns(rows: TreeRows, k: int) -> list[np.ndarray]:
    """Return pulses at times from every reversal of joint k, each (n_k,)."""
    return list(_turning(rows, k)[rows.lines[k], : -len(SLOW_SPEED_SHARES)].T)


def _turning(rows: TreeRows, k: int) -> np.ndarray:
    """Return pulses where joint k turns, and the shares of rows from slow speeds for each of `SLOW_SPEED_SHARES`.

    The pulses, (N, r), are in time order; the shares, (N, 2), follow. All are filtered as the effort is.
    """
    if k not in rows.reversals:
        usual = float(np.sqrt(np.mean(rows.velocity[:, k] ** 2)))
        rows.reversals[k] = np.concatenate([_turning_along(motion, k, usual) for motion in rows.motions])
    return rows.reversals[k]


def _turning_along(motion: TreeMotion, k: int, usual: float) -> np.ndarray:
    fs = motion.rate if motion.recorded is None else motion.recorded.rate

    def law(speed: np.ndarray) -> np.ndarray:
        slow = [(np.abs(speed) <= share * usual).astype(float) for share in SLOW_SPEED_SHARES]
        pulses = [fs * np.gradient(sign) for sign in turning_friction.shifted_signs(speed, fs)]
        return np.column_stack([*pulses, *slow])

    return motion.friction(law, np.eye(motion.velocity.shape[1])[k])


def _times(rows: TreeRows, k: int) -> np.ndarray:
    """Return the time of all rows from start to end of their recording, (N,); 0 where the speeds of joint k change."""

    def span_of(name: str) -> tuple[float, float] | None:
        same = [(m.time, m.velocity[:, k]) for m in rows.motions if m.recording == name]
        return recording_agreement.steady_span(lambda: same)

    spans = {name: span_of(name) for name in {m.recording for m in rows.motions}}
    return np.concatenate([recording_agreement.centred_time(m.time, spans[m.recording]) for m in rows.motions])
