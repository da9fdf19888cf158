"""Find efforts that belong to another joint, or that a wrong gear or drive constant scales.

A link's mass and inertia act on every joint before it. Efforts of several joints therefore agree on one set of bodies
only if each belongs to its joint and all have the same scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations

import numpy as np

from ...models.robot import Robot
from ..tree_motion import TreeMotion
from .sign_search import _Rows, _rows, _solve, _weights

MIN_UNEXPLAINED_SHARE = 0.01
"""A mistake is looked for only if at least this share of the efforts' mean square is unexplained."""

SEARCH_ROW_COUNT = 1000
"""Approximate number of rows of each search."""

TRIED_GAINS = np.geomspace(0.25, 4.0, 17)
"""Factors by which a joint's effort is multiplied; the one in the middle is 1."""

MIN_GAIN_DIFFERENCE = 0.15
"""A factor closer to 1 than this share is no mistake in a gear or a drive's constant."""

MIN_RESIDUAL_RATIO = 2.0
"""A mistake is told if the squared residual falls by at least this factor without it."""


@dataclass(frozen=True)
class EffortMixup:
    """A mistake in the efforts of a robot's joints."""

    joints: tuple[int, ...]  # the joint with another scale, or two joints whose efforts are exchanged
    gain: float  # factor that puts the effort right; 1 for exchanged joints
    ratio: float  # squared residual as recorded over that without the mistake


def find_effort_mixup(robot: Robot, motions: Sequence[TreeMotion]) -> EffortMixup | None:
    """Return the mistake that explains the efforts of several joints best; None if none explains them far better."""
    count = len(robot.names)
    if count < 2:
        return None
    rows = _rows(motions)
    step = max(1, sum(len(row.effort) for row in rows) // SEARCH_ROW_COUNT)
    rows = [_Rows(*(getattr(row, each.name)[::step] for each in fields(row))) for row in rows]
    before = _residual(robot, rows)
    if before < MIN_UNEXPLAINED_SHARE * sum(float(row.moving.sum()) for row in rows):
        return None
    tried = []
    for i, k in combinations(range(count), 2):
        order = list(range(count))
        order[i], order[k] = k, i
        swapped = [replace(row, effort=row.effort[:, order]) for row in rows]
        tried.append(EffortMixup((i, k), 1.0, before / max(_residual(robot, swapped), 1e-300)))
    for k in range(count):
        left = np.array([_residual(robot, _scaled(rows, k, gain)) for gain in TRIED_GAINS])
        best = int(np.argmin(left))
        # At an end of the range the effort tells nothing of its scale.
        if 0 < best < len(TRIED_GAINS) - 1 and abs(np.log(TRIED_GAINS[best])) > MIN_GAIN_DIFFERENCE:
            tried.append(EffortMixup((k,), float(TRIED_GAINS[best]), before / max(float(left[best]), 1e-300)))
    found = max(tried, key=lambda each: each.ratio)
    return found if found.ratio > MIN_RESIDUAL_RATIO else None


def _scaled(rows: Sequence[_Rows], joint: int, gain: float) -> list[_Rows]:
    gains = np.ones(rows[0].effort.shape[1])
    gains[joint] = gain
    return [replace(row, effort=row.effort * gains) for row in rows]


def _residual(robot: Robot, rows: Sequence[_Rows]) -> float:
    """Return the squared residual over all joints, each in shares of its own mean square effort."""
    signs, zeros = np.ones((2, len(robot.names))), np.zeros(len(robot.names))
    return _solve(robot, rows, signs, zeros, _weights(rows))[1]
