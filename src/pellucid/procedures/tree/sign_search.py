"""Does a robot's effort fit its motion: does friction take energy at every joint, and is any joint turned around?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion

ROWS = 4000
"""Of all recordings, spread over them, that signs are looked for in."""

GIVES, SURELY_GIVES = 0.02, 0.2
"""Power that friction gives, as a share of a joint's RMS effort times its RMS speed, from which on a motor's sign is
wrong, and a torque sensor's: one behind the friction that is some milliseconds late gives a few hundredths."""

TELLS = 1.15
"""A joint is turned around where that leaves so many times less of the efforts unexplained, in most segments."""

HINTS = 1.01
"""And may be, where it leaves so many times less."""

NEARLY = 0.8
"""Share of what a joint's turning explains, from which on another joint's is as good a guess."""

MOST = 0.9
"""Share of segments."""


@dataclass(frozen=True)
class TurnedAround:
    """A joint that fits the others better with the other sign of position and effort, or of effort alone."""

    joint: int
    ratio: float  # Of what its sign leaves over to what the other one does
    sure: bool
    effort_alone: bool  # Whether it is the effort's sign alone
    others: tuple[int, ...] = ()  # Joints that do nearly as well in its place: mirror images move alike
    stated: bool = False  # Whether it is the stated bodies that tell it


def giving(robot: Robot, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Power that friction takes of each joint, as a share of its RMS effort times its RMS speed, shape (m,): negative
    where the effort's sign is wrong against that of the motion."""
    rows = _rows(motions)
    return _taken(robot, rows, np.ones((2, len(robot.names))), np.zeros(len(robot.names)), _weights(rows))


def _taken(robot: Robot, rows, signs, zeros, weights) -> np.ndarray:
    """The same with other signs."""
    theta, _ = _solved(robot, rows, signs, zeros, weights)
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


def as_bodies_need(robot: Robot, motions: Sequence[TreeMotion]) -> float:
    """Correlation of the efforts with what the stated bodies need, over all joints, each by its own size."""
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
    told = (sizes[0] > 0.0) & (sizes[1] > 0.0)
    alike = (effort * needed * moving).sum(axis=0)[told] / (sizes[0] * sizes[1])[told]
    return float(alike.mean()) if told.any() else 0.0


def turned_around(
    robot: Robot, motions: Sequence[TreeMotion], zeros: np.ndarray, stated: bool = False
) -> list[TurnedAround]:
    """Joints, the clearest first, that fit better turned around about their `zeros` (m,), one after the other. Bodies
    are free, and a mirror image of most makes nearly the same efforts; where they are `stated`, these are asked too."""
    rows, found = _rows(motions), []
    weights, signs = _weights(rows), np.ones((2, len(robot.names)))  # Of gears, and of drives
    left = _solved(robot, rows, signs, zeros, weights)[1]
    for _ in robot.names:
        tried = []
        for k in np.flatnonzero((signs > 0.0).all(axis=0)):
            for turned in ([-1.0, 1.0], [1.0, -1.0]):
                other = signs.copy()
                other[:, k] = turned
                tried.append((_solved(robot, rows, other, zeros, weights)[1], k, other))
        # What fits by friction that gives energy is no better.
        better = (one for one in sorted(tried, key=lambda one: one[0]) if left >= HINTS * one[0])
        chosen = next((one for one in better if _taken(robot, rows, one[2], zeros, weights).min() > -GIVES), None)
        if chosen is None:
            break
        best, k, other = chosen
        ratio, told = left / best, False
        sure = _tells(ratio, *(_by_segment(robot, rows, s, zeros, weights) for s in (signs, other)))
        if stated and not sure:
            before, after = (_solved(robot, rows, s, zeros, weights, stated=True)[1] for s in (signs, other))
            sure = told = _tells(
                before / after, *(_by_segment(robot, rows, s, zeros, weights, stated=True) for s in (signs, other))
            )
            ratio = before / after if told else ratio
        alone = bool(other[0, k] > 0.0)
        alike = (
            i for one, i, s in tried if i != k and (s[0, i] > 0.0) == alone and left - one > NEARLY * (left - best)
        )
        others = () if told else tuple(int(i) for i in alike)
        found.append(TurnedAround(int(k), float(ratio), sure, alone, others, told))
        signs, left = other, best
    return found


def _tells(ratio: float, before: np.ndarray, after: np.ndarray) -> bool:
    """Whether so many times less is left over, and in most segments."""
    return ratio > TELLS and float(np.mean(before > after)) >= MOST


@dataclass(frozen=True)
class _Rows:
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    moving: np.ndarray
    segment: np.ndarray


def _rows(motions: Sequence[TreeMotion]) -> list[_Rows]:
    step = max(1, sum(len(m) for m in motions) // ROWS)
    names = ("position", "velocity", "acceleration", "effort", "moving", "segment")
    return [_Rows(*(getattr(m, name)[::step] for name in names)) for m in motions]


def _weights(rows: Sequence[_Rows]) -> np.ndarray:
    """One over each joint's mean square effort, (m,)."""
    size = sum((row.effort**2 * row.moving).sum(axis=0) for row in rows)
    count = sum(row.moving.sum(axis=0) for row in rows)
    return np.where(size > 0.0, count / np.where(size > 0.0, size, 1.0), 0.0)


def _turns(robot: Robot, signs: np.ndarray) -> np.ndarray:
    """Of motors, whose own turns have other signs, those by other joints not: gears taken out, the other way round."""
    told = robot.turns_array
    return np.where(np.eye(len(told)) > 0.0, told, signs[0][:, None] * told)


def _arguments(robot: Robot, row: _Rows, signs: np.ndarray, zeros: np.ndarray):
    """Motion, efforts and columns of friction with other `signs` (2, m): of each motor's gear, and of its drive."""
    told, (gear, drive), turns = robot.turns_array, signs, _turns(robot, signs)
    moved = np.linalg.solve(turns, gear[:, None] * told)
    effort = np.linalg.solve(told.T, row.effort.T).T * (gear * drive) @ turns
    q, v, a = zeros + (row.position - zeros) @ moved.T, row.velocity @ moved.T, row.acceleration @ moved.T
    shared = [
        x[:, None] * turns[i]
        for i in robot.shared
        for c, b in [(v @ turns[i], a @ turns[i])]
        for x in (b, c, np.sign(c))
    ]
    own = np.stack([a, v, np.sign(v), np.ones_like(v)], axis=-1)
    return (q, v, a), effort, {"own": own, "shared": np.stack(shared, axis=-1) if shared else None}


def _solved(robot: Robot, rows, signs, zeros, weights, stated: bool = False) -> tuple[np.ndarray, float]:
    """Least squares of all rows, with bodies as `stated` or free: its numbers, and the weighted squares left over."""
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


def _by_segment(robot: Robot, rows, signs, zeros, weights, stated: bool = False) -> np.ndarray:
    """Weighted squares left over in each segment."""
    theta, _ = _solved(robot, rows, signs, zeros, weights, stated)
    squares: dict[int, float] = {}
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        left = ((effort - robot.tree.core.regressor(*motion, **columns) @ theta) ** 2 * row.moving) @ weights
        for segment in np.unique(row.segment[row.segment >= 0]):
            squares[int(segment)] = squares.get(int(segment), 0.0) + float(left[row.segment == segment].sum())
    return np.array([squares[key] for key in sorted(squares)])
