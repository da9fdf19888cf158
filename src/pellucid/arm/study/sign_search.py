"""Check the signs of a robot's efforts and positions: friction must dissipate energy, and no joint may be flipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.robot import Robot
from ..tree_motion import TreeMotion


@dataclass(frozen=True)
class SignThresholds:
    """When a sign counts as wrong."""

    # Approximate number of rows, spread over all recordings, from which signs are determined.
    sign_row_count: int = 4000
    # A motor's sign is wrong if its friction creates at least this share of RMS effort times RMS speed.
    motor_power_threshold: float = 0.02
    # The same threshold for a torque sensor at the joint. It sees little friction, and a delay of some milliseconds
    # makes a few hundredths.
    sensor_power_threshold: float = 0.2
    # A joint is flipped if the other sign reduces the unexplained effort by more than this factor, in most segments.
    decisive_ratio: float = 1.15
    # A joint may be flipped if the other sign reduces the unexplained effort by at least this factor.
    hint_ratio: float = 1.01
    # Another joint is an equally good candidate if flipping it explains more than this share of the same reduction.
    min_alternative_share: float = 0.8
    min_segment_share: float = 0.9  # smallest share of segments in which the other sign must fit better


SIGN_THRESHOLDS = SignThresholds()


@dataclass(frozen=True)
class FlippedJoint:
    """A joint that fits the others better with the other sign of position and effort, or of effort alone."""

    joint: int  # index of the joint
    ratio: float  # residual with the stated sign over residual with the other
    sure: bool  # whether the evidence is decisive
    effort_alone: bool  # whether only the effort's sign is wrong
    others: tuple[int, ...] = ()  # joints that fit nearly as well if flipped instead, because mirror images move alike
    stated: bool = False  # whether the evidence comes from the stated bodies


def friction_power_shares(robot: Robot, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Return the power that friction dissipates at each joint, divided by RMS effort times RMS speed, shape (m,).

    A negative share means that the sign of effort or velocity is wrong.
    """
    rows, count = thinned(motions, SIGN_THRESHOLDS.sign_row_count), len(robot.names)
    return _dissipated_power(robot, rows, np.ones((2, count)), np.zeros(count), effort_weights(rows))


def _dissipated_power(robot: Robot, rows, signs, zeros, weights) -> np.ndarray:
    """Return the friction power shares, (m,), for other `signs`, (2, m), of gears and drives."""
    theta, _ = solve_with_signs(robot, rows, signs, zeros, weights)
    first = 10 * len(robot.tree.order)
    own = theta[first : first + 4 * len(robot.names)].reshape(-1, 4)[:, 1:3]
    of_motors = theta[first + 4 * len(robot.names) :].reshape(-1, 3)[:, 1:]
    turns = _turns(robot, signs)
    made = [_arguments(robot, row, signs, zeros)[:2] for row in rows]
    shares = np.zeros(len(own))
    for k in range(len(own)):
        moving = [row.moving[:, k] for row in rows]
        v = np.concatenate([motion[1][rows] for (motion, _), rows in zip(made, moving, strict=True)])
        effort = np.concatenate([effort[rows, k] for (_, effort), rows in zip(made, moving, strict=True)])
        both = [(v[:, k], own[k])]
        if k in robot.shared:
            both.append((v @ turns[k], of_motors[robot.shared.index(k)]))
        size = np.sqrt(np.mean(effort * effort)) if len(v) else 0.0
        taken = [
            np.mean(viscous * x * x + dry * np.abs(x)) / (size * np.sqrt(np.mean(x * x)))
            for x, (viscous, dry) in both
            if size > 0.0 and x.any()
        ]
        shares[k] = min(taken, default=0.0)
    return shares


def stated_effort_correlation(robot: Robot, motions: Sequence[TreeMotion]) -> float:
    """Return the mean correlation of the efforts with those of the stated bodies, over all joints."""
    effort, needed, moving = (
        np.concatenate(each)
        for each in zip(
            *(
                (m.effort, robot.tree.core.inverse_dynamics(m.position, m.velocity, m.acceleration), m.moving)
                for m in motions
            ),
            strict=True,
        )
    )
    sizes = [np.sqrt((x * x * moving).sum(axis=0)) for x in (effort, needed)]
    has_effort = (sizes[0] > 0.0) & (sizes[1] > 0.0)
    alike = (effort * needed * moving).sum(axis=0)[has_effort] / (sizes[0] * sizes[1])[has_effort]
    return float(alike.mean()) if has_effort.any() else 0.0


