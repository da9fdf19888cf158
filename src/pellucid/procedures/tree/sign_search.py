"""Does a robot's effort fit its motion: does friction take energy at every joint, and is any joint turned around?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion

ROWS = 4000
"""Of all recordings, spread over them, that signs are looked for in."""

GIVES = 0.02
"""Power that friction gives, as a share of a joint's RMS effort times its RMS speed, from which on a sign is wrong."""

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
    """A joint that others' motion fits better with the other sign of position and effort."""

    joint: int
    ratio: float  # Of what its sign leaves over to what the other one does
    sure: bool
    others: tuple[int, ...] = ()  # Joints that do nearly as well in its place: mirror images move alike


def giving(robot: Robot, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Power that friction takes of each joint, as a share of its RMS effort times its RMS speed, shape (m,): negative
    where the effort's sign is wrong against that of the motion."""
    rows = _rows(motions)
    theta, _ = _solved(robot, rows, np.ones(len(robot.names)), np.zeros(len(robot.names)), _weights(rows))
    first = 10 * len(robot.tree.order)
    own = theta[first : first + 4 * len(robot.names)].reshape(-1, 4)
    shares = np.zeros(len(own))
    for k, (_, viscous, dry, _) in enumerate(own):
        v = np.concatenate([row.velocity[row.moving[:, k], k] for row in rows])
        effort = np.concatenate([row.effort[row.moving[:, k], k] for row in rows])
        if len(v):
            size = np.sqrt(np.mean(v * v) * np.mean(effort * effort))
            shares[k] = np.mean(viscous * v * v + dry * np.abs(v)) / size if size else 0.0
    return shares


def turned_around(robot: Robot, motions: Sequence[TreeMotion], zeros: np.ndarray) -> list[TurnedAround]:
    """Joints, the clearest first, that fit better turned around about their `zeros` (m,), one after the other."""
    rows, found = _rows(motions), []
    weights, signs = _weights(rows), np.ones(len(robot.names))
    left = _solved(robot, rows, signs, zeros, weights)[1]
    for _ in robot.names:
        tried = []
        for k in np.flatnonzero(signs > 0.0):
            other = np.where(np.arange(len(signs)) == k, -1.0, signs)
            tried.append((_solved(robot, rows, other, zeros, weights)[1], k, other))
        best, k, other = min(tried, key=lambda one: one[0])
        if left < HINTS * best:
            break
        before, after = (_by_segment(robot, rows, s, zeros, weights) for s in (signs, other))
        sure = left > TELLS * best and float(np.mean(before > after)) >= MOST
        others = tuple(int(i) for one, i, _ in tried if i != k and left - one > NEARLY * (left - best))
        found.append(TurnedAround(int(k), float(left / best), sure, others))
        signs, left = other, best
    return found


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


def _arguments(robot: Robot, row: _Rows, signs: np.ndarray, zeros: np.ndarray):
    """Motion, efforts and columns of friction, joints turned around by `signs`."""
    turns = robot.turns_array
    q, v, a = zeros * (1.0 - signs) + row.position * signs, row.velocity * signs, row.acceleration * signs
    shared = [
        x[:, None] * turns[i]
        for i in robot.shared
        for c, b in [(v @ turns[i], a @ turns[i])]
        for x in (b, c, np.sign(c))
    ]
    own = np.stack([a, v, np.sign(v), np.ones_like(v)], axis=-1)
    return (q, v, a), row.effort * signs, {"own": own, "shared": np.stack(shared, axis=-1) if shared else None}


def _solved(robot: Robot, rows, signs, zeros, weights) -> tuple[np.ndarray, float]:
    """Least squares of all rows: its numbers, and the weighted squares that it leaves over."""
    normal, projected, whole = 0.0, 0.0, 0.0
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        n, p, _ = robot.tree.core.normal_equations(*motion, effort, weight=row.moving * weights, **columns)
        normal, projected = normal + n, projected + p
        whole += float((effort**2 * row.moving * weights).sum())
    size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    seen = values > 1e-9 * values[-1]
    theta = vectors[:, seen] @ ((vectors[:, seen].T @ (projected / size)) / values[seen]) / size
    return theta, whole - float(theta @ projected)


def _by_segment(robot: Robot, rows, signs, zeros, weights) -> np.ndarray:
    """Weighted squares left over in each segment."""
    theta, _ = _solved(robot, rows, signs, zeros, weights)
    squares: dict[int, float] = {}
    for row in rows:
        motion, effort, columns = _arguments(robot, row, signs, zeros)
        left = ((effort - robot.tree.core.regressor(*motion, **columns) @ theta) ** 2 * row.moving) @ weights
        for segment in np.unique(row.segment[row.segment >= 0]):
            squares[int(segment)] = squares.get(int(segment), 0.0) + float(left[row.segment == segment].sum())
    return np.array([squares[key] for key in sorted(squares)])