def find_flipped_joints(
    robot: Robot, motions: Sequence[TreeMotion], zeros: np.ndarray, stated: bool = False
) -> list[FlippedJoint]:
    """Find joints that fit better when flipped about their `zeros`, (m,), one after the other, the clearest first.

    Inertial parameters are free, and the mirror image of most bodies makes nearly the same efforts. If they are
    `stated`, the stated ones are tried too.
    """
    rows, found = thinned(motions, SIGN_THRESHOLDS.sign_row_count), []
    weights, signs = effort_weights(rows), np.ones((2, len(robot.names)))  # signs of gears and of drives
    left = solve_with_signs(robot, rows, signs, zeros, weights)[1]
    for _ in robot.names:
        tried = []
        for k in np.flatnonzero((signs > 0.0).all(axis=0)):
            for turned in ([-1.0, 1.0], [1.0, -1.0]):
                other = signs.copy()
                other[:, k] = turned
                tried.append((solve_with_signs(robot, rows, other, zeros, weights)[1], k, other))
        # A fit in which friction creates energy is no improvement.
        better = (one for one in sorted(tried, key=lambda one: one[0]) if left >= SIGN_THRESHOLDS.hint_ratio * one[0])
        chosen = next(
            (
                one
                for one in better
                if _dissipated_power(robot, rows, one[2], zeros, weights).min() > -SIGN_THRESHOLDS.motor_power_threshold
            ),
            None,
        )
        if chosen is None:
            break
        best, k, other = chosen
        ratio, is_explained = left / best, False
        sure = _is_decisive(ratio, *(_residuals_by_segment(robot, rows, s, zeros, weights) for s in (signs, other)))
        if stated and not sure:
            before, after = (solve_with_signs(robot, rows, s, zeros, weights, stated=True)[1] for s in (signs, other))
            sure = is_explained = _is_decisive(
                before / after,
                *(_residuals_by_segment(robot, rows, s, zeros, weights, stated=True) for s in (signs, other)),
            )
            ratio = before / after if is_explained else ratio
        alone = bool(other[0, k] > 0.0)
        alike = (
            i
            for one, i, s in tried
            if i != k
            and (s[0, i] > 0.0) == alone
            and left - one > SIGN_THRESHOLDS.min_alternative_share * (left - best)
        )
        others = () if is_explained else tuple(int(i) for i in alike)
        found.append(FlippedJoint(int(k), float(ratio), sure, alone, others, is_explained))
        signs, left = other, best
    return found


def _is_decisive(ratio: float, before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the residual falls by a decisive `ratio`, and in most segments."""
    return (
        ratio > SIGN_THRESHOLDS.decisive_ratio and float(np.mean(before > after)) >= SIGN_THRESHOLDS.min_segment_share
    )


def thinned(motions: Sequence[TreeMotion], count: int) -> list[TreeMotion]:
    """Return what is needed of the motions to compare signs, in about `count` evenly spaced rows of all of them."""
    step = max(1, sum(len(m) for m in motions) // count)
    names = ("time", "position", "velocity", "acceleration", "effort", "moving", "segment")
    return [replace(m, **{name: getattr(m, name)[::step] for name in names}) for m in motions]


def effort_weights(rows: Sequence[TreeMotion]) -> np.ndarray:
    """Return one over each joint's mean square effort, (m,)."""
    size = sum((row.effort**2 * row.moving).sum(axis=0) for row in rows)
    count = sum(row.moving.sum(axis=0) for row in rows)
    return np.where(size > 0.0, count / np.where(size > 0.0, size, 1.0), 0.0)


def _turns(robot: Robot, signs: np.ndarray) -> np.ndarray:
    """Return the turns of motors per turn of joints, (m, m), with the signs of gears applied to other joints' turns."""
    stated_turns = robot.turns_array
    return np.where(np.eye(len(stated_turns)) > 0.0, stated_turns, signs[0][:, None] * stated_turns)


def _arguments(robot: Robot, row: TreeMotion, signs: np.ndarray, zeros: np.ndarray):
    """Return motion, efforts and friction columns with other `signs`, (2, m), of gears and of drives."""
    stated_turns, (gear, drive), turns = robot.turns_array, signs, _turns(robot, signs)
    moved = np.linalg.solve(turns, gear[:, None] * stated_turns)
    effort = np.linalg.solve(stated_turns.T, row.effort.T).T * (gear * drive) @ turns
    q, v, a = zeros + (row.position - zeros) @ moved.T, row.velocity @ moved.T, row.acceleration @ moved.T
    shared = [
        x[:, None] * turns[i]
        for i in robot.shared
        for c, b in [(v @ turns[i], a @ turns[i])]
        for x in (b, c, np.sign(c))
    ]
    own = np.stack([a, v, np.sign(v), np.ones_like(v)], axis=-1)
    return (q, v, a), effort, {"own": own, "shared": np.stack(shared, axis=-1) if shared else None}


def solve_with_signs(robot: Robot, rows, signs, zeros, weights, stated: bool = False) -> tuple[np.ndarray, float]:
    """Solve least squares over all rows with free or `stated` bodies; return parameters and weighted squared
    residual."""
    normal, projected, whole = 0.0, 0.0, 0.0
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        n, p, _ = robot.tree.core.normal_equations(*motion, effort, weight=row.moving * weights, **columns)
        normal, projected = normal + n, projected + p
        whole += float((effort**2 * row.moving * weights).sum())
    known = robot.tree.parameters if stated else np.zeros(0)
    theta, free = np.concatenate([known, np.zeros(len(normal) - len(known))]), slice(len(known), None)
    size = np.sqrt(np.maximum(np.diag(normal), 1e-30))[free]
    values, vectors = np.linalg.eigh(normal[free, free] / np.outer(size, size))
    seen = values > 1e-9 * values[-1]
    left = (projected - normal @ theta)[free] / size
    theta[free] = vectors[:, seen] @ ((vectors[:, seen].T @ left) / values[seen]) / size
    return theta, whole - float(theta @ (2.0 * projected - normal @ theta))


def _residuals_by_segment(robot: Robot, rows, signs, zeros, weights, stated: bool = False) -> np.ndarray:
    """Return the weighted squared residual of each segment."""
    theta, _ = solve_with_signs(robot, rows, signs, zeros, weights, stated)
    squares: dict[int, float] = {}
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        left = ((effort - robot.tree.core.regressor(*motion, **columns) @ theta) ** 2 * row.moving) @ weights
        for segment in np.unique(row.segment[row.segment >= 0]):
            squares[int(segment)] = squares.get(int(segment), 0.0) + float(left[row.segment == segment].sum())
    return np.array([squares[key] for key in sorted(squares)])
